"""Clauses that refer to other steps, as formulas of one step with memory.

`cells.compile_node` turns a node's clauses into formulas of one step, and the state variables that they read: what each
stores, its initial value and its update at a step. Engines see only first-order terms.
"""

"""Clauses that speak of other steps, as one step with memory.

`cells.compile_node` gives of a node's clauses formulas of one step, and the cells that they read: what each remembers,
how it begins and how a step changes it. Engines see first-order terms and nothing else.
"""

"""A node's own program, asked and judged step by step: what every method needs that looks at the program itself.

`cpython` asks a Python class in isolation; `samples` draws inputs at which something may change; `judging` says
exactly, in the contract's words, what came of a step.
"""

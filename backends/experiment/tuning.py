"""This backend's numbers: how much is read, how far is searched, how much is shown; each with its reason."""

EXPRESSION_LENGTH = 500
"""Characters; a sum of so many terms is still far from Python's recursion limit."""

EXPRESSION_DEPTH = 50
"""Brackets of an expression over columns: its evaluator recurses."""

FAILURES_SHOWN = 20
"""Failing runs that are spelt out."""

FAILURES_KEPT = 200
"""Failing runs that are kept in a record: more than anybody leaves out one by one."""

RUNS = 100_000
"""Of one table: a larger campaign gives its figures, or several tables."""

TABLE_BYTES = 32_000_000
"""Of one table: as many runs of a few hundred characters each."""

HALVINGS = 24
"""In a bisection: bounds are given to better than one part in ten million."""

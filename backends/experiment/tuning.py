"""This backend's numbers: how much is read, how far is searched, how much is shown; each with its reason."""

FAILURES_SHOWN = 20
"""Failing runs that are spelt out."""

FAILURES_KEPT = 200
"""Failing runs that are kept in a record: more than anybody leaves out one by one."""

ROWS = 100_000
"""Of one table: of a larger campaign several tables are made."""

TABLE_BYTES = 32_000_000
"""Of one table: as many rows of a few hundred characters each."""

GRID = 100_000
"""Bounds are multiples of its inverse, rounded up: five decimals are more than any number of runs justifies."""

RUNS_NEEDED = 1_000_000
"""Up to so many runs it is told how many would be enough."""

CASES = 16
"""Choices of a guarantee, and ways to meet one condition, that are told apart. Each is a stratum, which takes its share
of the confidence."""

"""This backend's numbers: limits of reading, search and display; each with its reason."""

FAILURES_SHOWN = 20
"""Failing runs that are named."""

FAILURES_KEPT = 200
"""Failing runs that are kept in a record: more than a plan would leave out one by one."""

ROWS = 100_000
"""Rows of one table: a larger campaign has several tables."""

TABLE_BYTES = 32_000_000
"""Bytes of one table: as many rows of a few hundred characters each."""

GRID = 100_000
"""Bounds are multiples of its inverse, rounded up: five decimals are more than any number of runs justifies."""

RUNS_NEEDED = 1_000_000
"""The sufficient number of runs is reported up to this many."""

CASES = 16
"""Choices of a guarantee, and ways to meet one condition, that are distinguished. Each is a stratum, which takes its
share of the confidence."""

DRAWN_STEPS = 10_000
"""Steps of a distribution in a drawn run: more decimals than a simulator needs."""

SEARCHED_STEPS = 100
"""Steps of a number's range in a search: more make the climb along one parameter longer, fewer miss narrow faults."""

CLIMB_RUNS = 100
"""Runs of one climb, half of them drawn to find its start. For the rover of `docs/examples/rover`, 60 and 150 find its
planted fault more seldom."""

SEARCH_RUNS = 300
"""Runs of a search, unless the command says otherwise."""

SHRINKING_RUNS = 100
"""Runs to simplify a failing one."""

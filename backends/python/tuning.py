"""This backend's numbers, each with its reason."""

VALIDATED = 1000
"""Inputs on which class and translation are compared on every run: a tenth of a second's work."""

APART = 20
"""Cases beside which each REAL input is NaN and infinite, where that is possible."""

BESIDE = 6
"""Inputs, besides its operands, of which it is stated that a rounding does not pass them: a step compares few."""

COMBINED = 10
"""Numbers whose sums and products of two are thresholds on a second try: more would drown the solver."""

UNROLLED = 16
"""Turns of a loop over `range` of a constant that are run one by one, without an invariant: windows of filters."""

INLINED_DEPTH = 8
"""Calls within calls beyond which a step is refused; recursion is reported at once."""

MOST_NAMES = 4_000
"""Names of values in a symbolic run: a step of a hundred lines has some hundreds."""

CANDIDATES = 60
"""Invariants tried of one loop: each is asked about at least twice."""

CANDIDATE_SECONDS = 0.4
"""Seconds' worth of effort for one question whether an invariant lasts: most are settled in a hundredth."""

ROUNDS = 12
"""Rounds in which candidates are dropped; each drops one at least, and mostly two or three do."""

SHOWN_SECONDS = 2.0
"""Seconds' worth of effort for the solver to show values where a proof fails."""

RUN_SECONDS = 30.0
"""For the class to answer all inputs, by the clock."""

"""This backend's numbers, each with its reason."""

NETWORK_BYTES = 64_000_000
"""Bytes of a network: one of the most weights takes a sixteenth of it; more would be no use to a solver."""

WEIGHTS = 1_000_000
"""Weights, counted once for each use: a pass of interval bounds over so many takes a second."""

CASES = 256
"""Cases of a denied guarantee: each is a file, and a question to the solver."""

SAMPLES = 1_000
"""Points at which the network runs before a proof of one guarantee: half a second, with their judgement."""

MARGIN = 1e-4
"""How far a solver's second counterexample lies inside of each strict inequality, relative to its bound: well above the
solver's tolerance (1e-6) and the rounding of float32 (6e-8)."""

ALIKE = 1e-3
"""The greatest difference between onnxruntime and the network as read, as a share of 1 plus the value, at which a proof
counts: rounding in float32 makes some 1e-6."""

ROUNDS = 3
"""How often each constraint on inputs tightens their box: as many as a chain of comparisons has links. Marabou may take
a minute for what this excludes at once."""

CELLS = 500
"""Cells of a box in which slopes are bounded, before a case of two steps is left: some seconds, if the network has a
thousand weights."""

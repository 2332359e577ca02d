"""This backend's numbers, each with its reason."""

RUNS = 20_000
"""The default number of libFuzzer's runs: a few seconds, and a hundred times as many as the known mutants needed."""

STEPS = 12
"""The default limit on steps of one run: a count to ten, or two delays, end within them."""

SEEDS = 400
"""Runs drawn before libFuzzer begins, judged like those that it keeps: most of them contain thresholds."""

UNGUIDED = 4_000
"""Runs drawn without libFuzzer: ten times as many, as none is guided by coverage."""

SEED_BYTES = (8, 24, 64, 160)
"""Their lengths: one step of a few numbers, up to several of many."""

LONGEST_RUN = 1536
"""Bytes of a run at most: twelve steps of a long sequence."""

MOST_JUDGED = 6_000
"""Kept runs that are judged, the shortest first: judging more would take longer than fuzzing."""

BUILD_SECONDS = 120.0
"""Seconds for one build by clang: it takes two, on a loaded machine many more."""

FIRST_BUILD_SECONDS = 300.0
"""Seconds for one build by the wheel's compiler, whose first run builds the standard library: a minute of processor
time, which the method's `seconds` do not count."""

BUILD_MEGABYTES = 8_192
"""Clang's address space, which is far more than the memory that it uses."""

HANGS = 20
"""Seconds of one run beyond which libFuzzer calls it a hang: a step takes microseconds."""

RESIDENT = 2_048
"""Megabytes beyond which libFuzzer calls a run too large."""

SHORTENED = 60
"""Steps removed one by one from a run that violates a guarantee: more than a run has."""

APART = 4
"""Steps in which each REAL input is set to NaN and infinite: a fault there rarely depends on other inputs."""

SWEPT = 600
"""Runs of one step, at each threshold in turn, before any drawn one."""

WRITTEN = 60
"""Constants of contract, parameters and source that are drawn, with their neighbours: a byte distinguishes them."""

DRAWN_TOGETHER = 500
"""Runs whose inputs are drawn in one request: a few megabytes of text for long sequences."""

MOST_CRASHES = 3
"""Runs that end the plain program, after which no more are run: each costs a new process, and one refutes."""

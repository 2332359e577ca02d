"""This backend's numbers, each with its reason."""

RUNS = 20_000
"""Runs of libFuzzer where the plan says nothing: a few seconds, and a hundred times what the known mutants needed."""

STEPS = 12
"""Steps of one run at most, where the plan says nothing: what counts to ten, or waits twice, comes to its end."""

SEEDS = 400
"""Runs drawn before libFuzzer begins, which are judged like those that it keeps: thresholds are in most of them."""

UNGUIDED = 4_000
"""Runs drawn where libFuzzer is not here: ten times as many, as none is led on by what it reached."""

SEED_BYTES = (8, 24, 64, 160)
"""Their lengths: one step of a few numbers, up to several of many."""

LONGEST_RUN = 1536
"""Bytes of a run at most: twelve steps of a long sequence."""

MOST_JUDGED = 6_000
"""Kept runs that are judged, the shortest first: beyond, judging would take longer than fuzzing."""

BUILD_SECONDS = 120.0
"""For one build by clang: two seconds, on a loaded machine many more."""

BUILD_MEGABYTES = 8_192
"""For clang's address space, which is far more than the memory that it uses."""

HANGS = 20
"""Seconds of one run beyond which libFuzzer calls it a hang: a step takes microseconds."""

RESIDENT = 2_048
"""Megabytes beyond which libFuzzer calls a run too large."""

SHORTENED = 60
"""Steps that are left out one by one of a run that breaks a guarantee: more than a run has."""

APART = 4
"""Steps beside which each REAL input is NaN and infinite: a fault there rarely depends on other inputs."""

SWEPT = 600
"""Runs of one step, at each threshold in its turn, before any drawn one."""

WRITTEN = 60
"""Constants of contract, parameters and source that are drawn from, with what lies beside them: a byte tells them
apart."""

REMEMBERED = 16
"""Numbers of a run from which later ones are drawn; the harness has as many (`native/avow_drawn.hpp`)."""

MOST_CRASHES = 3
"""Runs that end the plain program, after which no more are asked: each costs a new process, and one refutes."""

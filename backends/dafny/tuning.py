"""This backend's numbers: how much is read, how far is searched, how much is shown; each with its reason."""

PROGRAM_BYTES = 2_000_000
"""A larger file is no program that Dafny would verify in useful time."""

VALUES_SHOWN = 3
"""Values of a candidate that a reason tells: more fit in no sentence."""

PROBLEMS_SHOWN = 6
"""Of Dafny's complaints in a reason; its log has all."""

MODEL_CHARACTERS = 4_000_000
"""Of a counterexample's model, so that one without end fills no memory."""

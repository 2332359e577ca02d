"""This backend's numbers: limits of reading, search and display; each with its reason."""

PROGRAM_BYTES = 2_000_000
"""A larger file is not a program that Dafny would verify in useful time."""

VALUES_SHOWN = 3
"""Values of a candidate in a reason: more do not fit in a sentence."""

PROBLEMS_SHOWN = 6
"""The number of Dafny's complaints in a reason; its log has all."""

MODEL_CHARACTERS = 4_000_000
"""Characters of a counterexample's model, so that an endless one does not fill the memory."""

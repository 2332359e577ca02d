"""This backend's numbers: limits of reading, search and display; each with its reason."""

PROGRAM_BYTES = 2_000_000
"""A larger file is not a program that Dafny would verify in useful time."""

PROBLEMS_SHOWN = 6
"""The number of Dafny's complaints in a reason; its log has all."""

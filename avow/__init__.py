"""Avow: contracts in, evidence out."""

__version__ = "0.1.0"

import sys

from avow.base.module_path import keep_z3

keep_z3()
sys.setrecursionlimit(max(10_000, sys.getrecursionlimit()))  # a long program's verification condition is a deep formula

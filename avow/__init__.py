"""Avow: contracts in, evidence out."""

__version__ = "0.1.0"

from avow.base.module_path import keep_z3

keep_z3()

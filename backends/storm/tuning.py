"""This backend's numbers, each with its reason."""

MODEL_BYTES = 1_000_000
"""Bytes of a model: one with more is generated, and has more states than can be checked."""

STATES_SHOWN = 20
"""Steps of a counterexample: a person reads no longer run."""

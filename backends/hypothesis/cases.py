"""Cases in the contract's words, and as they are sent and kept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from avow.formulas.values import Value, show

from .convention import sent
from .exchange import Pairs
from .generate import Inputs

Case = tuple[Inputs, dict[str, Value]]


def valuation(inputs: Inputs, found: Mapping[str, Value]) -> dict[str, Value]:
    """Qualified names to values."""
    return {f"in.{n}": v for n, v in inputs.items()} | {f"out.{n}": v for n, v in found.items()}


def told(inputs: Inputs, found: Mapping[str, Value]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in pairs(inputs, found))


def pairs(inputs: Inputs, found: Mapping[str, Value]) -> Pairs:
    return tuple((name, show(value)) for name, value in valuation(inputs, found).items())


def asked_with(inputs: Inputs, name: str, word: str) -> Pairs:
    """The inputs, of which one is what the word says."""
    return tuple((n, word if n == f"in.{name}" else value) for n, value in pairs(inputs, {}))


def sent_inputs(inputs: Inputs) -> dict[str, Any]:
    return {name: sent(value) for name, value in inputs.items()}

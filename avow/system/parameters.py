"""The parameters that a node's source is made with: a YAML file that every reader takes in the same way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import read_regular
from avow.system.paths import inside
from avow.system.plan import Source
from avow.system.strict_yaml import read_yaml


def parameters(root: Path, source: Source) -> tuple[Mapping[str, Any], tuple[Diagnostic, ...]]:
    """What the class is made with. A YAML that another reader may take otherwise is refused."""
    if not source.parameters:
        return {}, ()
    place, path = source.place.at("source", "parameters"), inside(root, source.parameters)
    try:
        assert path is not None
        data = read_regular(path)
        piece, faults = read_yaml(data, str(path))
        loaded = yaml.safe_load(data)
    except Rejected as rejected:
        return {}, rejected.diagnostics
    except (OSError, AssertionError, ValueError, yaml.YAMLError, RecursionError) as error:
        return {}, (Diagnostic("PLAN130", f"`{source.parameters}` cannot be read: {error}", place),)
    if faults:
        return {}, faults
    if not isinstance(loaded, dict):
        return {}, (Diagnostic("PLAN130", f"`{source.parameters}` is no mapping", place),)
    wrong = tuple(
        Diagnostic("PLAN130", f"`{source.parameters}`: {why}", place) for why in _unclear(piece.data, loaded, "")
    )
    return loaded, wrong


def _unclear(strict: Any, loaded: Any, where: str) -> Iterator[str]:
    """Where YAML's own reader takes a text otherwise than it looks, or has what no parameter is."""
    if isinstance(loaded, dict):
        if not isinstance(strict, dict) or set(strict) != set(loaded):
            yield f"{where or 'the mapping'} has keys that are no plain texts"
            return
        for key, value in loaded.items():
            yield from _unclear(strict[key], value, f"{where}.{key}" if where else key)
    elif isinstance(loaded, bool | int | float | str):
        if isinstance(loaded, float) and not math.isfinite(loaded):
            yield f"{where} is {loaded}, which is no REAL"
        elif type(strict) is not type(loaded) and not (type(strict) is int and type(loaded) is float):
            yield f"{where} is read as {loaded!r} by some, and as {strict!r} by others: write it in quotes, or plainly"
        elif strict != loaded:
            yield f"{where} is read as {loaded!r} by some, and as {strict!r} by others"
    elif loaded is not None or strict is not None:
        yield f"{where} is a {type(loaded).__name__}; numbers, truth values, texts and mappings of them are parameters"

"""Whatever is read as a dataclass is read strictly: a fault that is put into what was written is told, with its
place, or what was read is what stands there."""

from __future__ import annotations

import json
import re
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import StrEnum
from typing import Any

import pytest
from core.test_codec import Outer

from avow.backends.fuzz import runner
from avow.backends.hypothesis import exchange
from avow.base.codec import Foreign, Unreadable, canonical, from_json, from_text, to_json
from avow.base.tools import _Digest
from avow.cli.recheck import _Report
from avow.evidence.envelope import _Envelope
from avow.evidence.heads import Line
from avow.fretish.project import _Export
from avow.isolation.judge import _Word
from avow.kernel.certificate import Certificate
from avow.lsp.background import _Wanted
from avow.pipeline.assess import Rendering, _Overview
from avow.pipeline.check import Checked
from avow.pipeline.export import Stamp
from avow.pipeline.shortcut import _Settled
from avow.pipeline.workload import Listing

KINDS: list[Any] = [
    exchange.Answer,
    runner.Question,
    runner.Campaigned,
    runner.Answered,
    runner.Shown,
]
KINDS += [_Wanted, Line, _Word, Certificate, Checked, _Settled, Stamp, Rendering, _Overview, Listing]
KINDS += [_Digest, _Report, _Export, _Envelope, Outer]


def sample(kind: Any) -> Any:
    """Of each type the last in a union that is no None, one item of a list, and the first word of an enumeration."""
    origin, given = typing.get_origin(kind), typing.get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        hints = typing.get_type_hints(kind)
        return kind(**{f.name: sample(hints[f.name]) for f in fields(kind)})
    if isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields"):
        hints = typing.get_type_hints(kind)
        return kind(*(sample(hints[name]) for name in kind._fields))
    if origin is types.UnionType:
        return sample(next(one for one in reversed(given) if one is not type(None)))
    if origin is tuple:
        return tuple(sample(one) for one in given if one is not Ellipsis)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {"key": sample(given[1])}
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return next(iter(kind))
    return {str: "text", bytes: b"x", int: 7, bool: True, float: 0.5}.get(kind, {"any": [1]})


def objects(data: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Every place in plain data, but within what may be anything."""
    yield at, data
    if data != {"any": [1]}:
        for key, item in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
            yield from objects(item, (*at, key))


def changed(data: Any, at: tuple[Any, ...], change: Callable[[Any], Any]) -> Any:
    if not at:
        return change(data)
    copy = dict(data) if isinstance(data, dict) else list(data)
    copy[at[0]] = changed(data[at[0]], at[1:], change)
    return copy


def without(data: Any, at: tuple[Any, ...]) -> Any:
    return changed(data, at[:-1], lambda part: {k: v for k, v in part.items() if k != at[-1]})


def read(kind: Any, data: Any) -> str:
    """What was read, as it is written again; empty where it is refused, with the place."""
    try:
        found = from_json(kind, data)
    except Unreadable as error:
        told = str(error)
    else:
        return canonical(to_json(found))
    assert told.startswith(kind.__name__.strip("_").lower())
    return ""


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind.__module__.rpartition('.')[2]}.{kind.__name__}")
def test_a_fault_is_told(kind: Any) -> None:
    whole = json.loads(canonical(to_json(sample(kind))))
    assert read(kind, whole) == canonical(whole)
    for at, part in objects(whole):
        if part == {"any": [1]}:
            continue
        for wrong in (None, True, 3, 2.5, "odd", [], {}, [[]], {"odd": 1}):
            data = changed(whole, at, lambda _, wrong=wrong: wrong)
            same = {"", canonical(data)} | ({canonical(changed(data, at, float))} if wrong == 3 and at else set())
            if not wrong and at and isinstance(at[-1], str):  # what is empty may not be written
                same.add(canonical(without(whole, at)))
            assert read(kind, data) in same, (at, wrong)
        if isinstance(part, dict):
            for key in part:
                data = without(whole, (*at, key))
                found = read(kind, data)
                assert found in ("", canonical(data)) or issubclass(kind, Foreign), (at, key)
            passed_over = canonical(whole) if issubclass(kind, Foreign) else ""
            data = changed(whole, at, lambda part: {**part, "odd": part.get("key", 1)})
            assert read(kind, data) in ("", canonical(data) if "key" in part else passed_over), at


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind.__module__.rpartition('.')[2]}.{kind.__name__}")
def test_no_text_makes_a_reader_fail_otherwise(kind: Any) -> None:
    """What no two readers of JSON take alike is refused; half a character is what stands there, and is kept."""
    text = canonical(to_json(sample(kind)))
    first = text[1:].split(":", 1)[0]
    bad = [f"{{{first}:1,{text[1:]}", "[" * 100_000, text[:-1], f"{text}x", "", "\xff", f"[{text}]"]
    for place in (n for n, sign in enumerate(text) if sign in ":[" and text[n + 1] not in "]"):
        end = min(k for k in range(place + 1, len(text)) if text[k] in ",]}" or k == len(text) - 1)
        bad += [text[: place + 1] + odd + text[end:] for odd in ("NaN", "-Infinity", "9" * 5000)]
    for one in (*bad, text.encode("utf-16"), b"\xff" + text.encode()):
        with pytest.raises(Unreadable):
            from_text(kind, one)
    halves = re.sub('"text"(?!:)', r'"\\ud800"', text)
    assert canonical(to_json(from_text(kind, halves))) == halves

"""`report --check` against random edits of every file of a report: all of them are found."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from assurance.sample import case, rover_parts
from helpers import every_text

from avow.evidence.ledger import Ledger
from avow.pipeline import report_check as module
from avow.pipeline.report_check import check
from avow.report import render_all


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("random")
    subject, obligations, records, keys, extras = rover_parts()
    Ledger(root / "rover.jsonl").append_all(records)
    render_all(case(subject, obligations, records, keys=keys, **extras), root / "report")
    return root


def leaves(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if isinstance(value, dict):
        for name, item in value.items():
            yield from leaves(item, (*path, name))
    elif isinstance(value, list):
        if value:
            yield path
        for at, item in enumerate(value):
            yield from leaves(item, (*path, at))
    else:
        yield path


def other(value: Any, rng: random.Random) -> Any:
    match value:
        case bool():
            return not value
        case int() | float():
            return value + rng.choice([1, -1, 10])
        case str() if value:
            at = rng.randrange(len(value))
            return value[:at] + rng.choice("xq07") + value[at + rng.randrange(2) :]
        case list():
            return value[:-1] if rng.random() < 0.5 else [*value, value[-1]]
        case _:
            return "x"


def change_json(text: str, rng: random.Random) -> str:
    data = json.loads(text)
    path = rng.choice(list(leaves(data)))
    target = data
    for step in path[:-1]:
        target = target[step]
    old = target[path[-1]]
    new = other(old, rng)
    target[path[-1]] = new
    return text if new == old else json.dumps(data)


def change_bytes(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    match rng.randrange(4):
        case 0:
            return data[:at] + bytes([data[at] ^ (1 << rng.randrange(8))]) + data[at + 1 :]
        case 1:
            return data[:at] + data[at + rng.randrange(1, 40) :]
        case 2:
            return data[:at] + b"proved" + data[at:]
        case _:
            return data[:at]


def hunt(place: Path, times: int, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The edits that were not found."""
    rendered: dict[str, list[Any]] = {}

    def once(found: Any) -> list[Any]:  # the same case renders to the same bytes: there is a test for that
        mark = repr(found)
        if mark not in rendered:
            rendered.clear()
            rendered[mark] = list(every_text(found))
        return rendered[mark]

    monkeypatch.setattr(module, "formats", once)
    whole = module._formats
    missed = []
    files = sorted(p for p in (place / "report").iterdir())
    for seed in range(times):
        rng = random.Random(seed)
        path = place / "report/report.json" if rng.random() < 0.4 else rng.choice(files)
        before = path.read_bytes()
        after = change_bytes(before, rng)
        is_json = path.name == "report.json" and rng.random() < 0.85
        if is_json:
            after = change_json(before.decode(), rng).encode()
        if after == before:
            continue
        path.write_bytes(after)
        if is_json:  # rendering is the slow part; only what the rest does not find needs it
            monkeypatch.setattr(module, "_formats", lambda *_: ())
        try:
            found = check(place / "report", Ledger(place / "rover.jsonl"))
            if not found and is_json:
                monkeypatch.setattr(module, "_formats", whole)
                found = check(place / "report", Ledger(place / "rover.jsonl"))
        finally:
            monkeypatch.setattr(module, "_formats", whole)
            path.write_bytes(before)
        if not found:
            missed.append(f"seed {seed}: {path.name}")
    return missed


@pytest.mark.nightly
def test_random_edits_are_found(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert hunt(place, 60, monkeypatch) == []


@pytest.mark.nightly
def test_a_thousand_random_edits_are_found(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert hunt(place, 1000, monkeypatch) == []

"""Long runs of the rover: no false alarm where nothing is wrong; planted faults at their events, on the right party."""

from __future__ import annotations

import gc
import itertools
import json
from collections.abc import Iterable
from pathlib import Path
from types import BuiltinFunctionType, FunctionType, ModuleType

import pytest

from avow.backends.rosmonitoring.session import session
from avow.system.plan import System
from rosmonitoring.missions import Event, mission


def lines(path: Path, events: Iterable[Event]) -> Path:
    with path.open("w", encoding="utf-8") as file:
        file.writelines(json.dumps(event) + "\n" for event in events)
    return path


@pytest.mark.parametrize("count", [20_000, pytest.param(1_000_000, marks=pytest.mark.nightly)])
def test_no_false_alarm(count: int, case: System, tmp_path: Path) -> None:
    running = session(case)
    assert list(running.run(lines(tmp_path / "t.jsonl", itertools.islice(mission(count), count)))) == []
    assert running.events == count
    judged = {f"{m.setup.node.name}.{name}": tally.judged for m, name, _, tally in running.clauses()}
    assert min(judged.values()) > 0
    assert judged["radiationSensor.low"] > count // 5


def reachable(root: object) -> int:
    """The number of objects that hang on one, without code: what is shared by all runs does not count."""
    seen: dict[int, object] = {}
    left = [root]
    while left:
        one = left.pop()
        if id(one) not in seen and not isinstance(one, ModuleType | FunctionType | BuiltinFunctionType | type):
            seen[id(one)] = one
            left += gc.get_referents(one)
    return len(seen)


def test_what_a_session_keeps_does_not_grow_with_the_trace(case: System, tmp_path: Path) -> None:
    kept = []
    for count in (10_000, 40_000):
        running = session(case)
        assert list(running.run(lines(tmp_path / "t.jsonl", itertools.islice(mission(count), count)))) == []
        assert running.events == count
        kept.append(reachable(running))
    assert kept[1] < 1.01 * kept[0]

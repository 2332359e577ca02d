"""Long runs of the rover: no false alarm where nothing is wrong; planted faults at their events, on the right party."""

from __future__ import annotations

import gc
import itertools
import json
from collections.abc import Callable, Iterable
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


def wrong_level(event: Event) -> Event | None:
    return {**event, "level": "orange"} if event["topic"] == "radiationStatus" and event["level"] == "green" else None


def wrong_command(event: Event) -> Event | None:
    stays = {**event, "command": "inspect", "id": 3}
    return stays if event["topic"] == "command" and event["id"] == 0 and event["time"] > 100 else None


def wrong_phase(event: Event) -> Event | None:
    return {**event, "phase": "exploring"} if event["topic"] == "phase" and event["phase"] == "leaving" else None


def wrong_mark(event: Event) -> Event | None:
    return {**event, "id": 9} if event["topic"] == "inspected" and event["id"] == 4 else None


def negative(event: Event) -> Event | None:
    return {**event, "radiation": -0.001} if event["topic"] == "r" else None


def off(event: Event) -> Event | None:
    return {**event, "posX": event["posX"] + 3.5} if event["topic"] == "at" and event["time"] > 20 else None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "told"),
    [
        (wrong_level, "guarantee broken: this node: radiationSensor.low"),
        (wrong_command, "guarantee broken: this node: agent."),
        (wrong_phase, "guarantee broken: this node: agent."),
        (wrong_mark, "guarantee broken: this node: radiationSensor.marks_inspected"),
        (negative, "assumption broken: environment: radiationSensor.reading"),
        (off, "guarantee broken: this node: navigation.arrives"),
    ],
)
def test_a_planted_fault_is_found_at_its_event(
    change: Callable[[Event], Event | None], told: str, case: System, tmp_path: Path
) -> None:
    events = list(mission(30_000))
    places = [at for at, event in enumerate(events) if at > 300 and change(event) is not None]
    for at in {places[0], places[len(places) // 2], places[-1]}:
        changed = change(events[at])
        assert changed is not None
        path = lines(tmp_path / "t.jsonl", [*events[:at], changed, *events[at + 1 :]])
        found = list(session(case).run(path))
        assert found[0][0] == found[0][1].index == at + 1
        assert any(told in violation.text() for line, violation in found if line == at + 1)

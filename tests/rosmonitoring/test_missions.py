"""Long runs of the rover: no false alarm where nothing is wrong; planted faults at their events, on the right party."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterable
from pathlib import Path

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


@pytest.mark.slow
def test_ten_million_events_would_take_no_more_memory(case: System, tmp_path: Path) -> None:
    """What is kept does not grow with the trace."""
    import tracemalloc

    sizes = []
    for count in (60_000, 180_000):
        path = lines(tmp_path / f"{count}.jsonl", mission(count))
        running = session(case)
        tracemalloc.start()
        list(running.run(path))
        sizes.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert sizes[1] < 1.2 * sizes[0]


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

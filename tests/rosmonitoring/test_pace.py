"""Deadlines, rates, losses, ages: judged by time, and shown; too old, lost or silent is no evidence."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring.backend import RosMonitoringBackend
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.base.verdict import Outcome, Verdict
from avow.system.plan import System
from rosmonitoring.conftest import job_for

RCL = """
node n {
  inputs( r : REAL )
  outputs( s : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 s matches(out.s) )
  guarantee copies ( out.s == in.r )
}
"""
MAPPING = {"in.r": "data", "out.s": "data"}
Event = dict[str, Any]


def ticks(topic: str, start: float, stop: float, period: float) -> Iterator[Event]:
    count = round((stop - start) / period)
    for k in range(count):
        yield {"topic": topic, "time": round(start + k * period, 4), "data": 1.0, "header": {"seq": k + 1}}


def merged(*streams: Iterator[Event]) -> list[Event]:
    return sorted((event for stream in streams for event in stream), key=lambda event: (event["time"], event["topic"]))


def judged(make: Callable[..., System], events: list[Event], tmp_path: Path, **options: Any) -> list[Violation]:
    path = tmp_path / "t.jsonl"
    path.write_text("".join(json.dumps(event) + "\n" for event in events), encoding="utf-8")
    return [violation for _, violation in session(make(RCL, MAPPING, **options)).run(path)]


def evidence(make: Callable[..., System], events: list[Event], **options: Any) -> Outcome:
    system = make(RCL, MAPPING, traces=["t.jsonl"], **options)
    text = "".join(json.dumps(event) + "\n" for event in events)
    (system.plan.root / "t.jsonl").write_text(text, encoding="utf-8")
    report = RosMonitoringBackend().discharge(job_for(system, "n"), system.plan.root, Limits(30))
    return report.outcomes[0]


RATE = {"rate": {"in.r": "10 Hz ± 20 %"}}


def test_a_right_rate_is_not_complained_of(make_system: Callable[..., System], tmp_path: Path) -> None:
    for period in (0.1, 0.085, 0.124):
        events = merged(ticks("r", 0, 20, period), ticks("s", 0.01, 20, 0.5))
        assert judged(make_system, events, tmp_path, **RATE) == []


def test_one_late_message_is_no_other_rate(make_system: Callable[..., System], tmp_path: Path) -> None:
    events = [e for e in ticks("r", 0, 10, 0.1) if e["time"] != 5.0]
    assert judged(make_system, events, tmp_path, **RATE) == []


@pytest.mark.parametrize(("period", "words"), [(0.2, "too slow"), (0.05, "too fast"), (0.127, "too slow")])
def test_a_wrong_rate_is_told_once(
    period: float, words: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    events = merged(ticks("r", 0, 20, period), ticks("s", 0.01, 20, 0.5))
    (found,) = judged(make_system, events, tmp_path, **RATE)
    assert found.fault is Fault.RATE
    assert words in found.explanation
    assert "10 Hz ± 20 % is allowed" in found.explanation


def test_a_sensor_that_stops_is_told_when_its_deadline_passes(
    make_system: Callable[..., System], tmp_path: Path
) -> None:
    """By the other topics' events; the last message came at 4.9, and ten take at most 1.25 s."""
    events = merged(ticks("r", 0, 5, 0.1), ticks("s", 0.01, 20, 0.05))
    (slow,) = judged(make_system, events, tmp_path, **RATE)
    assert float(slow.time) == pytest.approx(4.0 + 1.25, abs=0.06)
    (silent,) = judged(make_system, events, tmp_path, fresh={"in.r": "300 ms"})
    assert silent.fault is Fault.SILENT
    assert float(silent.time) == pytest.approx(5.2, abs=0.06)


def test_a_sensor_that_never_speaks_is_told(make_system: Callable[..., System], tmp_path: Path) -> None:
    events = list(ticks("s", 7, 20, 0.05))
    for options, at in ((RATE, 8.25), ({"fresh": {"in.r": "300 ms"}}, 7.3)):
        (found,) = judged(make_system, events, tmp_path, **options)
        assert float(found.time) == pytest.approx(at, abs=0.06)


def test_a_sensor_that_stops_before_the_end_is_told_by_the_last_event(
    make_system: Callable[..., System], tmp_path: Path
) -> None:
    events = [*ticks("r", 0, 5, 0.1), {"topic": "s", "time": 6.0, "data": 1.0}]
    (found,) = judged(make_system, events, tmp_path, fresh={"in.r": "300 ms"})
    assert found.index == len(events)


def test_losses_and_disorder_are_counted(make_system: Callable[..., System], tmp_path: Path) -> None:
    events = merged(ticks("r", 0, 10, 0.1), ticks("s", 0.01, 10, 0.1))
    kept = [e for e in events if not (e["topic"] == "r" and 3 <= e["time"] < 3.65)]
    swapped = [*kept[:120], kept[121], kept[120], *kept[122:]]
    path = tmp_path / "t.jsonl"
    path.write_text("".join(json.dumps(event) + "\n" for event in swapped), encoding="utf-8")
    running = session(make_system(RCL, MAPPING))
    list(running.run(path))
    assert running.summary()["nodes"][0]["topics"] == {
        "r": {"lost": 7, "out_of_order": 0},
        "s": {"lost": 0, "out_of_order": 0},
    }


def test_how_old_the_inputs_were_is_in_the_evidence(make_system: Callable[..., System]) -> None:
    events = [
        e for e in merged(ticks("r", 0, 10, 0.1), ticks("s", 0.01, 10, 0.1)) if e["topic"] == "s" or e["time"] < 9
    ]
    found = evidence(make_system, events)
    assert found.verdict is Verdict.MONITORED
    assert found.bound["oldest"] == {"in.r": 1.01}
    assert found.bound["lost"] == 0
    assert "inputs at most 1.01 s old (in.r)" in found.summary


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"max_age": "500 ms"}, "in.r was 1.01 s old when an answer came: too old"),
        ({"fresh": {"in.r": "500 ms"}}, "in.r was silent for"),
        (RATE, "in.r is too slow"),
        ({"losses": 0}, ""),
    ],
)
def test_what_is_too_old_or_silent_is_no_evidence(
    options: dict[str, Any], words: str, make_system: Callable[..., System]
) -> None:
    events = merged(ticks("r", 0, 9, 0.1), ticks("s", 0.01, 12 if options == RATE else 10, 0.1))
    found = evidence(make_system, events, **options)
    assert found.verdict is (Verdict.UNKNOWN if words else Verdict.MONITORED), found.summary
    assert words in found.summary


def test_losses_beyond_what_is_allowed_are_no_evidence(make_system: Callable[..., System]) -> None:
    events = [e for e in merged(ticks("r", 0, 9, 0.1), ticks("s", 0.01, 9, 0.1)) if e["time"] not in (3.0, 4.0)]
    assert evidence(make_system, events, losses=2).verdict is Verdict.MONITORED
    assert "2 messages were lost, and 1 may be" in evidence(make_system, events, losses=1).summary
    for event in events:
        event.pop("header")
    assert "have no numbers" in evidence(make_system, events, losses=1).summary


@pytest.mark.parametrize("answers", [{}, {"answers": {"by": "key", "input": "k", "output": "k"}}])
@pytest.mark.parametrize(
    ("mark", "topic", "time", "verdict", "words"),
    [
        ("_lost", "r", 2.55, Verdict.UNKNOWN, "not all was heard: 3 samples lost"),
        ("_lost", "s", 9.0, Verdict.UNKNOWN, "not all was heard: 3 samples lost"),
        ("_lost", "other", 2.55, Verdict.MONITORED, "held"),
        ("_gone", "r", 9.0, Verdict.MONITORED, "held"),
    ],
)
def test_messages_that_were_not_heard_are_no_evidence(
    mark: str, topic: str, time: float, verdict: Verdict, words: str, answers: dict[str, Any],
    make_system: Callable[..., System], tmp_path: Path,
) -> None:  # fmt: skip
    """However many messages came before and after, in the order of which the batch is judged."""
    events = [{**e, "k": k // 2} for k, e in enumerate(merged(ticks("r", 0, 9, 0.1), ticks("s", 0.01, 9, 0.1)))]
    at = sum(event["time"] < time for event in events)
    events.insert(at, {"topic": topic, "time": time, mark: "3 samples lost"})
    found = evidence(make_system, events, **answers)
    assert (found.verdict, words in found.summary) == (verdict, True), found.summary
    (tmp_path / "t.jsonl").write_text("".join(json.dumps(event) + "\n" for event in events), encoding="utf-8")
    running = session(make_system(RCL, MAPPING, **answers))
    assert list(running.run(tmp_path / "t.jsonl")) == []
    assert ("n.copies" in running.unmonitored()) is (verdict is Verdict.UNKNOWN)


def test_values_are_unknown_once_nobody_publishes_them(make_system: Callable[..., System]) -> None:
    """The node goes on answering, and nothing says what."""
    events = merged(ticks("r", 0, 3, 0.1), ticks("s", 0.01, 4, 0.1))
    assert evidence(make_system, events).verdict is Verdict.MONITORED
    at = sum(event["time"] < 3 for event in events)
    gone = {"topic": "r", "time": 2.99, "_gone": "no writer of r is left"}
    found = evidence(make_system, [*events[:at], gone, *events[at:]])
    assert found.verdict is Verdict.UNKNOWN
    assert "30 of 40 publications were decided" in found.summary


def test_a_step_that_was_not_heard_is_no_step_before(make_system: Callable[..., System], tmp_path: Path) -> None:
    rcl = RCL.replace("out.s == in.r", "out.s <= previous(out.s, 9) + 1")
    path, events = tmp_path / "t.jsonl", list(ticks("s", 0, 1, 0.1))
    for k, event in enumerate(events):
        event["data"] = 1.0 if k < 5 else 3.0
    for more, count in (([], 1), ([{"topic": "s", "time": 0.45, "_lost": "some"}], 0)):
        path.write_text("".join(json.dumps(event) + "\n" for event in [*events[:5], *more, *events[5:]]), "utf-8")
        assert len([*session(make_system(rcl, MAPPING)).run(path)]) == count


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ([0] * 8, "do not rise"),
        ([1, None, None, None, None, None, None, None], "have no numbers"),
        ([1, 2, 3, 1, 2, 3, 4, 5], "do not rise"),
        ([1, 1, 2, 2, 3, 3, 4, 4], "do not rise"),
        ([5, 6, 7, 8, 9, 10, 11, 12], ""),
    ],
)
def test_losses_that_no_number_would_show_are_unknown(
    numbers: list[int | None], words: str, make_system: Callable[..., System]
) -> None:
    events: list[Event] = []
    for at, number in enumerate(numbers):
        one: Event = {"topic": "r", "time": at, "data": 1.0}
        events.append({**one, "header": {"seq": number}} if number is not None else one)
        events.append({"topic": "s", "time": at + 0.1, "data": 1.0, "header": {"seq": at}})
    found = evidence(make_system, events, losses=0)
    assert found.verdict is (Verdict.UNKNOWN if words else Verdict.MONITORED)
    assert words in found.summary
    assert ("lost" in found.bound) is (not words)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("by", ["key", "stamp", "order", "latency"])
def test_the_age_is_that_of_the_input_which_was_answered(
    by: str, seed: int, make_system: Callable[..., System]
) -> None:
    rng = random.Random(seed)
    own = {"input": "id", "output": "id"}
    answers: dict[str, Any] = {"by": by, "because": "so", **(own if by in ("key", "stamp") else {})}
    if by == "latency":
        answers = {"latency": "5 s", "jitter": "5 s", "because": "so"}
    heard = [Fraction(at) + Fraction(rng.randrange(10), 10) for at in range(0, 60, 2)]
    late = [at + Fraction(rng.randrange(1, 60), 10) for at in heard]
    if by == "order":
        late = sorted(late)
    events = [{"topic": "r", "time": float(at), "data": 1.0, "id": k} for k, at in enumerate(heard)]
    events += [{"topic": "s", "time": float(at), "data": 1.0, "id": k} for k, at in enumerate(late)]
    events.sort(key=lambda event: event["time"])
    found = evidence(make_system, events, answers=answers, decided=0.5, max_age="100 s")
    assert found.verdict is Verdict.MONITORED, found.summary
    oldest = max(answered - at for at, answered in zip(heard, late, strict=True))
    if by == "latency":  # nobody knows which it was: the oldest that it may have been
        assert found.bound["oldest"]["in.r"] >= 5
        return
    assert found.bound["oldest"]["in.r"] == pytest.approx(float(oldest))
    too_old = evidence(make_system, events, answers=answers, max_age=f"{float(oldest) - 0.01} s")
    assert too_old.verdict is Verdict.UNKNOWN
    assert "too old" in too_old.summary


@pytest.mark.parametrize("rate", ["0 Hz ± 20 %", "10 Hz ± 100 %"])
def test_a_rate_that_allows_everything_is_a_fault_of_the_plan(rate: str, make_system: Callable[..., System]) -> None:
    system = make_system(RCL, MAPPING, rate={"in.r": rate, "in.q": "1 Hz ± 1 %"})
    _, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert [fault.code for fault in faults] == ["MON101", "MON101"]
    assert {fault.message.split(":")[0] for fault in faults} == {"rate.in.r", "rate.in.q"}

"""The picture of a run: every finding has a mark, however long the run; whatever a trace says, it is only text."""

from __future__ import annotations

import json
import re
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

import pytest

from avow.backend_kit.protocol import Limits
from avow.backend_kit.timeline import (
    KINDS,
    Band,
    Columns,
    Lane,
    Mark,
    Timeline,
    Word,
    in_words,
    joined_marks,
    joined_stretches,
    picture,
    runs,
    timelines,
)
from avow.backends.rosmonitoring import BACKEND, lanes
from avow.base.codec import to_json
from avow.base.tuning.shown import TIMELINE_COLUMNS
from avow.cli import main
from avow.report.page import environment
from avow.system.load import load_system
from avow.system.plan import System

from .conftest import ARRIVAL, job_for

GUARD = """
node guard {
  inputs( r : REAL )
  outputs( mode : { slow, fast }, speed : REAL )
  topics( float64 r matches(in.r), string mode matches(out.mode), float64 speed matches(out.speed) )
  assume sane ( in.r >= 0 )
  guarantee bounded ( out.speed <= 10 )
  guarantee slows ( in.r < 1 -> out.mode == slow )
}
"""
Event = dict[str, Any]


def guard(folder: Path, events: list[Event], **options: Any) -> System:
    (folder / "system.rcl").write_text(GUARD, encoding="utf-8")
    (folder / "run.jsonl").write_text("".join(json.dumps(e) + "\n" for e in events), encoding="utf-8")
    method = {"rosmonitoring": {"answers": ARRIVAL, "traces": ["run.jsonl"], "mapping": {}, **options}}
    (folder / "plan.yaml").write_text(json.dumps({"nodes": {"guard": {"methods": [method]}}}), encoding="utf-8")
    return load_system(folder)


def said(topic: str, at: int, data: Any) -> Event:
    return {"topic": topic, "time": at / 10, "data": data}


def nominal(count: int) -> list[Event]:
    return [said(("r", "mode", "speed")[k % 3], k, (5.0, "fast", 2.0)[k % 3]) for k in range(count)]


def drawn(system: System, folder: Path) -> dict[str, Timeline]:
    job = job_for(system, "guard")
    outcomes = {o.obligation: o for o in BACKEND.discharge(job, folder, Limits()).outcomes}
    return {o.name: timelines(outcomes[o.id].details)[0] for o in job.obligations}


def monitor(system: Path, *arguments: str) -> int:
    """The exit code."""
    with pytest.raises(SystemExit) as done:
        main(["monitor", str(system), *arguments])
    return int(done.value.code or 0)


def parsed(svg: str) -> ElementTree.Element:
    return ElementTree.fromstring(svg)


def test_no_mark_is_lost_however_many_there_are() -> None:
    columns = Columns(joined_marks)
    chance = Random(7)
    events = [chance.randrange(1, 200_000) for _ in range(20_000)]
    for event in events:
        columns.put(event, Mark("broken", event, event, 1, str(event)))
    found = columns.items()
    assert len(found) <= TIMELINE_COLUMNS
    assert sum(m.number for m in found) == len(events)
    assert (min(m.first for m in found), max(m.last for m in found)) == (min(events), max(events))
    assert all(any(m.first <= e <= m.last for m in found) for e in events)
    assert all(m.time == str(m.first) for m in found)


def test_a_single_peak_of_a_long_signal_is_in_its_column() -> None:
    columns = Columns(joined_stretches)
    for event in range(1, 100_001):
        value = 99.0 if event == 70_001 else 1.0
        columns.put(event, Band(event, event, value, value))
    found = runs(columns.items())
    assert len(found) <= 3
    (peak,) = [s for s in found if s[2:] == (1.0, 99.0)]
    assert peak.first <= 70_001 <= peak.last


def test_evidence_has_a_timeline_of_what_each_guarantee_reads(tmp_path: Path) -> None:
    events = nominal(30)
    events[14] = said("speed", 14, 12.0)  # event 15
    found = drawn(guard(tmp_path, events), tmp_path)
    assert [lane.name for lane in found["bounded"].lanes] == ["bounded", "out.speed"]
    assert found["bounded"].lanes[0].marks == (Mark("broken", 15, 15, 1, "1.4"),)
    assert [s[2:] for s in found["bounded"].lanes[1].stretches] == [(2.0, 2.0), (12.0, 12.0), (2.0, 2.0)]
    assert [lane.name for lane in found["slows"].lanes] == ["slows", "in.r", "out.mode"]
    assert found["slows"].lanes[2].stretches == (Word(2, 29, "fast"),)
    assert (found["slows"].events, found["slows"].start, found["slows"].end) == (30, "0", "2.9")
    assert in_words(found["bounded"]) == "run.jsonl, 30 events: bounded: broken 1 time, first at event 15 (t = 1.4)"
    assert in_words(found["slows"]) == "run.jsonl, 30 events: no finding"


def test_silence_and_broken_assumptions_have_marks(tmp_path: Path) -> None:
    events = [said("r", 0, -1.0), said("mode", 1, "fast"), said("mode", 30, "slow")]
    found = drawn(guard(tmp_path, events, fresh={"in.r": "1 s"}), tmp_path)["slows"]
    assert {lane.name: [(m.kind, m.first) for m in lane.marks] for lane in found.lanes} == {
        "sane": [("assumption", 1)],
        "slows": [("excused", 2)],
        "in.r": [("silent", 3)],
        "out.mode": [],
    }


def test_of_a_long_run_signals_are_sampled_and_no_finding_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lanes, "TIMELINE_EVENTS", 100)
    events = nominal(3000)
    for k in (500, 1001, 2999):
        events[k] = said("speed", k, 11.0)
    found = drawn(guard(tmp_path, events), tmp_path)["bounded"]
    assert found.every == 30
    assert sum(m.number for m in found.lanes[0].marks) == 3
    assert [m.first for m in found.lanes[0].marks] == [501, 1002, 3000]
    assert 11.0 in {s.high for s in found.lanes[1].stretches if isinstance(s, Band)}
    assert "signals of one event in 30, marks of all" in in_words(found)


def test_it_is_the_same_in_evidence_and_read_again(tmp_path: Path) -> None:
    found = drawn(guard(tmp_path, nominal(30)), tmp_path)["slows"]
    assert timelines(json.loads(json.dumps({"timeline": [to_json(found)]}))) == [found]


@pytest.mark.parametrize(
    "change",
    [
        {"events": 0},
        {"every": 0},
        {"lanes": [{"name": "x", "signal": [[1, 9, 0, 1]], "marks": []}]},
        {"lanes": [{"name": "x", "signal": [[1, 2, 1e999, 1]], "marks": []}]},
        {"lanes": [{"name": "x", "signal": [[1, 2, 3, 1]], "marks": []}]},
        {"lanes": [{"name": "x", "signal": [], "marks": [["odd", 1, 1, 1, ""]]}]},
        {"lanes": [{"name": "x", "signal": [], "marks": [["broken", 0, 1, 1, ""]]}]},
        {"lanes": [7]},
    ],
)
def test_what_is_no_timeline_is_not_drawn(change: dict[str, Any]) -> None:
    good = {"trace": "t", "events": 3, "from": "", "to": "", "every": 1, "lanes": []}
    assert timelines({"timeline": [good]})
    assert timelines({"timeline": [{**good, **change}]}) == []
    assert timelines({"timeline": change}) == []


HOSTILE = '</title></text></svg><script>alert(1)</script>\x00\x1b&quot;" onload=x \ud800'


def test_text_of_a_trace_is_only_text() -> None:
    marks = tuple(Mark(kind, 1, 2, 2, HOSTILE) for kind in KINDS)
    lane = Lane(HOSTILE, (Word(1, 1, HOSTILE), Word(2, 9, HOSTILE + "x")), marks)
    whole = Timeline(HOSTILE, 9, HOSTILE, HOSTILE, (lane,))
    for svg in (picture(whole), picture(whole, alone=True)):
        assert {e.tag.rpartition("}")[2] for e in parsed(svg).iter()} <= {
            "svg",
            "style",
            "rect",
            "text",
            "title",
            "path",
        }
    draw = environment().globals["draw_timelines"]
    page = draw({"timeline": [to_json(whole)]})  # type: ignore[operator]
    assert "<script" not in page
    assert page.count("<svg") == 1


def test_it_fits_its_box_whatever_the_numbers() -> None:
    chance = Random(3)
    for events in (1, 2, 1000, 10**9):
        ends = sorted(chance.randrange(1, events + 1) for _ in range(20))
        numbers = tuple(Band(e, e, -1.7e308 * chance.random(), 1.7e308 * chance.random()) for e in ends)
        words = tuple(Word(e, e, "m" * chance.randrange(90)) for e in ends)
        marks = tuple(Mark(kind, e, events, 3) for kind in KINDS for e in ends)
        lanes_ = (Lane("c", (), marks), Lane("n" * 90, numbers, marks), Lane("w", words, marks))
        root = parsed(picture(Timeline("t", events, "0", "9" * 90, lanes_)))
        width, height = map(float, root.attrib["viewBox"].split()[2:])
        assert (width, root.attrib["width"]) == (720, "720")
        for element in root.iter():
            x, y = float(element.get("x", 0)), float(element.get("y", 0))
            assert 0 <= x <= width
            assert x + float(element.get("width", 0)) <= width + 1
            assert 0 <= y <= height
            if element.get("class") == "signal":
                heights = [float(n) for n in re.findall(r"V(-?[\d.]+)", element.attrib["d"])]
                assert heights
                assert all(0 <= n <= height for n in heights)
            if place := element.get("transform"):
                across, down = map(float, place[len("translate(") : -1].split())
                assert 170 <= across <= width
                assert 0 <= down <= height


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    events = nominal(30)
    events[14] = said("speed", 14, 12.0)
    guard(tmp_path, events)
    out = tmp_path / "run.svg"
    assert monitor(tmp_path, str(tmp_path / "run.jsonl"), "--timeline", str(out)) == 1
    titles = [e.text for e in parsed(out.read_text(encoding="utf-8")).iter() if e.tag.endswith("title")]
    assert "broken: event 15 (t = 1.4)" in titles
    assert {"guard.bounded", "guard.slows", "guard.in.r", "guard.out.mode", "guard.out.speed"} <= set(titles)

    for arguments, words in (
        (["-", "--timeline", str(out)], "--timeline needs a TRACE"),
        (["--live", "ros1", "--timeline", str(out)], "--timeline needs --record"),
        ([str(tmp_path / "run.jsonl"), "--timeline", str(tmp_path)], "MON304"),
    ):
        capsys.readouterr()
        assert monitor(tmp_path, *arguments) == 2
        assert words in capsys.readouterr().err

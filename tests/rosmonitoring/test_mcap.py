"""Verdicts and margins as MCAP: the engine's judgements, one for one; margins that agree with the verdicts."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from random import Random
from typing import Any

import jsonschema
import pytest

from avow.backends.rosmonitoring.live import follow
from avow.backends.rosmonitoring.live.graphs import Inbox
from avow.cli import main
from avow.system.load import load_system
from avow.system.plan import System

from .conftest import ARRIVAL

LIMITS = """
node limits {
  inputs( a : REAL )
  outputs( b : REAL )
  topics( float64 a matches(in.a), float64 b matches(out.b) )
  assume warm ( in.a > -50 )
  guarantee above ( out.b >= in.a )
  guarantee below ( out.b < 8 )
  guarantee same ( out.b == in.a )
  guarantee other ( out.b != in.a )
  guarantee within ( out.b >= 0 and out.b <= 10 )
  guarantee mixed ( in.a > 0 -> out.b > 0 )
}
"""
Event = dict[str, Any]


def limits(folder: Path, answers: dict[str, Any] | None = None, **options: Any) -> System:
    (folder / "system.rcl").write_text(LIMITS, encoding="utf-8")
    method = {"rosmonitoring": {"answers": answers or ARRIVAL, "mapping": {}} | options}
    (folder / "plan.yaml").write_text(json.dumps({"nodes": {"limits": {"methods": [method]}}}), encoding="utf-8")
    return load_system(folder)


def written(folder: Path, events: list[Event]) -> Path:
    path = folder / "run.jsonl"
    path.write_text("".join(json.dumps(e) + "\n" for e in events), encoding="utf-8")
    return path


def pairs(count: int, seed: int = 1) -> list[Event]:
    chance = Random(seed)
    numbers = [-60.0, -1.0, 0.0, 0.1, 7.5, 8.0, 9.0, 11.0]
    return [{"topic": "ab"[k % 2], "time": k / 8, "data": chance.choice(numbers)} for k in range(count)]


def monitor(system: Path, *arguments: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(["monitor", str(system), *arguments])
    return int(done.value.code or 0)


def channels(path: Path) -> dict[str, list[tuple[int, dict[str, Any]]]]:
    reader = pytest.importorskip("mcap.reader")
    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            said = json.loads(message.data)
            known = json.loads(schema.data)["properties"]
            assert (schema.encoding, channel.message_encoding, set(said)) == ("jsonschema", "json", set(known))
            jsonschema.validate(said, json.loads(schema.data))
            found.setdefault(channel.topic.removeprefix("/avow/limits/"), []).append((message.publish_time, said))
    with path.open("rb") as file:  # as they stand in the file
        stream = pytest.importorskip("mcap.stream_reader").StreamReader(file, validate_crcs=True)
        logged = [record.log_time for record in stream.records if hasattr(record, "publish_time")]
    assert logged == sorted(logged)
    assert len(logged) == sum(map(len, found.values()))
    return found


@pytest.fixture(autouse=True)
def _installed() -> None:
    pytest.importorskip("mcap")


@pytest.mark.slow
def test_each_judgement_is_there_and_its_margin_agrees(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits(tmp_path)
    trace = written(tmp_path, pairs(400))
    out = tmp_path / "verdicts.mcap"
    assert monitor(tmp_path, str(trace), "--mcap", str(out), "--json", "--all") == 1
    with_mcap = json.loads(capsys.readouterr().out)
    assert monitor(tmp_path, str(trace), "--json", "--all") == 1
    assert json.loads(capsys.readouterr().out) == with_mcap  # the compiled monitors say the same
    found = channels(out)
    for clause in with_mcap["nodes"][0]["clauses"]:
        said = [m["verdict"] for _, m in found[f"{clause['name']}/verdict"]]
        counted = (len(said), said.count("broken") + said.count("excused") * (clause["kind"] == "guarantee"))
        assert counted == (clause["judged"], clause["broken"])
    assert len(found["findings"]) == len(with_mcap["violations"])
    for name in ("above", "below", "same", "other", "within", "warm", "mixed"):
        verdicts = {m["event"]: (at, m) for at, m in found[f"{name}/verdict"]}
        assert len(found[f"{name}/margin"]) == len(verdicts)
        for at, message in found[f"{name}/margin"]:
            when, judged = verdicts[message["event"]]
            assert at == when == (message["event"] - 1) * 125_000_000
            if message["margin"] < 0:
                assert judged["verdict"] in ("broken", "excused")
            elif message["margin"] > 0:
                assert (judged["verdict"], judged["value"]) == ("held", 1)
    held = {v for _, m in found["below/verdict"] for v in (m["verdict"],)}
    assert held == {"held", "broken", "excused"}


def test_margins_are_signed_distances(tmp_path: Path) -> None:
    limits(tmp_path)
    out = tmp_path / "verdicts.mcap"
    events = [{"topic": "a", "time": 1, "data": 3.0}, {"topic": "b", "time": 2, "data": 9.5}]
    assert monitor(tmp_path, str(written(tmp_path, events)), "--mcap", str(out)) == 1
    margins = {name: found[0][1]["margin"] for name, found in channels(out).items() if name.endswith("/margin")}
    assert margins == {
        "warm/margin": 53.0, "above/margin": 6.5, "below/margin": -1.5, "same/margin": -6.5, "other/margin": 6.5,
        "within/margin": 0.5, "mixed/margin": 9.5,
    }  # fmt: skip


def test_a_paired_answer_has_the_margin_to_its_own_input(tmp_path: Path) -> None:
    limits(tmp_path, {"by": "key", "input": "id", "output": "id"}, mapping={"in.a": "data", "out.b": "data"})
    out = tmp_path / "verdicts.mcap"
    events = [
        {"topic": "a", "time": 1, "data": 1.0, "id": 1},
        {"topic": "a", "time": 2, "data": 5.0, "id": 2},
        {"topic": "b", "time": 3, "data": 2.0, "id": 1},
        {"topic": "b", "time": 4, "data": 5.5, "id": 2},
    ]
    monitor(tmp_path, str(written(tmp_path, events)), "--mcap", str(out))
    found = channels(out)
    assert [(at, m["event"], m["margin"]) for at, m in found["above/margin"]] == [
        (3_000_000_000, 3, 1.0),
        (4_000_000_000, 4, 0.5),
    ]


def test_what_is_judged_late_is_published_at_its_event_and_logged_when_it_was_said(tmp_path: Path) -> None:
    """With a latency, an answer is judged once all inputs are there that it may have answered."""
    limits(tmp_path, {"latency": "500 ms", "jitter": "300 ms", "because": "a test"})
    out = tmp_path / "verdicts.mcap"
    events = [
        {"topic": "a", "time": 0, "data": 1.0},
        {"topic": "b", "time": 1.25, "data": 2.0},
        {"topic": "a", "time": 1.5, "data": 1.5},
        {"topic": "a", "time": 3, "data": 1.75},
        {"topic": "b", "time": 3.5, "data": 2.0},
    ]
    monitor(tmp_path, str(written(tmp_path, events)), "--mcap", str(out))
    with out.open("rb") as file:
        messages = pytest.importorskip("mcap.reader").make_reader(file).iter_messages()
        times = {(c.topic, m.publish_time, m.log_time) for _, c, m in messages if c.topic.endswith("above/verdict")}
    assert ("/avow/limits/above/verdict", 1_250_000_000, 3_000_000_000) in times
    assert [at for at, m in channels(out)["above/verdict"] if m["event"] == 2] == [1_250_000_000]


def test_silence_is_a_finding(tmp_path: Path) -> None:
    limits(tmp_path, fresh={"in.a": "1 s"})
    out = tmp_path / "verdicts.mcap"
    events = [{"topic": "a", "time": 1, "data": 1.0}, {"topic": "b", "time": 9, "data": 2.0}]
    monitor(tmp_path, str(written(tmp_path, events)), "--mcap", str(out))
    assert next((at, m["fault"], m["about"]) for at, m in channels(out)["findings"]) == (
        9_000_000_000,
        "silent",
        "in.a",
    )


class Spoken:
    """A graph that has said some events."""

    def __init__(self, events: list[Event]) -> None:
        self.inbox = Inbox()
        for event in events:
            self.inbox.message(event["topic"], lambda now, event=event: event)

    def __enter__(self) -> Spoken:
        return self

    def __exit__(self, *_: object) -> None: ...


@pytest.mark.slow
def test_a_running_graph_gives_record_timeline_and_mcap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limits(tmp_path)
    events = pairs(40)
    monkeypatch.setattr(follow, "graph_of", lambda *_, **__: Spoken(events))
    record, drawn, out = tmp_path / "r.jsonl", tmp_path / "t.svg", tmp_path / "v.mcap"
    files = ("--record", str(record), "--timeline", str(drawn), "--mcap", str(out))
    assert monitor(tmp_path, "--live", "ros1", "--for", "0", *files) == 1
    again = tmp_path / "again.mcap"
    assert monitor(tmp_path, str(record), "--mcap", str(again), "--timeline", str(tmp_path / "again.svg")) == 1

    heard, read = channels(out), channels(again)
    assert heard.keys() == read.keys()
    for topic, said in heard.items():
        if not topic.endswith("/verdict"):  # a margin is that of one order
            assert {each["event"] for _, each in said} <= {each["event"] for _, each in read[topic]}
            continue
        of_file = {each["event"]: each["verdict"] for _, each in read[topic]}
        on_graph = {each["event"]: each["verdict"] for _, each in said}
        assert of_file.keys() == on_graph.keys()
        # on a graph nothing orders the topics: what would be held in another order of them is no breach
        assert all(told in (of_file[event], "unpaired") for event, told in on_graph.items())
    assert any(each["verdict"] == "broken" for topic in heard for _, each in heard[topic] if "verdict" in each)
    assert drawn.read_text().count("<svg") == (tmp_path / "again.svg").read_text().count("<svg") > 0


def test_what_cannot_be_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    limits(tmp_path)
    trace = written(tmp_path, pairs(4))
    text = trace.read_text()
    for arguments, words in (
        ((str(trace), "--mcap", str(trace)), "two of the files are one"),
        ((str(trace), "--timeline", str(tmp_path / "x"), "--mcap", str(tmp_path / "x")), "two of the files are one"),
        ((str(trace), "--mcap", str(tmp_path)), "MON304"),
        ((str(tmp_path),), "SYSTEM comes first"),
        (("--live", "ros1", "--record", str(tmp_path / "x.mcap")), "--record writes JSON lines, not .mcap"),
        (("--serve", "0", "--mcap", str(tmp_path / "x.mcap")), "--mcap needs a TRACE or --live"),
    ):
        assert monitor(tmp_path, *arguments) == 2
        assert words in " ".join(capsys.readouterr().err.split())
    assert trace.read_text() == text
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    assert monitor(tmp_path, str(trace), "--mcap", str(tmp_path / "x.mcap")) == 2
    assert "MON301" in capsys.readouterr().err
    assert not (tmp_path / "x.mcap").exists()

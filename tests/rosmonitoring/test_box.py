"""Bounds of a node's inputs in the plan: what leaves them is told, excuses, and is withheld by a filter."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from helpers import wait_for

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring import BACKEND
from avow.backends.rosmonitoring.live.follow import follow, graph_of
from avow.backends.rosmonitoring.live.ros1 import Ros1
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault
from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.system.plan import System

from .conftest import job_for, one_by_one
from .processes import MAPPING, RCL
from .test_live import FLOAT64, Master, float64, master, until  # noqa: F401 - a fixture

Make = Callable[..., System]
SAID = [("/r", 20), ("/s", 7), ("/r", 130), ("/s", 121), ("/r", 20), ("/s", 9)]


def trace(folder: Path, said: list[tuple[str, float]]) -> str:
    lines = [{"topic": topic, "time": time, "data": value} for time, (topic, value) in enumerate(said)]
    (folder / "run.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return "run.jsonl"


def test_what_leaves_the_box_is_told_and_excuses(make_system: Make) -> None:
    rcl = RCL.replace("( out.s <= 120 )", "( in.r >= 0 -> out.s <= 120 )")
    system = make_system(rcl, MAPPING, box={"in.r": [0, 100]}, traces=["run.jsonl"])
    path = system.plan.root / trace(system.plan.root, SAID)
    found = [(v.clause, v.fault) for _, v in session(system).run(path)]
    assert found == [("box", Fault.ASSUMPTION), ("low", Fault.EXCUSED)]
    assert [(v.clause, v.fault) for v in one_by_one(session(system), path)] == found
    (outcome,) = BACKEND.discharge(job_for(system, "n"), path.parent, Limits()).outcomes
    assert outcome.verdict is Verdict.MONITORED
    assert "the assumption box was broken by the environment, first at event 3" in outcome.summary
    assert [h.name for h in outcome.rests_on] == ["n/assumption/box"]
    assert outcome.rests_on[0].text == "the plan's box: 0 <= in.r <= 100"


def test_the_range_of_a_column_is_a_bound(make_system: Make) -> None:
    system = make_system(RCL, MAPPING, box={"in.r": {"data": "seen.csv", "column": "r"}}, traces=["run.jsonl"])
    table = system.plan.root / "seen.csv"
    table.write_text("run,r\n1,20\n2,3.5\n3,119\n")
    (monitor,) = session(system).monitors
    assert monitor.setup.box.text == "3.5 <= in.r <= 119"
    assert table in BACKEND.files(job_for(system, "n"))


@pytest.mark.parametrize(
    ("box", "table", "words"),
    [
        ({"in.q": [0, 1]}, "", "'in.q' is no input of type REAL"),
        ({"in.r": [2, 1]}, "", "in.r is an interval without values"),
        ({"in.r": {"data": "sen.csv", "column": "r"}}, "run,r\n1,2\n", "'sen.csv' is no table"),
        (
            {"in.r": {"data": "../seen.csv", "column": "r"}},
            "run,r\n1,2\n",
            "'../seen.csv' is no table",
        ),
        ({"in.r": {"data": "seen.csv", "column": "q"}}, "run,r\n1,2\n", "with values in a column 'q'"),
        ({"in.r": {"data": "seen.csv", "column": "r"}}, "run,r\n", "with values in a column 'r'"),
        ({"in.r": {"data": "seen.csv", "column": "r"}}, "", "'seen.csv' is no table"),
        ({"in.r": {"data": "seen.csv", "column": "r"}}, "run,r\n1,2\n2,high\n", "no number in column 'r'"),
        ({"in.r": {"data": "seen.csv", "column": "r"}}, "run,r\n1,2\n2\n", "no number in column 'r'"),
    ],
)
def test_a_wrong_box_is_refused(make_system: Make, box: dict[str, Any], table: str, words: str) -> None:
    system = make_system(RCL, MAPPING, box=box)
    (system.plan.root / "seen.csv").write_text(table)
    with pytest.raises(Rejected) as refused:
        session(system)
    (fault,) = refused.value.diagnostics
    assert (fault.code, words in fault.message) == ("MON101", True), fault
    assert fault.span is not None
    assert fault.span.line == (3 if "no number" in words else fault.span.line)


def test_a_box_of_what_no_message_carries_is_refused(make_system: Make) -> None:
    rcl = RCL.replace("inputs( r : REAL )", "inputs( r, q : REAL )")
    with pytest.raises(Rejected, match=r"box.in.q: no message that is observed carries it"):
        session(make_system(rcl, MAPPING, box={"in.r": [0, 1], "in.q": [0, 1]}))


def test_a_clause_called_box_is_refused(make_system: Make) -> None:
    with pytest.raises(Rejected, match="a clause of n has this name"):
        session(make_system(RCL.replace("guarantee low", "guarantee box"), MAPPING, box={"in.r": [0, 1]}))


@pytest.mark.parametrize(
    ("fallback", "words"),
    [
        ({"out.t": {"data": 0}}, "out.t is not filtered"),
        ({"out.s": {"date": 0}}, "date is no field of std_msgs/Float64"),
        ({"out.s": {"data": True}}, "data is not of type float64"),
        ({"out.s": {"data": "high"}}, "data is not of type float64"),
    ],
)
def test_a_wrong_fallback_is_refused(make_system: Make, fallback: dict[str, Any], words: str) -> None:
    with pytest.raises(Rejected, match=words):
        session(make_system(RCL, MAPPING, filter=["out.s"], fallback=fallback))


LISTENER = """node m {
  inputs( s : REAL )
  outputs( t : REAL )
  topics( std_msgs/Float64 s matches(in.s), std_msgs/Float64 t matches(out.t) )
  assume known ( in.s >= 0 )
  guarantee any ( out.t >= 0 )
}
"""


@pytest.mark.parametrize("fallback", [{}, {"out.s": {"data": -1}}])
def test_a_filter_falls_back_outside_the_box(
    master: Master,  # noqa: F811
    make_system: Make,
    tmp_path: Path,
    fallback: dict[str, Any],
) -> None:
    """Within the box what is wrong falls back, too; what cannot be read is withheld. The record is no evidence."""
    record = tmp_path / "run.jsonl"
    system = make_system(RCL + LISTENER, MAPPING, filter=["out.s"], box={"in.r": [0, 100]}, fallback=fallback)
    running, done = session(system), threading.Event()
    said = [("r", 20), ("s", 1.5), ("r", 101), ("s", 2.5), ("r", 30), ("s", 130), ("s", None), ("s", 7)]
    with Ros1(master.uri, ()) as node:
        spoken = {"r": node.speak("/r", *FLOAT64), "s": node.speak("/s_mon", *FLOAT64)}
        graph = graph_of(f"ros1:{master.uri}", running, "127.0.0.1", enforce=True)
        judging = threading.Thread(
            target=lambda: list(follow(running, graph, until(done.is_set), record, None, lambda text: None))
        )
        judging.start()
        wait_for(lambda: "/s" in master.publishers and spoken["r"]._lines)
        with Ros1(master.uri, ("s",)) as other:
            wait_for(lambda: len(graph._spoken["/s"]._lines) == 1)  # type: ignore[union-attr]
            for number, (topic, value) in enumerate(said, 1):
                spoken[topic].say(b"short" if value is None else float64(value))
                wait_for(lambda number=number: running.events == number)
            heard = [other.inbox.get(60) for _ in range(4 if fallback else 2)]
            values = [one.read()["data"] for one in heard if one is not None and one.read is not None]
        done.set()
        judging.join()
    assert values == ([1.5, -1, -1, 7] if fallback else [1.5, 7])
    assert running.withheld == {"/s": 3}
    told = [json.loads(line) for line in record.read_text("utf-8").splitlines()]
    assert [line["data"] for line in told if line["topic"] == "/s"] == values
    again = session(system)
    broken = [(v.node, v.clause) for _, v in again.run(record)]
    assert broken == [("n", "box"), *([("m", "known")] * 2 if fallback else [])]
    assert "n.low" in again.unmonitored()

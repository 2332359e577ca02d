"""An answer on several topics: a part that is lost or cannot be read is of one answer, and no later one is blamed."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import pytest

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.watched import Fault

from .test_other_steps import Make, found

RCL = """
node n {
  inputs( x : REAL )
  outputs( a : REAL, b : REAL )
  topics( m/V x matches(in.x), m/V a matches(out.a), m/V b matches(out.b) )
  guarantee sum ( out.a + out.b == in.x )
  guarantee same ( out.a == out.b )
}"""
MESSAGES = {
    "m/V": "std_msgs/Header header\nuint32 id\nfloat64 v\n",
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id\n",
}
WAYS: dict[str, dict[str, Any]] = {
    "stamp": {"by": "stamp"},
    "key": {"by": "key", "input": "id", "output": "id"},
    "order": {"by": "order", "because": "one process"},
    "latency": {"latency": "20 ms", "jitter": "0 ms", "because": "measured"},
    "arrival": {"by": "arrival", "because": "one process"},
}
COUNT, AT = 12, 5


def judged(
    make: Make,
    way: str,
    order: str,
    lost: Iterable[str] = (),
    bad: Iterable[str] = (),
    wrong: int = -1,
    seq: bool = True,
) -> tuple[list[tuple[Fault, str, int]], dict[str, tuple[int, int, int]], str]:  # fmt: skip
    """What is told (but of what cannot be read), each clause's answers (held or broken, apart, unreadable), and why it
    is no evidence. Of the answer at `AT` some messages are lost or NaN; the one at `wrong` is."""
    mapping = {"in.x": "v", "out.a": "v", "out.b": "v"}
    monitor = Monitor(found(make(RCL, mapping, messages=MESSAGES, answers=WAYS[way])))
    told, numbers = [], {"x": 0, "a": 0, "b": 0}
    for k in range(COUNT):
        for at, topic in enumerate(f"x{order}"):
            value = 2.0 * k if topic == "x" else 1.0 * k + (topic == "a" and k == wrong)
            numbers[topic] += 1
            if k == AT and topic in lost:
                continue
            header = {"stamp": {"secs": k, "nsecs": 0}, **({"seq": numbers[topic]} if seq else {})}
            said = math.nan if k == AT and topic in bad else value
            time = k + at / 100
            told += monitor.step({"topic": topic, "time": time, "header": header, "id": k, "v": said})
    told += monitor.finish()
    counts = {name: (tally.decided, tally.partial, tally.unreadable) for name, tally in monitor.tallies.items()}
    assert all(t.published >= t.decided + t.partial + t.unreadable + t.order for t in monitor.tallies.values())
    faults = [(v.fault, v.clause, v.index) for v in told if v.fault is not Fault.MAPPING]
    return faults, counts, monitor.backwards


@pytest.mark.parametrize("order", ["ab", pytest.param("ba", marks=pytest.mark.slow)])
@pytest.mark.parametrize("way", WAYS)
def test_of_a_correct_node_nothing_is_told(make_system: Make, way: str, order: str) -> None:
    for bad, clear in (("", (COUNT, 0, 0)), ("b", (COUNT - 1, 0, 1)), ("ab", (COUNT - 1, 0, 1))):
        faults, counts, backwards = judged(make_system, way, order, bad=bad)
        assert (faults, counts["same"], backwards) == ([], clear, "")
        assert counts["sum"] == clear or way == "latency"  # by latency, what has just changed may have been before
    faults, counts, backwards = judged(make_system, way, order, lost="b")
    assert faults == []
    if way in ("stamp", "key", "latency"):
        assert (counts["same"], backwards) == ((COUNT - 1, 1, 0), "")
    else:  # what came before the loss
        assert counts["same"][0] == AT
    assert not judged(make_system, way, order, lost="abx")[0]


@pytest.mark.parametrize("order", ["ab", "ba"])
@pytest.mark.parametrize("way", ["stamp", "key", "latency"])
def test_a_wrong_answer_is_found_after_a_loss(make_system: Make, way: str, order: str) -> None:
    faults, _, _ = judged(make_system, way, order, lost="b", wrong=8)
    event = 3 * 8 + 2  # one message less, and the last of three
    assert (Fault.GUARANTEE, "same", event) in faults
    assert (Fault.GUARANTEE, "sum", event) in faults or way == "latency"
    assert {at for _, _, at in faults} == {event}


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_by_order_an_unnumbered_loss_leaves_no_evidence(make_system: Make, order: str) -> None:
    _, _, backwards = judged(make_system, "order", order, lost="b", seq=False)
    assert "their order does not show which belong together" in backwards


def test_by_order_a_message_that_cannot_be_read_is_the_kth(make_system: Make) -> None:
    single = RCL.replace("outputs( a : REAL, b : REAL )", "outputs( a : REAL )").replace(", m/V b matches(out.b)", "")
    rcl = single.replace("out.a + out.b == in.x", "2 * out.a == in.x").replace("guarantee same ( out.a == out.b )", "")
    monitor = Monitor(found(make_system(rcl, {"in.x": "v", "out.a": "v"}, messages=MESSAGES, answers=WAYS["order"])))
    told = []
    for k in range(COUNT):
        for topic, value in (("x", 2.0 * k), ("a", 1.0 * k)):
            told += monitor.step({"topic": topic, "time": k * 1.0, "v": math.inf if k == AT else value})
    told += monitor.finish()
    assert {v.fault for v in told} == {Fault.MAPPING}
    assert (monitor.tallies["sum"].decided, monitor.backwards) == (COUNT - 1, "")

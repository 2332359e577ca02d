"""What a trace leaves open is no evidence: unheard inputs, answers that never were whole, orders that contradict."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring import BACKEND, options
from avow.backends.rosmonitoring.command import _Output, _report
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.session import Session, session
from avow.backends.rosmonitoring.watched import DEPENDS, UNSAID, Fault, Tally, coverage, remedies
from avow.base.diagnostics import Rejected
from avow.base.verdict import Outcome, Verdict
from avow.pipeline.plan_check import of_plan
from avow.system.plan import System

from .conftest import job_for

ONE = """
node n {
  inputs( r : REAL )
  outputs( v : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 v matches(out.v) )
  guarantee g ( in.r >= 120 -> out.v == 0 )
}
"""
TWO = """
node n {{
  inputs( r : REAL )
  outputs( v : REAL, w : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 v matches(out.v), std_msgs/Float64 w matches(out.w) )
  guarantee g ( in.r >= 120 -> (out.v == 0 {} out.w == 0) )
}}
"""
Make = Callable[..., System]


def events(*steps: tuple[str, float], times: tuple[float, ...] = ()) -> list[dict[str, Any]]:
    return [
        {"topic": topic, "time": times[k] if times else float(k), "data": value, "header": {"stamp": k // 2}}
        for k, (topic, value) in enumerate(steps)
    ]


def judged(make: Make, folder: Path, rcl: str, trace: list[dict[str, Any]], **more: Any) -> Outcome:
    system = make(rcl, more.pop("mapping", {}), traces=["t.jsonl"], **more)
    (system.plan.root / "t.jsonl").write_text("".join(json.dumps(e) + "\n" for e in trace), encoding="utf-8")
    (outcome,) = BACKEND.discharge(job_for(system, "n"), folder, Limits()).outcomes
    return outcome


GOOD = (("r", 130.0), ("v", 0.0)) * 30


def test_the_good_run_is_evidence(make_system: Make, tmp_path: Path) -> None:
    assert judged(make_system, tmp_path, ONE, events(*GOOD)).verdict is Verdict.MONITORED


NEVER_HIGH = (
    "in.r < 120 or out.v == 0",
    "not (in.r >= 120 and out.v != 0)",
    "if in.r >= 120 then out.v == 0 else TRUE",
    "in.r > 0 -> in.r >= 120 -> out.v == 0",
    "(in.r >= 120 -> out.v == 0) and (in.r < 50 -> out.v >= 0)",
    "forall(k in {130, 140} | in.r == k -> out.v == 0)",
    "in.r >= 120 <=> out.v == 0",
    "not once(in.r >= 120) or out.v == 0",
)


@pytest.mark.parametrize("by", ["arrival", "stamp"])
@pytest.mark.parametrize("formula", NEVER_HIGH)
def test_what_never_met_a_condition_is_vacuous_however_it_is_written(
    make_system: Make, tmp_path: Path, formula: str, by: str
) -> None:
    rcl, low, high = ONE.replace("in.r >= 120 -> out.v == 0", formula), (("r", 1.0), ("v", 5.0)) * 30, GOOD
    for trace, vacuous in ((low, True), (low + high, False)):
        told = judged(
            make_system, tmp_path, rcl, events(*trace), answers={"by": by, "because": "one process writes it"}
        )
        assert (told.verdict, told.vacuous) == (Verdict.MONITORED, vacuous), told.summary


@pytest.mark.parametrize("rule", [{"initial": 130}, {"initial": 130, "topic": "elsewhere"}])
def test_an_initial_value_is_no_observation(make_system: Make, tmp_path: Path, rule: dict[str, Any]) -> None:
    trace = events(*[("v", 0.0)] * 30)
    found = judged(make_system, tmp_path, ONE, trace, mapping={"in.r": {"field": "data", **rule}})
    assert found.verdict is Verdict.UNKNOWN
    late = judged(
        make_system,
        tmp_path,
        ONE,
        [*trace, *events(("r", 1.0), ("v", 5.0), times=(40.0, 41.0))],
        mapping={"in.r": {"field": "data", "initial": 130}},
    )
    assert (late.verdict, late.vacuous, late.bound["judged"]) == (Verdict.MONITORED, True, 1)
    broken = judged(make_system, tmp_path, ONE, events(("v", 1.0)), mapping={"in.r": {"field": "data", "initial": 130}})
    assert broken.verdict is Verdict.REFUTED


WHOLE = (("r", 130.0), ("v", 0.0), ("w", 0.0)) * 30


@pytest.mark.parametrize("tail", [(("v", 1.0),), (("v", 1.0), ("v", 0.0), ("w", 0.0))])
def test_a_part_that_breaks_whatever_the_rest_was_is_broken(
    make_system: Make, tmp_path: Path, tail: tuple[tuple[str, float], ...]
) -> None:
    found = judged(make_system, tmp_path, TWO.format("and"), events(*WHOLE, *tail))
    assert (found.verdict, found.bound["published"] - found.bound["judged"]) == (Verdict.REFUTED, 0)
    found = judged(make_system, tmp_path, TWO.format("or"), events(*WHOLE, *tail))
    assert found.verdict is Verdict.UNKNOWN
    assert "part of an incomplete answer 1" in found.summary
    assert (
        "decided; its outputs come on several topics, not always together: judge at each, `when: any`" in found.summary
    )
    found = judged(make_system, tmp_path, TWO.format("or"), events(*WHOLE, *tail), decided=0.9)
    assert found.verdict is Verdict.MONITORED
    assert "part of an incomplete answer 1" in found.summary
    quiet = judged(make_system, tmp_path, TWO.format("and"), events(*WHOLE, ("r", 1.0), *tail))
    assert quiet.verdict is Verdict.MONITORED


@pytest.mark.parametrize("first", [0, 1])
def test_what_an_initial_value_does_not_mend_is_told_beside_it(first: int) -> None:
    tally = Tally(published=9, judged=3)
    for reason in (UNSAID, DEPENDS)[:: 1 if first else -1]:
        tally.unsure(f"in.r{UNSAID}" if reason is UNSAID else reason)
    told = remedies(tally, {}, {})
    assert "mapping: {in.r: {…, initial: …}}; and pair answers by a stamp or a key" in told


@pytest.mark.parametrize("fault", ["no stamp", "two inputs"])
def test_one_answer_that_is_not_paired_leaves_it_unknown(make_system: Make, tmp_path: Path, fault: str) -> None:
    trace = events(*GOOD, ("r", 130.0), ("v", 1.0))
    if fault == "no stamp":
        del trace[-1]["header"]
    else:
        trace.insert(-1, {**trace[-2], "data": 1.0})
    found = judged(make_system, tmp_path, ONE, trace, answers={"by": "stamp"})
    assert found.verdict is Verdict.UNKNOWN
    assert "undecided which input was answered 1" in found.summary
    assert "pair answers" not in found.summary, "the plan does"


@pytest.mark.parametrize("last", [0.0, 1.0])
def test_times_that_run_backwards_contradict_the_order_of_arrival(
    make_system: Make, tmp_path: Path, last: float
) -> None:
    trace = events(("v", last), ("r", 130.0), ("v", last), times=(3.0, 2.0, 4.0))
    found = judged(make_system, tmp_path, ONE, trace, decided=0.1)
    assert found.verdict is Verdict.UNKNOWN
    assert "has the time 2 and an earlier one 3" in found.summary


@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({"answers": {"latency": 50, "jitter": "5 ms", "because": "x"}}, 1),
        ({"answers": {"latency": "50", "jitter": 4, "because": "x"}}, 2),
        ({"fresh": {"in.r": 2}}, 1),
    ],
)
def test_a_time_without_a_unit_is_one_fault(make_system: Make, options: dict[str, Any], count: int) -> None:
    from avow.backends.rosmonitoring.session import session

    with pytest.raises(Rejected) as caught:
        session(make_system(ONE, {}, **options))
    assert [d.code for d in caught.value.diagnostics] == ["PLAN105"] * count
    assert all("a time with a unit, such as 50 ms" in d.message for d in caught.value.diagnostics)


@pytest.mark.parametrize(
    ("bound", "said", "told"),
    [
        ("<= 0.2", 0.2, "; exactly, out.v is 0.2 + 1.1e-17, since no float is the decimal number: allow a tolerance"),
        (">= 0.3", 0.3, "; exactly, out.v is 0.3 - 1.1e-17"),
        ("== 0.5", 0.25, ""),
        ("<= 0.2", 0.3, ""),
    ],
)
def test_a_breach_that_looks_met_says_the_exact_number(
    make_system: Make, tmp_path: Path, bound: str, said: float, told: str
) -> None:
    rcl = ONE.replace("in.r >= 120 -> out.v == 0", f"in.r >= 120 -> out.v {bound}")
    messages = {"std_msgs/Float64": "float64 data\n"}
    found = judged(make_system, tmp_path, rcl, events(("r", 130.0), ("v", said)), messages=messages)
    assert found.verdict is Verdict.REFUTED
    assert (told or "in.r") in found.summary
    assert ("exactly" in found.summary) is bool(told)


def test_a_slip_in_the_mapping_is_one_fault_for_check_and_monitor(make_system: Make) -> None:
    """The other entries are read: the fields that they name are not in doubt."""
    messages = {"a/V": "float64 x\nfloat64 y\n"}
    rcl = ONE.replace("std_msgs/Float64 r", "a/V r").replace("std_msgs/Float64 v", "a/V v")
    mapping = {"in.r": {"field": "x", "nan": "nil", "elsewhere": 0}, "out.v": "y"}
    system = make_system(rcl, mapping, messages=messages)
    assert [d.code for d in of_plan(system) if d.is_error] == ["PLAN105"]
    system = make_system(rcl, {"in.r": "x", "out.vv": "y"}, messages=messages)  # of `out.v` nothing is told then
    assert [d.hint for d in of_plan(system) if d.is_error] == ["did you mean `out.v`?"]
    system = make_system(rcl, {"in.r": "x", "out.v": "y"}, messages=messages, answers={"by": "arrival", "because": "…"})
    with pytest.raises(Rejected, match="a reason in words"):
        session(system)


def test_a_step_before_that_nothing_showed_is_no_observation(make_system: Make, tmp_path: Path) -> None:
    rcl = (
        TWO.format("and")
        .replace("r : REAL", "r : REAL, last : REAL")
        .replace("in.r >= 120 -> (", "in.last >= 120 -> (")
    )
    rcl = rcl.replace(" and out.w == 0", "")
    mapping = {"in.last": {"previous": "out.w", "initial": 130}}
    trace = events(*[("v", 0.0)] * 9)
    assert judged(make_system, tmp_path, rcl, trace, mapping=mapping).verdict is Verdict.UNKNOWN
    heard = judged(make_system, tmp_path, rcl, [*trace, *events(("w", 1.0), times=(20.0,))], mapping=mapping)
    assert heard.verdict is Verdict.MONITORED


TIMED = """
node n {
  inputs( r : REAL )
  outputs( v : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 v matches(out.v) )
  guarantee g ( in.r >= 120 -> within[1 s](out.v == 0) )
  guarantee h ( in.r >= 0 or out.v == 0 )
}
"""


@pytest.mark.parametrize(
    ("time", "stands"),
    [
        (lambda k: k / 10, False),
        (lambda k: (k - k % 4) / 10, False),  # as coarse as a clock may be
        (lambda k: 0.0, True),
        (lambda k: min(k, 20) / 10, True),  # it freezes
        (lambda k: 7.0 if 20 <= k < 50 else k / 10, True),  # and goes on
    ],
)
def test_times_that_do_not_go_on_are_no_evidence_for_seconds(
    time: Callable[[int], float], stands: bool, make_system: Make, tmp_path: Path
) -> None:
    steps = [("r" if k % 2 == 0 else "v", 200.0 if k % 8 == 0 else 0.0) for k in range(60)]
    trace = events(*steps, times=tuple(max(time(k), 0.0) for k in range(60)))
    trace.sort(key=lambda e: e["time"])
    system = make_system(TIMED, {}, traces=["t.jsonl"], answers={"by": "arrival", "because": "one process"})
    (system.plan.root / "t.jsonl").write_text("".join(json.dumps(e) + "\n" for e in trace), encoding="utf-8")
    timed, plain = BACKEND.discharge(job_for(system, "n"), tmp_path, Limits()).outcomes
    assert plain.verdict is Verdict.MONITORED, plain
    assert timed.verdict is (Verdict.UNKNOWN if stands else Verdict.MONITORED), timed
    assert ("one time" in timed.summary) is stands


def test_a_value_is_initial_only_if_the_plan_gives_it(make_system: Make) -> None:
    running = session(make_system(ONE.replace("out.v == 0", "within[1 s](out.v == 0)")), ["n"])
    said = events(*[("r", 200.0)] * 3, times=(0.0, 1.0, 9.0))
    assert not [*(v for event in said for v in running.step(event)), *running.finish()]
    ((*_, tally),) = running.clauses()
    assert "initial" not in coverage(tally)
    assert tally.supposed


PAIRINGS: list[dict[str, Any]] = [
    {"by": "arrival", "because": "one process"},
    {"latency": "20 ms", "jitter": "5 ms", "because": "measured"},
    *(
        {"by": by, **({"input": "id", "output": "id"} if by == "key" else {})}
        for by in ("key", "stamp", "call", "order")
    ),
]


@pytest.mark.parametrize(("way", "said"), [("header.stmp", True), ("headr.stamp", True), ("id", False)])
def test_a_field_of_no_message_pairs_no_answers(make_system: Make, way: str, said: bool) -> None:
    """A line of JSON may have a field that its type lacks."""
    rcl, message = ONE.replace("std_msgs/Float64", "a/N"), {"a/N": "std_msgs/Header header\nfloat64 data"}
    more: dict[str, Any] = {"messages": message, "plan": {"ros": {"distro": "humble"}}, "traces": ["t.jsonl"]}
    answers = {"by": "key", "input": way, "output": "header.stamp"}
    system = make_system(rcl, {"in.r": "data", "out.v": "data"}, answers=answers, **more)
    _, faults = options.setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert [(f.code, "answers.input" in f.message, f.hint) for f in faults] == [
        ("MON101", True, f"did you mean `{'stamp' if 'stmp' in way else 'header'}`?")
    ] * said


@pytest.mark.parametrize("hold", [False, True])
@pytest.mark.parametrize("answers", PAIRINGS)
def test_an_initial_value_has_an_effect_or_is_refused(make_system: Make, answers: dict[str, Any], hold: bool) -> None:
    """Answers before the first input are decided by it, those that break included; none that holds is evidence."""
    system = make_system(ONE, {"in.r": {"field": "data", "initial": 130}, "out.v": "data"}, answers=answers)
    setup, faults = options.setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    if answers.get("by", "latency") not in ("arrival", "latency"):
        assert [(fault.code, "it has no effect" in fault.message) for fault in faults] == [("MON101", True)]
        return
    assert not faults
    early = [("v", 0.0 if hold else 1.0)] * 10
    sent = [("r", 1.0), ("v", 5.0), ("r", 130.0), ("v", 0.0)] * 10
    said = [{"topic": topic, "data": value, "time": k / 10} for k, (topic, value) in enumerate([*early, *sent])]
    for batch in (False, True):
        running = Session(system, (Monitor(setup),))
        if batch:
            lines = io.BytesIO("".join(f"{json.dumps(event)}\n" for event in said).encode())
            found = [violation for _, violation in running.read(lines.read1)]
        else:
            found = [v for event in said for v in running.step(event)] + [*running.finish()]
        ((*_, tally),) = running.clauses()
        assert (tally.early, tally.order, tally.awaited) == (0, 0, {})
        assert (tally.supposed, tally.broken, len(found)) == ((10, 0, 0) if hold else (0, 10, 10))
        assert tally.decided - tally.broken == 20
        assert all(age < 1 for age in tally.ages.values())


def test_only_an_input_without_a_value_is_asked_for(make_system: Make) -> None:
    rcl = """
    node n {
      inputs( a : REAL, b : REAL )  outputs( v : REAL )
      topics( m/R a matches(in.a), m/R b matches(in.b), m/R v matches(out.v) )
      guarantee sum ( out.v <= in.a + in.b )
    }
    """
    for answers in PAIRINGS[:2]:
        system = make_system(rcl, {"in.a": "data", "in.b": "data", "out.v": "data"}, answers=answers)
        running = session(system, ("n",))
        for k, topic in enumerate(["a", *["v"] * 10, "b", *["v"] * 10]):
            assert not [*running.step({"topic": topic, "data": 0, "time": k / 10})]
        assert not [*running.finish()]
        ((*_, tally),) = running.clauses()
        assert (tally.early, [*tally.awaited]) == (10, ["in.b"])


@pytest.mark.parametrize("answers", PAIRINGS[:2])
@pytest.mark.parametrize(("sent", "meant"), [("/lvel", "`/lvel`"), ("/somewhere_else", "")])
def test_a_topic_that_never_came_is_told_and_no_initial_value_advised(
    make_system: Make,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    answers: dict[str, Any],
    sent: str,
    meant: str,
) -> None:
    rcl = ONE.replace("64 r ", "64 /level ").replace("64 v ", "64 /v ")
    system = make_system(rcl, {"in.r": "data", "out.v": "data"}, answers=answers)
    trace = tmp_path / "t.jsonl"
    said = [{"topic": topic, "data": 0, "time": k / 10} for k, topic in enumerate([sent, "/v"] * 10)]
    trace.write_text("".join(f"{json.dumps(event)}\n" for event in said), encoding="utf-8")
    running = session(system, ("n",), trace)
    assert _report(running, running.run(trace), str(trace), _Output(False, False, None, None)) == 1
    told = capsys.readouterr().out
    assert "initial" not in told
    assert "bears" not in told
    assert "n.g: no message came on /level: correct the topic in the contract, or record it" in told
    assert f"  no message came on /level{': did you mean ' + meant + '?' if meant else ''}\n" in told
    assert told.count("did you mean") == bool(meant)


@pytest.mark.parametrize(
    "answers", [{"by": "arrival", "because": "one process"}, {"by": "key", "input": "k", "output": "k"}]
)
def test_no_initial_value_is_advised_for_what_could_not_be_read(
    make_system: Make, tmp_path: Path, answers: dict[str, Any]
) -> None:
    """The message says what helps: `nan`."""
    system = make_system(ONE, {"in.r": "data", "out.v": "data"}, answers=answers)
    trace = tmp_path / "t.jsonl"
    said = [{"topic": topic, "k": k // 2, "time": k / 10} for k, topic in enumerate(["r", "v"] * 10)]
    texts = (json.dumps({**event, "data": math.nan if event["time"] == 0.8 else 1.0}) for event in said)
    trace.write_text("".join(f"{text}\n" for text in texts), encoding="utf-8")
    running = session(system, ("n",), trace)
    assert [v.fault for _, v in running.run(trace)] == [Fault.MAPPING]
    advice = running.unmonitored()["n.g"]
    assert "in.r: nan is not a number; if it means no reading, map it" in advice
    assert "initial" not in advice


@pytest.mark.parametrize("decided", [None, 0.5])
@pytest.mark.parametrize("others", [1, 3, 8])
def test_no_share_is_advised_with_which_nothing_was_triggered(
    make_system: Make, tmp_path: Path, decided: float | None, others: int
) -> None:
    """The only answers that meet the antecedent are undecided by latency: a lesser share would be vacuous."""
    changes = [("r", k * 10.0, 1.0) for k in range(others)] + [("r", 90.0, 130.0)]
    answers = [("v", at + 5, 0.0) for _, at, _ in changes[:-1]] + [("v", 90.005, 3.0)]
    steps = sorted([*changes, *answers], key=lambda step: step[1])
    trace = events(*((topic, value) for topic, _, value in steps), times=tuple(at for _, at, _ in steps))
    more = {} if decided is None else {"decided": decided}
    found = judged(make_system, tmp_path, ONE, trace, answers=PAIRINGS[1], **more)
    assert found.verdict is (Verdict.UNKNOWN if decided is None else Verdict.MONITORED)
    assert found.vacuous is (decided is not None)
    assert "measure a shorter latency" in found.summary
    assert "decided:" not in found.summary.replace("that was decided:", "")

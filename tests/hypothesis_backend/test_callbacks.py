"""Callback classes of rospy and rclpy, tested over runs of messages: right ones, mutants, tricks, what is no number."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest
from drive.test_callbacks import CONTRACT, ROS1, ROS2, system
from helpers import some

from avow.backend_kit import one_step
from avow.backend_kit.protocol import Job, Limits
from avow.backends.hypothesis import tuning
from avow.backends.hypothesis.judging import MEANING, failure_bound
from avow.base.verdict import Object, Outcome, Verdict
from avow.evidence.record import CASE
from avow.pipeline.evidence_keys import surroundings
from avow.pipeline.methods import method_job
from avow.system.load import load_system

TOOL = import_module("avow.backends.hypothesis").BACKEND
DIRECT = ROS1.replace("# HERE", "self.said.publish(self.level)").replace(
    "rospy.Timer(rospy.Duration(0.25), self.tick)", ""
)
TIMED = """\
context { Level : {green, red}; Red = 250; }
node watch {
  inputs( r : REAL )
  outputs( status : Level )
  topics( float64 r matches(in.r), string status matches(out.status) )
  assume possible ( 0 <= in.r )
  guarantee soon ( in.r >= Red -> within[300 ms](out.status == red) )
}
"""


def job(folder: Path, kind: str, text: str, options: str = "{cases: 100}", contract: str = CONTRACT) -> Job:
    system(folder, kind, text, f"[{{hypothesis: {options}}}]")
    (folder / "system.rcl").write_text(contract, encoding="utf-8")
    loaded = load_system(folder)
    return method_job(loaded, loaded.contract.node("watch"), loaded.plan.node("watch").methods[0])


def asked(given: Job) -> dict[str, Outcome]:
    assert not [d for d in one_step.check(TOOL, given) if d.is_error]
    report = one_step.discharge(TOOL, given, given.root, Limits())
    return {o.obligation.rpartition("/")[2]: o for o in report.outcomes}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "text"), some([("rospy", ROS1), ("rclpy", ROS2), ("rospy", DIRECT)], 2))
def test_right_classes_are_tested_of_their_source(tmp_path: Path, kind: str, text: str) -> None:
    found = asked(job(tmp_path / "w", kind, text, "{cases: 300}"))  # in three runs of eight nothing high is drawn
    assert {o.verdict for o in found.values()} == {Verdict.TESTED}, found
    assert {(o.of, o.numbers, o.vacuous) for o in found.values()} == {(Object.SOURCE, "float64", False)}
    assert found["high"].bound["runs"] == 15


@pytest.mark.slow
def test_the_log_has_the_counts_and_some_runs_in_full(tmp_path: Path) -> None:
    given = job(tmp_path / "w", "rospy", DIRECT)
    report = one_step.discharge(TOOL, given, given.root, Limits())
    log = json.loads(report.logs["runs.json"])
    for outcome in report.outcomes:
        count = log["guarantees"][outcome.obligation.rpartition("/")[2]]
        told = [outcome.bound[key] for key in ("runs", "cases", "seed", "judged", "triggered")]
        assert told == [log["runs"], log["cases"], log["seed"], count["held"], min([log["runs"], *count["met"]])]
    first = log["first runs"][0]
    assert first["heard"][0]["topic"] != first["said"][0]["topic"]


@pytest.mark.slow
@pytest.mark.parametrize(("text", "some_missing"), [(DIRECT, True), (DIRECT, False), (ROS1, False)])
def test_messages_without_an_answer_are_counted(tmp_path: Path, text: str, some_missing: bool) -> None:
    """Unless a later timer answers them."""
    drop = "self.said.publish(self.level)"
    text = text.replace(drop, f"message.data > 300 or {drop}") if some_missing else text
    found = asked(job(tmp_path / "w", "rospy", text, "{cases: 300}"))["low"]
    assert found.verdict is Verdict.TESTED
    assert ("unanswered" in found.bound) is some_missing
    assert ("messages without an answer" in found.summary) is some_missing


@pytest.mark.slow
@pytest.mark.parametrize(
    "formula", ["in.r < 300 or out.status == red", "(in.r >= 300 -> out.status == red) and out.status in {green, red}"]
)
def test_a_class_that_never_answers_a_condition_is_not_tested(tmp_path: Path, formula: str) -> None:
    text = DIRECT.replace("self.said.publish(self.level)", "message.data >= 300 or self.said.publish(self.level)")
    contract = CONTRACT.replace("guarantee high", f"guarantee silent ( {formula} )\n  guarantee high")
    found = asked(job(tmp_path / "w", "rospy", text, "{cases: 300}", contract))["silent"]
    assert (found.verdict, found.vacuous) == (Verdict.UNKNOWN, True), found.summary


@pytest.mark.slow
def test_a_run_counts_only_if_the_guarantee_was_judged_in_it(tmp_path: Path) -> None:
    """The class answers nothing in the runs whose first message is high."""
    mute = "self.mute = getattr(self, 'mute', message.data > 300)"
    text = DIRECT.replace(
        "self.said.publish(self.level)", f"{mute}\n        self.mute or self.said.publish(self.level)"
    )
    contract = CONTRACT.replace("guarantee high", "guarantee any ( out.status in {green, red} )\n  guarantee high")
    found = asked(job(tmp_path / "w", "rospy", text, "{cases: 600}", contract))["any"]
    assert found.verdict is Verdict.TESTED, found.summary
    runs, judged = found.bound["runs"], found.bound["triggered"]
    assert isinstance(runs, int)
    assert isinstance(judged, int)
    assert 0 < judged < runs
    assert f"% of runs like the {judged} that judge it fail)" in found.summary
    assert found.bound["failure_probability_below"] == failure_bound(judged)
    assert found.details["meaning"] == MEANING


MUTANTS = {
    "strict": (">= self.red", "> self.red"),
    "one double off": (">= self.red", ">= self.red + 3e-14"),
    "raises at the threshold": ("# HERE", "assert message.data != 249.99999999999997"),
    "a number of its own": ("# HERE", "self.level = 'green' if message.data == 777 else self.level"),
    "the eleventh message": (
        "# HERE",
        "self.n = getattr(self, 'n', 0) + 1\n        if self.n >= 11: self.level = 'green'",
    ),
    "time": ("# HERE", "self.level = 'green' if rospy.get_time() > 1.5 else self.level"),
    "no value of the type": ("# HERE", "self.level = 'blue' if self.level == 'red' else self.level"),
    "no message at all": ("self.said.publish(self.level)", "self.said.publish(None)"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", some(sorted(MUTANTS), 3))
def test_mutants_are_refuted_by_a_run(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "SHRINKING_SECONDS", 40.0)  # on a busy machine too
    given = job(tmp_path / "w", "rospy", ROS1.replace(*MUTANTS[name]), "{cases: 300}")
    found = asked(given)["high"]
    assert found.verdict is Verdict.REFUTED, found
    assert found.counterexample is not None
    if name == "strict":
        assert found.counterexample.values == (("in.r", "250"), ("out.status", "green"))
        assert [step[0][0] for step in found.counterexample.trace] == ["(time)"] * len(found.counterexample.trace)
        assert len(found.details[CASE]) == 1  # type: ignore[arg-type]


@pytest.mark.slow
def test_what_refuted_once_is_tried_first(tmp_path: Path) -> None:
    given = job(
        tmp_path / "w", "rospy", DIRECT.replace(">= self.red", "> self.red"), "{cases: 200, guarantees: [high]}"
    )
    (found,) = asked(given).values()
    again = job(tmp_path / "again", "rospy", DIRECT.replace(">= self.red", "> self.red"), "{cases: 1, seed: 5}")
    kept = {again.obligations[0].id: [found.details[CASE], [["/gone", 1, {"d": []}]], "nothing"]}
    assert asked(replace(again, kept=kept))["high"].verdict is Verdict.REFUTED


TRICKS = {
    "what objects share": (
        "# HERE",
        "Watch.n = getattr(Watch, 'n', 0) + 1; self.level = 'red' if Watch.n > 90 else self.level",
    ),
    "chance": ("# HERE", "import random; random.random()"),
    "its own end": ("# HERE", "import os; os._exit(0)"),
    "a thread": ("# HERE", "import threading; threading.Timer(60, print).start()"),
    "silence": ("self.said.publish(self.level)", "pass"),
    "always green": ('"red" if', '"green" if'),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", some(sorted(TRICKS), 2))
def test_no_trick_is_tested(tmp_path: Path, name: str) -> None:
    found = asked(job(tmp_path / "w", "rospy", ROS1.replace(*TRICKS[name]), "{cases: 200}"))
    assert found["high"].verdict is not Verdict.TESTED or found["high"].vacuous, found


@pytest.mark.slow
@pytest.mark.parametrize("numbers", ["float64", "float64-with-nan"])
def test_what_is_no_number_is_tried_apart(tmp_path: Path, numbers: str) -> None:
    text = DIRECT.replace("message.data >=", "int(message.data) >=")
    given = job(tmp_path / "w", "rospy", text, f"{{cases: 40, numbers: {numbers}}}")
    found = asked(given)["low"]
    assert found.verdict is (Verdict.TESTED if numbers == "float64" else Verdict.REFUTED)
    assert "/r: data = NaN: the class raises ValueError" in str(found.details["no numbers"])


@pytest.mark.slow
@pytest.mark.parametrize(("text", "verdict"), [(DIRECT, Verdict.TESTED), (ROS1, Verdict.REFUTED)])
def test_limits_in_seconds_are_judged_in_virtual_time(tmp_path: Path, text: str, verdict: Verdict) -> None:
    found = asked(job(tmp_path / "w", "rospy", text.replace("0.25", "0.75"), contract=TIMED))["soon"]
    assert found.verdict is verdict, found
    assert found.bound["rejected"]


def test_exact_numbers_are_none_of_messages(tmp_path: Path) -> None:
    given = job(tmp_path / "w", "rospy", ROS1, "{numbers: exact}")
    assert [d.code for d in TOOL.check(given)] == ["HYPO106"]
    given = job(tmp_path / "v", "rospy", ROS1.replace("class Watch:", "class Other:"))
    (found,) = TOOL.check(given)
    assert (found.code, found.hint) == ("DRIVE108", "known: Other")
    given = job(tmp_path / "u", "rospy", ROS1, "{mapping: {in.q: data}}")
    assert [d.code for d in TOOL.check(given)] == ["MON101"]


def test_a_class_of_one_ros_is_not_driven_as_another(tmp_path: Path) -> None:
    for kind, text in (("rclpy", ROS1), ("rospy", ROS2), ("step", ROS2)):
        given = job(tmp_path / kind, kind, text)
        (found,) = (d for d in TOOL.check(given) if d.is_error)
        assert (found.code, found.hint) == ("DRIVE108", f"write `kind: {'rospy' if text is ROS1 else 'rclpy'}`")


@pytest.mark.slow
def test_a_class_that_never_publishes_fails(tmp_path: Path) -> None:
    """That another method answers from an old recording does not hide it."""
    found = asked(job(tmp_path / "w", "rospy", ROS1.replace("self.said.publish(", "str(")))
    assert {o.verdict for o in found.values()} == {Verdict.ERROR}, found


@pytest.mark.slow
@pytest.mark.parametrize("given", ["header=message.header, ", ""])
def test_answers_paired_by_stamp_have_one(tmp_path: Path, given: str) -> None:
    text = DIRECT.replace("std_msgs.msg import Float64, String", "own_msgs.msg import Level, Reading")
    text = text.replace("Float64", "Reading").replace("String", "Level")
    text = text.replace("publish(self.level)", f"publish(Level({given}data=self.level))")
    contract = CONTRACT.replace("float64 r", "own_msgs/Reading r").replace("string status", "own_msgs/Level status")
    made = job(tmp_path / "w", "rospy", text, contract=contract)
    for name, kind in (("Reading", "float64"), ("Level", "string")):
        path = tmp_path / f"w/msg/own_msgs/msg/{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"std_msgs/Header header\n{kind} data\n", encoding="utf-8")
    plan = (tmp_path / "w/plan.yaml").read_text(encoding="utf-8")
    plan = (
        plan.replace("{cases: 100}", "{cases: 100, answers: {by: stamp}}") + "messages: [msg]\nros: {distro: noetic}\n"
    )
    (tmp_path / "w/plan.yaml").write_text(plan, encoding="utf-8")
    loaded = load_system(tmp_path / "w")
    made = method_job(loaded, loaded.contract.node("watch"), loaded.plan.node("watch").methods[0])
    found = asked(made)
    assert (Verdict.ERROR in {o.verdict for o in found.values()}) == (not given), found
    assert given or "publishes /status without the stamp of what it answers" in found["high"].summary


def test_the_names_by_which_it_runs_are_part_of_the_key(tmp_path: Path) -> None:
    given = job(tmp_path / "w", "rospy", ROS1)
    plan = (tmp_path / "w/plan.yaml").read_text(encoding="utf-8")
    (tmp_path / "w/plan.yaml").write_text(
        f"{plan}ros: {{nodes: {{watch: {{name: /robot/watch}}}}}}\n", encoding="utf-8"
    )
    loaded = load_system(tmp_path / "w")
    other = method_job(loaded, loaded.contract.node("watch"), loaded.plan.node("watch").methods[0])
    assert surroundings(TOOL, given, "") != surroundings(TOOL, other, "")

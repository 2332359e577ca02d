"""A composed subsystem is a node of a larger system: exported by `avow compose --rcl`, named in the larger contract."""

from __future__ import annotations

from pathlib import Path

from avow.base.verdict import Verdict
from avow.calculus.composition import compose
from avow.calculus.derivation import Rule
from avow.calculus.export import derived_contract
from avow.cli.compose import command
from avow.formulas.formula import substitute
from avow.language.sorts import INTEGER
from avow.language.terms import Literal, Role, Variable
from avow.solving.questions import solve
from avow.system.load import load_system
from avow.system.plan import System

from .make import make, node, outcomes, settled
from .test_commands import invoke

CONTEXT = "context { Level : {low, high}; Limit = 10; }\n"
READER = node(
    "reader",
    "raw : REAL",
    "value : REAL",
    "A sane: 0 <= in.raw and in.raw <= Limit",
    "G scaled: out.value == in.raw / 2",
)
GRADER = node(
    "grader",
    "value : REAL",
    "level : Level",
    "A half: 0 <= in.value and in.value <= 5",
    "G grade: out.level == high <=> in.value > 4",
)
SOURCE = node("source", "", "raw : REAL", "G small: 0 <= out.raw and out.raw <= 8")
SINK = node("sink", "level : Level", "", "A calm: in.level == low")


def exported(folder: Path, text: str, plan: str = "{}") -> str:
    make(folder, text, plan)
    code, found = invoke(command, str(folder), "--rcl")
    assert code == 0
    return found


def larger(folder: Path, own: str, part: str, plan: str = "") -> System:
    folder.mkdir(parents=True)
    (folder / "own.rcl").write_text(own)
    (folder / "part.rcl").write_text(part)
    (folder / "plan.yaml").write_text("contract: [part.rcl, own.rcl]\n" + plan)
    return load_system(folder)


def test_a_subsystem_is_a_node(tmp_path: Path) -> None:
    part = exported(tmp_path / "sensor", CONTEXT + READER + GRADER)
    system = larger(tmp_path / "whole", SOURCE + SINK, part)
    assert [n.name for n in system.contract.nodes] == ["sensor", "source", "sink"]
    goal = compose(system).whole
    assert goal.root.rule is Rule.R1
    assert goal.root.nodes == ("source", "sensor", "sink")
    found = outcomes(system)
    assert found["whole.sensor.reader_sane"].verdict is Verdict.PROVED
    assert found["whole.sink.calm"].verdict is Verdict.PROVED
    flat = outcomes(make(tmp_path / "flat", CONTEXT + READER + GRADER + SOURCE + SINK))
    assert flat["whole.reader.sane"].verdict is Verdict.PROVED
    assert flat["whole.sink.calm"].verdict is Verdict.PROVED


def test_a_fault_outside_is_found_at_the_subsystem(tmp_path: Path) -> None:
    part = exported(tmp_path / "sensor", CONTEXT + READER + GRADER)
    found = outcomes(larger(tmp_path / "whole", SOURCE.replace("<= 8", "<= 11") + SINK, part))
    assert found["whole.sensor.reader_sane"].verdict is Verdict.REFUTED


def test_a_fault_inside_is_found_outside(tmp_path: Path) -> None:
    part = exported(tmp_path / "sensor", CONTEXT + READER + GRADER.replace("> 4", "> 3"))
    found = outcomes(larger(tmp_path / "whole", SOURCE + SINK, part))
    assert found["whole.sink.calm"].verdict is Verdict.REFUTED


def test_three_levels(tmp_path: Path) -> None:
    part = exported(tmp_path / "sensor", CONTEXT + READER + GRADER)
    (tmp_path / "middle").mkdir()
    middle = exported(tmp_path / "middle", part + SOURCE)
    found = outcomes(larger(tmp_path / "whole", SINK, middle))
    assert found["whole.sink.calm"].verdict is Verdict.PROVED


def test_memory_inside_is_shown_again_outside(tmp_path: Path) -> None:
    """The subsystem's delayed value is an input of its node: the larger system feeds it back, and shows it again."""
    counter = node(
        "counter", "last : INTEGER", "count : INTEGER", "A started: in.last >= 0", "G up: out.count == in.last + 1"
    )
    memory = "connections: [{from: counter.count, to: counter.last, delayed: true, initial: 0}]"
    part = exported(tmp_path / "clock", counter, memory)
    assert "count_before" in part
    sink = node("display", "count : INTEGER", "", "A positive: in.count >= 1")
    plan = "connections: [{from: clock.count, to: clock.count_before, delayed: true, initial: %s}]"
    found = outcomes(larger(tmp_path / "good", sink, part, plan % 0))
    assert {o.verdict for name, o in found.items() if name.startswith("whole.clock")} == {Verdict.PROVED}
    assert found["whole.display.positive"].verdict is Verdict.PROVED
    bad = outcomes(larger(tmp_path / "bad", sink, part, plan % -5))
    assert Verdict.REFUTED in {o.verdict for name, o in bad.items() if name.startswith("whole.clock")}


def test_what_the_step_before_has_shown_is_assumed_by_the_derived_contract(tmp_path: Path) -> None:
    """Outside, any value may come in as that of the step before: of such nothing was shown."""
    text = node("z", "", "y : INTEGER", "G: out.y <= 5") + node("p", "y : INTEGER", "x : INTEGER", "G: out.x == in.y")
    text += node("c", "x : INTEGER", "w : INTEGER", "A a: in.x <= 5", "G: out.w <= 5")
    plan = "connections: [{from: z.y, to: p.y, delayed: true, initial: 0}]\n"
    composition, answers = settled(make(tmp_path, text, plan))
    assert answers.verdict is Verdict.PROVED
    (derived,) = derived_contract(composition, composition.whole).nodes
    (assumed,) = derived.assumptions
    wrong = {Variable(Role.INPUT, "y_before", INTEGER): Literal(100, INTEGER)}
    assert solve([substitute(assumed.formula, wrong)]).status == "unsat"
    instantly = make(tmp_path / "instantly", text, "{}")
    composition, answers = settled(instantly)
    assert answers.verdict is Verdict.PROVED
    (derived,) = derived_contract(composition, composition.whole).nodes
    assert derived.assumptions == ()

"""Subsystems of a plan: one node outside, with a derived contract; inside, a derivation on which the whole rests."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.verdict import Verdict
from avow.calculus.composition import Composition, compose
from avow.calculus.derivation import Rule
from avow.calculus.discharge import Bounds
from avow.calculus.export import derived_contract
from avow.calculus.notation import write_goal
from avow.calculus.obligations import composition_obligations
from avow.cli.compose import command
from avow.language.load import check_text
from avow.language.translate import to_rcl
from avow.system.folding import seen
from avow.system.graph import dataflow
from avow.system.graph_svg import sheet

from .make import make, node, outcomes
from .test_commands import invoke
from .test_hierarchy import CONTEXT, GRADER, READER, SINK, SOURCE
from .test_random_systems import broken

FLAT = CONTEXT + READER + GRADER + SOURCE + SINK
NESTED = (
    "subsystems: {sensor: {nodes: [reader, grader]}, front: {nodes: [source, sensor]}, robot: {nodes: [front, sink]}}"
)


def whole(folder: Path, text: str, groups: str, more: str = "") -> Composition:
    return compose(make(folder, text, f"{more}\nsubsystems: {groups}"))


def verdict(composition: Composition) -> Verdict:
    return composition.stands(composition.whole, Bounds())


def faults(folder: Path, text: str, plan: str) -> tuple[Diagnostic, ...]:
    with pytest.raises(Rejected) as rejected:
        make(folder, text, plan)
    return tuple(d for d in rejected.value.diagnostics if d.severity is Severity.ERROR)


# -- what is derived ---------------------------------------------------------------------------------------------------


def test_a_subsystem_is_one_node_with_a_derived_contract(tmp_path: Path) -> None:
    composition = whole(tmp_path, FLAT, "{sensor: {nodes: [reader, grader]}}")
    inner, outer = composition.goals
    assert (inner.name, inner.root.rule, [str(a) for a in inner.root.assumed]) == ("sensor", Rule.R1, ["reader.sane"])
    assert outer.root.rule is Rule.R1
    assert outer.root.nodes == ("source", "sensor", "sink")
    assert inner.contract == (
        "sensor as a node",
        "  reads raw",
        "  puts out value, level",
        "  assumes reader.sane: 0 ≤ in.raw ≤ 10",
        "  guarantees reader.scaled: out.value = in.raw / 2",
        "  guarantees grader.grade: out.level = high ↔ out.value > 4",
    )
    assert verdict(composition) is Verdict.PROVED
    found = outcomes(composition.frame.system)
    assert list(found) == ["sensor.grader.half", "whole.sensor.reader.sane", "whole.sink.calm"]
    needed = {"source.small", "sensor.reader.scaled", "sensor.grader.grade"}
    assert needed == set(found["whole.sink.calm"].details["needed"])  # type: ignore[call-overload]


def test_four_levels(tmp_path: Path) -> None:
    composition = compose(make(tmp_path, FLAT, NESTED))
    assert [goal.name for goal in composition.goals] == ["sensor", "front", "robot", "whole"]
    assert [part.name for part in composition.whole.inner_first()] == ["sensor", "front", "robot", "whole"]
    assert verdict(composition) is Verdict.PROVED
    assert set(outcomes(composition.frame.system)) == {
        "sensor.grader.half",
        "front.sensor.reader.sane",
        "robot.sink.calm",
    }


def test_a_fault_inside_fells_all_that_rests_on_it(tmp_path: Path) -> None:
    """The outer side conditions hold as they are; the inside, on which they rest, does not."""
    text = FLAT.replace("in.value and in.value <= 5", "in.value and in.value <= 4")
    composition = compose(make(tmp_path, text, NESTED))
    by_name = {goal.name: goal for goal in composition.goals}
    assert composition.settled(by_name["front"], Bounds()).verdict is Verdict.PROVED
    for name in ("sensor", "front", "robot", "whole"):
        assert composition.stands(by_name[name], Bounds()) is Verdict.REFUTED
    code, shown = invoke(command, str(tmp_path))
    assert code == 1
    assert "whole does not stand yet: sensor.grader.half is refuted" in shown
    code, shown = invoke(command, str(tmp_path), "--goal", "front")
    assert code == 1, "a derivation is not shown without those of its subsystems"


def test_a_fault_outside_is_found_at_the_subsystem(tmp_path: Path) -> None:
    text = FLAT.replace("out.raw <= 8", "out.raw <= 11")
    found = outcomes(make(tmp_path, text, NESTED))
    assert found["front.sensor.reader.sane"].verdict is Verdict.REFUTED
    assert found["sensor.grader.half"].verdict is Verdict.PROVED
    assert found["front.sensor.reader.sane"].counterexample is not None
    assert "source.raw" in dict(found["front.sensor.reader.sane"].counterexample.values)


def test_what_an_edit_inside_touches(tmp_path: Path) -> None:
    """What reader guarantees is part of the contracts around; what grader assumes is shown inside, and stays there."""

    def digests(name: str, text: str) -> dict[str, str]:
        return {o.name: o.digest for o in composition_obligations(make(tmp_path / name, text, NESTED))}

    before = digests("before", FLAT)
    inside = digests("inside", FLAT.replace("in.value <= 5", "in.value <= 6"))
    assert {name for name in before if before[name] != inside[name]} == {"sensor.grader.half"}
    guarantee = digests("guarantee", FLAT.replace("in.value > 4", "in.value > 3"))
    assert {name for name in before if before[name] != guarantee[name]} == set(before)
    source = digests("source", FLAT.replace("out.raw <= 8", "out.raw <= 7"))
    assert {name for name in before if before[name] != source[name]} == {"front.sensor.reader.sane", "robot.sink.calm"}
    assert digests("words", FLAT.replace("node reader", "\n\nnode reader")) == before


# -- borders -----------------------------------------------------------------------------------------------------------

MIXED = (
    node("low", "", "x : INTEGER", "G small: out.x <= 5")
    + node("high", "", "y : INTEGER", "G large: out.y >= 5")
    + node("user", "x : INTEGER, y : INTEGER", "", "A ordered: in.x <= in.y")
)


def test_an_assumption_about_inside_and_outside_is_carried_outward(tmp_path: Path) -> None:
    composition = whole(tmp_path / "good", MIXED, "{part: {nodes: [low, user]}}")
    assert verdict(composition) is Verdict.PROVED
    assert [str(c.about) for c in composition.goals[0].conditions] == []
    assert "assumes user.ordered: out.x ≤ 5 → out.x ≤ in.y" in "\n".join(composition.goals[0].contract)
    text = to_rcl(derived_contract(composition, composition.goal("part")))
    assert "forall(" in text
    assert check_text(text, "part.rcl")[0] is not None
    weak = whole(tmp_path / "weak", MIXED.replace("out.y >= 5", "out.y >= 4"), "{part: {nodes: [low, user]}}")
    assert verdict(weak) is Verdict.REFUTED
    three = MIXED + node("more", "", "z : INTEGER")
    nested = whole(tmp_path / "deep", three, "{part: {nodes: [low, user]}, box: {nodes: [part, more]}}")
    assert verdict(nested) is Verdict.PROVED
    assert [str(c.about) for c in nested.whole.conditions] == ["box.part.user.ordered"]


def test_support_from_a_node_that_rests_on_the_assumption_does_not_count(tmp_path: Path) -> None:
    """b's assumption is carried outward; what a says may not help it there, since a rests on b."""
    text = (
        node("a", "y : BOOL", "x : BOOL", "A: in.y", "G: out.x")
        + node("b", "x : BOOL, e : BOOL", "y : BOOL", "A: in.x or in.e", "G: out.y")
        + node("c", "", "e : BOOL")
    )
    for number, groups in enumerate(("{s: {nodes: [a, b]}}", "{s: {nodes: [a]}, t: {nodes: [b, c]}}", "{}")):
        composition = whole(tmp_path / str(number), text, groups)
        assert broken(composition) is not None
        assert verdict(composition) is Verdict.REFUTED


def test_a_loop_that_closes_outside_is_a_loop(tmp_path: Path) -> None:
    """a → c → b has no loop; {a, b} ⇄ c has one. What holds by itself still stands; mutual support is refused."""
    text = (
        node("a", "", "x : INTEGER", "G: out.x >= 0")
        + node("c", "x : INTEGER", "y : INTEGER", "A: in.x >= 0", "G: out.y >= in.x")
        + node("b", "y : INTEGER", "", "A: in.y >= 0")
    )
    composition = whole(tmp_path / "mutual", text, "{s: {nodes: [a, b]}}")
    assert composition.whole.root.rule is Rule.R4
    assert verdict(composition) is Verdict.REFUTED
    circles = [a.circle for a in composition.settled(composition.whole, Bounds()).settled.values() if a.circle]
    assert circles
    assert set(circles[0]) == {"s", "c"}
    (finding,) = composition.frame_of(composition.whole).graph.findings
    assert finding.code == "PLAN123"
    code, _ = invoke(command, str(tmp_path / "mutual"))
    assert code == 1
    free = text.replace("assume A1", "assume").replace("out.y >= in.x", "out.y >= 0")
    broken_up = whole(tmp_path / "bootstrap", free.replace("in.x >= 0", "in.x == in.x"), "{s: {nodes: [a, b]}}")
    assert verdict(broken_up) is Verdict.PROVED
    assert [loop.form.value for loop in broken_up.settled(broken_up.whole, Bounds()).loops] == ["bootstrap"]


def test_a_subsystem_that_feeds_itself_through_another_step(tmp_path: Path) -> None:
    """The memory is inside: shown there, by induction, and seen outside as an input that the subsystem feeds itself."""
    text = node(
        "counter", "last : INTEGER", "count : INTEGER", "A started: in.last >= 0", "G up: out.count == in.last + 1"
    ) + node("display", "count : INTEGER", "", "A positive: in.count >= 1")
    memory = "connections: [{from: counter.count, to: counter.last, delayed: true, initial: %s}]"
    groups = "{clock: {nodes: [counter]}, desk: {nodes: [clock, display]}}"
    good = whole(tmp_path / "good", text, groups, memory % 0)
    assert verdict(good) is Verdict.PROVED
    assert [str(c.about) for c in good.goal("clock").conditions] == ["counter.started"]
    assert "  reads count_before" in good.goal("clock").contract
    edges = good.frame_of(good.goal("desk")).graph.edges
    assert [str(e) for e in edges if e.target.node == "clock"] == ["clock.count → clock.count_before (delayed)"]
    # what the display assumes is shown of the count: it needs what clock no longer assumes, but has shown inside
    assert verdict(whole(tmp_path / "bad", text, groups, memory % -5)) is Verdict.REFUTED


def test_two_values_of_one_name_stay_two(tmp_path: Path) -> None:
    """Both readers have an input x, from different nodes: seen from outside these are two inputs."""
    text = (
        node("left", "", "a : INTEGER", "G: out.a == 1")
        + node("right", "", "b : INTEGER", "G: out.b == 2")
        + node("one", "x : INTEGER", "p : INTEGER", "A: in.x == 1")
        + node("two", "x : INTEGER", "q : INTEGER", "A: in.x == 2")
    )
    wires = "connections: [{from: left.a, to: one.x}, {from: right.b, to: two.x}]"
    composition = whole(tmp_path / "good", text, "{s: {nodes: [one, two]}}", wires)
    assert "  reads x, two.x" in composition.goal("s").contract
    assert verdict(composition) is Verdict.PROVED
    crossed = "connections: [{from: left.a, to: two.x}, {from: right.b, to: one.x}]"
    assert verdict(whole(tmp_path / "crossed", text, "{s: {nodes: [one, two]}}", crossed)) is Verdict.REFUTED


def test_persistence_is_carried_outward(tmp_path: Path) -> None:
    text = (
        node("a", "", "x : INTEGER")
        + node("b", "", "y : INTEGER")
        + node("sum", "x : INTEGER, y : INTEGER", "z : INTEGER")
        + node("end", "z : INTEGER", "")
    )
    inner = whole(tmp_path / "inner", text, "{s: {nodes: [a, b, sum]}}")
    assert not any(part.rule is Rule.R3 for part in inner.whole.root.walk())
    assert "system/composition/s.persistence" in write_goal(inner.whole).conditional
    given = "{s: {nodes: [a, b, sum], persistence: {because: latched}, one_output: {because: one a cycle}}}"
    found = outcomes(whole(tmp_path / "given", text, given).frame.system)
    assert found["s.persistence"].verdict is Verdict.JUSTIFIED
    # fed by two nodes of one subsystem: R1 from outside, and their outputs are used together all the same
    pair = whole(tmp_path / "pair", text, "{s: {nodes: [a, b]}}")
    assert pair.whole.root.rule is Rule.R1
    assert "whole.persistence" in outcomes(pair.frame.system)


def test_requirements_rest_on_what_is_shown_inside(tmp_path: Path) -> None:
    plan = f"{NESTED}\nrequirements: {{R: {{text: t, formula: grader.level == low, supported_by: [sensor, source]}}}}"
    found = outcomes(make(tmp_path, FLAT, plan))
    assert found["R"].verdict is Verdict.PROVED
    assert {
        "grader/guarantee/grade",
        "system/composition/sensor.grader.half",
        "system/composition/front.sensor.reader.sane",
    } <= {h.name for h in found["R"].rests_on}


@pytest.mark.parametrize("support", ["front", "grader", "grader.grade"])
def test_a_derivation_is_support_as_the_nodes_are_whose_guarantees_it_derives(tmp_path: Path, support: str) -> None:
    wanted = f"{{R: {{text: t, formula: grader.level == low, supported_by: [source, {support}]}}}}"
    plan = f"subsystems: {{front: {{nodes: [reader, grader]}}}}\nrequirements: {wanted}"
    told = outcomes(make(tmp_path, CONTEXT + READER + GRADER + SOURCE, plan))["R"]
    assert told.verdict is Verdict.PROVED
    needed = "reader.scaled, grader.grade, source.small"
    unnamed = "" if support == "front" else "; `supported_by` does not name reader.scaled: add what it rests on"
    assert told.summary == f"follows at every step from {needed}{unnamed}"


def test_environment_assumptions_reach_into_subsystems(tmp_path: Path) -> None:
    text = CONTEXT + READER + GRADER
    plan = 'environment: {in.raw: {assume: "0 <= in.raw and in.raw <= 10", because: "a 10 V supply"}}'
    composition = whole(tmp_path / "assumed", text, "{sensor: {nodes: [reader, grader]}}", plan)
    assert {n: o.verdict for n, o in outcomes(composition.frame.system).items()} == {
        "sensor.reader.sane": Verdict.PROVED,
        "sensor.grader.half": Verdict.PROVED,
        "environment.in.raw": Verdict.JUSTIFIED,
    }
    nothing = outcomes(whole(tmp_path / "open", text, "{sensor: {nodes: [reader, grader]}}").frame.system)
    assert nothing["environment.reader.sane"].verdict is Verdict.UNKNOWN


def test_an_own_input_of_a_subsystem(tmp_path: Path) -> None:
    """`left.raw` is one input for both nodes inside, and another than that of the node outside."""
    text = (
        node("one", "raw : INTEGER", "a : INTEGER", "G: out.a == in.raw")
        + node("two", "raw : INTEGER", "b : INTEGER", "G: out.b == in.raw")
        + node("three", "raw : INTEGER", "c : INTEGER", "G: out.c == in.raw")
        + node("same", "a : INTEGER, b : INTEGER", "", "A: in.a == in.b")
        + node("other", "a : INTEGER, c : INTEGER", "", "A: in.a == in.c")
    )
    found = outcomes(
        make(tmp_path, text, "subsystems: {left: {nodes: [one, two]}}\nenvironment: {left.raw: {because: its own}}")
    )
    assert found["whole.same.A1"].verdict is Verdict.PROVED
    assert found["whole.other.A1"].verdict is Verdict.REFUTED


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plan", "code", "line", "words"),
    [
        ("subsystems:\n  s: {nodes: [reader, gradr]}", "PLAN106", 2, "did you mean `grader`"),
        ("subsystems:\n  s: {nodes: [reader]}\n  t: {nodes: [reader]}", "PLAN110", 3, "is in 's' already"),
        ("subsystems:\n  s: {nodes: [reader, reader]}", "PLAN105", 2, "is given twice"),
        ("subsystems:\n  reader: {nodes: [grader]}", "PLAN110", 2, "also a node"),
        ("subsystems:\n  D: {nodes: [grader]}\ncompose: {D: {}}", "PLAN110", 2, "also a derivation"),
        ("subsystems:\n  s: {nodes: [t]}\n  t: {nodes: [s]}", "PLAN110", 2, "contain one another: s → t → s"),
        ("subsystems:\n  s: {nodes: [s, reader]}", "PLAN110", 2, "contain one another: s → s"),
        ("subsystems:\n  s: {}", "PLAN104", 2, "'nodes' or 'system'"),
        ("subsystems:\n  s: {nodes: []}", "PLAN105", 2, "must not be empty"),
        ("subsystems:\n  s: {node: [reader]}", "PLAN103", 2, "`nodes`"),
        ("subsystems:\n  whole: {nodes: [reader]}", "PLAN103", 2, "'whole'"),
        ("subsystems:\n  s: {nodes: [reader], system: x}", "PLAN105", 2, "not both"),
        ("subsystems:\n  s: {system: nowhere}", "PLAN107", 2, "no folder 'nowhere'"),
        ("subsystems:\n  s: {system: ../../etc}", "PLAN108", 2, "leads out"),
        ("subsystems:\n  s: {system: /etc}", "PLAN108", 2, "leads out"),
        ("subsystems: {s: {nodes: [reader]}}\ncompose:\n  D: {select: [s, reader]}", "PLAN110", 3, "inside 's'"),
        ("subsystems: {s: {nodes: [reader]}}\ncompose:\n  D: {select: [z]}", "PLAN106", 3, "'z'"),
        ("subsystems: {s: {nodes: [reader]}}\nconnections:\n  - {from: s.nil, to: grader.value}", "PLAN106", 3, "nil"),
        ("subsystems: {s: {nodes: [reader]}}\nconnections:\n  - {from: source.raw, to: s.nil}", "PLAN106", 3, "s.raw"),
        ("subsystems: {s: {nodes: [reader]}}\nenvironment:\n  s.nil: {because: x}", "PLAN106", 3, "s.raw"),
    ],
)
def test_bad_subsystems_are_located(tmp_path: Path, plan: str, code: str, line: int, words: str) -> None:
    found = [d for d in faults(tmp_path / "sys", FLAT, plan) if d.code == code]
    match = [d for d in found if words in f"{d.message} {d.hint or ''}"]
    assert match, found
    assert match[0].span is not None
    assert match[0].span.line == line


def test_deep_and_wide(tmp_path: Path) -> None:
    """A hundred levels of one, and a plan that says so."""
    groups = "".join(f"  s{k}: {{nodes: [{f's{k - 1}' if k else 'reader'}]}}\n" for k in range(100))
    composition = compose(make(tmp_path, FLAT, f"subsystems:\n{groups}"))
    assert composition.whole.nodes == ("s99", "grader", "source", "sink")
    assert len(composition.whole.inner_first()) == 101
    assert verdict(composition) is Verdict.PROVED


# -- shown -------------------------------------------------------------------------------------------------------------


def test_the_graph_shows_subsystems_as_nodes(tmp_path: Path) -> None:
    system = make(tmp_path, FLAT, NESTED)
    parts = seen(system, dataflow(system))
    assert [name for name, _ in parts] == ["", "robot", "front", "sensor"]
    assert [graph.nodes for _, graph in parts] == [
        ("robot",),
        ("front", "sink"),
        ("sensor", "source"),
        ("reader", "grader"),
    ]
    assert not [at for _, graph in parts for at in graph.dangling], "what feeds a node inside feeds something"
    drawn = sheet(parts)
    assert drawn.count("<svg") == 1
    assert drawn.count(">inside ") == 3


def test_the_listing_and_json_show_the_derived_contract(tmp_path: Path) -> None:
    make(tmp_path, FLAT, NESTED)
    code, shown = invoke(command, str(tmp_path))
    assert code == 0
    assert "sensor as a node" in shown
    assert "whole stands" in shown
    code, shown = invoke(command, str(tmp_path), "--json")
    data = json.loads(shown)
    assert [s["name"] for s in data["subsystems"]] == ["sensor", "front", "robot"]
    assert data["subsystems"][0]["contract"][1] == "  reads raw"
    whole_ = next(d for d in data["derivations"] if d["name"] == "whole")
    assert whole_["premises"] == ["robot"], "the report finds the derivation of that name behind it"


def test_connections_may_name_ports_of_subsystems(tmp_path: Path) -> None:
    text = FLAT.replace("inputs( level : Level )", "inputs( grade : Level )").replace(
        "in.level == low", "in.grade == low"
    )
    plan = "connections: [{from: sensor.level, to: sink.grade}]"
    composition = whole(tmp_path, text, "{sensor: {nodes: [reader, grader]}}", plan)
    assert verdict(composition) is Verdict.PROVED
    assert "grader.level → sink.grade" in [str(edge) for edge in composition.frame.graph.edges]

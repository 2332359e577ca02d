"""What was looked at: a proof of the program before one of a model, and the gate of what is claimed of programs."""

from __future__ import annotations

import pytest

from assurance.sample import case, evidence, guarantee, node_plan, obligation, system
from avow.assurance.answers import MODELS, TOOLS, Level
from avow.assurance.model import Case, Gate
from avow.base.verdict import Object, Verdict
from avow.evidence.obligation import Kind, Obligation, ProgramClaim
from avow.evidence.record import Evidence
from avow.system.plan import Requirement

G = guarantee("n", "g")
FAULTLESS, LINKED = (obligation("n", Kind.PROGRAM, name) for name in (ProgramClaim.FAULTLESS, ProgramClaim.LINKED))
FINITE = ("inputs are finite: in.r: no NaN, no infinity",)
MODEL = evidence(G, Verdict.PROVED, "hoare")
SOURCE = evidence(G, Verdict.PROVED, "dafny", of=Object.SOURCE, numbers="float64", hypotheses=FINITE)
TESTED = evidence(G, Verdict.TESTED, "hypothesis", of=Object.SOURCE, numbers="float64")


def made(*records: Evidence, policy: object = None) -> Case:
    whole = system({"n": ["g"]}, plans=[node_plan("n", "medium", "hoare", "dafny")], policy=policy)
    return case(whole, [G, FAULTLESS, LINKED], list(records))


def words(*records: Evidence) -> str:
    (basis,) = made(*records).answers.bases
    return basis.words


def test_a_proof_of_the_source_is_named_before_one_of_a_model() -> None:
    assert words(MODEL, SOURCE) == words(SOURCE, MODEL) == "1 proved (source in float64)"
    assert words(MODEL) == "1 proved (model; program agrees: missing)"


@pytest.mark.parametrize(
    "compared", [{}, {"hoare": ["g"]}, {"dafny": ["g"]}, {"hoare": ["other"]}, {"dafny": ["g"], "hoare": ["g"]}]
)
def test_the_program_agrees_with_a_model_that_it_was_compared_with(compared: dict[str, list[str]]) -> None:
    """Of two models the one that was compared is relied upon; of one that was not, nothing is said."""
    agreed = evidence(LINKED, Verdict.TESTED, "hypothesis", details={"agrees": compared})
    both = [MODEL, evidence(G, Verdict.PROVED, "dafny")]
    said = "1 proved (model; program agrees: tested)"
    assert words(agreed, *both) == (said if any("g" in names for names in compared.values()) else "1 proved (model)")
    for model in both:
        one = words(agreed, model)
        assert one == (said if "g" in compared.get(model.method, ()) else "1 proved (model)")
    unknown = evidence(LINKED, Verdict.UNKNOWN, "hypothesis", details={"agrees": compared})
    assert words(unknown, MODEL) == "1 proved (model; program agrees: unknown)"


@pytest.mark.parametrize("wrong", [LINKED, FAULTLESS])
def test_a_model_that_the_program_refutes_shows_nothing(wrong: Obligation) -> None:
    """A program that fails differs from its model as well, although it agreed wherever both answered."""
    asked = [Requirement("R", "It is safe.", None, None, ("n.g",))]
    plans = [node_plan("n", "medium", "hoare", "hypothesis")]
    whole = system({"n": ["g"]}, plans=plans, requirements=asked, policy={"programs": []})
    agreed = evidence(LINKED, Verdict.TESTED, "hypothesis", details={"agrees": {"hoare": ["g"]}})
    refuted = evidence(wrong, Verdict.REFUTED, "hypothesis")
    levels = {Level.ARGUED: [MODEL, agreed], Level.NOT_SHOWN: [MODEL, *([agreed] * (wrong is FAULTLESS)), refuted]}
    for level, records in levels.items():
        found = case(whole, [G, LINKED, FAULTLESS], records)
        assert found.requirements[0].level is level
        assert any(a.key == MODELS for a in found.assumptions) is (level is not Level.NOT_SHOWN)
        assert ("program agrees: refuted" in found.answers.bases[0].words) is (level is Level.NOT_SHOWN)
    assert case(whole, [G, LINKED, FAULTLESS], [MODEL, refuted, TESTED]).requirements[0].level is Level.ARGUED


def test_a_reviews_condition_is_a_numbered_assumption() -> None:
    signed = {"reviewer": "A. Person", "date": "2026-11-20", "valid_until": "2027-01-01"}
    read = evidence(G, Verdict.REVIEWED, "review", hypotheses=("the map is loaded",), details=signed)
    found = made(read)
    assert [(a.says, a.who, a.until) for a in found.assumptions] == [("the map is loaded", "A. Person", "2027-01-01")]
    assert {d.key for d in found.deficits}.isdisjoint({"open", "conditional"})
    beside = {a.text: a.needed_by for a in made(MODEL, read).assumptions}
    assert beside["the map is loaded"] == (), "the proof does not need it"


def test_every_tool_that_speaks_for_a_claim_is_assumed_to_answer_rightly() -> None:
    (tools,) = (a for a in made(MODEL, TESTED).assumptions if a.key == TOOLS)
    assert tools.text.split("\n") == ["z3", "hypothesis"]


def test_a_test_of_the_source_is_no_proof() -> None:
    assert words(MODEL, TESTED).startswith("1 proved (model")
    assert words(SOURCE, TESTED) == "1 proved (source in float64)"


@pytest.mark.parametrize(
    ("record", "named"),
    [
        (evidence(G, Verdict.MONITORED, "rosmonitoring", of=Object.RECORDING), True),
        (evidence(G, Verdict.TESTED, "experiment", of=Object.RECORDING), True),
        (TESTED, False),
    ],
)
def test_a_recording_rests_on_the_programs_being_those_of_today(record: Evidence, named: bool) -> None:
    about = [a.words for a in made(record).assumptions]
    assert ("What is recorded is what the programs and settings of today do" in about) is named


def gate(*records: Evidence, policy: object = None) -> Gate:
    return next(g for g in made(*records, policy=policy).gates if g.id == "program")


GOOD = evidence(FAULTLESS, Verdict.TESTED, "hypothesis")
AGREES = evidence(LINKED, Verdict.TESTED, "hypothesis")


@pytest.mark.parametrize(
    ("records", "passed"),
    [
        ([GOOD, AGREES, MODEL], True),
        ([GOOD, MODEL], False),  # what is relied upon is a model, and whether the program is it is not known
        ([GOOD, SOURCE], True),
        ([AGREES, SOURCE], False),
        ([GOOD, evidence(LINKED, Verdict.UNKNOWN, "hypothesis"), MODEL], False),
        ([GOOD, evidence(LINKED, Verdict.UNKNOWN, "hypothesis"), MODEL, SOURCE], True),
    ],
)
def test_what_is_claimed_of_programs_has_a_gate(records: list[Evidence], passed: bool) -> None:
    assert gate(*records).passed is passed
    assert gate(*records, policy={"programs": []}).passed


def test_a_system_without_programs_has_no_such_gate() -> None:
    found = case(system({"n": ["g"]}), [G], [MODEL])
    assert not [g for g in found.gates if g.id == "program"]


@pytest.mark.parametrize(
    ("needed", "named"),
    [(["n.g", "initial n.o"], True), (["n.g", "initial n.#0"], False), (["n.g"], False)],
)
def test_a_proof_from_first_values_rests_on_the_plans_words_for_them(needed: list[str], named: bool) -> None:
    """A delayed connection of a node to itself has no obligation of its own that names them."""
    asked = obligation("system", Kind.REQUIREMENT, "R")
    proof = evidence(asked, Verdict.PROVED, "compose", details={"needed": needed})
    requirement = Requirement("R", "It holds", "n.o", None, ("n",))
    whole = system({"n": ["g"]}, plans=[node_plan("n", "medium", "hoare")], requirements=[requirement])
    found = case(whole, [G, asked], [MODEL, proof])
    assert ("Each delayed input begins with the first value that the plan gives" in _words(found)) is named


@pytest.mark.parametrize(
    ("formula", "supported_by", "named"),
    [
        ("n.o", ("n",), False),
        ("n.o -> m.o", ("n",), True),  # a reaction from one node to another, also if one guarantee is enough
        ("n.o", ("n", "m"), True),
        (None, ("n", "m"), True),  # in prose, over the same nodes
        (None, ("m",), False),
    ],
)
def test_a_requirement_over_several_nodes_rests_on_answers_in_time(
    formula: str | None, supported_by: tuple[str, ...], named: bool
) -> None:
    requirement = Requirement("R", "It holds", formula, None, supported_by)
    goals = [obligation(node, Kind.GUARANTEE, "g") for node in ("n", "m")]
    asked = obligation("system", Kind.REQUIREMENT, "R")
    proof = evidence(asked, Verdict.PROVED, "compose", details={"needed": [f"{node}.g" for node in supported_by]})
    plans = [node_plan(node, "medium", "hoare") for node in ("n", "m")]
    whole = system({"n": ["g"], "m": ["g"]}, plans=plans, requirements=[requirement])
    found = case(whole, [*goals, *([asked] if formula else [])], [proof] if formula else [])
    about = [a for a in found.assumptions if a.key == "assumptions.platform.reaction"]
    assert [a.words for a in about] == [
        "All nodes step together: each answers in time, and a reaction takes no time"
    ] * named
    assert all(a.needed_by == ("R",) and a.sort == "the platform" for a in about)


def _words(found: Case) -> list[str]:
    return [a.words for a in found.assumptions]

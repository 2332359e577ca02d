"""What is assumed of the environment can go on for ever, and leaves room for what guarantees are about."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import some

from avow.base.verdict import Outcome, Verdict
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from calculus.make import make, node, outcomes

COUNTS = "in.x == previous(in.x, 0) + 1"
DYING = {
    "counts up to a limit": (f"{COUNTS} and in.x <= 3", "x : INTEGER"),
    "never the same twice, of two": ("in.x != previous(in.x, FALSE) and not once(rose(in.x))", "x : BOOL"),
    "held for ever, and not for long": ("in.x and not held[5 steps](in.x)", "x : BOOL"),
    "contradicts itself": ("in.x > 3 and in.x < 2", "x : REAL"),
}
LIVING = {
    "counts": (COUNTS, "x : INTEGER"),
    "comes back": ("abs(in.x - previous(in.x, in.x)) <= 1 and in.x <= 3", "x : REAL"),
    "not for long": ("not held[5 steps](in.x)", "x : BOOL"),
}


def found(folder: Path, assumed: str, port: str, more: str = "") -> dict[str, Outcome]:
    plan = f"environment: {{in.x: {{assume: '{assumed}', because: it is so}}}}\n"
    plan += "requirements: {R: {text: never, formula: 'not n.y'}}\n"
    return outcomes(make(folder, node("n", port, "y : BOOL", f"G: out.y or not out.y{more}"), plan))


@pytest.mark.parametrize("name", DYING)
def test_an_environment_that_comes_to_an_end_supports_nothing(name: str, tmp_path: Path) -> None:
    outcome = found(tmp_path, *DYING[name])["environment.in.x"]
    assert outcome.vacuous
    assert "for ever" in outcome.summary


@pytest.mark.parametrize("name", LIVING)
def test_one_that_goes_on_is_supposed(name: str, tmp_path: Path) -> None:
    outcome = found(tmp_path, *LIVING[name])["environment.in.x"]
    assert (outcome.verdict, outcome.vacuous) == (Verdict.JUSTIFIED, False)


def test_what_nodes_assume_of_the_environment_counts_too(tmp_path: Path) -> None:
    nodes = [
        node(n, "x : INTEGER", f"{n}y : BOOL", f"A: {a}", "G: TRUE") for n, a in (("n", COUNTS), ("m", "in.x <= 3"))
    ]
    for name, text, ends in (("both", "\n".join(nodes), True), ("one", nodes[0], False)):
        answers = outcomes(make(tmp_path / name, text, "environment: {in.x: {because: one wire}}\n"))
        assert answers["environment.n.A1"].vacuous is ends


@pytest.mark.parametrize("name", [*DYING, *LIVING])
def test_a_nodes_own_assumptions_are_asked_the_same(name: str) -> None:
    assumed, port = (DYING | LIVING)[name]
    contract, faults = check_text(node("n", port, "y : BOOL", f"A: {assumed}", "G: out.y"), "n.rcl")
    assert contract is not None, faults
    results = {result.name: result.verdict for result in analyse(contract.nodes[0])}
    assert results["assumptions-satisfiable"] is (Verdict.REFUTED if name in DYING else Verdict.PROVED)


@pytest.mark.parametrize(("assumed", "excluded"), [("in.r < 120", True), ("in.r < 130", False)])
def test_an_environment_in_which_a_guarantee_is_about_nothing_supports_nothing(
    assumed: str, excluded: bool, tmp_path: Path
) -> None:
    text = node("n", "r : REAL", "y : BOOL", "A: in.r >= 0", "G high: in.r >= 120 -> out.y")
    plan = f"environment: {{in.r: {{assume: '0 <= in.r and {assumed}', because: it is so}}}}\n"
    outcome = outcomes(make(tmp_path, text, plan))["environment.in.r"]
    assert outcome.vacuous is excluded
    assert ("n.high" in outcome.summary) is excluded


@pytest.mark.parametrize(("promised", "excluded"), [("out.s == in.r", True), ("out.s >= in.r", False)])
def test_guarantees_count_where_a_condition_mentions_outputs(promised: str, excluded: bool, tmp_path: Path) -> None:
    text = node("n", "r : REAL", "y : BOOL, s : REAL", "G high: in.r + out.s >= 240 -> out.y", f"G same: {promised}")
    plan = "environment: {in.r: {assume: 'in.r < 120', because: it is so}}\n"
    assert outcomes(make(tmp_path, text, plan))["environment.in.r"].vacuous is excluded


@pytest.mark.parametrize(
    ("assumed", "excluded"),
    [("in.r < 120", True), ("in.r < 130", False), ("in.r < in.s", False), ("in.r < in.s and in.s < 119", True)],
)
def test_what_another_node_assumes_of_the_same_input_is_asked_the_same(
    assumed: str, excluded: bool, tmp_path: Path
) -> None:
    text = node("n", "r : REAL", "y : BOOL", "G high: in.r >= 120 -> out.y")
    text += node("m", "r, s : REAL", "z : BOOL", f"A few: {assumed}", "G low: in.r >= 0 -> out.z")
    plan = "environment: {in.r: {because: so}, in.s: {because: so}}\n"
    outcome = outcomes(make(tmp_path, text, plan))["environment.m.few"]
    assert outcome.vacuous is excluded
    assert ("n.high" in outcome.summary) is excluded


OVER_RUNS = {
    "a response": ("p : BOOL", "in.p -> next(out.y)", {"p": "not in.p"}),
    "a response until": ("p, q : BOOL", "in.p -> out.y until in.q", {"p": "not in.p"}),
    "once": ("x : REAL", "once(in.x > 5) -> out.y", {"x": "in.x < 3"}),
    "held": ("p : BOOL", "held[2 steps](in.p) -> out.y", {"p": "in.p -> next(not in.p)"}),
    "two that alternate": (
        "p, q : BOOL",
        "(in.p and in.q) -> out.y",
        {"p": "in.p == previous(not in.p, TRUE)", "q": "in.q == previous(not in.q, FALSE)"},
    ),
    "a constant": (
        "x, k : INTEGER",
        "in.x != previous(in.x, in.x) -> out.y",
        {"x": "", "k": "in.k > previous(in.k, 0)"},
    ),
}
"""Ports, a guarantee, and what is assumed of each input; nothing: that it is constant."""


@pytest.mark.parametrize("name", OVER_RUNS)
def test_a_condition_that_no_run_of_the_environment_meets_is_found(name: str, tmp_path: Path) -> None:
    ports, guarantee, assumed = OVER_RUNS[name]
    text = node("n", ports, "y : BOOL", f"G g: {guarantee}")

    def asked(said: dict[str, str], folder: Path) -> list[Outcome]:
        keys = {p: f"assume: '{a}'" if a else "constant: true" for p, a in said.items()}
        rows = [f"in.{p}: {{{key}, because: so}}" for p, key in keys.items()]
        answers = outcomes(make(folder, text, f"environment: {{{', '.join(rows)}}}\n"))
        return [outcome for key, outcome in answers.items() if key.startswith("environment.")]

    found = asked(assumed, tmp_path / "never")
    assert found
    assert all(outcome.vacuous and "n.g" in outcome.summary for outcome in found)
    free = asked({p: f"in.{p} == in.{p}" for p in assumed}, tmp_path / "free")
    assert not any(outcome.vacuous for outcome in free)


CONSTANT = {
    "that it changes": ("in.k != previous(in.k, in.k) -> out.y", True),
    "that it changed once": ("once(changed(in.k)) -> out.y", True),
    "that it is another than it was": ("(in.k > 3 and previous(in.k < 2, FALSE)) -> out.y", True),
    "what it is": ("in.k > 3 -> out.y", False),
    "that another input changes": ("changed(in.x) -> out.y", False),
}


@pytest.mark.parametrize("assumed", ["", "assume: 'in.k > 0', "])
@pytest.mark.parametrize("name", CONSTANT)
def test_that_an_input_is_constant_is_a_claim_of_its_own(name: str, assumed: str, tmp_path: Path) -> None:
    guarantee, vacuous = CONSTANT[name]
    text = node("n", "k : INTEGER, x : BOOL", "y : BOOL", f"G g: {guarantee}")
    answers = outcomes(make(tmp_path, text, f"environment: {{in.k: {{{assumed}constant: true, because: so}}}}\n"))
    found = answers["environment.in.k.constant" if assumed else "environment.in.k"]
    assert found.vacuous is vacuous
    assert found.verdict is Verdict.JUSTIFIED


RESTS = {
    "of itself": ("n.k == previous(n.k, n.k)", True),
    "through a guarantee": ("n.y == previous(n.y, n.y)", True),
    "not at all": ("n.z -> n.x", False),
}


@pytest.mark.parametrize("name", RESTS)
def test_what_is_proved_from_an_input_that_is_constant_rests_on_that(name: str, tmp_path: Path) -> None:
    formula, rests = RESTS[name]
    text = node("n", "k : INTEGER, x : BOOL", "y : INTEGER, z : BOOL", "G g: out.y == in.k", "G h: out.z -> in.x")
    plan = "environment: {in.k: {constant: true, because: so}}\n"
    plan += f"requirements: {{R: {{text: it holds, formula: '{formula}'}}}}\n"
    found = outcomes(make(tmp_path, text, plan))["R"]
    assert found.verdict is Verdict.PROVED
    assert any(h.name.endswith("environment.in.k") for h in found.rests_on) is rests


PACED = {
    "slower than messages are assumed to come": ("once[1 s](arrived(in.x))", "every 2 s", True),
    "slow enough to miss one": ("once[1 s](arrived(in.x))", "every 1001 ms", True),
    "just as fast": ("once[1 s](arrived(in.x))", "every 1 s", False),
    "perhaps slower": ("once[1 s](arrived(in.x))", "at most 2 s", False),
    "too slow to end in time": ("in.x -> within[300 ms](not in.x)", "every 400 ms", False),
    "of what must end and must not": ("(in.x or once(in.x)) and not held[1 s](in.x)", "every 2 s", True),
}
OWNED = [(name, of) for name in PACED if name != "perhaps slower" for of in ("a node", "another node")]


@pytest.mark.parametrize(
    ("name", "of"), [*some([(name, "the plan") for name in PACED], 2, slow=4), *some(OWNED, 0, slow=len(OWNED))]
)
def test_a_world_that_no_steps_of_the_declared_pace_can_meet_supports_nothing(
    name: str, of: str, tmp_path: Path
) -> None:
    assumed, pace, ends = PACED[name]
    paced = node("n", "x : BOOL", "y : BOOL", *([f"A: {assumed}"] if of == "a node" else []), "G: out.y or not out.y")
    text = paced.replace("topics()", f"topics()\n  steps( {pace} )")
    if of == "another node":
        text += node("m", "x : BOOL", "z : BOOL", f"A: {assumed}", "G: out.z")
    said = f"assume: '{assumed}', " if of == "the plan" else ""
    answers = outcomes(make(tmp_path, text, f"environment: {{in.x: {{{said}because: one wire}}}}\n"))
    (found,) = (outcome for key, outcome in answers.items() if key.startswith("environment."))
    assert found.vacuous is ends, found.summary
    if of == "a node":
        contract, _ = check_text(text, "n.rcl")
        assert contract is not None
        (result,) = analyse(contract.nodes[0], wanted={"assumptions-satisfiable"})
        assert result.verdict is (Verdict.REFUTED if ends else Verdict.PROVED)


def test_nodes_with_steps_of_their_own_each_end_no_world(tmp_path: Path) -> None:
    text = "".join(
        node(n, "x : BOOL", f"{n}y : BOOL", "G: TRUE").replace("topics()", f"topics()\n  steps( every {pace} ms )")
        for n, pace in (("n", 10), ("m", 20))
    )
    plan = "environment: {in.x: {assume: 'not held[1 s](in.x)', because: so}}\n"
    outcome = outcomes(make(tmp_path, text, plan))["environment.in.x"]
    assert (outcome.verdict, outcome.vacuous) == (Verdict.JUSTIFIED, False), outcome.summary

"""A claim that has no value is not met: of every engine the same, for each partial operation."""

from __future__ import annotations

from pathlib import Path

import pytest
from calculus.make import make, node, outcomes
from hoare.systems import make_job

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND as HOARE
from avow.backends.hypothesis import BACKEND as HYPOTHESIS
from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.traces import parse_event
from avow.base.verdict import Verdict
from avow.calculus.refinement import refines
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from avow.sanity.results import Bounds

# true of whatever the operation might yield, of an output that nothing keeps from zero, or from being short
CLAIMS = [
    "1 / {0}x == 1 or 1 / {0}x != 1",
    "exists(y in REAL | y == 1 / {0}x)",
    "forall(y in REAL | y == 1 / {0}x -> y == 1 / {0}x)",
    "not (1 / {0}x < 0 and 1 / {0}x > 0)",
    "abs(1 / {0}x) >= 0",
    "(if 1 / {0}x > 0 then 1 else 2) > 0",
    "{0}s(0) == 0 or {0}s(0) != 0",
    "{0}s({0}k) == {0}s({0}k)",
    "exists(i in INTEGER | i == {0}s(0))",
    "exists_unique(i in INTEGER | i == {0}s(0))",
    "xor({0}s(0) == 0, {0}s(0) != 0)",
    "{0}s(0) in {{0, 1}} <=> {0}s(0) in {{1, 0}}",
]
GUARDS = {"x": "{0}x != 0", "s": "{0}k < length({0}s) and length({0}s) > 0"}
OUTPUTS = "x : REAL, k : NATURAL, s : <INTEGER>"


def guarded(claim: str) -> str:
    return f"{GUARDS['x' if '{0}x' in claim else 's']} -> ({claim})"


@pytest.fixture(params=range(len(CLAIMS)))
def claim(request: pytest.FixtureRequest) -> str:
    return CLAIMS[request.param]


def plan(claim: str, temporal: bool = False) -> str:
    kind = "temporal" if temporal else "formula"
    text = f"always ({claim})" if temporal else claim
    scenario = "scenario: {steps: 2, domains: {n.x: ['0', '1'], n.k: ['0', '1'], n.s: ['<>', '<0, 1>']}}\n"
    return f"{scenario}requirements: {{R: {{text: t, {kind}: '{text}'}}}}\n"


def test_composition(claim: str, tmp_path: Path) -> None:
    text = node("n", "", OUTPUTS, "G: out.x >= 0")
    for name, formula, wanted in (("bare", claim, False), ("guarded", guarded(claim), True)):
        found = outcomes(make(tmp_path / name, text, plan(formula.format("n."))))
        verdict = next(outcome for label, outcome in found.items() if label.endswith("R")).verdict
        assert verdict is (Verdict.PROVED if wanted else Verdict.REFUTED)


@pytest.mark.parametrize("text", ["always (1 / n.x == 1 or 1 / n.x != 1)", "not eventually (1 / n.x < 1)"])
def test_over_runs(text: str, tmp_path: Path) -> None:
    """Neither that it holds always, nor that it never does: there it has no value."""
    of = plan("TRUE").replace("formula: 'TRUE'", f"temporal: '{text}'")
    found = outcomes(make(tmp_path, node("n", "", OUTPUTS, "G: out.x >= 0"), of))
    assert next(outcome for label, outcome in found.items() if label.endswith("R")).verdict is Verdict.REFUTED


@pytest.mark.slow
def test_refinement_and_sanity(claim: str) -> None:
    def one(formula: str) -> object:
        contract, faults = check_text(node("n", "", OUTPUTS, f"G: {formula}"), "n.rcl")
        assert contract is not None, faults
        return contract.nodes[0]

    weak, bare, safe = one("out.x >= 0 or out.x < 0"), one(claim.format("out.")), one(guarded(claim).format("out."))
    assert refines(weak, bare).verdict is Verdict.REFUTED
    assert refines(weak, safe).verdict is Verdict.PROVED
    # it demands something: that the value is there; with the guard, nothing
    for contract, wanted in ((bare, Verdict.PROVED), (safe, Verdict.REFUTED)):
        (found,) = (r for r in analyse(contract, bounds=Bounds(2_000)) if r.name.startswith("not-tautological-G"))
        assert found.verdict is wanted


PROGRAM = {
    "hoare": ({"program": "n.imp"}, "n.imp", "k := 0\nIF b THEN\n  x := 0\n  s := []\nELSE\n  x := 1\n  s := [0]\n"),
    "hypothesis": (
        {"subject": "s.py:step"},
        "s.py",
        "def step(b):\n    return {'x': 0 if b else 1, 's': [] if b else [0], 'k': 0}\n",
    ),
}
TOOLS = {"hoare": HOARE, "hypothesis": HYPOTHESIS}


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["hoare", "hypothesis"])
def test_programs(claim: str, tool: str, tmp_path: Path) -> None:
    options, file, text = PROGRAM[tool]
    rcl = node("n", "b : BOOL", OUTPUTS, f"G bare: {claim.format('out.')}", f"G safe: {guarded(claim).format('out.')}")
    job = make_job(tmp_path, rcl, "n", options, {file: text}, tool)
    assert not [d for d in TOOLS[tool].check(job) if d.is_error]
    found = {
        o.obligation.rpartition("/")[2]: o for o in TOOLS[tool].discharge(job, job.root, Limits(seconds=20)).outcomes
    }
    assert found["bare"].verdict is Verdict.REFUTED, found["bare"].summary
    assert found["safe"].verdict.supports, found["safe"].summary


def test_monitors(claim: str, tmp_path: Path) -> None:
    topics = ", ".join([f"a/I {port[-1]} matches({port})" for port in ("in.b", "out.x", "out.k", "out.s")])
    rcl = node("n", "b : BOOL", OUTPUTS, f"G bare: {claim.format('out.')}", f"G safe: {guarded(claim).format('out.')}")
    rcl = rcl.replace("topics()", f"topics({topics})")
    mapping = {"in.b": "b", "out.x": "x", "out.k": "k", "out.s": "s"}
    job = make_job(tmp_path, rcl, "n", {"mapping": mapping}, {}, "rosmonitoring")
    found, faults = setup(job.system, job.node, job.method.options)
    assert (faults, dict(found.hidden)) == ((), {})
    monitor = Monitor(found, ["bare", "safe"])
    said = [*monitor.step(parse_event('{"topic": "b", "b": true}'))]
    for topic, value in (("x", 0), ("k", 0), ("s", [])):
        said += monitor.step(parse_event(f'{{"topic": "{topic}", "{topic}": {value}}}'))
    assert [v.clause for v in said] == ["bare"]

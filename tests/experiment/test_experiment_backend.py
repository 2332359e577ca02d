"""From plan to verdict, on good data, bad data, hostile data, and the published figures."""

from __future__ import annotations

import csv
import io
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Backend, Limits
from avow.backends.experiment import BACKEND
from avow.base.diagnostics import Rejected
from avow.base.verdict import Link, Outcome, Verdict
from avow.conformance.seeded import Seeded

ROOT = Path(__file__).resolve().parents[2] / "contracts"
GOOD: dict[str, Any] = {"data": "runs.csv", "measure": "d", "within": 0.25, "unit": "m"}


def settle(job: Any) -> Outcome:
    (outcome,) = BACKEND.discharge(job, job.root, Limits()).outcomes
    return outcome


def rows(*distances: str) -> str:
    return "run,d\n" + "".join(f"{i},{d}\n" for i, d in enumerate(distances, 1))


def runs(number: int, greatest: str = "0.1") -> list[str]:
    """Distances of so many runs, no two of them equal."""
    return [f"{Decimal(greatest) - Decimal(n) / 1000}" for n in range(number)]


def test_it_is_a_backend() -> None:
    assert isinstance(BACKEND, Backend)
    assert BACKEND.tools() == ()


def test_no_failure_in_47_runs_is_tested(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(rows(*runs(47, "0.25")))
    outcome = settle(make_job(**GOOD))
    assert outcome.verdict is Verdict.TESTED
    assert outcome.link is Link.GUIDED
    assert outcome.bound["runs"] == 47
    assert outcome.bound["failures"] == 0
    assert 0.0617 < float(str(outcome.bound["failure probability at most"])) < 0.0619
    assert "6.2 %" in outcome.summary


def test_the_tolerance_may_be_a_constant_or_have_a_unit(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(rows(*runs(47, "0.25")))
    for within in ("Tolerance", "25 cm", "0.25", "250 mm"):
        assert settle(make_job(**{**GOOD, "within": within})).verdict is Verdict.TESTED
    assert settle(make_job(**{**GOOD, "within": "24 cm"})).verdict is Verdict.REFUTED


def test_the_pipelines_own_options_are_not_ours(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(rows(*[f"0.1{n:02}" for n in range(47)]))
    assert BACKEND.check(make_job(**GOOD, id="x", guarantees=["arrives"], seconds=5, megabytes=9, seed=1)) == ()


COPIES = {
    "lines": lambda n: "0.1,7",
    "a counter hides them": lambda n: f"0.1,{n}",
    "a spelling hides them": lambda n: f"0.1{'0' * n},7",
}


@pytest.mark.parametrize("copy", COPIES.values(), ids=COPIES)
def test_equal_runs_count_once_and_are_told(
    make_job: Callable[..., Any], tmp_path: Path, copy: Callable[[int], str]
) -> None:
    lines = [f"r{n},{copy(n % 30)}" for n in range(47)]
    (tmp_path / "runs.csv").write_text("\n".join(["name,d,stamp", *lines]) + "\n")
    job = make_job(**GOOD, run_column="name")
    assert {d.code for d in BACKEND.check(job)} == {"EXP115"}
    outcome = settle(job)
    assert (outcome.verdict, outcome.bound["runs"]) == (Verdict.UNKNOWN, 1)


def test_equal_failures_count_each(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(rows(*runs(46), *["0.3"] * 20))
    outcome = settle(make_job(**GOOD, at_least=0.9))
    assert (outcome.verdict, outcome.bound["failures"]) == (Verdict.REFUTED, 20)


FLATTER = (
    "min(d, 0.2)",
    "min(d, ten)",
    "0.1",
    "d / 10",
    "abs(d - 0.1)",
    "d / ten",
    "ten * d",
    "d - d",
    "abs(d - d)",
    "d / d",
    "mean(d, d - d)",
    "mean(d, ten)",
    "sqrt(d)",
    "hypot(d - d, ten - ten)",
    "max(d) - mean(d, d)",
    "d - ten - d",
    "d + d",
    "-d",
    "(d - ten)",
    "d - hypot(d, ten)",
    "d - max(d, ten)",
    "ten - mean(d, ten)",
    "max(ten, d) - mean(ten, d)",
    "abs(d) - abs(ten)",
)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        *(({"measure": text}, "EXP106") for text in FLATTER),
        ({"confidence": 0.5}, "EXP101"),
        ({"at_least": 0.1}, "EXP105"),
    ],
)
def test_what_would_flatter_is_refused(
    make_job: Callable[..., Any], tmp_path: Path, options: dict[str, Any], code: str
) -> None:
    lines = "".join(f"{n},0.1{n:02},10{'.0' * (n % 2)}\n" for n in range(47))
    (tmp_path / "runs.csv").write_text("run,d,ten\n" + lines)
    job = make_job(**{**GOOD, **options})
    assert code in {d.code for d in BACKEND.check(job) if d.is_error}
    assert settle(job).verdict is Verdict.ERROR


RCL = """context {{ Tolerance = 0.25; Reach = 3.0; }}
node drive {{ inputs( goal : REAL ) outputs( x : REAL, n : NATURAL, there : BOOL ) topics() guarantee arrives ( {0} ) }}
"""
COMPARES = "in.goal >= 7.5 -> in.goal - Tolerance <= out.x <= in.goal + Tolerance"
BOUND = "forall(a in REAL | out.x == a -> a - Tolerance <= 0.0)"
OTHERS = "out.x <= 0.25 or out.x > Reach and out.x < 0"
NAMES_NONE = "in.goal >= 7.5 -> out.there"


@pytest.mark.parametrize(
    ("formula", "within", "unit", "comes"),
    [
        (COMPARES, "Tolerance", "m", "tested"),
        (COMPARES, 0.25, "m", "tested"),
        (COMPARES, "25 cm", "m", "tested"),
        (COMPARES, "Tolerance m", "m", "tested"),
        (COMPARES, "Tolerance m", "cm", "refused"),
        (COMPARES, "Tolerance km", "m", "refused"),
        (COMPARES, "25 cm", "cm", "refused"),
        (COMPARES, "Reach", "m", "refused"),
        (COMPARES, 7.5, "m", "refused"),
        (COMPARES, 30, "m", "refused"),
        (BOUND, 0.25, "m", "tested"),
        (BOUND, 0.26, "m", "refused"),
        ("out.x > Tolerance", "Tolerance", "m", "refused"),
        ("Tolerance < out.x", "Tolerance", "m", "refused"),
        ("not out.x <= Tolerance", "Tolerance", "m", "refused"),
        ("not out.x > Tolerance", "Tolerance", "m", "tested"),
        ("0 <= out.x and out.x <= Tolerance", "Tolerance", "m", "tested"),
        ("0.2 <= out.x and out.x <= Tolerance", "Tolerance", "m", "refused"),
        ("out.x == 3.0", "Reach", "m", "refused"),
        ("out.x <= 0", "Reach", "m", "refused"),
        ("out.n <= 1", "Reach", "m", "refused"),
        ("out.n <= 3", "Reach", "m", "tested"),
        (OTHERS, "Reach", "m", "refused"),
        (OTHERS, 0.25, "m", "refused"),
        ("out.x <= Tolerance or out.x <= Reach", "Reach", "m", "refused"),
        ("out.x <= Tolerance and out.n <= 3", 3, "m", "refused"),
        ("out.x <= Tolerance and exists(a in REAL | a <= Reach)", "Reach", "m", "refused"),
        ("out.there -> out.x <= Tolerance", "Tolerance", "m", "refused"),
        ("out.there <=> out.x <= Tolerance", "Tolerance", "m", "refused"),
        ("0.1 * out.x <= Tolerance", "Tolerance", "m", "refused"),
        ("out.x * out.x <= Tolerance * Tolerance", "Tolerance", "m", "tested"),
        ("out.x * out.x <= Reach", "Reach", "m", "refused"),
        (NAMES_NONE, "Reach", "m", "supposed"),
        (NAMES_NONE, "300 cm", "m", "supposed"),
        (NAMES_NONE, 30, "m", "supposed"),
        (NAMES_NONE, 7.5, "m", "supposed"),
    ],
)
def test_the_tolerance_is_the_contracts(
    tmp_path: Path, formula: str, within: str | float, unit: str, comes: str
) -> None:
    options = {"data": "runs.csv", "measure": "d", "within": within, "unit": unit}
    files = {"runs.csv": rows(*[f"0.1{n:02}" for n in range(47)])}
    case = Seeded("case", RCL.format(formula), options, {"arrives": Verdict.TESTED}, files)
    outcome = settle(case.written(BACKEND, tmp_path))
    match comes:
        case "tested" | "supposed":
            assert outcome.verdict is Verdict.TESTED, outcome.summary
            assert any("is what the guarantee allows" in h for h in outcome.hypotheses) is (comes == "supposed")
        case _:
            assert outcome.verdict is Verdict.ERROR
            assert "is not its tolerance" in outcome.summary


@pytest.mark.parametrize(
    ("formula", "verdict"),
    [
        ("out.x < Tolerance", Verdict.REFUTED),
        ("not out.x >= Tolerance", Verdict.REFUTED),
        ("out.x <= Tolerance and out.x < Tolerance", Verdict.REFUTED),
        ("out.x <= Tolerance", Verdict.TESTED),
    ],
)
def test_strictness_is_kept(tmp_path: Path, formula: str, verdict: Verdict) -> None:
    options = {"data": "runs.csv", "measure": "d", "within": "Tolerance"}
    files = {"runs.csv": rows(*runs(47, "0.25"))}
    outcome = settle(Seeded("c", RCL.format(formula), options, {"arrives": verdict}, files).written(BACKEND, tmp_path))
    assert outcome.verdict is verdict, outcome.summary


def test_half_a_width_goes_with_a_free_centre(tmp_path: Path) -> None:
    lines = "".join(f"{n},0.1{n:02},0.2{n:02}\n" for n in range(47))
    options = {"data": "runs.csv", "measure": "max(a, b) - mean(a, b)", "within": "Tolerance"}
    near = "c - Tolerance <= out.x <= c + Tolerance"
    for formula, verdict in (
        (f"exists(c in REAL | {near})", Verdict.TESTED),
        ("in.goal - Tolerance <= out.x <= in.goal + Tolerance", Verdict.ERROR),
    ):
        case = Seeded("c", RCL.format(formula), options, {"arrives": verdict}, {"runs.csv": "run,a,b\n" + lines})
        outcome = settle(case.written(BACKEND, tmp_path / verdict))
        assert outcome.verdict is verdict, outcome.summary


@pytest.mark.parametrize(("criticality", "number"), [("high", 29), ("medium", 14), ("low", 5)])
def test_the_least_success_rate_follows_from_the_criticality(
    make_job: Callable[..., Any], tmp_path: Path, criticality: str, number: int
) -> None:
    job = make_job(**GOOD)
    (node,) = job.system.plan.nodes
    plan = replace(job.system.plan, nodes=(replace(node, criticality=criticality),))
    job = replace(job, system=replace(job.system, plan=plan))
    for made, verdict in ((number - 1, Verdict.UNKNOWN), (number, Verdict.TESTED)):
        (tmp_path / "runs.csv").write_text(rows(*runs(made)))
        assert settle(job).verdict is verdict


def test_one_failing_run_refutes_and_is_named(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(rows(*runs(46, "0.2"), "0.2500000000000000000001"))
    outcome = settle(make_job(**GOOD))
    assert outcome.verdict is Verdict.REFUTED
    assert outcome.counterexample is not None
    assert dict(outcome.counterexample.values)["run"] == "47"
    assert dict(outcome.counterexample.values)["d"].startswith("0.25")


def test_a_claimed_rate_allows_failures_only_as_far_as_the_runs_show_it(
    make_job: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "runs.csv").write_text(rows(*runs(46, "0.2"), "0.3"))
    assert settle(make_job(**GOOD, at_least=0.9)).verdict is Verdict.TESTED
    assert "statistically" in " ".join(settle(make_job(**GOOD, at_least=0.9)).hypotheses)
    refuted = settle(make_job(**GOOD, at_least=0.95))
    assert refuted.verdict is Verdict.REFUTED
    assert refuted.counterexample is not None


@pytest.mark.parametrize("change", ["deleted", "renamed", "looser", "figures", "another column"])
def test_a_failing_run_is_not_forgotten_by_deleting_it(
    make_job: Callable[..., Any], tmp_path: Path, change: str
) -> None:
    """Whoever leaves it out says so, and why; somebody has to stand for that."""
    (tmp_path / "runs.csv").write_text(rows(*runs(46, "0.2"), "0.3"))
    first = make_job(**GOOD)
    refuted = settle(first)
    assert refuted.verdict is Verdict.REFUTED
    kept = {o.id: (refuted.details["case"],) for o in first.obligations}
    options, expected = dict(GOOD), Verdict.UNKNOWN
    (tmp_path / "runs.csv").write_text(rows(*runs(46, "0.2")))
    match change:
        case "renamed":  # another run has its name now
            (tmp_path / "runs.csv").write_text(rows(*runs(47, "0.2")))
        case "looser":
            options["within"], expected = 0.5, Verdict.TESTED
        case "figures":
            (tmp_path / "s.yaml").write_text("n: 47\nmean: 0.1 m\nmin: 0.05 m\nmax: 0.2 m\nsource: here\n")
            options = {"summary": "s.yaml", "within": 0.25, "unit": "m"}
        case "another column":
            lines = rows(*runs(46, "0.2")).replace("run,d", "run,e")
            (tmp_path / "runs.csv").write_text(lines)
            options["measure"] = "e"
    outcome = settle(replace(make_job(**options), kept=kept))
    assert outcome.verdict is expected, outcome.summary
    if expected is Verdict.UNKNOWN:
        assert "47; put them back" in outcome.summary
        explained = replace(make_job(**options, left_out={"runs": [47], "because": "it hit the door"}), kept=kept)
        outcome = settle(explained)
        assert outcome.verdict is Verdict.TESTED
        assert "that run 47 failed does not count: it hit the door" in outcome.hypotheses
        other = replace(make_job(**options, left_out={"runs": [46], "because": "it hit the door"}), kept=kept)
        assert settle(other).verdict is Verdict.UNKNOWN


def test_a_failing_run_that_is_still_there_says_nothing_new(make_job: Callable[..., Any], tmp_path: Path) -> None:
    """Under another name, in another place, and where so many runs show the claimed rate all the same."""
    (tmp_path / "runs.csv").write_text(rows("0.3", *runs(20, "0.2")))
    first = make_job(**GOOD, at_least=0.9)
    refuted = settle(first)
    assert refuted.verdict is Verdict.REFUTED
    kept = {o.id: (refuted.details["case"],) for o in first.obligations}
    (tmp_path / "runs.csv").write_text(rows(*runs(70, "0.2"), "0.30"))
    assert settle(replace(first, kept=kept)).verdict is Verdict.TESTED


def test_too_few_runs_are_never_green(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(rows("0.1", "0.1"))
    few = settle(make_job(**GOOD))
    assert few.verdict is Verdict.UNKNOWN
    assert "14 are needed" in few.summary
    (tmp_path / "runs.csv").write_text(rows(*runs(28)))
    assert settle(make_job(**GOOD, at_least=0.9)).verdict is Verdict.UNKNOWN
    (tmp_path / "runs.csv").write_text(rows(*runs(29)))
    assert settle(make_job(**GOOD, at_least=0.9)).verdict is Verdict.TESTED


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("", 1, "empty"),
        ("run,d\n", 1, "no runs"),
        ("run,e\n1,0.1\n", 1, "no column 'd'"),
        ("run,d,d\n1,0.1,0.1\n", 1, "twice"),
        ("run,d\n1,nan\n", 2, "not a number"),
        ("run,d\n1,0.1\n2,inf\n", 3, "not a number"),
        ("run,d\n1,\n", 2, "empty cell"),
        ("run,d\n1,21 cm\n", 2, "not a number"),
        ("run,d\n1,-0.1\n", 2, "negative"),
        ("run,d\n1,0.1\n1,0.2\n", 3, "second run named"),
        ("run,d\n1\n", 2, "1 cells"),
        ('run,d\n1,"0.1\n', 2, "not CSV"),
        ("run,d\n1,0.1\n\n ,0.1\n", 4, "no name"),
        ("run,d\n1,=0.1+0.1\n", 2, "not a number"),
        ('d\n0.1\n""\n0.2\n', 3, "empty cell"),  # a run without a measurement is no blank line
        ("run,d,D\n1,0.1,0.2\n", 1, "nobody can tell the column 'd' from 'D'"),
        ("run,d,\u0501\n1,0.1,0.2\n", 1, "nobody can tell"),
        ("run,d,d\u200b\n1,0.1,0.2\n", 1, "nobody can tell"),
        ("run,d,\uff44\n1,0.1,0.2\n", 1, "nobody can tell"),
        ("run,d\n1,\u0661\n", 2, "not a number"),
        ('run,d\n1,"0,1"\n', 2, "not a number"),
        ("run;d\n1;0.1\n", 1, "no column 'd'"),
        ("run,d\r1,0.1\r\n2,x\n", 3, "not a number"),
        ("run,d\n1,1e400\n", 2, "not a number"),
    ],
)
def test_bad_data_is_told_with_its_line_and_never_green(
    make_job: Callable[..., Any], tmp_path: Path, text: str, line: int, word: str
) -> None:
    (tmp_path / "runs.csv").write_text(text)
    job = make_job(**GOOD)
    first = BACKEND.check(job)[0]
    assert first.span is not None
    assert first.span.line == line
    assert word in first.message
    outcome = settle(job)
    assert outcome.verdict is Verdict.ERROR
    assert word in outcome.summary
    assert f"runs.csv:{line}" in outcome.summary


def test_data_that_are_not_text(make_job: Callable[..., Any], tmp_path: Path) -> None:
    for data in (b"run,d\n1,\xff\n", b"run,d\n1,\0\n"):
        (tmp_path / "runs.csv").write_bytes(data)
        assert settle(make_job(**GOOD)).verdict is Verdict.ERROR


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({**GOOD, "data": "nowhere.csv"}, "no file"),
        ({**GOOD, "data": "../runs.csv"}, "system's folder"),
        ({**GOOD, "data": "/etc/passwd"}, "system's folder"),
        ({**GOOD, "data": "a\0b"}, "system's folder"),
        ({"data": "runs.csv", "summary": "s.yaml", "within": 1}, "either"),
        ({"measure": "d", "summary": "runs.csv", "within": 1}, "goes with"),
        ({**GOOD, "measure": "open('x')"}, "measure"),
        ({**GOOD, "within": "Tolerence"}, "neither"),
        ({**GOOD, "within": "Yes"}, "not a number"),
        ({**GOOD, "within": "3 s"}, "compare"),
        ({**GOOD, "within": -1}, "negative"),
        ({**GOOD, "within": float("nan")}, "neither"),
        ({**GOOD, "confidence": 1}, "confidence"),
        ({**GOOD, "confidence": "high"}, "number"),
        ({**GOOD, "at_least": 1}, "between"),
        ({**GOOD, "run_column": "who"}, "no column 'who'"),
    ],
)
def test_bad_options_are_told(make_job: Callable[..., Any], tmp_path: Path, options: dict[str, Any], word: str) -> None:
    (tmp_path / "runs.csv").write_text(rows(*runs(47)))
    job = make_job(**options)
    problems = BACKEND.check(job)
    assert any(word in p.message for p in problems), problems
    assert all(p.is_error for p in problems)
    assert settle(job).verdict is Verdict.ERROR
    BACKEND.files(job)


def test_a_copied_run_is_noticed(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(
        "run,x,y,d\n1,1,2,0.1\n2,1,2,0.1\n" + "".join(f"{i},{i},0,0.1\n" for i in range(3, 50))
    )
    job = make_job(**GOOD)
    (warning,) = BACKEND.check(job)
    assert not warning.is_error
    assert warning.span is not None
    assert warning.span.line == 3
    assert "warnings" in settle(job).details


def test_export_is_pure(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(rows("0.1"))
    job = make_job(**GOOD, protocol='quotes " and */ {braces}')
    assert BACKEND.export(job) == BACKEND.export(job)
    assert '"within": "1/4"' in BACKEND.export(job)["claim.json"]
    with pytest.raises(Rejected):
        BACKEND.export(make_job())


PUBLISHED = "n: 47\nmean: 21.4 cm\nsd: 4 mm\nmin: 8 cm\nmax: 43 cm\n"


def test_the_published_figures_are_refuted_and_contradict_each_other(
    make_job: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "s.yaml").write_text(PUBLISHED)
    outcome = settle(make_job(summary="s.yaml", within="25 cm", unit="cm"))
    assert outcome.verdict is Verdict.REFUTED
    assert outcome.counterexample is not None
    assert "3.65 cm" in outcome.counterexample.explanation
    assert "4 mm is printed" in outcome.counterexample.explanation
    assert "43 cm" in outcome.summary
    assert outcome.details["failures"] == {"at least": 1, "at most": 37}
    assert 0.0969 < float(str(outcome.bound["failure probability at most"])) < 0.0971


def test_contradictory_figures_alone_are_an_error(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(PUBLISHED)
    assert settle(make_job(summary="s.yaml", within="50 cm", unit="m")).verdict is Verdict.ERROR


@pytest.mark.parametrize(
    "text",
    [
        "n: 3\nmean: 9\nmin: 1\nmax: 5\n",
        "n: 3\nmin: 5\nmax: 1\n",
        "n: 10\nmean: 4.90\nmin: 1.00\nmax: 5.00\n",
        "n: 10\nmean: 3\nmin: 1\nmax: 5\nsd: 9.0\n",
    ],
)
def test_impossible_figures(make_job: Callable[..., Any], tmp_path: Path, text: str) -> None:
    (tmp_path / "s.yaml").write_text(text)
    assert settle(make_job(summary="s.yaml", within=100)).verdict is Verdict.ERROR


def test_possible_figures_rest_on_being_true(make_job: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text("n: 47\nmean: 21.4\nmin: 8\nmax: 24\nsd: 3\nunit: cm\n")
    outcome = settle(make_job(summary="s.yaml", within="25 cm", unit="cm"))
    assert outcome.verdict is Verdict.TESTED
    assert any("not examined" in h for h in outcome.hypotheses)
    (tmp_path / "s.yaml").write_text("n: 47\nmean: 21.4\nmin: 8\nmax: 25\nsd: 3\nunit: cm\n")
    outcome = settle(make_job(summary="s.yaml", within="25 cm", unit="cm"))
    assert outcome.verdict is Verdict.UNKNOWN, "25 may be 25.4, rounded"


@pytest.mark.parametrize(
    "text",
    ["", "[1]", "n: many\nmean: 1", "n: 0\nmean: 1", "mean: 1", "n: 4", "n: 4\nmean: about 3", "n: 4\nmean: [3]",
     "n: 4\nmean: 3 s", "n: 4\nmean: -3", "n: 4\nmean: .nan", "n: 4\nmean: 3\nmeen: 4", "n: 4\nmean: 3\nmean: 4",
     "n: true\nmean: 3", "n: 4\nmean: 3\nunit: s", "{", "n: 4\nmean: !!float 3"],
)  # fmt: skip
def test_bad_summaries_are_told(make_job: Callable[..., Any], tmp_path: Path, text: str) -> None:
    (tmp_path / "s.yaml").write_text(text)
    job = make_job(summary="s.yaml", within=100, unit="cm")
    problems = BACKEND.check(job)
    assert problems
    assert all(p.span is not None and p.span.file.endswith("s.yaml") for p in problems)
    assert settle(job).verdict is Verdict.ERROR


@pytest.mark.slow
def test_the_simulation_reproduces_its_data_byte_for_byte() -> None:
    program = ROOT / "remote_inspection/models/simulate_navigation.py"
    made = subprocess.run([sys.executable, program], capture_output=True, check=True, timeout=60).stdout
    kept = (ROOT / "remote_inspection/data/navigation_runs.csv").read_bytes()
    assert made == kept
    runs = list(csv.DictReader(io.StringIO(kept.decode())))
    assert len(runs) == 47
    assert len({(r["goal_x"], r["goal_y"]) for r in runs}) == 47

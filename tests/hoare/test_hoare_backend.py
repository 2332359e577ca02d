"""The Hoare backend end to end: what is proved, what is refuted and by which run, and what it says of bad plans."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.backend_kit.protocol import Backend, Job, Limits
from avow.backends.hoare import BACKEND
from avow.backends.hoare import backend as settling
from avow.backends.hoare.triples import one_line
from avow.base.diagnostics import Rejected
from avow.base.verdict import Link, Outcome, Verdict
from avow.evidence.record import OUTPUT_FOR_EVERY_INPUT
from avow.language.terms import Term
from avow.solving import second
from hoare.systems import make_job, sensor

GOLDEN = Path(__file__).parent / "golden"

PROGRAM = """input := r
IF (input < 120) THEN
   output := green
ELSE
   IF (input < 250) THEN
      output := orange
   ELSE
      output := red
done := before
MATCH command WITH inspect(i) THEN
   done[i] := TRUE
"""
TABLE = {"out.colour": "output"}
LISTING = """input := radiation_at(i)
IF (input < 120) THEN
   output := green
ELSE
   IF (input < 250) THEN
      output := orange
   ELSE
      output := red
"""
MEANT = """
context { Colour : {red, orange, green}; Command : { move(REAL, REAL), inspect(NATURAL) }; Done : NATURAL --> BOOL; }
node sensor {
  inputs( r : REAL, command : Command )
  outputs( colour : Colour, done : Done )
  topics( a/R r matches(in.r) )
  assume( 0 <= in.r )
  guarantee( forall(i in NATURAL | in.command == inspect(i) -> ( out.done(i) == TRUE
    and (0 <= in.r and in.r < 120 -> out.colour == green)
    and (120 <= in.r and in.r < 250 -> out.colour == orange)
    and (250 <= in.r -> out.colour == red) )) )
}
"""
PAPERS_TABLE = {
    "in.r": "radiation_at(i)",
    "in.command": "inspect(i)",
    "out.colour": "output",
    "out.done(i)": "input == radiation_at(i)",
}


def job(folder: Path, rcl: str, program: str, table: dict[str, Any] | None = None) -> Job:
    options: dict[str, Any] = {"program": "p.imp"}
    if table is not None:
        options["variables"] = table
    return make_job(folder, rcl, "sensor", options, {"p.imp": program}, "hoare")


def settle(wanted: Job) -> dict[str, Outcome]:
    assert not [d for d in BACKEND.check(wanted) if d.is_error]
    report = BACKEND.discharge(wanted, wanted.root, Limits(seconds=30))
    return {o.obligation.rpartition("/")[2]: o for o in report.outcomes}


def verdicts(wanted: Job) -> dict[str, Verdict]:
    return {name: outcome.verdict for name, outcome in settle(wanted).items()}


def test_it_is_a_backend() -> None:
    assert isinstance(BACKEND, Backend)


def test_the_sensor_is_proved(tmp_path: Path) -> None:
    found = settle(job(tmp_path, sensor(), PROGRAM, TABLE))
    for name in ("marks", "low", "medium", "high"):
        outcome = found[name]
        assert (outcome.verdict, outcome.vacuous, outcome.link) == (Verdict.PROVED, False, Link.GENERATED)
    assert not any(o.hypotheses for o in found.values())
    assert found["low"].summary.startswith("1 Hoare triple proved: 1 verification condition")


@pytest.mark.parametrize(
    ("old", "new", "broken"),
    some(
        [
            ("input < 120", "input < 130", {"medium"}),
            ("input < 120", "input <= 120", {"medium"}),
            ("input < 250", "input <= 250", {"high"}),
            ("input < 250", "input > 250", {"medium", "high"}),
            ("input := r", "input := r + 0.001", {"low", "medium"}),
            ("output := green", "output := orange", {"low"}),
            ("done[i] := TRUE", "done[i + 1] := TRUE", {"marks"}),
            ("done[i] := TRUE", "SKIP", {"marks"}),
            ("done[i] := TRUE", "done[i] := done[i]", {"marks"}),
            ("WITH inspect(i) THEN\n   done[i] := TRUE", "WITH move(x, y) THEN\n   done[0] := TRUE", {"marks"}),
            ("output := red", "SKIP", {"high"}),
        ],
        4,
    ),
)
def test_seeded_faults_are_refuted(tmp_path: Path, old: str, new: str, broken: set[str]) -> None:
    assert old in PROGRAM
    found = settle(job(tmp_path, sensor(), PROGRAM.replace(old, new), TABLE))
    assert {name for name, o in found.items() if o.verdict is Verdict.REFUTED} == broken
    assert all(o.verdict is Verdict.PROVED for name, o in found.items() if name not in broken)
    assert all(found[name].counterexample is not None for name in broken)


def test_what_two_solvers_do_not_agree_on_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second.importlib.util, "find_spec", lambda _: object())
    for answer, expected in (("sat", Verdict.ERROR), ("unknown", Verdict.PROVED), (None, Verdict.PROVED)):
        monkeypatch.setattr(second.smtlib, "ask_cvc5", lambda *_, answer=answer, **__: answer)
        found = settle(job(tmp_path, sensor(), PROGRAM, TABLE))
        assert {found[name].verdict for name in ("marks", "low", "medium", "high")} == {expected}
        assert all("contradict" in o.summary for o in found.values() if o.verdict is Verdict.ERROR)


def test_a_moved_threshold_is_refuted_by_a_simple_reading(tmp_path: Path) -> None:
    found = settle(job(tmp_path, sensor(orange=130), PROGRAM, TABLE))
    assert found["low"].verdict is Verdict.REFUTED
    shown = found["low"].counterexample
    assert shown is not None
    assert dict(shown.values)["in.r"] == "125"
    assert dict(shown.values)["out.colour"] == "orange"
    assert found["medium"].verdict is Verdict.PROVED


def test_the_papers_four_triples(tmp_path: Path) -> None:
    wanted = job(tmp_path, MEANT, LISTING, PAPERS_TABLE)
    outcome = settle(wanted)["G1"]
    assert (outcome.verdict, outcome.link, outcome.vacuous) == (Verdict.PROVED, Link.MAPPED, False)
    assert outcome.hypotheses == ("in.command is inspect(i): the plan covers no other value of it",)
    triples = outcome.details["triples"]
    assert isinstance(triples, list)
    same = "inspect(i) = inspect(i')"
    assert [(t["pre"], t["post"]) for t in triples] == [
        (f"0 ≤ radiation_at(i) ∧ {same}", "(input = radiation_at(i')) = true"),
        (f"0 ≤ radiation_at(i) ∧ {same} ∧ radiation_at(i) < 120", "output = green"),
        (f"0 ≤ radiation_at(i) ∧ {same} ∧ 120 ≤ radiation_at(i) ∧ radiation_at(i) < 250", "output = orange"),
        (f"0 ≤ radiation_at(i) ∧ {same} ∧ 250 ≤ radiation_at(i)", "output = red"),
    ]


def test_the_appendix_program_is_refuted(tmp_path: Path) -> None:
    appendix = LISTING.replace("120", "10").replace("250", "20")
    outcome = settle(job(tmp_path, MEANT, appendix, PAPERS_TABLE))["G1"]
    assert outcome.verdict is Verdict.REFUTED
    assert outcome.counterexample is not None
    assert 10 <= float(dict(outcome.counterexample.values)["in.r"]) < 120
    triples = outcome.details["triples"]
    assert isinstance(triples, list)
    assert [t["verdict"] for t in triples] == ["proved", "refuted", "refuted", "proved"]


def test_a_tautology_is_proved_but_vacuous(tmp_path: Path) -> None:
    rcl = MEANT.replace(
        "(0 <= in.r and in.r < 120 -> out.colour == green)", "0 <= in.r and in.r < 120 -> out.colour == green"
    )
    rcl = rcl.replace(
        "(120 <= in.r and in.r < 250 -> out.colour == orange)", "120 <= in.r and in.r < 250 -> out.colour == orange"
    )
    rcl = rcl.replace("(250 <= in.r -> out.colour == red)", "250 <= in.r -> out.colour == red")
    outcome = settle(job(tmp_path, rcl, LISTING, PAPERS_TABLE))["G1"]
    assert (outcome.verdict, outcome.vacuous) == (Verdict.PROVED, True)


def test_that_a_proof_is_vacuous_is_asked_of_a_second_solver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Term] = []

    def contradicted(impossible: Iterable[Term], **_: object) -> bool:
        asked.extend(impossible)
        return False

    monkeypatch.setattr(f"{settling.__name__}.contradicted", contradicted)
    rcl = MEANT.replace("(0 <= in.r and in.r < 120 ->", "(in.r < 0 and in.r > 0 ->")
    assert rcl != MEANT
    nothing = settle(job(tmp_path, rcl, LISTING, PAPERS_TABLE))["G1"]
    details = nothing.details["triples"]
    assert isinstance(details, list)
    vacuous = [triple["pre"] for triple in details if triple["vacuous"]]
    assert vacuous
    assert set(vacuous) <= {one_line(formula) for formula in asked}


ONE = """
context {{ Colour : {{red, green}}; }}
node sensor {{
  inputs( a : {a}, b : {a} )
  outputs( y : {y}, ok : BOOL )
  topics( p/T t matches(in.a) )
  assume( {assume} )
  guarantee( {guarantee} )
}}
"""


def small(guarantee: str, assume: str = "TRUE", a: str = "REAL", y: str = "REAL") -> str:
    return ONE.format(guarantee=guarantee, assume=assume, a=a, y=y)


@pytest.mark.parametrize(
    ("program", "verdict"),
    some(
        [
            ("IF a < b THEN y := b ELSE y := a", Verdict.PROVED),
            ("IF a < b THEN y := a ELSE y := b", Verdict.REFUTED),
            ("y := b\nIF y < a THEN y := a", Verdict.PROVED),
            ("y := a\ny := b", Verdict.REFUTED),
            ("b := a\nIF b < a THEN y := a ELSE y := b", Verdict.REFUTED),  # the contract speaks of b as it was given
            ("a := a - b\nIF a < 0 THEN y := b ELSE y := a + b", Verdict.PROVED),
            ("SKIP", Verdict.REFUTED),
        ],
        3,
    ),
)
def test_maximum(tmp_path: Path, program: str, verdict: Verdict) -> None:
    rcl = small("out.y >= in.a and out.y >= in.b and (out.y == in.a or out.y == in.b)")
    program = program if "y :=" in program else "VAR y : REAL;\nIF a < a THEN y := a\n" + program
    assert verdicts(job(tmp_path, rcl, program))["G1"] is verdict


def test_division_by_zero_breaks_a_triple(tmp_path: Path) -> None:
    rcl = small("in.a > 0 -> out.y * in.b == in.a")
    outcome = settle(job(tmp_path, rcl, "y := a / b"))["G1"]
    assert outcome.verdict is Verdict.REFUTED
    assert "division by zero" in outcome.summary
    assert verdicts(job(tmp_path, small("out.y * in.b == in.a", "in.b > 0"), "y := a / b"))["G1"] is Verdict.PROVED


@pytest.mark.parametrize(
    ("program", "total"),
    [
        ("IF a < b THEN y := b", False),
        ("y := a\nIF a < b THEN y := b", True),
        ("IF a < b THEN y := b ELSE IF a > b THEN SKIP ELSE y := a", False),
    ],
)
def test_an_output_without_a_value_is_told(tmp_path: Path, program: str, total: bool) -> None:
    """The guarantee is proved: it says nothing of the path that does not assign. But some input has no output."""
    wanted = job(tmp_path, small("in.a < in.b -> out.y == in.b"), program)
    outcome = settle(wanted)["G1"]
    assert (outcome.verdict, OUTPUT_FOR_EVERY_INPUT in outcome.details) == (Verdict.PROVED, total)
    assert [d.code for d in BACKEND.check(wanted)] == ([] if total else ["HOARE420"])


@pytest.mark.slow
def test_a_run_without_an_output_refutes_what_a_triple_cannot_tell(tmp_path: Path) -> None:
    """Where b is 0, the guarantee has no truth value: no run shows its triple to be broken. But there is no output."""
    rcl = small("0 <= in.a / in.b < 1 -> out.y <= in.a")
    program = "IF 0 <= a / b < 2 THEN\n  y := a\nELSE\n  y := 0"
    outcome = settle(job(tmp_path, rcl, program))["G1"]
    assert outcome.verdict is Verdict.REFUTED
    assert outcome.counterexample is not None
    assert dict(outcome.counterexample.values)["in.b"] == "0"
    assert "division by zero" in outcome.summary
    guarded = small("0 <= in.a / in.b < 1 -> out.y <= in.a", "in.b != 0")
    assert verdicts(job(tmp_path, guarded, program))["G1"] is Verdict.PROVED


def test_short_circuit_guards_a_division(tmp_path: Path) -> None:
    program = "IF b != 0 and a / b > 1 THEN y := 1 ELSE y := 0"
    assert verdicts(job(tmp_path, small("0 <= out.y <= 1"), program))["G1"] is Verdict.PROVED
    swapped = "IF a / b > 1 and b != 0 THEN y := 1 ELSE y := 0"
    assert verdicts(job(tmp_path, small("0 <= out.y <= 1"), swapped))["G1"] is Verdict.REFUTED


def test_naturals_stay_natural(tmp_path: Path) -> None:
    rcl = small("out.y + 1 == in.a", "in.a >= 1", a="NATURAL", y="NATURAL")
    assert verdicts(job(tmp_path, rcl, "y := a - 1"))["G1"] is Verdict.PROVED
    unsure = small("out.y + 1 == in.a", a="NATURAL", y="NATURAL")
    assert verdicts(job(tmp_path, unsure, "y := a - 1"))["G1"] is Verdict.REFUTED


LOOP = """
y := 0
n := 0
WHILE n < a INVARIANT {invariant} {variant} DO
  y := y + b
  n := n + 1
"""


def test_loops(tmp_path: Path) -> None:
    rcl = small("out.y == in.a * in.b", a="NATURAL", y="NATURAL")
    good = LOOP.format(invariant="y == n * b and n <= a", variant="VARIANT a - n")
    total = settle(job(tmp_path, rcl, good))["G1"]
    assert (total.verdict, total.hypotheses) == (Verdict.PROVED, ())
    partial = settle(job(tmp_path, rcl, LOOP.format(invariant="y == n * b and n <= a", variant="")))["G1"]
    assert partial.verdict is Verdict.PARTIAL
    assert partial.hypotheses == ("the loop at line 4 of p.imp terminates",)


@pytest.mark.parametrize(
    ("loop", "verdict"),
    [
        ("n := n + 1", Verdict.PROVED),
        ("n := n + 1\n  y := y", Verdict.UNKNOWN),
        ("n := n + 1\n  y := y + 1", Verdict.REFUTED),
    ],
)
def test_what_a_loop_does_not_assign_stays_without_an_invariant(tmp_path: Path, loop: str, verdict: Verdict) -> None:
    rcl = small("out.y == in.b + 1", a="NATURAL")
    program = f"y := b + 1\nn := 0\nWHILE n < a INVARIANT n <= a VARIANT a - n DO\n  {loop}"
    assert verdicts(job(tmp_path, rcl, program))["G1"] is verdict


@pytest.mark.parametrize(
    ("invariant", "variant"),
    some([("y == n * b", ""), ("TRUE", ""), ("FALSE", ""), ("y == n * b and n <= a", "VARIANT n")], 2, slow=2),
)
def test_a_weak_invariant_is_unknown_not_refuted(tmp_path: Path, invariant: str, variant: str) -> None:
    rcl = small("out.y == in.a * in.b", a="NATURAL", y="NATURAL")
    assert verdicts(job(tmp_path, rcl, LOOP.format(invariant=invariant, variant=variant)))["G1"] is Verdict.UNKNOWN


def test_a_wrong_loop_is_refuted_by_running_it(tmp_path: Path) -> None:
    rcl = small("out.y == in.a * in.b", a="NATURAL", y="NATURAL")
    wrong = LOOP.format(invariant="y == n * b and n <= a", variant="").replace("n < a", "n <= a")
    outcome = settle(job(tmp_path, rcl, wrong))["G1"]
    assert outcome.verdict is Verdict.REFUTED
    assert outcome.counterexample is not None


def test_an_endless_loop_is_not_proved(tmp_path: Path) -> None:
    rcl = small("out.y == 5", a="NATURAL", y="NATURAL")
    endless = "y := 0\nWHILE TRUE INVARIANT TRUE {} DO\n  y := 1"
    for variant in ("", "VARIANT y"):
        outcome = settle(job(tmp_path, rcl, endless.format(variant)))["G1"]
        assert (outcome.verdict, outcome.counterexample is None) == (Verdict.REFUTED, False)


def test_updates_see_the_map_before(tmp_path: Path) -> None:
    rcl = """
    context { Map : INTEGER --> INTEGER; }
    node sensor { inputs( m : Map, i : INTEGER ) outputs( n : Map ) topics( p/T t matches(in.i) )
      assume( TRUE )
      guarantee swap ( out.n(in.i) == in.m(in.i + 1) and out.n(in.i + 1) == in.m(in.i) )
      guarantee rest ( forall(k in INTEGER | k != in.i and k != in.i + 1 -> out.n(k) == in.m(k)) )
      guarantee nested ( out.n(out.n(in.i)) == out.n(in.m(in.i + 1)) ) }
    """
    good = "n := m\nn[i] := n(i + 1)\nn[i + 1] := m(i)"
    assert set(verdicts(job(tmp_path, rcl, good)).values()) == {Verdict.PROVED}
    bad = "n := m\nn[i] := n(i + 1)\nn[i + 1] := n(i)"
    found = verdicts(job(tmp_path, rcl, bad))
    assert (found["swap"], found["rest"]) == (Verdict.REFUTED, Verdict.PROVED)


def test_pattern_names_do_not_capture_the_contracts(tmp_path: Path) -> None:
    """The contract quantifies over i, and so does the pattern: they are different."""
    renamed = sensor().replace("forall(i in", "forall(k in").replace("before(i)", "before(k)")
    renamed = renamed.replace("done(i)", "done(k)").replace("inspect(i)", "inspect(k)")
    assert verdicts(job(tmp_path / "a", sensor(), PROGRAM, TABLE)) == verdicts(
        job(tmp_path / "b", renamed, PROGRAM, TABLE)
    )


def test_a_map_that_is_an_input_may_be_assigned(tmp_path: Path) -> None:
    program = PROGRAM.replace("done := before\n", "").replace("done[i]", "before[i]")
    found = verdicts(job(tmp_path / "a", sensor(), program, {**TABLE, "out.done": "before"}))
    assert found["marks"] is Verdict.PROVED
    wrong = program.replace("before[i] := TRUE", "before[i] := FALSE")
    found = verdicts(job(tmp_path / "b", sensor(), wrong, {**TABLE, "out.done": "before"}))
    assert found["marks"] is Verdict.REFUTED


# -- bad plans and programs --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("program", "table", "code", "part", "file"),
    [
        ("output = red", TABLE, "HOARE100", "`=` compares", "p.imp"),
        (PROGRAM.replace("input <", "inputt <", 1), TABLE, "HOARE200", "inputt", "p.imp"),
        (PROGRAM.replace(":= green", ":= gren"), TABLE, "HOARE200", "gren", "p.imp"),
        (PROGRAM.replace("input <", "abs(input) <", 1), TABLE, "HOARE200", "programs say it with IF", "p.imp"),
        (
            PROGRAM.replace("input < 120", "output < 120"),
            TABLE,
            "HOARE300",
            "is of numbers, and this is of type Colour",
            "p.imp",
        ),
        (PROGRAM.replace("inspect(i)", "inspect(i, j)"), TABLE, "HOARE300", "1 argument", "p.imp"),
        (PROGRAM.replace("WITH inspect", "WITH inspekt"), TABLE, "HOARE300", "does not make", "p.imp"),
        (PROGRAM.replace("done[i]", "input[i]"), TABLE, "HOARE300", "no map", "p.imp"),
        (PROGRAM, {}, "HOARE400", "out.colour", "system.rcl"),
        (PROGRAM, {"out.color": "output"}, "HOARE400", "no such", "plan.yaml"),
        (PROGRAM, {"out.colour": "outptu"}, "HOARE400", "neither sets", "plan.yaml"),
        (PROGRAM, {**TABLE, "out.done(i, j)": "TRUE"}, "HOARE400", "1 different", "plan.yaml"),
        (PROGRAM, {**TABLE, "out.done(1 + 1)": "TRUE"}, "HOARE400", "neither a port", "plan.yaml"),
        (PROGRAM, {**TABLE, "in.r": "((("}, "HOARE100", "did not expect", "plan.yaml"),
        ("red := green\n" + PROGRAM, TABLE, "HOARE200", "cannot be assigned", "p.imp"),
        ("VAR r : BOOL;\n" + PROGRAM, TABLE, "HOARE300", "REAL", "system.rcl"),
        ("VAR q : RAEL;\n" + PROGRAM, TABLE, "HOARE200", "RAEL", "p.imp"),
        (PROGRAM + "x := forall(k in NATURAL | k >= 0)", TABLE, "HOARE300", "cannot compute", "p.imp"),
        (PROGRAM + "x := in.r", TABLE, "HOARE200", "in.r", "p.imp"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(
    tmp_path: Path, program: str, table: dict[str, str], code: str, part: str, file: str
) -> None:
    wanted = job(tmp_path, sensor(), program, table)
    found = BACKEND.check(wanted)
    matching = [d for d in found if d.code == code and part in d.message]
    assert matching, [str(d) for d in found]
    assert matching[0].span is not None
    assert Path(matching[0].span.file).name == file
    assert {o.verdict for o in BACKEND.discharge(wanted, tmp_path, Limits()).outcomes} == {Verdict.ERROR}
    assert BACKEND.export(wanted) == {}


@pytest.mark.parametrize("name", ["nowhere.imp", "../outside.imp", "/etc/passwd"])
def test_a_program_that_is_not_there(tmp_path: Path, name: str) -> None:
    wanted = make_job(tmp_path, sensor(), "sensor", {"program": name}, {}, "hoare")
    assert [d.code for d in BACKEND.check(wanted)] == ["HOARE400"]
    assert BACKEND.files(wanted) == ()


def test_too_many_branches_are_unknown(tmp_path: Path) -> None:
    program = "y := a\n" + "".join(f"IF a < {k} THEN\n  y := y + {k}\nELSE\n  y := y * b\n" for k in range(24))
    outcome = settle(job(tmp_path, small("out.y > 0"), program))["G1"]
    assert outcome.verdict is Verdict.UNKNOWN
    assert "weakest precondition" in outcome.summary


@pytest.mark.parametrize(
    ("formula", "holds"),
    [
        ("exists_unique(i in NATURAL | TRUE)", False),
        ("exists_unique(t in Two | y == 0)", False),
        ("exists_unique(t in One | y == 0)", True),
        ("exists_unique(t in Two | t == one and y == 0)", True),
        ("exists_unique(i in INTEGER | i == a and y == 0)", True),
    ],
)
def test_exactly_one_of_what_always_holds(tmp_path: Path, formula: str, holds: bool) -> None:
    rcl = (
        "context { One : {only}; Two : {one, other}; }\n"
        f"node n {{ inputs( a : INTEGER ) outputs( y : INTEGER ) topics() guarantee g ( {formula} ) }}\n"
    )
    job = make_job(tmp_path, rcl, "n", {"program": "n.imp"}, {"n.imp": "y := 0\n"}, "hoare")
    outcome = BACKEND.discharge(job, tmp_path, Limits(seconds=20)).outcomes[0]
    assert outcome.verdict is (Verdict.PROVED if holds else Verdict.REFUTED), outcome.summary


# -- artifacts ---------------------------------------------------------------------------------------------------------


def test_export_is_pure_and_golden(tmp_path: Path) -> None:
    wanted = job(tmp_path, MEANT, LISTING, PAPERS_TABLE)
    made = BACKEND.export(wanted)
    assert made == BACKEND.export(wanted)
    for name in ("G1.2.hoare", "G1.2.pre.smt2"):
        golden = GOLDEN / name
        if os.environ.get("AVOW_REFRESH"):
            golden.write_text(made[name])
        assert made[name] == golden.read_text(), f"{golden} differs: refresh it if the change is meant"


def test_the_exported_conditions_are_unsat(tmp_path: Path) -> None:
    z3 = pytest.importorskip("z3")
    made = BACKEND.export(job(tmp_path, MEANT, LISTING, PAPERS_TABLE))
    scripts = [text for name, text in made.items() if name.endswith(".smt2")]
    assert len(scripts) == 4  # of each triple its condition
    for script in scripts:
        solver = z3.Solver(ctx=z3.Context())
        solver.from_string(script)
        assert solver.check() == z3.unsat


def test_hostile_names_stay_names(tmp_path: Path) -> None:
    program = "// */ }} ${{x}} {%s} <script>\n" + PROGRAM
    wanted = job(tmp_path, sensor(), program, TABLE)
    made = BACKEND.export(wanted)
    assert all("/" not in name and ".." not in name for name in made)
    assert set(verdicts(wanted).values()) == {Verdict.PROVED}


def test_a_name_may_begin_as_a_keyword_does(tmp_path: Path) -> None:
    rcl = """
    node sensor { inputs( in' : NATURAL, or' : BOOL ) outputs( not' : NATURAL, do_it : BOOL ) topics()
      guarantee same ( out.not' == in.in' ) guarantee flag ( out.do_it <=> not in.or' ) }
    """
    program = "not' := in'\nIF or' or not or' THEN\n   do_it := not or'\nELSE\n   do_it := TRUE\n"
    assert set(verdicts(job(tmp_path, rcl, program)).values()) == {Verdict.PROVED}


@pytest.mark.parametrize("depth", [60, 400, 3000])
def test_deep_contracts_do_not_crash(tmp_path: Path, depth: int) -> None:
    deep = "not (" * depth + "out.ok" + ")" * depth
    try:
        wanted = job(tmp_path, small(f"out.y == in.a and {deep}"), "y := a\nok := TRUE")
    except Rejected:
        return  # the language has its own limit
    BACKEND.export(wanted)
    report = BACKEND.discharge(wanted, tmp_path, Limits(seconds=20))
    assert {o.verdict for o in report.outcomes} <= {Verdict.PROVED, Verdict.UNKNOWN, Verdict.ERROR}


def test_match_on_an_element_says_what_to_write(tmp_path: Path) -> None:
    found = BACKEND.check(job(tmp_path, sensor(), PROGRAM + "\nMATCH output WITH red THEN\n   SKIP\n", TABLE))
    assert any(d.code == "HOARE300" and "write IF" in (d.hint or "") for d in found), found

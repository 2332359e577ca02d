"""The compiler to cells against the definitions over all steps of a run, on random formulas; its mutants die."""

from __future__ import annotations

import random

import pytest
from drawn.memory import A, B, N, formula, response, run_of
from helpers import some
from reference.meaning import Step, broken, value

from avow.evaluation.evaluate import evaluate
from avow.evaluation.running import Keeper
from avow.formulas.formula import digest
from avow.formulas.temporal import cells as compiler
from avow.formulas.temporal import responses
from avow.formulas.temporal.cell import Unsaid
from avow.formulas.temporal.cells import Records
from avow.formulas.values import Value
from avow.language.load import check_text
from avow.language.printer import show_term
from avow.language.sorts import BOOL, NATURAL
from avow.language.subterms import histories
from avow.language.terms import FALSE, TRUE, And, Compare, History, Implies, Limit, Literal, Not, Or, Past, Term


def judged(term: Term, run: list[Step]) -> list[Value]:
    """The formula at each step, by its cells."""
    records = Records()
    now = records.clause(term)
    keeper, found = Keeper(records.cells), []
    for step in run:
        found.append(evaluate(now, keeper.at(step)))
        keeper.advance(step)
    return found


def disagreement(rng: random.Random) -> str | None:
    """A formula of which cells and definition say something else somewhere in a run."""
    term, run = formula(rng, rng.randrange(1, 4)), run_of(rng)
    if judged(term, run) != [value(term, run, k) for k in range(len(run))]:
        return show_term(term, "rcl")
    trigger, wanted = response(rng)
    by_cells = judged(Implies(trigger, wanted), run)
    first = next((k for k, holds in enumerate(by_cells) if not holds), None)
    return None if first == broken(Implies(trigger, wanted), run) else show_term(Implies(trigger, wanted), "rcl")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_cells_are_what_the_definitions_say(seed: int) -> None:
    rng = random.Random(seed)
    assert [found for _ in range(150) if (found := disagreement(rng)) is not None] == []


def _late(trigger: Term, response: History) -> Term:
    made = _demanded(trigger, response)
    if response.operator is not Past.WITHIN:
        return made
    since = made.body.body if isinstance(made, Not) and isinstance(made.body, Not) else made.children[0]
    assert isinstance(since, History)
    assert since.limit is not None
    return Not(History(Past.SINCE, since.arguments, BOOL, Limit(">", since.limit.amount, True)))


_demanded = responses._demanded
_latest, _earliest, _kept, _record = Records._latest, Records._earliest, Records._kept, Records._record
_plus = compiler._plus_one

MUTANTS: dict[str, tuple[object, str, object]] = {
    "a response one step late passes": (responses, "_demanded", _late),
    "ages stand still": (compiler, "_plus_one", lambda term: term),
    "ages run twice as fast": (compiler, "_plus_one", lambda term: _plus(_plus(term))),
    "the latest beginning in place of the earliest": (Records, "_earliest", _latest),
    "the earliest beginning in place of the latest": (Records, "_latest", _earliest),
    "what held is forgotten": (
        Records, "_kept",
        lambda self, term, sort, initial, now: _kept(self, term, sort, initial, lambda _: now(initial)),
    ),
    "every step is the first": (Records, "_is_first", lambda self: TRUE),
    "no step is the first": (Records, "_is_first", lambda self: FALSE),
    "a limit is one step shorter": (
        Records, "_latest",
        lambda self, t, h, b, r, a: _latest(self, t, h, b, "<" if r == "<=" else r, a),
    ),
    "a limit leaves its end out": (
        Records, "_earliest",
        lambda self, t, h, b, r, a: _earliest(self, t, h, b, ">" if r == ">=" else r, a),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MUTANTS)
def test_mutants_die(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    where, attribute, mutant = MUTANTS[name]
    monkeypatch.setattr(where, attribute, mutant)
    rng = random.Random(7)
    assert any(disagreement(rng) is not None for _ in range(400))


def test_a_number_of_steps_that_is_written_down_bounds_the_memory() -> None:
    term = History(Past.SINCE, (A, B), BOOL, Limit(">=", Literal(3, NATURAL), True))
    records = Records()
    records.clause(Or((term, History(Past.ONCE, (A,), BOOL, Limit("", Literal(2, NATURAL), True)))))
    keeper, seen = Keeper(records.cells), set()
    rng = random.Random(0)
    for step in run_of(rng, 2000):
        keeper.advance(step)
        seen.add(tuple(keeper.memory.values()))
    assert len(seen) <= 6 * 4


def test_equal_records_share_a_cell() -> None:
    records = Records()
    once = History(Past.ONCE, (A,), BOOL)
    records.clause(And((once, Not(once), History(Past.ROSE, (A,), BOOL))))
    assert len(records.cells) == 2
    one, other = Compare("<", Literal(1, NATURAL), N), Compare(">", N, Literal(1, NATURAL))
    records.clause(And((History(Past.ONCE, (one,), BOOL), History(Past.ONCE, (other,), BOOL))))
    assert len({cell.name for cell in records.cells}) == len(records.cells) == 3


def test_what_no_first_steps_can_break_is_left_out_and_leaves_no_cell() -> None:
    records = Records()
    with pytest.raises(Unsaid, match="eventually"):
        records.clause(Implies(History(Past.ONCE, (A,), BOOL), History(Past.EVENTUALLY, (B,), BOOL)))
    assert records.cells == []


@pytest.mark.parametrize(
    ("said", "last"), [("previous(1 / n, 1) <= previous(1 / n, 2)", True), ("not changed(1 / n)", False)]
)
def test_a_value_of_the_step_before_had_to_be_one_there(said: str, last: bool) -> None:
    """The claim is not met at the step after one where `1 / n` had no value, and every step is judged."""
    contract, found = check_text(f"{_HEAD} guarantee( a or ({said}) ) }}", "n.rcl")
    assert contract is not None, found
    run: list[Step] = [
        {"in.a": a, "in.n": n, "out.b": True} for a, n in ((True, 0), (False, 1), (False, 1), (False, 0))
    ]
    assert judged(contract.nodes[0].guarantees[0].formula, run) == [True, False, True, last]


_HEAD = "node n { inputs( a : BOOL, n : NATURAL ) outputs( b : BOOL ) topics() "


@pytest.mark.parametrize("seed", some(range(4), 2, slow=2))
def test_what_is_printed_reads_back(seed: int) -> None:
    rng = random.Random(100 + seed)
    for _ in range(60):
        trigger, wanted = response(rng)
        for term in (formula(rng, 3), Implies(trigger, wanted)):
            contract, found = check_text(f"{_HEAD} guarantee( {show_term(term, 'rcl')} ) }}", "n.rcl")
            assert contract is not None, found
            (clause,) = contract.nodes[0].guarantees
            assert show_term(clause.formula, "rcl") == show_term(term, "rcl")
            assert digest(clause.formula) == digest(term)
            assert bool(histories(clause.formula)) == bool(histories(term))


@pytest.mark.slow
def test_the_smtlib_script_is_one_step_of_any_run() -> None:
    """With the cells at their first values it has exactly the first steps that keep the clauses; what a step leaves is
    what the cells have next."""
    import z3

    from avow.solving.smtlib import to_smtlib

    rng = random.Random(5)
    for _ in range(20):
        said = formula(rng, 2)
        ports = "inputs( a : BOOL, n : NATURAL ) outputs( b : BOOL ) topics()"
        text = f"node n {{ {ports} guarantee g ( {show_term(said, 'rcl')} ) }}"
        contract, found = check_text(text, "n.rcl")
        assert contract is not None, found
        node = compiler.compile_node(contract.nodes[0])
        script = z3.parse_smt2_string(to_smtlib(contract).text)
        first = {c.name: evaluate(c.initial, {}) for c in node.cells if c.initial is not None}
        for a, b, n in ((a, b, n) for a in (False, True) for b in (False, True) for n in (0, 2)):
            given = {"in.a": a, "out.b": b, "in.n": n} | {f"in.{name}": v for name, v in first.items()}
            solver = z3.Solver()
            solver.add(script)
            for name, v in given.items():
                solver.add((z3.Bool(name) if isinstance(v, bool) else z3.Int(name)) == v)
            held = value(contract.nodes[0].guarantees[0].formula, [{"in.a": a, "out.b": b, "in.n": n}], 0)
            assert (solver.check() == z3.sat) is held, text

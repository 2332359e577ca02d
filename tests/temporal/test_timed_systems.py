"""Systems and contracts with limits in seconds: known answers, and random systems against all their runs."""

from __future__ import annotations

import random
from fractions import Fraction
from pathlib import Path

import pytest
from click.testing import CliRunner
from drawn.memory import X, timed_formula
from helpers import some

from avow.base.verdict import Verdict
from avow.cli.simulate import command as simulate
from avow.evaluation.evaluate import compile_term
from avow.evaluation.running import Keeper
from avow.formulas.formula import free_variables, substitute
from avow.formulas.temporal.ages import CLOCK
from avow.formulas.temporal.cell import Unsaid
from avow.formulas.temporal.clock import Timed, longest_limit, one_step
from avow.formulas.values import Value
from avow.language.load import check_text
from avow.language.sorts import REAL
from avow.language.subterms import histories, timed
from avow.language.terms import Implies, Literal, Past, Term
from avow.sanity.viability import viable
from temporal.test_systems import Enumeration, Step, system, verdicts

STOPPER = """
node lidar {{ inputs( fault : BOOL ) outputs( silent : BOOL ) topics() guarantee same ( out.silent <=> in.fault ) }}
node stopper {{
  inputs( silent : BOOL ) outputs( stopped : BOOL ) topics()
  steps( {pace} )
  guarantee stop "After two seconds of silence it is stopped" ( held[2 s](in.silent) -> out.stopped )
}}
node log {{
  inputs( silent : BOOL, stopped : BOOL ) outputs( fine : BOOL ) topics()
  {more}
  assume stopped "Silent for {by} s, it is stopped" ( held[{by} s](in.silent) -> in.stopped )
  guarantee fine ( out.fine )
}}
"""


def stopped(folder: Path, pace: str, by: str, more: str = "") -> Verdict:
    (folder / "system.rcl").write_text(STOPPER.format(pace=pace, by=by, more=more))
    (folder / "plan.yaml").write_text("{}")
    return verdicts(folder)["whole.log.stopped"]


@pytest.mark.slow
def test_ages_are_the_same_for_all_nodes(tmp_path: Path) -> None:
    assert stopped(tmp_path, "at most 500 ms", "3") is Verdict.PROVED
    assert stopped(tmp_path, "every 500 ms", "2") is Verdict.PROVED


@pytest.mark.slow
def test_steps_that_no_run_can_have_prove_nothing(tmp_path: Path) -> None:
    """Two periods contradict one another in the one time between steps that a system has: then nothing is said."""
    assert stopped(tmp_path, "every 500 ms", "1", "steps( every 300 ms )") is not Verdict.PROVED
    assert stopped(tmp_path, "every 500 ms", "1", "steps( at most 300 ms )") is not Verdict.PROVED


def realizable(text: str) -> Verdict:
    contract, found = check_text(f"node n {{ inputs( r : BOOL ) outputs( s : BOOL ) topics() {text} }}", "n.rcl")
    assert contract is not None, found
    return viable(one_step(contract.nodes[0])).verdict


@pytest.mark.slow
@pytest.mark.parametrize(
    ("clauses", "expected"),
    [
        # an answer that needs another step: who comes too late for it is lost
        ("steps( at most 2 s ) G( rose(in.r) -> within[2 s](s) ) G( rose(in.r) -> not s )", Verdict.PROVED),
        ("steps( at most 2.1 s ) G( rose(in.r) -> within[2 s](s) ) G( rose(in.r) -> not s )", Verdict.REFUTED),
        ("steps( every 2 s ) G( rose(in.r) -> within[2 s](s) ) G( rose(in.r) -> not s )", Verdict.PROVED),
        ("G( rose(in.r) -> within[2 s](s) ) G( rose(in.r) -> not s )", Verdict.REFUTED),
        ("G( rose(in.r) -> within[2 s](s) )", Verdict.PROVED),
        ("G( in.r -> for[2 s](s) )", Verdict.PROVED),
        ("G( in.r -> for[2 s](s) ) G( previous(in.r, FALSE) -> not s )", Verdict.REFUTED),
        ("A( not held[1 s](in.r) ) G( held[2 s](in.r) -> FALSE )", Verdict.PROVED),
        ("G( once[1 s](s) )", Verdict.PROVED),  # what is put out stays so
        ("G( once[1 s](rose(s)) )", Verdict.REFUTED),
        ("steps( at most 1 s ) A( TRUE ) G( once[2 s](rose(s)) )", Verdict.PROVED),
        ("G( s <=> held[2 s](in.r) )", Verdict.REFUTED),  # it would have to change in a silence
        ("G( s <=> once[2 s](in.r) )", Verdict.REFUTED),
        ("G( held[2 s](in.r) -> s )", Verdict.PROVED),
    ],
)
def test_known_answers(clauses: str, expected: Verdict) -> None:
    assert realizable(clauses) is expected


def clause(rng: random.Random) -> Term:
    """A random clause with few states that speaks of a port, without events of messages; most limits are in seconds."""
    while True:
        found = timed_formula(rng, 2)
        if rng.random() < 0.4:
            found = Implies(timed_formula(rng, 1), found)
        found = substitute(found, {X: Literal(Fraction(1), REAL)})
        plain = all(h.operator is not Past.ARRIVED for h in histories(found))
        if plain and free_variables(found) and (timed(found) or rng.random() < 0.3):
            return found


def drawn(seed: int) -> tuple[Term, Term, Term]:
    rng = random.Random(seed)
    return clause(rng), clause(rng), clause(rng)


class EachSecond:
    """A clause with limits in seconds, where each step takes one, by its cells: `test_clock` holds these against the
    definitions."""

    def __init__(self, term: Term) -> None:
        records = Timed(longest=longest_limit([term]))
        self.judge, self.keeper = compile_term(records.clause(term)), Keeper(records.cells)
        self.begins = tuple(self.keeper.memory.items())

    def step(self, step: Step, memory: tuple[tuple[str, Value], ...]) -> tuple[bool, tuple[tuple[str, Value], ...]]:
        self.keeper.memory = dict(memory)
        ports: dict[str, Value] = {**step, CLOCK.qualified: Fraction(1)}
        held = bool(self.judge(self.keeper.at(ports)))
        self.keeper.advance(ports)
        return held, tuple(self.keeper.memory.items())


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(200), 3))
def test_no_run_says_otherwise(seed: int, tmp_path: Path) -> None:
    said, assumed, promised = drawn(seed)

    folder = system(tmp_path, said, assumed, promised, pace="steps( every 1 s )")
    try:
        met = all(assumed for assumed, _, _ in Enumeration(said, assumed, promised, EachSecond).reach())
    except (OverflowError, Unsaid):
        pytest.skip("too many states, or not said")
    found = verdicts(folder)["whole.b.m"]
    assert found is not Verdict.PROVED or met
    assert found is not Verdict.REFUTED or not met


@pytest.mark.slow
def test_a_run_has_its_times(tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(
        "node n { inputs( r : BOOL ) outputs( s : BOOL ) topics() steps( at most 2 s ) "
        "guarantee g ( rose(in.r) -> within[2 s](s) ) guarantee h ( rose(in.r) -> not s ) "
        "guarantee k ( not once[4 s](arrived(in.r)) -> not s ) }"
    )
    (tmp_path / "plan.yaml").write_text("{}")
    told = CliRunner().invoke(simulate, [str(tmp_path), "--steps", "12", "--seed", "3"], catch_exceptions=False)
    assert told.exit_code == 0, told.output
    assert "step 12" in told.output
    assert "at 0 s" in told.output

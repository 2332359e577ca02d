"""Random systems whose clauses have memory against an enumeration of every run: nothing proved is broken by a run,
and nothing refuted is kept by all."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from calculus.make import all_obligations, settle_all
from click.testing import CliRunner
from drawn.memory import clause
from helpers import some
from oracle.stepping import Watch

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.calculus.composition import compose
from avow.calculus.export import derived_contract
from avow.cli.compose import command as compose_command
from avow.cli.simulate import command as simulate
from avow.formulas.temporal.cells import CELL
from avow.language.load import check_text
from avow.language.printer import show_term
from avow.language.terms import Term
from avow.system.load import load_system

Step = Mapping[str, bool]
STATES = 400
PLAN = """requirements:
  R: {{text: "R", formula: "{}", supported_by: [a, b]}}
"""


class Enumeration:
    """Every run of two nodes over truth values: `a` reads `e` and says `w`, `b` reads `w` and says `v`."""

    def __init__(self, said: Term, assumed: Term, promised: Term, watch: Callable[[Term], Any] = Watch) -> None:
        """`watch`: how a clause is read, a step at a time."""
        self.parts = [(watch(term), names) for term, names in ((said, "ew"), (assumed, "ww"), (promised, "wv"))]

    def reach(self) -> Iterator[tuple[bool, bool, Step]]:
        """Of every step that a run can come to: whether b's assumption holds, whether it and all before did, and the
        step's values. Raises OverflowError where there are too many states."""
        first = (*(watch.begins for watch, _ in self.parts), True)
        seen, waiting = {first}, [first]
        while waiting:
            *memories, kept = waiting.pop()
            for e, w, v in product((False, True), repeat=3):
                values = {"e": e, "w": w, "v": v}
                walked = [
                    watch.step({"in.a": values[one], "out.b": values[other]}, memory)
                    for (watch, (one, other)), memory in zip(self.parts, memories, strict=True)
                ]
                (said, assumed, promised), after = zip(*walked, strict=True)
                still = kept and assumed
                if not said or (still and not promised):
                    continue
                yield assumed, still, values
                state = (*after, still)
                if state not in seen:
                    seen.add(state)
                    waiting.append(state)
                    if len(seen) > STATES:
                        raise OverflowError


def system(folder: Path, said: Term, assumed: Term, promised: Term, required: str = "", pace: str = "") -> Path:
    def text(term: Term, one: str, other: str) -> str:
        return show_term(term, "rcl").replace("in.a", f"in.{one}").replace("out.b", other)

    (folder / "system.rcl").write_text(
        f"node a {{ inputs( e : BOOL ) outputs( w : BOOL ) topics() {pace}"
        f" guarantee g ( {text(said, 'e', 'out.w')} ) }}\n"
        f"node b {{ inputs( w : BOOL ) outputs( v : BOOL ) topics() assume m ( {text(assumed, 'w', 'in.w')} )"
        f" guarantee h ( {text(promised, 'w', 'out.v')} ) }}\n"
    )
    (folder / "plan.yaml").write_text(PLAN.format(required) if required else "{}")
    return folder


def drawn(seed: int) -> tuple[Term, Term, Term, str]:
    rng = random.Random(seed)
    required = rng.choice(("a.w or b.v", "not (a.w and b.v)", "a.w -> b.v", "b.v -> a.w", "not b.v", "a.w"))
    return clause(rng), clause(rng), clause(rng), required


class BriefLimits:
    seconds, seed = 5.0, 0


def verdicts(folder: Path) -> dict[str, Verdict]:
    composition = compose(load_system(folder))
    obligations = all_obligations(composition)

    found = settle_all(composition, obligations, BriefLimits())
    return {o.name: outcome.verdict for o, outcome in zip(obligations, found, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(300), 8))
def test_no_run_says_otherwise(seed: int, tmp_path: Path) -> None:
    said, assumed, promised, required = drawn(seed)
    folder = system(tmp_path, said, assumed, promised, required)
    try:
        steps = list(Enumeration(said, assumed, promised).reach())
    except OverflowError:
        pytest.skip("too many states")
    found = verdicts(folder)
    judge = {
        "a.w or b.v": lambda w, v: w or v,
        "not (a.w and b.v)": lambda w, v: not (w and v),
        "a.w -> b.v": lambda w, v: not w or v,
        "b.v -> a.w": lambda w, v: not v or w,
        "not b.v": lambda w, v: not v,
        "a.w": lambda w, v: w,
    }[required]
    met = all(assumed_now for assumed_now, _, _ in steps)
    kept = all(judge(step["w"], step["v"]) for _, still, step in steps if still)
    said_of = found["whole.b.m"]
    assert said_of in (Verdict.PROVED, Verdict.REFUTED, Verdict.UNKNOWN)
    assert said_of is not Verdict.PROVED or met
    assert said_of is not Verdict.REFUTED or not met
    assert found["R"] is not Verdict.PROVED or kept
    assert found["R"] is not Verdict.REFUTED or not kept


def test_the_draws_are_of_every_kind() -> None:
    """Some assumptions are met by every run, and some are not."""
    known = []
    for seed in range(60):
        said, assumed, promised, _ = drawn(seed)
        try:
            known.append(all(now for now, _, _ in Enumeration(said, assumed, promised).reach()))
        except OverflowError:
            continue
    assert known.count(True) > 5
    assert known.count(False) > 5


def test_what_is_drawn_is_a_contract(tmp_path: Path) -> None:
    folder = system(tmp_path, *drawn(0))
    contract, found = check_text((folder / "system.rcl").read_text(), "system.rcl")
    assert contract is not None, found


CONTRACTS = """node a {{ inputs( f : NATURAL --> BOOL ) outputs( g : NATURAL --> BOOL, w : BOOL, v : BOOL ) topics()
  guarantee seen ( forall(i in NATURAL | out.g(i) <=> once(in.f(i))) )
  guarantee up ( w -> eventually(v) ) guarantee soon ( w -> within[200 ms](v) ) guarantee plain ( v or not w ) }}
node b {{ inputs( g : NATURAL --> BOOL, w : BOOL, v : BOOL ) outputs( z : BOOL ) topics()
  assume grows ( forall(i in NATURAL | previous(in.g(i), FALSE) -> in.g(i)) )
  assume stays ( previous(v, FALSE) -> v ) assume plain ( v or not w ) {} guarantee z ( z ) }}"""


def made(folder: Path, assumed: str) -> dict[str, Verdict]:
    (folder / "system.rcl").write_text(CONTRACTS.format(assumed))
    (folder / "plan.yaml").write_text("{}")
    return verdicts(folder)


@pytest.mark.slow
def test_what_is_remembered_of_each_value(tmp_path: Path) -> None:
    """A cell for every number; what no step can break is no hypothesis, and keeps no other from being one."""
    found = made(tmp_path, "")
    assert found["whole.b.grows"] is Verdict.PROVED
    assert found["whole.b.plain"] is Verdict.PROVED
    assert found["whole.b.stays"] is Verdict.REFUTED


@pytest.mark.slow
def test_of_a_node_that_assumes_more_than_steps_can_break_nothing_is_proved(tmp_path: Path) -> None:
    assert Verdict.PROVED not in made(tmp_path, "assume ever ( w -> eventually(v) )").values()


@pytest.mark.slow
def test_no_contract_is_derived_of_clauses_with_memory(tmp_path: Path) -> None:
    made(tmp_path, "")
    composition = compose(load_system(tmp_path))
    with pytest.raises(Rejected, match="other steps"):
        derived_contract(composition, composition.whole)


REFUTED = """node a {{ inputs( e : BOOL ) outputs( w : BOOL ) topics() guarantee g ( out.w -> previous(in.e, FALSE) ) }}
node b {{ inputs( w : BOOL ) outputs( v : BOOL ) topics() assume m ( {} ) guarantee h ( out.v == in.w ) }}"""


@pytest.mark.parametrize(
    ("assumed", "length"), [("not in.w", 2), pytest.param("not held[2 steps](in.w)", 4, marks=pytest.mark.slow)]
)
def test_a_refutation_is_shown_as_a_run_and_says_nothing_of_cells(assumed: str, length: int, tmp_path: Path) -> None:
    """In the answer, and in what would make it hold."""
    (tmp_path / "system.rcl").write_text(REFUTED.format(assumed))
    (tmp_path / "plan.yaml").write_text("requirements: {R: {text: r, formula: 'not b.v', supported_by: [a, b]}}")
    composition = compose(load_system(tmp_path))
    obligations = all_obligations(composition)
    outcomes = settle_all(composition, obligations, BriefLimits())
    found = {o.name: outcome for o, outcome in zip(obligations, outcomes, strict=True)}
    shown = found["whole.b.m"]
    assert shown.verdict is Verdict.REFUTED
    assert shown.counterexample is not None
    assert len(shown.counterexample.trace) == length
    for outcome in (shown, found["R"]):
        told = [outcome.summary, str(outcome.counterexample)]
        assert not any(CELL in text for text in told), told
    done = CliRunner().invoke(compose_command, [str(tmp_path)])
    assert f"   {length}  a.w = TRUE" in done.output


TRAP = """node n { inputs( a : BOOL ) outputs( b : BOOL ) topics()
  guarantee g ( not (previous(out.b, FALSE) and a and b) and ((previous(out.b, FALSE) and a) -> b) ) }"""


@pytest.mark.parametrize("seed", range(3))
def test_a_run_that_goes_on_is_shown_where_some_answer_ends_it(seed: int, tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(TRAP)
    (tmp_path / "plan.yaml").write_text("{}")
    done = CliRunner().invoke(simulate, [str(tmp_path), "--steps", "4", "--seed", str(seed)])
    assert done.exit_code == 0, done.output
    assert "stuck" not in done.output

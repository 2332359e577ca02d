"""Realizability with memory against the game itself, played over whole runs by the definitions of the operators; and
contracts with known answers."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

import pytest
from drawn.memory import N, clause, formula
from helpers import some
from oracle.runs import environment_wins, runs, step
from oracle.stepping import Watch
from reference.meaning import breaks

from avow.base.verdict import Verdict
from avow.formulas.formula import substitute
from avow.formulas.temporal.cells import Records, compile_node, remembers
from avow.language.contract import Clause, ClauseKind, Node
from avow.language.load import check_text
from avow.language.sorts import NATURAL
from avow.language.subterms import ports_of
from avow.language.terms import Literal, Not, Term, Variable
from avow.sanity.analysis import analyse
from avow.sanity.viability import viable

DEPTH = 5


def drawn(seed: int) -> tuple[Term, list[Term]]:
    rng = random.Random(seed)
    assumed: Term = substitute(formula(rng, rng.randrange(3)), {N: Literal(1, NATURAL)})
    if any(v.qualified == "out.b" for v in _now(assumed)):
        assumed = Not(Literal(False, assumed.sort))
    return assumed, [clause(rng) for _ in range(rng.randrange(1, 4))]


def _now(term: Term) -> tuple[Variable, ...]:
    return ports_of(Records().clause(term))


def node_of(assumed: Term, promised: list[Term]) -> Node:
    contract, _ = check_text("node n { inputs( a : BOOL ) outputs( b : BOOL ) topics() guarantee( TRUE ) }", "n.rcl")
    assert contract is not None
    guarantees = tuple(Clause(ClauseKind.GUARANTEE, f"g{k}", k + 1, g) for k, g in enumerate(promised))
    return replace(
        contract.nodes[0], assumptions=(Clause(ClauseKind.ASSUMPTION, "a", 1, assumed),), guarantees=guarantees
    )


AHEAD = {
    "two demands at once": (
        """inputs( start : BOOL, stop : BOOL, n : REAL ) outputs( v : BOOL, m : REAL ) topics()
        guarantee starts ( rose(start) -> v ) guarantee stops ( rose(stop) -> not v ) guarantee other ( m > n )""",
        ("starts", "stops"),
        1,
    ),
    "a demand that comes due": (
        """inputs( a : BOOL, n : REAL ) outputs( v : REAL ) topics()
        guarantee due ( a -> next(v > 3) ) guarantee low ( previous(n > 1, FALSE) -> v < 2 )""",
        ("due", "low"),
        2,
    ),
    "nothing comes in, and three steps are too many": (
        """inputs() outputs( v : REAL ) topics()
        guarantee up ( v >= previous(v, 0) + 2 ) guarantee low ( v <= 5 )""",
        ("up", "low"),
        3,
    ),
}


@pytest.mark.parametrize("name", some(AHEAD, 1, slow=2))
def test_inputs_of_a_refutation_are_shown_where_there_are_numbers(name: str) -> None:
    text, clauses, length = AHEAD[name]
    contract, found = check_text(f"node n {{ {text} }}", "n.rcl")
    assert contract is not None, found
    (result,) = analyse(contract.nodes[0], wanted=frozenset({"realizable"}))
    assert (result.verdict, result.clauses) == (Verdict.REFUTED, clauses)
    assert result.counterexample is not None
    assert len(result.counterexample.trace) == length
    assert all(clause in result.counterexample.explanation for clause in clauses)


EACH = """inputs( e : {{p, q, r}}, a : BOOL ) outputs( o : {{p, q, r}} ) topics()
  guarantee g ( forall(x in {{p, q, r}} | {} ) )"""


@pytest.mark.parametrize(
    ("clause", "verdict"),
    [
        ("rose(in.e == x) -> within[0 steps](o == x)", Verdict.PROVED),
        ("rose(in.e == x) -> for[1 steps](o == x)", Verdict.REFUTED),
        ("once(in.e == x) -> o == x", Verdict.REFUTED),
    ],
)
def test_what_is_remembered_for_each_value_is_played_through(clause: str, verdict: Verdict) -> None:
    contract, found = check_text(f"node n {{ {EACH.format(clause)} }}", "n.rcl")
    assert contract is not None, found
    answer = viable(compile_node(contract.nodes[0]))
    assert answer.verdict is verdict, answer
    assert answer.run is None or len(answer.run.trace) == 2


def test_what_is_remembered_for_each_number_is_no_crash() -> None:
    text = """node n { inputs( b : BOOL ) outputs( o : BOOL ) topics()
      guarantee g ( forall(x in NATURAL | once(b and x > 3) -> o) )
      guarantee h ( forall(x in NATURAL | once(b and x > 2) -> next(not o)) ) }"""
    contract, found = check_text(text, "n.rcl")
    assert contract is not None, found
    answer = viable(compile_node(contract.nodes[0]), effort=100)
    assert (answer.verdict, "for each value" in answer.reason) == (Verdict.UNKNOWN, True)


@pytest.mark.parametrize("seed", some(range(1000), 8, slow=32))
def test_the_game_says_the_same(seed: int) -> None:
    assumed, promised = drawn(seed)
    found = viable(compile_node(node_of(assumed, promised)), effort=2_000)
    if found.verdict is Verdict.PROVED:
        assert not environment_wins(assumed, promised, DEPTH)
    elif found.verdict is Verdict.REFUTED:
        assert found.run is not None
        length = len(found.run.trace)
        if length <= DEPTH:
            assert environment_wins(assumed, promised, length)


TANK = """inputs( flow : REAL ) outputs( level : REAL, valve : REAL ) topics()
  assume small ( 0 <= flow <= 1 )
  guarantee moves ( level == previous(out.level, 5) + flow - valve )
  guarantee stays ( 0 <= level <= 10 )
  guarantee valve ( 0 <= valve <= {} )"""
ARBITER = """inputs( a : BOOL, b : BOOL ) outputs( x : BOOL, y : BOOL ) topics()
  guarantee one ( not (x and y) )
  guarantee first ( a -> within[{} steps](out.x) )
  guarantee second ( b -> within[{} steps](out.y) )"""
KNOWN = {
    "a tank whose bad levels no run comes to": (TANK.format(2), Verdict.PROVED),
    "a tank that a full flow fills": (TANK.format(0), Verdict.REFUTED),
    "an arbiter with room for both": (ARBITER.format(1, 1), Verdict.PROVED),
    "an arbiter without": (ARBITER.format(0, 0), Verdict.REFUTED),
    "an arbiter that answers one at once": (ARBITER.format(0, 1), Verdict.REFUTED),
    "a response that later requests forbid": (
        """inputs( a : BOOL ) outputs( b : BOOL ) topics()
        guarantee g ( rose(a) -> within[1 steps](out.b) )
        guarantee h ( previous(in.a, FALSE) -> not out.b )
        guarantee i ( not previous(out.b, FALSE) -> not out.b )""",
        Verdict.REFUTED,
    ),
    "the same, where requests are apart": (
        """inputs( a : BOOL ) outputs( b : BOOL ) topics()
        assume apart ( rose(a) -> historically[2 steps](a or not a) )
        guarantee g ( a -> next(out.b) )""",
        Verdict.PROVED,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_known_answers(name: str) -> None:
    text, verdict = KNOWN[name]
    contract, found = check_text(f"node n {{ {text} }}", "n.rcl")
    assert contract is not None, found
    assert viable(compile_node(contract.nodes[0])).verdict is verdict


def test_a_refutation_is_a_run_of_the_environment() -> None:
    contract, _ = check_text(f"node n {{ {ARBITER.format(0, 0)} }}", "n.rcl")
    assert contract is not None
    found = viable(compile_node(contract.nodes[0]))
    assert found.run is not None
    assert dict(found.run.trace[-1]) == {"in.a": "TRUE", "in.b": "TRUE"}


@pytest.mark.parametrize("name", ["an arbiter that answers one at once", "the same, where requests are apart"])
def test_where_the_second_solver_says_the_opposite_it_is_an_error(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("avow.sanity.viability.contradicted", lambda *_, **__: True)
    contract, found = check_text(f"node n {{ {KNOWN[name][0]} }}", "n.rcl")
    assert contract is not None, found
    assert viable(compile_node(contract.nodes[0])).verdict is Verdict.ERROR


def test_claims_are_about_what_runs_can_reach() -> None:
    """What no memory that a run comes to allows is refuted, also where some memory would."""
    text = """node n { inputs( a : BOOL ) outputs( b : BOOL ) topics()
      guarantee never ( not b )
      guarantee idle ( a and previous(out.b, FALSE) -> out.b )
      guarantee late ( held[3 steps](in.a) -> not b ) }"""
    contract, _ = check_text(text, "n.rcl")
    assert contract is not None
    found = {result.name: result.verdict for result in analyse(contract.nodes[0])}
    assert found["not-vacuous-idle"] is Verdict.REFUTED
    assert found["not-vacuous-late"] is Verdict.PROVED
    assert found["not-redundant-late"] is Verdict.REFUTED
    assert found["realizable"] is Verdict.PROVED


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(2000, 2300), 12))
def test_what_is_said_of_a_clause_is_so_in_every_run(seed: int) -> None:
    """A tautology is one whatever else is promised, and an output of no matter matters at no later step either."""
    assumed, promised = drawn(seed)
    refuted = {r.name for r in analyse(node_of(assumed, promised)) if r.verdict is Verdict.REFUTED}
    for k, own in enumerate(promised):
        for name, others in ((f"not-tautological-g{k}", []), (f"not-redundant-g{k}", promised[:k] + promised[k + 1 :])):
            if name in refuted:
                for length in range(1, DEPTH):
                    assert runs([assumed, *others, own], length) == runs([assumed, *others], length)
    if "constrained-b" in refuted:
        for run in runs([assumed, *promised], DEPTH - 1):
            for k, step in enumerate(run):
                other = [*run[:k], {**step, "out.b": not step["out.b"]}, *run[k + 1 :]]
                assert not any(breaks(g, other) for g in promised)


@pytest.mark.parametrize(
    ("clauses", "name", "because"),
    [
        ("assume a ( previous(x, FALSE) ) guarantee g ( once(x) -> o )", "assumptions-satisfiable", None),
        ("assume a ( previous(x, FALSE) ) guarantee g ( once(x) -> o )", "consistent", "assumptions-satisfiable"),
        ("guarantee g ( held[1 steps](o) ) guarantee h ( n < 3 )", "consistent", None),
    ],
)
def test_what_no_run_lasts_for_is_refuted_though_there_are_numbers(
    clauses: str, name: str, because: str | None
) -> None:
    text = f"node n {{ inputs( x : BOOL, n : NATURAL ) outputs( o : BOOL ) topics() {clauses} }}"
    contract, found = check_text(text, "n.rcl")
    assert contract is not None, found
    (result,) = analyse(contract.nodes[0], wanted=frozenset({name}))
    assert (result.verdict, result.because) == (Verdict.REFUTED, because)


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("not-tautological-g1", Verdict.PROVED),
        pytest.param("not-tautological-never", Verdict.REFUTED, marks=pytest.mark.slow),
        pytest.param("constrained-y", Verdict.UNKNOWN, marks=pytest.mark.slow),
    ],
)
def test_what_other_clauses_keep_runs_from_is_no_tautology(name: str, verdict: Verdict) -> None:
    text = """node n { inputs( a : BOOL ) outputs( x : BOOL, y : BOOL ) topics()
      guarantee g0 ( not x )
      guarantee g1 ( a -> next(once(not x)) )
      guarantee g2 ( changed(y) -> within[2 steps](a) )
      guarantee never ( x -> x until x ) }"""
    contract, _ = check_text(text, "n.rcl")
    assert contract is not None
    (result,) = analyse(contract.nodes[0], wanted=frozenset({name}))
    assert result.verdict is verdict


def test_what_is_not_a_safety_property_is_not_called_realizable() -> None:
    text = """node n { inputs( a : BOOL ) outputs( b : BOOL ) topics()
      guarantee g ( a -> eventually(b) ) guarantee h ( not b ) }"""
    contract, _ = check_text(text, "n.rcl")
    assert contract is not None
    assert {r.verdict for r in analyse(contract.nodes[0])} == {Verdict.UNKNOWN}


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(150), 6))
def test_what_is_needed_is_so_in_all_runs(seed: int) -> None:
    node = node_of(*drawn(seed))
    found = {r.name: r.verdict for r in analyse(node, wanted={"needed-a"})}
    if remembers(node) and found.get("needed-a") in (Verdict.PROVED, Verdict.REFUTED):
        without = replace(node, assumptions=())
        always: Term = Not(Literal(False, node.assumptions[0].formula.sort))
        loses = environment_wins(always, [c.formula for c in without.guarantees], DEPTH)
        assert found["needed-a"] is Verdict.PROVED or not loses


MOST_MEMORIES = 1000
"""A count that is never reset leaves ever new memories."""


def determined(assumed: Term, promised: list[Term]) -> tuple[bool | None, int]:
    """Whether, wherever a run can go on for ever, one output alone lets it; None where none does or there are too many
    memories to walk them all. And the number of memories."""
    rules, start = Watch(assumed), tuple(Watch(g).begins for g in promised)
    watches, moves = [Watch(g) for g in promised], dict[Any, list[dict[bool, Any]]]()
    waiting: list[Any] = [(rules.begins, start)]
    for memory in waiting:
        if memory in moves:
            continue
        if len(moves) == MOST_MEMORIES:
            return None, len(moves)
        moves[memory] = []
        for a in (False, True):
            allowed, _ = rules.step(step(a, False), memory[0])
            answers: dict[bool, Any] = {}
            for b in (False, True):
                told = [w.step(step(a, b), m) for w, m in zip(watches, memory[1], strict=True)]
                if allowed and all(held for held, _ in told):
                    answers[b] = (rules.step(step(a, b), memory[0])[1], tuple(left for _, left in told))
            moves[memory] += [answers] if allowed else []
            waiting += answers.values()
    live = set(moves)
    while dead := {m for m in live if any(not (set(answers.values()) & live) for answers in moves[m])}:
        live -= dead
    if waiting[0] not in live:
        return None, len(moves)
    reached = [waiting[0]]
    for memory in reached:
        left = {after for answers in moves[memory] for after in answers.values() if after in live}
        reached += [after for after in left if after not in reached]
    alone = all(sum(after in live for after in answers.values()) < 2 for m in reached for answers in moves[m])
    return alone, len(moves)


@pytest.mark.parametrize("seed", some(range(400), 4, slow=40))
def test_what_is_determined_or_needed_is_known_where_all_memories_are(seed: int) -> None:
    assumed, promised = drawn(seed)
    node = node_of(assumed, promised)
    wanted, memories = determined(assumed, promised)
    if not remembers(node):
        return
    found = {r.name: r.verdict for r in analyse(node, wanted={"determined-b", "needed-a"})}
    if memories <= 50:
        assert Verdict.UNKNOWN not in found.values(), found
    if wanted is not None and "determined-b" in found and found["determined-b"] is not Verdict.UNKNOWN:
        assert found["determined-b"] is (Verdict.PROVED if wanted else Verdict.REFUTED), found

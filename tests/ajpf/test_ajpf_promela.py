"""Spin on agents' programs, by a translation that shares nothing with our interpreter: AJPF's verdicts once more."""

from __future__ import annotations

import csv
from pathlib import Path
from random import Random
from types import SimpleNamespace

import pytest
import yaml
from helpers import some
from rich_agents import rich_agent
from runner_graph import runner_graph
from small_agents import case, formula
from small_societies import society

from avow.backends.ajpf import spin, spin_tool
from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts, reduce
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import parse_system, read_system
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system
from avow.base.process import Completed
from avow.isolation.outside import Outside

GOLDEN = Path(__file__).parent / "golden"


def _rows(folder: str) -> dict[str, list[dict[str, str]]]:
    found: dict[str, list[dict[str, str]]] = {}
    with (GOLDEN / folder / "verdicts.csv").open(newline="") as table:
        for row in csv.DictReader(table):
            found.setdefault(row["program"], []).append(row)
    return found


ROWS = {folder: _rows(folder) for folder in ("verdicts", "random", "societies")}
ALL = [(folder, name) for folder, rows in ROWS.items() for name in rows]
TOLD_APART = {("verdicts", "h1"), ("verdicts", "k12"), ("societies", next(iter(ROWS["societies"])))}


def _when(case):
    return pytest.mark.slow if case in TOLD_APART else pytest.mark.nightly


def checkers(programs, draws, properties, semantics=Semantics.MCAPL, most=20_000):
    """A checker for the properties that ask for percepts, and one for the others."""
    for probed in (False, True):
        wanted = [p for p in properties if asks_for_percepts(p) is probed]
        if wanted:
            graph = explore(system(programs, draws, semantics, probed=probed), states=most)
            if graph.unfinished is None:
                yield Checker(graph, wanted)


def properties_of(texts):
    return [Property(key, instantiate(parse_psl(text), {})) for key, text in texts]


@pytest.mark.needs_spin
@pytest.mark.parametrize(("folder", "name"), [pytest.param(*c, marks=_when(c)) for c in ALL])
def test_spin_says_of_the_program_what_ajpf_says(tmp_path, folder, name):
    rows = ROWS[folder][name]
    programs = read_system(GOLDEN / folder / f"{name}.gwen")
    draws = read_environment(GOLDEN / folder / f"{name}.yaml")
    found: dict[str, bool] = {}
    for checker in checkers(programs, draws, properties_of((row["property"], row["formula"]) for row in rows)):
        found |= spin.opinions(checker, checker.properties, tmp_path, 120.0, Outside((spin_tool.tool(),)))
    for row in rows:
        agrees = found.pop(row["property"]) is (row["ajpf"] == "holds")
        assert agrees is not bool(row.get("remark")), row
    assert not found


@pytest.mark.slow
@pytest.mark.needs_spin
@pytest.mark.parametrize(
    ("make", "seed", "semantics", "fair"),
    some(
        [
            (make, seed, semantics, fair)
            for seed in range(7000, 7060)
            for make in (case, society, rich_agent)
            for semantics in Semantics
            for fair in (False, True)
        ],
        6,
    ),
)
def test_the_runner_goes_where_our_interpreter_goes(tmp_path, make, seed, semantics, fair):
    """The same answers on both graphs, whatever the semantics and what is assumed of the draws."""
    made, rng = make(seed), Random(seed)
    draws = yaml.safe_load(made.environment)
    percepts = [word for group in draws["percepts"].values() for word in group if word != "nothing"]
    if fair and percepts:
        draws["fair"] = [{"percept": percepts[0], "because": "it comes"}]
    (tmp_path / "e.yaml").write_text(yaml.safe_dump(draws))
    texts = [*made.formulas, *([formula(rng, 1), formula(rng, 2)] if make is case else [])]
    properties = properties_of((f"f{at}", text) for at, text in enumerate(texts))
    programs = parse_system(made.program, "a.gwen")
    for checker in checkers(programs, read_environment(tmp_path / "e.yaml"), properties, semantics, 4_000):
        theirs = Checker(checker.graph, checker.properties)
        theirs.reduced = reduce(runner_graph(tmp_path, checker.graph.system, checker.atoms))
        for p in checker.properties:
            assert theirs.check(p).holds is checker.check(p).holds, p


PUZZLE = """\
GWENDOLEN
:name: ag
:Initial Beliefs:
square(1), square(2), square(3), empty(2), lit("on"), near(1, [2, 3])
:Reasoning Rules:
full :- ~(square(X), empty(X));
big(X) :- square(X), [1 < X];
one :- full, !;
one;
none :- square(X), !, [X < 9], lit("on");
none;
member(X, [X|T]);
member(X, [H|T]) :- member(X, T);
twice(X, Y) :- square(X), [Y == X * 2];
:Initial Goals:
start [perform]
:Plans:
+!start [perform] : { B big(X), B one, ~B none, ~B full, B twice(X, Y), Y < 5 } <- +got(Y), sum(Y, 0.5, Z), +half(Z),
  toString(f(Z), S), say(S), append("a", "b", T), +text(T), +any(W), +!ask(V) [perform], after(V), -square(U), gone(U),
  div(1, 4, Q), +quarter(Q), +!find(F) [achieve], have(F);
+!ask(V) [perform] : { B near(1, L), B member(V, L), ~B empty(V) } <- found(V), +asked((V + 1));
+!find(X) [achieve] : { B square(X), 1 < X } <- +.lock, look(X), -.lock, +find(X);
+half(X) : { B any(foo(bar)) } <- *asked(N), know(N);
-square(X) : { True } <- -any(Y), lost(X);
"""


@pytest.mark.needs_spin
def test_a_search_that_takes_too_long_is_told_as_such(tmp_path):
    asked = []

    def run(command, *, cwd, seconds):
        asked.append(command)
        return Completed(tuple(command), None, "", "", 3.0)

    with pytest.raises(spin.NoOpinion) as found:
        spin._verdict(tmp_path, "c0", 10, spin.time.monotonic() + 100, SimpleNamespace(run=run))
    assert found.value.reason == "pan gave no answer in 3 s"
    assert len(asked) == 1


def test_what_a_program_may_have_is_translated(tmp_path):
    """Groups, cuts, lists, comparisons, computing, texts, free variables in beliefs and goals."""
    (tmp_path / "e.yaml").write_text("draws: {at_start: true, at_quiescence: once}\npercepts: {x: [p, nothing]}\n")
    words = [
        "got(4)",
        "half(4.5)",
        "text(_)",
        "any(boo)",
        "asked(4)",
        "find(_)",
        "square(1)",
        "quarter(_)",
        "half(_)",
        "full",
    ]
    done = ["say(_)", "found(3)", "after(3)", "gone(_)", "look(2)", "know(4)", "lost(_)"]
    atoms = [*(f"B(ag, {w})" for w in words), *(f"D(ag, {w})" for w in done), "I(ag, ask(_))", "ItD(ag, found(_))"]
    texts = [
        (f"f{at}{k}", form.format(a)) for at, a in enumerate(atoms) for k, form in enumerate(("<> {}", "[] (~{})"))
    ]
    programs = parse_system(PUZZLE, "a.gwen")
    (checker,) = checkers(programs, read_environment(tmp_path / "e.yaml"), properties_of(texts))
    theirs = Checker(checker.graph, checker.properties)
    theirs.reduced = reduce(runner_graph(tmp_path, checker.graph.system, checker.atoms))
    answers = {p.key: checker.check(p).holds for p in checker.properties}
    assert {p.key: theirs.check(p).holds for p in checker.properties} == answers
    came = [a for at, a in enumerate(atoms) if answers[f"f{at}0"]]
    assert len(came) >= len(atoms) - 3, came

"""Spin on an agent's program, by a translation that shares nothing with our interpreter: AJPF's verdicts once more."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from avow.backends.ajpf import promela, spin
from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import read_system
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system

GOLDEN = Path(__file__).parent / "golden" / "verdicts"
with (GOLDEN / "verdicts.csv").open(newline="") as table:
    ROWS = list(csv.DictReader(table))


def checkers(name: str):
    program, draws = read_system(GOLDEN / f"{name}.gwen"), read_environment(GOLDEN / f"{name}.yaml")
    for probed in (False, True):
        rows = [
            (Property(r["property"], instantiate(parse_psl(r["formula"]), {})), r["ajpf"])
            for r in ROWS
            if r["program"] == name
        ]
        said = {p.key: answer == "holds" for p, answer in rows if asks_for_percepts(p) is probed}
        wanted = [p for p, _ in rows if p.key in said]
        if wanted:
            agent = system(program, draws, Semantics.MCAPL, probed=probed)
            yield Checker(explore(agent, states=20_000), wanted), wanted, said


@pytest.mark.needs_spin
@pytest.mark.parametrize(
    "name", ["h1", *(pytest.param(n, marks=pytest.mark.slow) for n in ("k1", "d3", "k10", "e4", "b2", "a4"))]
)
def test_spin_says_of_the_program_what_ajpf_says(tmp_path, name):
    for checker, wanted, said in checkers(name):
        found = spin.opinions(checker, wanted, tmp_path, 120.0)
        assert found.seen == "the program, by a translation of its own"
        assert dict(found.holds) == said


def test_what_is_not_translated_is_told():
    for name, reason in (("e1", "compute"),):
        ((checker, _, _),) = checkers(name)
        agent = checker.graph.system
        with pytest.raises(promela.NotTranslated, match=reason):
            promela.header(agent.program, agent.environment, checker.atoms, probed=False)

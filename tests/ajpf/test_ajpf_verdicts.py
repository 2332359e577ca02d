"""What the real AJPF says of small agents (`golden/verdicts`): our engine says the same of every one of them.

The programs are our own. AJPF (MCAPL of December 2025, Java 11) ran each with an environment that offers what NAME.yaml
lists; `states` is its count, for the curious.
"""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Agent, Semantics
from avow.backends.ajpf.parser import read_program
from avow.backends.ajpf.psl_parser import instantiate, parse_psl

GOLDEN = Path(__file__).parent / "golden" / "verdicts"
with (GOLDEN / "verdicts.csv").open(newline="") as table:
    ROWS = list(csv.DictReader(table))
PROGRAMS = sorted({row["program"] for row in ROWS})


@pytest.mark.parametrize("name", PROGRAMS)
def test_our_verdicts_are_ajpfs(name):
    program, draws = read_program(GOLDEN / f"{name}.gwen"), read_environment(GOLDEN / f"{name}.yaml")
    wanted = {
        row["property"]: (Property(row["property"], instantiate(parse_psl(row["formula"]), {})), row["ajpf"])
        for row in ROWS
        if row["program"] == name
    }
    for p, said in wanted.values():
        graph = explore(Agent(program, draws, Semantics.MCAPL, probed=asks_for_percepts(p)), states=20_000)
        assert graph.unfinished is None
        assert Checker(graph, (p,)).check(p).holds is (said == "holds"), (p.key, said)

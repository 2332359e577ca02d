"""What the real AJPF says of small agents: our engine says the same of every one of them.

The programs are our own. AJPF (MCAPL of December 2025, Java 11) ran each with an environment that offers what
NAME.yaml lists. Those in `golden/verdicts` were written for one question each or told readings of the semantics
apart; those in `golden/random` were drawn by `small_agents`. Those in `golden/societies`, drawn by `small_societies`,
are systems of two or three agents with AJPF's default scheduler: for each of them AJPF wrote down its whole model,
which has the same runs (up to stuttering, in all that the properties speak of) as ours, and the verdicts are those of
its model. So are those of s5004 and later ones in `golden/random`, of `cuts`, of r… (random programs with more
features), and of l…, random systems with few messages. A remark says where AJPF errs: its answer is not what
follows from the model that it writes down itself, and ours is; or, where the model was not written down, the
program's first state alone breaks a property that AJPF says holds, and the remark says by what.
"""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from helpers import some

from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import read_system
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system

GOLDEN = Path(__file__).parent / "golden"


def _rows(folder: str) -> list[dict[str, str]]:
    with (GOLDEN / folder / "verdicts.csv").open(newline="") as table:
        return list(csv.DictReader(table))


ROWS = {folder: _rows(folder) for folder in ("verdicts", "random", "societies")}
PROGRAMS = [(folder, name) for folder, rows in ROWS.items() for name in dict.fromkeys(row["program"] for row in rows)]


@pytest.mark.parametrize(("folder", "name"), some(PROGRAMS, 20, slow=len(PROGRAMS) - 20))
def test_our_verdicts_are_ajpfs(folder, name):
    program = read_system(GOLDEN / folder / f"{name}.gwen")
    draws = read_environment(GOLDEN / folder / f"{name}.yaml")
    for row in ROWS[folder]:
        if row["program"] != name:
            continue
        p = Property(row["property"], instantiate(parse_psl(row["formula"]), {}))
        graph = explore(system(program, draws, Semantics.MCAPL, probed=asks_for_percepts(p)), states=20_000)
        assert graph.unfinished is None
        found = Checker(graph, (p,)).check(p)
        agrees = found.holds is (row["ajpf"] == "holds")
        assert agrees is not bool(row.get("remark")), row
        assert (found.vacuous, found.immediate) == (False, False), "nothing was said of a trigger"

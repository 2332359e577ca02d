"""A property decided on the part of the state space that it needs."""

from __future__ import annotations

from random import Random

import pytest
from small_agents import case, formula

from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.lazy import open_part
from avow.backends.ajpf.parser import parse_system
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system

ENDLESS = """\
GWENDOLEN
:name: ag
:Initial Beliefs:
:Initial Goals:
:Plans:
+p(X) : { True } <- go(X), rest(X), turn(X);
"""


@pytest.mark.parametrize("seeds", [range(100, 112), range(140, 152)])
def test_the_part_decides_as_the_whole_does(tmp_path, seeds):
    told = set()
    for seed in seeds:
        made = case(seed)
        (tmp_path / "e.yaml").write_text(made.environment)
        program, draws = parse_system(made.program, "ag.gwen"), read_environment(tmp_path / "e.yaml")
        rng = Random(seed)
        for text in (*made.formulas, formula(rng, 1), formula(rng, 2)):
            wanted = Property("f", instantiate(parse_psl(text), {}))
            agent = system(program, draws, Semantics.MCAPL, probed=asks_for_percepts(wanted))
            whole = explore(agent, states=2_000)
            if whole.unfinished is not None:
                continue
            part = open_part(agent, wanted, 3_000, 60.0)
            assert part is not None
            holds = Checker(whole, (wanted,)).check(wanted).holds
            assert Checker(part, (wanted,)).check(wanted).holds is holds, (seed, text)
            told.add((holds, len(part) < len(whole)))
    assert told >= {(True, True), (False, True)}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("<> D(ag, go(_))", True),
        ("(~D(ag, rest(_))) U D(ag, go(_))", True),
        ("[] (~D(ag, turn(0)))", False),
        ("(~D(ag, go(_))) U D(ag, rest(_))", False),
    ],
)
def test_an_agent_without_bounds_has_its_answer(tmp_path, text, holds):
    (tmp_path / "e.yaml").write_text('draws: {at_quiescence: repeatedly}\npercepts: {p: ["p(0)", "p(1)"]}\n')
    agent = system(parse_system(ENDLESS, "ag.gwen"), read_environment(tmp_path / "e.yaml"), Semantics.MCAPL)
    assert explore(agent, states=2_000).unfinished is not None
    wanted = Property("f", instantiate(parse_psl(text), {}))
    part = open_part(agent, wanted, 5_000, 60.0)
    assert part is not None
    assert Checker(part, (wanted,)).check(wanted).holds is holds

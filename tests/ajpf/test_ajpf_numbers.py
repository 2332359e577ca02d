"""States as numbers, and the smaller graph on which properties are checked: nothing is lost by either."""

from __future__ import annotations

import pytest
from helpers import some
from small_agents import case

from avow.backends.ajpf.checker import Checker, Property, label_states
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import parse_system
from avow.backends.ajpf.psl import Not, automaton_of, compiled
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system
from avow.formulas.lasso import accepted_run


@pytest.mark.parametrize("seeds", some([range(at, at + 5) for at in range(700, 800, 5)], 1))
def test_the_smaller_graph_has_the_verdicts_of_the_whole(tmp_path, seeds):
    answers = set()
    for seed in seeds:
        drawn = case(seed)
        (tmp_path / "env.yaml").write_text(drawn.environment)
        semantics = list(Semantics)[seed % 2]
        environment = read_environment(tmp_path / "env.yaml")
        agent = system(parse_system(drawn.program, "ag.gwen"), environment, semantics)
        graph = explore(agent, states=1_000)
        assert all(agent.numbered(agent.state(number)) == number for number in graph.states)
        for formula in (*drawn.formulas, "[] (I(ag, g) -> (<> D(ag, one)))"):
            p = Property("p", instantiate(parse_psl(formula), {}))
            checker = Checker(graph, (p,))
            one_by_one = [label_states(agent, [state], checker.atoms)[0] for state in graph.states]
            assert checker.labels == one_by_one
            automaton = automaton_of(Not(p.formula))
            tests = [compiled(leaf, checker.places) for leaf in automaton.leaves]
            bits = [sum(1 << at for at, test in enumerate(tests) if test(label)) for label in checker.labels]
            found = accepted_run(graph.initial, graph.after, bits.__getitem__, automaton)
            assert checker.check(p).holds is (found is None)
            answers.add(found is None)
    assert answers == {True, False}

"""Partial order reduction for several agents: the same answers as the whole state space gives."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers import some
from loose_societies import loose_society
from small_societies import society

from avow.backends.ajpf.checker import Checker, Property, label_states
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import parse_system
from avow.backends.ajpf.partial import Reduction, unfolded
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system

SILENT = "draws: {at_start: false, at_quiescence: never, quiet: [send, act]}\npercepts: {x: [nothing]}\n"
DRAWS = "draws: {at_start: false, at_quiescence: never, quiet: [send]}\npercepts: {x: [p]}\n"


def agents_of(folder, program, environment, semantics=Semantics.MCAPL):
    (folder / "e.yaml").write_text(environment)
    return system(parse_system(program, "a.gwen"), read_environment(folder / "e.yaml"), semantics)


def property_of(text):
    return Property("f", instantiate(parse_psl(text), {}))


def both(agents, wanted, made=Reduction, most=3_000):
    """The answers on the whole state space and on the reduced one, and how large they are; None without bounds."""
    whole = explore(agents, states=most)
    if whole.unfinished is not None:
        return None
    full = Checker(whole, [wanted])
    try:
        reduction = made(agents, full.atoms)
    except ValueError:
        return None
    graph = explore(agents, states=2 * most, reduced=reduction)
    small = Checker(graph, [wanted])
    answers = full.check(wanted).holds, small.check(wanted).holds
    if not answers[1]:
        run, lasso = unfolded(reduction, graph, small.lasso(wanted))
        assert run.states[0] in agents.start()
        after = (*lasso.path[1:], lasso.loop)
        assert all(run.states[t] in agents.successors(run.states[s]) for s, t in zip(lasso.path, after, strict=True))
        assert label_states(agents, run.states, full.atoms)[: len(small.lasso(wanted).path)] == [
            small.labels[s] for s in small.lasso(wanted).path
        ]
        assert not Checker(run, [wanted]).check(wanted).holds
    return answers, (len(whole), len(graph))


@pytest.mark.slow
@pytest.mark.parametrize("make", [loose_society, society])
@pytest.mark.parametrize("first", some(range(0, 1000, 10), 2))
def test_the_answers_are_those_of_the_whole_state_space(tmp_path, make, first):
    for seed in range(first, first + 10):
        made = make(seed)
        for semantics in Semantics:
            agents = agents_of(tmp_path, made.program, made.environment, semantics)
            for text in made.formulas:
                found = both(agents, property_of(text))
                assert found is None or found[0][0] is found[0][1], (seed, text)


def agent(name: str, plans: str, goals: str = "g [perform]") -> str:
    return f":name: {name}\n:Initial Beliefs:\n:Initial Goals:\n{goals}\n:Plans:\n{plans}\n"


class NoSenders(Reduction):
    def _may_send(self, place, to):
        return False


class NoReceivers(Reduction):
    def turn(self, state, place):
        found = super().turn(state, place)
        return found and replace(found, to=None)


class NoDrawers(Reduction):
    def _may_draw(self, place):
        return False


class DrawsAreLocal(Reduction):
    def _silently(self, deed):
        return not self.actions_show


class ActionsHidden(Reduction):
    def _silently(self, deed):
        return not self._draws(deed)


class Blind(Reduction):
    def _shown(self, state, place):
        return 0


class PutsOff(Reduction):
    def _leads_on(self, group, turns, known):
        return True


FAULTS = {
    NoSenders: (
        SILENT,
        "[] (~B(one, early))",
        agent("one", "+!g [perform] : { True } <- +x; +.received(:tell, B) : { ~B x } <- +early;"),
        agent("two", "+!g [perform] : { True } <- .send(one, :tell, hello);"),
    ),
    NoReceivers: (
        SILENT,
        "[] (~B(two, late))",
        agent("one", "+!g [perform] : { True } <- .send(two, :tell, hello);"),
        agent("two", "+!g [perform] : { True } <- +started; +.received(:tell, B) : { B started } <- +late;"),
    ),
    NoDrawers: (
        DRAWS,
        "<> B(three, x)",
        agent("one", "+!g [perform] : { True } <- act;"),
        agent("two", "+!g [perform] : { ~B seen } <- .send(three, :tell, x); +p : { True } <- +.lock, +seen, -.lock;"),
        agent("three", "+.received(:tell, B) : { True } <- +B;", ""),
    ),
    DrawsAreLocal: (
        DRAWS,
        "[] (~B(two, a))",
        agent("one", "+!g [perform] : { True } <- act;"),
        agent("two", "+!g [perform] : { ~B seen } <- +a; +p : { True } <- +.lock, +seen, -.lock;"),
    ),
    ActionsHidden: (
        SILENT,
        "(~D(two, act)) U D(one, act)",
        agent("one", "+!g [perform] : { True } <- act;"),
        agent("two", "+!g [perform] : { True } <- act;"),
    ),
    Blind: (
        SILENT,
        "[] (~(B(two, b) & (~B(one, a))))",
        agent("one", "+!g [perform] : { True } <- +a;"),
        agent("two", "+!g [perform] : { True } <- +b;"),
    ),
    PutsOff: (
        SILENT,
        "[] (~B(three, a))",
        agent(
            "one",
            "+!g [perform] : { True } <- .send(two, :tell, x); "
            "+.received(:tell, B) : { True } <- .send(two, :tell, x);",
        ),
        agent("two", "+.received(:tell, B) : { True } <- .send(one, :tell, x);", ""),
        agent("three", "+!g [perform] : { True } <- +a;"),
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_what_is_independent_would_be_seen(tmp_path, fault):
    """A system for each part of the relation: without it, the answer is another."""
    draws, text, *programs = FAULTS[fault]
    agents = agents_of(tmp_path, "GWENDOLEN\n" + "".join(programs), draws)
    (right, ours), _ = both(agents, property_of(text))
    (_, wrong), _ = both(agents, property_of(text), fault)
    assert ours is right
    assert wrong is not right


@pytest.mark.parametrize("number", [2, 4])
def test_agents_that_have_nothing_to_do_with_each_other_take_turns_in_one_order(tmp_path, number):
    names = ["one", "two", "three", "four", "five"]
    think = "+!g [perform] : { True } <- +a, +b, .send(%s, :tell, done);"
    lonely = [agent(name, think % ("boss" + name)) for name in names[:number]]
    bosses = [agent("boss" + name, "+.received(:tell, B) : { True } <- +B;", "") for name in names[:number]]
    agents = agents_of(tmp_path, "GWENDOLEN\n" + "".join(lonely + bosses), SILENT)
    wanted = property_of("<> B(bossone, done)")
    atoms = Checker(explore(agents, states=1), [wanted]).atoms
    small = explore(agents, reduced=Reduction(agents, atoms))
    assert Checker(small, [wanted]).check(wanted).holds
    if number == 2:
        whole = explore(agents)
        assert Checker(whole, [wanted]).check(wanted).holds
        assert len(small) < len(whole) / 4
    assert len(small) < 60 * number


def test_where_draws_are_looked_at_there_is_no_reduction(tmp_path):
    fair = DRAWS + "fair: [{percept: p, because: it comes}]\n"
    two = "GWENDOLEN\n" + agent("one", "+p : { True };") + agent("two", "+p : { True };")
    for environment, text in ((fair, "<> B(one, a)"), (DRAWS, "<> P(p)")):
        agents = agents_of(tmp_path, two, environment)
        with pytest.raises(ValueError, match="draws"):
            Reduction(agents, Checker(explore(agents), [property_of(text)]).atoms)

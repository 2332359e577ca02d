"""The model checker against an independent decision procedure on random small graphs and random formulas.

The oracle guesses the truth of every Until and Release at every state (the classic closure construction), checks the
expansion laws along edges and looks for fair strongly connected sets by naive reachability: nothing is shared with the
tableau, Tarjan's algorithm, the stutter reduction or the treatment of fairness.
"""

from __future__ import annotations

from itertools import product

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from avow.backends.ajpf.checker import Kripke, find_lasso, reduce
from avow.backends.ajpf.psl import (
    FALSE,
    TRUE,
    Always,
    And,
    Atom,
    Eventually,
    Implies,
    Modality,
    Not,
    Or,
    Release,
    Until,
    automaton_of,
    compiled,
    parts,
)
from avow.backends.ajpf.terms import Struct
from avow.formulas.lasso import Fair

P, Q = (Atom(Modality.BELIEVES, "ag", Struct(name)) for name in "pq")
PLACES = {P: 0, Q: 1}
ASK, GRANT = 4, 8


def project(graph: Kripke, automaton) -> Kripke:
    """Labels as the automaton reads them: its leaves low, the fairness bits above."""
    tests = [compiled(leaf, PLACES) for leaf in automaton.leaves]
    low = len(tests)
    labels = [
        sum(1 << at for at, test in enumerate(tests) if test(label)) | (label >> 2) << low for label in graph.labels
    ]
    return Kripke(graph.initial, graph.successors, labels)


def satisfiable(graph: Kripke, formula, fair: bool, *, small: bool):
    """A fair run of the graph on which the formula holds, by the code under test."""
    automaton = automaton_of(formula)
    projected = project(graph, automaton)
    if small:
        projected = reduce(projected)
    low = len(automaton.leaves)
    assumptions = [Fair(1 << low, 1 << (low + 1))] if fair else []
    return find_lasso(projected, automaton, assumptions)


def core(formula):
    """In terms of Not, And, Or, Until and Release."""
    match formula:
        case Always(body=body):
            return Release(FALSE, core(body))
        case Eventually(body=body):
            return Until(TRUE, core(body))
        case Implies(left=left, right=right):
            return Or((Not(core(left)), core(right)))
        case Not(body=body):
            return Not(core(body))
        case And(items=items):
            return And(tuple(map(core, items)))
        case Or(items=items):
            return Or(tuple(map(core, items)))
        case Until(left=left, right=right):
            return Until(core(left), core(right))
        case Release(left=left, right=right):
            return Release(core(left), core(right))
    return formula


def temporal(formula, found):
    for part in parts(formula):
        temporal(part, found)
    if isinstance(formula, Until | Release) and formula not in found:
        found.append(formula)
    return found


def truth(formula, label, guess):
    match formula:
        case Atom():
            return bool(label >> PLACES[formula] & 1)
        case Not(body=body):
            return not truth(body, label, guess)
        case And(items=items):
            return all(truth(i, label, guess) for i in items)
        case Or(items=items):
            return any(truth(i, label, guess) for i in items)
        case Until() | Release():
            return guess[formula]
    return formula.value


def oracle(graph: Kripke, formula, fair: bool) -> bool:
    """Whether some fair run satisfies the formula."""
    formula = core(formula)
    subs = temporal(formula, [])
    guesses = [dict(zip(subs, values, strict=True)) for values in product((False, True), repeat=len(subs))]
    nodes = [(s, g) for s in range(len(graph.labels)) for g in range(len(guesses))]

    def holds(f, node):
        return truth(f, graph.labels[node[0]], guesses[node[1]])

    def fits(a, b):
        for sub in subs:
            left, right = holds(sub.left, a), holds(sub.right, a)
            later = guesses[b[1]][sub]
            expected = (right or (left and later)) if isinstance(sub, Until) else (right and (left or later))
            if guesses[a[1]][sub] != expected:
                return False
        return True

    edges = {a: [b for b in nodes if b[0] in graph.successors[a[0]] and fits(a, b)] for a in nodes}

    def reach(start, within):
        seen, stack = set(), [b for b in edges[start] if b in within]
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack += [b for b in edges[node] if b in within]
        return seen

    def fulfilled(part):
        for sub in subs:
            wanted = isinstance(sub, Until)  # a true Until is fulfilled; a false Release is refuted
            if not any(guesses[n[1]][sub] is not wanted or holds(sub.right, n) is wanted for n in part):
                return False
        return True

    def good_part(within):
        left = set(within)
        while left:
            node = left.pop()
            forward = reach(node, within)
            part = {n for n in forward if node in reach(n, within)} if node in forward else set()
            left -= part
            if not part or not fulfilled(part):
                continue
            asking = {n for n in part if graph.labels[n[0]] & ASK}
            granted = any(graph.labels[n[0]] & GRANT for n in part)
            if not fair or granted or not asking:
                return part
            smaller = good_part(part - asking)
            if smaller:
                return smaller
        return set()

    goods = set()
    everything = set(nodes)
    for node in nodes:
        if node not in goods and node in reach(node, everything):
            forward = reach(node, everything)
            part = {n for n in forward if node in reach(n, everything)}
            goods |= good_part(part)
    starts = [n for n in nodes if n[0] in graph.initial and holds(formula, n)]
    return any(n in goods or reach(n, everything) & goods for n in starts)


@st.composite
def graphs(draw):
    size = draw(st.integers(1, 4))
    labels = []
    for _ in range(size):
        label = draw(st.integers(0, 3)) | (ASK if draw(st.booleans()) else 0)
        labels.append(label | (GRANT if label & ASK and draw(st.booleans()) else 0))
    successors = [
        tuple(sorted(draw(st.sets(st.integers(0, size - 1), min_size=1, max_size=size)))) for _ in range(size)
    ]
    initial = tuple(sorted(draw(st.sets(st.integers(0, size - 1), min_size=1, max_size=2))))
    return Kripke(initial, successors, labels)


FORMULAS = st.recursive(
    st.sampled_from([P, Q, TRUE, FALSE]),
    lambda inner: st.one_of(
        st.builds(Not, inner),
        st.builds(Always, inner),
        st.builds(Eventually, inner),
        st.builds(lambda a, b: And((a, b)), inner, inner),
        st.builds(lambda a, b: Or((a, b)), inner, inner),
        st.builds(Implies, inner, inner),
        st.builds(Until, inner, inner),
        st.builds(Release, inner, inner),
    ),
    max_leaves=4,
).filter(lambda f: len(temporal(core(f), [])) <= 4)


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(graphs(), FORMULAS, st.booleans())
def test_it_agrees_with_the_oracle(graph, formula, fair):
    expected = oracle(graph, formula, fair)
    found = satisfiable(graph, formula, fair, small=False)
    assert (found is not None) == expected
    assert (satisfiable(graph, formula, fair, small=True) is not None) == expected
    if found is not None:
        check_lasso(graph, formula, found, fair)


def check_lasso(graph, formula, lasso, fair):
    """The run is a run of the graph, is fair, and satisfies the formula: the oracle agrees on the run alone."""
    path, loop = lasso.path, lasso.loop
    assert path[0] in graph.initial
    following = [*path[1:], path[loop]]
    assert all(b in graph.successors[a] for a, b in zip(path, following, strict=True))
    alone = Kripke(
        (0,),
        [(at + 1,) if at + 1 < len(path) else (loop,) for at in range(len(path))],
        [graph.labels[s] for s in path],
    )
    assert oracle(alone, formula, fair)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        (Always(Implies(P, Eventually(Q))), True),
        (Always(Implies(Q, Eventually(P))), False),
        (Until(P, Q), True),
        (Eventually(Always(Q)), True),
        (Always(P), False),
        (Release(Q, P), False),
    ],
)
def test_on_a_graph_done_by_hand(formula, expected):
    """p, then q for ever."""
    graph = Kripke((0,), [(1,), (1,)], [1, 2])
    assert (satisfiable(graph, Not(formula), False, small=False) is None) is expected


def test_a_fair_run_is_demanded():
    """p with a draw that may go on for ever unless draws are fair."""
    graph = Kripke((0,), [(0, 1), (1,)], [1 | ASK, 2 | ASK | GRANT])
    assert satisfiable(graph, Always(P), False, small=True) is not None
    assert satisfiable(graph, Always(P), True, small=True) is None


@st.composite
def repetitive_graphs(draw):
    """Few labels and few ways: stretches of one label, loops in them and ways out, as agents' graphs have them."""
    size = draw(st.integers(2, 6))
    labels = [draw(st.sampled_from([1, 1, 1, 2, 0])) for _ in range(size)]
    successors = [tuple(sorted(draw(st.sets(st.integers(0, size - 1), min_size=1, max_size=2)))) for _ in range(size)]
    return Kripke((0,), successors, labels)


SHAPES = [
    Always(P),
    Eventually(Q),
    Always(Not(Q)),
    Until(P, Q),
    And((P, Eventually(And((Not(P), Not(Q)))))),
    Always(Or((P, Q))),
    Eventually(Always(P)),
    And((Always(Eventually(P)), Always(Eventually(Not(P))))),
]


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(repetitive_graphs())
def test_reduction_changes_nothing(graph):
    small = reduce(graph)
    assert len(small) <= len(graph)
    for formula in SHAPES:
        expected = oracle(graph, formula, False)
        assert oracle(small, formula, False) == expected
        assert (satisfiable(graph, formula, False, small=True) is not None) == expected


def test_reduction_keeps_endless_stuttering():
    graph = Kripke((0,), [(0, 1), (2,), (2,)], [1, 1, 2])
    assert satisfiable(graph, Always(P), False, small=True) is not None
    assert satisfiable(Kripke((0,), [(1,), (2,), (2,)], [1, 1, 2]), Always(P), False, small=True) is None

"""Verdicts on affine maps: by induction, within a number of steps, or by a run that breaks the guarantee."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import islice

from avow.base.plain import count
from avow.base.tuning.effort import JUDGE_EFFORT
from avow.base.verdict import Verdict
from avow.formulas.formula import substitute
from avow.language import terms as t
from avow.language.contract import Clause
from avow.language.sorts import REAL
from avow.solving.questions import entails

from .answers import Found, Question
from .maps import Affine, Map, Spans, affine
from .picture import Piece
from .truth import Span
from .tuning import INDUCTION


def enclosed(question: Question, map_: Map) -> list[Piece]:
    """The first steps that the plan asks for, or as many as an induction may take; fewer if the time is over."""
    found = []
    for piece in _pieces(question, map_.boxes(question.initial, question.inputs)):
        found.append(piece)
        if piece.end == (question.given.steps or INDUCTION) or question.is_late:
            break
    return found


def judged(question: Question, clause: Clause, map_: Map, pieces: Sequence[Piece]) -> Found:
    """The verdict on one guarantee. `pieces`: see `enclosed`."""
    piece, number = question.first_open(clause, pieces), count(len(pieces), "step")
    for cover in map_.returning(question.initial, question.inputs) if piece is None else ():
        all_steps = [*_pieces(question, cover)]
        if question.first_open(clause, all_steps) is None:
            why = f"proved by induction: after {count(len(cover), 'step')} all runs are in an earlier box again"
            return Found(Verdict.PROVED, why, all_steps)
        if question.is_late:
            break
    if not question.is_late and _is_preserved(question, clause):
        why = "proved by induction: it holds after the first step, and each step preserves it"
        return Found(Verdict.PROVED, why, pieces)
    if piece is None and len(pieces) == question.given.steps:
        why = f"holds of all runs for {number}, whose values are enclosed exactly"
        return Found(Verdict.CHECKED, why, pieces, f"runs of {number}, and no longer ones")
    if piece is None:
        return Found(
            Verdict.UNKNOWN, f"holds for {number}, and no induction shows it of more: 'steps' bounds the claim"
        )

    def moments(first: Sequence[Span], inputs: Sequence[Span]) -> Iterable[Piece]:
        return islice(_pieces(question, map_.boxes(tuple(first), tuple(inputs))), len(pieces))

    found = question.broken(clause, moments)
    if found is not None:
        return Found(Verdict.REFUTED, found.text(), counterexample=found)
    return Found(Verdict.UNKNOWN, question.opened(piece), pieces)


def _pieces(question: Question, boxes: Iterable[Spans]) -> Iterable[Piece]:
    states, outputs = question.given.equations, question.given.outputs
    for k, box in enumerate(boxes, 1):
        named = dict(zip((*states, *outputs), box, strict=True))
        yield Piece(Fraction(k), Fraction(k), {s: named[s] for s in states}, {o: named[o] for o in outputs})


def _is_preserved(question: Question, clause: Clause) -> bool:
    """Whether the guarantee holds after the first step, and after each step from a state that was reached with it."""
    given, node = question.given, question.job.node
    ports = {port.variable.qualified: port.variable for port in (*node.inputs, *node.outputs)}
    states = {name: t.Variable(t.Role.INPUT, f"state {name}", REAL) for name in given.equations}
    earlier = {port.variable: replace(port.variable, name=f"before {port.name}") for port in node.inputs}
    known = {**states, **{name: ports[port] for name, port in given.inputs.items()}}
    then = {**states, **{name: earlier[ports[port]] for name, port in given.inputs.items()}}
    names = {name: Affine({name: Fraction(1)}) for name in known}
    moved = names | {name: affine(name, term, names) for name, term in given.equations.items()}
    outputs = given.outputs.items()
    after = {ports[port]: _term(affine(port, term, moved), known) for port, term in outputs}
    before = {ports[port]: _term(affine(port, term, names), then) for port, term in outputs}
    assumed = [each.formula for each in node.assumptions]
    goal = substitute(clause.formula, after)
    initial = [
        t.And((t.Compare("<=", t.Literal(s.low, REAL), x), t.Compare("<=", x, t.Literal(s.high, REAL))))
        for x, s in zip(states.values(), question.initial, strict=True)
    ]
    held = [substitute(formula, {**before, **earlier}) for formula in (clause.formula, *assumed)]
    asked = (entails([*some, *assumed], goal, effort=JUDGE_EFFORT, whether=True) for some in (initial, held))
    return all(found.verdict is Verdict.PROVED for found in asked)


def _term(of: Affine, names: Mapping[str, t.Variable]) -> t.Term:
    total: t.Term = t.Literal(of.constant, REAL)
    for name, by in of.factors.items():
        total = t.Arithmetic("+", total, t.Arithmetic("*", t.Literal(by, REAL), names[name], REAL), REAL)
    return total

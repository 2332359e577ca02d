"""Verdicts on differential equations: the enclosure of all solutions, and that of one for a counterexample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from avow.base.plain import count
from avow.base.verdict import Verdict
from avow.language.contract import Clause

from .answers import Found, Question
from .expressions import Expression
from .flow import Box, Motion, Stuck
from .intervals import Interval, outward
from .picture import Piece, shown
from .series import Undefined, interval, values
from .truth import Span


@dataclass(frozen=True, slots=True)
class Tube:
    """All solutions: pieces of time without a gap."""

    pieces: Sequence[Piece]
    lasting: bool
    """The last piece ends within the first values: nothing else ever occurs."""
    stopped: str
    """Why it ends before the horizon."""


def enclosed(question: Question) -> Tube:
    """Raises Undefined if a number is too large."""
    given = question.given
    inputs = _inputs(question, question.inputs)
    initial = tuple(map(_interval, question.initial))
    pieces: list[Piece] = []
    try:
        for step in Motion(given.equations, inputs).steps(initial, given.horizon, given.step):
            pieces.append(_piece(question, step.start, step.end, step.during, inputs))
            if all(now.is_subset(first) for now, first in zip(step.after, initial, strict=True)):
                return Tube(pieces, True, "")
            if question.is_late:
                return Tube(pieces, False, f"the time is over: enclosed up to {shown(step.end)} s")
    except (Stuck, Undefined) as why:
        reached = shown(pieces[-1].end) if pieces else "0"
        return Tube(pieces, False, f"no enclosure after {reached} s: {why}")
    return Tube(pieces, False, "")


def judged(question: Question, clause: Clause, tube: Tube) -> Found:
    """The verdict on one guarantee."""
    horizon = shown(question.given.horizon)
    piece = question.first_open(clause, tube.pieces)
    if piece is None and not tube.stopped:
        number = count(len(tube.pieces), "step")
        if tube.lasting:
            end = shown(tube.pieces[-1].end)
            why = (
                f"proved of all solutions at all times: after {end} s ({number}) they are within the first values again"
            )
            return Found(Verdict.PROVED, why, tube.pieces)
        why = f"holds of all solutions from 0 to {horizon} s, in {number} that are enclosed as a whole"
        return Found(Verdict.CHECKED, why, tube.pieces, f"the motion is enclosed for {horizon} s, and not beyond")

    def moments(first: Sequence[Span], inputs: Sequence[Span]) -> Iterator[Piece]:
        return _moments(question, tuple(map(_interval, first)), inputs)

    found = question.broken(clause, moments)
    if found is not None:
        return Found(Verdict.REFUTED, found.text(), counterexample=found)
    return Found(Verdict.UNKNOWN, tube.stopped if piece is None else question.opened(piece), tube.pieces)


def _moments(question: Question, begin: Box, held: Sequence[Span]) -> Iterator[Piece]:
    """One solution at the ends of its steps, as far as it is enclosed."""
    given, inputs = question.given, _inputs(question, held)
    try:
        yield _piece(question, Fraction(0), Fraction(0), begin, inputs)
        for step in Motion(given.equations, inputs).steps(begin, given.horizon, given.step):
            yield _piece(question, step.end, step.end, step.after, inputs)
    except (Stuck, Undefined):
        return


def _inputs(question: Question, spans: Sequence[Span]) -> dict[str, Interval]:
    return {name: _interval(span) for name, span in zip(question.given.inputs, spans, strict=True)}


@outward()
def _piece(question: Question, start: Fraction, end: Fraction, box: Box, inputs: Mapping[str, Interval]) -> Piece:
    states, outputs = question.given.equations, question.given.outputs
    found = {port: _output(term, [*states, *inputs], [*box, *inputs.values()]) for port, term in outputs.items()}
    spans = {port: span for port, span in found.items() if span is not None}
    return Piece(start, end, {name: _span(x) for name, x in zip(states, box, strict=True)}, spans)


def _output(term: Expression, names: Sequence[str], box: Sequence[Interval]) -> Span | None:
    try:
        ((found,),) = values([term], names, [(x,) for x in box])
    except Undefined:
        return None
    return None if found.is_empty() or found.is_unbounded() else _span(found)


def _span(of: Interval) -> Span:
    return Span(Fraction(of.lb()), Fraction(of.ub()))


def _interval(span: Span) -> Interval:
    return interval(span.low) | interval(span.high)

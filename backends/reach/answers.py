"""What both kinds of motion share: a question with its boxes, what was found, and the search for a counterexample."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, product

from avow.backend_kit.programs.judging import Formula
from avow.backend_kit.protocol import Job
from avow.base.verdict import Counterexample, Verdict
from avow.formulas.cases import lifted
from avow.language.contract import Clause

from .options import Given
from .picture import Piece, shown
from .truth import Box, Span, holds
from .tuning import CORNERS


@dataclass(frozen=True, slots=True)
class Found:
    """What was found about one guarantee, and the boxes that show it."""

    verdict: Verdict
    summary: str
    pieces: Sequence[Piece] = ()
    bounded: str = ""
    """What limits the answer, in words."""
    counterexample: Counterexample | None = None


@dataclass(frozen=True, slots=True)
class Question:
    """A motion, with the bounds of the node's inputs by qualified name."""

    job: Job
    given: Given
    box: Box
    unit: str
    end: float
    """On `time.monotonic`."""

    @property
    def inputs(self) -> tuple[Span, ...]:
        return tuple(self.box[port] for port in self.given.inputs.values())

    @property
    def initial(self) -> tuple[Span, ...]:
        return tuple(self.given.initial[name] for name in self.given.equations)

    @property
    def is_late(self) -> bool:
        return time.monotonic() > self.end

    def first_open(self, clause: Clause, pieces: Iterable[Piece]) -> Piece | None:
        """The first piece over which the guarantee is not shown. Raises TooManyCases."""
        formula = lifted(clause.formula)
        return next((p for p in pieces if holds(formula, {**self.box, **p.outputs}) is not True), None)

    def broken(
        self, clause: Clause, moments: Callable[[Sequence[Span], Sequence[Span]], Iterable[Piece]]
    ) -> Counterexample | None:
        """A motion that certainly breaks the guarantee at one time: from a corner of the boxes (or their middle), with
        constant inputs. `moments` encloses it at single times."""
        formula, given, spans = lifted(clause.formula), self.given, (*self.initial, *self.inputs)
        assumed = [Formula.of(each) for each in self.job.node.assumptions]
        corners = product(*(dict.fromkeys((span.low, span.high)) for span in spans))
        for point in (*islice(corners, CORNERS), tuple((span.low + span.high) / 2 for span in spans)):
            ports = dict(zip(given.inputs.values(), point[len(given.equations) :], strict=True))
            if not all(each.holds(ports) is True for each in assumed):
                continue
            single = [Span(number, number) for number in point]
            box = {port: Span(number, number) for port, number in ports.items()}
            for piece in moments(single[: len(given.equations)], single[len(given.equations) :]):
                if self.is_late:
                    return None
                if holds(formula, {**box, **piece.outputs}) is False:
                    return _counterexample(
                        clause, dict(zip(given.equations, point, strict=False)), box, piece, self.unit
                    )
        return None

    def opened(self, piece: Piece) -> str:
        """Why a guarantee is open, where and when."""
        when = f"after {shown(piece.end)} {self.unit}"
        if piece.start != piece.end:
            when = f"from {shown(piece.start)} to {shown(piece.end)} {self.unit}"
        where = ", ".join(f"{name} from {shown(s.low)} to {shown(s.high)}" for name, s in piece.outputs.items())
        return f"the enclosure does not decide it {when}: {where or 'an output may have no value'}"


def _counterexample(clause: Clause, first: dict[str, Fraction], ports: Box, piece: Piece, unit: str) -> Counterexample:
    values = [(f"(first {name})", shown(number)) for name, number in first.items()]
    for name, span in {**ports, **piece.outputs}.items():
        low, high = shown(span.low), shown(span.high)
        values.append((name, low if low == high else f"{low} to {high}"))
    return Counterexample(tuple(values), f"guarantee {clause.name} does not hold after {shown(piece.end)} {unit}")

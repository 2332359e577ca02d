"""A subject that is looked at while it answers: what it compares, and with what. Its answers are thrown away.

Where a subject decides by a number that no text has, or by two inputs together, drawn inputs seldom meet it; what the
scout has seen says where to look next. Nothing that it tells is evidence: whatever is found there is put to the subject
as it is, in a process of its own.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.base.records import dataclass
from avow.base.tuning.running import SIGHTS
from avow.isolation.subject import SubjectProcess

Simple = Fraction | str


@dataclass(frozen=True, slots=True)
class Sight:
    """One comparison, or (`right` None) one number or text that decided something. `place` is where in the program."""

    place: int
    what: str
    left: Simple
    right: Simple | None


class Scout(SubjectProcess):
    """As `SubjectProcess`; of each case the answer is what was seen of it."""

    def sights(self, cases: Sequence[Mapping[str, Any]]) -> list[tuple[Sight, ...]]:
        """Of each case what was seen, of the first also what the subject holds; nothing where it fails. Never raises:
        a scout that is lost finds nothing."""
        if self.fault or self.silent or not cases:
            return [() for _ in cases]
        found = [reply if isinstance(reply, tuple) else () for reply in self.ask_all(cases)]
        return [*found, *(() for _ in cases[len(found) :])]

    def _command(self, there: int, back: int, mark: str) -> tuple[list[str], tuple[Path, ...]]:
        command, shown = super()._command(there, back, mark)
        return [*command, json.dumps(SIGHTS)], shown

    def _one_by_one(self, cases: Sequence[Mapping[str, Any]]) -> list[Any]:
        return [] if self.silent else super()._one_by_one(cases)  # which of them it hangs on is of no interest

    def _reply(self, reply: Any) -> Any:
        told = reply.get("sights") if isinstance(reply, dict) else None
        read = [_read(sight) for sight in told] if isinstance(told, list) else []
        return tuple(sight for sight in read if sight is not None)


def _read(sight: Any) -> Sight | None:
    """None of what is no sight: it may be of the subject's making."""
    match sight:
        case [int(place), str(what), left, right]:
            one, other = _simple(left), _simple(right)
            if one is not None and (other is None or type(one) is type(other)):
                return Sight(place, what, one, other)
    return None


def _simple(data: Any) -> Simple | None:
    match data:
        case str():
            return data
        case [int(numerator), int(denominator)] if denominator > 0:
            return Fraction(numerator, denominator)
    return None

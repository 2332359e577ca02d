"""What formulas mean over timed words, from the definitions over all positions; no code is shared with the cells.

Steps come at whole seconds (several may come at one), and limits are whole seconds. Between two steps, positions are
the whole seconds and the open intervals between these, in which nothing changes: one stands for all of its instants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from avow.language.terms import And, Compare, History, Iff, Implies, Literal, Not, Or, Past, Term, Variable

_COMPARED = {
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


@dataclass(frozen=True)
class Position:
    """A step, or a part of the silence after it: an instant (`start` is `end`), or an open interval."""

    step: int
    start: int
    end: int
    silent: bool

    @property
    def time(self) -> Fraction:
        return Fraction(self.start + self.end, 2)

    @property
    def open(self) -> bool:
        return self.start < self.end


Step = Mapping[str, Any]


@dataclass(frozen=True)
class Word:
    steps: Sequence[Step]
    times: Sequence[int]

    def positions(self) -> list[Position]:
        found = [Position(0, self.times[0], self.times[0], False)]
        for k in range(1, len(self.steps)):
            before, now = self.times[k - 1], self.times[k]
            for second in range(before, now):
                if second > before:
                    found.append(Position(k - 1, second, second, True))
                found.append(Position(k - 1, second, second + 1, True))
            found.append(Position(k, now, now, False))
        return found


class Meaning:
    """The values of formulas at the positions of a word."""

    def __init__(self, word: Word) -> None:
        self.word = word
        self.positions = word.positions()
        self.places = {p.step: n for n, p in enumerate(self.positions) if not p.silent}
        self._known: dict[tuple[Term, int], Any] = {}

    def value(self, term: Term, p: int) -> Any:
        key = (term, p)
        if key not in self._known:
            self._known[key] = self._value(term, p)
        return self._known[key]

    def _value(self, term: Term, p: int) -> Any:
        at = lambda t: self.value(t, p)  # noqa: E731
        match term:
            case Literal(value=literal):
                return literal
            case Variable():
                return self.word.steps[self.positions[p].step][term.qualified]
            case Not(body=body):
                return not at(body)
            case And(items=items):
                return all(map(at, items))
            case Or(items=items):
                return any(map(at, items))
            case Implies(left=left, right=right):
                return not at(left) or at(right)
            case Iff(left=left, right=right):
                return at(left) == at(right)
            case Compare(operator=sign, left=left, right=right):
                return _COMPARED[sign](at(left), at(right))
            case History():
                return self._history(term, p)
        raise AssertionError(term)

    def _history(self, term: History, p: int) -> Any:
        k, silent, f = self.positions[p].step, self.positions[p].silent, term.arguments[0]
        there = lambda t, j: self.value(t, self.places[j])  # noqa: E731
        match term.operator:
            case Past.ARRIVED:
                assert isinstance(f, Variable)
                return not silent and (k == 0 or self.word.steps[k][f"in.arrived {f.name}"])
            case Past.ROSE:
                return not silent and there(f, k) and not (k > 0 and there(f, k - 1))
            case Past.FELL:
                return not silent and k > 0 and there(f, k - 1) and not there(f, k)
            case Past.CHANGED:
                return not silent and k > 0 and there(f, k) != there(f, k - 1)
            case Past.PREVIOUS:
                return there(f, k - 1) if k else there(term.arguments[1], 0)
            case Past.COUNTED:
                last = max((j for j in range(k + 1) if there(term.arguments[1], j)), default=-1)
                return sum(1 for j in range(last + 1, k + 1) if there(f, j))
        if term.limit is not None and term.limit.steps:
            most = there(term.limit.amount, k)
            match term.operator:
                case Past.ONCE:
                    return any(there(f, j) for j in range(k + 1) if k - j <= most)
                case Past.HISTORICALLY:
                    return all(there(f, j) for j in range(k + 1) if k - j <= most)
                case Past.HELD:
                    return k >= most and all(there(f, j) for j in range(k - most, k + 1))
            raise AssertionError(term)
        limit = None if term.limit is None else self.value(term.limit.amount, p)
        match term.operator:
            case Past.ONCE:
                return self._since(None, f, "<=", limit, p)
            case Past.HISTORICALLY:
                return not self._since(None, Not(f), "<=", limit, p)
            case Past.HELD:
                return self._since(f, f, ">=", limit, p)
            case Past.SINCE:
                relation = term.limit.relation if term.limit is not None else "<="
                return self._since(f, term.arguments[1], relation, limit, p)
        raise AssertionError(term)

    def _since(self, holds: Term | None, began: Term, relation: str, limit: Any, p: int) -> bool:
        """Since a position that is that old, and at which something began, something holds."""
        now, fits = self.positions[p], _COMPARED[relation]
        for j in range(p, -1, -1):
            there = self.positions[j]
            going_on = holds is None or self.value(holds, j)
            if self.value(began, j) and (j == p or not there.open or going_on):
                if relation in ("<", "<="):  # the latest of its instants
                    age = Fraction(0) if j == p else now.time - there.end
                else:  # the earliest
                    age = now.time - there.start if j < p or (there.open and going_on) else Fraction(0)
                if limit is None or fits(age, limit):
                    return True
            if not going_on:
                return False
        return False

    def broken(self, trigger: Term, response: History) -> int | None:
        """The first position at which the word has broken ``trigger -> response``, by what a response demands of the
        positions that follow; None where none has."""
        wanted, found, positions = response.arguments[0], list[int](), self.positions
        limit: Any = None if response.limit is None else response.limit.amount.value  # type: ignore[union-attr]
        for j, there in enumerate(positions):
            if not self.value(trigger, j):
                continue
            for p in range(j, len(positions)):
                now = positions[p]
                match response.operator:
                    case Past.WITHIN:
                        due = there.start + limit
                        in_time = now.start < due or (now.start == due and (not now.open or there.open))
                        if in_time and self.value(wanted, p):
                            break
                        if now.start > due or (now.start == due and now.open and not self.value(wanted, p)):
                            found.append(p)
                            break
                    case Past.FOR:
                        last = there.end + limit if p > j else now.start
                        if now.start > last or (now.start == last and now.open and p > j):
                            break
                        if not self.value(wanted, p):
                            found.append(p)
                            break
                    case Past.UNTIL:
                        if self.value(response.arguments[1], p):
                            break
                        if not self.value(wanted, p):
                            found.append(p)
                            break
                    case _:
                        raise AssertionError(response.operator)
        return min(found, default=None)

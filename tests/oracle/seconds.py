"""What formulas mean over timed words, from the definitions over all positions; no code is shared with the cells.

Steps come at whole seconds (several may come at one), and limits are whole seconds. Between two steps, positions are
the whole seconds and the open intervals between these, in which nothing changes: one stands for all of its instants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from avow.language.terms import History, Not, Past, Term, Variable

from .values import COMPARED, NOWHERE, Meaning, Run, Step


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


@dataclass(frozen=True)
class Word(Sequence[Step]):
    """As a run: the step that each of its positions is at."""

    steps: Sequence[Step]
    times: Sequence[int]

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, p: Any) -> Any:
        return self.steps[self.positions[p].step]

    @cached_property
    def places(self) -> dict[int, int]:
        """Of each step, its position."""
        return {p.step: n for n, p in enumerate(self.positions) if not p.silent}

    @cached_property
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


_OF_STEPS = (Past.PREVIOUS, Past.ROSE, Past.FELL, Past.CHANGED, Past.COUNTED)


class InSeconds(Meaning):
    """The values of formulas at the positions of a word."""

    def __init__(self, word: Word) -> None:
        super().__init__()
        self.word = word
        self._known: dict[tuple[Term, int], Any] = {}

    def at(self, term: Term, p: int) -> Any:
        return self.value(term, self.word, p)

    def place(self, j: int) -> int:
        return self.word.places[j]

    def value(self, term: Term, run: Run, k: int = 0, bound: Step = NOWHERE) -> Any:
        if (term, k) not in self._known:
            self._known[term, k] = super().value(term, run, k)
        return self._known[term, k]

    def history(self, term: History, run: Run, k: int, bound: Step) -> Any:
        position, f = self.word.positions[k], term.arguments[0]
        match term.operator:
            case Past.ARRIVED:
                assert isinstance(f, Variable)
                return not position.silent and (position.step == 0 or run[k][f"in.arrived {f.name}"])
            case Past.ROSE | Past.FELL | Past.CHANGED if position.silent:
                return False
        if term.limit.steps if term.limit is not None else term.operator in _OF_STEPS:
            return super().history(term, run, position.step, bound)
        limit = None if term.limit is None else self.at(term.limit.amount, k)
        match term.operator:
            case Past.ONCE:
                return self._since(None, f, "<=", limit, k)
            case Past.HISTORICALLY:
                return not self._since(None, Not(f), "<=", limit, k)
            case Past.HELD:
                return self._since(f, f, ">=", limit, k)
            case Past.SINCE:
                relation = term.limit.relation if term.limit is not None else "<="
                return self._since(f, term.arguments[1], relation, limit, k)
        raise AssertionError(term)

    def _since(self, holds: Term | None, began: Term, relation: str, limit: Any, p: int) -> bool:
        """Since a position that is that old, and at which something began, something holds."""
        now, fits = self.word.positions[p], COMPARED[relation]
        for j in range(p, -1, -1):
            there = self.word.positions[j]
            going_on = holds is None or self.at(holds, j)
            if self.at(began, j) and (j == p or not there.open or going_on):
                if relation in ("<", "<="):  # the latest of its instants
                    age = Fraction(0) if j == p else now.time - there.end
                else:  # the earliest
                    age = now.time - there.start if j < p or (there.open and going_on) else Fraction(0)
                if limit is None or fits(age, limit):
                    return True
            if not going_on:
                return False
        return False

    def broken(self, trigger: Term, response: History, run: Run) -> int | None:
        """The first position at which the word has broken ``trigger -> response``, by what a response demands of the
        positions that follow; None where none has."""
        wanted, found, positions = response.arguments[0], list[int](), self.word.positions
        limit: Any = None if response.limit is None else response.limit.amount.value  # type: ignore[union-attr]
        for j, there in enumerate(positions):
            if not self.at(trigger, j):
                continue
            for p in range(j, len(positions)):
                now = positions[p]
                match response.operator:
                    case Past.WITHIN:
                        due = there.start + limit
                        in_time = now.start < due or (now.start == due and (not now.open or there.open))
                        if in_time and self.at(wanted, p):
                            break
                        if now.start > due or (now.start == due and now.open and not self.at(wanted, p)):
                            found.append(p)
                            break
                    case Past.FOR:
                        last = there.end + limit if p > j else now.start
                        if now.start > last or (now.start == last and now.open and p > j):
                            break
                        if not self.at(wanted, p):
                            found.append(p)
                            break
                    case Past.UNTIL:
                        if self.at(response.arguments[1], p):
                            break
                        if not self.at(wanted, p):
                            found.append(p)
                            break
                    case _:
                        raise AssertionError(response.operator)
        return min(found, default=None)

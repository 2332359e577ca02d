"""What RCL's terms and clauses mean, written from docs/language.md alone, over runs of steps and in dense time.

Values are Python's: truth values, exact fractions, strings (also for elements of an enumeration), ``("go", "red")`` for
data, tuples for tuples and sequences; a function is a dictionary from arguments (see `Table`) or the set of the
arguments at which it is TRUE. A step maps names as a formula writes them (``in.a``) to values. A run is a list of
steps; a `Word` is a run with times, and is looked at in its positions: its steps, and the silence between them.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import isqrt
from typing import Any

from avow.language import terms as t
from avow.language.sorts import BOOL, BoolSort, DataSort, EnumSort, FunctionSort, Sort, TupleSort

from . import decimals

Step = Mapping[str, Any]
Run = Sequence[Step]
NOWHERE: Step = {}

COMPARED: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


NEAR = Fraction(1, 10**100)
"""Numbers that are nearer to each other are the same: square roots, sines, cosines and angles are computed to twice as
many digits, and nothing that tests say of their sums and products distinguishes numbers that are so near."""


class NoValue(Exception):  # noqa: N818 - it names what a term has
    """The term has no value."""


class Table(dict[Any, Any]):
    """A total function: points, and what it is elsewhere."""

    def __init__(self, points: Mapping[Any, Any], default: Any) -> None:
        super().__init__(points)
        self.default = default

    def __missing__(self, _: Any) -> Any:
        return self.default


@dataclass(frozen=True)
class Position:
    """A step, or a part of the silence after it: an instant (`start` is `end`), or an open interval."""

    step: int
    start: Fraction
    end: Fraction
    silent: bool

    @property
    def time(self) -> Fraction:
        return (self.start + self.end) / 2

    @property
    def open(self) -> bool:
        return self.start < self.end


@dataclass(frozen=True)
class Word(Sequence[Step]):
    """Steps with their times. `grain` divides all times and all limits in seconds, so that nothing changes within an
    open interval of that length. As a sequence: the step that each position is at."""

    steps: Sequence[Step]
    times: Sequence[int | Fraction]
    grain: Fraction = Fraction(1)

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
        found: list[Position] = []
        for k, time in enumerate(map(Fraction, self.times)):
            found.append(Position(k, time, time, False))
            end = Fraction(self.times[k + 1]) if k + 1 < len(self.times) else time
            while time < end:
                found.append(Position(k, time, time + self.grain, True))
                time += self.grain
                if time < end:
                    found.append(Position(k, time, time, True))
            assert time == end, "the grain divides all times"
        return found


def is_finite(sort: Sort) -> bool:
    match sort:
        case BoolSort() | EnumSort():
            return True
        case DataSort(constructors=constructors):
            return all(is_finite(p) for c in constructors for p in c.parameters)
        case TupleSort(items=items):
            return all(map(is_finite, items))
        case FunctionSort(parameters=parameters, result=result):
            return all(map(is_finite, (*parameters, result)))
        case _:
            return False


def members(sort: Sort) -> list[Any]:
    """All values of a finite sort."""
    match sort:
        case BoolSort():
            return [False, True]
        case EnumSort(members=names):
            return list(names)
        case DataSort(constructors=constructors):
            return [(c.name, *items) for c in constructors for items in product(*map(members, c.parameters))]
        case TupleSort(items=items):
            return list(product(*map(members, items)))
        case FunctionSort(parameters=parameters, result=result):
            points = list(product(*map(members, parameters)))
            return [dict(zip(points, chosen, strict=True)) for chosen in product(members(result), repeat=len(points))]
    raise AssertionError(sort)


@functools.lru_cache(maxsize=20_000)
def has_value_always(term: t.Term) -> bool:
    """Whether it has in it no quotient, no element of a sequence, no square root and no angle of a vector."""
    partial = isinstance(term, t.Index) or (isinstance(term, t.Arithmetic) and term.operator == "/")
    partial = partial or (isinstance(term, t.Operation) and term.operator in ("sqrt", "atan2"))
    return not partial and all(map(has_value_always, term.children))


class Meaning:
    """Values of terms. `ranges`: what quantified variables of an infinite sort range over; else over the collection
    that their formula restricts them to."""

    def __init__(self, ranges: Mapping[Sort, Iterable[Any]] = {}) -> None:
        self.ranges = ranges
        self._known: dict[tuple[int, t.Term, int], Any] = {}
        self._runs: dict[int, Run] = {}

    def met(self, formula: t.Term, run: Run, k: int = 0, bound: Step = NOWHERE) -> bool:
        """Whether a claim is met: one without a value is not."""
        return self.truth(formula, run, k, bound) is True

    def truth(self, formula: t.Term, run: Run, k: int = 0, bound: Step = NOWHERE) -> bool | None:
        """None: it has no value."""
        try:
            return bool(self.value(formula, run, k, bound))
        except NoValue:
            return None

    def value(self, term: t.Term, run: Run, k: int = 0, bound: Step = NOWHERE) -> Any:
        """At step `k` of a run, at position `k` of a word. Raises NoValue."""

        def of(part: t.Term) -> Any:
            return self.value(part, run, k, bound)

        match term:
            case t.Literal(value=value):
                return value if isinstance(value, bool | str) else Fraction(value)
            case t.EnumValue(name=name):
                return name
            case t.Variable():
                return bound[term.qualified] if term.qualified in bound else run[k][term.qualified]
            case t.Widen(term=inner):
                return of(inner)
            case t.Not(body=body):
                return not of(body)
            case t.And(items=items):
                return self._decided(items, False, run, k, bound)
            case t.Or(items=items):
                return self._decided(items, True, run, k, bound)
            case t.Implies(left=left, right=right):
                return self._decided((t.Not(left), right), True, run, k, bound)
            case t.Iff(left=left, right=right):
                return of(left) == of(right)
            case t.Compare(operator=sign, left=left, right=right):
                one, other = of(left), of(right)
                near = isinstance(one, Fraction) and isinstance(other, Fraction) and abs(one - other) < NEAR
                return COMPARED[sign](one, one if near else other)
            case t.In(item=item, collection=collection):
                return of(item) in self._collected(collection, run, k, bound)
            case t.Conditional(condition=condition, then=then, otherwise=otherwise):
                return of(then if of(condition) else otherwise)
            case t.Quantified():
                return self._quantified(term, run, k, bound)
            case t.History():
                return self.history(term, run, k, bound)
            case t.Apply(function=function, arguments=arguments):
                table, at = of(function), tuple(map(of, arguments))
                return table[at] if isinstance(table, dict) else at in table
            case t.Construct(constructor=constructor, arguments=arguments):
                return (constructor, *map(of, arguments))
            case t.TupleTerm(items=items) | t.SequenceTerm(items=items):
                return tuple(map(of, items))
            case t.SequenceRange():
                return self._collected(term, run, k, bound)
            case t.Length(sequence=sequence):
                return Fraction(len(of(sequence)))
            case t.Item(record=record, position=position):
                return of(record)[position]
            case t.Index(sequence=sequence, index=index):
                items, at = of(sequence), of(index)
                return items[int(at)] if 0 <= at < len(items) else self.without_value(term)
            case t.Negative(term=inner):
                return -of(inner)
            case t.Arithmetic(operator=sign, left=left, right=right):
                one, other = of(left), of(right)
                match sign:
                    case "+":
                        return one + other
                    case "-":
                        return one - other
                    case "*":
                        return one * other
                return Fraction(one) / other if other else self.without_value(term)
            case t.Operation(operator=name, arguments=arguments):
                given = list(map(of, arguments))
                lacks = name == "sqrt" and given[0] <= -NEAR
                lacks = lacks or (name == "atan2" and all(abs(number) < NEAR for number in given))
                return self.without_value(term) if lacks else _operation(name, given)
        return self.unwritten(term, run, k, bound)

    def without_value(self, term: t.Term) -> Any:
        raise NoValue

    def unwritten(self, term: t.Term, run: Run, k: int, bound: Step) -> Any:
        """A term that no contract says."""
        raise AssertionError(term)

    def _decided(self, parts: Sequence[t.Term], end: bool, run: Run, k: int, bound: Step) -> bool:
        """A disjunction (`end`: TRUE) or a conjunction. A part may be without a value where another, which always has
        one or stands before it, is the `end`."""
        found = [self.truth(part, run, k, bound) for part in parts]
        for i, truth in enumerate(found):
            if truth is None and not any(
                found[j] is end and (j < i or has_value_always(parts[j])) for j in range(len(parts))
            ):
                raise NoValue
        return end if end in found else not end

    def _collected(self, collection: t.Term, run: Run, k: int, bound: Step) -> tuple[Any, ...]:
        match collection:
            case t.SetTerm(items=items):
                return tuple(self.value(item, run, k, bound) for item in items)
            case t.SequenceRange(low=low, high=high):
                first, last = (int(self.value(each, run, k, bound)) for each in (low, high))
                return tuple(map(Fraction, range(first, last + 1)))
        return tuple(self.value(collection, run, k, bound))

    def _quantified(self, term: t.Quantified, run: Run, k: int, bound: Step) -> bool:
        """Its body has a value at every value of its variables that the guards allow, which are within the body."""
        found = [self.value(term.body, run, k, more) for more in self.choices(term, run, k, bound)]
        match term.quantifier:
            case t.Quantifier.FORALL:
                return all(found)
            case t.Quantifier.EXISTS:
                return any(found)
        return found.count(True) == 1

    def choices(self, term: t.Quantified, run: Run, k: int, bound: Step) -> Iterator[Step]:
        """Values of the variables, beside those that are `bound`."""
        chosen = [bound]
        for variable in term.variables:
            more = []
            for before in chosen:
                if is_finite(variable.sort):
                    values: Iterable[Any] = members(variable.sort)
                elif variable.sort in self.ranges:
                    values = self.ranges[variable.sort]
                else:
                    values = dict.fromkeys(self._collected(_range_of(variable, term), run, k, before))
                more += [{**before, variable.qualified: value} for value in values]
            chosen = more
        yield from chosen

    # -- other steps ---------------------------------------------------------------------------------------------------

    def history(self, term: t.History, run: Run, k: int, bound: Step) -> Any:
        if bound:
            return self._history(term, run, k, bound)
        self._runs[id(run)] = run
        at = (id(run), term, k)
        if at not in self._known:
            self._known[at] = self._history(term, run, k, bound)
        return self._known[at]

    def _history(self, term: t.History, run: Run, k: int, bound: Step) -> Any:
        limit = None if term.limit is None else self.value(term.limit.amount, run, k, bound)
        if isinstance(run, Word):
            position = run.positions[k]
            match term.operator:
                case t.Past.ARRIVED:
                    (port,) = term.arguments
                    assert isinstance(port, t.Variable)
                    return not position.silent and (position.step == 0 or run[k][f"in.arrived {port.name}"])
                case t.Past.ROSE | t.Past.FELL | t.Past.CHANGED if position.silent:
                    return False
            counted = (t.Past.PREVIOUS, t.Past.ROSE, t.Past.FELL, t.Past.CHANGED, t.Past.COUNTED)
            if not (term.limit.steps if term.limit is not None else term.operator in counted):
                return self._in_time(term, limit, run, k, bound)
            k = position.step
        assert term.limit is None or term.limit.steps or isinstance(run, Word)
        return self._in_steps(term, limit, run, k, bound)

    def _in_steps(self, term: t.History, limit: Any, run: Run, k: int, bound: Step) -> Any:
        """At step `k`, whose silence has the same value."""
        f, *others = term.arguments

        def at(argument: t.Term, j: int) -> Any:
            """A formula without a value was not so at that step; another term without one has none."""
            place = run.places[j] if isinstance(run, Word) else j
            read = self.met if argument.sort == BOOL else self.value
            return read(argument, run, place, bound)

        recent = [j for j in range(k + 1) if limit is None or k - j <= limit]
        match term.operator:
            case t.Past.PREVIOUS:
                return at(f, k - 1) if k else at(others[0], 0)
            case t.Past.ROSE:
                return at(f, k) and not (k and at(f, k - 1))
            case t.Past.FELL:
                return bool(k and at(f, k - 1) and not at(f, k))
            case t.Past.CHANGED:
                return bool(k and at(f, k - 1) != at(f, k))
            case t.Past.ONCE:
                return any(at(f, j) for j in recent)
            case t.Past.HISTORICALLY:
                return all(at(f, j) for j in recent)
            case t.Past.HELD:
                return k >= limit and all(at(f, j) for j in recent)
            case t.Past.SINCE:
                fits = COMPARED[term.limit.relation if term.limit is not None else ">="]
                began = (j for j in range(k + 1) if at(others[0], j) and fits(k - j, limit or 0))
                return any(all(at(f, i) for i in range(j + 1, k + 1)) for j in began)
            case t.Past.COUNTED:
                last = max((j for j in range(k + 1) if at(others[0], j)), default=-1)
                return Fraction(sum(at(f, j) for j in range(last + 1, k + 1)))
        raise AssertionError(term.operator)

    def _in_time(self, term: t.History, limit: Any, run: Word, k: int, bound: Step) -> bool:
        f, *others = term.arguments

        def holds(formula: t.Term) -> Callable[[int], bool]:
            return lambda p: self.met(formula, run, p, bound)

        relation = term.limit.relation if term.limit is not None else ""
        match term.operator:
            case t.Past.ONCE:
                return _since(lambda p: True, holds(f), "<=", limit, run, k)
            case t.Past.HISTORICALLY:
                return not _since(lambda p: True, lambda p: not self.met(f, run, p, bound), "<=", limit, run, k)
            case t.Past.HELD:
                return _since(holds(f), holds(f), ">=", limit, run, k)
            case t.Past.SINCE:
                return _since(holds(f), holds(others[0]), relation or "<=", limit, run, k)
        raise AssertionError(term.operator)

    # -- clauses -------------------------------------------------------------------------------------------------------

    def broken(self, clause: t.Term, run: Run, bound: Step = NOWHERE) -> int | None:
        """The first step (position) by which a run has broken a clause; None where none has."""
        match clause:
            case t.Quantified(quantifier=t.Quantifier.FORALL, body=body) if _responds(body):
                found = [self.broken(body, run, more) for more in self.choices(clause, run, 0, bound)]
                return min((k for k in found if k is not None), default=None)
            case t.Implies(left=left, right=t.History() as right) if right.operator in t.RESPONSES:
                return min(self._breaches(left, right, run, bound), default=None)
            case t.History() if clause.operator in t.RESPONSES:
                return min(self._breaches(t.TRUE, clause, run, bound), default=None)
            case t.History(operator=t.Past.STEPS):
                assert isinstance(run, Word)
                assert clause.limit is not None
                return min(_off_pace(clause.limit.relation, self.value(clause.limit.amount, run), run), default=None)
        return next((k for k in range(len(run)) if not self.met(clause, run, k, bound)), None)

    def _breaches(self, trigger: t.Term, response: t.History, run: Run, bound: Step) -> Iterator[int]:
        for j in range(len(run)):
            if not self.met(trigger, run, j, bound):
                continue
            limit: Any = None if response.limit is None else self.value(response.limit.amount, run, j, bound)
            wanted = [p for p in range(j, len(run)) if self.met(response.arguments[0], run, p, bound)]
            match response.operator:
                case t.Past.NEXT:
                    yield from self._next(wanted, run, j)
                case t.Past.UNTIL:
                    ends = (p for p in range(j, len(run)) if self.met(response.arguments[1], run, p, bound))
                    end = next(ends, len(run))
                    yield from (p for p in range(j, end) if p not in wanted)
                case t.Past.WITHIN:
                    due, late = _due(limit, run, j, response)
                    if late is not None and not any(due(p) for p in wanted):
                        yield late
                case t.Past.FOR:
                    asked, _ = _due(limit, run, j, response)
                    yield from (p for p in range(j, len(run)) if asked(p) and p not in wanted)
                case t.Past.EVENTUALLY:
                    return

    def _next(self, wanted: list[int], run: Run, j: int) -> Iterator[int]:
        if not isinstance(run, Word):
            after: int | None = j + 1
        else:
            position = run.positions[j]
            after = None if position.silent else run.places.get(position.step + 1)
        if after is not None and after < len(run) and after not in wanted:
            yield after


def _since(f: Callable[[int], bool], g: Callable[[int], bool], relation: str, limit: Any, run: Word, k: int) -> bool:
    """Whether there is an instant s at which, just before which or just after which G was so, F at every instant after
    it (if G was so only before it: at s too), and as old as the limit says."""
    now = run.positions[k].time
    for j in range(k, -1, -1):
        there, going_on = run.positions[j], f(j)
        if g(j):
            last = now if j == k else there.end
            first = min(there.start, last) if going_on and there.open else last
            age = now - (last if relation in ("<", "<=") else first)
            if limit is None or COMPARED[relation](age, limit):
                return True
        if not going_on:
            return False
    return False


def _due(limit: Any, run: Run, j: int, response: t.History) -> tuple[Callable[[int], bool], int | None]:
    """Of a trigger at `j`: at which positions from it on something is within the limit, and the first at which it is
    over, where the run goes that far. `within` is counted from where the trigger began, `for` from where it ended."""
    assert response.limit is not None
    if not isinstance(run, Word):
        return lambda p: p - j <= limit, j + int(limit) if j + limit < len(run) else None
    if response.limit.steps:
        first = run.positions[j].step
        last = run.places.get(first + int(limit))
        return lambda p: run.positions[p].step - first <= limit, last
    there = run.positions[j]
    within = response.operator is t.Past.WITHIN
    end = (there.start if within else there.end) + limit

    def in_time(p: int) -> bool:
        now = run.positions[p]
        open_too = now.open and not (within and there.open)
        return p == j or now.start < end or (now.start == end and not open_too)

    def over(p: int) -> bool:
        now = run.positions[p]
        return now.start > end or (now.start == end and now.open)

    return in_time, next((p for p in range(j, len(run)) if over(p)), None)


def _off_pace(relation: str, pace: Fraction, run: Word) -> Iterator[int]:
    """Positions by which a step is too late, or (`every`) too early."""
    times = [Fraction(time) for time in run.times]
    for p, there in enumerate(run.positions):
        before = times[there.step - (not there.silent)] if there.step or there.silent else None
        if before is None:
            continue
        if there.end - before > pace or (relation != "<=" and not there.silent and there.end - before < pace):
            yield p


def _responds(term: t.Term) -> bool:
    match term:
        case t.Quantified(body=body):
            return _responds(body)
        case t.Implies(right=right):
            return _responds(right)
    return isinstance(term, t.History) and term.operator in t.RESPONSES


def _operation(name: str, given: list[Any]) -> Any:
    match name:
        case "xor":
            return given[0] != given[1]
        case "abs":
            return max(given[0], -given[0])
        case "min":
            return min(given)
        case "max":
            return max(given)
        case "div":
            return Fraction(given[0] // given[1])
        case "mod":
            return given[0] - given[1] * (given[0] // given[1])
        case "sqrt":
            number, digits = Fraction(max(given[0], 0)), 10**200
            exact = Fraction(isqrt(number.numerator), isqrt(number.denominator))
            return exact if exact**2 == number else Fraction(isqrt(int(number * digits**2)), digits)
        case "sin":
            return decimals.sine(Fraction(given[0]))
        case "cos":
            return decimals.cosine(Fraction(given[0]))
        case "atan2":
            return decimals.angle(*(Fraction(0 if abs(number) < NEAR else number) for number in given))
    raise AssertionError(f"the reference does not know {name}: describe it in {__file__}")


def _range_of(variable: t.Variable, term: t.Quantified) -> t.Term:
    """The collection that the body restricts a variable of an infinite sort to."""
    stack = [term.body]
    while stack:
        match stack.pop():
            case t.In(item=t.Variable() as item, collection=collection) if item == variable:
                return collection
            case t.And(items=items):
                stack.extend(reversed(items))
            case t.Implies(left=left) if term.quantifier is t.Quantifier.FORALL:
                stack.append(left)
    raise AssertionError(f"{variable.name} ranges over too much")


# -- without an instance -----------------------------------------------------------------------------------------------


def value(term: t.Term, run: Run, k: int) -> Any:
    return Meaning().value(term, run, k)


def holds(formula: t.Term, step: Step) -> bool:
    """Of one that speaks of this step alone."""
    return Meaning().met(formula, [step])


def broken(clause: t.Term, run: Run) -> int | None:
    return Meaning().broken(clause, run)


def breaks(clause: t.Term, run: Run) -> bool:
    """Whether some step of a run breaks a clause."""
    return broken(clause, run) is not None


def keeps(clause: t.Term, run: Run) -> bool:
    """Whether a clause is not broken at the last step of a run (a response: at none before, either)."""
    return breaks(clause, run) is False if _responds(clause) else Meaning().met(clause, run, len(run) - 1)


def lasts(clause: t.Term, stem: Run, loop: Run) -> bool:
    """Whether a run keeps a clause that goes through `stem` and then through `loop` for ever.

    The loop is gone through until everything that is remembered comes again: limits and nesting say how often."""
    remembered = list(_histories(clause))
    assert all(h.operator is not t.Past.COUNTED for h in remembered), "counts may grow without end"
    limits = sum(int(h.limit.amount.value) for h in remembered if h.limit is not None)  # type: ignore[union-attr]
    times = limits // len(loop) + len(remembered) + 2
    run = [*stem, *loop * (2 * times)]
    if (
        isinstance(clause, t.Implies)
        and isinstance(clause.right, t.History)
        and clause.right.operator is t.Past.EVENTUALLY
    ):
        (wanted,) = clause.right.arguments
        meaning, asked = Meaning(), len(stem) + len(loop) * times
        last = max((k for k in range(len(run)) if meaning.met(wanted, run, k)), default=-1)
        return last >= asked or not any(meaning.met(clause.left, run, k) for k in range(last + 1, asked + len(loop)))
    return not breaks(clause, run)


def _histories(term: t.Term) -> Iterator[t.History]:
    if isinstance(term, t.History):
        yield term
    for part in term.children:
        yield from _histories(part)

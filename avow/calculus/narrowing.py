"""The outputs that a node may have, found by lazy search: a function's or a sequence's values are chosen when they are
read.

An open function has a table of decided points, and `ANY` everywhere else. The evaluation of a guarantee over one stops
at a point that it needs, and reports that point (`Undecided`), unless another part of the guarantee decides it. The
search continues with each possible value, and points that no clause reads stay open. So one open function represents
all functions that complete it, and a search that ends has covered them all (lazy narrowing: Lindblad 2007; Runciman,
Naylor and Lindblad 2008).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from typing import Any

from avow.base.records import dataclass
from avow.base.tuning.bounds import PARTIAL_ANSWERS, PARTIAL_ANSWERS_AGAIN, POINTS_OF_ARGUMENTS
from avow.base.tuning.effort import SEARCH_STEPS
from avow.evaluation.compiler import combinations
from avow.evaluation.evaluate import Domains, Evaluator, NotEvaluable, compile_term
from avow.formulas.formula import free_variables
from avow.formulas.values import Data, FunctionValue, Opaque, SequenceValue, Value
from avow.language.contract import Clause
from avow.language.sorts import FunctionSort, SequenceSort
from avow.language.terms import And, Apply, Compare, Implies, Role, Term, Variable
from avow.solving.limits import spend

Values = dict[str, Value]
Point = tuple[Value, ...]
Holds = Callable[[Mapping[str, Value]], bool]


class _Any(Opaque):
    __slots__ = ()

    def __str__(self) -> str:
        return "any"


ANY = _Any("any", -1)
"""Marks an undecided value: a function's default, or an element of a sequence."""


class Undecided(Exception):  # noqa: N818 - it names a state
    """A clause cannot be judged before these points are decided: (variable, arguments), in the order read."""

    def __init__(self, wanted: Sequence[tuple[str, Point]]) -> None:
        super().__init__(wanted)
        self.wanted = tuple(wanted)

    def __str__(self) -> str:
        return f"{self.wanted[0][0]} is open"


def is_open(value: Value) -> bool:
    """Whether a function or a sequence has undecided values."""
    match value:
        case FunctionValue(default=default):
            return default is ANY
        case SequenceValue(items=items):
            return any(item is ANY for item in items)
        case _:  # other values are never open
            return False


Lazy = tuple[tuple[str, tuple[Point, ...] | None], ...]
"""Variables whose values may be open; for a function, all its points, if they are finitely many."""


def lazy_names(formula: Term, domains: Domains | None = None) -> Lazy:
    """The free variables of a formula whose values may be open. `domains`: for quantifiers over these values only."""
    return tuple(
        (
            v.qualified,
            combinations(v.sort.parameters, domains, POINTS_OF_ARGUMENTS) if isinstance(v.sort, FunctionSort) else None,
        )
        for v in free_variables(formula)
        if isinstance(v.sort, FunctionSort | SequenceSort)
    )


def decided(value: Value, point: Point, result: Value) -> Value:
    """The open value with one more point decided."""
    match value:
        case FunctionValue(table=table, default=default):
            return FunctionValue(dict(sorted({**table, point: result}.items(), key=_order)), default)
        case SequenceValue(items=items):
            [at] = point
            assert isinstance(at, int)
            return SequenceValue((*items[:at], result, *items[at + 1 :]))
    raise AssertionError("only functions and sequences are open")


def closed(value: Value, result: Value) -> Value:
    """The open value with one value for all its open points."""
    match value:
        case FunctionValue(table=table):
            return FunctionValue(table, result)
        case SequenceValue(items=items):
            return SequenceValue(tuple(result if item is ANY else item for item in items))
    raise AssertionError("only functions and sequences are open")


def _order(entry: tuple[Point, Value]) -> tuple[object, ...]:
    return tuple((0, a, "") if isinstance(a, int | Fraction) else (1, 0, str(a)) for a in entry[0])


def opened(found: Mapping[str, Value], names: Lazy) -> tuple[Mapping[str, Value], list[tuple[str, Point]]]:
    """The valuation with its open values wrapped to record reads of open points, and the list of these reads."""
    wanted: list[tuple[str, Point]] = []
    asking: Values = {}
    for name, points in names:
        value = found.get(name)
        if value is None or not is_open(value):
            continue
        match value:
            case FunctionValue(table=table, default=default):
                asking[name] = FunctionValue(_OpenTable(name, table, wanted, points), default)
            case SequenceValue(items=items):
                asks: Any = _OpenItems(name, items, wanted)
                asking[name] = SequenceValue(asks)
    return ({**found, **asking} if asking else found), wanted


class _Asked(NotEvaluable):
    """Evaluation read an open point. This does no harm if another part decides the whole."""


class _OpenTable(Mapping[Point, Value]):
    """A table that records which point was read. If all points are read, it reads one after the other, provided they
    are finitely many."""

    def __init__(
        self,
        name: str,
        table: Mapping[Point, Value],
        wanted: list[tuple[str, Point]],
        points: tuple[Point, ...] | None,
    ) -> None:
        self._name, self._table, self._wanted, self._points = name, table, wanted, points

    def get(self, point: Point, default: Any = None) -> Value:
        found = self._table.get(point)
        if found is None:
            self._wanted.append((self._name, point))
            raise _Asked(f"{self._name} is open")
        return found

    def __getitem__(self, point: Point) -> Value:
        return self.get(point)

    def _all(self) -> dict[Point, Value]:
        if self._points is None:
            raise NotEvaluable(f"{self._name} is not known at all its points")
        return {point: self.get(point) for point in self._points}

    def __iter__(self) -> Iterator[Point]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())


class _OpenItems(Sequence[Value]):
    """The elements of a sequence of known length, some of them open."""

    def __init__(self, name: str, items: tuple[Value, ...], wanted: list[tuple[str, Point]]) -> None:
        self._name, self._items, self._wanted = name, items, wanted

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, at: Any) -> Any:
        found = self._items[at]
        if found is ANY:
            self._wanted.append((self._name, (at,)))
            raise _Asked(f"{self._name} is open")
        return found

    def __contains__(self, item: object) -> bool:
        if item in [known for known in self._items if known is not ANY]:
            return True
        return ANY in self._items and bool(self[self._items.index(ANY)])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, tuple | _OpenItems):
            return NotImplemented
        theirs = other._items if isinstance(other, _OpenItems) else other
        if len(theirs) != len(self._items):
            return False
        doubt: _Asked | None = None
        for at in range(len(theirs)):
            try:
                if self[at] != other[at]:
                    return False
            except _Asked as asked:
                doubt = doubt or asked
        if doubt is not None:
            raise doubt
        return True

    def __hash__(self) -> int:
        return hash(tuple(self))


def asking(value: Value) -> bool:
    """Whether a computed value contains an open sequence."""
    match value:
        case SequenceValue(items=items):
            return isinstance(items, _OpenItems) or any(map(asking, items))
        case Data(arguments=items) | tuple(items):
            return any(map(asking, items))
        case _:  # a value without parts
            return False


# -- equations ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Forcing:
    """An equation ``when -> out.name == value`` or, with arguments, ``when -> out.name(arguments) == value``."""

    name: str
    arguments: tuple[Evaluator, ...] | None
    when: tuple[Evaluator, ...]
    value: Evaluator
    lazy: Lazy

    def forced(
        self, found: Mapping[str, Value], point: Point | None, wanted: list[tuple[str, Point]]
    ) -> tuple[Value, ...] | None:
        """The only possible value of this port (at this point), if this equation gives one. Open points that it needs
        are added to `wanted`."""
        if (point is None) is not (self.arguments is None):
            return None
        values, asked = opened(found, self.lazy)
        try:
            if self.arguments is not None and tuple(a(values) for a in self.arguments) != point:
                return None
            if not all(when(values) for when in self.when):
                return None
            value = self.value(values)
        except NotEvaluable:
            wanted += asked
            return None
        # An open sequence is not copied: later decisions about the copy would not apply to it.
        return None if asking(value) else (value,)


def forcings(guarantees: Sequence[Clause]) -> tuple[Forcing, ...]:
    """The equations among the guarantees that give an output, or a function's value at a point."""
    found: list[Forcing] = []
    for clause in guarantees:
        stack: list[tuple[Term, tuple[Term, ...]]] = [(clause.formula, ())]
        while stack:
            term, when = stack.pop()
            match term:
                case And(items=items):
                    stack += [(item, when) for item in reversed(items)]
                case Implies(left=left, right=right):
                    stack.append((right, (*when, left)))
                case Compare(operator="==", left=left, right=right):
                    for head, value in ((left, right), (right, left)):
                        forcing = _forcing(head, value, when)
                        if forcing is not None:
                            found.append(forcing)
    return tuple(found)


def _forcing(head: Term, value: Term, when: tuple[Term, ...]) -> Forcing | None:
    port, arguments = (head.function, head.arguments) if isinstance(head, Apply) else (head, None)
    if not isinstance(port, Variable) or port.role is not Role.OUTPUT:
        return None
    if arguments is None and isinstance(port.sort, FunctionSort):
        return None
    parts = (*(arguments or ()), *when, value)
    if port in {v for part in ((value, *when) if arguments is None else parts) for v in free_variables(part)}:
        return None
    try:
        return Forcing(
            port.qualified,
            None if arguments is None else tuple(map(compile_term, arguments)),
            tuple(map(compile_term, when)),
            compile_term(value),
            tuple(dict(entry for part in parts for entry in lazy_names(part)).items()),
        )
    except NotEvaluable:
        return None


# -- the search --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Choices:
    """The possible values of an output. `values`: for a plain one the values tried, None if unknown; for a function or
    a sequence the values that it may have at a point. `why` says what would help if they are unknown."""

    values: tuple[Value, ...] | None
    why: str = ""
    shells: tuple[Value, ...] | None = None
    """The values tried first for an open output: the open function; open sequences of every length tried."""

    short: str = ""
    """In what way `shells` are incomplete."""

    restricted: str = ""
    """In what way `values` are incomplete, for an output with `shells`."""

    natural: bool = False
    """Whether the output, or its value at a point, is a natural number."""

    def fits(self, value: Value) -> bool:
        """Whether a value that an equation gives is of the output's sort, in the scenario or not."""
        return not (self.natural and isinstance(value, int) and value < 0)

    def begin(self) -> tuple[Value, ...] | None:
        return self.shells if self.shells is not None else self.values


class Unknown(Exception):  # noqa: N818 - it names a state
    """An output has unknown values and no equation gives one."""


@dataclass(slots=True)
class Narrowing:
    """The search for the outputs of one node."""

    choices: Mapping[str, Choices]
    """The possible values, by ``out.port``."""
    guarantees: tuple[tuple[frozenset[str], Holds], ...]
    """Each with the outputs that it mentions. They raise `Undecided`."""
    forcings: tuple[Forcing, ...]
    incomplete: set[str] = field(default_factory=set)
    """Why a search that ended is still not exhaustive."""

    most: int = PARTIAL_ANSWERS

    def answers(self, inputs: Mapping[str, Value], limit: int, *, free: bool = False) -> tuple[list[Values], bool]:
        """Every output that satisfies the guarantees (with `free`, every output at all), open at points that do not
        matter; and whether these are all. Raises Undecided if an open input has to be decided first, and Unknown."""
        pending = () if free else self.guarantees
        stack: list[tuple[Values, tuple[tuple[frozenset[str], Holds], ...]]] = [({}, pending)]
        found: list[Values] = []
        tried = 0
        while stack:
            outputs, pending = stack.pop()
            tried += 1
            spend(SEARCH_STEPS)
            if tried > self.most or len(found) > limit:
                self.most = min(self.most, PARTIAL_ANSWERS_AGAIN)
                return found[:limit], False
            judged = self._judge({**inputs, **outputs}, outputs, pending)
            if judged is None:
                continue
            pending, wanted = judged
            missing = [name for name in self.choices if name not in outputs]
            following = self._next(missing, {**inputs, **outputs}, free, wanted) if missing else None
            if following is not None:
                name, values = following
                stack += [({**outputs, name: value}, pending) for value in reversed(values)]
            elif wanted:
                own = next(((name, point) for name, point in wanted if name in outputs), None)
                if own is None:
                    raise Undecided(wanted)
                name, point = own
                possible = self._possible(name, point, {**inputs, **outputs}, free)
                further = [decided(outputs[name], point, value) for value in reversed(possible)]
                stack += [({**outputs, name: value}, pending) for value in further]
            else:
                found.append(outputs)
        return found, True

    def _judge(
        self, valuation: Values, outputs: Values, pending: tuple[tuple[frozenset[str], Holds], ...]
    ) -> tuple[tuple[tuple[frozenset[str], Holds], ...], list[tuple[str, Point]]] | None:
        """The guarantees that are not judged yet, with the points that they need; None if one is broken."""
        left: list[tuple[frozenset[str], Holds]] = []
        wanted: list[tuple[str, Point]] = []
        for guarantee in pending:
            mentioned, holds = guarantee
            if not mentioned <= outputs.keys():
                left.append(guarantee)
                continue
            try:
                if not holds(valuation):
                    return None
            except Undecided as undecided:
                left.append(guarantee)
                wanted += undecided.wanted
        return tuple(left), wanted

    def _next(
        self, missing: Sequence[str], valuation: Values, free: bool, wanted: list[tuple[str, Point]]
    ) -> tuple[str, tuple[Value, ...]] | None:
        """The output to choose next, and its possible values: one that an equation gives, otherwise the one with the
        fewest values. None if a point has to be decided first: it is added to `wanted`. Raises Unknown."""
        best: tuple[str, tuple[Value, ...]] | None = None
        for name in missing:
            begin = self.choices[name].begin()
            forced = None if free else self._forced(name, None, valuation, wanted)
            if forced is not None:
                return name, tuple(filter(self.choices[name].fits, forced))
            if begin is not None and (best is None or len(begin) < len(best[1])):
                best = name, begin
        if best is not None:
            if self.choices[best[0]].short:
                self.incomplete.add(self.choices[best[0]].short)
            return best
        if wanted:
            return None
        raise Unknown(self.choices[missing[0]].why)

    def _possible(self, name: str, point: Point, valuation: Values, free: bool) -> tuple[Value, ...]:
        values = self.choices[name].values
        wanted: list[tuple[str, Point]] = []
        forced = None if free else self._forced(name, point, valuation, wanted)
        if forced is not None:
            return tuple(filter(self.choices[name].fits, forced))
        if values is None and (foreign := [(n, p) for n, p in wanted if n not in self.choices]):
            raise Undecided(foreign)
        if values is None:
            raise Unknown(self.choices[name].why)
        return values

    def _forced(
        self, name: str, point: Point | None, valuation: Values, wanted: list[tuple[str, Point]]
    ) -> tuple[Value, ...] | None:
        for forcing in self.forcings:
            if forcing.name == name:
                found = forcing.forced(valuation, point, wanted)
                if found is not None:
                    return found
        return None

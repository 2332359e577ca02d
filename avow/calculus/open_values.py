"""Values of which not everything is decided: functions and sequences that say where they are looked at.

An open function has a table of what is decided, and `ANY` everywhere else. A formula that is evaluated over one stops
where it has to know more, and says what (`Undecided`); where another part settles it, it does not stop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

from avow.base.tuning.bounds import POINTS_OF_ARGUMENTS
from avow.evaluation.compiler import combinations
from avow.evaluation.evaluate import Domains, NotEvaluable
from avow.formulas.formula import free_variables
from avow.formulas.values import Data, FunctionValue, Opaque, SequenceValue, Value
from avow.language.sorts import FunctionSort, SequenceSort
from avow.language.terms import Term

Values = dict[str, Value]
Point = tuple[Value, ...]
Holds = Callable[[Mapping[str, Value]], bool]


class _Any(Opaque):
    __slots__ = ()

    def __str__(self) -> str:
        return "any"


ANY = _Any("any", -1)
"""Stands where nothing is decided yet: a function's default, or an element of a sequence."""


class Undecided(Exception):  # noqa: N818 - it names a state
    """A clause cannot be judged before these points are decided: (variable, arguments), in the order met."""

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
        case _:  # other values are known as a whole
            return False


Lazy = tuple[tuple[str, tuple[Point, ...] | None], ...]
"""Variables whose values may be open; of a function, all points that there are, if they are finitely many."""


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
    """The open value with all its open places decided alike."""
    match value:
        case FunctionValue(table=table):
            return FunctionValue(table, result)
        case SequenceValue(items=items):
            return SequenceValue(tuple(result if item is ANY else item for item in items))
    raise AssertionError("only functions and sequences are open")


def _order(entry: tuple[Point, Value]) -> tuple[object, ...]:
    return tuple((0, a, "") if isinstance(a, int | Fraction) else (1, 0, str(a)) for a in entry[0])


def opened(found: Mapping[str, Value], names: Lazy) -> tuple[Mapping[str, Value], list[tuple[str, Point]]]:
    """The valuation with its open values ready to be asked, and where the questions to them will be noted."""
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
    """Evaluation met an open point. Where another part decides the whole, it does no harm."""


class _OpenTable(Mapping[Point, Value]):
    """A table that says which point it was asked for. Asked for all, it asks for one after the other, if there is an
    end to them."""

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

    def items(self) -> Any:
        return self._all().items()

    def keys(self) -> Any:
        return self._all().keys()

    def values(self) -> Any:
        return self._all().values()

    def __eq__(self, other: object) -> bool:
        return self._all() == other

    __hash__ = None  # type: ignore[assignment]


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
    """Whether a value that was computed holds on to an open sequence."""
    match value:
        case SequenceValue(items=items):
            return isinstance(items, _OpenItems) or any(map(asking, items))
        case Data(arguments=items) | tuple(items):
            return any(map(asking, items))
        case _:  # a value without parts
            return False

"""Sorts: the types of many-sorted first-order logic that RCL's type declarations denote.

A declared name denotes a sort; sets of names become `EnumSort`, sets of constructors `DataSort`, and ``{}`` an
`OpaqueSort`: an unspecified sort, never an empty one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from itertools import islice
from typing import assert_never

from avow.base.records import dataclass


@dataclass(frozen=True, slots=True)
class BoolSort:
    """BOOL."""


@dataclass(frozen=True, slots=True)
class RealSort:
    """REAL: the reals, exact."""


@dataclass(frozen=True, slots=True)
class IntegerSort:
    """INTEGER: the integers."""


@dataclass(frozen=True, slots=True)
class NaturalSort:
    """NATURAL: the integers that are at least 0; a subset of INTEGER."""


@dataclass(frozen=True, slots=True)
class StringSort:
    """STRING."""


@dataclass(frozen=True, slots=True)
class EnumSort:
    """Exactly the listed elements, all different."""

    name: str
    members: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Constructor:
    """One way to build a value of a `DataSort`; injective, and disjoint from the others."""

    name: str
    parameters: tuple[Sort, ...]


@dataclass(frozen=True, slots=True)
class DataSort:
    """A free algebraic data type: ``{ move(REAL, REAL), inspect(NATURAL) }``."""

    name: str
    constructors: tuple[Constructor, ...]

    def constructor(self, name: str) -> Constructor:
        return next(c for c in self.constructors if c.name == name)


@dataclass(frozen=True, slots=True)
class OpaqueSort:
    """An unspecified, non-empty sort (``{}``)."""

    name: str


@dataclass(frozen=True, slots=True)
class FunctionSort:
    """A total function ``A x B --> C``."""

    parameters: tuple[Sort, ...]
    result: Sort


@dataclass(frozen=True, slots=True)
class TupleSort:
    """``(REAL, REAL)``, or with names for its items a record, ``[x : REAL, y : REAL]``."""

    items: tuple[Sort, ...]
    labels: tuple[str, ...] = ()
    name: str = field(default="", compare=False)
    """The name under which it is declared: for people."""


@dataclass(frozen=True, slots=True)
class SequenceSort:
    """A finite sequence ``<T>``."""

    item: Sort


@dataclass(frozen=True, slots=True)
class SetSort:
    """The sort of a finite set literal; it occurs only to the right of ``in``."""

    item: Sort


Sort = (
    BoolSort
    | RealSort
    | IntegerSort
    | NaturalSort
    | StringSort
    | EnumSort
    | DataSort
    | OpaqueSort
    | FunctionSort
    | TupleSort
    | SequenceSort
    | SetSort
)

NotScalar = StringSort | DataSort | OpaqueSort | FunctionSort | TupleSort | SequenceSort | SetSort
"""Sorts whose values are not a single truth value, number or element."""

BOOL = BoolSort()
REAL = RealSort()
INTEGER = IntegerSort()
NATURAL = NaturalSort()
STRING = StringSort()
BUILTINS: Mapping[str, Sort] = {"REAL": REAL, "INTEGER": INTEGER, "NATURAL": NATURAL, "BOOL": BOOL, "STRING": STRING}
"""The built-in sorts by name."""


def components(*sorts: Sort) -> Iterator[Sort]:
    """The given sorts and their component sorts, each once."""
    stack, seen = list(sorts), set[Sort]()
    while stack:
        sort = stack.pop()
        if sort in seen:
            continue
        seen.add(sort)
        yield sort
        stack.extend(parts(sort))


def rebuilt(sort: Sort, made_of: Iterable[Sort]) -> Sort:
    """The sort with its `parts` replaced."""
    given = iter(made_of)
    match sort:
        case DataSort(name=name, constructors=constructors):
            made = (Constructor(c.name, tuple(islice(given, len(c.parameters)))) for c in constructors)
            return DataSort(name, tuple(made))
        case FunctionSort(parameters=parameters):
            return FunctionSort(tuple(islice(given, len(parameters))), next(given))
        case TupleSort(labels=labels):
            return TupleSort(tuple(given), labels)
        case SequenceSort() | SetSort():
            return type(sort)(next(given))
        case BoolSort() | RealSort() | IntegerSort() | NaturalSort() | StringSort() | EnumSort() | OpaqueSort():
            return sort
        case _:
            assert_never(sort)


def parts(sort: Sort) -> tuple[Sort, ...]:
    """The direct component sorts of a sort."""
    match sort:
        case DataSort(constructors=constructors):
            return tuple(p for c in constructors for p in c.parameters)
        case FunctionSort(parameters=parameters, result=result):
            return (*parameters, result)
        case TupleSort(items=items):
            return items
        case SequenceSort(item=item) | SetSort(item=item):
            return (item,)
        case BoolSort() | RealSort() | IntegerSort() | NaturalSort() | StringSort() | EnumSort() | OpaqueSort():
            return ()
        case _:
            assert_never(sort)

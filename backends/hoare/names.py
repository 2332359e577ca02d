"""Which sort each name of a program has: by declaration, by the plan's table, by the ports, or by what is assigned.

Nothing here complains: a name without a sort stays without, and the checker says so where it is used.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import assert_never

from avow.base.records import dataclass
from avow.language import sorts as s
from avow.language.contract import Contract, Node
from avow.language.terms import EnumValue, Term

from . import syntax

_NUMBERS: tuple[s.Sort, ...] = (s.NATURAL, s.INTEGER, s.REAL)
_ARITHMETIC = frozenset("+-*/")
UNKNOWN = s.OpaqueSort("?")
"""Of what an empty sequence is: whatever its place says. No contract can declare a type of this name."""


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The contract's own words: types, elements of enumerations, constructors, constants."""

    types: Mapping[str, s.Sort]
    values: Mapping[str, Term]
    constructors: Mapping[str, tuple[s.DataSort, s.Constructor]]


@dataclass(slots=True)
class Names:
    """The sort of every name known so far."""

    vocabulary: Vocabulary
    sorts: dict[str, s.Sort] = field(default_factory=dict)
    inferred: set[str] = field(default_factory=set)
    """Those whose sort was read off assignments, and may still widen."""


def vocabulary(contract: Contract, node: Node) -> Vocabulary:
    types = {**s.BUILTINS, **dict(contract.types)}
    values: dict[str, Term] = dict(contract.constants)
    constructors: dict[str, tuple[s.DataSort, s.Constructor]] = {}
    for sort in s.components(*types.values(), *(port.sort for port in (*node.inputs, *node.outputs))):
        match sort:
            case s.EnumSort(members=members):
                values.update((member, EnumValue(member, sort)) for member in members)
            case s.DataSort(constructors=made):
                constructors.update((c.name, (sort, c)) for c in made)
            case _:  # declares no element
                pass
    return Vocabulary(types, values, constructors)


def join(one: s.Sort | None, other: s.Sort | None) -> s.Sort | None:
    """The narrowest sort that holds both: numbers widen; anything else stays what it was first."""
    if one is None or other is None:
        return one or other
    if one == UNKNOWN:
        return other
    match one, other:
        case s.TupleSort(items=ones), s.TupleSort(items=others) if len(ones) == len(others):
            return s.TupleSort(tuple(join(a, b) or a for a, b in zip(ones, others, strict=True)))
        case s.SequenceSort(item=a), s.SequenceSort(item=b):
            return s.SequenceSort(join(a, b) or a)
    if one in _NUMBERS and other in _NUMBERS:
        return _NUMBERS[max(_NUMBERS.index(one), _NUMBERS.index(other))]
    return one


def _estimate(expression: syntax.Expression, names: Names, local: Mapping[str, s.Sort]) -> s.Sort | None:
    """The sort that an expression seems to have, if its names' sorts are known."""
    match expression:
        case syntax.Number(whole=whole):
            return s.NATURAL if whole else s.REAL
        case syntax.Truth() | syntax.Member() | syntax.Inside() | syntax.Chain() | syntax.Quantification():
            return s.BOOL
        case syntax.Tuple(items=items):
            sorts = [_estimate(item, names, local) for item in items]
            return s.TupleSort(tuple(part for part in sorts if part is not None)) if None not in sorts else None
        case syntax.Sequence(items=items):
            item: s.Sort | None = UNKNOWN
            for each in items:
                item = join(item, _estimate(each, names, local))
            return s.SequenceSort(item or UNKNOWN)
        case syntax.Call(function=syntax.Name(name="length", prefix=None)) if "length" not in names.sorts:
            return s.NATURAL
        case syntax.Text():
            return s.STRING
        case syntax.Name(name=name, prefix=None):
            if name in local:
                return local[name]
            if name in names.sorts:
                return names.sorts[name]
            if name in names.vocabulary.constructors:
                return names.vocabulary.constructors[name][0]
            value = names.vocabulary.values.get(name)
            return value.sort if value is not None else None
        case syntax.Name():
            return None
        case syntax.Call(function=function):
            if function.prefix is None and function.name in names.vocabulary.constructors:
                return names.vocabulary.constructors[function.name][0]
            sort = names.sorts.get(function.name) if function.prefix is None else None
            if isinstance(sort, s.SequenceSort):
                return sort.item
            return sort.result if isinstance(sort, s.FunctionSort) else None
        case syntax.Unary(operator="-", operand=operand):
            return join(s.INTEGER, _estimate(operand, names, local))
        case syntax.Binary(operator="/"):
            return s.REAL
        case syntax.Binary(operator=operator, left=left, right=right) if operator in _ARITHMETIC:
            sort = join(_estimate(left, names, local), _estimate(right, names, local))
            return join(s.INTEGER, sort) if operator == "-" else sort
        case syntax.Unary() | syntax.Binary():  # a comparison or a connective
            return s.BOOL
        case _:
            assert_never(expression)


def expect(expression: syntax.Expression, sort: s.Sort, names: Names) -> None:
    """Give unknown names the sort that the place asks for: `f(i)` for a REAL makes f a function to REAL."""
    match expression:
        case syntax.Name(name=name, prefix=None) if name not in names.vocabulary.values:
            names.sorts.setdefault(name, sort)
        case syntax.Tuple(items=items) if isinstance(sort, s.TupleSort):
            for item, part in zip(items, sort.items, strict=False):
                expect(item, part, names)
        case syntax.Sequence(items=items) if isinstance(sort, s.SequenceSort):
            for item in items:
                expect(item, sort.item, names)
        case syntax.Call(function=syntax.Name(name=name, prefix=None), arguments=arguments):
            if name in names.vocabulary.constructors:
                parameters = names.vocabulary.constructors[name][1].parameters
                for argument, parameter in zip(arguments, parameters, strict=False):
                    expect(argument, parameter, names)
            elif name not in names.sorts and name != "length":
                known = [_estimate(argument, names, {}) for argument in arguments]
                if all(k is not None for k in known):
                    names.sorts[name] = s.FunctionSort(tuple(k for k in known if k is not None), sort)
        case _:  # says nothing of a name's sort
            pass


def spread(body: tuple[syntax.Statement, ...], names: Names) -> None:
    """Sorts of assigned variables, from what is assigned to them, until nothing more is learnt."""
    fixed = frozenset(names.sorts) - names.inferred
    learnt = True
    while learnt:
        learnt = False
        for statement, local in assignments(body, names):
            if statement.arguments or statement.target.name in fixed or statement.target.name in local:
                continue
            old = names.sorts.get(statement.target.name)
            new = join(old, _estimate(statement.value, names, local))
            if new is not None and new != old:
                names.sorts[statement.target.name] = new
                names.inferred.add(statement.target.name)
                learnt = True


def assignments(
    body: tuple[syntax.Statement, ...], names: Names
) -> Iterator[tuple[syntax.Assign, Mapping[str, s.Sort]]]:
    """Every assignment, with the sorts of the MATCH variables around it."""
    stack: list[tuple[syntax.Statement, Mapping[str, s.Sort]]] = [(statement, {}) for statement in reversed(body)]
    while stack:
        statement, local = stack.pop()
        match statement:
            case syntax.Assign():
                yield statement, local
            case syntax.If(then=then, otherwise=otherwise):
                stack.extend((statement, local) for statement in reversed((*then, *otherwise)))
            case syntax.Match(constructor=constructor, variables=variables, then=then, otherwise=otherwise):
                inner = dict(local)
                if constructor.name in names.vocabulary.constructors:
                    parameters = names.vocabulary.constructors[constructor.name][1].parameters
                    inner.update((v.name, p) for v, p in zip(variables, parameters, strict=False))
                stack.extend((statement, local) for statement in reversed(otherwise))
                stack.extend((statement, inner) for statement in reversed(then))
            case syntax.While(body=inside):
                stack.extend((statement, local) for statement in reversed(inside))
            case syntax.Skip():  # holds no statement
                pass
            case _:
                assert_never(statement)

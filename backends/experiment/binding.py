"""The conversion of cells to values of a node's ports, and the meaning of predicates in terms of columns.

An entry of `mapping` names a port's column, or its columns: ``[x, y]`` is a tuple, or a relation that holds at that
point and nowhere else; ``{constructor: kind, move: [x, y]}`` is a value of an algebraic type. An entry of `interpret`
replaces a predicate (``out.at(x, y)``), or a whole part of a guarantee, by a formula over columns. The data cannot show
that this is the contract's meaning, so it is an assumption.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from avow.base.diagnostics import Span
from avow.base.plain import exact
from avow.base.records import dataclass
from avow.formulas.formula import free_variables, meaning, substitute
from avow.formulas.traversal import transform
from avow.formulas.values import Data, Element, FunctionValue, Value
from avow.language import sorts as s
from avow.language.contract import Contract, Node
from avow.language.definedness import with_value
from avow.language.load import parse_formula
from avow.language.subterms import ports_of
from avow.language.terms import Apply, Role, Term, Variable

Cells = Mapping[str, str]
WORDS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
_PREDICATE = re.compile(r"\s*(in|out)\.(\w+)\s*\(\s*(\w+(?:\s*,\s*\w+)*)\s*\)\s*")


class Unfit(Exception):  # noqa: N818 - it names what an entry, or a cell, is
    """An entry that cannot give a value of its port, or a cell without one."""


@dataclass(frozen=True, slots=True)
class Binding:
    """`name` is a port's name, or a column's own name; `value` raises Unfit."""

    name: str
    columns: tuple[str, ...]
    value: Callable[[Cells], Value]


def bound(name: str, sort: s.Sort, entry: Any) -> Binding:
    """A port's value by an entry of `mapping`. Raises Unfit."""
    match entry:
        case str() | {"field": str()}:
            column = entry if isinstance(entry, str) else entry["field"]
            words = {} if isinstance(entry, str) else entry.get("values", {})
            _check_words(sort, words)
            return Binding(name, (column,), lambda cells: _cell(cells, column, sort, words))
        case list():
            sorts = _items(sort, len(entry))
            parts = [bound(name, one, column) for one, column in zip(sorts, entry, strict=True)]
            columns = tuple(column for part in parts for column in part.columns)
            if isinstance(sort, s.TupleSort):
                return Binding(name, columns, lambda cells: tuple(part.value(cells) for part in parts))
            return Binding(
                name, columns, lambda cells: FunctionValue({tuple(part.value(cells) for part in parts): True}, False)
            )
        case Mapping() if isinstance(sort, s.DataSort):
            return _constructed(name, sort, entry)
    raise Unfit("an entry is a column, a list of columns, {field, values}, or constructors with their columns")


def _check_words(sort: s.Sort, words: Mapping[str, str]) -> None:
    """Raises Unfit if a word stands for no value of the type, or is itself a value of it and stands for another. Any
    text is a value of STRING."""
    for word, name in words.items() if sort != s.STRING else ():
        if (meant := _valued(name, sort)) is None:
            names = ", ".join(_names(sort))
            raise Unfit(f"'{name}' is {f'none of {names}' if names else 'no value of this type'}")
        if (own := _valued(word, sort)) is not None and own != meant:
            raise Unfit(f"'{word}' is itself a value of this type, and cannot stand for '{name}'")


def _names(sort: s.Sort) -> tuple[str, ...]:
    match sort:
        case s.EnumSort(members=names):
            return names
        case s.DataSort(constructors=constructors):
            return tuple(each.name for each in constructors)
    return ()


def _items(sort: s.Sort, count: int) -> Sequence[s.Sort]:
    match sort:
        case s.TupleSort(items=items) | s.FunctionSort(parameters=items, result=s.BoolSort()) if len(items) == count:
            return items
    raise Unfit(f"{count} columns are no value of this type")


def _constructed(name: str, sort: s.DataSort, entry: Mapping[str, Any]) -> Binding:
    column = entry.get("constructor")
    known = {each.name: each for each in sort.constructors}
    made: dict[str, list[Binding]] = {}
    for word, columns in entry.items():
        if word == "constructor":
            continue
        if word not in known or not isinstance(columns, list) or len(columns) != len(known[word].parameters):
            raise Unfit(f"'{word}' is no constructor with so many columns; there are {', '.join(known)}")
        made[word] = [bound(name, item, c) for item, c in zip(known[word].parameters, columns, strict=True)]
    if not made or (column is None and len(made) > 1):
        raise Unfit("'constructor' names the column that says which of several constructors a row has")

    def value(cells: Cells) -> Value:
        word = cells[column] if column is not None else next(iter(made))
        if word not in known or (word not in made and known[word].parameters):
            raise Unfit(f"column '{column}': '{word}' is none of {', '.join(made)}")
        return Data(word, tuple(part.value(cells) for part in made.get(word, ())))

    used = tuple(c for parts in made.values() for part in parts for c in part.columns)
    return Binding(name, (*((column,) if column is not None else ()), *used), value)


def _cell(cells: Cells, column: str, sort: s.Sort, words: Mapping[str, str]) -> Value:
    text = words.get(cells[column], cells[column])
    if (value := _valued(text, sort)) is not None:
        return value
    kind = {s.BOOL: "neither true nor false", s.REAL: "not a number"}.get(sort, "no value of its port's type")
    raise Unfit(f"column '{column}': {repr(cells[column]) if text else 'an empty cell'} is {kind}")


def _valued(text: str, sort: s.Sort) -> Value | None:
    """The value of a word; None if it is not a value of the type."""
    match sort:
        case s.BoolSort():
            return WORDS.get(text.casefold())
        case s.RealSort() | s.IntegerSort() | s.NaturalSort():
            number = _number(text)
            if isinstance(sort, s.RealSort) or number is None:
                return number
            if number.denominator == 1 and (isinstance(sort, s.IntegerSort) or number >= 0):
                return int(number)
        case s.EnumSort(members=members) if text in members:
            return Element(text)
        case s.DataSort() if any(each.name == text and not each.parameters for each in sort.constructors):
            return Data(text)
        case s.StringSort():
            return text
    return None


def _number(text: str) -> Fraction | None:
    try:
        return exact(text)
    except ValueError:
        return None


# -- interpretations --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Interpretation:
    """`pattern` (a part of a guarantee; or None: the predicate `function` of the variables `over`) means `formula`."""

    pattern_text: str
    text: str
    pattern: Term | None
    function: str
    over: tuple[Variable, ...]
    formula: Term
    bindings: tuple[Binding, ...]
    """The columns that the formula reads."""
    output: bool
    """Whether it is about an output."""


def interpretation(
    pattern: str, text: str, node: Node, contract: Contract, columns: Mapping[str, s.Sort], span: Span | None
) -> Interpretation:
    """An entry of `interpret`; `columns` are those that a formula may name, with their types. Raises Rejected if a text
    is not a formula, and Unfit."""
    over, whole, function = list[Variable](), None, ""
    if match := _PREDICATE.fullmatch(pattern):
        function = f"{match[1]}.{match[2]}"
        port = next((p for p in (*node.inputs, *node.outputs) if p.variable.qualified == function), None)
        names = re.split(r"\s*,\s*", match[3])
        if port is None or not isinstance(port.sort, s.FunctionSort) or port.sort.result != s.BOOL:
            raise Unfit(f"{function} is no predicate of {node.name}")
        if len(names) != len(port.sort.parameters) or len(set(names)) < len(names):
            raise Unfit(f"{function} takes {len(port.sort.parameters)} different variables")
        if shared := sorted({*names} & columns.keys()):
            raise Unfit(f"'{shared[0]}' is a column too: give the variable another name")
        over = [Variable(Role.BOUND, name, sort) for name, sort in zip(names, port.sort.parameters, strict=True)]
        output = match[1] == "out"
    else:
        whole = parse_formula(pattern, node, contract, span)
        ports = ports_of(whole)
        output = any(port.role is Role.OUTPUT for port in ports)
        if not any(isinstance(port.sort, s.FunctionSort | s.SequenceSort | s.OpaqueSort) for port in ports):
            raise Unfit("each of its ports can have a column: name them under 'mapping'")
    written = {name: sort for name, sort in columns.items() if name in re.findall(r"(?<![.\w])\w+", text)}
    taken = {name for name, _ in contract.constants} | {port.name for port in (*node.inputs, *node.outputs)}
    if both := sorted(taken & written.keys()):
        raise Unfit(f"'{both[0]}' is a column, and a constant or a port of the contract: give the column another name")
    formula = with_value(parse_formula(text, node, contract, span, {**written, **{v.name: v.sort for v in over}}))
    free = {v for v in free_variables(formula) if v.role is Role.BOUND and v not in over}
    if not free:
        raise Unfit("its meaning names no column: it would be the same in every row")
    # with its own name and role, a column cannot be bound by a quantifier of the guarantee
    role = Role.OUTPUT if output else Role.INPUT
    columns_of = {v: Variable(role, f"column {v.name}", v.sort) for v in free}
    return Interpretation(
        pattern,
        f"{' '.join(pattern.split())} means {' '.join(text.split())}",
        whole,
        function,
        tuple(over),
        substitute(formula, columns_of),
        tuple(bound(own.qualified, own.sort, v.name) for v, own in columns_of.items()),
        output,
    )


def interpreted(formula: Term, meanings: Iterable[Interpretation]) -> Term:
    """A formula with the patterns replaced by their meanings: whole parts first, then predicates."""
    known = tuple(meanings)
    parts = {meaning(one.pattern): one.formula for one in known if one.pattern is not None}
    predicates = {one.function: one for one in known if one.pattern is None}

    def part(term: Term) -> Term:
        return parts.get(meaning(term), term) if term.sort == s.BOOL else term

    def predicate(term: Term) -> Term:
        if isinstance(term, Apply) and isinstance(term.function, Variable):
            one = predicates.get(term.function.qualified)
            if one is not None:
                return substitute(one.formula, dict(zip(one.over, term.arguments, strict=True)))
        return term

    formula = transform(formula, part) if parts else formula
    return transform(formula, predicate) if predicates else formula

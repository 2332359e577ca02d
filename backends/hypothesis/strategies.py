"""Hypothesis strategies for the types of a contract, as the text of a generated test."""

from __future__ import annotations

import itertools
import pprint
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import assert_never

from avow.base.plain import decimal
from avow.formulas.finite import cell_value
from avow.language import sorts
from avow.language.bounds import constant
from avow.language.terms import And, Compare, Role, Term, Variable, Widen

from . import tuning
from .thresholds import Thresholds
from .translate import number, safe_name

Rows = tuple[tuple[str, ...], ...]
Column = tuple[sorts.Sort, ...]
"""The sorts of neighbouring columns that belong together: (REAL, REAL) is a position."""


def bounds(assumptions: Iterable[Term]) -> dict[str, tuple[Fraction | None, Fraction | None]]:
    """The least and the largest value of each numeric input that the assumptions compare with constants."""
    found: dict[str, tuple[Fraction | None, Fraction | None]] = {}
    stack = list(assumptions)
    while stack:
        match stack.pop():
            case And(items=items):
                stack.extend(items)
            case Compare(operator="<" | "<=" | ">" | ">=" as operator, left=left, right=right):
                low, high = (left, right) if operator.startswith("<") else (right, left)
                least, most = constant(low), constant(high)
                if (variable := _input(high)) is not None and least is not None:
                    found[variable] = (least, found.get(variable, (None, None))[1])
                if (variable := _input(low)) is not None and most is not None:
                    found[variable] = (found.get(variable, (None, None))[0], most)
            case _:  # it bounds nothing by itself
                pass
    return found


def _input(term: Term) -> str | None:
    inner = term.term if isinstance(term, Widen) else term
    return inner.name if isinstance(inner, Variable) and inner.role is Role.INPUT else None


@dataclass(slots=True)
class Strategies:
    """`doubles`: a REAL is a float; `tables`: the scenario's rows of the ports that it interprets. `definitions` is
    filled with the text that the strategies need, in order."""

    thresholds: Thresholds
    doubles: bool
    lists: bool
    """Sequences come as lists, not as tuples."""
    meeting: bool
    """Numbers are often arguments or values of a function that is an input."""
    tables: Mapping[str, tuple[sorts.FunctionSort, Rows]] = field(default_factory=dict)
    definitions: dict[str, str] = field(default_factory=dict)
    _known: dict[Column, list[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, (sort, _) in self.tables.items():
            self._table(name, sort)

    def port(self, name: str, sort: sorts.Sort, limits: tuple[Fraction | None, Fraction | None] = (None, None)) -> str:
        """The strategy of an input."""
        if name in self.tables:
            return f"st.just({_constant(name)})"
        if isinstance(sort, sorts.RealSort | sorts.IntegerSort | sorts.NaturalSort):
            drawn = f"{self._few(sort)} | {self._number(sort, limits)}" if self.meeting else self._number(sort, limits)
            if (sort,) in self._known:
                return f"either(st.sampled_from({self._column((sort,))}), {drawn})"
            return drawn
        return self._of(sort, few=False)

    # -- by sort -----------------------------------------------------------------------------------------

    def _of(self, sort: sorts.Sort, *, few: bool) -> str:
        """`few`: a value that should sometimes equal another."""
        match sort:
            case sorts.BoolSort():
                return "st.booleans()"
            case sorts.RealSort() | sorts.IntegerSort() | sorts.NaturalSort():
                return self._few(sort) if few else self._number(sort, (None, None))
            case sorts.StringSort():
                for name, texts in (("TEXTS", self.thresholds.texts), ("WORDS", self.thresholds.words)):
                    shown = pprint.pformat(list(texts), width=110, compact=True)
                    self.definitions.setdefault(name, f"{name} = {shown}")
                self._list("LENGTHS", self.thresholds.lengths)
                return "texts()"
            case sorts.EnumSort(members=members):
                return f"st.sampled_from({list(members)!r})"
            case sorts.OpaqueSort(name=name):
                return f"st.sampled_from({[f'{name}#{k}' for k in range(tuning.OPAQUE_VALUES)]!r})"
            case sorts.DataSort(constructors=constructors):
                return " | ".join(self._row(c.parameters, c.name) for c in constructors)
            case sorts.TupleSort(items=items):
                return f"st.tuples({', '.join(self._of(item, few=few) for item in items)})"
            case sorts.SequenceSort(item=item):
                self._list("LENGTHS", self.thresholds.lengths)
                return f"sequences({self._of(item, few=few)}{', list' * self.lists})"
            case sorts.FunctionSort(parameters=parameters, result=sorts.BoolSort()):
                return f"st.lists({self._point(parameters)}, max_size=4).map(relation)"
            case sorts.FunctionSort(parameters=parameters, result=result):
                points, values = self._row(parameters), self._of(result, few=True)
                return f"st.builds(Table, st.dictionaries({points}, {values}, max_size=4), {values})"
            case sorts.SetSort():
                return "st.nothing()"
            case _:
                assert_never(sort)

    def _point(self, parameters: Column) -> str:
        return self._row(parameters) if len(parameters) != 1 else self._few_or_known(parameters[0])

    def _few_or_known(self, sort: sorts.Sort) -> str:
        drawn = self._of(sort, few=True)
        if isinstance(sort, sorts.RealSort | sorts.IntegerSort | sorts.NaturalSort):
            drawn = f"either({drawn}, {self._of(sort, few=False)})"
        return f"({drawn} | st.sampled_from({self._column((sort,))}))" if (sort,) in self._known else drawn

    def _row(self, parameters: Column, constructor: str = "") -> str:
        """A tuple, with the name of a constructor before it; sometimes from a row of the scenario."""
        before = [f"st.just({constructor!r})"] if constructor else []
        if len(parameters) == 1:
            return f"st.tuples({', '.join([*before, self._few_or_known(parameters[0])])})"
        drawn = f"st.tuples({', '.join([*before, *(self._of(p, few=True) for p in parameters)])})"
        if parameters not in self._known:
            return drawn
        known = self._column(parameters)
        rows = f"[({constructor!r}, *row) for row in {known}]" if constructor else known
        return f"({drawn} | st.sampled_from({rows}))"

    def _number(self, sort: sorts.Sort, limits: tuple[Fraction | None, Fraction | None]) -> str:
        low, high = limits
        self._list("CONSTANTS", self.thresholds.constants, numbers=True)
        self._list("NUMBERS", self.thresholds.numbers, numbers=True)
        if isinstance(sort, sorts.RealSort):
            name, texts = "floats" if self.doubles else "reals", [self._limit(end) for end in (low, high)]
        else:
            least = max(Fraction(0), low or Fraction(0)) if isinstance(sort, sorts.NaturalSort) else low
            name = "wholes"
            ends = (None if least is None else -(-least // 1), None if high is None else high // 1)
            texts = [repr(end) for end in ends]
        while texts and texts[-1] == "None":
            texts.pop()
        return f"{name}({', '.join(texts)})"

    def _limit(self, end: Fraction | None) -> str:
        if end is None or (self.doubles and Fraction(float(end)) != end):
            return "None"
        return repr(float(end)) if self.doubles else number(end)

    def _list(self, name: str, values: Iterable[Fraction | int], *, numbers: bool = False) -> None:
        given = dict.fromkeys(map(_as_double, values)) if numbers and self.doubles else values
        shown = ", ".join(map(_shown, given))
        text = textwrap.fill(shown, 110, initial_indent="    ", subsequent_indent="    ", break_long_words=False)
        made = f"list(map(Fraction, [\n{text},\n]))" if numbers and not self.doubles else f"[\n{text},\n]"
        self.definitions.setdefault(name, f"{name} = {made}")

    def _few(self, sort: sorts.Sort) -> str:
        """A number that should sometimes equal another."""
        few = self.thresholds.few
        if isinstance(sort, sorts.RealSort):
            shown = ", ".join(_shown(_as_double(n) if self.doubles else n) for n in few)
            values = f"[{shown}]" if self.doubles else f"list(map(Fraction, [{shown}]))"
            self.definitions.setdefault("FEW_REALS", f"FEW_REALS = often(st.sampled_from({values}))")
            return "FEW_REALS"
        name = "FEW_NATURALS" if isinstance(sort, sorts.NaturalSort) else "FEW_INTEGERS"
        whole = [int(n) for n in few if n.denominator == 1 and (n >= 0 or isinstance(sort, sorts.IntegerSort))]
        whole += [-1] * isinstance(sort, sorts.IntegerSort)
        self.definitions.setdefault(name, f"{name} = often(st.sampled_from({whole!r}))")
        return name

    # -- the scenario ------------------------------------------------------------------------------------

    def _table(self, name: str, sort: sorts.FunctionSort) -> None:
        read = 'json.loads(Path(__file__).with_name("scenario.json").read_text(encoding="utf-8"))'
        self.definitions.setdefault("TABLES", f"TABLES = {read}  # of the plan's scenario")
        relation = isinstance(sort.result, sorts.BoolSort)
        columns = sort.parameters if relation else (*sort.parameters, sort.result)
        letters = [f"c{k}" for k in range(len(columns))]
        cells = [self._cell(letter, column) for letter, column in zip(letters, columns, strict=True)]
        unpacked = f"for {', '.join(letters)}{',' if len(letters) == 1 else ''} in TABLES[{name!r}]"
        if relation:
            made = f"relation([({', '.join(cells)}{',' if len(cells) == 1 else ''}) {unpacked}])"
        else:
            point = f"({', '.join(cells[:-1])}{',' if len(cells) == 2 else ''})"
            made = f"table_of({{{point}: {cells[-1]} {unpacked}}})"
        self.definitions[_constant(name)] = f"{_constant(name)} = {made}"
        at = 0
        for _, group in itertools.groupby(sort.parameters):
            column = tuple(group)
            part = f"point[{at}]" if len(column) == 1 else f"point[{at}:{at + len(column)}]"
            self._known.setdefault(column, []).append(f"{{{part} for point in {_constant(name)}.table}}")
            at += len(column)

    def _column(self, column: Column) -> str:
        """The constant with the scenario's parts of rows of these sorts."""
        name = f"KNOWN_{1 + [*self._known].index(column)}"
        self.definitions.setdefault(name, f"{name} = sorted({' | '.join(dict.fromkeys(self._known[column]))})")
        return name

    def _cell(self, letter: str, sort: sorts.Sort) -> str:
        match sort:
            case sorts.RealSort():
                return f"float(Fraction({letter}))" if self.doubles else f"Fraction({letter})"
            case sorts.IntegerSort() | sorts.NaturalSort():
                return f"int({letter})"
            case sorts.BoolSort():
                return f'{letter} == "TRUE"'
            case _:  # a text
                return letter


def readable(rows: Rows, columns: Sequence[sorts.Sort]) -> Rows:
    """The rows of a scenario's table that have a value for each column."""
    stripped = (tuple(cell.strip() for cell in row) for row in rows)
    return tuple(row for row in stripped if len(row) == len(columns) and all(map(_is_cell, row, columns)))


def _is_cell(text: str, sort: sorts.Sort) -> bool:
    try:
        cell_value(text, sort)
    except ValueError:
        return False
    return True


def _shown(value: Fraction | float) -> str:
    """The shortest argument of Python's `Fraction` for the number."""
    if not isinstance(value, Fraction) or value.denominator == 1:
        return str(value) if isinstance(value, Fraction) else repr(value)
    text = decimal(value)
    double = repr(_as_double(value))
    if Fraction(_as_double(value)) == value and (text is None or len(double) < len(text)):
        return double
    return repr(text or str(value))


def _constant(port: str) -> str:
    return f"THE_{safe_name(port).upper()}"


def _as_double(number: Fraction | int) -> float:
    try:
        return float(number)
    except OverflowError:
        return 0.0

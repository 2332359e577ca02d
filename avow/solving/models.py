"""Z3's models as values of the contract's sorts.

Z3 gives a function as a list of points and an expression for the rest; here it becomes a table and a default. If that
is not possible exactly, the value is an approximation: a model is replayed before it is shown.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

from avow.base.records import dataclass
from avow.base.tuning.bounds import TABLE_POINTS
from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value
from avow.language import sorts as s
from avow.language.terms import Variable
from avow.solving.translation import Expr, Translator, Unsupported
from avow.solving.z3_module import z3

_ESCAPE = re.compile(r"\\u\{([0-9a-fA-F]+)\}|\\u([0-9a-fA-F]{4})|\\x([0-9a-fA-F]{2})")


@dataclass(frozen=True, slots=True)
class Model:
    """One model of a question, in its translator's context."""

    translator: Translator
    z3_model: Any

    def value(self, variable: Variable) -> Value:
        """The value of a free variable. Raises Unsupported."""
        if isinstance(variable.sort, s.FunctionSort):
            return self._function(variable, variable.sort)
        return self.read(self.translator.variable(variable), variable.sort)

    def values(self, variables: Iterable[Variable]) -> dict[Variable, Value]:
        """The values of some free variables. Raises Unsupported."""
        return {variable: self.value(variable) for variable in variables}

    def read(self, expr: Expr, sort: s.Sort) -> Value:
        """The value in this model of an expression of a sort. Raises Unsupported."""
        return self._value(self.evaluate(expr), sort)

    def evaluate(self, expr: Expr) -> Expr:
        """The solver's value of an expression in this model."""
        return self.z3_model.eval(expr, model_completion=True)

    def _value(self, expr: Expr, sort: s.Sort) -> Value:
        match sort:
            case s.BoolSort():
                if not (z3.is_true(expr) or z3.is_false(expr)):
                    raise Unsupported(f"a truth value that the solver left open: {expr}")
                return bool(z3.is_true(expr))
            case s.IntegerSort():
                return _integer(expr)
            case s.NaturalSort():
                return max(0, _integer(expr))
            case s.RealSort():
                return _fraction(expr)
            case s.StringSort():
                return _string(expr)
            case s.EnumSort(members=members):
                index = self._constructor(expr, sort, len(members))
                return Element(members[index])
            case s.DataSort(constructors=constructors):
                index = self._constructor(expr, sort, len(constructors))
                chosen = constructors[index]
                fields = (self._value(expr.arg(k), p) for k, p in enumerate(chosen.parameters))
                return Data(chosen.name, tuple(fields))
            case s.TupleSort(items=items):
                self._constructor(expr, sort, 1)
                return tuple(self._value(expr.arg(k), item) for k, item in enumerate(items))
            case s.SequenceSort(item=item):
                return SequenceValue(tuple(self._value(part, item) for part in _units(expr)))
            case s.OpaqueSort(name=name):
                universe = [u.sexpr() for u in self.z3_model.get_universe(self.translator.sort(sort)) or ()]
                text = expr.sexpr()
                return Opaque(name, universe.index(text) if text in universe else 0)
            case s.FunctionSort() | s.SetSort():
                raise Unsupported("a function or set as part of another value")

    def _constructor(self, expr: Expr, sort: s.Sort, count: int) -> int:
        datatype = self.translator.sort(sort)
        for index in range(count):
            if z3.is_app(expr) and expr.decl().eq(datatype.constructor(index)):
                return index
        raise Unsupported(f"a value that the solver left open: {expr}")

    def _function(self, variable: Variable, sort: s.FunctionSort) -> FunctionValue:
        interpretation = self.z3_model[self.translator.function(variable)]
        if not isinstance(interpretation, z3.FuncInterp) or not interpretation.f:
            return FunctionValue({}, default_value(sort.result))  # the model leaves it open: any function will do
        table: dict[tuple[Value, ...], Value] = {}
        for k in range(interpretation.num_entries()):
            entry = interpretation.entry(k)
            point = tuple(self._value(entry.arg_value(j), p) for j, p in enumerate(sort.parameters))
            table[point] = self._value(entry.value(), sort.result)
        rest = interpretation.else_value()
        default = self._otherwise(rest, sort, table)
        return FunctionValue({point: value for point, value in table.items() if value != default}, default)

    def _otherwise(self, rest: Expr, sort: s.FunctionSort, table: dict[tuple[Value, ...], Value]) -> Value:
        """The default. If the rest distinguishes arguments (``x == 1``, ``2 <= x``), its values at the points named
        there are added to the table, and the value of its last branch is used as the default."""
        if rest is None:
            return default_value(sort.result)
        places = _compared(rest, len(sort.parameters))
        if math.prod(map(len, places)) > TABLE_POINTS:
            return default_value(sort.result)
        try:
            for place in itertools.product(*places):
                point = tuple(self.read(a, p) for a, p in zip(place, sort.parameters, strict=True))
                table.setdefault(point, self.read(z3.substitute_vars(rest, *place), sort.result))
            while z3.is_app_of(rest, z3.Z3_OP_ITE):
                rest = rest.arg(2)
            return self.read(rest, sort.result)
        except Unsupported:
            return default_value(sort.result)


def _compared(expr: Expr, count: int) -> list[list[Expr]]:
    """For each of a function's `count` arguments, the constants that an expression compares it with."""
    found: list[dict[int, Expr]] = [{} for _ in range(count)]
    stack, seen = [expr], set()
    while stack:
        part = stack.pop()
        if part.get_id() in seen or not z3.is_app(part):
            continue
        seen.add(part.get_id())
        stack.extend(part.children())
        if part.num_args() == 2 and z3.is_bool(part):
            for one, other in (part.children(), reversed(part.children())):
                if z3.is_var(one) and _is_closed(other):
                    found[z3.get_var_index(one)][other.get_id()] = other
    return [list(values.values()) for values in found]


def _is_closed(expr: Expr) -> bool:
    return bool(z3.is_app(expr)) and all(map(_is_closed, expr.children()))


def default_value(sort: s.Sort) -> Value:
    """The simplest value of a sort. Raises Unsupported."""
    match sort:
        case s.BoolSort():
            return False
        case s.IntegerSort() | s.NaturalSort():
            return 0
        case s.RealSort():
            return Fraction(0)
        case s.StringSort():
            return ""
        case s.EnumSort(members=members):
            return Element(members[0])
        case s.DataSort(constructors=constructors):
            first = constructors[0]
            return Data(first.name, tuple(map(default_value, first.parameters)))
        case s.TupleSort(items=items):
            return tuple(map(default_value, items))
        case s.SequenceSort():
            return SequenceValue(())
        case s.OpaqueSort(name=name):
            return Opaque(name, 0)
        case s.FunctionSort(result=result):
            return FunctionValue({}, default_value(result))
        case s.SetSort():
            raise Unsupported("a set as a value")


def _integer(expr: Expr) -> int:
    if not z3.is_int_value(expr):
        raise Unsupported(f"a number that the solver left open: {expr}")
    return int(expr.as_long())


def _fraction(expr: Expr) -> Fraction:
    if z3.is_algebraic_value(expr):
        expr = expr.approx(12)  # an irrational number: close enough to show, and replayed before it counts
    if not z3.is_rational_value(expr):
        raise Unsupported(f"a number that the solver left open: {expr}")
    return Fraction(expr.numerator_as_long(), expr.denominator_as_long())


def _string(expr: Expr) -> str:
    if not z3.is_string_value(expr):
        raise Unsupported(f"a string that the solver left open: {expr}")
    return _ESCAPE.sub(lambda match: chr(int(next(filter(None, match.groups())), 16)), expr.as_string())


def _units(expr: Expr) -> list[Expr]:
    stack, units = [expr], []
    while stack:
        part = stack.pop()
        kind = part.decl().kind()
        if kind == z3.Z3_OP_SEQ_CONCAT:
            stack.extend(reversed(part.children()))
        elif kind == z3.Z3_OP_SEQ_UNIT:
            units.append(part.arg(0))
        elif kind != z3.Z3_OP_SEQ_EMPTY:
            raise Unsupported(f"a sequence that the solver left open: {part}")
    return units

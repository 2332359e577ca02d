"""Expressions of a step: their kinds, and nothing that Python would take otherwise."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from . import program
from .program import Expr, Kind, Scalar, parts
from .whole_file import Parts, Refusal, outside

if TYPE_CHECKING:
    from .translate import Scope

_OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
}
_COMPARED: dict[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_NUMBERS = (Kind.INT, Kind.FLOAT)
_FINITE = {"isnan": False, "isinf": False, "isfinite": True}
"""What `math` says of any finite number."""


class Expressions:
    """The part of the translator that reads expressions. Raises Refusal."""

    scope: Scope
    start: dict[str, Scalar]

    def __init__(self, file: Parts, params: Mapping[str, Any]) -> None:
        self.parts, self.params = file, params
        self.kinds: dict[str, Kind] = {}
        self.items: dict[str, Kind] = {}
        self.mappings: dict[str, Any] = {}
        self.results: list[Kind] = []
        self.conditional = 0
        self.start = {}

    def inline(self, definition: ast.FunctionDef, arguments: Sequence[ast.expr], method: bool, line: int) -> Expr:
        raise NotImplementedError

    def truth(self, node: ast.expr) -> Expr:
        found = self.expression(node)
        if found.kind is not Kind.BOOL:
            raise Refusal(node.lineno, f"{_a(found)} stands for a truth value")
        return found

    def under_condition(self, node: ast.expr) -> Expr:
        self.conditional += 1
        try:
            return self.expression(node)
        finally:
            self.conditional -= 1

    def expression(self, node: ast.expr) -> Expr:
        try:
            return self._expression(node)
        except Refusal as refusal:
            refusal.within(node)
            raise

    def _expression(self, node: ast.expr) -> Expr:
        constant = self.constant(node)
        if isinstance(constant, bool | int | float | str):
            return _const(constant, node.lineno)
        if constant is not None:
            raise Refusal(node.lineno, "a mapping or list is used as a value")
        line = node.lineno
        match node:
            case ast.Name(id=name):
                return self.name(name, line)
            case ast.Attribute(value=ast.Name(id=receiver), attr=attribute) if self.is_object(receiver):
                return self.attribute(attribute, line)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return program.Unary("not", self.truth(operand), Kind.BOOL)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                body = self.number(operand)
                return program.Unary("-", body, body.kind)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.number(operand)
            case ast.BinOp(left=left, op=op, right=right):
                return self.arithmetic(left, op, right, line)
            case ast.BoolOp(op=op, values=values):
                first = self.truth(values[0])
                rest = [self.under_condition(value) for value in values[1:]]
                if any(item.kind is not Kind.BOOL for item in rest):
                    raise Refusal(line, "and/or of what are no truth values gives one of them")
                return program.Junction("and" if isinstance(op, ast.And) else "or", (first, *rest))
            case ast.Compare(left=left, ops=ops, comparators=comparators):
                return self.comparison(left, ops, comparators, line)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                condition = self.truth(test)
                then, otherwise = self.alike([self.under_condition(body), self.under_condition(orelse)], line, "if")
                return program.Choice(condition, then, otherwise, then.kind)
            case ast.Call(func=func, args=arguments, keywords=[]):
                return self.call(func, arguments, line)
            case ast.Subscript(slice=index):
                view = self.view(node.value)
                if view is not None and not isinstance(index, ast.Slice):
                    return self.item(view, index, line)
            case ast.Attribute():
                raise Refusal(
                    line, f"{ast.unparse(node)} is not in the subset: an enumeration's elements are texts here"
                )
        raise outside(node, line)

    # -- names -------------------------------------------------------------------------------------------

    def local(self, name: str) -> bool:
        """Whether the function that is read has this name itself: it is then not the module's."""
        scope = self.scope
        return name == scope.receiver or any(
            name in held for held in (scope.own, scope.bound, scope.sequences, scope.aliases)
        )

    def is_object(self, name: str) -> bool:
        return name == self.scope.receiver and name not in self.scope.own and bool(name)

    def name(self, name: str, line: int) -> Expr:
        full = f"{name}{self.scope.suffix}"
        if name in self.scope.bound:
            return program.Name(full, self.kinds[full])
        if name in self.scope.own:
            raise Refusal(line, f"{name} has no value on some path to here")
        if name in self.scope.sequences:
            raise Refusal(line, f"the sequence {name} is kept, compared or given away whole")
        raise Refusal(line, f"{name} is not known here")

    def attribute(self, attribute: str, line: int) -> Expr:
        full = f"self.{attribute}"
        if full not in self.kinds or (attribute in self.parts.methods):
            raise Refusal(line, f"{full} is not a number, truth value or text that __init__ sets")
        return program.Name(full, self.kinds[full])

    def constant(self, node: ast.expr) -> Any:
        """A value that is the same at every step and written down: a literal, a name of the module or the class, a
        parameter; None where it is none of these."""
        match node:
            case ast.Constant(value=bool() | int() | float() | str() as value):
                return value
            case ast.Name(id=name) if name in self.scope.aliases and name not in self.scope.own:
                return self.scope.aliases[name]
            case ast.Name(id=name) if not self.local(name):
                return self.literal(self.parts.constants.get(name))
            case ast.Attribute(value=ast.Name(id="math"), attr="pi") if self.is_module("math"):
                return math.pi
            case ast.Attribute(value=ast.Name(id=receiver), attr=attribute) if self.is_object(receiver):
                if attribute in self.mappings:
                    return self.mappings[attribute]
                return self.literal(self.parts.of_class.get(attribute))
            case ast.Attribute(value=ast.Name(id=name), attr=attribute) if (
                name == self.parts.node.name and not self.local(name)
            ):
                return self.literal(self.parts.of_class.get(attribute))
            case ast.Subscript(value=value, slice=ast.Constant(value=str(key))):
                whole = self.constant(value)
                if isinstance(whole, Mapping):
                    if key not in whole:
                        raise Refusal(node.lineno, f"the parameters have no {key}")
                    return whole[key]
            case ast.Call(func=ast.Attribute(value=value, attr="get"), args=[ast.Constant(value=str(key)), *rest]):
                whole = self.constant(value)
                default = self.constant(rest[0]) if len(rest) == 1 else None
                known = default is not None or all(isinstance(item, ast.Constant) for item in rest)
                if isinstance(whole, Mapping) and not node.keywords and len(rest) <= 1 and known:
                    return whole.get(key, default)  # what stands for want of it is evaluated anyhow
            case ast.Dict(keys=[]):
                return {}
            case ast.Call(func=ast.Name(id="float"), args=[value], keywords=[]):
                inner = self.constant(value)
                if type(inner) in (int, float):
                    return float(inner)
        return None

    def literal(self, node: ast.expr | None) -> Any:
        match node:
            case None:
                return None
            case ast.UnaryOp(operand=ast.Constant(value=value)):
                return -value  # type: ignore[operator]
            case ast.Constant(value=value):
                return value
        return None

    def is_module(self, name: str) -> bool:
        """Whether a name is an imported module here."""
        return not self.local(name) and name in self.parts.modules

    # -- numbers -----------------------------------------------------------------------------------------

    def number(self, node: ast.expr) -> Expr:
        found = self.expression(node)
        if found.kind not in _NUMBERS:
            raise Refusal(node.lineno, f"{_a(found)} stands for a number")
        return found

    def arithmetic(self, left: ast.expr, op: ast.operator, right: ast.expr, line: int) -> Expr:
        operator = _OPERATORS.get(type(op))
        if operator is None:
            raise outside(op, line)
        one, other = self.number(left), self.number(right)
        if operator in ("//", "%") and {one.kind, other.kind} != {Kind.INT}:
            raise Refusal(line, f"{operator} of a float is not in the subset")
        if one.kind is not other.kind:
            one, other = _floating(one, line), _floating(other, line)
        kind = Kind.FLOAT if operator == "/" else one.kind
        return program.Binary(operator, one, other, kind, line)

    def comparison(self, left: ast.expr, ops: Sequence[ast.cmpop], comparators: Sequence[ast.expr], line: int) -> Expr:
        found: list[Expr] = []
        one = self.expression(left)
        for k, (op, node) in enumerate(zip(ops, comparators, strict=True)):
            if (
                isinstance(op, ast.In | ast.NotIn)
                and len(ops) == 1
                and isinstance(node, ast.Tuple | ast.List | ast.Set)
            ):
                if any(isinstance(p, program.Inlined) for p in parts(one)):
                    raise Refusal(line, "a call that is looked for among values")
                looked = [self.expression(item) for item in node.elts]
                if not all(
                    isinstance(p, program.Const | program.Name | program.Unary) for item in looked for p in parts(item)
                ):
                    raise Refusal(line, "values looked among have to be constants or names: Python evaluates them all")
                members = [self.equated("==", one, item, line) for item in looked]
                if members:
                    among: Expr = program.Junction("or", tuple(members)) if len(members) > 1 else members[0]
                    return among if isinstance(op, ast.In) else program.Unary("not", among, Kind.BOOL)
            operator = _COMPARED.get(type(op))
            if operator is None:
                raise outside(op, line)
            other = self.expression(node) if k == 0 else self.under_condition(node)
            if len(ops) > 1 and any(isinstance(p, program.Inlined) for p in parts(other)):
                raise Refusal(line, "a call between two comparisons")
            found.append(self.equated(operator, one, other, line))
            one = other
        return found[0] if len(found) == 1 else program.Junction("and", tuple(found))

    def equated(self, operator: str, one: Expr, other: Expr, line: int) -> Expr:
        numbers = one.kind in _NUMBERS and other.kind in _NUMBERS
        alike = one.kind is other.kind and operator in ("==", "!=")
        if not numbers and not alike:
            raise Refusal(line, f"{_a(one)} {operator} {_a(other)} is not in the subset")
        return program.Comparison(operator, one, other)

    def alike(self, items: Sequence[Expr], line: int, what: str) -> list[Expr]:
        if len({item.kind for item in items}) > 1:
            kinds = " and ".join(sorted({_a(item) for item in items}))
            raise Refusal(line, f"{kinds} meet in {what}: write 0.0 where a float is meant")
        return list(items)

    # -- calls and sequences -----------------------------------------------------------------------------

    def call(self, func: ast.expr, arguments: Sequence[ast.expr], line: int) -> Expr:
        match func:
            case ast.Name(id=name) if self.local(name):
                raise Refusal(line, f"{name} is called, and is a local name")
            case ast.Name(id="min" | "max" as name) if len(arguments) >= 2:
                items = self.alike([self.number(a) for a in arguments], line, name)
                return program.Extreme(name, tuple(items), items[0].kind)
            case ast.Name(id="abs") if len(arguments) == 1:
                body = self.number(arguments[0])
                return program.Unary("abs", body, body.kind)
            case ast.Name(id="float") if len(arguments) == 1:
                return _floating(self.number(arguments[0]), line)
            case ast.Name(id="bool") if len(arguments) == 1:
                return self.truth(arguments[0])
            case ast.Name(id="len") if len(arguments) == 1:
                view = self.view(arguments[0])
                if view is not None:
                    return program.Length(view)
            case ast.Attribute(value=ast.Name(id="math"), attr="fabs") if self.is_module("math"):
                if len(arguments) == 1:
                    return program.Unary("abs", _floating(self.number(arguments[0]), line), Kind.FLOAT)
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in _FINITE and self.is_module("math"):
                if len(arguments) == 1:
                    asked = self.number(arguments[0])
                    if not isinstance(asked, program.Const | program.Name) or asked.kind is not Kind.FLOAT:
                        raise Refusal(line, f"{name} is asked of something else than a float's name")
                    return program.Const(_FINITE[name], Kind.BOOL)
            case ast.Name(id=name) if name in self.parts.functions:
                return self.inline(self.parts.functions[name], arguments, False, line)
            case ast.Attribute(value=ast.Name(id=receiver), attr=name) if (
                self.is_object(receiver) and name in self.parts.methods
            ):
                return self.inline(self.parts.methods[name], arguments, True, line)
        allowed = "call min, max, abs, len, float, an own method, or a function of this file"
        raise Refusal(line, f"the call of {ast.unparse(func)[:60]} is not in the subset", allowed)

    def view(self, node: ast.expr) -> program.View | None:
        """An input sequence or a part of it; None where it is none. Raises Refusal."""
        match node:
            case ast.Name(id=name) if name in self.scope.sequences:
                return self.scope.sequences[name]
            case ast.Subscript(value=value, slice=ast.Slice(lower=lower, upper=upper, step=step)):
                whole = self.view(value)
                if whole is None:
                    return None
                if whole.start or whole.stop is not None or step is not None:
                    raise Refusal(node.lineno, "a part of a part, or a step within a part")
                ends = [self.constant(end) if end is not None else None for end in (lower, upper)]
                for end, given in zip((lower, upper), ends, strict=True):
                    if end is not None and (type(given) is not int or given < 0):
                        raise Refusal(node.lineno, "a part whose ends are not written as numbers from 0")
                return program.View(whole.sequence, ends[0] or 0, ends[1])
        return None

    def item(self, view: program.View, index: ast.expr, line: int) -> Expr:
        at = self.expression(index)
        if at.kind is not Kind.INT:
            raise Refusal(line, f"{_a(at)} is an index")
        if (isinstance(at, program.Const) and int(at.value) < 0) or isinstance(index, ast.UnaryOp):
            raise Refusal(line, "a negative index counts from the end")
        return program.Item(view, at, self.items[view.sequence], line)


def _const(value: Scalar, line: int) -> program.Const:
    match value:
        case bool():
            return program.Const(value, Kind.BOOL)
        case int():
            return program.Const(value, Kind.INT)
        case float():
            if not math.isfinite(value):
                raise Refusal(line, f"{value} is no REAL")
            return program.Const(value, Kind.FLOAT)
        case str():
            return program.Const(value, Kind.TEXT)


def _floating(value: Expr, line: int) -> Expr:
    """A number as a float, as Python makes one of an int where it meets a float."""
    if value.kind is Kind.FLOAT:
        return value
    if isinstance(value, program.Const):
        try:
            return program.Const(float(value.value), Kind.FLOAT)
        except OverflowError:
            raise Refusal(line, f"{value.value} is too large for a float") from None
    return program.Convert(value, line)


def _a(value: Expr) -> str:
    return f"{'an' if value.kind is Kind.INT else 'a'} {value.kind}"

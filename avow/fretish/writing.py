"""Clauses as FRETish sentences: the inverse of `meaning`, for the forms of clauses that it produces."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction
from functools import reduce

from avow.base.diagnostics import Diagnostic
from avow.formulas.formula import free_variables
from avow.formulas.values import show
from avow.language import terms as t
from avow.language.contract import Clause, Contract, Node, Partial
from avow.language.printer import show_sort
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort

from .sentence import FIRST, Expression, Unreadable, is_assumption, parse_expression


class _Beyond(Exception):  # noqa: N818 - it names what happened
    """A construct without a counterpart in FRETish."""


def to_fretish(contract: Contract) -> Partial:
    """A line for each clause, starting with its name."""
    lines: list[str] = []
    missing: list[Diagnostic] = []
    for node in contract.nodes:
        twice = {p.name for p in node.inputs} & {p.name for p in node.outputs}
        for clause in node.clauses:
            try:
                lines.append(f"{_named(node, clause)}: {_sentence(node, clause, twice)}\n")
            except _Beyond as error:
                message = f"{node.name}.{clause.name}: FRETish cannot say {error}"
                missing.append(Diagnostic("FRET005", message, clause.span))
    return Partial("".join(lines), tuple(missing))


def _named(node: Node, clause: Clause) -> str:
    """The name distinguishes assumptions from guarantees."""
    if clause in node.assumptions:
        return clause.name if is_assumption(clause.name) else f"{clause.name}_assumption"
    if is_assumption(clause.name):
        raise _Beyond("a guarantee whose name has `assum` in it, which makes an assumption of it")
    return clause.name


def _sentence(node: Node, clause: Clause, twice: set[str]) -> str:
    formula = clause.formula
    if clause.chance is not None:
        raise _Beyond("a probability")
    doubled = {part.name for part in free_variables(formula)} & twice
    if doubled:
        raise _Beyond(f"an input and an output that are both called `{min(doubled)}`")
    match formula:
        case t.Implies(left=trigger, right=t.History(operator=operator) as response) if operator in t.RESPONSES:
            return f"{_condition(trigger)}the {_name(node.name)} shall {_response(response)}"
        case t.History(operator=operator) if operator in t.RESPONSES:
            return f"whenever true the {_name(node.name)} shall {_response(formula)}"
        case t.Implies(left=t.History(operator=t.Past.ROSE) as trigger, right=right):
            return f"{_condition(trigger)}the {_name(node.name)} shall immediately satisfy {_say(right)}"
        case _:  # one step
            return f"the {_name(node.name)} shall always satisfy {_say(formula)}"


def _condition(trigger: t.Term) -> str:
    match trigger:
        case t.History(operator=t.Past.ROSE, arguments=(inner,)) if inner == t.TRUE:
            return ""
        case t.History(operator=t.Past.ROSE, arguments=(inner,)):
            return f"upon {_say(inner)} "
        case _:  # at every step where it holds
            return f"whenever {_say(trigger)} "


def _response(response: t.History) -> str:
    wanted = _say(response.arguments[0])
    match response.operator:
        case t.Past.NEXT:
            return f"at the next timepoint satisfy {wanted}"
        case t.Past.WITHIN | t.Past.FOR:
            return f"{response.operator} {_duration(response.limit)} satisfy {wanted}"
        case t.Past.UNTIL:
            return f"until {_say(response.arguments[1])} satisfy {wanted}"
        case t.Past.EVENTUALLY:
            return f"eventually satisfy {wanted}"
        case _:
            raise _Beyond(f"`{response.operator}`")


def _duration(limit: t.Limit | None) -> str:
    assert limit is not None
    if limit.steps:
        return f"{limit.number} ticks"
    seconds = limit.number
    for scale, unit in ((1, "seconds"), (1000, "milliseconds"), (1_000_000, "microseconds")):
        if (seconds * scale).denominator == 1:
            return f"{seconds * scale} {unit}"
    raise _Beyond("a limit shorter than a microsecond")


_CONNECTIVES = {t.And: "&", t.Or: "|", t.Implies: "=>", t.Iff: "<=>"}


def _say(term: t.Term) -> str:
    """In parentheses if it has parts of its own."""
    match term:
        case t.Literal(value=bool(value)):
            return "true" if value else "false"
        case t.Literal(value=str()):
            raise _Beyond("a text")
        case t.Literal(value=value):
            return _number(Fraction(value))
        case t.Variable(role=t.Role.INPUT | t.Role.OUTPUT, name=name) | t.EnumValue(name=name):
            return _name(name)
        case t.Widen(term=inner):
            return _say(inner)
        case t.Not(body=body):
            return f"!{_say(body)}"
        case t.Negative(term=inner):
            return f"(-{_say(inner)})"
        case t.And() | t.Or() | t.Implies() | t.Iff():
            return _infix(_CONNECTIVES[type(term)], term)
        case t.Compare(operator=sign, left=left) if isinstance(left.sort, BoolSort):
            return _infix("<=>" if sign == "==" else "xor", term)
        case t.Compare(operator=sign):
            return _infix("=" if sign == "==" else sign, term)
        case t.Arithmetic(operator=sign):
            return _infix(sign, term)
        case t.Operation(operator=t.Builtin.XOR | t.Builtin.MOD as operator):
            return _infix(operator, term)
        case t.Operation(operator=t.Builtin.ABS, arguments=(inner,)):
            return f"abs({_say(inner)})"
        case t.Operation(operator=t.Builtin.MIN | t.Builtin.MAX as operator, arguments=arguments):
            return reduce(lambda left, right: f"{operator}({left}, {right})", map(_say, arguments))
        case t.History(operator=t.Past.PREVIOUS, arguments=(value, first)):
            return f"{_previous(term)}({_say(first)}, {_say(value)})"
        case t.History(operator=t.Past.ROSE, arguments=(inner,)) if inner == t.TRUE:
            return FIRST
        case t.History(
            operator=t.Past.HELD | t.Past.ONCE as operator, arguments=(inner,), limit=t.Limit(steps=True) as limit
        ):
            name = "persisted" if operator is t.Past.HELD else "occurred"
            return f"{name}({_say(limit.amount)}, {_say(inner)})"
        case t.History(operator=operator) | t.Operation(operator=operator):
            raise _Beyond(f"`{operator}`")
        case _:
            raise _Beyond(f"a {type(term).__name__.lower()} ({show_sort(term.sort)})" if term.children else "this term")


def _infix(sign: str, term: t.Term) -> str:
    return f"({f' {sign} '.join(map(_say, term.children))})"


def _previous(term: t.History) -> str:
    match term.sort:
        case BoolSort():
            return "preBool"
        case IntegerSort() | NaturalSort():
            return "preInt"
        case RealSort() | EnumSort():  # an element is compared as a number there
            return "preReal"
        case sort:
            raise _Beyond(f"`previous` of a value of {show_sort(sort)}")


def _number(value: Fraction) -> str:
    text = show(value).replace("/", " / ")
    return f"({text})" if value < 0 or "/" in text else text


def _name(name: str) -> str:
    with suppress(Unreadable):
        if name != FIRST and parse_expression(name) == Expression("name", text=name):
            return name
    raise _Beyond(f"the name `{name}`, which it reads otherwise")

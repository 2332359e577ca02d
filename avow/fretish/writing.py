"""Clauses as FRETish sentences: the shapes that `meaning` makes of sentences, the other way."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from avow.base.diagnostics import Diagnostic
from avow.formulas.formula import free_variables
from avow.formulas.values import show
from avow.language.contract import Clause, Contract, Node
from avow.language.printer import show_sort
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort
from avow.language.terms import (
    RESPONSES,
    TRUE,
    And,
    Arithmetic,
    Builtin,
    Compare,
    EnumValue,
    History,
    Iff,
    Implies,
    Limit,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
    Past,
    Role,
    Term,
    Variable,
    Widen,
)

from .sentence import FIRST, is_assumption


@dataclass(frozen=True, slots=True)
class Partial:
    """A text, and what is left out of it."""

    text: str
    missing: tuple[Diagnostic, ...] = field(default=())


class _Beyond(Exception):  # noqa: N818 - it names what happened
    """What FRETish has no counterpart for."""


def to_fretish(contract: Contract) -> Partial:
    """A line for each clause, its name before it."""
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
    """The name tells assumptions from guarantees."""
    if clause in node.assumptions:
        return clause.name if is_assumption(clause.name) else f"{clause.name}_assumption"
    if is_assumption(clause.name):
        raise _Beyond("a guarantee whose name has `assum` in it, which makes an assumption of it")
    return clause.name


def _sentence(node: Node, clause: Clause, twice: set[str]) -> str:
    formula = clause.formula
    doubled = {part.name for part in free_variables(formula)} & twice
    if doubled:
        raise _Beyond(f"an input and an output that are both called `{min(doubled)}`")
    match formula:
        case Implies(left=trigger, right=History(operator=operator) as response) if operator in RESPONSES:
            return f"{_condition(trigger)}the {node.name} shall {_response(response)}"
        case History(operator=operator) if operator in RESPONSES:
            return f"whenever true the {node.name} shall {_response(formula)}"
        case Implies(left=History(operator=Past.ROSE) as trigger, right=right):
            return f"{_condition(trigger)}the {node.name} shall immediately satisfy {_say(right)}"
        case _:  # one step
            return f"the {node.name} shall always satisfy {_say(formula)}"


def _condition(trigger: Term) -> str:
    match trigger:
        case History(operator=Past.ROSE, arguments=(inner,)) if inner == TRUE:
            return ""
        case History(operator=Past.ROSE, arguments=(inner,)):
            return f"upon {_say(inner)} "
        case _:  # whatever is so at a step
            return f"whenever {_say(trigger)} "


def _response(response: History) -> str:
    wanted = _say(response.arguments[0])
    match response.operator:
        case Past.NEXT:
            return f"at the next timepoint satisfy {wanted}"
        case Past.WITHIN | Past.FOR:
            return f"{response.operator} {_duration(response.limit)} satisfy {wanted}"
        case Past.UNTIL:
            return f"until {_say(response.arguments[1])} satisfy {wanted}"
        case Past.EVENTUALLY:
            return f"eventually satisfy {wanted}"
        case _:
            raise _Beyond(f"`{response.operator}`")


def _duration(limit: Limit | None) -> str:
    if limit is None or not isinstance(limit.amount, Literal) or isinstance(limit.amount.value, bool | str):
        raise _Beyond("a limit that is no number")
    if limit.steps:
        return f"{limit.amount.value} ticks"
    seconds = Fraction(limit.amount.value)
    for scale, unit in ((1, "seconds"), (1000, "milliseconds"), (1_000_000, "microseconds")):
        if (seconds * scale).denominator == 1:
            return f"{seconds * scale} {unit}"
    raise _Beyond("a limit shorter than a microsecond")


_SIGNS = {"==": "="}


def _say(term: Term) -> str:
    """In parentheses where it has parts of its own."""
    match term:
        case Literal(value=bool(value)):
            return "true" if value else "false"
        case Literal(value=str()):
            raise _Beyond("a text")
        case Literal(value=value):
            return _number(Fraction(value))
        case Variable(role=Role.INPUT | Role.OUTPUT, name=name):
            return _name(name)
        case EnumValue(name=name):
            return _name(name)
        case Widen(term=inner):
            return _say(inner)
        case Not(body=body):
            return f"!{_say(body)}"
        case And(items=items):
            return f"({' & '.join(map(_say, items))})"
        case Or(items=items):
            return f"({' | '.join(map(_say, items))})"
        case Implies(left=left, right=right):
            return f"({_say(left)} => {_say(right)})"
        case Iff(left=left, right=right):
            return f"({_say(left)} <=> {_say(right)})"
        case Compare(operator=sign, left=left, right=right) if isinstance(left.sort, BoolSort):
            return f"({_say(left)} <=> {_say(right)})" if sign == "==" else f"({_say(left)} xor {_say(right)})"
        case Compare(operator=sign, left=left, right=right):
            return f"({_say(left)} {_SIGNS.get(sign, sign)} {_say(right)})"
        case Arithmetic(operator="+" | "-" | "*" | "/" as sign, left=left, right=right):
            return f"({_say(left)} {sign} {_say(right)})"
        case Negative(term=inner):
            return f"(-{_say(inner)})"
        case Operation(operator=Builtin.XOR, arguments=(left, right)):
            return f"({_say(left)} xor {_say(right)})"
        case Operation(operator=Builtin.MOD, arguments=(left, right)):
            return f"({_say(left)} mod {_say(right)})"
        case Operation(operator=Builtin.ABS | Builtin.MIN | Builtin.MAX | Builtin.DIV as operator, arguments=arguments):
            return f"{operator}({', '.join(map(_say, arguments))})"
        case Operation(operator=operator):
            raise _Beyond(f"`{operator}`")
        case History(operator=Past.PREVIOUS, arguments=(value, first)):
            return f"{_previous(term)}({_say(first)}, {_say(value)})"
        case History(operator=Past.ROSE, arguments=(inner,)) if inner == TRUE:
            return FIRST
        case History(operator=Past.HELD | Past.ONCE as operator, arguments=(inner,), limit=Limit(steps=True) as limit):
            name = "persisted" if operator is Past.HELD else "occurred"
            return f"{name}({_say(limit.amount)}, {_say(inner)})"
        case History(operator=operator):
            raise _Beyond(f"`{operator}`")
        case _:
            raise _Beyond(f"a {type(term).__name__.lower()} ({term.sort})" if term.children else "this term")


def _previous(term: History) -> str:
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
    if "'" in name or name == FIRST:
        raise _Beyond(f"the name `{name}`")
    return name

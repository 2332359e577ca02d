"""Temporal properties of a system, as plans write them: ``eventually (… or agent.phase == leaving)``.

`always`, `eventually`, `next` and `until` over state formulas (RCL formulas whose ports are written ``node.port``).
From loosest to tightest: ``<=>``, ``->``, ``or``, ``and``, ``until``, then `not`, `always`, `eventually`, `next`. A
part without temporal operators is one state formula; operators cannot occur inside a quantifier.
"""

from __future__ import annotations

from dataclasses import field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.language.contract import Contract, Node, Port
from avow.language.definedness import unless_without_value, with_value
from avow.language.syntax import Ahead, Connective, Lasting, Name, Negation, Sign, unparenthesised, walk
from avow.language.terms import TRUE, Term

if TYPE_CHECKING:
    from avow.language.lexer import Token
    from avow.language.source import Reports
    from avow.language.syntax import Syntax, TermSyntax


class Operator(StrEnum):
    """Temporal and propositional operators; `RELEASE` is the dual of `UNTIL` and arises only from negation."""

    NOT = "not"
    AND = "and"
    OR = "or"
    IMPLIES = "->"
    IFF = "<=>"
    NEXT = "next"
    ALWAYS = "always"
    EVENTUALLY = "eventually"
    UNTIL = "until"


@dataclass(frozen=True, slots=True)
class State:
    """A property of one step."""

    term: Term
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class Temporal:
    """An operator applied to properties."""

    operator: Operator
    parts: tuple[Property, ...]


Property = State | Temporal


def parse_property(text: str, contract: Contract, span: Span | None = None) -> Property:
    """A temporal property, as a claim. Raises Rejected with every fault found."""
    from avow.language.load import syntax_of  # the grammar is slow to import
    from avow.language.source import in_order

    tree, reports = syntax_of(text, span, _marked)
    found = None if tree is None else _property(tree, reports, contract)
    if found is None or reports.failed:
        raise Rejected(*in_order(reports))
    return _claimed(found, span)


def show_property(formula: Property) -> str:
    """The property as text, every operator in parentheses where it could be misread."""
    if isinstance(formula, State):
        return formula.text.strip()
    shown = [
        f"({show_property(p)})" if isinstance(p, Temporal) or _mixed(p) else show_property(p) for p in formula.parts
    ]
    if len(shown) == 1:
        return f"{formula.operator} {shown[0]}"
    return f" {formula.operator} ".join(shown)


def states_of(formula: Property) -> tuple[State, ...]:
    """Its state formulas, each once."""
    if isinstance(formula, State):
        return (formula,)
    return tuple(dict.fromkeys(state for part in formula.parts for state in states_of(part)))


def parse_state(text: str, contract: Contract, span: Span | None = None) -> Term:
    """A claim over a system's ports, written ``node.port``: the formula, and that it has a value. If a node has an
    input and an output of one name, the output is meant, unless the text contains ``node.in.port``. It may refer to
    other steps. Raises Rejected."""
    return with_value(written_state(text, contract, span, clause=True))


def written_state(text: str, contract: Contract, span: Span | None = None, *, clause: bool = False) -> Term:
    """As `parse_state`, for the formula only; one that is not a `clause` refers to one step."""
    from avow.language.load import parse_formula  # the grammar is slow to import

    return parse_formula(text, None, _heard(text, contract), span, clause=clause)


def _heard(text: str, contract: Contract) -> Contract:
    """Without the inputs that have the name of an output of their node, unless the text contains ``node.in.port``."""

    def kept(node: Node) -> tuple[Port, ...]:
        outputs = {port.name for port in node.outputs}
        return tuple(p for p in node.inputs if p.name not in outputs or f"{node.name}.in.{p.name}" in text)

    return replace(contract, nodes=tuple(replace(node, inputs=kept(node)) for node in contract.nodes))


def _claimed(formula: Property, span: Span | None, positive: bool = True) -> Property:
    """A property as a claim: a state without a value counts against it, also under a `not`."""
    match formula:
        case State(term=term, text=text):
            return State(with_value(term) if positive else unless_without_value(term), text)
        case Temporal(operator=Operator.NOT, parts=parts):
            return Temporal(Operator.NOT, tuple(_claimed(part, span, not positive) for part in parts))
        case Temporal(operator=Operator.IMPLIES, parts=(left, right)):
            return Temporal(Operator.IMPLIES, (_claimed(left, span, not positive), _claimed(right, span, positive)))
        case Temporal(operator=Operator.IFF):
            if any(with_value(state.term) != state.term for state in states_of(formula)):
                message = "temporal property: a part of `<=>` must always have a value; write two `->`"
                raise Rejected(Diagnostic("PLAN114", message, span))
            return formula
        case Temporal(operator=operator, parts=parts):
            return Temporal(operator, tuple(_claimed(part, span, positive) for part in parts))


def _mixed(part: Property) -> bool:
    return isinstance(part, State) and " " in part.text.strip()


def _marked(found: list[Token]) -> list[Token]:
    """RCL's tokens. `always`, `eventually` and `next` are operators, not names, where a formula begins and before one;
    `until` is one everywhere."""
    for at, token in enumerate(found):
        before = found[at - 1].type if at else "LPAR"
        after = found[at + 1].type if at + 1 < len(found) else "LPAR"
        if token.type == "UNTIL":
            found[at] = token._replace(type="AHEAD_UNTIL")
        elif token.text in ("always", "eventually", "next") and before in _BEFORE and after in _AFTER:
            found[at] = token._replace(type="AHEAD")
    return found


_INSIDE = ("LPAR", "LBRACE", "NOT", "AHEAD", "IF")
_BEFORE = frozenset((*_INSIDE, "LSQUARE", "BAR", "IFF", "IMPLIES", "OR", "AND", "AHEAD_UNTIL", "THEN", "ELSE"))
_AFTER = frozenset((*_INSIDE, "NAME", "STRING", "MINUS", "NUMBER", "FORALL", "EXISTS", "UNIQUE", "TRUE", "FALSE", "LT"))


def _property(tree: TermSyntax, reports: Reports, contract: Contract) -> Property:
    """Faults are reported."""

    def made(operator: str, *parts: TermSyntax) -> Temporal:
        return Temporal(Operator(operator), tuple(_property(part, reports, contract) for part in parts))

    tree = unparenthesised(tree)
    if not any(isinstance(part, Ahead) or _is_until(part) for part in walk(tree)):
        from avow.language.load import one_step

        text = reports.source.text[tree.start : tree.end]
        term = one_step(tree, reports, _heard(text, contract))
        assert term is not None or reports.failed
        return State(term or TRUE, text)
    match tree:
        case Ahead(function=Name(text=word), arguments=parts):
            return made(word, *parts)
        case Negation(body=body):
            return made("not", body)
        case Lasting(word=word, left=left, right=right) if _is_until(tree):
            return made(word, left, right)
        case Connective(sign=sign, items=items) if len(items) == 2 or sign in (Sign.AND, Sign.OR):
            return made(sign, *items)
        case Connective(sign=Sign.IMPLIES, items=(left, *rest)):
            return made("->", left, replace(tree, start=rest[0].start, items=tuple(rest)))
        case Connective():
            message = "put parentheses: <=> is given more than once"
        case _:  # a formula about one step
            message = "a temporal operator cannot stand inside a state formula or a quantifier"
    reports.error("PLAN114", f"temporal property: {message}", tree.start, tree.end)
    return State(TRUE)


def _is_until(tree: Syntax) -> bool:
    return isinstance(tree, Lasting) and tree.word == Operator.UNTIL

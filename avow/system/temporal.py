"""Temporal properties of a system, as plans write them: ``eventually (… or agent.phase == leaving)``.

`always`, `eventually`, `next` and `until` over state formulas (RCL formulas whose ports are written ``node.port``).
From loosest to tightest: ``<=>``, ``->``, ``or``, ``and``, ``until``, then `not`, `always`, `eventually`, `next`. A
part without temporal operators is one state formula; operators cannot stand inside a quantifier.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum
from itertools import pairwise

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.language.contract import Contract
from avow.language.definedness import unless_without_value, with_value
from avow.language.terms import Term
from avow.tuning.sizes import PROPERTY_DEPTH, PROPERTY_LENGTH


class Operator(StrEnum):
    """Temporal and propositional operators; `RELEASE` is the dual of `UNTIL` and only arises from negation."""

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
    """What one step shows."""

    term: Term
    text: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class Temporal:
    """An operator applied to properties."""

    operator: Operator
    parts: tuple[Property, ...]


Property = State | Temporal


_TEMPORAL = ("always", "eventually", "next", "until")
_UNARY = ("not", "always", "eventually", "next")
_BINARY = ("<=>", "->", "or", "and", "until")
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[A-Za-z_][A-Za-z0-9_\']*|<=>|->|[()\[\]{}]|[^\sA-Za-z_"]|"')
_OPENING, _CLOSING = "([{", ")]}"


@dataclass(frozen=True, slots=True)
class _Token:
    text: str
    start: int
    end: int


def parse_property(text: str, contract: Contract, span: Span | None = None) -> Property:
    """A temporal property, as a claim. Raises Rejected with every fault found."""
    if len(text) > PROPERTY_LENGTH:
        raise Rejected(Diagnostic("PLAN114", "the property is too long", span))
    parser = _Parser(text, contract, span, _tokens(text))
    return _claimed(parser.parse(0, len(parser.tokens), 0), span)


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


def is_temporal(text: str) -> bool:
    """Whether a text uses a temporal operator at all."""
    tokens = _tokens(text)
    return any(_is_operator(tokens, k) in _TEMPORAL for k in range(len(tokens)))


def parse_state(text: str, contract: Contract, span: Span | None = None) -> Term:
    """A claim over a system's ports, written ``node.port``: the formula, and that it has a value. Where a node has an
    input and an output of one name, the output is meant, unless the text says ``node.in.port`` somewhere. It may speak
    of other steps. Raises Rejected."""
    return with_value(written_state(text, contract, span, clause=True))


def written_state(text: str, contract: Contract, span: Span | None = None, *, clause: bool = False) -> Term:
    """As `parse_state`, of the formula alone; one that is no `clause` is of one step."""
    from dataclasses import replace

    from avow.language.load import parse_formula  # the grammar is slow to import

    nodes = tuple(
        replace(
            node,
            inputs=tuple(
                port
                for port in node.inputs
                if port.name not in {o.name for o in node.outputs} or f"{node.name}.in.{port.name}" in text
            ),
        )
        for node in contract.nodes
    )
    return parse_formula(text, None, replace(contract, nodes=nodes), span, clause=clause)


def _claimed(formula: Property, span: Span | None, positive: bool = True) -> Property:
    """What a property says as a claim: a state that has no value counts against it, also under a `not`."""
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


def _tokens(text: str) -> tuple[_Token, ...]:
    return tuple(_Token(found[0], found.start(), found.end()) for found in _TOKEN.finditer(text))


def _is_operator(tokens: tuple[_Token, ...], at: int) -> str | None:
    """The operator at a place. A name such as `next` is one only where an operator can stand."""
    word = tokens[at].text
    before = tokens[at - 1].text if at else None
    after = tokens[at + 1].text if at + 1 < len(tokens) else None
    if word in ("<=>", "->"):
        return word
    if before == ".":
        return None
    starts = before is None or before in "([{|" or before in _BINARY or before in _UNARY
    if word in _UNARY:
        operand = after is not None and (after[0].isalpha() or after[0] in '_("-' or after[0].isdigit())
        return word if starts and operand else None
    if word in _BINARY:
        return None if starts else word
    return None


@dataclass(slots=True)
class _Parser:
    text: str
    contract: Contract
    span: Span | None
    tokens: tuple[_Token, ...]

    def parse(self, start: int, end: int, depth: int) -> Property:
        if depth > PROPERTY_DEPTH:
            raise self.fault("nested too deeply", start)
        if start >= end:
            raise self.fault("a formula is missing here", start)
        if self.wrapped(start, end):
            return self.parse(start + 1, end - 1, depth + 1)
        if not any(_is_operator(self.tokens, k) in _TEMPORAL for k in range(start, end)):
            return self.state(start, end)
        for operator in _BINARY:
            places = list(self.places(operator, start, end))
            if not places:
                continue
            if operator in ("and", "or"):
                cuts = [start - 1, *places, end]
                parts = tuple(self.parse(a + 1, b, depth + 1) for a, b in pairwise(cuts))
                return Temporal(Operator(operator), parts)
            if operator == "<=>" and len(places) > 1:
                raise self.fault("put parentheses: <=> is given more than once", places[1])
            left = self.parse(start, places[0], depth + 1)
            return Temporal(Operator(operator), (left, self.parse(places[0] + 1, end, depth + 1)))
        first = _is_operator(self.tokens, start)
        if first in _UNARY:
            return Temporal(Operator(first), (self.parse(start + 1, end, depth + 1),))
        raise self.fault("a temporal operator cannot stand inside a state formula or a quantifier", start)

    def wrapped(self, start: int, end: int) -> bool:
        """Whether one pair of parentheses encloses it all."""
        if self.tokens[start].text != "(" or self.tokens[end - 1].text != ")":
            return False
        level = 0
        for k in range(start, end):
            text = self.tokens[k].text
            level += 1 if text in _OPENING else -1 if text in _CLOSING else 0
            if level == 0:
                return k == end - 1
        return False

    def places(self, operator: str, start: int, end: int) -> Iterator[int]:
        """Where an operator stands outside all brackets."""
        level = 0
        for k in range(start, end):
            text = self.tokens[k].text
            if text in _OPENING:
                level += 1
            elif text in _CLOSING:
                level -= 1
                if level < 0:
                    raise self.fault(f"{text} closes nothing", k)
            elif level == 0 and _is_operator(self.tokens, k) == operator:
                yield k
        if level:
            raise self.fault("a bracket is not closed", end - 1)

    def state(self, start: int, end: int) -> State:
        first, last = self.tokens[start].start, self.tokens[end - 1].end
        text = self.text[first:last]
        return State(written_state(text, self.contract, self.span), text)

    def fault(self, message: str, at: int) -> Rejected:
        offset = self.tokens[min(at, len(self.tokens) - 1)].start if self.tokens else 0
        near = self.text[offset : offset + 30]
        return Rejected(Diagnostic("PLAN114", f"temporal property: {message}, near {near!r}", self.span))

"""Reads properties as written in a plan, and refuses those that AJPF would silently read as something else.

Beyond AJPF's syntax, arguments may be index variables and ``i + 1`` of them, to be replaced for each instance.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from . import psl
from .psl import Atom, Formula, Modality
from .terms import Struct, Term, Var, subterms
from .tuning import PROPERTY_LENGTH, PROPERTY_NESTING

_TOKEN = re.compile(r"\s*(\[\]|<>|->|\|\||[~&(),+\-]|[A-Za-z_][A-Za-z0-9_']*|[0-9]+(?:\.[0-9]+)?|\Z|.)", re.DOTALL)
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?\Z")
_BINARY: Mapping[str, Callable[[Formula, Formula], Formula]] = {"U": psl.Until, "R": psl.Release, "->": psl.Implies}
_JUNCTIONS: Mapping[str, Callable[[tuple[Formula, ...]], Formula]] = {"&": psl.And, "||": psl.Or}
_UNARY: Mapping[str, tuple[Callable[[Formula], Formula], int]] = {
    **dict.fromkeys(("[]", "A"), (psl.Always, 3)),
    **dict.fromkeys(("<>", "E"), (psl.Eventually, 2)),
    "~": (psl.Not, 1),
}
"""With its level of precedence in AJPF: its direct operands must bind tighter."""


class Malformed(Exception):  # noqa: N818 - it names the text
    """`reason` is a sentence; `offset` counts characters from the formula's start."""

    def __init__(self, reason: str, offset: int) -> None:
        super().__init__(reason)
        self.reason = reason
        self.offset = offset


@dataclass(frozen=True, slots=True)
class _Token:
    text: str
    offset: int


def parse_psl(text: str) -> Formula:
    """Raises Malformed."""
    if len(text) > PROPERTY_LENGTH:
        raise Malformed(f"longer than {PROPERTY_LENGTH} characters", 0)
    parser = _Parser([_Token(found[1], found.start(1)) for found in _TOKEN.finditer(text)])
    formula = parser.property(0)
    if parser.now.text:
        raise Malformed(
            f"unexpected {parser.now.text!r} after the formula; AJPF would ignore the rest", parser.now.offset
        )
    return formula


class _Parser:
    def __init__(self, tokens: list[_Token]) -> None:
        self.tokens = tokens
        self.at = 0

    @property
    def now(self) -> _Token:
        return self.tokens[self.at]

    def take(self, text: str | None = None) -> _Token:
        token = self.now
        if text is not None and token.text != text:
            raise Malformed(f"expected {text!r}, found {token.text or 'the end'!r}", token.offset)
        if token.text:
            self.at += 1
        return token

    def property(self, depth: int) -> Formula:
        """One kind of operator at a level: a mixture is refused, as AJPF's precedences are not what people expect."""
        if depth > PROPERTY_NESTING:
            raise Malformed(f"brackets nested more than {PROPERTY_NESTING} deep", self.now.offset)
        items = [self.unary(depth)]
        operator = self.now
        while self.now.text in _BINARY or self.now.text in _JUNCTIONS:
            token = self.take()
            if token.text != operator.text:
                raise Malformed(
                    f"'{operator.text}' and '{token.text}' without brackets: AJPF binds '||' tighter than '&', "
                    "'&' tighter than '->'; say which is meant",
                    token.offset,
                )
            items.append(self.unary(depth))
            if token.text in _BINARY and len(items) > 2:
                raise Malformed(f"'{token.text}' in a row: AJPF brackets to the left; say which is meant", token.offset)
        if len(items) == 1:
            return items[0]
        if operator.text in _JUNCTIONS:
            return _JUNCTIONS[operator.text](tuple(items))
        return _BINARY[operator.text](items[0], items[1])

    def unary(self, depth: int) -> Formula:
        token = self.now
        if token.text not in _UNARY:
            return self.atom(depth)
        self.take()
        inner = self.now
        make, loose = _UNARY[token.text]
        if inner.text in _UNARY and _UNARY[inner.text][1] >= loose:
            raise Malformed(
                f"'{token.text}{inner.text}' loses an operator in AJPF: write {token.text}({inner.text} …)",
                inner.offset,
            )
        return make(self.unary(depth))

    def atom(self, depth: int) -> Formula:
        token = self.take()
        match token.text:
            case "(":
                inner = self.property(depth + 1)
                self.take(")")
                return inner
            case "T":
                return psl.TRUE
            case "F":
                return psl.FALSE
            case "P" | "B" | "G" | "I" | "ItD" | "D":
                self.take("(")
                agent = ""
                if token.text != "P":
                    name = self.take()
                    agent = name.text
                    if agent in psl.KEYWORDS or not psl.AGENT_NAME.match(agent):
                        raise Malformed(f"{agent!r} cannot be an agent's name in AJPF", name.offset)
                    self.take(",")
                term = self.struct(depth)
                self.take(")")
                return Atom(Modality(token.text), agent, term)
            case _:  # no formula begins so: reported below
                shown = repr(token.text) if token.text else "the end"
                raise Malformed(f"expected a proposition such as B(agent, fact), found {shown}", token.offset)

    def struct(self, depth: int) -> Struct:
        at = self.now.offset
        term = self.term(depth)
        if isinstance(term, Var) or not psl.AGENT_NAME.match(term.functor):
            raise Malformed("expected a fact such as going(3)", at)
        return term

    def term(self, depth: int) -> Term:
        if depth > PROPERTY_NESTING:
            raise Malformed(f"terms nested more than {PROPERTY_NESTING} deep", self.now.offset)
        token = self.take()
        if token.text == "_":
            return Var("_")
        if token.text == "-":
            raise Malformed("AJPF's properties know no negative numbers", token.offset)
        if _NUMBER.match(token.text):
            return Struct(token.text)
        if not re.match(r"[A-Za-z][A-Za-z0-9_']*\Z", token.text):
            raise Malformed(f"expected a term, found {token.text or 'the end'!r}", token.offset)
        if token.text[0].isupper():
            raise Malformed("AJPF's properties know no named variables: write _", token.offset)
        if self.now.text in ("+", "-"):
            operator = self.take().text
            number = self.take()
            if not re.match(r"[0-9]+\Z", number.text):
                raise Malformed("expected a whole number, as in i + 1", number.offset)
            return Struct(operator, (Struct(token.text), Struct(number.text)))
        args: list[Term] = []
        if self.now.text == "(":
            while self.now.text == "," or not args:
                self.take()
                args.append(self.term(depth + 1))
            self.take(")")
        return Struct(token.text, tuple(args))


def instantiate(formula: Formula, values: Mapping[str, int]) -> Formula:
    """The formula with its index variables replaced. Raises Malformed if a part remains that AJPF cannot read."""

    def instance(atom: Atom) -> Atom:
        made = _instantiate(atom.term, values)
        assert isinstance(made, Struct)
        return replace(atom, term=made)

    return psl.with_atoms(formula, instance)


def _instantiate(term: Term, values: Mapping[str, int]) -> Term:
    if isinstance(term, Var):
        return term
    if term.functor in ("+", "-"):
        name, number = term.args
        assert isinstance(name, Struct)
        assert isinstance(number, Struct)
        if name.functor not in values:
            raise Malformed(f"'{name.functor}' has no value here", 0)
        offset = int(number.functor)
        return _index(values[name.functor] + (offset if term.functor == "+" else -offset))
    if not term.args and term.functor in values:
        return _index(values[term.functor])
    made = Struct(term.functor, tuple(_instantiate(arg, values) for arg in term.args))
    if "'" in made.functor:
        raise Malformed(f"'{made.functor}' has no value here", 0)
    return made


def _index(value: int) -> Struct:
    if value < 0:
        raise Malformed(f"the index becomes {value}, and AJPF's properties know no negative numbers", 0)
    return Struct(str(value))


def index_names(formula: Formula) -> frozenset[str]:
    """Names without arguments in the formula's terms: constants, or index variables."""
    found = (part for atom in psl.atoms(formula) for arg in atom.term.args for part in subterms(arg))
    return frozenset(part.functor for part in found if isinstance(part, Struct) and not part.args)

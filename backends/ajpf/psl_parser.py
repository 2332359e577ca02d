"""Reads properties as written in a plan, and refuses those that AJPF would silently read as something else.

Beyond AJPF's syntax, arguments may be index variables and ``i + 1`` of them, to be replaced for each instance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from lark import Token, Transformer
from lark.exceptions import UnexpectedInput

from avow.base.grammars import lark_of, misfit

from . import psl
from .psl import Atom, Formula, Modality
from .terms import Struct, Term, Var, subterms

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


def parse_psl(text: str) -> Formula:
    """Raises Malformed."""
    grammar = lark_of(Path(__file__).with_name("psl.lark"), "psl", ("row",), _Builder, lexer="contextual")
    try:
        formula: Formula = grammar.parse(text)
    except UnexpectedInput as error:
        word, at = misfit(error, text)
        reason = f"did not expect {word!r} here" if word else "the formula ends too early"
        if "$END" in (getattr(error, "accepts", None) or ()):
            reason = f"unexpected {word!r} after the formula; AJPF would ignore the rest"
        raise Malformed(reason, at) from None
    return formula


class _Builder(Transformer):  # type: ignore[misc]
    """Makes the formula while the text is parsed, so that nothing recurses."""

    def row(self, parts: list[Any]) -> Formula:
        """One kind of operator at a level: a mixture is refused, as AJPF's precedences are not what people expect."""
        items, operators = parts[::2], parts[1::2]
        if not operators:
            return items[0]  # type: ignore[no-any-return]
        first = str(operators[0])
        for token in operators[1:]:
            if token != first:
                raise Malformed(
                    f"'{first}' and '{token}' without brackets: AJPF binds '||' tighter than '&', "
                    "'&' tighter than '->'; say which is meant",
                    token.start_pos,
                )
            if token in _BINARY:
                raise Malformed(f"'{token}' in a row: AJPF brackets to the left; say which is meant", token.start_pos)
        return _JUNCTIONS[first](tuple(items)) if first in _JUNCTIONS else _BINARY[first](*items)

    def unary(self, parts: list[Any]) -> Formula:
        *prefixes, formula = parts
        for outer, inner in pairwise(prefixes):
            if _UNARY[inner][1] >= _UNARY[outer][1]:
                raise Malformed(
                    f"'{outer}{inner}' loses an operator in AJPF: write {outer}({inner} …)", inner.start_pos
                )
        for prefix in reversed(prefixes):
            formula = _UNARY[prefix][0](formula)
        return formula  # type: ignore[no-any-return]

    def truth(self, parts: list[Token]) -> Formula:
        return psl.TRUE if parts[0] == "T" else psl.FALSE

    def modal(self, parts: list[Any]) -> Formula:
        modality, agent, fact = parts
        if agent in psl.KEYWORDS or not psl.AGENT_NAME.match(agent):
            raise Malformed(f"'{agent}' cannot be an agent's name in AJPF", agent.start_pos)
        return Atom(Modality(modality), str(agent), fact)

    def percept(self, parts: list[Any]) -> Formula:
        return Atom(Modality.PERCEPT, "", parts[1])

    def fact(self, parts: list[Any]) -> Struct:
        if not psl.AGENT_NAME.match(parts[0]):
            raise Malformed("expected a fact such as going(3)", parts[0].start_pos)
        return self.struct(parts)

    def struct(self, parts: list[Any]) -> Struct:
        name, *args = parts
        if name[0].isupper():
            raise Malformed("AJPF's properties know no named variables: write _", name.start_pos)
        return Struct(str(name), tuple(args))

    def shifted(self, parts: list[Token]) -> Struct:
        """An index and a whole number."""
        name, operator, number = parts
        if "." in number:
            raise Malformed("expected a whole number, as in i + 1", number.start_pos)
        return Struct(str(operator), (self.struct([name]), Struct(str(number))))

    def number(self, parts: list[Token]) -> Struct:
        return Struct(str(parts[0]))

    def negative(self, parts: list[Token]) -> Struct:
        raise Malformed("AJPF's properties know no negative numbers", parts[0].start_pos)

    def anything(self, parts: list[Token]) -> Var:
        return Var("_")


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

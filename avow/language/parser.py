"""Tokens to surface syntax, by Lark's LALR parser over grammar.lark.

Its input is a slice of the file's tokens (see `avow.language.outline`), and its callbacks build the trees directly.
It is iterative: no nesting, however deep, can exhaust the stack.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar, overload

from avow.base.grammars import lark_of
from avow.base.tuning.bounds import CHAIN
from avow.base.tuning.sizes import NESTING
from avow.language import syntax
from avow.language.lexer import Token
from avow.language.source import Reports
from avow.language.terms import Quantifier
from avow.language.topic_names import topic_names

QUANTIFIERS = {"FORALL": Quantifier.FORALL, "EXISTS": Quantifier.EXISTS, "UNIQUE": Quantifier.UNIQUE}
STARTS = ("declaration", "ports", "topics", "formula")


@overload
def parse(
    start: Literal["declaration"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> syntax.Declaration | None: ...


@overload
def parse(
    start: Literal["ports"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> syntax.PortList | None: ...


@overload
def parse(
    start: Literal["topics"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> syntax.TopicList | None: ...


@overload
def parse(
    start: Literal["formula"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> syntax.TermSyntax | None: ...


def parse(
    start: str, tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> syntax.Syntax | None:
    """The tree of one part of a file, which stands between the offsets `begin` (of its first token, where not given)
    and `end`. Reports the first error, unless it follows from what the lexer had to leave out or guess; then None."""
    if start == "topics":
        tokens = topic_names(tokens)
    tree = _run(_tables(start), tokens, Token("$END", "", end, end))
    if begin is None:
        begin = tokens[0].start if tokens else end
    if isinstance(tree, Token):
        at = next((i for i, t in enumerate(tokens) if t is tree), len(tokens))
        guessed = any(t.start in reports.odd for t in tokens[max(at - 1, 0) : at + 1])
        guessed = guessed or any(t.type == "UPTO" and t.start in reports.odd for t in tokens[at + 1 : at + 2])
        if not guessed and not reports.is_torn(begin, tree.end):
            from avow.language.expectations import explain

            explain(start, tokens, at, tree, _accepted(start, tokens, tree), reports)
        return None
    if start in ("formula", "topics") and reports.is_torn(begin, end):
        return None  # what it says would be something else
    if tree.depth > NESTING:
        reports.error(
            "RCL110",
            f"this is nested {tree.depth} levels deep; {NESTING} is the most",
            tree.start,
            min(tree.end, tree.start + 1),
            hint="split the clause, or name its parts",
        )
        return None
    return tree


class _Tables(NamedTuple):
    """Lark's LALR tables of one start symbol, made ready for the loop below."""

    first: int
    last: int
    shifts: dict[int, dict[str, int]]
    reductions: dict[int, dict[str, tuple[int, str, Callable[[list[Any]], Any] | None]]]
    """State → terminal → (how many values, the rule's symbol, its callback; None: the one value stays as it is)."""
    gotos: dict[int, dict[str, int]]


def _run(tables: _Tables, tokens: Iterable[Token], end: Token) -> syntax.Syntax | Token:
    """The LALR automaton, on Lark's tables. (Lark's own loop does the same and takes three times as long: it calls a
    function for every token, and makes a list and two calls for each of the many reductions that change nothing.)
    Gives the token where it cannot go on."""
    _, last, shifts, reductions, gotos = tables
    state = tables.first
    states, values = [state], list[Any]()
    for token in (*tokens, end):
        kind = token.type
        while True:
            following = shifts[state].get(kind)
            if following is not None:
                states.append(following)
                values.append(token)
                state = following
                break
            reduction = reductions[state].get(kind)
            if reduction is None:
                if token is end and state == last:
                    break
                return token
            size, symbol, callback = reduction
            if callback is None:
                states.pop()
            elif size:
                children = values[-size:]
                del states[-size:]
                del values[-size:]
                values.append(callback(children))
            else:
                values.append(callback([]))
            state = gotos[states[-1]][symbol]
            states.append(state)
            if token is end and state == last:
                break
    tree: syntax.Syntax = values[-1]
    return tree


@functools.cache
def _tables(start: str) -> _Tables:
    from lark.parsers.lalr_analysis import Shift

    state = _lark().parse_interactive("", start=start).parser_state
    configuration = state.parse_conf
    shifts: dict[int, dict[str, int]] = {}
    gotos: dict[int, dict[str, int]] = {}
    reductions: dict[int, dict[str, tuple[int, str, Callable[[list[Any]], Any] | None]]] = {}
    for number, actions in configuration.states.items():
        shifts[number], gotos[number], reductions[number] = {}, {}, {}
        for symbol, (action, argument) in actions.items():
            if action is Shift:
                target = shifts if symbol.isupper() or symbol == "$END" else gotos
                target[number][symbol] = argument
                continue
            size = len(argument.expansion)
            stays = size == 1 and argument.options.expand1 and argument.alias is None
            callback = None if stays else configuration.callbacks[argument]
            reductions[number][symbol] = (size, argument.origin.name, callback)
    return _Tables(configuration.start_state, configuration.end_state, shifts, reductions, gotos)


def _accepted(start: str, tokens: Iterable[Token], bad: Token) -> frozenset[str]:
    """The terminals that could stand in the place of the bad token."""
    machine = _lark().parse_interactive("", start=start)
    for token in tokens:
        if token is bad:
            break
        machine.parser_state.feed_token(token)
    return frozenset(machine.accepts())


def _lark() -> Any:
    return lark_of(Path(__file__).with_name("grammar.lark"), "rcl", STARTS, _Build, maybe_placeholders=False)


def _deepest(parts: Iterable[Any]) -> int:
    deepest: int = max([part.depth for part in parts])
    return deepest + 1


def _chain_depth(operands: Sequence[Any]) -> int:
    """A chain of operators counts as deep as its term becomes."""
    return _deepest(operands) - 1 + min(len(operands) - 1, CHAIN)


_Binders = tuple[syntax.Binder, ...]
_Made = TypeVar("_Made")
_Callback = Callable[["_Build", list[Any]], _Made]


def _word(kind: Callable[[int, int, int, str], _Made]) -> _Callback[_Made]:
    """What one word says by its text."""
    return lambda _, c: kind(c[0].start, c[0].end, 1, c[0].text)


def _listed(kind: Callable[[int, int, int, tuple[Any, ...]], _Made]) -> _Callback[_Made]:
    """What stands between brackets, with commas."""
    return lambda _, c: kind(c[0].start, c[-1].end, _deepest(c[1:-1:2]) if c[1:-1] else 1, tuple(c[1:-1:2]))


def _joined(sign: syntax.Sign, depth: Callable[[Sequence[Any]], int]) -> _Callback[syntax.Connective]:
    """Formulas with a sign between them."""
    return lambda _, c: syntax.Connective(c[0].start, c[-1].end, depth(c[::2]), sign, tuple(c[::2]))


class _Build:
    """A callback per alias of the grammar; its argument is the list of tokens and trees of the rule."""

    # --- declarations ------------------------------------------------------------------------------------------------

    def type_declaration(self, c: list[Any]) -> syntax.TypeDeclaration:
        return syntax.TypeDeclaration(c[0].start, c[2].end, c[2].depth + 1, c[0], c[2])

    def constant_declaration(self, c: list[Any]) -> syntax.ConstantDeclaration:
        return syntax.ConstantDeclaration(c[0].start, c[2].end, c[2].depth + 1, c[0], c[2])

    def plain_definition(self, c: list[Any]) -> syntax.Define:
        return syntax.Define(c[0].start, c[3].end, c[3].depth + 1, c[1], (), c[3])

    def definition(self, c: list[Any]) -> syntax.Define:
        return syntax.Define(c[0].start, c[6].end, _deepest((c[3], c[6])), c[1], c[3].items, c[6])

    def ports(self, c: list[Any]) -> syntax.PortList:
        ports = tuple(port for group in c[::2] for port in group)
        return (
            syntax.PortList(ports[0].start, ports[-1].end, _deepest(ports), ports)
            if c
            else syntax.PortList(0, 0, 1, ())
        )

    def port(self, c: list[Any]) -> tuple[syntax.PortDeclaration, ...]:
        """``a, b : BOOL``: each name with the type."""
        return tuple(syntax.PortDeclaration(name.start, c[-1].end, c[-1].depth + 1, name, c[-1]) for name in c[:-2:2])

    def topics(self, c: list[Any]) -> syntax.TopicList:
        return (
            syntax.TopicList(c[0].start, c[-1].end, _deepest(c[::2]), tuple(c[::2]))
            if c
            else syntax.TopicList(0, 0, 1, ())
        )

    def plain_topic(self, c: list[Any]) -> syntax.TopicDeclaration:
        return syntax.TopicDeclaration(c[0].start, c[-1].end, 2, c[0], c[1], None, None)

    def bare_topic(self, c: list[Any]) -> syntax.TopicDeclaration:
        return syntax.TopicDeclaration(c[0].start, c[-1].end, 2, c[0], c[1], None, c[4])

    def matched_topic(self, c: list[Any]) -> syntax.TopicDeclaration:
        return syntax.TopicDeclaration(c[0].start, c[-1].end, 2, c[0], c[1], c[4].text, c[6])

    def ros_type(self, c: list[Any]) -> syntax.RosType:
        return syntax.RosType(c[0].start, c[-1].end, 1, tuple(c[::2]))

    # --- types -------------------------------------------------------------------------------------------------------

    def function_type(self, c: list[Any]) -> syntax.FunctionType:
        return syntax.FunctionType(c[0].start, c[2].end, max(c[0].depth, c[2].depth) + 1, c[0], c[2])

    def product_type(self, c: list[Any]) -> syntax.ProductType:
        return syntax.ProductType(c[0].start, c[-1].end, _deepest(c[::2]), tuple(c[::2]), tuple(c[1::2]))

    def unspecified_type(self, c: list[Any]) -> syntax.UnspecifiedType:
        return syntax.UnspecifiedType(c[0].start, c[1].end, 1)

    def sequence_type(self, c: list[Any]) -> syntax.SequenceType:
        return syntax.SequenceType(c[0].start, c[-1].end, c[1].depth + 1, c[1])

    def record_type(self, c: list[Any]) -> syntax.RecordType:
        fields = tuple(port for group in c[1:-1:2] for port in group)
        return syntax.RecordType(c[0].start, c[-1].end, _deepest(fields), fields)

    def plain_element(self, c: list[Any]) -> syntax.Element:
        return syntax.Element(c[0].start, c[0].end, 1, c[0], ())

    def constructor(self, c: list[Any]) -> syntax.Element:
        return syntax.Element(c[0].start, c[-1].end, _deepest(c[2:-1:2]), c[0], tuple(c[2:-1:2]))

    # --- formulas and terms ------------------------------------------------------------------------------------------

    iff, implies = _joined(syntax.Sign.IFF, _chain_depth), _joined(syntax.Sign.IMPLIES, _chain_depth)
    disjunction, conjunction = _joined(syntax.Sign.OR, _deepest), _joined(syntax.Sign.AND, _deepest)

    def negation(self, c: list[Any]) -> syntax.Negation:
        return syntax.Negation(c[0].start, c[1].end, c[1].depth + 1, c[1])

    def comparison(self, c: list[Any]) -> syntax.Comparison:
        return syntax.Comparison(c[0].start, c[-1].end, _deepest(c[::2]), tuple(c[::2]), tuple(c[1::2]))

    def arithmetic(self, c: list[Any]) -> syntax.Calculation:
        operands = tuple(c[::2])
        return syntax.Calculation(c[0].start, c[-1].end, _chain_depth(operands), operands, tuple(c[1::2]))

    def negative(self, c: list[Any]) -> syntax.Minus:
        return syntax.Minus(c[0].start, c[1].end, c[1].depth + 1, c[1])

    def application(self, c: list[Any]) -> syntax.Application:
        arguments = tuple(c[2:-1:2])
        return syntax.Application(c[0].start, c[-1].end, _deepest((c[0], *arguments)), c[0], arguments)

    name, builtin, number = _word(syntax.Name), _word(syntax.BuiltinName), _word(syntax.Number)
    string, named_type, builtin_type = _word(syntax.Text), _word(syntax.NamedType), _word(syntax.BuiltinType)

    def truth(self, c: list[Any]) -> syntax.Truth:
        return syntax.Truth(c[0].start, c[0].end, 1, c[0].text == "TRUE")

    def port_name(self, c: list[Any]) -> syntax.PortName:
        return syntax.PortName(c[0].start, c[2].end, 1, c[0].text, c[2].text)

    def node_port(self, c: list[Any]) -> syntax.NodePort:
        role = c[2].text if len(c) == 5 else None
        return syntax.NodePort(c[0].start, c[-1].end, 1, c[0].text, role, c[-1].text)

    def field(self, c: list[Any]) -> syntax.FieldOf:
        return syntax.FieldOf(c[0].start, c[2].end, c[0].depth + 1, c[0], c[2])

    def parenthesised(self, c: list[Any]) -> syntax.Parentheses:
        inner = c[1].body if type(c[1]) is syntax.Parentheses else c[1]
        return syntax.Parentheses(c[0].start, c[2].end, c[1].depth + 1, inner)

    tuple, set, sequence = _listed(syntax.TupleDisplay), _listed(syntax.SetDisplay), _listed(syntax.SequenceDisplay)
    tuple_type, set_type = _listed(syntax.TupleType), _listed(syntax.SetType)

    def range(self, c: list[Any]) -> syntax.RangeDisplay:
        return syntax.RangeDisplay(c[0].start, c[4].end, max(c[1].depth, c[3].depth) + 1, c[1], c[3])

    def quantified(self, c: list[Any]) -> syntax.Quantification:
        binders: _Binders = c[2]
        depth = max(_deepest(binders) + 1, c[4].depth + 1)
        return syntax.Quantification(c[0].start, c[5].end, depth, QUANTIFIERS[c[0].type], binders, c[4])

    def if_then_else(self, c: list[Any]) -> syntax.IfThenElse:
        return syntax.IfThenElse(c[0].start, c[5].end, _deepest(c[1::2]), c[1], c[3], c[5])

    def quantity(self, c: list[Any]) -> syntax.Quantity:
        return syntax.Quantity(c[0].start, c[1].end, 1, c[0].text, c[1])

    def since(self, c: list[Any]) -> syntax.Lasting:
        return syntax.Lasting(c[0].start, c[2].end, _deepest(c[::2]), c[1].text, c[0], None, c[2])

    until = since

    def ahead(self, c: list[Any]) -> syntax.Ahead:
        return syntax.Ahead(
            c[0].start, c[1].end, c[1].depth + 1, syntax.Name(c[0].start, c[0].end, 1, c[0].text), (c[1],)
        )

    def limited_since(self, c: list[Any]) -> syntax.Lasting:
        return syntax.Lasting(c[0].start, c[3].end, _deepest((c[0], *c[2:])), c[1].text, c[0], c[2], c[3])

    def limited(self, c: list[Any]) -> syntax.Limited:
        arguments = tuple(c[3:-1:2])
        return syntax.Limited(c[0].start, c[-1].end, _deepest((c[1], *arguments)), c[0], c[1], arguments)

    def pace(self, c: list[Any]) -> syntax.PaceSyntax:
        length = syntax.Quantity(c[-3].start, c[-2].end, 1, c[-3].text, c[-2])
        return syntax.PaceSyntax(c[0].start, c[-1].end, c[0].depth + 1, c[0], tuple(c[2:-3]), length)

    def plain_limit(self, c: list[Any]) -> syntax.LimitSyntax:
        return syntax.LimitSyntax(c[0].start, c[2].end, c[1].depth + 1, "", c[1], None)

    def related_limit(self, c: list[Any]) -> syntax.LimitSyntax:
        return syntax.LimitSyntax(c[0].start, c[3].end, c[2].depth + 1, c[1].text, c[2], None)

    def named_limit(self, c: list[Any]) -> syntax.LimitSyntax:
        return syntax.LimitSyntax(c[0].start, c[3].end, c[1].depth + 1, "", c[1], c[2])

    def related_named_limit(self, c: list[Any]) -> syntax.LimitSyntax:
        return syntax.LimitSyntax(c[0].start, c[4].end, c[2].depth + 1, c[1].text, c[2], c[3])

    def binders(self, c: list[Any]) -> _Binders:
        return tuple(c[::2])

    def binder(self, c: list[Any]) -> syntax.Binder:
        return syntax.Binder(c[0].start, c[-1].end, c[-1].depth + 1, tuple(c[:-2:2]), c[-1])

"""Tokens to surface syntax, by Lark's LALR parser over grammar.lark.

Its input is a slice of the file's tokens (see `avow.language.outline`), and its callbacks build the trees directly.
It is iterative: no nesting, however deep, can exhaust the stack.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, overload

from avow.base.grammars import lark_of
from avow.base.tuning.bounds import CHAIN
from avow.base.tuning.sizes import NESTING
from avow.language.lexer import Token
from avow.language.source import Reports
from avow.language.syntax import (
    Ahead,
    Application,
    Binder,
    BuiltinName,
    BuiltinType,
    Calculation,
    Comparison,
    Connective,
    ConstantDeclaration,
    Declaration,
    Define,
    Element,
    FieldOf,
    FunctionType,
    IfThenElse,
    Lasting,
    Limited,
    LimitSyntax,
    Minus,
    Name,
    NamedType,
    Negation,
    NodePort,
    Number,
    PaceSyntax,
    Parentheses,
    PortDeclaration,
    PortList,
    PortName,
    ProductType,
    Quantification,
    Quantity,
    RangeDisplay,
    RecordType,
    RosType,
    SequenceDisplay,
    SequenceType,
    SetDisplay,
    SetType,
    Sign,
    Syntax,
    TermSyntax,
    Text,
    TopicDeclaration,
    TopicList,
    Truth,
    TupleDisplay,
    TupleType,
    TypeDeclaration,
    UnspecifiedType,
)
from avow.language.terms import Quantifier
from avow.language.topic_names import topic_names

QUANTIFIERS = {"FORALL": Quantifier.FORALL, "EXISTS": Quantifier.EXISTS, "UNIQUE": Quantifier.UNIQUE}
STARTS = ("declaration", "ports", "topics", "formula")


@overload
def parse(
    start: Literal["declaration"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> Declaration | None: ...


@overload
def parse(
    start: Literal["ports"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> PortList | None: ...


@overload
def parse(
    start: Literal["topics"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> TopicList | None: ...


@overload
def parse(
    start: Literal["formula"], tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None
) -> TermSyntax | None: ...


def parse(start: str, tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None) -> Syntax | None:
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


def _run(tables: _Tables, tokens: Iterable[Token], end: Token) -> Syntax | Token:
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
    tree: Syntax = values[-1]
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


_Binders = tuple[Binder, ...]


class _Build:
    """A callback per alias of the grammar; its argument is the list of tokens and trees of the rule."""

    # --- declarations ------------------------------------------------------------------------------------------------

    def type_declaration(self, c: list[Any]) -> TypeDeclaration:
        return TypeDeclaration(c[0].start, c[2].end, c[2].depth + 1, c[0], c[2])

    def constant_declaration(self, c: list[Any]) -> ConstantDeclaration:
        return ConstantDeclaration(c[0].start, c[2].end, c[2].depth + 1, c[0], c[2])

    def plain_definition(self, c: list[Any]) -> Define:
        return Define(c[0].start, c[3].end, c[3].depth + 1, c[1], (), c[3])

    def definition(self, c: list[Any]) -> Define:
        return Define(c[0].start, c[6].end, _deepest((c[3], c[6])), c[1], c[3].items, c[6])

    def ports(self, c: list[Any]) -> PortList:
        ports = tuple(port for group in c[::2] for port in group)
        return PortList(ports[0].start, ports[-1].end, _deepest(ports), ports) if c else PortList(0, 0, 1, ())

    def port(self, c: list[Any]) -> tuple[PortDeclaration, ...]:
        """``a, b : BOOL``: each name with the type."""
        return tuple(PortDeclaration(name.start, c[-1].end, c[-1].depth + 1, name, c[-1]) for name in c[:-2:2])

    def topics(self, c: list[Any]) -> TopicList:
        return TopicList(c[0].start, c[-1].end, _deepest(c[::2]), tuple(c[::2])) if c else TopicList(0, 0, 1, ())

    def plain_topic(self, c: list[Any]) -> TopicDeclaration:
        return TopicDeclaration(c[0].start, c[-1].end, 2, c[0], c[1], None, None)

    def bare_topic(self, c: list[Any]) -> TopicDeclaration:
        return TopicDeclaration(c[0].start, c[-1].end, 2, c[0], c[1], None, c[4])

    def matched_topic(self, c: list[Any]) -> TopicDeclaration:
        return TopicDeclaration(c[0].start, c[-1].end, 2, c[0], c[1], c[4].text, c[6])

    def ros_type(self, c: list[Any]) -> RosType:
        return RosType(c[0].start, c[-1].end, 1, tuple(c[::2]))

    # --- types -------------------------------------------------------------------------------------------------------

    def function_type(self, c: list[Any]) -> FunctionType:
        return FunctionType(c[0].start, c[2].end, max(c[0].depth, c[2].depth) + 1, c[0], c[2])

    def product_type(self, c: list[Any]) -> ProductType:
        return ProductType(c[0].start, c[-1].end, _deepest(c[::2]), tuple(c[::2]), tuple(c[1::2]))

    def named_type(self, c: list[Any]) -> NamedType:
        return NamedType(c[0].start, c[0].end, 1, c[0].text)

    def builtin_type(self, c: list[Any]) -> BuiltinType:
        return BuiltinType(c[0].start, c[0].end, 1, c[0].text)

    def unspecified_type(self, c: list[Any]) -> UnspecifiedType:
        return UnspecifiedType(c[0].start, c[1].end, 1)

    def set_type(self, c: list[Any]) -> SetType:
        return SetType(c[0].start, c[-1].end, _deepest(c[1:-1:2]), tuple(c[1:-1:2]))

    def tuple_type(self, c: list[Any]) -> TupleType:
        return TupleType(c[0].start, c[-1].end, _deepest(c[1:-1:2]), tuple(c[1:-1:2]))

    def sequence_type(self, c: list[Any]) -> SequenceType:
        return SequenceType(c[0].start, c[-1].end, c[1].depth + 1, c[1])

    def record_type(self, c: list[Any]) -> RecordType:
        fields = tuple(port for group in c[1:-1:2] for port in group)
        return RecordType(c[0].start, c[-1].end, _deepest(fields), fields)

    def plain_element(self, c: list[Any]) -> Element:
        return Element(c[0].start, c[0].end, 1, c[0], ())

    def constructor(self, c: list[Any]) -> Element:
        return Element(c[0].start, c[-1].end, _deepest(c[2:-1:2]), c[0], tuple(c[2:-1:2]))

    # --- formulas and terms ------------------------------------------------------------------------------------------

    def iff(self, c: list[Any]) -> Connective:
        items = tuple(c[::2])
        return Connective(c[0].start, c[-1].end, _chain_depth(items), Sign.IFF, items)

    def implies(self, c: list[Any]) -> Connective:
        items = tuple(c[::2])
        return Connective(c[0].start, c[-1].end, _chain_depth(items), Sign.IMPLIES, items)

    def disjunction(self, c: list[Any]) -> Connective:
        items = tuple(c[::2])
        return Connective(c[0].start, c[-1].end, _deepest(items), Sign.OR, items)

    def conjunction(self, c: list[Any]) -> Connective:
        items = tuple(c[::2])
        return Connective(c[0].start, c[-1].end, _deepest(items), Sign.AND, items)

    def negation(self, c: list[Any]) -> Negation:
        return Negation(c[0].start, c[1].end, c[1].depth + 1, c[1])

    def comparison(self, c: list[Any]) -> Comparison:
        return Comparison(c[0].start, c[-1].end, _deepest(c[::2]), tuple(c[::2]), tuple(c[1::2]))

    def arithmetic(self, c: list[Any]) -> Calculation:
        operands = tuple(c[::2])
        return Calculation(c[0].start, c[-1].end, _chain_depth(operands), operands, tuple(c[1::2]))

    def negative(self, c: list[Any]) -> Minus:
        return Minus(c[0].start, c[1].end, c[1].depth + 1, c[1])

    def application(self, c: list[Any]) -> Application:
        arguments = tuple(c[2:-1:2])
        return Application(c[0].start, c[-1].end, _deepest((c[0], *arguments)), c[0], arguments)

    def name(self, c: list[Any]) -> Name:
        return Name(c[0].start, c[0].end, 1, c[0].text)

    def builtin(self, c: list[Any]) -> BuiltinName:
        return BuiltinName(c[0].start, c[0].end, 1, c[0].text)

    def number(self, c: list[Any]) -> Number:
        return Number(c[0].start, c[0].end, 1, c[0].text)

    def string(self, c: list[Any]) -> Text:
        return Text(c[0].start, c[0].end, 1, c[0].text)

    def truth(self, c: list[Any]) -> Truth:
        return Truth(c[0].start, c[0].end, 1, c[0].text == "TRUE")

    def port_name(self, c: list[Any]) -> PortName:
        return PortName(c[0].start, c[2].end, 1, c[0].text, c[2].text)

    def node_port(self, c: list[Any]) -> NodePort:
        role = c[2].text if len(c) == 5 else None
        return NodePort(c[0].start, c[-1].end, 1, c[0].text, role, c[-1].text)

    def field(self, c: list[Any]) -> FieldOf:
        return FieldOf(c[0].start, c[2].end, c[0].depth + 1, c[0], c[2])

    def parenthesised(self, c: list[Any]) -> Parentheses:
        inner = c[1].body if type(c[1]) is Parentheses else c[1]
        return Parentheses(c[0].start, c[2].end, c[1].depth + 1, inner)

    def tuple(self, c: list[Any]) -> TupleDisplay:
        return TupleDisplay(c[0].start, c[-1].end, _deepest(c[1:-1:2]), tuple(c[1:-1:2]))

    def set(self, c: list[Any]) -> SetDisplay:
        items = tuple(c[1:-1:2])
        return SetDisplay(c[0].start, c[-1].end, _deepest(items) if items else 1, items)

    def sequence(self, c: list[Any]) -> SequenceDisplay:
        items = tuple(c[1:-1:2])
        return SequenceDisplay(c[0].start, c[-1].end, _deepest(items) if items else 1, items)

    def range(self, c: list[Any]) -> RangeDisplay:
        return RangeDisplay(c[0].start, c[4].end, max(c[1].depth, c[3].depth) + 1, c[1], c[3])

    def quantified(self, c: list[Any]) -> Quantification:
        binders: _Binders = c[2]
        depth = max(_deepest(binders) + 1, c[4].depth + 1)
        return Quantification(c[0].start, c[5].end, depth, QUANTIFIERS[c[0].type], binders, c[4])

    def if_then_else(self, c: list[Any]) -> IfThenElse:
        return IfThenElse(c[0].start, c[5].end, _deepest(c[1::2]), c[1], c[3], c[5])

    def quantity(self, c: list[Any]) -> Quantity:
        return Quantity(c[0].start, c[1].end, 1, c[0].text, c[1])

    def since(self, c: list[Any]) -> Lasting:
        return Lasting(c[0].start, c[2].end, _deepest(c[::2]), c[1].text, c[0], None, c[2])

    until = since

    def ahead(self, c: list[Any]) -> Ahead:
        return Ahead(c[0].start, c[1].end, c[1].depth + 1, Name(c[0].start, c[0].end, 1, c[0].text), (c[1],))

    def limited_since(self, c: list[Any]) -> Lasting:
        return Lasting(c[0].start, c[3].end, _deepest((c[0], *c[2:])), c[1].text, c[0], c[2], c[3])

    def limited(self, c: list[Any]) -> Limited:
        arguments = tuple(c[3:-1:2])
        return Limited(c[0].start, c[-1].end, _deepest((c[1], *arguments)), c[0], c[1], arguments)

    def pace(self, c: list[Any]) -> PaceSyntax:
        length = Quantity(c[-3].start, c[-2].end, 1, c[-3].text, c[-2])
        return PaceSyntax(c[0].start, c[-1].end, c[0].depth + 1, c[0], tuple(c[2:-3]), length)

    def plain_limit(self, c: list[Any]) -> LimitSyntax:
        return LimitSyntax(c[0].start, c[2].end, c[1].depth + 1, "", c[1], None)

    def related_limit(self, c: list[Any]) -> LimitSyntax:
        return LimitSyntax(c[0].start, c[3].end, c[2].depth + 1, c[1].text, c[2], None)

    def named_limit(self, c: list[Any]) -> LimitSyntax:
        return LimitSyntax(c[0].start, c[3].end, c[1].depth + 1, "", c[1], c[2])

    def related_named_limit(self, c: list[Any]) -> LimitSyntax:
        return LimitSyntax(c[0].start, c[4].end, c[2].depth + 1, c[1].text, c[2], c[3])

    def binders(self, c: list[Any]) -> _Binders:
        return tuple(c[::2])

    def binder(self, c: list[Any]) -> Binder:
        return Binder(c[0].start, c[-1].end, c[-1].depth + 1, tuple(c[:-2:2]), c[-1])

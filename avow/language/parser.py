"""Tokens to surface syntax, by Lark's LALR parser over grammar.lark.

Its input is a slice of the file's tokens (see `avow.language.outline`), and its callbacks build the trees directly.
It is iterative: no nesting, however deep, can exhaust the stack.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal, TypeVar, get_args

from avow.base.grammars import lark_of
from avow.base.tuning.sizes import NESTING
from avow.language import syntax
from avow.language.expectations import explain
from avow.language.lexer import KEYWORDS, Token
from avow.language.source import Reports
from avow.language.terms import Quantifier

QUANTIFIERS = {"FORALL": Quantifier.FORALL, "EXISTS": Quantifier.EXISTS, "UNIQUE": Quantifier.UNIQUE}
Start = Literal["declaration", "ports", "given", "topics", "formula"]


def parse(start: Start, tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None) -> Any:
    """The tree of one part of a file (a declaration, a list of ports or topics, a formula), between the offsets `begin`
    (by default its first token's) and `end`. Returns None after an error, and reports the first unless it follows from
    text that the lexer skipped or guessed."""
    from lark.exceptions import UnexpectedToken  # Lark takes long to import, and most runs parse nothing

    if start == "topics":
        tokens = _topic_names(tokens)
    if begin is None:
        begin = tokens[0].start if tokens else end
    last = Token("$END", "", end, end)
    state = _lark().parse_interactive("", start=start).parser_state
    try:
        for token in (*tokens, last):
            tree = state.feed_token(token, is_end=token is last)
    except UnexpectedToken as error:
        bad = error.token
        at = next((i for i, token in enumerate(tokens) if token is bad), len(tokens))
        guessed = any(token.start in reports.odd for token in tokens[max(at - 1, 0) : at + 1])
        if not guessed and not reports.is_torn(begin, bad.end):
            explain(start, tokens, at, bad, _accepted(start, tokens[:at]), reports)
        return None
    if start in ("formula", "topics") and reports.is_torn(begin, end):
        return None  # its meaning would be wrong
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


def _accepted(start: str, tokens: Iterable[Token]) -> frozenset[str]:
    """The terminals that may follow these tokens. (Lark reduces as far as possible before it finds an error, so the
    state of the failed parser accepts less.)"""
    machine = _lark().parse_interactive("", start=start)
    for token in tokens:
        machine.parser_state.feed_token(token)
    return frozenset(machine.accepts())


def _topic(c: list[Any], matched: list[Any]) -> syntax.TopicDeclaration:
    frame = c[3] if len(c) - len(matched) > 2 else None
    role, port = (matched[2].text if len(matched) > 4 else None, matched[-2]) if matched else (None, None)
    return _made(syntax.TopicDeclaration, c, c[0], c[1], role, port, frame)


def _callbacks() -> SimpleNamespace:
    return SimpleNamespace(**_CALLBACKS)


def _lark() -> Any:
    return lark_of(
        Path(__file__).with_name("grammar.lark"), "rcl", get_args(Start), _callbacks, maybe_placeholders=False
    )


_Made = TypeVar("_Made")


def _made(kind: Callable[..., _Made], c: Sequence[Any], *fields: Any) -> _Made:
    """A tree that spans a rule's tokens and trees, one level above the deepest of them."""
    depth = max([part.depth for part in c if type(part) is not Token], default=0)
    return kind(c[0].start, c[-1].end, depth + 1, *fields)


def _word(kind: Callable[[int, int, int, str], _Made]) -> Callable[[list[Any]], _Made]:
    """A callback for a tree of one token, with its text."""
    return lambda c: kind(c[0].start, c[0].end, 1, c[0].text)


def _chain(kind: Callable[..., _Made], c: list[Any], *fields: Any) -> _Made:
    """A tree of operands with signs between them; its depth is that of the resulting term."""
    depth = max([part.depth for part in c[::2]]) + len(c) // 2
    return kind(c[0].start, c[-1].end, depth, *fields)


def _listed(kind: Callable[..., _Made]) -> Callable[[list[Any]], _Made]:
    """A callback for a list between brackets, separated by commas."""
    return lambda c: _made(kind, c, tuple(c[1:-1:2]))


def _joined(sign: syntax.Sign) -> Callable[[list[Any]], syntax.Connective]:
    """A callback for formulas with a sign between them."""
    return lambda c: _made(syntax.Connective, c, sign, tuple(c[::2]))


def _implied(sign: syntax.Sign) -> Callable[[list[Any]], syntax.Connective]:
    """As `_joined`, for a sign whose chain becomes a deep term."""
    return lambda c: _chain(syntax.Connective, c, sign, tuple(c[::2]))


def _ports(groups: Iterable[Sequence[syntax.PortDeclaration]]) -> tuple[syntax.PortDeclaration, ...]:
    return tuple(port for group in groups for port in group)


def _port_list(c: list[Any]) -> syntax.PortList:
    ports = _ports(c[::2])
    return _made(syntax.PortList, ports, ports) if ports else syntax.PortList(0, 0, 1, ())


def _record(c: list[Any]) -> syntax.RecordType:
    fields = _ports(c[1:-1:2])
    return _made(syntax.RecordType, (c[0], *fields, c[-1]), fields)


def _parenthesised(c: list[Any]) -> syntax.Parentheses:
    inner = c[1].body if type(c[1]) is syntax.Parentheses else c[1]
    return _made(syntax.Parentheses, c, inner)


def _limit(c: list[Any]) -> syntax.LimitSyntax:
    relation = c[1].text if type(c[1]) is Token else ""
    unit = c[-2] if type(c[-2]) is Token else None
    return _made(syntax.LimitSyntax, c, relation, c[2] if relation else c[1], unit)


def _pace(c: list[Any]) -> syntax.PaceSyntax:
    length = syntax.Quantity(c[-3].start, c[-2].end, 1, c[-3].text, c[-2])
    return _made(syntax.PaceSyntax, c, c[0], tuple(c[2:-3]), length)


_CALLBACKS: dict[str, Callable[[list[Any]], Any]] = {
    "type_declaration": lambda c: _made(syntax.TypeDeclaration, c, c[0], c[2]),
    "constant_declaration": lambda c: _made(syntax.ConstantDeclaration, c, c[0], c[2]),
    "definition": lambda c: _made(syntax.Define, c, c[1], c[3].items if len(c) > 4 else (), c[-1]),
    "ports": _port_list,
    "port_in": lambda c: tuple(
        replace(_made(syntax.PortDeclaration, (name, c[-3]), name, c[-3]), end=c[-1].end, unit=c[-1])
        for name in c[:-4:2]
    ),
    "unit": lambda c: Token("NAME", "".join(token.text for token in c), c[0].start, c[-1].end),
    "given": _port_list,
    "parameter": lambda c: tuple(replace(port, marker=c[0]) for port in c[1]),
    "port": lambda c: tuple(_made(syntax.PortDeclaration, (name, c[-1]), name, c[-1]) for name in c[:-2:2]),
    "topics": lambda c: _made(syntax.TopicList, c, tuple(c[::2])) if c else syntax.TopicList(0, 0, 1, ()),
    "topic": lambda c: _topic(c, c[2:] if len(c) < 3 or c[2].type != "IN" else c[4:]),
    "ros_type": lambda c: _made(syntax.RosType, c, tuple(c[::2])),
    # types
    "function_type": lambda c: _made(syntax.FunctionType, c, c[0], c[2]),
    "product_type": lambda c: _made(syntax.ProductType, c, tuple(c[::2]), tuple(c[1::2])),
    "named_type": _word(syntax.Name),
    "sequence_type": lambda c: _made(syntax.SequenceType, c, c[1]),
    "record_type": _record,
    "set_type": _listed(syntax.SetType),
    "tuple_type": _listed(syntax.TupleType),
    "element": lambda c: _made(syntax.Element, c, c[0], tuple(c[2:-1:2])),
    # formulas and terms
    "iff": _implied(syntax.Sign.IFF),
    "implies": _implied(syntax.Sign.IMPLIES),
    "disjunction": _joined(syntax.Sign.OR),
    "conjunction": _joined(syntax.Sign.AND),
    "negation": lambda c: _made(syntax.Negation, c, c[1]),
    "comparison": lambda c: _made(syntax.Comparison, c, tuple(c[::2]), tuple(c[1::2])),
    "arithmetic": lambda c: _chain(syntax.Calculation, c, tuple(c[::2]), tuple(c[1::2])),
    "negative": lambda c: _made(syntax.Minus, c, c[1]),
    "application": lambda c: _made(syntax.Application, c, c[0], tuple(c[2:-1:2])),
    "name": _word(syntax.Name),
    "number": _word(syntax.Number),
    "string": _word(syntax.Text),
    "truth": lambda c: _made(syntax.Truth, c, c[0].text == "TRUE"),
    "port_name": lambda c: _made(syntax.PortName, c, c[0].text, c[2].text),
    "node_port": lambda c: _made(syntax.NodePort, c, c[0].text, c[2].text if len(c) > 3 else None, c[-1].text),
    "field": lambda c: _made(syntax.FieldOf, c, c[0], c[2]),
    "parenthesised": _parenthesised,
    "tuple": _listed(syntax.TupleDisplay),
    "set": _listed(syntax.SetDisplay),
    "sequence": _listed(syntax.SequenceDisplay),
    "range": lambda c: _made(syntax.RangeDisplay, c, c[1], c[3]),
    "quantified": lambda c: _made(syntax.Quantification, c, QUANTIFIERS[c[0].type], tuple(c[2:-3:2]), c[-2]),
    "binder": lambda c: syntax.Binder(c[0].start, c[-1].end, c[-1].depth + 2, tuple(c[:-2:2]), c[-1]),
    "if_then_else": lambda c: _made(syntax.IfThenElse, c, c[1], c[3], c[5]),
    "quantity": lambda c: _made(syntax.Quantity, c, c[0].text, c[1]),
    "lasting": lambda c: _made(syntax.Lasting, c, c[1].text, c[0], c[2] if len(c) > 3 else None, c[-1]),
    "ahead": lambda c: _made(syntax.Ahead, c, syntax.Name(c[0].start, c[0].end, 1, c[0].text), (c[1],)),
    "limited": lambda c: _made(syntax.Limited, c, c[0], c[1], tuple(c[3:-1:2])),
    "limit": _limit,
    "pace": _pace,
}
"""The callback for the tokens and trees of each rule, by its name in the grammar."""


# --- names of topics --------------------------------------------------------------------------------------------------

_SEGMENTS = frozenset(("NAME", *KEYWORDS.values()))


def _topic_names(tokens: Sequence[Token]) -> list[Token]:
    """The tokens of a list of topics, each name that has several segments (`/robot1/scan`, `~scan`) as one NAME. White
    space separates type and name; a keyword is an ordinary segment (`/arm/in`)."""
    found: list[Token] = []
    runs = 0
    for run in _runs(tokens):
        if len(run) == 1 and run[0].type not in _SEGMENTS and run[0].type != "SLASH":
            runs = 0 if run[0].type in ("COMMA", "LPAR", "RPAR") else runs
            found += run
            continue
        runs += 1
        if runs == 2 and len(run) > 1:
            text = "".join(token.text for token in run)
            found.append(Token("NAME", text, run[0].start, run[-1].end))
        else:
            found += run
    return found


def _runs(tokens: Sequence[Token]) -> Iterator[list[Token]]:
    """Groups of adjacent segments and slashes; any other token by itself."""
    run: list[Token] = []
    for token in tokens:
        part = token.type in _SEGMENTS or token.type == "SLASH"
        if run and (not part or run[-1].end != token.start):
            yield run
            run = []
        if part:
            run.append(token)
        else:
            yield [token]
    if run:
        yield run

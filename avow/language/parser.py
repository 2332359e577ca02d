"""Tokens to surface syntax, by Lark's LALR parser over grammar.lark.

Its input is a slice of the file's tokens (see `avow.language.outline`), and its callbacks build `Tree`s directly. It is
iterative: no nesting, however deep, can exhaust the stack.
"""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from avow.language.chains import LONG
from avow.language.lexer import Token
from avow.language.source import Reports
from avow.language.syntax import Tree

MAX_DEPTH = 150
"""How deep a formula or type may be nested. Every later pass may recurse as deep as this. A chain of operators is no
nesting: its terms are made shallow by `avow.language.chains`."""

QUANTIFIERS = {"FORALL": "forall", "EXISTS": "exists", "UNIQUE": "exists_unique"}
STARTS = ("declaration", "ports", "topics", "formula")


def parse(start: str, tokens: Sequence[Token], reports: Reports, end: int, begin: int | None = None) -> Tree | None:
    """The tree of one part of a file, which stands between the offsets `begin` (of its first token, where not given)
    and `end`. Reports the first error, unless it follows from what the lexer had to leave out or guess; then None."""
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
    if tree.depth > MAX_DEPTH:
        reports.error(
            "RCL110",
            f"this is nested {tree.depth} levels deep; {MAX_DEPTH} is the most",
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


def _run(tables: _Tables, tokens: Iterable[Token], end: Token) -> Tree | Token:
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
    tree: Tree = values[-1]
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


@functools.cache
def _lark() -> Any:
    from lark import Lark

    grammar = Path(__file__).with_name("grammar.lark")
    options: dict[str, Any] = {
        "parser": "lalr",
        "lexer": "basic",
        "start": list(STARTS),
        "maybe_placeholders": False,
        "transformer": _Build(),
    }
    cache = _cache_file()
    if cache is not None:
        try:
            return Lark(grammar.read_text("utf-8"), cache=str(cache), **options)
        except (OSError, ValueError, EOFError, AttributeError, KeyError):
            pass
    return Lark(grammar.read_text("utf-8"), **options)


def _cache_file() -> Path | None:
    """Where the tables are kept between runs; a folder of the user's own, since Lark's cache is a pickle."""
    try:
        base = os.environ.get("XDG_CACHE_HOME")
        folder = (Path(base) if base else Path.home() / ".cache") / "avow"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.stat().st_uid != os.getuid() or not os.access(folder, os.W_OK):
            return None
    except (OSError, AttributeError, RuntimeError):
        return None
    return folder / f"rcl-{sys.version_info.major}{sys.version_info.minor}.lark"


def _chain(kind: str, parts: list[Any], operators: int) -> Tree:
    """A chain of operators counts as deep as its term becomes."""
    tree = _make(kind, tuple(parts), parts[0], parts[-1])
    return tree._replace(depth=tree.depth - 1 + min(operators, LONG))


def _make(kind: str, parts: tuple[Any, ...], first: Any, last: Any) -> Tree:
    depth = 0
    for part in parts:
        if type(part) is Tree and part.depth > depth:
            depth = part.depth
    return Tree(kind, parts, first.start, last.end, depth + 1)


class _Build:
    """A callback per alias of the grammar; its argument is the list of tokens and trees of the rule."""

    # --- declarations ------------------------------------------------------------------------------------------------

    def type_declaration(self, c: list[Any]) -> Tree:  # (name token, type)
        return _make("type", (c[0], c[2]), c[0], c[2])

    def constant_declaration(self, c: list[Any]) -> Tree:  # (name token, value)
        return _make("constant", (c[0], c[2]), c[0], c[2])

    def ports(self, c: list[Any]) -> Tree:  # (port, …)
        return _listing("ports", c)

    def port(self, c: list[Any]) -> Tree:  # (name token, type)
        return _make("port", (c[0], c[2]), c[0], c[2])

    def topics(self, c: list[Any]) -> Tree:  # (topic, …)
        return _listing("topics", c)

    def plain_topic(self, c: list[Any]) -> Tree:  # (ros type, name token, role or None, matched name token or None)
        return _make("topic", (c[0], c[1], None, None), c[0], c[-1])

    def bare_topic(self, c: list[Any]) -> Tree:
        return _make("topic", (c[0], c[1], None, c[4]), c[0], c[-1])

    def matched_topic(self, c: list[Any]) -> Tree:
        return _make("topic", (c[0], c[1], c[4].text, c[6]), c[0], c[-1])

    def ros_type(self, c: list[Any]) -> Tree:  # (name token, …) without the slashes
        return _make("ros_type", tuple(c[::2]), c[0], c[-1])

    # --- types -------------------------------------------------------------------------------------------------------

    def function_type(self, c: list[Any]) -> Tree:  # (parameters, result)
        return _make("function_type", (c[0], c[2]), c[0], c[2])

    def product_type(self, c: list[Any]) -> Tree:  # (type, x token, type, …)
        return _make("product_type", tuple(c), c[0], c[-1])

    def named_type(self, c: list[Any]) -> Tree:  # (name,)
        return Tree("named_type", (c[0].text,), c[0].start, c[0].end, 1)

    def builtin_type(self, c: list[Any]) -> Tree:  # (name,)
        return Tree("builtin_type", (c[0].text,), c[0].start, c[0].end, 1)

    def unspecified_type(self, c: list[Any]) -> Tree:
        return Tree("unspecified_type", (), c[0].start, c[1].end, 1)

    def set_type(self, c: list[Any]) -> Tree:  # (element, …)
        return _make("set_type", tuple(c[1:-1:2]), c[0], c[-1])

    def tuple_type(self, c: list[Any]) -> Tree:  # (type, …)
        return _make("tuple_type", tuple(c[1:-1:2]), c[0], c[-1])

    def sequence_type(self, c: list[Any]) -> Tree:  # (type,)
        return _make("sequence_type", (c[1],), c[0], c[-1])

    def plain_element(self, c: list[Any]) -> Tree:  # (name token,)
        return Tree("element", (c[0],), c[0].start, c[0].end, 1)

    def constructor(self, c: list[Any]) -> Tree:  # (name token, type, …)
        return _make("constructor", (c[0], *c[2:-1:2]), c[0], c[-1])

    # --- formulas and terms ------------------------------------------------------------------------------------------

    def iff(self, c: list[Any]) -> Tree:  # (formula, …)
        return _chain("iff", c[::2], len(c) // 2)

    def implies(self, c: list[Any]) -> Tree:  # (formula, …)
        return _chain("implies", c[::2], len(c) // 2)

    def disjunction(self, c: list[Any]) -> Tree:  # (formula, …)
        return _make("or", tuple(c[::2]), c[0], c[-1])

    def conjunction(self, c: list[Any]) -> Tree:  # (formula, …)
        return _make("and", tuple(c[::2]), c[0], c[-1])

    def negation(self, c: list[Any]) -> Tree:  # (formula,)
        return _make("not", (c[1],), c[0], c[1])

    def comparison(self, c: list[Any]) -> Tree:  # (term, relation token, term, …)
        return _make("comparison", tuple(c), c[0], c[-1])

    def arithmetic(self, c: list[Any]) -> Tree:  # (term, operator token, term, …)
        return _chain("arithmetic", c, len(c) // 2)

    def negative(self, c: list[Any]) -> Tree:  # (term,)
        return _make("negative", (c[1],), c[0], c[1])

    def application(self, c: list[Any]) -> Tree:  # (function, argument, …)
        return _make("application", (c[0], *c[2:-1:2]), c[0], c[-1])

    def name(self, c: list[Any]) -> Tree:  # (name,)
        return Tree("name", (c[0].text,), c[0].start, c[0].end, 1)

    def builtin(self, c: list[Any]) -> Tree:  # (name,)
        return Tree("builtin", (c[0].text,), c[0].start, c[0].end, 1)

    def number(self, c: list[Any]) -> Tree:  # (digits,)
        return Tree("number", (c[0].text,), c[0].start, c[0].end, 1)

    def string(self, c: list[Any]) -> Tree:  # (text with its quotation marks,)
        return Tree("string", (c[0].text,), c[0].start, c[0].end, 1)

    def truth(self, c: list[Any]) -> Tree:  # (TRUE or FALSE,)
        return Tree("truth", (c[0].text,), c[0].start, c[0].end, 1)

    def port_name(self, c: list[Any]) -> Tree:  # ("in" or "out", name)
        return Tree("port_name", (c[0].text, c[2].text), c[0].start, c[2].end, 1)

    def node_port(self, c: list[Any]) -> Tree:  # (node, "in" or "out" or None, name)
        role = c[2].text if len(c) == 5 else None
        return Tree("node_port", (c[0].text, role, c[-1].text), c[0].start, c[-1].end, 1)

    def parenthesised(self, c: list[Any]) -> Tree:
        """The inner tree under the parentheses' place: they group, and are gone."""
        inner: Tree = c[1]
        if inner.kind == "parenthesised":  # `((a))` counts as deep as it is written
            return inner._replace(start=c[0].start, end=c[2].end, depth=inner.depth + 1)
        return Tree("parenthesised", (inner,), c[0].start, c[2].end, inner.depth + 1)

    def tuple(self, c: list[Any]) -> Tree:  # (term, …)
        return _make("tuple", tuple(c[1:-1:2]), c[0], c[-1])

    def set(self, c: list[Any]) -> Tree:  # (term, …)
        return _make("set", tuple(c[1:-1:2]), c[0], c[-1])

    def sequence(self, c: list[Any]) -> Tree:  # (term, …)
        return _make("sequence", tuple(c[1:-1:2]), c[0], c[-1])

    def range(self, c: list[Any]) -> Tree:  # (low, high)
        return _make("range", (c[1], c[3]), c[0], c[4])

    def quantified(self, c: list[Any]) -> Tree:  # (quantifier, binders, body)
        return _make("quantified", (QUANTIFIERS[c[0].type], c[2], c[4]), c[0], c[5])

    def binders(self, c: list[Any]) -> Tree:  # (binder, …)
        return _make("binders", tuple(c[::2]), c[0], c[-1])

    def binder(self, c: list[Any]) -> Tree:  # (name token, …, domain)
        return _make("binder", (*c[:-2:2], c[-1]), c[0], c[-1])


def _listing(kind: str, c: list[Any]) -> Tree:
    if not c:
        return Tree(kind, (), 0, 0, 1)
    return _make(kind, tuple(c[::2]), c[0], c[-1])

"""The meaning of the names in a plan: nodes, ports and clauses of the contract, elements and types in its formulas.

Keys and values with a meaning in the plan's schema are read accordingly. In a method's options, which its backend
knows, ``in.v`` and ``out.v`` are read as ports of the method's node and ``guarantee:`` as names of its guarantees;
other words of a text that names a port so are looked up as in a formula. Everything else is ignored.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from avow.base.diagnostics import Rejected, Span
from avow.language.contract import Contract
from avow.language.scope import of_contract
from avow.language.source import Source
from avow.language.terms import Role
from avow.lsp.names import Meaning, Occurrence, Ports, What, declared
from avow.system.strict_yaml import Piece, read_yaml

_WORD = re.compile(r"\"(?:[^\"\\\n]|\\.)*\"|[A-Za-z_][A-Za-z0-9_']*|[0-9]+(?:\.[0-9]+)?|\.")
_PORT = re.compile(r"\b(?:in|out)\s*\.\s*[A-Za-z_]")
_ROLES = (str(Role.INPUT), str(Role.OUTPUT))
_CLAUSE_KINDS = {"guarantee": What.GUARANTEE, "assumption": What.ASSUMPTION}


@dataclass(frozen=True, slots=True)
class PlanText:
    """A plan's file and its text."""

    file: str
    text: str


def plan_occurrences(plan: PlanText, contract: Contract) -> tuple[Occurrence, ...]:
    """Every name in a plan with a meaning in the contract; none if the text is not YAML."""
    root = _document(plan)
    if root is None:
        return ()
    found = {(o.start, o.end): o for o in _Reader(plan, contract).everything(root)}
    return tuple(found[place] for place in sorted(found))


@functools.lru_cache(maxsize=8)
def _document(plan: PlanText) -> Piece | None:
    try:
        return read_yaml(plan.text.encode("utf-8", "replace"), plan.file)[0]
    except Rejected:
        return None


@dataclass(frozen=True, slots=True)
class _Region:
    """A stretch of the plan's text that holds one scalar, without quotation marks."""

    start: int
    end: int


class _Reader:
    def __init__(self, plan: PlanText, contract: Contract) -> None:
        self.plan = plan
        self.source = Source(plan.file, plan.text)
        self.environment = of_contract(contract)
        self.ports = {
            n.name: Ports(frozenset(p.name for p in n.inputs), frozenset(p.name for p in n.outputs))
            for n in contract.nodes
        }
        self.named = {
            n.name: {
                What.ASSUMPTION: {c.name for c in n.assumptions},
                What.GUARANTEE: {c.name for c in n.guarantees},
            }
            for n in contract.nodes
        }

    # -- places --------------------------------------------------------------------------------------------------------

    def region(self, span: Span) -> _Region:
        start = self.source.offset(span.line, span.column)
        end = self.source.offset(span.end_line, span.end_column)
        raw = self.plan.text[start:end]
        if raw[:1] in ("'", '"'):
            return _Region(start + 1, max(end - 1, start + 1))
        if raw[:1] in ("|", ">"):
            return _Region(start + raw.find("\n") + 1 if "\n" in raw else end, end)
        return _Region(start, end)

    def one(self, meaning: Meaning | None, start: int) -> Iterator[Occurrence]:
        if meaning is not None and self.plan.text.startswith(meaning.name, start):
            yield Occurrence(meaning, self.plan.file, start, start + len(meaning.name))

    def single(self, piece: Piece, what: Callable[[str], Meaning | None]) -> Iterator[Occurrence]:
        """A scalar that is a single name."""
        region = self.region(piece.span)
        if self.plan.text[region.start : region.end] == piece.text:
            yield from self.one(what(piece.text), region.start)

    def keys(self, piece: Piece | None) -> Iterator[tuple[str, int, Piece]]:
        """Each key of a mapping, with the place of its text."""
        for name, span, inner in piece.keyed() if piece is not None else ():
            yield name, self.region(span).start, inner

    # -- meanings ------------------------------------------------------------------------------------------------------

    def node(self, name: str) -> Meaning | None:
        return Meaning(What.NODE, name) if name in self.ports else None

    def clause(self, node: str, what: What, name: str) -> Meaning | None:
        return Meaning(what, name, node) if name in self.named.get(node, {}).get(what, ()) else None

    def element(self, name: str) -> Meaning | None:
        return declared(self.environment, name)

    def port(self, node: str, name: str, role: str | None = None) -> Meaning | None:
        """A port of a node; of any node that has it, if no node is named."""
        nodes = [node] if node else list(self.ports)
        return next((m for n in nodes if n in self.ports and (m := self.ports[n].meaning(n, name, role))), None)

    # -- texts ---------------------------------------------------------------------------------------------------------

    def words(self, region: _Region, node: str | None, side: Role = Role.OUTPUT) -> Iterator[Occurrence]:
        """The names of a formula, or of a path such as ``node.port``. `node`: whose ports ``in.v`` and ``v`` are;
        empty: those of any node; None: it has to be named. `side`: which port ``node.v`` is, if there are two."""
        before: list[tuple[str, int]] = []
        for match in _WORD.finditer(self.plan.text, region.start, region.end):
            word, at = match.group(), match.start()
            if word[0] == '"' or word[0].isdigit():
                before = []
            elif word == ".":
                before.append((word, at))
            elif before and before[-1][0] == ".":
                path = [text for text, _ in before if text != "."]
                yield from self.last_of(path, word, at, node, side)
                before.append((word, at))
            else:
                before = [(word, at)]
                if not self.plan.text[match.end() : region.end].lstrip().startswith("."):
                    meaning = self.port(node, word) if node else None
                    yield from self.one(meaning or self.element(word), at)
                elif word not in _ROLES:
                    yield from self.one(self.node(word), at)

    def last_of(self, path: Sequence[str], name: str, at: int, node: str | None, side: Role) -> Iterator[Occurrence]:
        match list(path):
            case ["in" | "out" as role] if node is not None:
                yield from self.one(self.port(node, name, role), at)
            case [owner] if owner in self.ports and name not in _ROLES:
                ports = self.ports[owner]
                meaning = ports.meaning(owner, name, side) or ports.meaning(owner, name)
                yield from self.one(meaning or self.clause(owner, What.GUARANTEE, name), at)
            case [owner, "in" | "out" as role] if owner in self.ports:
                yield from self.one(self.ports[owner].meaning(owner, name, role), at)
            case _:  # not the contract's
                pass

    # -- the plan ------------------------------------------------------------------------------------------------------

    def everything(self, piece: Piece, path: tuple[str, ...] = ()) -> Iterator[Occurrence]:
        """The names in a piece of the plan, with the keys around it."""
        for item in piece.items or ():
            yield from self.everything(item, path)
        for name, at, inner in self.keys(piece):
            yield from self.key(path, name, _Region(at, at + len(name)))
            yield from self.everything(inner, (*path, name))
        if piece.items is None and piece.entries is None:
            yield from self.scalar(path, piece)

    def key(self, path: tuple[str, ...], name: str, region: _Region) -> Iterator[Occurrence]:
        match path:
            case ("environment",):
                yield from self.words(region, "", Role.INPUT)
            case ("nodes",) | ("ros", "nodes") | ("model", "compound" | "external"):
                yield from self.one(self.node(name), region.start)
            case ("scenario", "interpret" | "domains"):
                yield from self.words(region, "")
            case ("nodes", node, "methods", *_, "guarantee" | "guarantees"):
                yield from self.one(self.clause(node, What.GUARANTEE, name), region.start)
            case ("nodes", node, "source", "memory"):
                yield from self.words(region, node)
            case ("nodes", node, "methods", *_) if _PORT.search(name):
                yield from self.words(region, node)

    def scalar(self, path: tuple[str, ...], piece: Piece) -> Iterator[Occurrence]:
        region = self.region(piece.span)
        match path:
            case ("connections", "from") | ("requirements", _, "formula" | "temporal"):
                yield from self.words(region, None)
            case ("connections", "to"):
                yield from self.words(region, None, Role.INPUT)
            case ("connections", "initial"):
                yield from self.words(region, "")
            case ("environment", port, "assume"):
                owner = port.partition(".")[0]
                yield from self.words(region, owner if owner in self.ports else "")
            case ("requirements", _, "supported_by"):
                node, _, name = piece.text.partition(".")
                yield from self.one(self.node(node), region.start)
                yield from self.one(self.clause(node, What.GUARANTEE, name), region.start + len(node) + 1)
            case ("compose" | "subsystems", _, "select" | "nodes"):
                yield from self.single(piece, self.node)
            case ("scenario", table, *_) if table not in ("interpret", "steps"):
                yield from self.single(piece, self.element)
            case ("expected" | "accepted", "obligation" | "matched"):
                yield from self.obligation(piece)
            case ("nodes", node, "methods", *_, "guarantee" | "guarantees"):
                yield from self.single(piece, lambda name: self.clause(node, What.GUARANTEE, name))
            case ("nodes", node, "methods", *_) if _PORT.search(self.plan.text, region.start, region.end):
                yield from self.words(region, node)

    def obligation(self, piece: Piece) -> Iterator[Occurrence]:
        """``node/guarantee/name``, ``node/sanity/not-vacuous-name``."""
        region = self.region(piece.span)
        node, _, rest = piece.text.partition("/")
        kind, _, name = rest.partition("/")
        yield from self.one(self.node(node), region.start)
        at = region.start + len(node) + len(kind) + 2
        if kind in _CLAUSE_KINDS:
            yield from self.one(self.clause(node, _CLAUSE_KINDS[kind], name), at)
        elif kind == "sanity":
            for what, names in self.named.get(node, {}).items():
                subject = next((n for n in sorted(names, key=len, reverse=True) if name.endswith(f"-{n}")), None)
                if subject is not None:
                    yield from self.one(Meaning(what, subject, node), at + len(name) - len(subject))
            if name.startswith(("constrained-", "determined-")):
                output = name.partition("-")[2]
                yield from self.one(self.port(node, output, Role.OUTPUT), at + len(name) - len(output))

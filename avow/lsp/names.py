"""The meaning and position of every name in the contracts of a system: a table, made from the syntax.

It agrees with the checker (`avow.language.check_names`) for every clause that parses. Places are offsets into the
texts.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import assert_never

from avow.language.contract import ClauseKind, Contract
from avow.language.lexer import Token, tokens
from avow.language.load import unless_torn
from avow.language.outline import read
from avow.language.scope import Environment, of_contract
from avow.language.source import Reports, Source
from avow.language.syntax import (
    ConstantDeclaration,
    Define,
    Element,
    FieldOf,
    FileSyntax,
    Name,
    NodePort,
    NodeSyntax,
    PortName,
    Quantification,
    RecordType,
    SetDisplay,
    Syntax,
    TypeDeclaration,
    children,
    unparenthesised,
    walk,
)
from avow.language.terms import Role


class What(StrEnum):
    """The kinds of things that a name can mean."""

    NODE = "node"
    INPUT = "input"
    OUTPUT = "output"
    ASSUMPTION = "assumption"
    GUARANTEE = "guarantee"
    TYPE = "type"
    CONSTANT = "constant"
    DEFINITION = "definition"
    ELEMENT = "element"
    FIELD = "field"
    """For all records that have a field of the name: their types do not count as different things."""
    VARIABLE = "variable"


PORTS = (What.INPUT, What.OUTPUT)
CLAUSES = (What.ASSUMPTION, What.GUARANTEE)
OWNED = (*PORTS, *CLAUSES, What.DEFINITION)
"""The kinds that belong to a node; a definition may belong to the context."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """The meaning of a name. `owner` is the node of a port, a clause or a definition of its own; for a variable that a
    quantifier or a definition binds, the place where it is bound."""

    what: What
    name: str
    owner: str = ""

    @property
    def shown(self) -> str:
        """``input agent.at``, for messages."""
        return f"{self.what} {f'{self.owner}.' if self.what in (*PORTS, *CLAUSES) else ''}{self.name}"


@dataclass(frozen=True, slots=True)
class Occurrence:
    """An occurrence of a name. One that is not `written` is where a clause without a name begins."""

    meaning: Meaning
    file: str
    start: int
    end: int
    declares: bool = False
    written: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Text:
    """A contract's text, parsed; cached, so that each text has one."""

    file: str
    text: str
    syntax: FileSyntax
    tokens: tuple[Token, ...]
    comments: tuple[Token, ...]


@functools.lru_cache(maxsize=64)
def taken_apart(file: str, text: str) -> Text:
    """The tokens and clauses of a text; its faults are not reported here."""
    reports, comments = Reports(Source(file, text)), list[Token]()
    found = tokens(reports, comments)
    return Text(file, text, read(found, unless_torn(reports)), tuple(found), tuple(comments))


@functools.lru_cache(maxsize=16)
def occurrences(texts: tuple[Text, ...], contract: Contract) -> tuple[Occurrence, ...]:
    """Every name in the texts that has a meaning, in each text by position. `contract` is what they declare, as far as
    it can be read."""
    nodes = [node for text in texts for node in text.syntax.nodes]
    own = {node.name.text: frozenset(d.name.text for d in node.definitions) for node in nodes}
    shared = (d.name.text for text in texts for d in text.syntax.declarations if isinstance(d, Define))
    defined = {**own, "": frozenset(shared)}
    reader = _Reader(of_contract(contract), {node.name.text: _ports(node) for node in nodes}, defined)
    found: dict[tuple[str, int], Occurrence] = {}
    for text in texts:
        for one in reader.text(text):
            found.setdefault((one.file, one.start), one)
    order = {text.file: k for k, text in enumerate(texts)}
    return tuple(sorted(found.values(), key=lambda o: (order[o.file], o.start)))


def clause_names(node: NodeSyntax) -> Iterator[tuple[Meaning, int, int, bool]]:
    """Each clause of a node by its name, with the place of the name, or (False) of the clause's first word."""
    counts = dict.fromkeys(ClauseKind, 0)
    for clause in node.clauses:
        counts[clause.kind] += 1
        letter = "A" if clause.kind is ClauseKind.ASSUMPTION else "G"
        what = What.ASSUMPTION if clause.kind is ClauseKind.ASSUMPTION else What.GUARANTEE
        name = clause.name.text if clause.name is not None else f"{letter}{counts[clause.kind]}"
        place = clause.name or Token("", "", clause.start, clause.start + 1)
        own = clause.name is not None and clause.name.start != clause.start  # `steps( … )` is named by its keyword
        yield Meaning(what, name, node.name.text), place.start, place.end, own


@dataclass(frozen=True, slots=True)
class Ports:
    """The names of a node's ports, by role."""

    inputs: frozenset[str] = frozenset()
    outputs: frozenset[str] = frozenset()

    def meaning(self, node: str, name: str, role: str | None = None) -> Meaning | None:
        """The port of that name; if both an input and an output have it, the input."""
        if role != Role.OUTPUT and name in self.inputs:
            return Meaning(What.INPUT, name, node)
        if role != Role.INPUT and name in self.outputs:
            return Meaning(What.OUTPUT, name, node)
        return None


def declared(environment: Environment, name: str) -> Meaning | None:
    """The meaning of a name in a context, except for its definitions. An enumeration that is declared as a constant is
    a type: the constant may denote one."""
    of = environment
    kinds = ((What.ELEMENT, of.elements), (What.TYPE, of.types), (What.CONSTANT, of.constants))
    return next((Meaning(what, name) for what, names in kinds if name in names), None)


def _ports(node: NodeSyntax) -> Ports:
    both = (frozenset(p.name.text for p in (t.items if t else ())) for t in (node.inputs, node.outputs))
    return Ports(*both)


@dataclass(slots=True)
class _Reader:
    environment: Environment
    nodes: Mapping[str, Ports]
    defined: Mapping[str, frozenset[str]]
    """The definitions of each node; those of the contexts under the empty name."""
    node: str = ""
    text_: Text = field(default_factory=lambda: Text("", "", FileSyntax(), (), ()))

    def at(self, meaning: Meaning | None, start: int, end: int, declares: bool = False) -> Iterator[Occurrence]:
        if meaning is not None and meaning.name and self.text_.text[start:end] == meaning.name:
            yield Occurrence(meaning, self.text_.file, start, end, declares)

    def global_name(self, name: str) -> Meaning | None:
        """The meaning of a name wherever it occurs."""
        owner = next((each for each in (self.node, "") if name in self.defined.get(each, ())), None)
        return declared(self.environment, name) if owner is None else Meaning(What.DEFINITION, name, owner)

    def text(self, text: Text) -> Iterator[Occurrence]:
        self.text_ = text
        for declaration in text.syntax.declarations:
            name = declaration.name
            yield from self.at(self.global_name(name.text), name.start, name.end, True)
            match declaration:
                case TypeDeclaration(type=type_):
                    yield from self.in_type(type_)
                case ConstantDeclaration(value=value):
                    body = unparenthesised(value)
                    names_set = isinstance(body, SetDisplay) and name.text in self.environment.types
                    for one in self.in_formula(value, {}):
                        yield replace(one, declares=True) if names_set and one.meaning.what is What.ELEMENT else one
                case Define():
                    yield from self.in_definition(declaration)
                case _:
                    assert_never(declaration)
        for node in text.syntax.nodes:
            yield from self.of_node(node)

    def of_node(self, node: NodeSyntax) -> Iterator[Occurrence]:
        self.node = node.name.text
        yield from self.at(Meaning(What.NODE, self.node), node.name.start, node.name.end, True)
        for what, listing in ((What.INPUT, node.inputs), (What.OUTPUT, node.outputs)):
            for port in listing.items if listing is not None else ():
                yield from self.at(Meaning(what, port.name.text, self.node), port.name.start, port.name.end, True)
                yield from self.in_type(port.type)
        for topic in node.topics.items if node.topics is not None else ():
            if topic.port is not None:
                meaning = self.nodes[self.node].meaning(self.node, topic.port.text, topic.role)
                yield from self.at(meaning, topic.port.start, topic.port.end)
        for definition in node.definitions:
            name = definition.name
            yield from self.at(self.global_name(name.text), name.start, name.end, True)
            yield from self.in_definition(definition)
        for clause, (meaning, start, end, written) in zip(node.clauses, clause_names(node), strict=True):
            yield Occurrence(meaning, self.text_.file, start, end, True, written)
            if clause.formula is not None:
                yield from self.in_formula(clause.formula, {})
            if clause.chance is not None and clause.chance.given is not None:
                yield from self.in_formula(clause.chance.given, {})
            else:
                first, last = clause.inside
                yield from self.in_words([t for t in self.text_.tokens if first <= t.start < last])
        self.node = ""

    def in_definition(self, tree: Define) -> Iterator[Occurrence]:
        bound: dict[str, Meaning] = {}
        for part in tree.parameters:
            token = part.name
            bound[token.text] = Meaning(What.VARIABLE, token.text, f"{self.text_.file}:{token.start}")
            yield from self.at(bound[token.text], token.start, token.end, True)
            yield from self.in_type(part.type)
        yield from self.in_formula(tree.body, bound)

    def in_type(self, tree: Syntax) -> Iterator[Occurrence]:
        for part in walk(tree):
            match part:
                case Name(text=name):
                    if name in self.environment.types:
                        yield from self.at(Meaning(What.TYPE, name), part.start, part.end)
                case RecordType(fields=fields):
                    for field_ in fields:
                        token = field_.name
                        yield from self.at(Meaning(What.FIELD, token.text), token.start, token.end, True)
                case Element(name=token):
                    yield from self.at(Meaning(What.ELEMENT, token.text), token.start, token.end, True)
                case _:  # names nothing by itself
                    pass

    def in_formula(self, tree: Syntax, bound: Mapping[str, Meaning]) -> Iterator[Occurrence]:
        stack: list[tuple[Syntax, Mapping[str, Meaning]]] = [(tree, bound)]
        while stack:
            part, scope = stack.pop()
            match part:
                case Name(text=name):
                    yield from self.at(scope.get(name) or self.meaning(name), part.start, part.end)
                case PortName(role=role, name=name):
                    ports = self.nodes.get(self.node, Ports())
                    yield from self.at(ports.meaning(self.node, name, role), part.end - len(name), part.end)
                case NodePort(node=name):  # a field of a record; a contract refers only to its own ports
                    yield from self.at(scope.get(name) or self.meaning(name), part.start, part.start + len(name))
                    yield from self.at(Meaning(What.FIELD, part.name), part.end - len(part.name), part.end)
                case FieldOf(body=body, name=token):
                    yield from self.at(Meaning(What.FIELD, token.text), token.start, token.end)
                    stack.append((body, scope))
                case Quantification(binders=binders, body=body):
                    inner = dict(scope)
                    for binder in binders:
                        stack.append((binder.domain, dict(inner)))
                        for token in binder.names:
                            place = f"{self.text_.file}:{token.start}"
                            inner[token.text] = Meaning(What.VARIABLE, token.text, place)
                            yield from self.at(inner[token.text], token.start, token.end, True)
                    stack.append((body, inner))
                case _:  # any other term with parts
                    stack.extend((each, scope) for each in children(part))

    def meaning(self, name: str) -> Meaning | None:
        ports = self.nodes.get(self.node, Ports())
        return ports.meaning(self.node, name) or self.global_name(name)

    def in_words(self, found: Sequence[Token]) -> Iterator[Occurrence]:
        """The names of a clause that does not parse, except for those that it binds."""
        for at, token in enumerate(found):
            role = found[at - 2].text if at > 1 and found[at - 1].type == "DOT" else None
            if token.type == "NAME" and role in (None, *Role):
                ports = self.nodes.get(self.node, Ports())
                meaning = self.meaning(token.text) if role is None else ports.meaning(self.node, token.text, role)
                yield from self.at(meaning, token.start, token.end)


def at_offset(found: Iterable[Occurrence], file: str, offset: int) -> Occurrence | None:
    """The name at (or just before) an offset."""
    touching = [o for o in found if o.file == file and o.written and o.start <= offset <= o.end]
    return touching[-1] if touching else None

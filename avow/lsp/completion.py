"""The completions at a place of a contract.

It is based on words, so that it works while a text is being typed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from avow.language.contract import Contract, Definition, Node, Port
from avow.language.lexer import LONG_UNITS, STEPS, UNITS, Token
from avow.language.nodes import ROS_BUILTINS
from avow.language.printer import show_sort, show_term, show_type
from avow.language.scope import of_contract
from avow.language.sorts import BoolSort, DataSort, EnumSort, Sort, TupleSort, components
from avow.language.terms import Past, Role
from avow.lsp.names import Text
from avow.lsp.vocabulary import BUILTIN_TYPES, CONNECTIVES, CONTEXT, FORMS, NODE, QUANTIFIERS, SECTIONS


@dataclass(frozen=True, slots=True)
class Offer:
    """A completion. `template` is a snippet in the protocol's syntax; empty: the label itself."""

    label: str
    kind: str
    """The protocol's name of it: a `CompletionItemKind`."""
    detail: str = ""
    template: str = ""
    about: str = ""


# --- where an offset is, by words, so that it is known while a text is being typed ------------------------------------

_TOP = ("CONTEXT", "NODE")
_SECTIONS = ("INPUTS", "OUTPUTS", "TOPICS", "DEFINE", "ASSUME", "GUARANTEE")
_WORDS = {"A": "ASSUME", "G": "GUARANTEE", "steps": "STEPS"}


@dataclass(frozen=True, slots=True)
class _Place:
    """`top` is ``CONTEXT``, ``NODE`` or empty; `section` the part of a node, empty between its parts. `before` are the
    words of the part up to the offset, without the one being typed."""

    top: str = ""
    node: str = ""
    section: str = ""
    before: Sequence[Token] = ()

    @property
    def last(self) -> str:
        """The kind of the word before; empty if there is none."""
        return self.before[-1].type if self.before else ""

    def has(self, kind: str) -> bool:
        """Whether there is such a word before."""
        return any(token.type == kind for token in self.before)

    @property
    def bound(self) -> tuple[str, ...]:
        """The variables that quantifiers before bind, and the parameters of a definition."""
        found = zip(self.before, self.before[1:], self.before[2:], strict=False)
        begins, ends = ("LPAR", "COMMA"), ("COMMA", "IN", "COLON")
        return tuple(t.text for a, t, z in found if t.type == "NAME" and a.type in begins and z.type in ends)


def _place_of(text: Text, offset: int) -> _Place | None:
    """The context of an offset; None within a comment or a string."""
    if any(
        c.start < offset and (offset < c.end or (offset == c.end and c.text.startswith("//"))) for c in text.comments
    ):
        return None
    if any(t.type == "STRING" and t.start < offset < t.end for t in text.tokens):
        return None
    before = [t for t in text.tokens if t.end < offset or (t.end == offset and not t.text[:1].isidentifier())]
    top = max((k for k, token in enumerate(before) if token.type in _TOP), default=None)
    return _Place() if top is None else _inside(before[top].type, before[top + 1 :])


def _inside(top: str, found: Sequence[Token]) -> _Place:
    """The place after a context's or node's first word and these words."""
    brace = next((k for k, token in enumerate(found) if token.type == "LBRACE"), None)
    if brace is None:
        return _Place(top, section="HEAD")
    if _open(found, "LBRACE", "RBRACE") <= 0:
        return _Place()
    node = found[0].text if top == "NODE" else ""
    body = found[brace + 1 :]
    if top == "CONTEXT":
        start = max((k + 1 for k, token in enumerate(body) if token.type == "SEMICOLON"), default=0)
        return _Place(top, node, "DECLARATION", body[start:])
    start, section = -1, ""
    for k, token in enumerate(body):
        if token.type in _SECTIONS:
            start, section = k, token.type
        elif token.text in _WORDS and body[k - 1].type in ("RPAR", "SEMICOLON"):
            start, section = k, _WORDS[token.text]
    part = body[start + 1 :]
    closed = part[-1:] and part[-1].type == ("SEMICOLON" if section == "DEFINE" else "RPAR")
    if closed and _open(part, "LPAR", "RPAR") <= 0:
        return _Place(top, node)
    begun = section in ("", "DEFINE") or any(token.type == "LPAR" for token in part)
    return _Place(top, node, section if begun else "HEAD", part)


def _open(found: Sequence[Token], opening: str, closing: str) -> int:
    """The number of brackets that are open at the end."""
    return sum((token.type == opening) - (token.type == closing) for token in found)


# --- contracts --------------------------------------------------------------------------------------------------------


def offers(text: Text, contract: Contract, offset: int) -> tuple[Offer, ...]:
    """All completions at an offset of a contract."""
    place = _place_of(text, offset)
    if place is None:
        return ()
    once: dict[str, Offer] = {}
    for offer in _offers(place, contract):
        once.setdefault(offer.label, offer)
    return tuple(once.values())


def _offers(place: _Place, contract: Contract) -> Iterator[Offer]:
    node = next((n for n in contract.nodes if n.name == place.node), None)
    match place.top, place.section:
        case "", _:
            yield Offer("node", "Keyword", "a node's contract", NODE)
            yield Offer("context", "Keyword", "types and constants", CONTEXT)
        case "CONTEXT", _:
            if place.has("EQUALS"):
                yield from _of_formula(place, node, contract) if place.has("DEFINE") else _values(contract)
            elif place.has("COLON"):
                yield from _types(contract)
        case "NODE", "":
            for word, (template, detail) in SECTIONS.items():
                yield Offer(word, "Keyword", detail, template)
        case "NODE", "INPUTS" | "OUTPUTS":
            if place.has("COLON"):
                yield from _types(contract)
        case "NODE", "TOPICS":
            yield from _of_topic(place, node)
        case "NODE", "DEFINE":
            if place.has("EQUALS"):
                yield from _of_formula(place, node, contract)
            elif place.last == "COLON":
                yield from _types(contract)
        case "NODE", "ASSUME" | "GUARANTEE":
            yield from _of_formula(place, node, contract)
        case _:  # a new name
            return


def _of_topic(place: _Place, node: Node | None) -> Iterator[Offer]:
    words = [t.type for t in place.before]
    if words[-2:-1] in (["IN"], ["OUT"]) and words[-1] == "DOT":
        yield from _ports(node, Role.INPUT if words[-2] == "IN" else Role.OUTPUT, "")
    elif words[-2:] == ["MATCHES", "LPAR"]:
        yield from _ports(node, Role.INPUT, "in.")
        yield from _ports(node, Role.OUTPUT, "out.")
    elif words[-1:] in (["LPAR"], ["COMMA"]):
        yield from (Offer(name, "Struct", "a built-in type of ROS") for name in ROS_BUILTINS)
    elif words[-1:] == ["NAME"]:
        yield Offer("matches", "Keyword", "the input or output that it carries", "matches(${1:in.name})")


def _of_formula(place: _Place, node: Node | None, contract: Contract) -> Iterator[Offer]:
    words = [t.type for t in place.before]
    if len(words) > 1 and words[-1] == "DOT" and words[-2] in ("IN", "OUT"):
        yield from _ports(node, Role.INPUT if words[-2] == "IN" else Role.OUTPUT, "")
        return
    if words[-1:] == ["DOT"]:
        yield from _fields(place, node, contract)
        return
    if words[-1:] == ["NUMBER"] and "LSQUARE" in words and "RSQUARE" not in words[words.index("LSQUARE") :]:
        yield from (Offer(unit, "Unit") for unit in (*STEPS, *UNITS, *LONG_UNITS))
        return
    if words[-1:] in (["IN"], ["NOT_IN"]):
        yield from _types(contract)
    if words[-1:] in (["EQ"], ["NE"]) and (sort := _sort_before(place, node)) is not None:
        yield from _of_sort(sort, node, contract)
        if isinstance(sort, EnumSort | DataSort | BoolSort):
            return
    yield from (Offer(name, "Variable", "a variable") for name in place.bound)
    for role in (Role.INPUT, Role.OUTPUT):
        yield from _ports(node, role, f"{role}.")
    yield from _values(contract)
    for definition in _definitions(node, contract):
        stops = ", ".join(f"${{{k}:{p.name}}}" for k, p in enumerate(definition.parameters, 1))
        yield Offer(definition.name, "Function", definition.text, f"{definition.name}({stops})" if stops else "")
    for form in (form for form in FORMS.values() if form.name != Past.STEPS):
        yield Offer(form.name, "Function", form.label, form.template, form.meaning)
    for word, meaning in QUANTIFIERS.items():
        yield Offer(word, "Operator", f"{word}(x in S | F)", f"{word}(${{1:x}} in ${{2:REAL}} | ${{3:F}})", meaning)
    yield Offer("if", "Operator", "if F then s else t", "if ${1:F} then ${2:s} else ${3:t}")
    yield from (Offer(word, "Operator", detail) for word, detail in CONNECTIVES.items())
    yield from (Offer(word, "Constant", "BOOL") for word in ("TRUE", "FALSE"))


def _definitions(node: Node | None, contract: Contract) -> tuple[Definition, ...]:
    return node.definitions if node is not None else contract.definitions


def _fields(place: _Place, node: Node | None, contract: Contract) -> Iterator[Offer]:
    """The fields of the record before the point; if it is not one of the node's ports, those of all records."""
    ports = (*node.inputs, *node.outputs) if node is not None else ()
    found = _sorts_of(place.before, ports)
    whole = found or [*components(*(sort for _, sort in contract.types), *(p.sort for p in ports))]
    for sort in _records(whole):
        pairs = zip(sort.labels, sort.items, strict=False)
        yield from (Offer(label, "Field", show_sort(item)) for label, item in pairs)


def _sorts_of(before: Sequence[Token], ports: Sequence[Port]) -> list[Sort]:
    """The sorts of the port, or of the field of one, whose name ends the words."""
    chain: list[str] = []
    for token in reversed(before):
        if token.type not in ("NAME", "DOT", "IN", "OUT"):
            break
        chain += [token.text] if token.type == "NAME" else []
    chain.reverse()
    found: list[Sort] = [p.sort for p in ports if chain and p.name == chain[0]]
    for name in chain[1:] if found else ():
        found = [dict(zip(s.labels, s.items, strict=False))[name] for s in _records(found) if name in s.labels]
    return found


def _sort_before(place: _Place, node: Node | None) -> Sort | None:
    """The sort of the port, or of the field of one, before the last word."""
    ports = (*node.inputs, *node.outputs) if node is not None else ()
    return next(iter(_sorts_of(place.before[:-1], ports)), None)


def _of_sort(sort: Sort, node: Node | None, contract: Contract) -> Iterator[Offer]:
    """The values of this sort: elements, the truth values, constants and ports."""
    elements = of_contract(contract).elements
    yield from (o for o in _values(contract) if o.kind == "EnumMember" and elements[o.label] == sort)
    yield from (Offer(name, "Constant", show_term(t, "rcl")) for name, t in contract.constants if t.sort == sort)
    if isinstance(sort, BoolSort):
        yield from (Offer(word, "Constant", "BOOL") for word in ("TRUE", "FALSE"))
    alike = (
        {f"{p.role}.{p.name}" for p in (*node.inputs, *node.outputs) if p.sort == sort} if node is not None else set()
    )
    for role in (Role.INPUT, Role.OUTPUT):
        yield from (o for o in _ports(node, role, f"{role}.") if o.label in alike)


def _records(sorts: Iterable[Sort]) -> list[TupleSort]:
    return [sort for sort in sorts if isinstance(sort, TupleSort)]


def _ports(node: Node | None, role: Role, before: str) -> Iterator[Offer]:
    for port in (node.inputs if role is Role.INPUT else node.outputs) if node is not None else ():
        detail = f"{port.type_name} = {shown}" if (shown := show_type(port.sort)) != port.type_name else shown
        yield Offer(before + port.name, "Field", detail)


def _types(contract: Contract) -> Iterator[Offer]:
    yield from (Offer(name, "Struct", show_type(sort)) for name, sort in contract.types)
    yield from (Offer(name, "Struct", detail) for name, detail in BUILTIN_TYPES.items())


def _values(contract: Contract) -> Iterator[Offer]:
    for name, sort in of_contract(contract).elements.items():
        parameters = sort.constructor(name).parameters if isinstance(sort, DataSort) else ()
        stops = ", ".join(f"${{{k}:{show_sort(p)}}}" for k, p in enumerate(parameters, 1))
        yield Offer(name, "EnumMember", f"an element of {sort.name}", f"{name}({stops})" if parameters else "")
    yield from (Offer(name, "Constant", show_term(term, "rcl")) for name, term in contract.constants)

"""The completions at a place of a contract, and the arguments of an operator or function.

It is based on words, so that it works while a text is being typed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from avow.language import parser
from avow.language.contract import Contract, Definition, Node, Port
from avow.language.lexer import LONG_UNITS, STEPS, UNITS, Token
from avow.language.nodes import ROS_BUILTINS
from avow.language.printer import show_sort, show_term, show_type
from avow.language.scope import of_contract
from avow.language.sorts import BoolSort, DataSort, EnumSort, FunctionSort, SequenceSort, Sort, TupleSort, components
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


@dataclass(frozen=True, slots=True)
class Signature:
    """How an operator or function is applied, and which of its arguments contains the place."""

    label: str
    parameters: tuple[str, ...]
    active: int
    about: str = ""


# --- where an offset is, by words, so that it is known while a text is being typed ------------------------------------

_TOP = ("CONTEXT", "NODE")
_SECTIONS = ("INPUTS", "OUTPUTS", "TOPICS", "STEPS", "DEFINE", "ASSUME", "GUARANTEE")
_WORDS = {"A": "ASSUME", "G": "GUARANTEE"}


@dataclass(frozen=True, slots=True)
class _Place:
    """`top` is ``CONTEXT``, ``NODE`` or empty; `section` the part of a node, empty between its parts. `before` are the
    words of the part up to the offset, without the one being typed; `bound` the variables of the quantifiers around."""

    top: str = ""
    node: str = ""
    section: str = ""
    before: tuple[Token, ...] = ()
    bound: tuple[str, ...] = ()

    @property
    def last(self) -> str:
        """The kind of the word before; empty if there is none."""
        return self.before[-1].type if self.before else ""

    @property
    def defines(self) -> bool:
        """Whether it is in a definition."""
        return self.section == "DEFINE" or any(t.type == "DEFINE" for t in self.before)

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters of a definition."""
        pairs = pairwise(self.before) if self.defines else ()
        return tuple(t.text for t, then in pairs if t.type == "NAME" and then.type in ("COLON", "COMMA"))


def _place_of(text: Text, offset: int) -> _Place | None:
    """The context of an offset; None within a comment or a string."""
    if any(
        c.start < offset and (offset < c.end or (offset == c.end and c.text.startswith("//"))) for c in text.comments
    ):
        return None
    if any(t.type == "STRING" and t.start < offset < t.end for t in text.tokens):
        return None
    before = [t for t in text.tokens if t.end < offset or (t.end == offset and not t.text[:1].isidentifier())]
    return _scan([t for t in before if t.start < offset])


def _scan(found: Sequence[Token]) -> _Place:
    top, node, section, start, depth, brace, opened = "", "", "", 0, 0, 0, False
    for at, token in enumerate(found):
        kind = token.type
        between = depth == 0 and (not section or opened)
        if kind == "NAME" and top == "NODE" and brace and between and token.text in _WORDS:
            kind = _WORDS[token.text]
        if kind == "NAME" and token.text == Past.STEPS and top == "NODE" and brace and between:
            kind = "STEPS"
        if kind in _TOP:
            top, node, section, start, depth, brace, opened = kind, "", "", at + 1, 0, 0, False
        elif kind in _SECTIONS and (kind, top) != ("DEFINE", "CONTEXT"):
            section, start, depth, opened = kind, at + 1, 0, False
        elif kind == "LPAR":
            depth, opened = depth + 1, section != "DEFINE"
        elif kind == "RPAR":
            depth = max(depth - 1, 0)
        elif kind == "LBRACE" and depth == 0:
            brace += 1
        elif kind == "RBRACE" and depth == 0:
            brace = max(brace - 1, 0)
            if brace == 0:
                top, node, section, start, opened = "", "", "", at + 1, False
        elif kind == "NAME" and top == "NODE" and not brace and not node:
            node = token.text
        elif kind == "SEMICOLON" and depth == 0 and (top == "CONTEXT" or section == "DEFINE"):
            section, start = "", at + 1
    if section and opened and depth == 0:
        section, start = "", len(found)
    elif section and not opened and section != "DEFINE":
        section = "HEAD"
    elif top == "NODE" and not section:
        section = "" if brace else "HEAD"
    part = tuple(found[start:])
    return _Place(top, node, section, part, _bound(part))


def _bound(part: Sequence[Token]) -> tuple[str, ...]:
    """The variables of the quantifiers that are open at the end of a part."""
    open_: list[tuple[int, list[str], bool]] = []
    depth = 0
    for at, token in enumerate(part):
        if token.type == "LPAR":
            depth += 1
            if at and part[at - 1].type in parser.QUANTIFIERS:
                open_.append((depth, [], True))
        elif token.type == "RPAR":
            depth -= 1
            while open_ and open_[-1][0] > depth:
                open_.pop()
        elif open_ and open_[-1][0] == depth and open_[-1][2]:
            if token.type in ("BAR", "SEMICOLON"):
                open_[-1] = (depth, open_[-1][1], False)
            elif token.type == "NAME" and part[at - 1].type in ("LPAR", "COMMA"):
                following = part[at + 1].type if at + 1 < len(part) else ""
                if following in ("COMMA", "IN"):
                    open_[-1][1].append(token.text)
    return tuple(name for _, names, _ in open_ for name in names)


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
            if place.defines and any(t.type == "EQUALS" for t in place.before):
                yield from _of_formula(place, node, contract)
            elif place.last == "COLON" or any(t.type == "COLON" for t in place.before):
                yield from _types(contract)
            elif any(t.type == "EQUALS" for t in place.before):
                yield from _values(contract)
        case "NODE", "":
            for word, (template, detail) in SECTIONS.items():
                yield Offer(word, "Keyword", detail, template)
        case "NODE", "INPUTS" | "OUTPUTS":
            if any(t.type == "COLON" for t in place.before):
                yield from _types(contract)
        case "NODE", "STEPS":
            if place.last == "NUMBER":
                yield from (Offer(unit, "Unit") for unit in (*UNITS, *LONG_UNITS))
            elif place.last == "LPAR":
                yield Offer("every", "Keyword", "exactly so far apart")
                yield Offer("at most", "Keyword", "no further apart")
        case "NODE", "TOPICS":
            yield from _of_topic(place, node)
        case "NODE", "DEFINE":
            if any(t.type == "EQUALS" for t in place.before):
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
    yield from (Offer(name, "Variable", "quantified") for name in place.bound)
    yield from (Offer(name, "Variable", "a parameter") for name in place.parameters)
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


# --- signatures ------------------------------------------------------------------------------------------------------


def signature(text: Text, contract: Contract, offset: int) -> Signature | None:
    """How the operator or function before the innermost open parenthesis is applied."""
    place = _place_of(text, offset)
    inside = place is not None and (place.section in ("ASSUME", "GUARANTEE") or place.defines)
    if place is None or not inside:
        return None
    commas, closed = 0, 0
    for at in range(len(place.before) - 1, 0, -1):
        kind = place.before[at].type
        if kind in ("RPAR", "RBRACE", "RSQUARE"):
            closed += 1
        elif kind in ("LPAR", "LBRACE", "LSQUARE") and closed:
            closed -= 1
        elif kind == "LPAR":
            return _of_head(place, at, contract, commas)
        elif kind == "COMMA" and not closed:
            commas += 1
    return None


def _of_head(place: _Place, opening: int, contract: Contract, active: int) -> Signature | None:
    at = opening - 1
    if place.before[at].type == "RSQUARE":
        while at > 0 and place.before[at].type != "LSQUARE":
            at -= 1
        at -= 1
    name = place.before[at]
    if name.text in QUANTIFIERS:
        label = f"{name.text}(x in S | F)"
        bar = any(t.type in ("BAR", "SEMICOLON") for t in place.before[opening:])
        return Signature(label, ("x in S", "F"), int(bar), QUANTIFIERS[name.text])
    if name.type != "NAME":
        return None
    role = place.before[at - 2].text if at > 1 and place.before[at - 1].type == "DOT" else None
    found = _applied(place, name.text, role, contract)
    if found is None and name.text in FORMS and role is None:
        form = FORMS[name.text]
        found = Signature(form.label, form.parameters, 0, form.meaning)
    return replace(found, active=min(active, max(len(found.parameters) - 1, 0))) if found is not None else None


def _applied(place: _Place, name: str, role: str | None, contract: Contract) -> Signature | None:
    """A port or constructor of the contract."""
    node = next((n for n in contract.nodes if n.name == place.node), None)
    ports: list[Port] = [p for p in (*node.inputs, *node.outputs) if p.name == name] if node is not None else []
    for port in ports:
        if role is not None and port.role != role:
            continue
        match port.sort:
            case FunctionSort(parameters=parameters, result=result):
                shown = tuple(map(show_sort, parameters))
                return Signature(f"{name}({', '.join(shown)})", shown, 0, f"→ {show_sort(result)}")
            case SequenceSort(item=item):
                return Signature(f"{name}(i)", ("i",), 0, f"the element at position i, from 0: {show_sort(item)}")
            case _:  # takes no arguments
                pass
    for definition in _definitions(node, contract):
        if role is None and definition.name == name and definition.parameters:
            shown = tuple(f"{p.name} : {show_sort(p.sort)}" for p in definition.parameters)
            return Signature(f"{name}({', '.join(shown)})", shown, 0, definition.text)
    sort = of_contract(contract).elements.get(name)
    if role is None and isinstance(sort, DataSort) and (parameters := sort.constructor(name).parameters):
        shown = tuple(map(show_sort, parameters))
        return Signature(f"{name}({', '.join(shown)})", shown, 0, f"an element of {sort.name}")
    return None

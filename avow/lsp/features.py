"""The answers to an editor's requests as plain data: the server (`avow.lsp.server`) only converts them to the protocol.

Places are offsets into the text; the server converts them to the protocol's lines and UTF-16 columns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from avow.base.diagnostics import Diagnostic
from avow.language.contract import Clause, Definition, Node, Port
from avow.language.definitions import show_clause
from avow.language.lexer import Token
from avow.language.load import clean_text
from avow.language.printer import show_sort, show_term, show_type
from avow.language.scope import of_contract
from avow.language.source import Source
from avow.language.subterms import subterms
from avow.language.terms import Quantified, Variable
from avow.lsp.names import CLAUSES, Meaning, Occurrence, Text, What, at_offset, taken_apart
from avow.lsp.project import Project, about_plan, is_plan, project_of
from avow.lsp.renaming import all_occurrences
from avow.lsp.vocabulary import BUILTIN_TYPES, FORMS
from avow.sanity.document import Result

StatusLookup = Callable[[str, str], str | None]
"""(node, clause) → its status in the ledger, in a few words; None if it has none."""
SanityLookup = Callable[[Node, str | None], tuple[Result, ...]]
"""The known answers about the sanity of a node's clause, or (None) of the node and its outputs."""


@dataclass(frozen=True, slots=True)
class Document:
    """A text, its diagnostics, and the system that it belongs to, as far as that can be read."""

    file: str
    text: str
    project: Project
    diagnostics: tuple[Diagnostic, ...]
    names: tuple[Occurrence, ...] = field(repr=False)
    """Every name with a meaning in every file of the system."""

    @property
    def taken_apart(self) -> Text:
        """The contract's text; for a plan, an empty one."""
        return taken_apart(self.file, "" if is_plan(self.file) else self.text)

    @property
    def tokens(self) -> tuple[Token, ...]:
        return self.taken_apart.tokens


def analyse(text: str, file: str, texts: Mapping[str, str] | None = None) -> Document:
    """Check a text. `texts` are the other documents that are open, by file."""
    project = project_of(file, {**(texts or {}), file: text})
    names = all_occurrences(project)
    if is_plan(file):
        return Document(file, text, project, about_plan(file), names)
    source = clean_text(text, file)
    if isinstance(source, Diagnostic):
        return Document(file, text, project, (source,), names)
    mine = tuple(d for d in project.diagnostics if d.span is None or d.span.file == file)
    return Document(file, source.text, project, mine, names)


def name_at(document: Document, offset: int) -> Occurrence | None:
    """The name with a meaning at (or just before) an offset."""
    return at_offset(document.names, document.file, offset)


def _token_at(document: Document, offset: int) -> Token | None:
    touching = [t for t in document.tokens if t.start <= offset <= t.end]
    return touching[-1] if touching else None


def hover(
    document: Document,
    offset: int,
    status: StatusLookup = lambda node, clause: None,
    sanity: SanityLookup = lambda node, clause: (),
) -> str | None:
    """Markdown about the thing at an offset: its type, its origin, and the status of its guarantee."""
    name = name_at(document, offset)
    if name is not None:
        return _about(document, name, status, sanity)
    token = _token_at(document, offset)
    if token is None:
        return None
    if token.type in ("ASSUME", "GUARANTEE") or token.text in ("A", "G"):
        clause = next((o for o in document.names if o.file == document.file and _begins(document, o, token)), None)
        return _about(document, clause, status, sanity) if clause is not None else None
    if token.type == "BUILTIN":
        return f"`{token.text}`: a built-in type, {_plain(BUILTIN_TYPES[token.text])}"
    if token.text in FORMS:
        form = FORMS[token.text]
        return f"`{form.label}`\n\n{_plain(form.meaning)}"
    return None


def _begins(document: Document, clause: Occurrence, token: Token) -> bool:
    """Whether the clause whose name (or, without one, first letter) this is begins with the token."""
    if not clause.declares or clause.meaning.what not in CLAUSES:
        return False
    between = document.text[token.end : clause.start]
    return clause.start == token.start or (token.end <= clause.start and not between.strip())


def definition(document: Document, offset: int) -> tuple[Occurrence, ...]:
    """Where the name at an offset is declared."""
    name = name_at(document, offset)
    return tuple(o for o in document.names if o.declares and o.meaning == name.meaning) if name is not None else ()


def references(document: Document, offset: int, declarations: bool = True) -> tuple[Occurrence, ...]:
    """Every place, in all files of the system, that names the thing whose name is at an offset."""
    name = name_at(document, offset)
    if name is None:
        return ()
    found = (o for o in document.names if o.written and o.meaning == name.meaning)
    return tuple(o for o in found if declarations or not o.declares)


# --- finding out -----------------------------------------------------------------------------------------------------


def _about(document: Document, name: Occurrence, status: StatusLookup, sanity: SanityLookup) -> str | None:
    meaning, contract = name.meaning, document.project.contract
    owner = next((n for n in contract.nodes if n.name in (meaning.owner, meaning.name)), None)
    match meaning.what:
        case What.NODE:
            return "\n\n".join([f"node `{meaning.name}`", *_sane(owner, None, sanity)])
        case What.INPUT | What.OUTPUT:
            ports = [p for p in (*owner.inputs, *owner.outputs) if p.name == meaning.name] if owner else []
            port = (
                next((p for p in ports if (p in owner.inputs) == (meaning.what is What.INPUT)), None) if owner else None
            )
            return _about_port(port, owner) if port is not None and owner is not None else None
        case What.ASSUMPTION | What.GUARANTEE:
            clause = next((c for c in owner.clauses if c.name == meaning.name), None) if owner else None
            return _about_clause(clause, owner, status, sanity) if clause is not None and owner is not None else None
        case What.TYPE:
            return f"type `{meaning.name}` = `{show_type(dict(contract.types)[meaning.name])}`"
        case What.CONSTANT:
            return f"constant `{meaning.name}` = `{show_term(dict(contract.constants)[meaning.name], 'rcl')}`"
        case What.DEFINITION:
            found = next((d for n in contract.nodes for d in n.definitions if _is_of(d, n, meaning)), None)
            found = found or next((d for d in contract.definitions if d.name == meaning.name), None)
            return f"`{found.text}`" if found is not None else f"definition `{meaning.name}`"
        case What.ELEMENT:
            sort = of_contract(contract).elements.get(meaning.name)
            return f"`{meaning.name}`: an element of `{sort.name}`" if sort is not None else None
        case What.FIELD:
            return f"field `{meaning.name}` of a record"
        case What.VARIABLE:
            return _about_variable(document, meaning)


def _is_of(definition: Definition, node: Node, meaning: Meaning) -> bool:
    """Whether a node's definition is the intended one; a context's is the same for each node that uses it."""
    return definition.name == meaning.name and meaning.owner in ("", node.name)


def _about_variable(document: Document, meaning: Meaning) -> str:
    """A quantified variable, with its sort if its clause could be read."""
    place = next((o for o in document.names if o.declares and o.meaning == meaning), None)
    source = Source(document.file, document.project.text_of(document.file))
    for clause in (c for node in document.project.contract.nodes for c in node.clauses):
        if place is None or clause.span is None or clause.span.file != place.file:
            continue
        line, _ = source.place(place.start)
        if clause.span.line <= line <= clause.span.end_line:
            for variable in _bound(clause, meaning.name):
                return f"`{variable.name}` : `{show_sort(variable.sort)}` (quantified)"
    return f"`{meaning.name}` (quantified)"


def _bound(clause: Clause, name: str) -> list[Variable]:
    quantified = (term for term in subterms(clause.formula) if isinstance(term, Quantified))
    return [variable for term in quantified for variable in term.variables if variable.name == name]


def _about_clause(clause: Clause, node: Node, status: StatusLookup, sanity: SanityLookup) -> str:
    lines = [f"**{clause.kind} {_plain(clause.name)}**"]
    if clause.sentence:
        lines.append(_plain(clause.sentence))
    shown = show_clause(replace(clause, formula=clause.written or clause.formula), node)
    lines.append(f"```\n{shown}\n```")
    said = status(node.name, clause.name)
    if said:
        lines.append(_plain(said))
    return "\n\n".join([*lines, *_sane(node, clause.name, sanity)])


def _sane(node: Node | None, subject: str | None, sanity: SanityLookup) -> list[str]:
    """A line for each sanity claim about a clause, or (None) about the node and its outputs."""
    found = sanity(node, subject) if node is not None else ()
    lines = [f"- {_plain(f'{a.verdict}: {a.claim} {a.explanation}'.strip())}" for a in found]
    return ["\n".join(lines)] if lines else []


def _plain(text: str) -> str:
    """Text that Markdown leaves unchanged."""
    return "".join(f"\\{c}" if c in "\\`*_{}[]()#+-.!|<>~&" else c for c in text)


def _about_port(port: Port, node: Node) -> str:
    words = {"in": "parameter" if port.parameter else "input", "out": "output"}
    shown = show_type(port.sort)
    more = f" = `{shown}`" * (shown != port.type_name) + f" in {port.unit}" * bool(port.unit)
    topics = [t for t in node.topics if t.port == port]
    carried = "".join(f"\n\ntopic `{t.name}` of `{t.ros_type}`" for t in topics)
    return f"`{port.role}.{port.name}` : `{port.type_name}`{more} ({words[port.role]} of {_plain(node.name)}){carried}"

"""The answers to an editor's requests as plain data: the server (`avow.lsp.server`) only converts them to the protocol.

Places are offsets into the text; the server converts them to the protocol's lines and UTF-16 columns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from avow.base.diagnostics import Diagnostic
from avow.language.contract import Clause, Contract, Node, Port
from avow.language.definitions import show_clause
from avow.language.lexer import Token
from avow.language.load import clean_text
from avow.language.printer import show_sort, show_term, show_type
from avow.language.scope import of_contract
from avow.language.subterms import subterms
from avow.language.terms import Quantified
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
    """None if what has the name could not be read."""
    try:
        return _of_meaning(document.project.contract, name.meaning, status, sanity)
    except KeyError:
        return None


def _of_meaning(contract: Contract, meaning: Meaning, status: StatusLookup, sanity: SanityLookup) -> str:
    name, owner = meaning.name, meaning.owner
    match meaning.what:
        case What.NODE:
            return "\n\n".join([f"node `{name}`", *_sane(contract.node(name), None, sanity)])
        case What.INPUT:
            return _about_port(contract.node(owner).input(name), contract.node(owner))
        case What.OUTPUT:
            return _about_port(contract.node(owner).output(name), contract.node(owner))
        case What.ASSUMPTION | What.GUARANTEE:
            return _about_clause(contract.node(owner).clause(name), contract.node(owner), status, sanity)
        case What.TYPE:
            return f"type `{name}` = `{show_type(dict(contract.types)[name])}`"
        case What.CONSTANT:
            return f"constant `{name}` = `{show_term(dict(contract.constants)[name], 'rcl')}`"
        case What.DEFINITION:
            nodes = (
                n for n in contract.nodes if owner in ("", n.name)
            )  # a context's is the same for each that uses it
            known = {d.name: d for ds in (contract.definitions, *(n.definitions for n in nodes)) for d in ds}
            return f"`{known[name].text}`"
        case What.ELEMENT:
            return f"`{name}`: an element of `{of_contract(contract).elements[name].name}`"
        case What.FIELD:
            return f"field `{name}` of a record"
        case What.VARIABLE:
            formulas = (clause.spoken for node in contract.nodes for clause in node.clauses)
            quantified = (part for formula in formulas for part in subterms(formula) if isinstance(part, Quantified))
            sorts = {v.sort for part in quantified for v in part.variables if v.name == name}
            of = f" : `{show_sort(sorts.pop())}`" if len(sorts) == 1 else ""
            return f"`{name}`{of} (quantified)"


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


def _sane(node: Node, subject: str | None, sanity: SanityLookup) -> list[str]:
    """A line for each sanity claim about a clause, or (None) about the node and its outputs."""
    lines = [f"- {_plain(f'{a.verdict}: {a.claim} {a.explanation}'.strip())}" for a in sanity(node, subject)]
    return ["\n".join(lines)] if lines else []


def _plain(text: str) -> str:
    """Text that Markdown leaves unchanged."""
    return "".join(f"\\{c}" if c in "\\`*_{}[]()#+-.!|<>~&" else c for c in text)


def _about_port(port: Port, node: Node) -> str:
    words = {"in": "parameter" if port.parameter else "input", "out": "output"}
    shown = show_type(port.sort)
    more = f" = `{shown}`" * (shown != port.type_name) + f" in {port.unit}" * bool(port.unit)
    topics = [t for t in node.topics if t.port == port]
    carried = "".join(f"\n\ntopic `{t.name}` of `{t.kind}`" for t in topics)
    return f"`{port.role}.{port.name}` : `{port.type_name}`{more} ({words[port.role]} of {_plain(node.name)}){carried}"

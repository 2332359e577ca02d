"""RCL files and texts to a checked contract; formulas of other files (plans) to typed terms.

Every function reports all errors at once, and raises only `Rejected`.
"""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.remembered import Shelf
from avow.base.suggestions import nearby
from avow.base.tuning.sizes import CONTRACT_BYTES, CONTRACTS_KEPT
from avow.language.checker import Checker
from avow.language.contract import Contract, Node
from avow.language.declarations import Declarations
from avow.language.lexer import Token, tokens
from avow.language.lints import LintedFile, lint
from avow.language.nodes import check_node, check_ports
from avow.language.outline import read
from avow.language.parser import parse
from avow.language.pieces import by_pieces
from avow.language.scope import BOTH_ROLES, Defined, Scope, of_contract
from avow.language.sorts import Sort
from avow.language.source import Reports, Source, in_order
from avow.language.syntax import FileSyntax, NodeSyntax, TermSyntax
from avow.language.terms import Role, Term, Variable

NOTHING = Contract((), (), (), ())


def load_contract(paths: Sequence[Path], shelf: Shelf | None = None) -> Contract:
    """The contract that the files declare together. Raises `Rejected` with every error of every file. `shelf`: the
    cache of their checked nodes."""
    contract, diagnostics = check_paths(paths, shelf=shelf)
    errors = tuple(d for d in diagnostics if d.is_error)
    if contract is None or errors:
        raise Rejected(*errors)
    return contract


def check_paths(
    paths: Iterable[Path], *, off: frozenset[str] = frozenset(), shelf: Shelf | None = None
) -> tuple[Contract | None, tuple[Diagnostic, ...]]:
    """The contract of the files, or None, and all diagnostics about them, lints included.

    `off`: codes of lints not to report. A file that cannot be read is reported too. `shelf`: as for `load_contract`.
    """
    sources: list[Source] = []
    unreadable: list[Diagnostic] = []
    for path in paths:
        source = read_source(path)
        if isinstance(source, Diagnostic):
            unreadable.append(source)
        else:
            sources.append(source)
    contract, diagnostics = check_sources(sources, off=off, partial=bool(unreadable), shelf=shelf)
    return (None if unreadable else contract), (*unreadable, *diagnostics)


def read_in_part(paths: Iterable[Path]) -> Contract:
    """As much of a contract as can be read despite its errors: for looking names up, never for verification."""
    found = [source for path in paths if isinstance(source := read_source(path), Source)]
    return _checked(found, frozenset(), True)[0]


def syntax_faults(text: str, span: Span | None) -> tuple[Diagnostic, ...]:
    """The syntax errors of a formula; empty if the text can be a formula for some meaning of its names."""
    return tuple(in_order(syntax_of(text, span)[1]))


def check_text(
    text: str, file: str, *, off: frozenset[str] = frozenset()
) -> tuple[Contract | None, tuple[Diagnostic, ...]]:
    """The contract that a text declares, or None if it has errors; and all errors and lints."""
    found = clean_text(text, file)
    if isinstance(found, Diagnostic):
        return None, (found,)
    return check_sources([found], off=off)


def read_source(path: Path) -> Source | Diagnostic:
    """A file's text, or the error why it cannot be read."""
    file = str(path)
    start = Span(file, 1, 1, 1, 1)
    try:
        if not stat.S_ISREG(path.stat().st_mode) and not path.is_dir():  # opening a folder fails by itself
            return Diagnostic("RCL002", "the file cannot be read: it is a device or a pipe", start)
        with path.open("rb") as stream:
            data = stream.read(CONTRACT_BYTES + 1)
    except OSError as error:
        return Diagnostic("RCL002", f"the file cannot be read: {error.strerror or error}", start, hint=nearby(path))
    except ValueError:  # a NUL in the name
        return Diagnostic("RCL002", "the file cannot be read: its name is not a file name", start)
    return decode(data, file)


def decode(data: bytes, file: str) -> Source | Diagnostic:
    """The text of a file's (or a pipe's) bytes, or the error why they are not a text."""
    start = Span(file, 1, 1, 1, 1)
    if len(data) > CONTRACT_BYTES:
        return Diagnostic("RCL003", f"the file is larger than {CONTRACT_BYTES // 1_000_000} MB", start)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        begin = data.rfind(b"\n", 0, error.start) + 1
        column = len(data[begin : error.start].decode("utf-8", "replace")) + 1
        if b"\0" in data and data[:2] not in (b"\xff\xfe", b"\xfe\xff"):
            return Diagnostic("RCL005", "the file holds NUL characters: it is not a text", start)
        message = f"the file is not UTF-8: the byte 0x{data[error.start]:02X} cannot stand here"
        return Diagnostic("RCL004", message, Span(file, line, column, line, column + 1), hint="save the file as UTF-8")
    return clean_text(text, file)


def clean_text(text: str, file: str) -> Source | Diagnostic:
    """A text prepared for the lexer, without byte order mark and with plain line ends; or the error why it is not a
    text."""
    if len(text) > CONTRACT_BYTES:
        return Diagnostic("RCL003", f"the text is larger than {CONTRACT_BYTES // 1_000_000} MB", Span(file, 1, 1, 1, 1))
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    at = text.find("\0")
    if at >= 0:
        line, column = Source(file, text).place(at)
        message = "the file holds a NUL character: it is not a text"
        return Diagnostic("RCL005", message, Span(file, line, column, line, column + 1))
    return Source(file, text)


def check_sources(
    sources: Sequence[Source],
    *,
    off: frozenset[str] = frozenset(),
    partial: bool = False,
    shelf: Shelf | None = None,
) -> tuple[Contract | None, tuple[Diagnostic, ...]]:
    """As `check_paths`, for texts already read. `partial`: other files are missing, so names may be declared there."""
    contract, diagnostics = _checked(sources, off, partial, shelf)
    return (None if any(d.is_error for d in diagnostics) else contract), diagnostics


def warnings_of(texts: tuple[tuple[str, str], ...]) -> tuple[Contract | None, tuple[Diagnostic, ...]]:
    """As `check_sources` for (file, text) pairs, warnings only, for the texts that a report quotes. If the same texts
    were already checked under other file names, the spans in the contract have those names."""
    given = tuple(text for _, text in texts)
    known = _under.get(given, tuple(file for file, _ in texts))
    contract, found = check_sources([Source(file, text) for file, text in zip(known, given, strict=True)])
    names = dict(zip(known, (file for file, _ in texts), strict=True))

    def named(span: Span | None) -> Span | None:
        return span and replace(span, file=names.get(span.file, span.file))

    told = (d for d in found if d.severity is Severity.WARNING)
    return contract, tuple(
        replace(d, span=named(d.span), notes=tuple((text, named(span)) for text, span in d.notes)) for d in told
    )


_under: dict[tuple[str, ...], tuple[str, ...]] = {}
"""Recently checked texts → their file names, all distinct."""


_lately: dict[tuple[object, ...], tuple[Contract, tuple[Diagnostic, ...]]] = {}
"""Recent results: a run loads a contract, and then requests its diagnostics."""


def _checked(
    sources: Sequence[Source], off: frozenset[str], partial: bool, shelf: Shelf | None = None
) -> tuple[Contract, tuple[Diagnostic, ...]]:
    key = (*((s.file, s.text, s.line, s.column) for s in sources), off, partial)
    found = _lately.get(key)
    if found is None:
        names = tuple(source.file for source in sources)
        distinct = len(set(names)) == len(names)
        if not off and not partial and distinct:
            if len(_under) >= CONTRACTS_KEPT:
                _under.clear()
            _under[tuple(source.text for source in sources)] = names
        try:
            if shelf is not None and distinct and not partial:
                found = by_pieces(sources, off, shelf)
            found = found or _whole(sources, off, partial)
        except RecursionError:
            message = "a name is declared by another, that by another and so on, too many times"
            place = sources[0].span(0, 0)
            found = NOTHING, (Diagnostic("RCL110", message, place, hint="declare a name before those that use it"),)
        if len(_lately) >= CONTRACTS_KEPT:
            _lately.clear()
        _lately[key] = found
    return found


def _whole(sources: Sequence[Source], off: frozenset[str], partial: bool) -> tuple[Contract, tuple[Diagnostic, ...]]:
    parsed: list[tuple[FileSyntax, Reports]] = []
    linted: list[LintedFile] = []
    declarations = Declarations()
    for source in sources:
        reports = Reports(source)
        comments: list[Token] = []
        found = tokens(reports, comments)
        syntax = read(found, unless_torn(reports))
        parsed.append((syntax, reports))
        first = found[0].start if found else len(source.text)
        linted.append(LintedFile(syntax, tuple(comments), first, reports))
        declarations.environment.broken.update(syntax.broken)
    for syntax, reports in parsed:
        declarations.add(syntax.declarations, reports)
    if partial:
        declarations.environment.broken.add("*")
    declarations.elaborate()
    contract = _contract(parsed, declarations)
    sound = () if partial else sound_nodes(contract, [syntax for syntax, _ in parsed])
    faulty = partial or any(reports.failed for _, reports in parsed)
    lint(linted, sound, None if faulty else contract, off)
    return contract, tuple(d for _, reports in parsed for d in in_order(reports))


def check_in_part(
    sources: Sequence[Source], *, off: frozenset[str] = frozenset()
) -> tuple[Contract, tuple[Diagnostic, ...]]:
    """As `check_sources`, with as much of the contract as can be read if there are errors: to help its author, never
    for verification."""
    return _checked(sources, off, False)


def sound_nodes(contract: Contract, files: Sequence[FileSyntax]) -> tuple[Node, ...]:
    """The nodes of a contract that are complete: no part is missing because of an error."""
    written = {node.name.text: node for syntax in files for node in syntax.nodes}
    return tuple(node for node in contract.nodes if node.name in written and _is_whole(node, written[node.name]))


def _is_whole(node: Node, written: NodeSyntax) -> bool:
    lists = ((node.inputs, written.inputs), (node.outputs, written.outputs), (node.topics, written.topics))
    return (
        not written.broken
        and all(tree is not None and len(found) == len(tree.items) for found, tree in lists)
        and len(node.clauses) - len(node.implied) == len(written.clauses)
    )


def unless_torn(reports: Reports) -> Reports:
    """The reports for syntax errors: discarded if a comment swallows the rest of the file, since missing parts then
    mean nothing."""
    return Reports(reports.source) if any(d.code == "RCL103" for d in reports.found) else reports


def _contract(parsed: Sequence[tuple[FileSyntax, Reports]], declarations: Declarations) -> Contract:
    environment = declarations.environment
    places: dict[str, Span] = {}
    ready = []
    for syntax, reports in parsed:
        for node in syntax.nodes:
            name = node.name.text
            span = reports.source.span(node.name.start, node.name.end)
            if name and name in places:
                notes = ((f"the first node `{name}` is here", places[name]),)
                reports.error("RCL219", f"a second node `{name}`", node.name.start, node.name.end, notes=notes)
            places.setdefault(name, span)
            ready.append((node, *check_ports(node, declarations, reports), reports))
    nodes = tuple(check_node(node, i, o, declarations, reports) for node, i, o, reports in ready)
    return Contract(
        tuple(reports.source.file for _, reports in parsed),
        tuple(environment.types.items()),
        tuple(environment.constants.items()),
        nodes,
        tuple(entry.found for entry in declarations.definitions.values() if entry.found is not None),
    )


# --- formulas of other files -----------------------------------------------------------------------------------------


def parse_formula(
    text: str,
    node: Node | None = None,
    contract: Contract = NOTHING,
    span: Span | None = None,
    extra: Mapping[str, Sort] | None = None,
    *,
    roles: frozenset[Role] = BOTH_ROLES,
    remembers: bool = False,
    clause: bool = False,
) -> Term:
    """A formula given as text (in a plan, say) as a term of sort BOOL.

    With `node`, names mean what they mean in that node: ``in.v``, ``out.v``, or bare. Without, ports are written
    ``agent.command`` (``agent.in.phase`` or ``agent.out.phase`` if the node has both) and become
    ``Variable(role, "agent.command", sort)``. `extra` are further names, which become bound variables. `roles` are the
    roles that ports may have; a bare name then means the port of that role. With `remembers` it may refer to other
    steps; as a `clause`, it may be a response as well. `span` is the place of the text. Raises `Rejected` with every
    error.
    """
    tree, reports = syntax_of(text, span)
    checker = _checker(reports, node, contract, extra, roles, remembers=remembers or clause)
    read = checker.clause if clause else checker.formula
    return _sound(None if tree is None else read(tree), reports)


def parse_term(
    text: str,
    node: Node | None = None,
    contract: Contract = NOTHING,
    span: Span | None = None,
    *,
    sort: Sort | None = None,
) -> Term:
    """As `parse_formula`, for a term of any sort (``move(0, 1)``, ``red``); with `sort`, converted to that."""
    tree, reports = syntax_of(text, span)
    checker = _checker(reports, node, contract)
    if tree is None or sort is None:
        return _sound(None if tree is None else checker.term(tree), reports)
    return _sound(checker.wanted(tree, sort, "this"), reports)


def _sound(term: Term | None, reports: Reports) -> Term:
    if term is None or reports.failed:
        raise Rejected(*in_order(reports))
    return term


def syntax_of(
    text: str, span: Span | None, marked: Callable[[list[Token]], list[Token]] = list
) -> tuple[TermSyntax | None, Reports]:
    """The tree of a formula, or None if it has syntax errors, and its reports. `marked` may change the token types."""
    source = Source("<formula>", text) if span is None else Source(span.file, text, span.line, span.column)
    reports = Reports(source)
    found = marked(tokens(reports))
    if not found and not reports.failed:
        reports.error("RCL120", "there is no formula here", 0, len(text))
    return parse("formula", found, reports, found[-1].end) if found else None, reports


def one_step(tree: TermSyntax, reports: Reports, contract: Contract) -> Term | None:
    """A part of a formula's tree as a term, as by `parse_formula` without a node; None if it has errors, which are in
    `reports`."""
    return _checker(reports, None, contract).formula(tree)


def _checker(
    reports: Reports,
    node: Node | None,
    contract: Contract,
    extra: Mapping[str, Sort] | None = None,
    roles: frozenset[Role] = BOTH_ROLES,
    *,
    remembers: bool = False,
) -> Checker:
    bound = {name: Variable(Role.BOUND, name, of) for name, of in (extra or {}).items()}
    definitions = (*contract.definitions, *(node.definitions if node is not None else ()))
    defined = {d.name: Defined(d.parameters, found=d, state="done") for d in definitions if d.name not in bound}
    scope = Scope(of_contract(contract), bound=bound, roles=roles, remembers=remembers, defined=defined)
    if node is None:
        scope.nodes = {n.name: n for n in contract.nodes}
    else:
        scope.inputs = {p.name: p for p in (*node.inputs, *node.fixed)}
        scope.outputs = {p.name: p for p in node.outputs}
        scope.node = node.name
    return Checker(scope, reports)

"""Answers in the protocol's form: lines and UTF-16 columns for offsets, and the protocol's kinds for ours."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lsprotocol import types

from avow.base.codes import advice
from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.language.contract import ClauseKind
from avow.language.source import Source
from avow.language.syntax import ConstantDeclaration, Declaration, Define, TypeDeclaration
from avow.lsp.completion import Offer
from avow.lsp.features import Document
from avow.lsp.names import clause_names
from avow.sanity.document import Result

SEVERITIES = {
    Severity.ERROR: types.DiagnosticSeverity.Error,
    Severity.WARNING: types.DiagnosticSeverity.Warning,
    Severity.NOTE: types.DiagnosticSeverity.Information,
}
_DECLARED = {
    TypeDeclaration: ("type", types.SymbolKind.Struct),
    ConstantDeclaration: ("constant", types.SymbolKind.Constant),
    Define: ("definition", types.SymbolKind.Function),
}
_CLAUSES = {ClauseKind.ASSUMPTION: types.SymbolKind.Event, ClauseKind.GUARANTEE: types.SymbolKind.Function}


class Lines:
    """A text's lines, to go from offsets to the protocol's positions and back."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.source = Source("", text)

    def position(self, offset: int) -> types.Position:
        """The position of an offset."""
        line, column = self.source.place(offset)
        return types.Position(line - 1, units(self.text[offset - column + 1 : offset]))

    def offset(self, position: types.Position) -> int:
        """The offset of a position; a position beyond a line's end is that end."""
        at, end = self._line(position.line + 1)
        left: int = position.character
        while at < end and left > 0:
            left -= units(self.text[at])
            at += 1
        return at

    def range(self, start: int, end: int) -> types.Range:
        return types.Range(self.position(start), self.position(end))

    def of_span(self, span: Span) -> types.Range:
        return types.Range(self._of(span.line, span.column), self._of(span.end_line, span.end_column))

    def _of(self, line: int, column: int) -> types.Position:
        start, end = self._line(line)
        return types.Position(max(line - 1, 0), units(self.text[start : min(start + max(column - 1, 0), end)]))

    def _line(self, line: int) -> tuple[int, int]:
        """The start and end of a line, counted from 1; the text's end for a line after the last."""
        start = self.source.offset(line, 1)
        end = self.text.find("\n", start)
        return start, len(self.text) if end < 0 else end


def units(text: str) -> int:
    """The length in UTF-16 code units, in which the protocol counts columns."""
    return len(text.encode("utf-16-le", "surrogatepass")) // 2


def diagnostic(found: Diagnostic, document: Document, lines: Lines) -> types.Diagnostic:
    """A message, with its hint on a line of its own."""
    nowhere = Span(document.file, 1, 1, 1, 1)
    related = [
        types.DiagnosticRelatedInformation(
            types.Location(Path(place.file).resolve().as_uri(), lines.of_span(place)), note
        )
        for note, place in found.notes
        if place is not None and place.file == document.file
    ]
    arguments: dict[str, Any] = {"related_information": related} if related else {}
    return types.Diagnostic(
        range=lines.of_span(found.span or nowhere),
        message="\n".join(filter(None, (found.message, advice(found)))),
        severity=SEVERITIES[found.severity],
        code=found.code,
        source="avow",
        **arguments,
    )


def refuted(answer: Result, place: types.Range) -> types.Diagnostic:
    """A sanity claim that does not hold, at its clause or node."""
    severity = types.DiagnosticSeverity.Error if answer.severity == "error" else types.DiagnosticSeverity.Warning
    said = [f"{answer.name} is {answer.verdict}: {answer.explanation or answer.claim}"]
    said += [answer.counterexample.text] if answer.counterexample else []
    return types.Diagnostic(place, "\n".join(said), severity=severity, code=answer.name, source="avow sanity")


def outline(document: Document, lines: Lines) -> list[types.DocumentSymbol]:
    """The context's declarations, the nodes, and their definitions and clauses."""

    def declared(tree: Declaration) -> types.DocumentSymbol:
        kind, symbol = _DECLARED[type(tree)]
        return _symbol(tree.name.text, symbol, lines.range(tree.start, tree.end), kind)

    syntax = document.taken_apart.syntax
    found = [declared(tree) for tree in syntax.declarations]
    for node in syntax.nodes:
        inner = [declared(definition) for definition in node.definitions]
        for clause, (meaning, _, _, _) in zip(node.clauses, clause_names(node), strict=True):
            sentence = clause.sentence.text.strip('"') if clause.sentence else ""
            place = lines.range(clause.start, clause.end)
            inner.append(_symbol(meaning.name, _CLAUSES[clause.kind], place, sentence))
        place = lines.range(node.start, node.end)
        found.append(_symbol(node.name.text, types.SymbolKind.Class, place, "node", inner))
    return found


def _symbol(
    name: str, kind: types.SymbolKind, place: types.Range, detail: str, inner: Sequence[types.DocumentSymbol] = ()
) -> types.DocumentSymbol:
    return types.DocumentSymbol(name or "(no name)", kind, place, place, detail, children=list(inner))


def completion_item(offer: Offer, number: int, snippets: bool) -> types.CompletionItem:
    """`number`: its place in the list, which is the order in which the editor shows it."""
    template = offer.template if snippets and offer.template else ""
    return types.CompletionItem(
        label=offer.label,
        kind=types.CompletionItemKind[offer.kind],
        detail=offer.detail or None,
        documentation=offer.about or None,
        insert_text=template or offer.label,
        insert_text_format=types.InsertTextFormat.Snippet if template else types.InsertTextFormat.PlainText,
        sort_text=f"{number:04}",
    )

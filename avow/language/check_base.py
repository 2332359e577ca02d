"""What every part of the formula checker shares: reporting, and the terms of several trees."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence

from avow.base.diagnostics import Span
from avow.language.conversions import convert
from avow.language.lexer import Token
from avow.language.printer import show_sort
from avow.language.scope import Scope
from avow.language.sorts import BOOL, INTEGER, NATURAL, FunctionSort, Sort
from avow.language.source import Reports
from avow.language.syntax import Syntax, TermSyntax
from avow.language.terms import Construct, EnumValue, Past, Term


class Base(ABC):
    """A formula's scope, and where to report. The scope's `bound` variables change on the way and are as before
    afterwards."""

    def __init__(self, scope: Scope, reports: Reports) -> None:
        self.scope = scope
        self.reports = reports

    def formula(self, tree: TermSyntax) -> Term | None:
        """A term of sort BOOL."""
        term = self.term(tree, BOOL)
        if term is None or term.sort == BOOL:
            return term
        if self._at_least(tree):
            return None
        shown = show_sort(term.sort)
        hint = "compare it with something: `… == …`"
        if isinstance(term, EnumValue | Construct):
            hint = "compare each time: `s == red or s == green`, or `s in {red, green}`"
        if isinstance(term.sort, FunctionSort) and term.sort.result == BOOL:
            hint = f"apply it to its {len(term.sort.parameters)} argument(s)"
        self.error("RCL301", f"this must be true or false, and it is of type {shown}", tree, hint=hint)
        return None

    def _at_least(self, tree: TermSyntax) -> bool:
        """Whether a term stands beside `=>`, which has been reported: it may have been meant for at least."""
        text = self.reports.source.text
        return bool(self.reports.odd) and (
            text[tree.end : tree.end + 20].lstrip().startswith("=>")
            or text[max(tree.start - 20, 0) : tree.start].rstrip().endswith("=>")
        )

    @abstractmethod
    def term(self, tree: TermSyntax, expected: Sort | None = None) -> Term | None:
        """A term of any sort; `expected` helps only where the text leaves the sort open (``<>``)."""

    @abstractmethod
    def history(self, tree: TermSyntax, operator: Past, arguments: Sequence[TermSyntax]) -> Term | None:
        """A form that speaks of other steps than this one."""

    @abstractmethod
    def defined(self, tree: Syntax, name: str, arguments: Sequence[TermSyntax]) -> Term | None:
        """What a definition of the scope says of these arguments."""

    def error(
        self,
        code: str,
        message: str,
        at: Syntax | Token,
        *,
        hint: str | None = None,
        notes: tuple[tuple[str, Span | None], ...] = (),
    ) -> None:
        self.reports.error(code, message, at.start, at.end, hint=hint, notes=notes)

    def span(self, tree: Syntax | Token) -> Span:
        return self.reports.source.span(tree.start, tree.end)

    def places(self, trees: Sequence[TermSyntax]) -> Callable[[int, int], Span]:
        """Of parts that stand one after another: the place from one of them to another."""
        return lambda first, last: self.reports.source.span(trees[first].start, trees[last].end)

    def text(self, tree: Syntax) -> str:
        text = " ".join(self.reports.source.text[tree.start : tree.end].split())
        return text if len(text) <= 40 else text[:39] + "…"

    def terms(self, trees: Iterable[TermSyntax]) -> list[Term | None]:
        return [self.term(t) for t in trees]

    def wanted(self, tree: TermSyntax, sort: Sort, what: str) -> Term | None:
        """The term, converted to the sort that its place asks for."""
        term = self.term(tree, sort)
        if term is None:
            return None
        converted = convert(term, sort)
        if converted is None:
            hint = None
            if sort == NATURAL and term.sort == INTEGER:
                hint = "it may be negative; say it the other way round, as in `exists(j in NATURAL | j + 1 == i and …)`"
            message = f"{what} must be of type {show_sort(sort)} and is of type {show_sort(term.sort)}"
            self.error("RCL303", message, tree, hint=hint)
        return converted

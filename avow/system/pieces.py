"""The parts of a YAML document with their places: as `Piece`, which the readers of a plan go through, and as plain data
whose places can be looked up (`Located`), which a plan keeps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field, replace
from typing import Any

from avow.base.diagnostics import Span
from avow.base.records import dataclass


@dataclass(slots=True)
class Piece:
    """A scalar (`value`), a list (`items`) or a mapping (`entries`: key → piece), with its place.

    `text` is a scalar exactly as written, for cells of tables, where ``2.30`` must not become another number.
    """

    span: Span
    value: Any = None
    text: str = ""
    items: list[Piece] | None = None
    entries: dict[str, Piece] | None = None
    keys: dict[str, Span] = field(default_factory=dict)
    quoted: bool = False

    @property
    def inner(self) -> Span:
        """The place of a scalar's text, without quotation marks."""
        start, end = self.span.column + self.quoted, self.span.end_column - self.quoted
        return replace(self.span, column=start, end_column=end)

    @property
    def data(self) -> Any:
        """Plain data."""
        if self.entries is not None:
            return {key: piece.data for key, piece in self.entries.items()}
        if self.items is not None:
            return [piece.data for piece in self.items]
        return self.value

    def located(self) -> Located:
        """The same as plain data with the places of its parts."""
        return Located(self.data, self.span, self)

    def parts(self, *path: str | int) -> Iterator[tuple[tuple[str | int, ...], Piece]]:
        """Itself and everything in it, each with its path."""
        yield path, self
        for key, child in (self.entries or {}).items():
            yield from child.parts(*path, key)
        for index, child in enumerate(self.items or ()):
            yield from child.parts(*path, index)

    def at(self, *path: str | int) -> Piece | None:
        """The piece at a path, or None."""
        piece: Piece | None = self
        for step in path:
            if piece is None:
                return None
            if isinstance(step, int):
                items = piece.items
                piece = items[step] if items is not None and 0 <= step < len(items) else None
            else:
                piece = piece.entries.get(step) if piece.entries is not None else None
        return piece

    def each(self, *path: str | int) -> list[Piece]:
        """The pieces of the list at a path; a piece that is not a list counts as a list of one."""
        piece = self.at(*path)
        return [] if piece is None else [piece] if piece.items is None else piece.items

    def texts(self, *path: str | int) -> tuple[str, ...]:
        """The texts of `each`."""
        return tuple(item.text for item in self.each(*path))

    def said(self, *path: str | int) -> str | None:
        """The text at a path; None if it is missing."""
        piece = self.at(*path)
        return None if piece is None else piece.text

    def words(self) -> dict[str, str]:
        """The texts of a mapping, with single blanks."""
        return {key: " ".join(part.text.split()) for key, part in (self.entries or {}).items() if part.items is None}

    def keyed(self, *path: str | int) -> Iterator[tuple[str, Span, Piece]]:
        """Each key of the mapping at a path, with its position and its value."""
        piece = self.at(*path)
        if piece is not None and piece.entries is not None:
            for name, inner in piece.entries.items():
                yield name, piece.key_span(name), inner

    def key_span(self, key: str) -> Span:
        """The place of a key of this mapping."""
        return self.keys.get(key, self.span)


@dataclass(frozen=True, slots=True)
class Located:
    """A piece as plain data whose places can be looked up, also once some of the data is left out."""

    data: Any
    span: Span
    spans: Piece | None = field(default=None, compare=False, repr=False)
    """The piece that it was read from, if any: it has the places of the parts."""
    key_span: Span | None = field(default=None, compare=False, repr=False)
    """The place of its own key."""

    def key(self, *path: str | int) -> Span:
        """The place of a part's key; of its value, if it has none."""
        if not path:
            return self.key_span or self.span
        *above, name = path
        around = self.spans.at(*above) if self.spans is not None else None
        return (around.keys.get(str(name)) if around is not None else None) or self.at(*path)

    def at(self, *path: str | int) -> Span:
        """The place of a part, such as ``("predicates", "in.r")`` or ``("select", 0)``; of the nearest enclosing part,
        if it has none."""
        piece, span = self.spans, self.span
        for step in path:
            piece = piece.at(step) if piece is not None else None
            span = piece.span if piece is not None else span
        return span

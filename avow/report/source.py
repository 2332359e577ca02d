"""Contracts and plan as written, for the HTML page: numbered lines, coloured by Pygments, with the result for each.

A comment may hold anything, so every piece of text is escaped here, and invisible characters that change the reading
(direction controls, invisible blanks) are shown by their code points.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache

from markupsafe import Markup, escape
from pygments.lexer import Lexer
from pygments.lexers.data import YamlLexer
from pygments.token import Comment, Keyword, Name, Number, Operator, String, _TokenType

from avow.assurance.answers import Tone
from avow.assurance.model import Case, ObligationView, SourceView
from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.tuning.shown import ANCHORED_LINES, COLOURED_CHARACTERS
from avow.evidence.obligation import Kind
from avow.language.pygments_lexer import RclLexer
from avow.report.parts import NOTHING_KEPT, Parts
from avow.report.wording import MARKS, anchor, clean, page_of, tone

_COLOURS: tuple[tuple[_TokenType, str], ...] = (
    (Comment, "c"),
    (Keyword.Type, "t"),
    (Keyword, "k"),
    (Operator.Word, "k"),
    (String, "s"),
    (Number, "m"),
    (Name.Label, "l"),
    (Name.Tag, "l"),
    (Name.Class, "l"),
    (Name.Variable, "v"),
)
"""Pygments' token types → the style sheet's classes (``.src .c``…); other types have the text's colour."""

_HIDDEN = re.compile("[\r\u00ad\u061c\u180e\u200b-\u200f\u202a-\u202e\u2060-\u2069\ufeff\u2028\u2029\u0085]")
"""Characters that are invisible, or reverse the order of the text after them: a comment could make code look like a
comment."""


def _line_anchor(number: int, line: int) -> str:
    """The fragment of a line of the `number`-th text, counted from 1."""
    return f"s{number}-{line}"


def places(case: Case) -> Mapping[str, tuple[int, int]]:
    """Path → (number of the text, its lines), for links to lines."""
    return {s.path: (at, len(visible_lines(s.text))) for at, s in enumerate(case.sources, 1)}


def location(span: Span | None, known: Mapping[str, tuple[int, int]]) -> Markup:
    """``contracts/x/system.rcl:12``, as a link to the line if the text is on the page; empty without a position."""
    if span is None:
        return Markup()
    shown = escape(f"{span.file}:{span.line}")
    number, lines = known.get(span.file, (0, 0))
    if not 1 <= span.line <= lines:
        return shown
    return Markup(f'<a href="contracts.html#{_line_anchor(number, span.line)}">{shown}</a>')  # escaped above


def lines_of(case: Case, number: int, parts: Parts = NOTHING_KEPT) -> Markup:
    """The `number`-th text, line by line; a guarantee's or a requirement's line has its result beside it."""
    source = case.sources[number - 1]
    notes: dict[int, list[str]] = {}
    needed: set[int] = set()
    for span, note in _pointing(case):
        if span.file == source.path:
            needed.add(span.line)
            notes.setdefault(span.line, []).extend([note] if note else [])
    lines = _coloured(source, parts)
    rows = []
    for at, shown in enumerate(lines, 1):
        name = f' id="{_line_anchor(number, at)}"' if len(lines) <= ANCHORED_LINES or at in needed else ""
        rows.append(f"<div{name}>{''.join(notes.get(at, ()))}{shown or ' '}</div>")
    return Markup("".join(rows))  # every piece is escaped


def _pointing(case: Case) -> Iterator[tuple[Span, str]]:
    """Everything in the report that has a position: the position, and a mark to put there if a person wrote the
    claim."""
    for view in case.obligations:
        if view.obligation.span is not None:
            yield view.obligation.span, _mark(view) if view.obligation.kind is Kind.GUARANTEE else ""
    for r in case.requirements:
        if r.span is not None:
            shade = {Tone.GREEN: "good", Tone.AMBER: "fair", Tone.RED: "bad", Tone.GREY: "open"}[r.tone]
            yield (
                r.span,
                _note(f"argument.html#{anchor('requirement:' + r.id)}", shade, r.tone.mark, f"{r.id} {r.level}"),
            )


def _mark(view: ObligationView) -> str:
    said = f"{view.obligation.name} {view.standing.value}"
    return _note(f"{page_of(view.obligation.node)}#{anchor(view.id)}", tone(view.standing), MARKS[view.standing], said)


def _note(place: str, shade: str, mark: str, text: str) -> str:
    return f'<a class="came {shade}" href="{place}"><span aria-hidden="true">{mark}</span> {escape(clean(text))}</a>'


@cache
def _lexer(is_contract: bool) -> Lexer:
    return RclLexer(stripnl=False, ensurenl=False) if is_contract else YamlLexer(stripnl=False, ensurenl=False)


@cache
def _colour(kind: _TokenType) -> str:
    """The style sheet's name for a kind of token; empty for most."""
    return next((name for found, name in _COLOURS if kind in found), "")


def _coloured(source: SourceView, parts: Parts) -> list[str]:
    """The text's lines as HTML. A contract without comments of several lines is coloured node by node."""
    if len(source.text) > COLOURED_CHARACTERS:
        return [_shown(line) for line in visible_lines(source.text)]
    text = "\n".join(visible_lines(source.text))
    pieces = _NODES.split(text) if source.is_contract and "/*" not in text else [text]
    texts = (parts.text("contracts", sha256(piece), _in_colours, piece, source.is_contract) for piece in pieces)
    return "\n".join(texts).split("\n")


_NODES = re.compile(r"\n(?=node\b)")


def _in_colours(text: str, is_contract: bool) -> str:
    lines = [""]
    for _, kind, value in _lexer(is_contract).get_tokens_unprocessed(text):
        colour = _colour(kind)
        for at, piece in enumerate(value.split("\n")):
            if at:
                lines.append("")
            if piece:
                shown = _shown(piece)
                lines[-1] += f'<span class="{colour}">{shown}</span>' if colour else shown
    return "\n".join(lines)


def _shown(piece: str) -> str:
    escaped = str(escape(clean(piece)))
    return _HIDDEN.sub(lambda m: f'<span class="odd" title="not visible">U+{ord(m.group()):04X}</span>', escaped)


def visible_lines(text: str) -> list[str]:
    """The lines as the compiler counts them: only a line feed ends a line."""
    lines = [line.removesuffix("\r") for line in text.split("\n")]
    return lines[:-1] if len(lines) > 1 and not lines[-1] else lines


def plain_lines(source: SourceView) -> Iterable[str]:
    """The lines for formats without markup of their own; invisible characters are shown by their code points."""
    for line in visible_lines(source.text):
        yield _HIDDEN.sub(lambda m: f"<U+{ord(m.group()):04X}>", clean(line))

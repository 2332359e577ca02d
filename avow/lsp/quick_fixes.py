"""Quick fixes: the hint that a message carries, done.

What a hint proposes is read from its words (``did you mean `red`?``, ``write `==` …``, ``remove it``, ``close it with
`}` ``). It is proposed as a fix only where it helps: the text with the change is checked again, the message is gone and
no error has come instead.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

from avow.base.diagnostics import Diagnostic
from avow.base.tuning.running import FIXES_TRIED
from avow.language.source import Source

_QUOTED = re.compile(r"`` ?([^`]+) ?``|`([^`\n]+)`|\bwrite '([^'\n]+)'")
_MEANT = re.compile(r"did you mean `([^`\n]+)`\?")
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_']*")

Check = Callable[[str], tuple[Diagnostic, ...]]
"""A text → what there is to say of it."""


@dataclass(frozen=True, slots=True)
class Fix:
    """A change of a text that does what a message's hint says."""

    title: str
    start: int
    end: int
    text: str


def fixes(diagnostic: Diagnostic, text: str, check: Check, most: int = 3) -> tuple[Fix, ...]:
    """The fixes of one message about a text; none where its hint proposes nothing that helps."""
    if diagnostic.span is None or not diagnostic.hint:
        return ()
    source, span = Source("", text), diagnostic.span
    start, end = source.offset(span.line, span.column), source.offset(span.end_line, span.end_column)
    before = check(text)
    good: dict[str, Fix] = {}
    for fix in islice(_candidates(diagnostic, text, start, end), FIXES_TRIED):
        if fix.title not in good and _helps(fix, diagnostic, text, before, check):
            good[fix.title] = fix
        if len(good) == most:
            break
    return tuple(good.values())


def _helps(fix: Fix, diagnostic: Diagnostic, text: str, before: tuple[Diagnostic, ...], check: Check) -> bool:
    """Whether the message is gone, and nothing has come instead that is as bad."""
    after = check(text[: fix.start] + fix.text + text[fix.end :])
    errors, were = (sum(d.is_error for d in each) for each in (after, before))
    codes, had = (Counter(d.code for d in each) for each in (after, before))
    gone = codes[diagnostic.code] < had[diagnostic.code]
    return gone and (errors < were if diagnostic.is_error else errors == were and len(after) < len(before))


def _candidates(diagnostic: Diagnostic, text: str, start: int, end: int) -> Iterator[Fix]:
    hint = diagnostic.hint or ""
    shown = text[start:end]
    if meant := _MEANT.search(hint):
        yield from _instead(meant[1], text, start, end)
    if "remove it" in hint or "delete it" in hint:
        after = end + 1 if text[end : end + 1] == " " and text[max(start - 1, 0)] in " \n" else end
        yield Fix(f"Remove `{shown}`" if len(shown) < 30 else "Remove it", start, after, "")
    if "end every declaration with `;`" in hint:
        yield Fix("Write `;`", end, end, ";")
        return
    if "close it with" in hint:
        yield from _closed(diagnostic, hint, text, start)
        return
    for match in _QUOTED.finditer(hint):
        proposal = match[1] or match[2] or match[3]
        commented = "//" in shown or "/*" in shown
        if "…" in proposal or "NAME" in proposal or (commented and len(proposal.split()) > 1):
            continue
        if f'"{proposal}"' in shown:
            at = start + shown.index(f'"{proposal}"')
            yield Fix(f"Write `{proposal}`", at, at + len(proposal) + 2, proposal)
        yield from _instead(proposal, text, start, end)
        if diagnostic.is_error and len(proposal.split()) == 1:
            yield Fix(f"Write `{proposal}`", end, end, f" {proposal}" if proposal[:1].isalnum() else proposal)
            yield Fix(f"Write `{proposal}`", start, start, f"{proposal} ")
        head = _WORD.match(proposal)
        if head and proposal[head.end() :].startswith("("):
            yield from _instead(head[0], text, start, end)


def _instead(proposal: str, text: str, start: int, end: int) -> Iterator[Fix]:
    """The proposal in place of all that the message is about, or of a word of it."""
    title = f"Write `{proposal}`"
    yield Fix(title, start, end, proposal)
    words = list(_WORD.finditer(text, start, end))
    for word in reversed(words[:1] + words[-1:]):
        yield Fix(title, word.start(), word.end(), proposal)


def _closed(diagnostic: Diagnostic, hint: str, text: str, start: int) -> Iterator[Fix]:
    """What is missing, put where the message says that it should be, or at the end of the line or the text."""
    sign = next((m[1] or m[2] for m in _QUOTED.finditer(hint)), "")
    title = f"Close it with `{sign}`"
    for _, span in diagnostic.notes:
        if span is not None:
            at = len(text[: Source("", text).offset(span.line, span.column)].rstrip())
            yield Fix(title, at, at, f" {sign}")
    line_end = text.find("\n", start)
    at = line_end if line_end >= 0 else len(text)
    yield Fix(title, at, at, sign)
    at = len(text.rstrip())
    yield Fix(title, at, at, f"\n{sign}" if sign == "}" else f" {sign}")
    yield Fix(title, at, at, f"\n{sign}\n")

"""Quick fixes: the hint of a message, applied.

The proposal of a hint is read from its words (``did you mean `red`?``, ``write `==` …``, ``remove it``, ``close it with
`}` ``). It is proposed as a fix only if it helps: the text with the change is checked again, the message is gone and no
new error has appeared.
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
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_']*")

_MOST = 3
"""Fixes of one message."""

Check = Callable[[str], tuple[Diagnostic, ...]]
"""A text → its diagnostics."""


@dataclass(frozen=True, slots=True)
class Fix:
    """A change of a text that applies a message's hint."""

    title: str
    start: int
    end: int
    text: str


def fixes(diagnostic: Diagnostic, text: str, check: Check) -> tuple[Fix, ...]:
    """The fixes of one message about a text; none if its hint proposes nothing that helps."""
    if diagnostic.span is None or not diagnostic.hint:
        return ()
    source, span = Source("", text), diagnostic.span
    start, end = source.offset(span.line, span.column), source.offset(span.end_line, span.end_column)
    before = check(text)
    good: dict[str, Fix] = {}
    for fix in islice(_candidates(diagnostic, text, start, end), FIXES_TRIED):
        if fix.title not in good and _helps(fix, diagnostic, text, before, check):
            good[fix.title] = fix
        if len(good) == _MOST:
            break
    return tuple(good.values())


def _helps(fix: Fix, diagnostic: Diagnostic, text: str, before: tuple[Diagnostic, ...], check: Check) -> bool:
    """Whether the message is gone, and nothing equally bad has appeared."""
    after = check(text[: fix.start] + fix.text + text[fix.end :])
    errors, were = (sum(d.is_error for d in each) for each in (after, before))
    codes, had = (Counter(d.code for d in each) for each in (after, before))
    gone = codes[diagnostic.code] < had[diagnostic.code]
    return gone and (errors < were if diagnostic.is_error else errors == were and len(after) < len(before))


def _candidates(diagnostic: Diagnostic, text: str, start: int, end: int) -> Iterator[Fix]:
    hint, shown = diagnostic.hint or "", text[start:end]
    if "remove it" in hint or "delete it" in hint:
        after = end + 1 if text[end : end + 1] == " " and text[max(start - 1, 0)] in " \n" else end
        yield Fix("Remove it", start, after, "")
    proposals = [next(filter(None, match.groups())) for match in _QUOTED.finditer(hint)]
    if "close it with" in hint:
        places = [len(text[: Source("", text).offset(s.line, s.column)].rstrip()) for _, s in diagnostic.notes if s]
        line_end = text.find("\n", start)
        for at in (*places, line_end if line_end >= 0 else len(text), len(text.rstrip())):
            yield Fix(f"Close it with `{proposals[0]}`", at, at, f" {proposals[0]}")
        return
    for proposal in proposals:
        if "…" in proposal or "NAME" in proposal:
            continue
        title = f"Write `{proposal}`"
        if (at := shown.find(f'"{proposal}"')) >= 0:
            yield Fix(title, start + at, start + at + len(proposal) + 2, proposal)
        head = _WORD.match(proposal)
        applied = head is not None and proposal[head.end() :].startswith("(")
        for written in (proposal, head[0]) if head is not None and applied else (proposal,):
            yield Fix(title, start, end, written)
            words = list(_WORD.finditer(text, start, end))
            yield from (Fix(title, *word.span(), written) for word in reversed(words[:1] + words[-1:]))
        if diagnostic.is_error and len(proposal.split()) == 1:
            yield Fix(title, end, end, f" {proposal}" if proposal[:1].isalnum() else proposal)
            yield Fix(title, start, start, f"{proposal} ")

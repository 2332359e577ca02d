"""Two states of a case compared on a page, with the same changes as the terminal and the report have. Styled as the
report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from avow.assurance.answers import ChangeLine
from avow.assurance.changes import MARKS, is_worse
from avow.base.tuning.shown import CHANGES_UNFOLDED
from avow.report.page import fill


def render_comparison(old: str, new: str, changes: Sequence[tuple[str, ChangeLine]]) -> str:
    """The page. `old` and `new` are the two states as the reader named them; each of `changes` comes with its
    system."""
    worse = sum(is_worse(change) for _, change in changes)
    return fill(
        "compare.html.j2",
        old=old,
        new=new,
        line=_line(changes),
        banner="bad" if worse else "open" if any(c.kind in ("edit", "meaning") for _, c in changes) else "good",
        systems={
            name: [c for n, c in changes if n == name and c.kind != "rerun"]
            for name in dict.fromkeys(name for name, c in changes if c.kind != "rerun")
        },
        marks=MARKS,
        folded=CHANGES_UNFOLDED,
    )


_WORDS = {
    "✘": "no longer shown",
    "▼": "weaker, or more assumed",
    "▲": "better",
    "≠": "changed",
    "+": "new",
    "⟲": "re-run with the same answer",
}


def _line(changes: Sequence[tuple[str, ChangeLine]]) -> str:
    """How many changes have each mark, in the words of the mark."""
    if not changes:
        return "Nothing changed."
    number = Counter(MARKS.get(change.kind, "▼") for _, change in changes)
    if set(number) == {"⟲"}:
        return "Re-run; every answer is the same."
    return "; ".join(f"{mark} {number[mark]} {words}" for mark, words in _WORDS.items() if number[mark])

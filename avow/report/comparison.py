"""Two states of a case compared on a page, with the same changes as the terminal and the report have. Styled as the
report."""

from __future__ import annotations

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
        line=_line(changes, worse),
        banner="bad" if worse else "open" if any(c.kind in ("edit", "meaning") for _, c in changes) else "good",
        systems={name: [c for n, c in changes if n == name] for name in dict.fromkeys(name for name, _ in changes)},
        marks=MARKS,
        folded=CHANGES_UNFOLDED,
    )


def _line(changes: Sequence[tuple[str, ChangeLine]], worse: int) -> str:
    if not changes:
        return "Nothing changed."
    if all(change.kind == "rerun" for _, change in changes):
        return "Re-run; every answer is the same."
    return f"{worse} of {len(changes)} changes are for the worse." if worse else "Nothing is worse than before."

"""Two states of a case compared on a page: what was lost, gained and re-run, and why. Styled as the report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from avow.assurance.compare import ORDER, Change
from avow.base.tuning.shown import CHANGES_UNFOLDED
from avow.evidence.status import Status
from avow.report.page import fill

_KINDS = {
    "requirement": ("Requirements and hazards: what each was and is, and the edit", "requirements and hazards", ""),
    "gate": ("Gates of the policy", "of the gates changed", ""),
    "worse": ("Lost: claims that stand worse", "worse", "bad"),
    "removed": ("Gone: claims that are not made any more", "gone", "open"),
    "assumption": ("Assumed now, without being shown", "assumed now", "open"),
    "meaning": ("Changed meaning: another claim under the same name", "changed meaning", "open"),
    "added": ("New claims", "new", "fair"),
    "better": ("Gained: claims that stand better", "better", "good"),
    "rerun": ("Re-run, with the same verdict", "re-run", "plain"),
}
"""For each kind its heading, the word after its number, and its colour (empty: computed from the changes)."""


def render_comparison(old: str, new: str, changes: Sequence[tuple[str, Change]]) -> str:
    """The page. `old` and `new` are the two states as the reader named them; each of `changes` comes with its
    system."""
    systems = {}
    for system in dict.fromkeys(name for name, _ in changes):
        mine = [change for name, change in changes if name == system]
        systems[system] = [(kind, [c for c in mine if c.kind == kind]) for kind in ORDER]
    counts = Counter(change.kind for _, change in changes)
    lost = sum(c.is_worse and c.kind != "removed" for _, c in changes)
    return fill(
        "compare.html.j2",
        old=old,
        new=new,
        line=_line(counts, lost),
        banner="bad" if lost else "open" if counts["removed"] or counts["meaning"] else "good",
        systems=systems,
        counts=[(kind, counts[kind], _KINDS[kind][1], _tone(kind, changes)) for kind in ORDER if counts[kind]],
        headings={kind: heading for kind, (heading, _, _) in _KINDS.items()},
        known={status.value for status in Status},
        folded=CHANGES_UNFOLDED,
    )


def _line(counts: Counter[str], lost: int) -> str:
    if not counts:
        return "Nothing changed."
    if set(counts) == {"rerun"}:
        return "Asked again; every verdict is the same."
    if lost:
        return f"{lost} {'thing stands' if lost == 1 else 'things stand'} worse than before."
    if counts["removed"] or counts["meaning"]:
        return "Nothing stands worse, but some claims are gone or mean something else."
    return "Nothing stands worse than before."


def _tone(kind: str, changes: Sequence[tuple[str, Change]]) -> str:
    worse = any(c.is_worse for _, c in changes if c.kind == kind)
    return _KINDS[kind][2] or ("bad" if worse else "good")

"""Two states of a case side by side, as a page: what was lost, gained, asked again, and why. Looks like the report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from markupsafe import Markup

from avow.assurance.compare import ORDER, Change
from avow.base.tuning.shown import CHANGES_UNFOLDED
from avow.evidence.status import Status
from avow.report.page import asset, environment

_HEADINGS = {
    "gate": "Gates of the policy",
    "worse": "Lost: claims that stand worse",
    "removed": "Gone: claims that are not made any more",
    "supposition": "Supposed now, without being shown",
    "meaning": "Changed meaning: another claim under the same name",
    "added": "New claims",
    "better": "Gained: claims that stand better",
    "rerun": "Asked again, with the same verdict",
}
_WORDS = {
    "gate": "of the gates changed",
    "worse": "worse",
    "removed": "gone",
    "supposition": "supposed now",
    "meaning": "changed meaning",
    "added": "new",
    "better": "better",
    "rerun": "asked again",
}
_TONES = {
    "worse": "bad",
    "removed": "open",
    "supposition": "open",
    "meaning": "open",
    "added": "fair",
    "better": "good",
    "rerun": "plain",
}


def render_comparison(old: str, new: str, changes: Sequence[tuple[str, Change]]) -> str:
    """The page. `old` and `new` are what the reader asked to compare, as given; `changes` are with their systems."""
    systems = {}
    for system in dict.fromkeys(name for name, _ in changes):
        mine = [change for name, change in changes if name == system]
        systems[system] = [(kind, [c for c in mine if c.kind == kind]) for kind in ORDER]
    counts = Counter(change.kind for _, change in changes)
    lost = sum(c.is_worse and c.kind != "removed" for _, c in changes)
    return (
        environment()
        .get_template("compare.html.j2")
        .render(
            old=old,
            new=new,
            line=_line(counts, lost),
            banner="bad" if lost else "open" if counts["removed"] or counts["meaning"] else "good",
            systems=systems,
            counts=[(kind, counts[kind], _WORDS[kind], _tone(kind, changes)) for kind in ORDER if counts[kind]],
            headings=_HEADINGS,
            known={status.value for status in Status},
            folded=CHANGES_UNFOLDED,
            style=Markup(asset("style.css")),  # our own file
        )
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
    if kind != "gate":
        return _TONES[kind]
    return "bad" if any(c.kind == "gate" and c.after == "fails" for _, c in changes) else "good"

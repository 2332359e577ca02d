"""Changes between two states of a case: one list, which the report, `avow diff` and its page print."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from fractions import Fraction
from itertools import takewhile

from avow.assurance.answers import ChangeLine, Changes, Level
from avow.assurance.deficits import SEVERITIES, words_of
from avow.assurance.model import Case
from avow.assurance.naming import cut, short
from avow.assurance.policy import CRITICALITIES
from avow.assurance.state import OF_RECORDS, State, Value, shown_by, state_of, state_of_signature
from avow.base.plain import count, listed
from avow.base.tuning.shown import EDIT_CHARACTERS
from avow.base.verdict import Isolation
from avow.evidence.status import Status
from avow.system.statements import GENERAL

KINDS = (
    *("open", "gone", "demand", "weaker", "expired", "assumption", "deficit"),
    *("edit", "meaning", "new", "better", "rerun"),
)
"""Worst first. ``demand``: the case asks for less, or judges a hazard otherwise; ``rerun``: with the same answer."""
MARKS = {"open": "✘", "better": "▲", "edit": "≠", "meaning": "≠", "new": "+", "rerun": "⟲"}
"""Of the other kinds: ▼."""
EDITED = 60
"""Characters of a formula, old or new, in a line about its edit; the row of the change has it in full."""
_FIRST = ("hazard", "requirement")
_ABOUT = (*_FIRST, "gate", "policy", "node", "claim", "evidence")
_LEVELS = [level.value for level in reversed(Level)]
_STATUSES = [status.value for status in sorted(Status, key=lambda status: status.rank)]
_LOST = ("open", "gone", "demand", "weaker")


def is_worse(change: ChangeLine) -> bool:
    """Whether less is shown, demanded or evidenced than before, or more assumed that does not come with every answer of
    its kind."""
    return change.kind in (*_LOST, "expired", "assumption") and change.subject not in GENERAL


def changes(case: Case) -> Changes:
    """The differences from the last signed report, worst first; re-runs with the same answer are only counted."""
    signed = case.baseline
    if signed is None:
        return Changes("")
    found = compare(state_of_signature(signed), state_of(case))
    again = sum("/guarantee/" in change.subject for change in found if change.kind == "rerun")
    entries = tuple(change for change in found if change.kind != "rerun")
    return Changes(f"{signed.who}, {signed.signed_on}", entries, again)


def compare(old: State, new: State) -> tuple[ChangeLine, ...]:
    """Every difference, the worst first."""
    known = [state.known for state in (old, new) if state.known is not None]
    found: list[ChangeLine] = []
    for about, subject in dict.fromkeys((*old.items, *new.items)):
        answered = (about, subject) not in old.unanswered | new.unanswered
        if answered and all(about in kinds for kinds in known):
            was, now = old.items.get((about, subject)), new.items.get((about, subject))
            if was is None or now is None:
                found += _came_or_went(about, subject, was, now, old, new)
            elif was != now:
                found += _moved(about, subject, was, now, new)
    edits = list(_edits(old, new))
    found = _with_reasons(found, edits, old, new)
    found += [line for _, line in edits]
    found += _files(old, new, found) if not known else []
    if any(change.kind in _LOST for change in found):  # a smaller claim also has fewer assumptions: no gain
        found = [c for c in found if c.kind != "better" or c.about not in ("assumption", "deficit")]

    def order(change: ChangeLine) -> tuple[int, bool, bool, int, int]:
        place = _ABOUT.index(change.about) if change.about in _ABOUT else len(_ABOUT)
        severity = new.items.get((change.about, change.subject), {}).get("severity", ("",))[0]
        grave = SEVERITIES.index(severity) if severity in SEVERITIES else 0
        refuted = change.after in (Status.REFUTED, Status.CONTRADICTORY)
        return KINDS.index(change.kind), change.about not in _FIRST, not refuted, place, grave

    return tuple(sorted(found, key=order))


def _came_or_went(
    about: str, subject: str, was: Mapping[str, Value] | None, now: Mapping[str, Value] | None, old: State, new: State
) -> Iterator[ChangeLine]:
    """A subject that only one of the states has."""
    values = was or now or {}
    said = ", ".join(next(iter(values.values()), ()))
    before, after = (said, "") if now is None else ("", said)
    match about:
        case "hazard" | "requirement":
            level = values["level"][0]
            kind = "gone" if now is None else "new" if Level(level).holds else "open"
            words = f"{_name(about, subject)} is {f'new, and {level}' if now is not None else 'not there any more'}"
            before, after = (level, "") if now is None else ("", level)
        case "claim":
            kind, title = ("gone" if now is None else "new"), new.titles.get(subject) or short(subject)
            words = f"claimed no more: {short(subject)}" if now is None else f"new claim, {said}: “{title}”"
        case "evidence":
            if not {("claim", subject.rpartition(" ")[0])} <= old.items.keys() & new.items.keys():
                return  # the claim's own line has it
            before, after = (shown_by(values), "") if now is None else ("", shown_by(values))
            kind = "gone" if now is None else "new"
            why = f" ({reason})" if now is None and (reason := new.ended.get(subject)) else ""
            words = (
                f"{_by(subject)}: the evidence is gone: {before}{why}"
                if why or now is None
                else f"{_by(subject)}: {after}"
            )
        case "gate":
            kind = "demand" if now is None else "open" if said == "fails" else "new"
            words = f"gate “{subject}”: {before or 'did not apply'} → {after or 'does not apply any more'}"
        case "assumption" | "accepted" | "expected":
            kind = "better" if now is None else "assumption"
            named = said if about == "assumption" else f"{subject}: {said}"
            words = f"{_TAKEN[about]} no more: {named}" if now is None else f"new: {_TAKEN[about]}: {named}"
        case "deficit":
            kind = "better" if now is None else "deficit"
            words = f"{words_of(subject, int(said))}: {before or 'none'} → {after or 'none'}"
        case _:  # files have lines of their own, and a node's claims stand for it
            return
    yield ChangeLine(kind, subject, words, before, after, about=about)


_TAKEN = {"assumption": "assumed", "accepted": "finding accepted", "expected": "finding expected"}


def _name(about: str, subject: str) -> str:
    return f"hazard {subject}" if about == "hazard" else subject


def _by(evidence: str) -> str:
    claim, _, method = evidence.rpartition(" ")
    return f"{short(claim)} by {method}"


def _moved(
    about: str, subject: str, was: Mapping[str, Value], now: Mapping[str, Value], new: State
) -> Iterator[ChangeLine]:
    """The values of a subject that differ."""
    if about == "file":
        return
    names = [name for name in dict.fromkeys((*was, *now)) if was.get(name, ()) != now.get(name, ())]
    if "level" in names:  # its line says more
        names = [name for name in names if name != "weakest evidence"]
    kinds = {name: _kind(about, name, was.get(name, ()), now.get(name, ())) for name in names}
    if about == "evidence":  # one line for all
        kind = min(kinds.values(), key=KINDS.index)
        before, after = shown_by(was), shown_by(now)
        moved = f"{before} → {after}" if before != after else f"re-run, and {after} as before"
        yield ChangeLine(kind, subject, f"{_by(subject)}: {moved}", before, after, about=about)
        return
    for name, kind in kinds.items():
        before, after = (", ".join(of.get(name, ())) for of in (was, now))
        named, title = _name(about, subject), f"“{new.titles.get(subject) or short(subject)}”"
        match about, name:
            case (("hazard" | "requirement"), "level"):
                words = f"{named} was {before}, and is {after}"
            case "claim", "status":
                words = f"{before} → {after}: {title}"
            case "claim", "meaning":
                before, after = was[name][-1], now[name][-1]
                words = _edit(title, before, after)
            case "requirement", "formula":
                words = _edit(subject, before, after)
            case "gate", _:
                words = f"gate “{subject}”: {before} → {after}"
            case "deficit", _:
                words = f"{words_of(subject, int(after))}: {before} → {after}"
            case "assumption", "words":
                words = f"another assumption: {after}"
            case "assumption", "expired" if after:
                words = f"expired on {after}: {now['words'][0]}"
            case _ if max(len(of.get(name, ())) for of in (was, now)) > 1 or name in _SETS:
                words = f"{_heading(about, named, name)}: {_parts(was.get(name, ()), now.get(name, ()))}"
            case _:  # every other value is named as it is
                words = f"{_heading(about, named, name)}: {_quoted(before)} → {_quoted(after)}"
        yield ChangeLine(kind, subject, words, before, after, about=about)


_SETS = ("mitigated_by", "supported by")


def _heading(about: str, named: str, name: str) -> str:
    named = f"{about} {named}" if about not in ("hazard", "requirement") else named
    return f"{named.strip()}, {name if about == 'policy' else name.replace('_', ' ')}"


def _quoted(value: str) -> str:
    return cut(value, EDITED) or "none"


def _parts(was: Value, now: Value) -> str:
    """``also justified, without reviewed``."""
    less = [f"without {item}" for item in was if item not in now]
    more = [f"also {item}" for item in now if item not in was]
    return ", ".join(more + less) or f"{', '.join(was)} → {', '.join(now)}"


def _kind(about: str, name: str, was: Value, now: Value) -> str:
    """How one value of a subject moved. What has no order here is neither better nor worse: another meaning."""
    before, after = (value[0] if value else "" for value in (was, now))
    match about, name:
        case (("hazard" | "requirement"), "level"):
            return "better" if _better(_LEVELS, before, after) else "weaker" if Level(after).holds else "open"
        case "claim", "status":
            return "better" if _better(_STATUSES, before, after) else "weaker" if Status(after).supports else "open"
        case "gate", _:
            return "open" if after == "fails" else "better" if before == "fails" or after == "passes" else "weaker"
        case "policy", _:
            return "better" if _stricter(name, was, now) else "demand"
        case "node", "criticality":
            return "better" if _better(tuple(reversed(CRITICALITIES)), before, after) else "demand"
        case "hazard", "severity" if _better(tuple(reversed(SEVERITIES)), before, after):
            return "meaning"
        case "hazard", "mitigated_by":
            return "new" if set(was) < set(now) else "gone"
        case "hazard", name if name != "source":
            return "demand"
        case "requirement", "failure rate":
            return "better" if _number(after, 1) < _number(before, 1) else "weaker"
        case "requirement", "weakest evidence":  # `bound 13 %`, `no bound`; nothing for a proof
            now_at, was_at = (_number(text[6:-2], 101 if text else 0) for text in (after, before))
            return "better" if now_at < was_at else "weaker"
        case "evidence", "bound":
            return "better" if _number(after, 1) < _number(before, 1) else "weaker"
        case "evidence", "judged":
            return "better" if _number(after, 0) > _number(before, 0) else "weaker"
        case "evidence", "verdict" if before in _STATUSES and after in _STATUSES:
            return "better" if _better(_STATUSES, before, after) else "weaker"
        case "evidence", name if name in OF_RECORDS:
            return "rerun"
        case "deficit", _:
            return "better" if int(after) < int(before) else "deficit"
        case "assumption", "words":
            return "assumption"
        case "assumption", "expired":
            return "expired" if after else "better"
        case (("accepted" | "expected"), _):
            return "assumption"
        case _:  # values without an order
            return "meaning"


def _better(order: Sequence[str], before: str, after: str) -> bool:
    """Whether a value moved up in an order that begins with the worst."""
    return before in order and after in order and order.index(after) > order.index(before)


def _number(text: str, default: float) -> float:
    try:
        return float(Fraction(text))
    except ValueError:
        return default


def _stricter(name: str, was: Value, now: Value) -> bool:
    """Whether a rule of the policy asks for more than before. Of accepted words, none given accepts all."""
    key = name.rpartition(".")[2] if "max_" not in name else "max"
    if key == "isolation":
        return _better(tuple(Isolation), *was, *now)
    if all(text.replace(".", "", 1).isdigit() for text in (*was, *now)):
        before, after = (_number(value[0] if value else "", math.inf if key == "max" else 0) for value in (was, now))
        return after < before if key == "max" else after > before
    if key in ("standard", "level") or "yes" in (*was, *now):
        return not was
    return bool(now) and (not was or set(now) < set(was))


def _edit(what: str, before: str, after: str) -> str:
    """``REQ1 was “in.r < 120”, is “in.r < 130”``: of both formulas the part that differs, from two words before it,
    and with whole parentheses."""
    was, now = before.split(), after.split()
    if was == now or not was or not now:
        return f"{what} means something else"
    pairs = list(zip(was, now, strict=False))
    start = next((at for at, (a, b) in enumerate(pairs) if a != b), len(pairs))
    same = zip(reversed(was[start:]), reversed(now[start:]), strict=False)
    end = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], same))
    first = max(0, start - 2)
    while ((more := _closing(was, first, end) + _closing(now, first, end)) > 0 and first) or (more < 0 and end):
        first, end = (first - 1, end) if more > 0 else (first, end - 1)
    old, new = (cut(" ".join(text[first : len(text) - end]), EDITED) for text in (was, now))
    return f"{what} was “{old}”, is “{new}”"


def _closing(words: Sequence[str], first: int, end: int) -> int:
    """How many more parentheses close in a part than open."""
    part = "".join(words[first : len(words) - end])
    return part.count(")") - part.count("(")


def _edits(old: State, new: State) -> Iterator[tuple[set[str], ChangeLine]]:
    """Edits of contract and plan, with the claims and requirements whose text each is in (none: others may use it)."""
    for path, text in new.sources.items() if old.sources else ():
        was, now = old.sources.get(path, "").splitlines(), text.splitlines()
        for kind, a, b, start, end in SequenceMatcher(None, was, now).get_opcodes() if was != now else ():
            if kind != "equal":
                last = max(end, start + 1)
                at = {name for name, s in new.spans.items() if s.file == path and s.line <= last and start < s.end_line}
                at |= {claim for claim, read in new.reads.items() if path in read}
                before, after = (_lines(lines) for lines in (was[a:b], now[start:end]))
                words = f"{path}:{start + 1}: {before} → {after}"
                yield at, ChangeLine("edit", f"{path}:{start + 1}", words, before, after, about="edit")


def _lines(lines: Sequence[str]) -> str:
    return cut(" ".join(line.strip() for line in lines), EDIT_CHARACTERS) or "(nothing)"


def _with_reasons(
    found: Sequence[ChangeLine], edits: Sequence[tuple[set[str], ChangeLine]], old: State, new: State
) -> list[ChangeLine]:
    """Each change of a requirement, a hazard or a claim with the edits and the changes below it that may be the
    reason. A claim's evidence has a line of its own only if the claim's status did not move, and a requirement's claim
    only if the requirement did not move."""
    moved = {c.subject for c in found if c.about == "claim" and c.kind != "meaning"}
    asked = {c.subject for c in found if c.about == "requirement" and c.before in _LEVELS and c.after in _LEVELS}
    told = {name for name in moved if name.partition("/requirement/")[2] in asked}
    kept: list[ChangeLine] = []
    evidence: dict[str, list[str]] = {}
    for change in found:
        claim = change.subject.rpartition(" ")[0]
        if change.about == "evidence" and (claim in moved - told or (change.kind == "rerun") != (claim in told)):
            evidence.setdefault(claim, []).append(change.words)
        hidden = change.subject in told if change.about == "claim" else change.about == "evidence" and claim in moved
        kept += [] if hidden else [change]
    result = []
    for change in kept:
        if change.about in (*_FIRST, "claim") and change.kind in ("open", "weaker", "meaning", "better"):
            reached = {change.subject, *new.below.get((change.about, change.subject), ())}
            own = [line.words for at, line in edits if not at or at & reached]
            if change.kind != "meaning":
                others = [c for c in kept if c.about == "claim" and c.subject in reached - {change.subject}]
                own += [c.words for c in others if c.kind == "meaning"]
                own += [f"{path} changed" for path in _changed_files(old, new, reached)]
                own += [words for name in sorted(told & reached | {change.subject}) for words in evidence.get(name, [])]
                own += [c.words for c in others if c.kind != "meaning"]
            change = replace(change, edits=tuple(own))
        result.append(change)
    return result


def _changed_files(old: State, new: State, claims: Iterable[str]) -> list[str]:
    """The changed files that evidence of some claims read; contracts and plans have their edits."""
    paths = sorted({path for claim in claims for path in new.reads.get(claim, ())} - new.sources.keys())
    return [path for path in paths if old.items.get(("file", path)) not in (None, new.items.get(("file", path)))]


def _files(old: State, new: State, found: Sequence[ChangeLine]) -> Iterator[ChangeLine]:
    """Files besides contract and plan that evidence depends on, and what came of their changes."""
    marks = [{path: of["digest"][0] for (about, path), of in s.items.items() if about == "file"} for s in (old, new)]
    then, now = marks
    moved = {c.subject: c for c in found if c.about == "claim"}
    for path in sorted((then | now).keys() - old.sources.keys() - new.sources.keys()):
        if then.get(path) != now.get(path):
            how = "is read now" if path not in then else "is read no more" if path not in now else "changed"
            readers = [claim for claim, paths in new.reads.items() if path in paths]
            came = [moved[claim].words for claim in readers if claim in moved]
            if how == "changed" and not came:
                came = [f"{count(len(readers), 'claim')} re-run, same verdict"]
            words = f"{path} {how}" + (f": {listed(came, 2)}" if came else "")
            yield ChangeLine("edit", path, words, then.get(path, "")[:12], now.get(path, "")[:12], about="file")

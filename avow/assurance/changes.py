"""Changes since the last signed report: the part of a case that a signature covers, and the comparison with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile

from avow.assurance.answers import Assumption, Baseline, ChangeLine, Changes, Deficit, Level
from avow.assurance.deficits import words_of
from avow.assurance.hazards import HazardView
from avow.assurance.model import Case, Gate, ObligationView, RequirementView
from avow.assurance.naming import cut
from avow.base.codec import canonical
from avow.base.files import sha256
from avow.evidence.obligation import Kind
from avow.evidence.record import Evidence
from avow.evidence.status import Status

KINDS = ("open", "gone", "weaker", "meaning", "expired", "assumption", "deficit", "new", "better")
"""Worst first."""
MARKS = {"open": "✘", "better": "▲", "meaning": "≠", "new": "+"}
EDITED = 60
"""Characters of a formula, old or new, in a line about its edit; the row of the change has it in full."""
_RANK = {level: -at for at, level in enumerate(Level)}


def baseline_of(case: Case, name: str = "", who: str = "", signed_on: str = "", until: str = "") -> Baseline:
    """The part of a case that is signed, and compared with later cases."""
    found = Baseline(
        name=name,
        who=who,
        signed_on=signed_on,
        until=until,
        content="",
        verdict=case.answers.verdict,
        requirements=tuple((r.id, r.meaning, r.level.value, _formula(r, case.obligations)) for r in case.requirements),
        guarantees=tuple(map(_guarantee, case.guarantees)),
        assumptions=tuple((s.key, s.words, s.until) for s in case.assumptions),
        deficits=tuple((w.key, w.count) for w in case.deficits),
        hazards=tuple((h.hazard.id, h.meaning, h.level.value) for h in case.hazards),
        gates=tuple((g.id, g.title, g.passed) for g in case.gates if not g.idle),
    )
    return replace(found, content=content_of(found))


def is_signed(case: Case, signed: Baseline) -> bool:
    """Whether a case is the signed one."""
    now = baseline_of(case)
    return content_of(now if signed.gates else replace(now, hazards=(), gates=())) == signed.content


def content_of(of: Baseline) -> str:
    """SHA-256 of everything that a signature covers: verdict, requirements, evidence, assumptions, deficits, hazards,
    gates."""
    later = {"hazards": list(map(list, of.hazards)), "gates": list(map(list, of.gates))} if of.gates else {}
    return sha256(
        canonical(
            {
                **later,
                "verdict": of.verdict,
                "requirements": [list(item) for item in of.requirements],
                "guarantees": [list(item[:-1]) for item in of.guarantees],
                "assumptions": [list(item) for item in of.assumptions],
                "deficits": [list(item) for item in of.deficits],
            }
        )
    )


def changes(
    old: Baseline | None,
    requirements: Sequence[RequirementView],
    views: Sequence[ObligationView],
    assumptions: Sequence[Assumption],
    deficits: Sequence[Deficit],
    hazards: Sequence[HazardView],
    gates: Sequence[Gate],
) -> Changes:
    """The differences from the signed report, worst first."""
    if old is None:
        return Changes("")
    guarantees = [view for view in views if view.obligation.kind is Kind.GUARANTEE]
    now = {item[0]: item for item in map(_guarantee, guarantees)}
    then = {item[0]: item for item in old.guarantees}
    titles = {view.id: view.obligation.claim for view in guarantees}
    below = list(_guarantees(then, now, titles))
    asked = {r.id: (r.meaning, r.level, _formula(r, views), r.closure) for r in requirements}
    feared = {f"hazard {h.hazard.id}": (h.meaning, h.level, h.meaning, h.closure) for h in hazards}
    before = {name: (meaning, level, formal) for name, meaning, level, formal in old.requirements}
    before |= {f"hazard {name}": (meaning, level, meaning) for name, meaning, level in old.hazards}
    named = asked | feared if old.gates else asked
    under = {name: tuple(e.words for e in below if e.subject in item[3]) for name, item in named.items()}
    shown = [replace(entry, edits=under.get(entry.subject, ())) for entry in _levels(before, named)]
    shown += [*(_gates(old, gates) if old.gates else ()), *below]
    lost = any(entry.kind in ("open", "gone", "weaker") for entry in shown)
    entries = [*shown, *_assumptions(old, assumptions), *_deficits(old, deficits)]
    if lost:  # a smaller claim also has fewer assumptions and deficits: that is no gain
        entries = [e for e in entries if e.kind != "better" or e in shown]
    again = sum(
        1 for name in now if name in then and now[name][1:3] == then[name][1:3] and now[name][4] != then[name][4]
    )
    by = f"{old.who}, {old.signed_on}"
    return Changes(by, tuple(sorted(entries, key=lambda entry: KINDS.index(entry.kind))), again)


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


def _formula(requirement: RequirementView, views: Sequence[ObligationView]) -> str:
    """A requirement's formula with the values of constants; else as its plan states it."""
    own = {
        v.obligation.formula for v in views if v.id in requirement.obligations and v.obligation.name == requirement.id
    }
    return "; ".join(sorted(own - {""})) or requirement.formal


def _guarantee(view: ObligationView) -> tuple[str, str, str, str, str]:
    counting = sorted(_mark(item.entry.evidence, item.entry.hash) for item in view.counting)
    return view.id, view.obligation.digest, view.standing.value, view.obligation.formula, sha256("\n".join(counting))


def _mark(record: Evidence, hash_: str) -> str:
    return f"{record.method} {record.run} {hash_}"


def _levels(
    then: Mapping[str, tuple[str, str, str]], now: Mapping[str, tuple[str, Level, str, Sequence[str]]]
) -> Iterator[ChangeLine]:
    """Requirements and hazards: (meaning, level, formula) of each."""
    for name, (meaning, level, formula, _) in now.items():
        if name not in then:
            kind = "new" if level.holds else "open"
            yield ChangeLine(kind, name, f"{name} is new, and {level}", "", level.value)
            continue
        old_meaning, how, old_formula = then[name]
        was = Level(how)
        if level is not was:
            kind = "better" if _RANK[level] > _RANK[was] else "weaker" if level.holds else "open"
            yield ChangeLine(kind, name, f"{name} was {was}, and is {level}", was.value, level.value)
        if (meaning, formula) != (old_meaning, old_formula):
            yield ChangeLine("meaning", name, _edit(name, old_formula, formula), old_formula, formula)
    for name in (name for name in then if name not in now):
        yield ChangeLine("gone", name, f"{name} is not there any more", then[name][1], "")


def _gates(old: Baseline, gates: Sequence[Gate]) -> Iterator[ChangeLine]:
    """The gates that were asked or are."""
    word = {None: "", True: "passes", False: "fails"}
    then = {name: (title, passed) for name, title, passed in old.gates}
    now = {gate.id: (gate.title, gate.passed) for gate in gates if not gate.idle}
    for name, (title, _) in (then | now).items():
        was, is_ = (found.get(name, ("", None))[1] for found in (then, now))
        if is_ is not was:
            kind = "gone" if is_ is None else "open" if not is_ else "new" if was is None else "better"
            text = f"gate “{title}”: {word[was] or 'not asked'} → {word[is_] or 'not asked any more'}"
            yield ChangeLine(kind, name, text, word[was], word[is_])


def _guarantees(
    then: Mapping[str, tuple[str, str, str, str, str]],
    now: Mapping[str, tuple[str, str, str, str, str]],
    titles: Mapping[str, str],
) -> Iterator[ChangeLine]:
    for name, (_, meaning, status, formula, _) in now.items():
        title = f"“{titles[name]}”"
        if name not in then:
            yield ChangeLine("new", name, f"new guarantee, {status}: {title}", "", status)
            continue
        _, old_meaning, old_status, old_formula, _ = then[name]
        is_, was = Status(status), Status(old_status)
        if meaning != old_meaning:
            yield ChangeLine("meaning", name, _edit(title, old_formula, formula), old_formula, formula)
        if is_ is not was:
            kind = "better" if is_.rank > was.rank else "weaker" if is_.supports else "open"
            yield ChangeLine(kind, name, f"{was} → {is_}: {title}", old_status, status)
    for name, item in then.items():
        if name not in now:
            yield ChangeLine("gone", name, "a guarantee is not there any more", item[2], "")


def _assumptions(old: Baseline, assumptions: Sequence[Assumption]) -> Iterator[ChangeLine]:
    then = {key: (words, until) for key, words, until in old.assumptions}
    for s in assumptions:
        if s.key not in then:
            yield ChangeLine("assumption", s.key, f"new assumption: {s.words}", "", s.words)
        elif s.words != then[s.key][0]:
            yield ChangeLine("assumption", s.key, f"another assumption: {s.words}", then[s.key][0], s.words)
        if s.expired:
            yield ChangeLine(
                "expired", s.key, f"expired on {s.until}: {s.words}", then.get(s.key, ("", ""))[1], s.until
            )
    for key in then:
        if key not in {s.key for s in assumptions}:
            yield ChangeLine("better", key, f"assumed no more: {then[key][0]}", then[key][0], "")


def _deficits(old: Baseline, deficits: Sequence[Deficit]) -> Iterator[ChangeLine]:
    then = dict(old.deficits)
    for w in deficits:
        was = then.get(w.key, 0)
        if w.count > was:
            yield ChangeLine("deficit", w.key, f"{w.words}: {was or 'none'} → {w.count}", str(was), str(w.count))
    now = {w.key: w.count for w in deficits}
    for key, was in old.deficits:
        if (left := now.get(key, 0)) < was:
            yield ChangeLine("better", key, f"{words_of(key, was)}: {was} → {left or 'none'}", str(was), str(left))

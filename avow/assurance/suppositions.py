"""What the case rests on without its being shown: each supposition once, in plain words, with owner and date.

That is what a requirement needs, and what the evidence of any other guarantee supposes: a page that names the evidence
names what that supposes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date

from avow.assurance.answers import Sort, Supposition
from avow.assurance.closure import Closed
from avow.assurance.facts import Facts
from avow.assurance.findings import takes
from avow.assurance.model import ObligationView
from avow.assurance.relied import Judged, Relied
from avow.assurance.support import supposition_claim
from avow.base.records import dataclass
from avow.base.verdict import HypothesisKind
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.system.plan import Requirement, Statement

_SORTS = tuple(Sort)
_SCENARIO = Statement("suppositions.compose.scenario", "Nothing occurs that the plan's finite scenario does not list")
"""The bounds of a check within the scenario, each named by its record, are one supposition."""
_WHOLE = ""
"""Stands among the requirements for all guarantees together."""
_PLATFORM = ("persistence", "one-output", "entered")


@dataclass(frozen=True, slots=True)
class Statements:
    """The plan's plain words, found by the place that they are about or by what a method supposes."""

    all: tuple[Statement, ...]
    today: date

    def at(self, place: str, because: str = "") -> Statement:
        """What is said of a place; else what is said with the same reason; else nothing, in no words."""
        found = next((s for s in self.all if s.place == place), None)
        if found is None and because:
            found = next((s for s in self.all if s.because == because), None)
        return found or Statement(place)

    def of_method(self, method: str, hypothesis: str) -> Statement:
        """The statement ``suppositions.<method>.<word>`` whose word the hypothesis has."""
        told = hypothesis.casefold()
        for statement in self.all:
            section, _, rest = statement.place.partition(".")
            owner, _, name = rest.partition(".")
            if section == "suppositions" and owner == method and any(_says(told, word) for word in _spelled(name)):
                return statement
        return Statement("")

    def judge(self, method: str, hypothesis: str) -> Judged:
        statement = self.of_method(method, hypothesis)
        return Judged(self.is_past(statement.until), bool(statement.who and statement.until))

    def is_past(self, until: str) -> bool:
        try:
            return bool(until) and date.fromisoformat(until) < self.today
        except ValueError:
            return True


def _spelled(name: str) -> tuple[str, ...]:
    """A key's word as it may stand in a hypothesis."""
    return tuple({name.casefold(), name.replace("_", " ").casefold(), name.replace("-", " ").casefold()})


def _says(told: str, word: str) -> bool:
    """Whether a text has a word, whole: one of three letters at least, so that no key is about everything."""
    return len(word) > 2 and re.search(rf"(?<!\w){re.escape(word)}(?!\w)", told) is not None


@dataclass(frozen=True, slots=True)
class _Raw:
    """One thing supposed at one place."""

    sort: Sort
    place: str
    text: str
    statement: Statement
    where: str
    needed: Callable[[str], bool]
    """Whether a requirement (or `_WHOLE`) needs it."""


def suppositions(
    facts: Facts,
    views: Sequence[ObligationView],
    relied: Mapping[str, Relied],
    required: Mapping[str, Closed],
    whole: Closed,
    statements: Statements,
) -> tuple[Supposition, ...]:
    """Those that some requirement needs (`required`: what each rests on), or some guarantee (`whole`: what they all
    rest on), numbered: by what they are about, the most needed first."""
    closed = {**required, _WHOLE: whole}
    raw = [
        *_reasons(views, closed, statements),
        *_constants(facts, closed, statements),
        *_of_methods(views, relied, closed, statements),
        *_accepted(facts, views, closed),
        *_assumptions(facts, closed),
        *_meaning(facts.requirements, statements),
    ]
    merged: dict[tuple[Sort, str], list[_Raw]] = {}
    for item in raw:
        merged.setdefault((item.sort, item.statement.says or item.statement.because or item.text), []).append(item)
    needed = [
        _one(items, tuple(required), statements)
        for items in merged.values()
        if any(item.needed(name) for item in items for name in closed)
    ]
    needed.sort(key=lambda s: (_SORTS.index(s.sort), -len(s.needed_by), s.key))
    return tuple(replace(s, number=f"S{at}") for at, s in enumerate(needed, start=1))


def _one(items: Sequence[_Raw], requirements: Sequence[str], statements: Statements) -> Supposition:
    said = next((i.statement for i in items if i.statement.says), items[0].statement)
    ends = sorted({i.statement.until for i in items if i.statement.until})
    made = sorted({i.statement.date for i in items if i.statement.date})
    owned = all(i.statement.who for i in items)
    dated = all(i.statement.until for i in items)
    return Supposition(
        number="",
        key=min(item.place for item in items),
        sort=items[0].sort,
        says=said.says,
        text="\n".join(dict.fromkeys(item.text for item in items)),
        because=said.because,
        who=", ".join(dict.fromkeys(i.statement.who for i in items)) if owned else "",
        until=ends[0] if dated and ends else "",
        date=made[-1] if made and all(i.statement.date for i in items) else "",
        expired=any(statements.is_past(end) for end in ends),
        needed_by=tuple(r for r in requirements if any(item.needed(r) for item in items)),
        where=tuple(dict.fromkeys(item.where for item in items)),
    )


def _in(closed: Mapping[str, Closed], claim: str) -> Callable[[str], bool]:
    holders = {name for name, found in closed.items() if claim in found.claims}
    return holders.__contains__


def _reasons(views: Sequence[ObligationView], closed: Mapping[str, Closed], statements: Statements) -> Iterator[_Raw]:
    """Conditions of the composition, and guarantees, for which the plan gives a reason and nothing else."""
    for view in views:
        if view.status is not Status.JUSTIFIED:
            continue
        o = view.obligation
        text = next((r.summary for r in reversed(view.records)), o.claim)
        sort, place = Sort.MODELS, o.local_id
        if o.kind is Kind.COMPOSITION and o.name.startswith("environment."):
            sort, place = Sort.WORLD, o.name
        elif o.kind is Kind.COMPOSITION:
            goal, _, what = o.name.partition(".")
            sort, place = Sort.PLATFORM, o.name if what in _PLATFORM else f"{goal}.entered"
        yield _Raw(sort, place, text, statements.at(place, text), o.id, _in(closed, o.id))


def _constants(facts: Facts, closed: Mapping[str, Closed], statements: Statements) -> Iterator[_Raw]:
    """Inputs that the plan declares to be the same at every step: no claim says so, and the calculus uses it. What an
    entry says is about its assumption, where it has one: that the input does not change needs a reason of its own."""
    for entry in facts.environment:
        if entry.constant:
            place = f"environment.{entry.port}" + (".constant" if entry.assume else "")
            reading = tuple(f"{facts.system}/{node}/{Kind.GUARANTEE}/" for node in entry.nodes)
            holders = {
                name for name, found in closed.items() if any(claim.startswith(reading) for claim in found.claims)
            }
            text = f"{entry.port} is the same at every step"
            yield _Raw(Sort.WORLD, place, text, statements.at(place), place, holders.__contains__)


def _of_methods(
    views: Sequence[ObligationView],
    relied: Mapping[str, Relied],
    closed: Mapping[str, Closed],
    statements: Statements,
) -> Iterator[_Raw]:
    """Hypotheses of the records relied upon."""
    for view in views:
        if view.id not in relied:
            continue
        found = relied[view.id]
        sampled = found.status in (Status.TESTED, Status.MONITORED)
        for text in found.suppositions:
            statement = statements.of_method(found.record.method, text)
            if not statement.place and text in found.scenario:
                statement = _SCENARIO
            place = statement.place or f"suppositions.{found.record.method}: {text}"
            sort = Sort.SAMPLING if sampled else Sort.MODELS
            yield _Raw(sort, place, text, statement, view.id, _in(closed, view.id))


def _accepted(facts: Facts, views: Sequence[ObligationView], closed: Mapping[str, Closed]) -> Iterator[_Raw]:
    """What a record rests on and a person has accepted by name."""
    supposed = {
        supposition_claim(h): h
        for view in views
        for record in view.records
        for h in record.rests_on
        if h.kind is HypothesisKind.SUPPOSITION
    }
    for claim in dict.fromkeys(name for found in closed.values() for name in found.accepted):
        hypothesis = supposed[claim]
        given = next((f for f in facts.accepted if takes(f.obligation, f.matched, hypothesis.name)), None)
        holders = {name for name, found in closed.items() if claim in found.accepted}
        said = Statement(hypothesis.name)
        if given is not None:
            reason, who, until, made = (s or "" for s in (given.reason, given.who, given.expires, given.date))
            said = Statement(hypothesis.name, "", reason, who, until, made)
        text = hypothesis.text or hypothesis.name
        yield _Raw(Sort.MODELS, hypothesis.name, text, said, claim, holders.__contains__)


def _assumptions(facts: Facts, closed: Mapping[str, Closed]) -> Iterator[_Raw]:
    """Assumptions of nodes that nothing in the case discharges."""
    sentences = {f"{node.name}.{name}": said for node in facts.nodes for name, said in node.assumptions}
    for about in dict.fromkeys(name for found in closed.values() for name in found.assumptions):
        holders = {name for name, found in closed.items() if about in found.assumptions}
        place = f"assumption.{about}"
        yield _Raw(Sort.WORLD, place, sentences.get(about, about), Statement(place), about, holders.__contains__)


def _meaning(requirements: Sequence[Requirement], statements: Statements) -> Iterator[_Raw]:
    """Requirements without a formula: that the guarantees named amount to the sentence is a person's word; and where a
    formula says less than its sentence, what the plan says of the rest."""
    for r in requirements:
        place = f"requirements.{r.id}.amounts"
        said = statements.at(place)
        if said.says or said.because or (not r.formula and not r.temporal):
            words = f"The guarantees named amount to the sentence of {r.id}"
            if not said.says:
                said = replace(said, says=words)
            yield _Raw(Sort.MEANING, place, said.because or words, said, place, {r.id}.__contains__)

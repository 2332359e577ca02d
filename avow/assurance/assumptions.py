"""The assumptions of the case: each once, in plain words, with owner and date.

They are those that a requirement needs, and those of the evidence for any other guarantee: a page that shows evidence
also shows its assumptions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date

from avow.assurance.answers import MODELS, PLATFORM, REACTION, RECORDINGS, SAMPLES, START, TOOLS, Assumption, Sort
from avow.assurance.closure import Closed, used
from avow.assurance.facts import Facts
from avow.assurance.findings import accepts
from avow.assurance.gap import reviewers
from avow.assurance.model import ObligationView
from avow.assurance.naming import short
from avow.assurance.relied import Judged, Relied, differs, looked_at, relied_of, seen
from avow.assurance.support import assumption_claim
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.verdict import HypothesisKind, Object
from avow.evidence.obligation import Kind
from avow.evidence.record import Evidence
from avow.evidence.status import Status, weigh
from avow.formulas.temporal.cell import CELL
from avow.system.plan import Requirement, Statement
from avow.system.statements import GENERAL

_SORTS = tuple(Sort)
_SCENARIO = Statement("assumptions.compose.scenario", "Nothing occurs that the plan's finite scenario does not list")
"""The limits of checks within the scenario, each named by its record, are one assumption."""
_WHOLE = ""
"""The key, among the requirements, for all guarantees together."""
_MEANING = "Each requirement's formula, or the guarantees named, says what its sentence asks for"
_PLATFORM = ("persistence", "one-output", "entered")


@dataclass(frozen=True, slots=True)
class Statements:
    """The plan's plain words, found by the place that they are about or by a method's assumption."""

    all: tuple[Statement, ...]
    today: date

    def at(self, place: str, because: str = "") -> Statement:
        """The statement about a place; else a statement with the same reason; else an empty statement."""
        found = next((s for s in self.all if s.place == place), None)
        if found is None and because:
            found = next((s for s in self.all if s.because == because), None)
        return found or Statement(place)

    def of_method(self, method: str, hypothesis: str) -> Statement:
        """The statement ``assumptions.<method>.<word>`` whose word occurs in the hypothesis."""
        told = hypothesis.casefold()
        for statement in self.all:
            section, _, rest = statement.place.partition(".")
            owner, _, name = rest.partition(".")
            if section == "assumptions" and owner == method and any(_says(told, word) for word in _spelled(name)):
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
    """The spellings of a key's word that a hypothesis may use."""
    return tuple({name.casefold(), name.replace("_", " ").casefold(), name.replace("-", " ").casefold()})


def _says(told: str, word: str) -> bool:
    """Whether a text contains a whole word of at least three letters, so that no key matches everything."""
    return len(word) > 2 and re.search(rf"(?<!\w){re.escape(word)}(?!\w)", told) is not None


@dataclass(frozen=True, slots=True)
class _Raw:
    """One assumption at one place."""

    sort: Sort
    place: str
    text: str
    statement: Statement
    where: str
    needed: Callable[[str], bool]
    """Whether a requirement (or `_WHOLE`) needs it."""


def assumptions(
    facts: Facts,
    views: Sequence[ObligationView],
    relied: Mapping[str, Relied],
    required: Mapping[str, Closed],
    whole: Closed,
    statements: Statements,
) -> tuple[Assumption, ...]:
    """The assumptions that some requirement needs (`required`: what each rests on), or some guarantee (`whole`: what
    they all rest on), numbered in order of sort, the most needed first."""
    closed = {**required, _WHOLE: whole}
    raw = [
        *_reasons(views, closed, statements),
        *_of_methods(views, relied, closed, statements),
        *_accepted(facts, views, closed),
        *_assumptions(facts, closed),
        *_of_evidence(views, relied, closed, statements),
        *_first_values(views, closed, statements),
        *_reaction(facts, closed, statements),
        *_meaning(facts.requirements, statements),
    ]
    merged: dict[tuple[str, bool], list[_Raw]] = {}
    for item in raw:  # one whose owner is missing stands apart: it alone lost its owner
        words = item.statement.says or item.statement.because or item.text
        merged.setdefault((words, bool(item.statement.who)), []).append(item)
    needed = [
        _one(items, tuple(required), statements)
        for items in merged.values()
        if any(item.needed(name) for item in items for name in closed)
    ]
    needed.sort(key=lambda s: (_SORTS.index(s.sort), -len(s.needed_by), s.key))
    return tuple(replace(s, number=f"A{at}") for at, s in enumerate(needed, start=1))


def _one(items: Sequence[_Raw], requirements: Sequence[str], statements: Statements) -> Assumption:
    said = next((i.statement for i in items if i.statement.says), items[0].statement)
    ends = sorted({i.statement.until for i in items if i.statement.until})
    made = sorted({i.statement.date for i in items if i.statement.date})
    owned = all(i.statement.who for i in items)
    dated = all(i.statement.until for i in items)
    return Assumption(
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
    return _holders(closed).get(claim, set()).__contains__


@by_identity(1)
def _holders(closed: Mapping[str, Closed]) -> Mapping[str, set[str]]:
    """Each claim with the names of all that rests on it."""
    found: dict[str, set[str]] = {}
    for name, one in closed.items():
        for claim in one.claims:
            found.setdefault(claim, set()).add(name)
    return found


def _reasons(views: Sequence[ObligationView], closed: Mapping[str, Closed], statements: Statements) -> Iterator[_Raw]:
    """Conditions of the composition, and guarantees, that only a reason in the plan supports."""
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


def _of_methods(
    views: Sequence[ObligationView],
    relied: Mapping[str, Relied],
    closed: Mapping[str, Closed],
    statements: Statements,
) -> Iterator[_Raw]:
    """Hypotheses of the records that are relied upon, and of the others that support a claim (no requirement needs
    these)."""
    for view in views:
        for found, needed in _supporting(view, relied, closed):
            # assumptions about how a program is run, or about its likeness to a model, are not about the sampled cases
            sampled = found.status in (Status.TESTED, Status.MONITORED) and view.obligation.kind is not Kind.PROGRAM
            for text in found.assumptions:
                statement = statements.of_method(found.record.method, text)
                if not statement.place and text in found.scenario:
                    statement = _SCENARIO
                elif not statement.place and found.status is Status.REVIEWED:
                    statement = _condition(found.record, text)
                place = statement.place or f"assumptions.{found.record.method}: {text}"
                sort = Sort.SAMPLING if sampled else Sort.MODELS
                yield _Raw(sort, place, text, statement, view.id, needed)


def _supporting(
    view: ObligationView, relied: Mapping[str, Relied], closed: Mapping[str, Closed]
) -> Iterator[tuple[Relied, Callable[[str], bool]]]:
    """The records that support a claim, and the requirements that need their assumptions: those of the record relied
    upon."""
    if view.id not in relied:
        return
    holders = _in(closed, view.id)
    yield relied[view.id], holders
    for record in view.records:
        status = weigh(record).support
        if record is not relied[view.id].record and status is not None:
            yield relied_of(record, status), lambda name: name == _WHOLE and holders(name)


def _condition(record: Evidence, text: str) -> Statement:
    """A review's condition: the reviewer vouches for the guarantee under it, as long as the review is valid."""
    place = f"assumptions.{record.method}: {text}"
    until, made = (str(record.details.get(key, "")) for key in ("valid_until", "date"))
    return Statement(place, text, record.summary, ", ".join(reviewers(record)), until, made)


def _accepted(facts: Facts, views: Sequence[ObligationView], closed: Mapping[str, Closed]) -> Iterator[_Raw]:
    """Hypotheses of records that a person has accepted by name."""
    supposed = {
        assumption_claim(h): h
        for view in views
        for record in view.records
        for h in record.rests_on
        if h.kind is HypothesisKind.ASSUMPTION
    }
    for claim in dict.fromkeys(name for found in closed.values() for name in found.accepted):
        hypothesis = supposed[claim]
        given = next((f for f in facts.accepted if accepts(f.obligation, f.found, hypothesis)), None)
        holders = {name for name, found in closed.items() if claim in found.accepted}
        said = Statement(hypothesis.name)
        if given is not None:
            reason, who, until, made = (s or "" for s in (given.reason, given.who, given.expires, given.date))
            said = Statement(hypothesis.name, given.says, reason, who, until, made)
        text = hypothesis.text or hypothesis.name
        yield _Raw(Sort.MODELS, hypothesis.name, text, said, claim, holders.__contains__)


def _assumptions(facts: Facts, closed: Mapping[str, Closed]) -> Iterator[_Raw]:
    """Assumptions of nodes that nothing in the case discharges."""
    sentences = {f"{node.name}.{name}": said for node in facts.nodes for name, said in node.assumptions}
    for about in dict.fromkeys(name for found in closed.values() for name in found.assumptions):
        holders = {name for name, found in closed.items() if about in found.assumptions}
        place = f"assumption.{about}"
        yield _Raw(Sort.WORLD, place, sentences.get(about, about), Statement(place), about, holders.__contains__)


def _of_evidence(
    views: Sequence[ObligationView],
    relied: Mapping[str, Relied],
    closed: Mapping[str, Closed],
    statements: Statements,
) -> Iterator[_Raw]:
    """The assumptions that no record states: that the program behaves like its model, that untried cases are like those
    tried, that the platform behaves as expected, and that the tools answer correctly."""
    programs = [view for view in views if view.obligation.kind is Kind.PROGRAM]
    tools = statements.at(TOOLS)
    tools = tools if tools.says else replace(tools, says=GENERAL[TOOLS])
    for view in views:
        for found, needed in _supporting(view, relied, closed):
            if looked_at(found) is not None:
                tool = found.record.tool or found.record.backend
                yield _Raw(Sort.TOOLS, TOOLS, tool, tools, view.id, needed)
        if view.id not in relied or view.obligation.kind is not Kind.GUARANTEE:
            continue
        found, name = relied[view.id], short(view.id)
        record = found.record
        if looked_at(found) is None:  # a person's statement
            continue
        about = [(Sort.PLATFORM, PLATFORM, "")]
        if record.of is Object.MODEL and not differs(programs, view.obligation, record):
            about.append((Sort.MODELS, MODELS, f"{name} by {record.method}"))
        if found.status in (Status.TESTED, Status.MONITORED):
            about.append((Sort.SAMPLING, SAMPLES, f"{name}: {seen(found)}"))
        if record.of is Object.RECORDING:  # a monitor or an experiment does not examine the program
            about.append((Sort.SAMPLING, RECORDINGS, f"{name} by {record.method}"))
        for sort, place, text in about:
            said = statements.at(place)
            said = said if said.says else replace(said, says=GENERAL[place])
            yield _Raw(sort, place, text, said, view.id, _in(closed, view.id))


def _first_values(
    views: Sequence[ObligationView], closed: Mapping[str, Closed], statements: Statements
) -> Iterator[_Raw]:
    """The `initial` values of delayed connections that a proof uses: the calculus takes them from the plan, and no
    method checks a program's first values, except those that the node's own class keeps."""
    for view in views:
        labels = [label for record in view.records for label in used(record.details) if _is_first_value(label)]
        if labels and view.status.supports:
            said = statements.at(START)
            said = said if said.says else replace(said, says=GENERAL[START])
            text = ", ".join(dict.fromkeys(labels))
            yield _Raw(Sort.PLATFORM, START, text, said, view.id, _in(closed, view.id))


def _is_first_value(label: str) -> bool:
    """Whether a hypothesis is the plan's `initial`, and not a clause's state variable before the first step."""
    return label.startswith("initial ") and CELL not in label


def _reaction(facts: Facts, closed: Mapping[str, Closed], statements: Statements) -> Iterator[_Raw]:
    """A requirement is about steps in which each node has answered: if it speaks of more than one node, or rests on
    more than one, nothing says how late a node, or a reaction from node to node, may be."""
    kinds = {o.id: o for o in facts.obligations if o.kind is Kind.GUARANTEE}
    said = statements.at(REACTION)
    said = said if said.says else replace(said, says=GENERAL[REACTION])
    for r in facts.requirements:
        spoken = re.findall(r"(\w+)\.\w", f"{r.formula or ''} {r.temporal or ''}")
        below = {kinds[claim].node for claim in closed[r.id].claims if claim in kinds}
        nodes = [node.name for node in facts.nodes if node.name in below or node.name in spoken]
        if len(nodes) > 1:
            text = f"{r.id} is about steps in which each of {', '.join(nodes)} has answered"
            yield _Raw(Sort.PLATFORM, REACTION, text, said, r.id, {r.id}.__contains__)


def _meaning(requirements: Sequence[Requirement], statements: Statements) -> Iterator[_Raw]:
    """The assumption that a requirement's formula, or the guarantees named under a sentence without one, mean what the
    sentence says: the statement of the person who validated it."""
    for r in requirements:
        place = f"requirements.{r.id}.validation"
        said = statements.at(place)
        read = r.validation if r.validated else None
        said = replace(said, who=read.who if read else "", date=read.date if read else "")
        if not said.says:
            said = replace(said, says=_MEANING)
        yield _Raw(Sort.MEANING, place, said.because or r.id, said, place, {r.id}.__contains__)

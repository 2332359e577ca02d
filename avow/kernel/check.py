"""The kernel proper: the theorem's conditions (`Sound` in avow/calculus/proofs/kernel.dfy), held against a certificate.

The entries that are well formed (`Formed`) and valid (`Valid`, `Begins`: each question that they name is written from
the claims as they are now, and has no counterexample), and that rest on no other, are a closed part (`Closed`). Of a
claim in it, the given entries that it names, directly or through others, are all its hypotheses. Nothing that the
certificate says beside indices and digests is believed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

from avow.base.files import digest as sha256
from avow.kernel.certificate import FORMAT, Certificate, Entry, How, Question
from avow.kernel.solvers import LOOK, Said, Solvers
from avow.kernel.statements import Kind, Statement, Statements
from avow.kernel.text import Text, Untranslatable, conjunction, symbol
from avow.language.terms import And, Quantified, Quantifier


class Refused(Exception):  # noqa: N818 - it says what came of it
    """The certificate does not show the claim."""


class Given(StrEnum):
    """The kinds of hypotheses."""

    GUARANTEE = How.GUARANTEE
    ENVIRONMENT = How.ENVIRONMENT
    OPEN = How.OPEN
    TOGETHER = "together"
    """Values of several nodes are taken as of one step: they persist until used together, one output for each input."""


@dataclass(frozen=True, slots=True, order=True)
class Needed:
    """A hypothesis: of a guarantee, `conds` are the assumptions that its evidence may use (digests); of values taken
    together, `conds` are the nodes that put them out."""

    kind: Given
    node: str
    digest: str
    conds: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Established:
    """A claim that the kernel has established, up to its hypotheses. `goal` is its digest."""

    goal: str
    hypotheses: tuple[Needed, ...]
    shown: tuple[tuple[str, str], ...]
    """(node, digest) of the claims shown on the way, itself included."""
    key: str
    """What it was established from, digested: it moves exactly where something used has changed."""
    vacuous: bool
    """Its premises contradict each other: it is true, and says nothing."""
    solvers: int
    """How many solvers, of different makers, answered each of its questions."""


@dataclass(frozen=True, slots=True)
class Answered:
    """A question with the answer that is wanted."""

    digest: str
    solvers: int
    together: tuple[str, ...] = ()
    vacuous: bool = False


KINDS = {
    How.SHOWN: (Kind.ASSUMPTION, Kind.REQUIREMENT, Kind.IMPOSSIBLE),
    How.GUARANTEE: (Kind.GUARANTEE,),
    How.ENVIRONMENT: (Kind.ENVIRONMENT, Kind.ASSUMPTION),
    How.OPEN: (Kind.ASSUMPTION,),
    How.POSSIBLE: (Kind.POSSIBLE,),
}


@dataclass
class Kernel:
    """Checks the entries of one certificate against the claims of a system; each entry and question once."""

    known: Statements
    certificate: Certificate
    solvers: Solvers

    def establish(self, goal: int, *, alone: bool = False) -> Established:
        """The claim of an entry. `alone`: told with what its own questions name, as an implication; else with all that
        it rests on. Raises Refused."""
        if goal in self.refused or goal >= len(self.certificate.entries):
            raise Refused(self.refused.get(goal, "there is no such entry"))
        entries = self.certificate.entries
        part, stack = {goal}, [goal]
        while stack:
            new = set(entries[stack.pop()].named()) - part
            part |= new
            stack += () if alone else new
        hypotheses = {self._needed(entries[i]) for i in part if entries[i].how not in (How.SHOWN, How.POSSIBLE)}
        answered = [answer for i in ((goal,) if alone else part) for answer in self._answers.get(i, ())]
        for nodes in (answer.together for answer in answered if answer.together):
            hypotheses.add(Needed(Given.TOGETHER, "", sha256("\n".join(nodes)), nodes))
        is_open = any(need.kind is Given.OPEN for need in hypotheses)
        if is_open and self._claim(entries[goal]).kind is Kind.REQUIREMENT:
            raise Refused("a requirement rests on what only a derived contract may assume")
        told = [[n.kind, n.node, n.digest, n.conds] for n in sorted(hypotheses)]
        questions = sorted({answer.digest for answer in answered})
        return Established(
            goal=entries[goal].digest,
            hypotheses=tuple(sorted(hypotheses)),
            shown=tuple((entries[i].node, entries[i].digest) for i in sorted(part) if entries[i].how is How.SHOWN),
            key=sha256(json.dumps([FORMAT, entries[goal].digest, told, questions])),
            vacuous=any(answer.vacuous for answer in answered),
            solvers=min((answer.solvers for answer in answered), default=1),
        )

    @cached_property
    def refused(self) -> dict[int, str]:
        """Entries that are not valid, or rest on one that is not, and why: all others are a closed part."""
        found: dict[int, str] = {}
        users: dict[int, list[int]] = {}
        for i, entry in enumerate(self.certificate.entries):
            for j in entry.named():
                users.setdefault(j, []).append(i)
            try:
                self._answers[i] = tuple(self._entry(i, entry))
            except Refused as refused:
                found[i] = str(refused)
            except Untranslatable as problem:
                found[i] = f"no text: {problem}"
        stack = list(found)
        while stack:
            for user in users.get(why := stack.pop(), ()):
                if user not in found:
                    found[user] = found[why]
                    stack.append(user)
        return found

    @cached_property
    def _answers(self) -> dict[int, tuple[Answered, ...]]:
        return {}

    # -- one entry -----------------------------------------------------------------------------------------------------

    def _entry(self, i: int, entry: Entry) -> Iterator[Answered]:
        """`Formed`, `Valid` and `Begins`. Raises Refused."""
        entries, claim = self.certificate.entries, self._claim(entry)
        if any(not 0 <= j < len(entries) or entries[j].how is How.POSSIBLE for j in entry.named()):
            raise Refused("it names an entry that is not there, or that is no premise")
        match entry.how:
            case How.GUARANTEE:
                # it holds while *all* its node's assumptions have held so far: none may be left out
                conds = frozenset(entries[c].digest for c in entry.conds)
                if any(c >= i for c in entry.conds) or conds != self.known.assumptions.get(entry.node):
                    raise Refused(f"{claim.called}: its conditions are not the assumptions of its node, before it")
            case How.ENVIRONMENT if not claim.outside_only:
                raise Refused(f"{claim.called} is called the environment's, but a node provides a value in it")
            case How.SHOWN if entry.step is None or entry.step.initials:
                raise Refused(f"{claim.called}: no question about every step, or one from initial values")
            case How.SHOWN:
                for step, question in enumerate(entry.questions):
                    if any(not 0 <= u.back <= step or (u.back == 0 and u.entry >= i) for u in question.uses):
                        raise Refused("circular: an entry uses, at its own step, what comes no earlier than itself")
                    yield self.answered(entry, question, step)
                    yield from self.begins(question, step)
            case How.POSSIBLE:
                text = Text()
                body = text.formula(claim.term, claim.symbols())
                yield self._asked(_script(text, [body]), Said.SAT, f"{claim.called}: no values are shown to be so")

    def _claim(self, entry: Entry) -> Statement:
        """The claim of an entry as it is now. Raises Refused."""
        for kind in KINDS[entry.how]:
            if (found := self.known.find(entry.digest, kind, entry.node)) is not None:
                return found
        raise Refused(f"stale: {entry.node or 'the system'} has no such {' or '.join(KINDS[entry.how])}")

    def _needed(self, entry: Entry) -> Needed:
        conds = tuple(sorted(self.certificate.entries[c].digest for c in entry.conds))
        return Needed(Given(entry.how), entry.node, entry.digest, conds)

    # -- one question --------------------------------------------------------------------------------------------------

    def _asked(self, script: str, wanted: Said, otherwise: str) -> Answered:
        count = self.solvers.ask(script, wanted)
        if not count:
            raise Refused(otherwise)
        return Answered(sha256(script), count)

    def answered(self, entry: Entry, question: Question, step: int) -> Answered:
        """`Base_valid` and `Step_valid`: no window of states meets the premises and not the claim. Raises Refused."""
        text, claim = Text(), self._claim(entry)
        premises, goal = self._question(text, claim, question, step)
        script = _script(text, [*premises, f"(not {goal})"])
        found = self._asked(script, Said.UNSAT, f"{claim.called} does not follow from what is named")
        vacuous = self.solvers.first(_script(text, premises), LOOK) is Said.UNSAT
        return Answered(found.digest, found.solvers, self._together(claim, question), vacuous)

    def _question(self, text: Text, claim: Statement, question: Question, step: int) -> tuple[list[str], str]:
        """Premises and conclusion. A witness is what a premise says exists, by name: it serves for what the claim says
        exists, which is thereby shown, and more."""
        used = [(self._claim(self.certificate.entries[use.entry]), use.back) for use in question.uses]
        used += [(self._initial(mark), step) for mark in question.initials]
        premises = [text.formula(claim.term, claim.symbols(back)) for claim, back in used]
        if question.witness is None:
            return premises, text.formula(claim.term, claim.symbols())
        at, which = question.witness
        source, back = used[at] if at < len(used) else (claim, 0)
        parts: Sequence[object] = source.term.items if isinstance(source.term, And) else (source.term,)
        match parts[which] if at < len(used) and which < len(parts) else None, claim.term:
            case Quantified(Quantifier.EXISTS, given, such), Quantified(Quantifier.EXISTS, wanted, body) if [
                v.sort for v in given
            ] == [v.sort for v in wanted]:
                names = [symbol(f"witness {k}") for k in range(len(given))]
                for name, variable in zip(names, given, strict=True):
                    text.declare(name, variable.sort)  # and with that, that it is of its sort
                premises.append(text.formula(such, source.symbols(back), dict(zip(given, names, strict=True))))
                return premises, text.formula(body, claim.symbols(), dict(zip(wanted, names, strict=True)))
        raise Refused("a witness of another type, or where nothing is said to exist")

    def _initial(self, mark: str) -> Statement:
        found = self.known.find(mark, Kind.INITIAL)
        if found is None or not found.unary:
            raise Refused("stale, or no initial condition: it speaks of more than the state before the first step")
        return found

    def begins(self, question: Question, step: int) -> Iterator[Answered]:
        """`Begins`: initial conditions that are used say nothing of the environment. Whatever its constant values are,
        as far as the question's environment entries allow, there is a first value of each output. Those of one output
        are taken together; those of different outputs share nothing but what is constant. Raises Refused."""
        for mark in dict.fromkeys(question.initials):
            together = self._with_same_outputs(self._initial(mark))
            first = {p.symbol(step): p.sort for each in together for p in each.sources}
            called = " and ".join(each.called for each in together)
            constant = any(place.node is None for each in together for place in each.places.values())
            names = {name: f"begin{k}" for k, name in enumerate(sorted(first))} if constant else {}
            text, conditions = Text(), []
            for each in together:
                bound = {v: names[p.symbol(step)] for v, p in each.places.items() if p.symbol(step) in names}
                conditions.append(text.formula(each.term, each.symbols(step), bound))
            if not constant:
                yield self._asked(_script(text, conditions), Said.SAT, f"no first value of {called} is found")
                continue
            begin = text.bound("exists", names.values(), [first[n] for n in names], conjunction(conditions) or "true")
            used = [(self.certificate.entries[use.entry], use.back) for use in question.uses]
            given = [(self._claim(entry), back) for entry, back in used if entry.how is How.ENVIRONMENT]
            allowed = [text.formula(claim.term, claim.symbols(back)) for claim, back in given if claim.outside_only]
            script = _script(text, [*allowed, f"(not {begin})"])
            yield self._asked(script, Said.UNSAT, f"{called}: no first value for every constant input that is allowed")

    def _with_same_outputs(self, initial: Statement) -> list[Statement]:
        """An initial condition with all others of the system that speak, directly or through others, of its outputs."""
        found = [initial]
        while more := [s for s in self.known.initials if s not in found and any(s.sources & f.sources for f in found)]:
            found += more
        return [self._initial(each.digest) for each in found]

    def _together(self, claim: Statement, question: Question) -> tuple[str, ...]:
        """The nodes whose values a question takes as of one step, where that is more than the wires say.

        Along a chain, where each value is read by one node, the question follows one message on its way, and its steps
        are that message's, whatever else happens meanwhile. It does not where a claim speaks of values of two nodes, a
        value is read in two places, or a value of the step before is.
        """
        readers: dict[str, set[str]] = {}
        nodes: set[str] = set()
        apart = bool(question.initials)
        used = ((self._claim(self.certificate.entries[u.entry]), u.back) for u in question.uses)
        for each, back in ((claim, 0), *used):
            sources = {place.node or "" for place in each.sources}
            others = sources - {each.node}
            nodes |= sources
            apart = apart or back > 0 or len(others) > 1 or any(place.back for place in each.sources)
            for source in others:
                readers.setdefault(source, set()).add(each.node)
        apart = apart or any(len(found) > 1 for found in readers.values())
        return tuple(sorted(nodes)) if apart and len(nodes) > 1 else ()


def _script(text: Text, assertions: Sequence[str]) -> str:
    lines = [f"(assert {each})" for each in (*text.facts(), *assertions)]
    return "\n".join(["(set-logic ALL)", *text.declarations.values(), *lines, ""])

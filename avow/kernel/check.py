"""The kernel proper: `SoundFromAnyBeginning` (avow/calculus/proofs/kernel.dfy), applied to a certificate.

Entries that are well formed (`Formed`) and valid (`Valid`, `Begins`: each question is written from the current claims),
and that depend on no others, are a closed part (`Closed`). The hypotheses of a claim in it are the given entries that
it names, directly or through others. Only a certificate's indices and digests are trusted.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import NamedTuple

from avow.base.files import sha256
from avow.kernel.certificate import Certificate, Entry, Format, How, Question, Use
from avow.kernel.solvers import LOOK, Reply, Solvers
from avow.kernel.statements import Claimed, Statement, Statements
from avow.kernel.text import Text, Untranslatable, conjunction, symbol
from avow.language.terms import And, Quantified, Quantifier


class Refused(Exception):  # noqa: N818 - it says what came of it
    """The certificate does not show the claim."""


@dataclass(frozen=True, slots=True, order=True)
class Needed:
    """A hypothesis. `conds`: assumptions that a guarantee's evidence may use; nodes whose values belong to one step."""

    kind: How
    node: str
    digest: str
    conds: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Established:
    """A claim established, up to its hypotheses. `goal`: its digest; `shown`: (node, digest) of those shown on the way;
    `key`: the digest of its basis; `vacuous`: its premises are contradictory; `solvers`: how many answered each;
    `at_once`: at each step from what holds at that step."""

    goal: str
    hypotheses: tuple[Needed, ...]
    shown: tuple[tuple[str, str], ...]
    key: str
    vacuous: bool
    solvers: int
    at_once: bool = False


class Answered(NamedTuple):
    """A question (its digest), answered as wanted by `solvers` of them; `together`: nodes whose steps it merges."""

    digest: str
    solvers: int
    together: tuple[str, ...] = ()
    vacuous: bool = False


KINDS = {How.SHOWN: (Claimed.ASSUMPTION, Claimed.REQUIREMENT, Claimed.IMPOSSIBLE), How.GUARANTEE: (Claimed.GUARANTEE,)}
KINDS |= {How.ENVIRONMENT: (Claimed.ENVIRONMENT, Claimed.ASSUMPTION), How.OPEN: (Claimed.ASSUMPTION,)}
KINDS |= {How.POSSIBLE: (Claimed.POSSIBLE, Claimed.START), How.DEFINED: (Claimed.DEFINITION,)}


@dataclass
class Kernel:
    """Checks the entries of one certificate against the claims of a system; each entry and question once."""

    known: Statements
    certificate: Certificate
    solvers: Solvers

    def establish(self, goal: int, *, alone: bool = False) -> Established:
        """The claim of an entry, on all its dependencies; `alone`: on its own questions and lemmas. Raises Refused."""
        entries, (answers, refused) = self.certificate.entries, self.checked
        if goal in refused or goal not in answers:
            raise refused.get(goal, Refused("there is no such entry"))
        part, own = {goal}, [goal]
        for i in own:  # which grows in the loop
            new = set(entries[i].named()) - part
            part |= new
            own += [j for j in new if not alone or self._claim(entries[j]).kind is Claimed.REQUIREMENT]
        rests = [entries[i] for i in part]
        given = [e for e in rests if e.how not in (How.SHOWN, How.POSSIBLE, How.DEFINED)]
        apart = any(e.base or e.how is How.DEFINED or any(u.back for q in e.questions for u in q.uses) for e in rests)
        needed = {Needed(e.how, e.node, e.digest, tuple(sorted(entries[c].digest for c in e.conds))) for e in given}
        if self._claim(entries[goal]).kind is Claimed.REQUIREMENT and any(need.kind is How.OPEN for need in needed):
            raise Refused("a requirement rests on what only a derived contract may assume")
        answered = [answer for i in own for answer in answers[i]]
        needed |= {Needed(How.TOGETHER, "", sha256("\n".join(n)), n) for a in answered if (n := a.together)}
        parts = [Format.NOW, entries[goal].digest, *map(astuple, sorted(needed)), sorted({a.digest for a in answered})]
        return Established(
            goal=entries[goal].digest,
            hypotheses=tuple(sorted(needed)),
            shown=tuple((entries[i].node, entries[i].digest) for i in sorted(part) if entries[i].how is How.SHOWN),
            key=sha256(json.dumps(parts)),
            vacuous=any(answer.vacuous for answer in answered),
            solvers=min((answer.solvers for answer in answered), default=1),
            at_once=not apart,
        )

    @cached_property
    def checked(self) -> tuple[dict[int, tuple[Answered, ...]], dict[int, Refused]]:
        """For each entry the answers to its questions, or why it is not valid, or depends on one that is not."""
        answers, refused = dict[int, tuple[Answered, ...]](), dict[int, Refused]()
        users: dict[int, list[int]] = {}
        for i, entry in enumerate(self.certificate.entries):
            for j in entry.named():
                users.setdefault(j, []).append(i)
            try:
                answers[i] = tuple(self._entry(i, entry))
            except (Refused, Untranslatable) as why:
                refused[i] = why if isinstance(why, Refused) else Refused(f"no text: {why}")
        for i in (stack := list(refused)):  # which grows in the loop
            for user in users.get(i, ()):
                if user not in refused:
                    refused[user] = refused[i]
                    stack.append(user)
        return answers, refused

    def _entry(self, i: int, entry: Entry) -> Iterator[Answered]:
        """`Formed`, `Valid` and `Begins`. Raises Refused."""
        entries, claim = self.certificate.entries, self._claim(entry)
        if any(not 0 <= j < len(entries) or entries[j].how is How.POSSIBLE for j in entry.named()):
            raise Refused("it names an entry that is not there, or that is no premise")
        match entry.how:
            case How.GUARANTEE:
                # it holds while *all* its node's assumptions have held so far: none may be omitted
                conds = frozenset(entries[c].digest for c in entry.conds)
                late = any(c >= i or entries[c].node != entry.node for c in entry.conds)
                if late or conds != self.known.assumptions.get(entry.node):
                    raise Refused(f"{claim.called}: its conditions are not the assumptions of its node, before it")
            case How.ENVIRONMENT if claim.nodes:
                raise Refused(f"{claim.called} is called the environment's, but a node provides a value in it")
            case How.SHOWN if entry.step is None or entry.step.initials:
                raise Refused(f"{claim.called}: no question about every step, or one from initial values")
            case How.SHOWN:
                for step, question in enumerate(entry.questions):
                    if any(not 0 <= u.back <= step or (u.back == 0 and u.entry >= i) for u in question.uses):
                        raise Refused("circular: an entry uses, at its own step, what comes no earlier than itself")
                    yield self.answered(entry, question, step)
                    yield from self.begins(question.uses, question.initials)
            case How.POSSIBLE:
                body = (text := Text()).formula(claim.term, claim.symbols())
                yield self._asked(text.script([body]), Reply.SAT, f"{claim.called}: no values are shown to be so")
                if claim.kind is Claimed.START:  # one example is not enough if the environment matters: all of it
                    firsts = [s.digest for s in self.known.every if s.kind is Claimed.INITIAL and s.node in claim.nodes]
                    yield from self.begins([use for question in entry.base for use in question.uses], firsts)

    def _claim(self, entry: Entry) -> Statement:
        """The claim of an entry, looked up in the current system. Raises Refused."""
        found = (self.known.find(entry.digest, kind, entry.node) for kind in KINDS.get(entry.how, ()))
        if (claim := next(filter(None, found), None)) is None:
            raise Refused(f"stale: {entry.node or 'the system'} has no such {entry.how} claim")
        return claim

    def _asked(self, script: str, wanted: Reply, otherwise: str) -> Answered:
        if wanted is Reply.SAT and (types := re.findall(r"^\(declare-sort (.*) 0\)$", script, re.MULTILINE)):
            if re.search(r"\((forall|exists) \(", script):  # without quantifiers, one element represents any number
                raise Refused(f"{otherwise}, however many elements {' and '.join(types)} may have")
            script += "".join(f"(assert (forall ((x {name}) (y {name})) (= x y)))\n" for name in types)
        answer, count = self.solvers.ask(script, wanted)
        if not count:
            raise Refused(f"{otherwise}: {answer}")
        return Answered(sha256(script), count)

    def answered(self, entry: Entry, question: Question, step: int) -> Answered:
        """`Base_valid` and `Step_valid`: no window of states meets the premises and not the claim. Raises Refused."""
        text, claim = Text(), self._claim(entry)
        premises, goal = self._question(text, claim, question, step)
        found = self._asked(text.script([*premises, f"(not {goal})"]), Reply.UNSAT, f"{claim.called} does not follow")
        vacuous = self.solvers.first(text.script(premises), LOOK) is Reply.UNSAT
        return Answered(found.digest, found.solvers, self._together(claim, question), vacuous)

    def _question(self, text: Text, claim: Statement, question: Question, step: int) -> tuple[list[str], str]:
        """Premises and conclusion. A witness names the values that a premise says exist: the claim's existential is
        shown for these values, which is stronger."""
        used = [*self._used(question.uses), *((self._initial(mark), step) for mark in question.initials)]
        premises = [text.formula(each.term, each.symbols(back)) for each, back in used]
        if question.witness is None:
            return premises, text.formula(claim.term, claim.symbols())
        at, which = question.witness
        for source, back in used[at : at + 1]:  # that premise, if it exists
            parts: Sequence[object] = source.term.items if isinstance(source.term, And) else (source.term,)
            match claim.term, parts[which] if which < len(parts) else None:
                case Quantified(Quantifier.EXISTS, wanted, body), Quantified(Quantifier.EXISTS, given, such):
                    names = [symbol(f"witness {k}") for k in range(len(given))]
                    for name, variable in zip(names, given, strict=True):
                        text.declare(name, variable.sort)  # this also asserts that it is of its sort
                    if [v.sort for v in wanted] == [v.sort for v in given]:
                        premises.append(text.formula(such, source.symbols(back), dict(zip(given, names, strict=True))))
                        return premises, text.formula(body, claim.symbols(), dict(zip(wanted, names, strict=True)))
        raise Refused("a witness of another type, or where nothing is said to exist")

    def _used(self, uses: Sequence[Use]) -> list[tuple[Statement, int]]:
        return [(self._claim(self.certificate.entries[use.entry]), use.back) for use in uses]

    def _initial(self, mark: str) -> Statement:
        if (found := self.known.find(mark, Claimed.INITIAL)) is None or not found.unary:
            raise Refused("stale, or no initial condition: it speaks of more than the state before the first step")
        return found

    def begins(self, uses: Sequence[Use], marks: Sequence[str]) -> Iterator[Answered]:
        """`Begins`: initials do not constrain the environment: for all constants that the environment entries used
        allow, each output has a first value that satisfies all its conditions together (`Apart`). Raises Refused."""
        given = [use for use in uses if self.certificate.entries[use.entry].how is How.ENVIRONMENT]
        for mark in dict.fromkeys(marks):
            initials = [each for each in self.known.every if each.kind is Claimed.INITIAL]
            found = [self._initial(mark)]
            while more := [s for s in initials if s not in found and any(s.sources & f.sources for f in found)]:
                found += map(self._initial, (each.digest for each in more))
            called = " and ".join(each.called for each in found)
            first = {place.symbol(): place.sort for each in found for place in each.sources}
            constant = any(place.node is None for each in found for place in each.places.values())
            names = {name: f"begin{k}" for k, name in enumerate(sorted(first))} if constant else {}
            text, conditions = Text(), []
            for each in found:
                bound = {v: names[p.symbol()] for v, p in each.places.items() if p.symbol() in names}
                conditions.append(text.formula(each.term, each.symbols(), bound))
            if not constant:
                yield self._asked(text.script(conditions), Reply.SAT, f"no first value of {called} is found")
                continue
            begin = text.bound("exists", names.values(), [first[n] for n in names], conjunction(conditions) or "true")
            allowed = (text.formula(each.term, each.symbols(back)) for each, back in self._used(given))
            asked = text.script([*allowed, f"(not {begin})"])
            yield self._asked(asked, Reply.UNSAT, f"{called}: no first value for every constant input that is allowed")

    def _together(self, claim: Statement, question: Question) -> tuple[str, ...]:
        """The nodes whose steps a question treats as one, if the wires do not imply that. Along a chain, where each
        value is read by one node, it follows one message on its way, whatever else happens meanwhile. This fails if a
        claim refers to values of two nodes, a value is read in two places, a value of the previous step is read, or a
        node off the chain constrains its own steps: its pace, or what it remembers of the environment."""
        used = [(claim, 0), *self._used(question.uses)]
        before = question.initials or any(back or any(p.back for p in each.sources) for each, back in used)
        reads = {(node, each.node) for each, _ in used for node in each.nodes - {each.node}}
        nodes = {node for each, _ in used for node in each.nodes}
        kinds = KINDS[How.ENVIRONMENT]
        own = {s.node for s, _ in used if s.kind is Claimed.GUARANTEE or (s.kind in kinds and s.sources)}
        if off := own - nodes - {claim.node}:
            nodes |= off | ({claim.node} - {""})
        joined = any(len(s.nodes - {s.node}) > 1 for s, _ in used) or len(reads) > len(dict(reads))
        return tuple(sorted(nodes)) if (before or joined or off) and len(nodes) > 1 else ()

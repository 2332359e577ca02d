"""The kernel proper: the theorem's conditions (`Sound` in avow/calculus/proofs/kernel.dfy), held against a certificate.

For a claim, the entries that it rests on are walked to, and the part so found is checked to be closed (`Closed`), well
formed (`Formed`) and valid (`Valid`): each question that it names is written from the claims as they are now and has no
counterexample. The given entries of the part are all the claim's hypotheses. Nothing that the certificate says beside
indices and digests is believed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

from avow.base.files import digest as sha256
from avow.kernel.certificate import FORMAT, Certificate, Entry, How, Question
from avow.kernel.solvers import LOOK, Said, Solvers
from avow.kernel.statements import Kind, Place, Statement, Statements
from avow.kernel.text import Text, Untranslatable, conjunction, symbol
from avow.language.terms import And, Quantified, Quantifier, Term


class Refused(Exception):  # noqa: N818 - it says what came of it
    """The certificate does not show the claim."""


class Given(StrEnum):
    """The kinds of hypotheses."""

    GUARANTEE = "guarantee"
    ENVIRONMENT = "environment"
    OPEN = "open"
    TOGETHER = "together"
    """Values of several nodes are taken as of one step: they persist until used together, one output for each input."""


@dataclass(frozen=True, slots=True)
class Needed:
    """A hypothesis: of a guarantee, `conds` are the assumptions that its evidence may use (digests); of values taken
    together, `conds` are the nodes that put them out."""

    kind: Given
    node: str
    digest: str
    conds: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Established:
    """A claim that the kernel has established, up to its hypotheses."""

    goal: str
    """Its digest."""
    hypotheses: tuple[Needed, ...]
    shown: tuple[tuple[str, str], ...]
    """(node, digest) of the claims shown on the way, itself included."""
    key: str
    """What it was established from, digested: it moves exactly where something used has changed."""
    vacuous: bool
    """Its premises contradict each other: it is true, and says nothing."""
    solvers: int
    """How many solvers, of different makers, answered each of its questions."""


@dataclass
class Kernel:
    """Checks the entries of one certificate against the claims of a system; each entry and question once."""

    known: Statements
    certificate: Certificate
    solvers: Solvers
    _found: dict[int, tuple[Answered, ...] | Refused] = field(default_factory=dict)
    _sound: frozenset[int] | None = None

    @cached_property
    def places(self) -> Mapping[tuple[str, str], list[int]]:
        """(node, digest) of a claim → the entries that show it."""
        found: dict[tuple[str, str], list[int]] = {}
        for i, entry in enumerate(self.certificate.entries):
            if entry.how is How.SHOWN:
                found.setdefault((entry.node, entry.digest), []).append(i)
        return found

    def establish(self, goal: int) -> Established:
        """The claim of an entry, with all that it rests on. Raises Refused."""
        if goal >= len(self.certificate.entries):
            raise Refused("there is no such entry")
        part = self._walk(goal)
        if not self._closed(goal, part):
            raise Refused("the entries that it rests on are not closed")
        for i in sorted(part):
            self._valid(i)
        found = self._established(goal, part, part)
        is_open = any(need.kind is Given.OPEN for need in found.hypotheses)
        if is_open and self._claim(self.certificate.entries[goal]).kind is Kind.REQUIREMENT:
            raise Refused("a requirement rests on what only a derived contract may assume")
        return found

    def side_condition(self, goal: int) -> Established:
        """The claim of an entry as an implication: established with all that it rests on, and told with only what its
        own questions name. Linear for all entries together. Raises Refused."""
        if self._sound is None:
            self._sound = self._greatest()
        if goal not in self._sound:
            self.establish(goal)  # says why not
            raise Refused("it rests on what is refused")
        part = frozenset((goal, *_named(self.certificate.entries[goal])))
        return self._established(goal, part, frozenset((goal,)))

    def _established(self, goal: int, part: frozenset[int], asked: frozenset[int]) -> Established:
        entries = [self.certificate.entries[i] for i in sorted(part)]
        answered = [answer for i in sorted(asked) for answer in self._valid(i)]
        hypotheses = {need: None for entry in entries if (need := self._needed(entry)) is not None}
        hypotheses |= {
            Needed(Given.TOGETHER, "", sha256("\n".join(answer.together)), answer.together): None
            for answer in answered
            if answer.together
        }
        ordered = tuple(sorted(hypotheses, key=lambda n: (n.kind, n.node, n.digest, n.conds)))
        mark = self.certificate.entries[goal].digest
        told = [[n.kind, n.node, n.digest, n.conds] for n in ordered]
        questions = sorted({answer.digest for answer in answered})
        return Established(
            goal=mark,
            hypotheses=ordered,
            shown=tuple((e.node, e.digest) for e in entries if e.how is How.SHOWN),
            key=sha256(json.dumps([FORMAT, mark, told, questions])),
            vacuous=any(answer.vacuous for answer in answered),
            solvers=min((answer.solvers for answer in answered), default=1),
        )

    # -- the part that a claim rests on --------------------------------------------------------------------------------

    def _walk(self, goal: int) -> frozenset[int]:
        found, stack = {goal}, [goal]
        while stack:
            for i in _named(self.certificate.entries[stack.pop()]):
                if i >= len(self.certificate.entries):
                    raise Refused("an entry names one that is not there")
                if i not in found:
                    found.add(i)
                    stack.append(i)
        return frozenset(found)

    def _greatest(self) -> frozenset[int]:
        """The entries that are valid, and rest on none that is not: the greatest closed part."""
        users: dict[int, list[int]] = {}
        refused: list[int] = []
        size = len(self.certificate.entries)
        for i, entry in enumerate(self.certificate.entries):
            for j in _named(entry):
                users.setdefault(j, []).append(i)
            try:
                self._valid(i)
            except Refused:
                refused.append(i)
        refused += [j for j in users if j >= size]
        found = set(refused)
        while refused:
            for user in users.get(refused.pop(), ()):
                if user not in found:
                    found.add(user)
                    refused.append(user)
        return frozenset(range(size)) - found

    def _closed(self, goal: int, part: frozenset[int]) -> bool:
        """`Closed`: whatever a member names is a member."""
        return goal in part and all(j in part for i in part for j in _named(self.certificate.entries[i]))

    # -- one entry -----------------------------------------------------------------------------------------------------

    def _valid(self, i: int) -> tuple[Answered, ...]:
        if i not in self._found:
            try:
                if any(j >= len(self.certificate.entries) for j in _named(self.certificate.entries[i])):
                    raise Refused("it names an entry that is not there")
                self._found[i] = tuple(self._entry(i, self.certificate.entries[i]))
            except Refused as refused:
                self._found[i] = refused
        found = self._found[i]
        if isinstance(found, Refused):
            raise found
        return found

    def _entry(self, i: int, entry: Entry) -> Iterator[Answered]:
        """`Formed` and `Valid`. Raises Refused."""
        match entry.how:
            case How.GUARANTEE:
                self._guarantee(i, entry)
            case How.ENVIRONMENT:
                if not self._claim(entry).outside_only:
                    raise Refused(
                        f"{self._called(entry)} is called the environment's, but a node provides a value in it"
                    )
            case How.OPEN:
                if self._claim(entry).kind is not Kind.ASSUMPTION:
                    raise Refused(f"{self._called(entry)} is no assumption that a derived contract could make")
            case How.SHOWN:
                if entry.step is None:
                    raise Refused(f"{self._called(entry)}: no question about every step")
                for b, question in enumerate(entry.base):
                    self._formed(i, question, b)
                    yield self.answered(entry, question, b)
                    yield from self.begins(question, b)
                if entry.step.initials:
                    raise Refused("initial values in a question about every step")
                self._formed(i, entry.step, len(entry.base))
                yield self.answered(entry, entry.step, len(entry.base))

    def _guarantee(self, i: int, entry: Entry) -> None:
        """It holds while *all* its node's assumptions have held so far: none may be left out, each is of lower rank."""
        if self.known.find(entry.digest, Kind.GUARANTEE, entry.node) is None:
            raise Refused(f"stale: {entry.node} has no such guarantee")
        if any(c >= i for c in entry.conds):
            raise Refused(f"{self._called(entry)}: its assumptions do not come before it")
        conds = {self.certificate.entries[c].digest for c in entry.conds}
        if entry.node not in self.known.assumptions or conds != set(self.known.assumptions[entry.node]):
            raise Refused(f"{self._called(entry)}: its conditions are not the assumptions of its node")

    def _formed(self, i: int, question: Question, furthest: int) -> None:
        """`Fine`: no further back than there are steps; at the same step only what is of lower rank."""
        for use in question.uses:
            if use.back > furthest or (use.back == 0 and use.entry >= i):
                raise Refused("circular: an entry uses, at its own step, what comes no earlier than itself")

    def _claim(self, entry: Entry) -> Statement:
        """The claim of an entry as it is now. Raises Refused."""
        kinds = {
            How.SHOWN: (Kind.ASSUMPTION, Kind.REQUIREMENT),
            How.GUARANTEE: (Kind.GUARANTEE,),
            How.ENVIRONMENT: (Kind.ENVIRONMENT, Kind.ASSUMPTION),
            How.OPEN: (Kind.ASSUMPTION,),
        }[entry.how]
        for kind in kinds:
            found = self.known.find(entry.digest, kind, entry.node)
            if found is not None:
                return found
        raise Refused(f"stale: {entry.node or 'the system'} has no such {' or '.join(kinds)}")

    def _called(self, entry: Entry) -> str:
        claim = self._claim(entry)
        return f"{claim.node}.{claim.name}" if claim.node else claim.name

    def _needed(self, entry: Entry) -> Needed | None:
        match entry.how:
            case How.GUARANTEE:
                conds = tuple(sorted(self.certificate.entries[c].digest for c in entry.conds))
                return Needed(Given.GUARANTEE, entry.node, entry.digest, conds)
            case How.ENVIRONMENT:
                return Needed(Given.ENVIRONMENT, entry.node, entry.digest)
            case How.OPEN:
                return Needed(Given.OPEN, entry.node, entry.digest)
            case How.SHOWN:
                return None

    # -- one question --------------------------------------------------------------------------------------------------

    def answered(self, entry: Entry, question: Question, step: int) -> Answered:
        """`Base_valid` and `Step_valid`: no window of states meets the premises and not the claim. Raises Refused."""
        script, premises = self.script(entry, question, step)
        if self.solvers.first(script) is not Said.UNSAT:
            raise Refused(f"{self._called(entry)} does not follow from what is named")
        second = self.solvers.second is not None and self.solvers.second.ask(script) is Said.UNSAT
        vacuous = self.solvers.first(premises, LOOK) is Said.UNSAT
        return Answered(sha256(script), self._together(entry, question), vacuous, 2 if second else 1)

    def begins(self, question: Question, step: int) -> Iterator[Answered]:
        """That initial conditions that are used say nothing of the environment: whatever its constant values are, as
        far as the question's environment entries allow, there is a first value of each output. Those of one output are
        taken together; those of different outputs share nothing but what is constant. Raises Refused."""
        for mark in dict.fromkeys(question.initials):
            initial = self.known.find(mark, Kind.INITIAL)
            assert initial is not None
            together = self._with_same_outputs(initial)
            if all(place.node is not None for each in together for place in each.places.values()):
                continue  # where no value satisfies it, the claim is vacuous, and said to be so
            script = self._beginning(question, step, together)
            if self.solvers.first(script) is not Said.UNSAT:
                raise Refused(
                    f"the initial condition of {initial.node}.{initial.name} is not shown to have a value "
                    "for every constant input that the environment allows"
                )
            second = self.solvers.second is not None and self.solvers.second.ask(script) is Said.UNSAT
            yield Answered(sha256(script), (), False, 2 if second else 1)

    def _with_same_outputs(self, initial: Statement) -> list[Statement]:
        """An initial condition with all others of the system that speak, directly or through others, of its outputs."""
        found, spoken = [initial], _first_values(initial)
        others = [s for same in self.known.by_digest.values() for s in same if s.kind is Kind.INITIAL]
        while more := [s for s in others if s not in found and _first_values(s).keys() & spoken.keys()]:
            found += more
            spoken = {name: place for s in found for name, place in _first_values(s).items()}
        return found

    def _beginning(self, question: Question, step: int, together: list[Statement]) -> str:
        """The text of: constant values, as the environment entries of a question allow, without first values."""
        text = Text()
        used = [(self.certificate.entries[use.entry], use.back) for use in question.uses]
        first = {name: place for each in together for name, place in _first_values(each).items()}
        names = {name: f"first{k}" for k, name in enumerate(sorted(first))}
        try:
            allowed = [
                text.formula(claim.term, claim.symbols(back))
                for entry, back in used
                if entry.how is How.ENVIRONMENT and (claim := self._claim(entry)).outside_only
            ]
            conditions = [text.member(first[name].sort, called) for name, called in names.items()]
            for each in together:
                if not each.unary:
                    raise Refused("an initial condition speaks of more than the state before the first step")
                bound = {v: names[p.symbol()] for v, p in each.places.items() if p.node is not None}
                conditions.append(text.formula(each.term, each.symbols(step), bound))
            binders = text.binders(names.values(), [first[name].sort for name in names])
            body = conjunction(conditions)
            begins = f"(exists ({binders}) {body})" if names else body
            facts = text.facts()
        except Untranslatable as problem:
            raise Refused(f"no text: {problem}") from None
        lines = [f"(assert {premise})" for premise in (*facts, *allowed)]
        return "\n".join(["(set-logic ALL)", *text.declarations.values(), *lines, f"(assert (not {begins}))", ""])

    def script(self, entry: Entry, question: Question, step: int) -> tuple[str, str]:
        """The text of a question, and of its premises alone. Raises Refused."""
        text = Text()
        try:
            premises, goal = self._assertions(text, entry, question, step)
            facts = text.facts()
        except Untranslatable as problem:
            raise Refused(f"no text: {problem}") from None
        head = ["(set-logic ALL)", *text.declarations.values()]
        lines = [f"(assert {premise})" for premise in (*facts, *premises)]
        return "\n".join([*head, *lines, f"(assert (not {goal}))", ""]), "\n".join([*head, *lines, ""])

    def _assertions(self, text: Text, entry: Entry, question: Question, step: int) -> tuple[list[str], str]:
        claim = self._claim(entry)
        used = [(self._claim(self.certificate.entries[use.entry]), use.back) for use in question.uses]
        for mark in question.initials:
            initial = self.known.find(mark, Kind.INITIAL)
            if initial is None or not initial.unary:
                raise Refused("stale, or no initial condition: it speaks of more than the state before the first step")
            used.append((initial, step))
        premises, named = [], None
        for k, (statement, back) in enumerate(used):
            if question.witness is not None and question.witness[0] == k:
                named = self._opened(text, statement, back, question.witness[1])
                premises += named[1]
            premises.append(text.formula(statement.term, statement.symbols(back)))
        if named is None:
            return premises, text.formula(claim.term, claim.symbols())
        match claim.term:
            case Quantified(quantifier=Quantifier.EXISTS, variables=variables, body=body) if len(variables) == len(
                named[0]
            ):
                if [text.sort(v.sort) for v in variables] != [text.sort(text.free[n]) for n in named[0]]:
                    raise Refused("a witness of another type")
                members = [text.member(v.sort, n) for v, n in zip(variables, named[0], strict=True)]
                goal = text.formula(body, claim.symbols(), dict(zip(variables, named[0], strict=True)))
                return premises, f"(and {' '.join([*(m for m in members if m), goal])})"
        raise Refused("a witness for a claim that does not say that something exists")

    def _opened(self, text: Text, used: Statement, back: int, at: int) -> tuple[list[str], list[str]]:
        """What a premise says exists, by name: new constants, and that they are as it says."""
        term: Term = used.term
        parts = term.items if isinstance(term, And) else (term,)
        if at < len(parts):
            match parts[at]:
                case Quantified(quantifier=Quantifier.EXISTS, variables=variables, body=body):
                    names = [symbol(f"witness {k}") for k in range(len(variables))]
                    for name, variable in zip(names, variables, strict=True):
                        text.declare(name, variable.sort)
                    bound = dict(zip(variables, names, strict=True))
                    return names, [text.formula(body, used.symbols(back), bound)]
        raise Refused("a witness where nothing is said to exist")

    def _together(self, entry: Entry, question: Question) -> tuple[str, ...]:
        """The nodes whose values a question takes as of one step, where that is more than the wires say.

        Along a chain, where each value is read by one node, the question follows one message on its way, and its steps
        are that message's, whatever else happens meanwhile. It does not where a claim speaks of values of two nodes, a
        value is read in two places, or a value of the step before is.
        """
        readers: dict[str, set[str]] = {}
        nodes: set[str] = set()
        apart = bool(question.initials)
        for e, back in ((entry, 0), *((self.certificate.entries[u.entry], u.back) for u in question.uses)):
            claim = self._claim(e)
            sources = {node for node, _ in claim.sources}
            others = sources - {claim.node}
            nodes |= sources
            apart = apart or back > 0 or len(others) > 1 or any(ago for _, ago in claim.sources)
            for source in others:
                readers.setdefault(source, set()).add(claim.node)
        apart = apart or any(len(found) > 1 for found in readers.values())
        return tuple(sorted(nodes)) if apart and len(nodes) > 1 else ()


@dataclass(frozen=True, slots=True)
class Answered:
    digest: str
    together: tuple[str, ...]
    vacuous: bool
    solvers: int


def _first_values(initial: Statement) -> dict[str, Place]:
    """The values before the first step that it speaks of, by their symbol."""
    return {place.symbol(): place for place in initial.places.values() if place.node is not None}


def _named(entry: Entry) -> Iterator[int]:
    """`Named`: the entries that an entry names, in its conditions and in all of its questions."""
    yield from entry.conds
    for question in (*entry.base, *((entry.step,) if entry.step else ())):
        yield from (use.entry for use in question.uses)

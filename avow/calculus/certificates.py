"""Certificates for a system's derivations and requirements, and the kernel's results for them.

The engine's proofs are hints for `avow.calculus.finder`; certificates kept from an earlier run are tried first. A claim
is proved only if `avow.kernel.check` establishes it from the current system.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace
from typing import TYPE_CHECKING, assert_never

from avow.base.graphs import components, reached
from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.calculus.derivation import Case, Phase, Settled
from avow.calculus.discharge import Bounds
from avow.calculus.finder import Finder, Hint
from avow.calculus.induction import INVARIANT, Written, with_lemmas
from avow.calculus.subsystem_contracts import innermost
from avow.calculus.wiring import wiring
from avow.kernel.certificate import Certificate, Entry, How, Question, Use
from avow.kernel.check import Established, Kernel, Refused
from avow.kernel.solvers import Reply, Solvers
from avow.kernel.statements import Claimed, Statement, Statements, statements

if TYPE_CHECKING:
    from avow.calculus.composition import Composition
    from avow.calculus.derivation import Goal


POSSIBLE = frozenset({Claimed.POSSIBLE, Claimed.IMPOSSIBLE, Claimed.START})
"""Claims that something is possible or, as an alternative, that a node alone excludes it."""


@dataclass(slots=True)
class Certificates:
    """The certificates of one system. `kept`: those of an earlier run, by scope; `made`: the current ones."""

    composition: Composition
    kept: Mapping[str, Certificate] = field(default_factory=dict)
    made: dict[str, Certificate] = field(default_factory=dict)
    solvers: Solvers = field(default_factory=Solvers)
    _known: Statements | None = None
    _finders: dict[str, Finder] = field(default_factory=dict)
    _kernels: dict[str, Kernel] = field(default_factory=dict)
    _places: dict[str, dict[tuple[How, str, str], list[int]]] = field(default_factory=dict)
    """Scope → the entries for a claim."""
    _named: dict[tuple[Claimed, str], Statement] = field(default_factory=dict)
    _extended: dict[tuple[Written, ...], Statements] = field(default_factory=dict)

    @property
    def known(self) -> Statements:
        if self._known is None:
            self._known = statements(wiring(self.composition.frame))
        return self._known

    def known_with(self, lemmas: tuple[Written, ...]) -> Statements:
        """The claims of the system, and those of the lemmas that can be read."""
        if not lemmas:
            return self.known
        if lemmas not in self._extended:
            frame = self.composition.frame
            self._extended[lemmas] = statements(with_lemmas(wiring(frame), frame.system.contract, lemmas))
        return self._extended[lemmas]

    @property
    def late(self) -> bool:
        """Whether a Z3 query ran out of time: a faster machine might establish more."""
        return Reply.LATE in self.solvers.known.values()

    def condition(self, goal: Goal, about: str, bounds: Bounds) -> Established | None:
        """Establish the assumption of a node (``agent.low``; in a subsystem ``robot.agent.low``) in a derivation."""
        claim = self.claim(Claimed.ASSUMPTION, innermost(about))
        if claim is None:
            return None
        if goal.name not in self.made:
            kept = self.kept.get(goal.name)
            if kept is not None and self.established(kept, claim) is not None:
                self.made[goal.name] = kept
        found = self.established(self.made.get(goal.name), claim)
        if found is None and goal.name not in self._finders:
            self._finders[goal.name] = self._finder(goal, bounds)
            self.made[goal.name] = self._finders[goal.name].find()
            found = self.established(self.made[goal.name], claim)
        return found

    def requirement(
        self, name: str, hint: Hint, bounds: Bounds, lemmas: tuple[Written, ...] = ()
    ) -> Established | None:
        """Establish a requirement on the whole system."""
        claim = self.claim(Claimed.REQUIREMENT, name)
        if claim is None:
            return None
        scope = requirement_scope(name)
        found = self.established(self.kept.get(scope), claim)
        if found is not None:
            self.made[scope] = self.kept[scope]
            return found
        whole = self.composition.whole
        if whole.name not in self._finders:
            self._finders[whole.name] = self._finder(whole, bounds)
        of_whole = self._finders[whole.name]
        lemmas = tuple(dict.fromkeys((*of_whole.lemmas, *lemmas)))
        finder = replace(of_whole, known=self.known_with(lemmas), lemmas=lemmas, scope=scope, goals=(claim,))
        finder.hints = {**finder.hints, name: hint}
        self.made[scope] = _pruned(finder.find(), claim)
        return self.established(self.made[scope], claim)

    def existence(self, name: str) -> list[Established] | None:
        """Establish everything that an obligation claims to be possible (`avow.calculus.wiring`)."""
        entries: list[Entry] = []
        for part in self.parts(name):
            tried = ((claim, attempt) for claim in part for attempt in self._examples(claim))
            shown = (a for claim, a in tried if self.established(Certificate(name, a), claim) is not None)
            entries += next(shown, ())
        scope = existence_scope(name)
        self.made[scope] = Certificate(scope, tuple(entries))
        return self.existing(self.made[scope], name)

    def existing(self, certificate: Certificate | None, name: str) -> list[Established] | None:
        """The same as `existence`, from a certificate."""
        found = complete(
            next((one for claim in part if (one := self.established(certificate, claim)) is not None), None)
            for part in self.parts(name)
        )
        return found or None

    def _examples(self, claim: Statement) -> Iterator[tuple[Entry, ...]]:
        """Certificates to try for the claim that something is possible or excluded. A loop may have first values only
        under the environment assumptions; they are left out if they are not needed."""
        match claim.kind:
            case Claimed.IMPOSSIBLE:
                yield (Entry(How.SHOWN, "", claim.digest, step=Question()),)
            case Claimed.START:
                known = (s for s in self.known.every if s.kind is Claimed.ENVIRONMENT)
                given = tuple(Entry(How.ENVIRONMENT, s.node, s.digest) for s in known)
                for assumed in ((), given) if given else ((),):
                    uses = tuple(Use(k) for k in range(len(assumed)))
                    yield (*assumed, Entry(How.POSSIBLE, "", claim.digest, base=(Question(uses),)))
            case _:  # an assumption
                yield (Entry(How.POSSIBLE, "", claim.digest),)

    def parts(self, name: str) -> list[list[Statement]]:
        """The parts of an obligation that something is possible: for each, the claims of which one is enough."""
        parts: dict[str, list[Statement]] = {}
        for claim in self.known.every:
            if claim.kind in POSSIBLE and _possible_name(claim) == name:
                parts.setdefault(claim.name, []).append(claim)
        return list(parts.values())

    def kept_for(self, scope: str, kind: Claimed, name: str) -> Established | None:
        """The kernel's result for a claim from the certificate of an earlier run."""
        claim = self.claim(kind, name)
        return self.established(self.kept.get(scope), claim) if claim is not None else None

    def established(self, certificate: Certificate | None, claim: Statement) -> Established | None:
        """The kernel's result for a claim, from a certificate that has an entry for it; otherwise None."""
        if certificate is None:
            return None
        kernel = self._kernels.get(certificate.scope)
        if kernel is None or kernel.certificate is not certificate:
            known = self.known_with(certificate.lemmas)
            kernel = self._kernels[certificate.scope] = Kernel(known, certificate, self.solvers)
            places = self._places[certificate.scope] = {}
            for i, entry in enumerate(certificate.entries):
                places.setdefault((entry.how, entry.node, entry.digest), []).append(i)
        how = How.POSSIBLE if claim.kind in (Claimed.POSSIBLE, Claimed.START) else How.SHOWN
        for i in self._places[certificate.scope].get((how, claim.node, claim.digest), ()):
            try:
                # for an assumption, the entries that its questions name are reported as separate claims
                return kernel.establish(i, alone=claim.kind is Claimed.ASSUMPTION)
            except Refused:
                continue
        return None

    def claim(self, kind: Claimed, name: str) -> Statement | None:
        """The current claim of that name; None if it has no text."""
        if not self._named:
            self._named = {(s.kind, s.called): s for s in self.known.every}
        return self._named.get((kind, name))

    def _finder(self, goal: Goal, bounds: Bounds) -> Finder:
        composition = self.composition
        graph = composition.frame.graph
        nodes = composition.leaves(goal, goal.nodes)
        selected = frozenset(nodes)
        edges = [e for e in graph.edges if {e.source.node, e.target.node} <= selected]
        arcs = [(e.source.node, e.target.node) for e in edges if not e.delayed]
        order = tuple(name for group in components(nodes, arcs) for name in group)
        everything = selected == frozenset(graph.nodes)
        hints: dict[str, Hint] = {}
        hopeless: set[str] = set()
        lemmas: dict[Written, None] = {}
        for part in goal.inner_first():
            for condition, answer in composition.settled(part, bounds).settled.items():
                name = innermost(str(condition.about))
                if answer.verdict is not Verdict.PROVED:
                    hopeless.add(name)
                elif (hint := _hint(answer)) is not None:
                    hints[name] = hint
                lemmas |= dict.fromkeys(case.invariant for case in answer.cases if case.invariant)
        return Finder(
            self.known_with(tuple(lemmas)),
            goal.name,
            order,
            any(e.delayed for e in edges) or composition.frame.remembering(nodes),
            frozenset() if everything else frozenset(innermost(str(name)) for name in goal.root.assumed),
            hints,
            frozenset(hopeless - hints.keys()),
            lemmas=tuple(lemmas),
            solvers=self.solvers,
        )


def requirement_scope(name: str) -> str:
    """The scope of a requirement's certificate. No derivation can have such a name."""
    return f"requirement {name}"


def scope_of(claim: Statement) -> str | None:
    """The scope of the certificate of a claim about the whole system; None for another claim."""
    match claim.kind:
        case Claimed.REQUIREMENT:
            return requirement_scope(claim.name)
        case Claimed.POSSIBLE | Claimed.IMPOSSIBLE | Claimed.START:
            return existence_scope(_possible_name(claim))
        case Claimed.ASSUMPTION | Claimed.GUARANTEE | Claimed.ENVIRONMENT | Claimed.INITIAL | Claimed.DEFINITION:
            # a clause or a formula of the plan: in its derivation's scope, or in none
            return None
        case _:
            assert_never(claim.kind)


def _possible_name(claim: Statement) -> str:
    """The obligation of which a claim that something is possible is a part."""
    return claim.name if claim.kind is Claimed.START else claim.name.rpartition(".")[0]


def existence_scope(name: str) -> str:
    """The scope of the certificate of an obligation that something is possible."""
    return f"existence {name}"


def _pruned(certificate: Certificate, goal: Statement) -> Certificate:
    """The certificate with only the entries that a claim depends on."""
    wanted = (How.SHOWN, goal.node, goal.digest)
    at = next((i for i, e in enumerate(certificate.entries) if (e.how, e.node, e.digest) == wanted), None)
    if at is None:
        return Certificate(certificate.scope, ())
    kept = reached([at], lambda i: certificate.entries[i].named())
    ranks = {old: new for new, old in enumerate(sorted(kept))}

    def renumbered(question: Question) -> Question:
        uses = tuple(Use(ranks[use.entry], use.back) for use in question.uses)
        return Question(uses, question.initials, question.witness)

    def moved(entry: Entry) -> Entry:
        step = renumbered(entry.step) if entry.step is not None else None
        conds = tuple(ranks[c] for c in entry.conds)
        return Entry(entry.how, entry.node, entry.digest, conds, tuple(map(renumbered, entry.base)), step)

    return Certificate(
        certificate.scope, tuple(moved(certificate.entries[i]) for i in sorted(kept)), certificate.lemmas
    )


def _hint(settled: Settled) -> Hint | None:
    cases = {case.phase: case for case in settled.cases}
    if Phase.SAME_STEP in cases:
        return Hint(labels(cases[Phase.SAME_STEP].needed))
    first, later = cases.get(Phase.INITIAL), cases.get(Phase.LATER)
    return hint_of(first, later) if first is not None and later is not None else None


def hint_of(first: Case, later: Case) -> Hint:
    """The hint for a proof by induction."""
    initials = tuple(label.removeprefix("initial ") for label in first.needed if label.startswith("initial "))
    return Hint(labels(later.needed), labels(first.needed), initials, later.depth)


def labels(needed: Iterable[str]) -> tuple[tuple[str, int], ...]:
    """The engine's labels as clauses with the number of steps before, without initial values."""
    found = []
    for label in needed:
        if label.startswith("initial "):
            continue
        name = label.removesuffix(" one step before")
        back = int(name != label)
        found.append((name if name.startswith(("environment ", "memory ", INVARIANT)) else innermost(name), back))
    return tuple(dict.fromkeys(found))

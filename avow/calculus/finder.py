"""Finds certificates for claims that the calculus has proved. Nothing here is trusted: `avow.kernel.check` decides.

A certificate of a scope (the nodes of a derivation, or all) shows each assumption of a node by an instance of the
theorem in `proofs/instances.dfy`:

- R1 to R4 and loops through delays: `Nodes` (assumptions in causal order, each from lower ranks now and from everything
  that held the step before; at the first step from the initial values). The rule's name is presentation only.
- k-induction: the theorem itself, with k base questions.
- an assumption that stays assumed, and subsystems: `Derived` (an open entry). A subsystem is flattened: its nodes'
  clauses are the entries.

The premises that the proof names are tried first, then an unsatisfiable core of everything that is established.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field

from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.tuning.bounds import DEEPEST_INDUCTION, PREMISES_TRIED
from avow.base.tuning.effort import CERTIFICATE_NET_MS, CERTIFICATE_STEPS
from avow.calculus.induction import label
from avow.calculus.variables import OBSERVED
from avow.kernel.certificate import Certificate, Entry, How, Question, Use
from avow.kernel.check import Kernel, Refused
from avow.kernel.solvers import Reply, Solvers
from avow.kernel.statements import Claimed, Statement, Statements
from avow.kernel.text import Text, Untranslatable
from avow.language.terms import And, Quantified, Quantifier
from avow.solving.z3_module import z3


@dataclass(frozen=True, slots=True)
class Hint:
    """The premises named in the engine's proof of an assumption: clauses (``agent.low``) with the number of steps
    before. `first` is for the first step, if it is a separate case; `depth` is the number of steps of an induction."""

    step: tuple[tuple[str, int], ...]
    first: tuple[tuple[str, int], ...] | None = None
    initials: tuple[str, ...] = ()
    depth: int = 1


@dataclass(frozen=True, slots=True)
class Item:
    """A claim that a certificate may have as an entry."""

    how: How
    claim: Statement

    @property
    def label(self) -> str:
        """The engine's label for it."""
        if self.claim.kind is Claimed.ENVIRONMENT:
            return f"environment {self.claim.name}"
        if self.claim.kind is Claimed.DEFINITION:
            return f"memory {self.claim.called}"
        return f"{self.claim.node}.{self.claim.name}" if self.claim.node else self.claim.name


_Uses = tuple[tuple[Item, int], ...]
_Base = tuple[_Uses, tuple[str, ...]]
"""Uses, and the digests of initial conditions."""

_Witness = tuple[int, int] | None


@dataclass(frozen=True, slots=True)
class _Proof:
    base: tuple[_Base, ...]
    step: _Uses
    witnesses: tuple[_Witness, ...] = ()
    """One for each first step, and one for every later step."""


@dataclass(slots=True)
class Finder:
    """The search for one scope's certificate. `open`: assumptions that stay assumed; an assumption only about the
    environment becomes an environment assumption."""

    known: Statements
    scope: str
    nodes: Sequence[str]
    """Providers before consumers, as far as possible."""
    delayed: bool
    open: frozenset[str]
    hints: Mapping[str, Hint]
    hopeless: frozenset[str] = frozenset()
    """Labels of the assumptions that the engine could not prove."""
    goals: tuple[Statement, ...] = ()
    """Requirements, to be shown after everything else."""
    lemmas: tuple[tuple[str, ...], ...] = ()
    """Invariants that were found, as separate claims: to be shown before the goals."""
    solvers: Solvers = field(default_factory=Solvers)
    _proofs: dict[Item, _Proof] = field(default_factory=dict)
    _now: dict[str, Item] = field(default_factory=dict)
    """The established items, by label."""
    _then: dict[str, Item] = field(default_factory=dict)
    """The items that may be used at earlier steps, by label."""
    _ever: list[Item] = field(default_factory=list)
    _initials: tuple[Statement, ...] | None = None
    _failed: set[tuple[Item, int, int]] = field(default_factory=set)
    """Items that could not be shown, with the numbers of items then established and usable."""

    def find(self) -> Certificate:
        """The certificate with the entries that could be shown, and what they depend on."""
        ever = self.items()
        while True:
            established = self.established(ever)
            proofs = [self._proofs[item] for item in established if item in self._proofs]
            used = {item for proof in proofs for uses, _ in (*proof.base, (proof.step, ())) for item, _ in uses}
            if used <= established.keys():
                return self.certificate(list(established))
            ever = [item for item in ever if item in established]

    def items(self) -> list[Item]:
        """All possible entries."""
        found: list[Item] = []
        own = set(self.nodes)
        found += [Item(How.ENVIRONMENT, s) for s in self.known.every if s.kind is Claimed.ENVIRONMENT]
        found += [Item(How.SHOWN, s) for s in self.invariants()]
        for s in self.known.every:
            if s.kind is Claimed.DEFINITION and (s.node in own or self.remembered(s)):
                found.append(Item(How.DEFINED, s))
            if s.node not in own or s.node not in self.known.assumptions:
                continue
            if s.kind is Claimed.ASSUMPTION:
                name = f"{s.node}.{s.name}"
                if name in self.open or (not s.nodes and s.places and name not in self.hints):
                    found.append(Item(How.ENVIRONMENT if not s.nodes else How.OPEN, s))
                else:
                    found.append(Item(How.SHOWN, s))
            elif s.kind is Claimed.GUARANTEE:
                found.append(Item(How.GUARANTEE, s))
        return found

    def invariants(self) -> list[Statement]:
        """The claims of the lemmas."""
        wanted = set(map(label, self.lemmas))
        return [s for s in self.known.every if s.kind is Claimed.REQUIREMENT and s.name in wanted]

    def remembered(self, definition: Statement) -> bool:
        """Whether it defines a cell of one of the goals."""
        return not definition.node and any(definition.name.startswith(f"{OBSERVED}{g.name}.") for g in self.goals)

    def established(self, ever: list[Item]) -> dict[Item, None]:
        """The items that can be shown, each from earlier items at the same step and from any of `ever` at earlier
        steps."""
        self._ever, self._then, self._now = ever, {item.label: item for item in ever}, {}
        done: dict[Item, None] = {}

        def add(items: Iterable[Item]) -> None:
            for item in items:
                done[item] = None
                self._now[item.label] = item

        add(item for item in ever if item.how in (How.ENVIRONMENT, How.OPEN, How.DEFINED))
        of_node: dict[str, list[Item]] = {name: [] for name in self.nodes}
        for item in ever:
            if item.claim.node in of_node and item.claim.kind is not Claimed.ENVIRONMENT:
                of_node[item.claim.node].append(item)
        waiting, progress = list(self.nodes), True
        while waiting and progress:
            progress = False
            for name in list(waiting):
                mine = of_node[name]
                assumed = [item for item in mine if item.claim.kind is Claimed.ASSUMPTION]
                found = [item for item in assumed if item not in done and self.shown(item, done)]
                add(found)
                progress = progress or bool(found)
                marks = {item.claim.digest for item in assumed if item in done}
                if name in self.known.assumptions and marks >= set(self.known.assumptions[name]):
                    add(item for item in mine if item.how is How.GUARANTEE)
                    waiting.remove(name)
                    progress = True
        for goal in (*self.invariants(), *self.goals):
            if self.shown(item := Item(How.SHOWN, goal), done):
                add([item])
        return done

    # -- one claim -----------------------------------------------------------------------------------------------------

    def shown(self, item: Item, done: Mapping[Item, None]) -> bool:
        """Find a proof from the items established at the same step, and from all items at earlier steps."""
        if item.label in self.hopeless:
            return False
        known = self._proofs.get(item)
        if known is not None and self.still(known, item):
            return True
        attempt = (item, len(done), len(self._ever))
        proof = None if attempt in self._failed else next((p for p in self.proofs(item, done) if p is not None), None)
        if proof is None:
            self._failed.add(attempt)
            self._proofs.pop(item, None)
            return False
        self._proofs[item] = proof
        return True

    def still(self, proof: _Proof, item: Item) -> bool:
        uses = [*proof.step, *(use for base, _ in proof.base for use in base)]
        return all(
            self._now.get(used.label) == used if back == 0 else used in (item, self._then.get(used.label))
            for used, back in uses
        )

    def proofs(self, item: Item, done: Mapping[Item, None]) -> Iterator[_Proof | None]:
        hint = self.hints.get(item.label)
        yield self.hinted(item, hint, done) if hint is not None else None
        yield self.same_step(item, list(done))
        if self.delayed:
            for depth in range(1, DEEPEST_INDUCTION + 1):
                yield self.inductive(item, list(done), depth)

    def hinted(self, item: Item, hint: Hint, done: Mapping[Item, None]) -> _Proof | None:
        """A proof from the premises that the engine's proof names."""

        def uses(labels: Iterable[tuple[str, int]]) -> _Uses | None:
            found = [
                (self._now.get(label) if back == 0 else item if label == item.label else self._then.get(label), back)
                for label, back in labels
            ]
            return tuple((i, back) for i, back in found if i is not None) if all(i for i, _ in found) else None

        step = uses(hint.step)
        if step is None:
            return None
        if hint.first is None:
            return self.kept(item, (), step)
        if hint.depth > 1:
            return self.inductive(item, list(done), hint.depth)
        first = uses(hint.first)
        marks = tuple(sorted(s.digest for s in self.initials() if s.called in hint.initials))
        return self.kept(item, ((first, marks),), step) if first is not None else None

    def same_step(self, item: Item, now: Sequence[Item]) -> _Proof | None:
        premises = tuple((i, 0) for i in now)
        core = self.core(item, premises)
        if core is not None:
            return self.kept(item, (), core[0])
        goal = item.claim.term  # a witness may help if the search for instances fails
        exists = isinstance(goal, Quantified) and goal.quantifier is Quantifier.EXISTS
        return self.kept(item, (), premises) if exists else None

    def inductive(self, item: Item, now: Sequence[Item], depth: int) -> _Proof | None:
        earlier = [*self._ever, *([] if item.label in self._then else [item])]
        bases = []
        for b in range(depth):
            before = [(i, back) for back in range(1, b + 1) for i in earlier]
            core = self.core(item, (*((i, 0) for i in now), *before), initially=b)
            if core is None:
                return None
            bases.append(core)
        before = [(i, back) for back in range(1, depth + 1) for i in earlier]
        step = self.core(item, (*((i, 0) for i in now), *before))
        return self.kept(item, tuple(bases), step[0]) if step is not None else None

    def kept(self, item: Item, base: tuple[_Base, ...], step: _Uses) -> _Proof | None:
        """The proof, if the kernel finds its questions valid; with a witness if one is needed."""
        begun = complete(map(self.begun, base))
        if begun is None:
            return None
        base = tuple(begun)
        items = list(dict.fromkeys([*(i for uses in (*(b for b, _ in base), step) for i, _ in uses), item]))
        ranks = {i: k for k, i in enumerate(items)}
        # only the questions are checked here, not ranks and conditions
        stand_ins = tuple(Entry(i.how, i.claim.node, i.claim.digest) for i in items)
        kernel = Kernel(self.known, Certificate(self.scope, stand_ins), self.solvers)
        found: list[_Witness] = []
        for b, (uses, initials) in enumerate((*base, (step, ()))):
            for witness in (*self.witnesses(item, uses, initials), None):
                question = Question(tuple(Use(ranks[i], back) for i, back in uses), initials, witness)
                try:
                    kernel.answered(stand_ins[ranks[item]], question, b)
                except Refused:
                    continue
                found.append(witness)
                break
            else:
                return None
        return _Proof(base, step, tuple(found))

    def begun(self, base: _Base) -> _Base | None:
        """A first step whose initial conditions the kernel accepts, if necessary with the assumptions about constants
        of the environment; None if it does not accept them even so."""
        uses, initials = base
        constant = (
            (i, 0) for i in self._ever if i.how is How.ENVIRONMENT and all(p.rigid for p in i.claim.places.values())
        )
        for wider in (uses, tuple(dict.fromkeys((*uses, *constant)))):
            stand_ins = tuple(Entry(i.how, i.claim.node, i.claim.digest) for i, _ in wider)
            kernel = Kernel(self.known, Certificate(self.scope, stand_ins), self.solvers)
            question = Question(tuple(Use(k, back) for k, (_, back) in enumerate(wider)), initials)
            try:
                tuple(kernel.begins(question.uses, question.initials))
            except Refused:
                continue
            return wider, initials
        return None

    def witnesses(self, item: Item, uses: _Uses, initials: tuple[str, ...]) -> list[tuple[int, int]]:
        """For an existential claim: the existential premises over the same types."""
        goal = item.claim.term
        if not (isinstance(goal, Quantified) and goal.quantifier is Quantifier.EXISTS):
            return []
        sorts = [v.sort for v in goal.variables]
        terms = [used.claim.term for used, _ in uses]
        terms += [s.term for mark in initials for s in self.initials() if s.digest == mark]
        found = [
            (k, at)
            for k, term in enumerate(terms)
            for at, part in enumerate(term.items if isinstance(term, And) else (term,))
            if isinstance(part, Quantified)
            and part.quantifier is Quantifier.EXISTS
            and [v.sort for v in part.variables] == sorts
        ]
        return found[:PREMISES_TRIED]

    # -- the certificate -----------------------------------------------------------------------------------------------

    def certificate(self, order: Sequence[Item]) -> Certificate:
        ranks = {item: k for k, item in enumerate(order)}
        entries = tuple(self.entry(item, self._proofs.get(item), ranks) for item in order)
        return Certificate(self.scope, entries, self.lemmas)

    def entry(self, item: Item, proof: _Proof | None, ranks: Mapping[Item, int]) -> Entry:
        claim = item.claim
        if item.how is How.GUARANTEE:
            same = (s for mark in self.known.assumptions[claim.node] for s in self.known.by_digest[mark])
            labels = dict.fromkeys(
                f"{s.node}.{s.name}" for s in same if s.node == claim.node and s.kind is Claimed.ASSUMPTION
            )
            conds = (ranks[i] for label in labels if (i := self._now.get(label)) is not None and i in ranks)
            return Entry(item.how, claim.node, claim.digest, tuple(sorted(conds)))
        if proof is None:
            return Entry(item.how, claim.node, claim.digest)

        questions = [
            Question(tuple(Use(ranks[i], back) for i, back in uses), initials, witness)
            for (uses, initials), witness in zip((*proof.base, (proof.step, ())), proof.witnesses, strict=True)
        ]
        return Entry(item.how, claim.node, claim.digest, (), tuple(questions[:-1]), questions[-1])

    def initials(self) -> tuple[Statement, ...]:
        if self._initials is None:
            self._initials = tuple(s for s in self.known.every if s.kind is Claimed.INITIAL and s.unary)
        return self._initials

    def core(self, item: Item, premises: _Uses, *, initially: int | None = None) -> _Base | None:
        """The premises that a proof needs; None if none is found. `initially`: the first step that it is about."""
        text = Text()
        initials = self.initials() if initially is not None else ()
        try:
            written = [text.formula(i.claim.term, i.claim.symbols(back)) for i, back in premises]
            written += [text.formula(s.term, s.symbols(initially or 0)) for s in initials]
            goal = text.formula(item.claim.term, item.claim.symbols())
            facts = [fact for name, sort in text.free.items() if (fact := text.member(sort, name)) is not None]
        except Untranslatable:
            return None
        lines = [*text.declarations.values(), *(f"(assert {fact})" for fact in facts)]
        for k, premise in enumerate(written):
            lines += [f"(declare-const track{k} Bool)", f"(assert (=> track{k} {premise}))"]
        lines.append(f"(assert (not {goal}))")
        try:
            context = z3.Context()
            solver = z3.Solver(ctx=context)
            solver.set("rlimit", CERTIFICATE_STEPS)
            solver.set("timeout", CERTIFICATE_NET_MS)
            solver.set("smt.arith.nl.grobner", False)
            solver.from_string("\n".join(lines))
            answer = solver.check(*(z3.Bool(f"track{k}", context) for k in range(len(written))))
            if answer != z3.unsat:
                if answer == z3.unknown and solver.reason_unknown() == "timeout":
                    self.solvers.known["\n".join(lines), CERTIFICATE_STEPS] = Reply.LATE
                return None
            needed = {str(switch) for switch in solver.unsat_core()}
        except z3.Z3Exception:
            return None
        uses = tuple(use for k, use in enumerate(premises) if f"track{k}" in needed)
        marks = (s.digest for k, s in enumerate(initials, start=len(premises)) if f"track{k}" in needed)
        return uses, tuple(sorted(marks))

"""The search for the answer about one group of guarantees: is there an output for all inputs?

`avow.sanity.realizability` lists the methods.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from avow.base.tuning.bounds import WITNESS_REFUTATIONS
from avow.base.tuning.effort import WITNESS_PATIENT_EFFORT, WITNESS_STEPS
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, free_variables, negation, substitute
from avow.formulas.values import Value
from avow.language.sorts import FunctionSort
from avow.language.terms import Quantified, Quantifier, Role, Term, Variable
from avow.sanity.proofs import Proof
from avow.sanity.witness_candidates import Definition, candidates
from avow.sanity.witnesses import Fixed, Witness, applied, instantiate, meanings_of, witnesses
from avow.solving.checking import check
from avow.solving.limits import allowed, effort_left, spend, spent, tried, until
from avow.solving.questions import entails, search_tables, solve
from avow.solving.replay import replay
from avow.solving.translation import Expr, Meaning, Translator, Unsupported
from avow.solving.z3_module import z3

Formulas = Mapping[str, Term]
Given = Mapping[Variable, Value]


@dataclass(frozen=True, slots=True)
class Realizability:
    """The answer. `inputs`, if refuted, leave no output; `needed` labels the assumptions that a proof used."""

    verdict: Verdict
    inputs: Mapping[Variable, Value] = field(default_factory=dict)
    group: tuple[str, ...] = ()
    """The guarantees among which the conflict is."""
    needed: tuple[str, ...] = ()
    reason: str = ""
    engine: str = "z3"
    proofs: tuple[Proof, ...] = ()
    """If proved: the proof for each group, to be checked by separate queries (`avow.sanity.proofs`)."""


@dataclass(frozen=True, slots=True)
class Group:
    """Guarantees connected by the outputs that they share."""

    guarantees: Formulas
    outputs: tuple[Variable, ...]


def groups(guarantees: Formulas, outputs: Sequence[Variable]) -> list[Group]:
    """Groups of guarantees that share outputs; each guarantee without outputs is a group by itself."""
    found: list[tuple[dict[str, Term], set[Variable]]] = []
    for label, formula in guarantees.items():
        mentioned = free_variables(formula) & set(outputs)
        touching = [g for g in found if g[1] & mentioned]
        merged = {name: f for g in touching for name, f in g[0].items()} | {label: formula}
        found = [g for g in found if g not in touching]
        found.append((merged, set(mentioned).union(*(g[1] for g in touching))))
    return [
        Group(
            {label: formula for label, formula in guarantees.items() if label in members}, _ordered(mentioned, outputs)
        )
        for members, mentioned in found
    ]


def _ordered(some: set[Variable] | frozenset[Variable], outputs: Sequence[Variable]) -> tuple[Variable, ...]:
    return tuple(output for output in outputs if output in some)


class Search:
    """One group's question, with the witnesses found so far."""

    def __init__(self, inputs: Sequence[Variable], group: Group, assumptions: Formulas, effort: int, seed: int) -> None:
        self.group = group
        self.assumptions = assumptions
        self.inputs = tuple(inputs)
        self.granted = allowed(effort)
        self.deadline = until(effort)
        self.seed = seed
        self.found = candidates(group.outputs, assumptions.values(), group.guarantees.values())
        self.witnesses: list[Witness] = witnesses(self.found)
        self.read = len(self.witnesses)
        """The number of witnesses read off the contract; later ones are outputs found for single inputs."""
        self.reason = ""

    def left(self) -> int:
        return effort_left(self.deadline)

    def decide(self, doubtful: bool = False) -> Realizability:
        try:
            return self._decide(doubtful)
        except Unsupported as error:
            return Realizability(Verdict.UNKNOWN, reason=f"Avow cannot express {error.what} for the solver")
        except z3.Z3Exception as error:
            return Realizability(Verdict.UNKNOWN, reason=f"Z3: {error}")

    def _decide(self, doubtful: bool) -> Realizability:
        if not self.group.outputs:
            return self._without_outputs()
        methods: list[Callable[[int], Realizability | None]] = [self._direct, self._strengthened, self._witnessed]
        if self.inputs:
            methods.insert(1 if doubtful else 3, self._refute)
        for limit in (1_000, 4_000) if doubtful else (300, 1_000, 4_000, 10_000):
            for method in methods:
                if self.left() <= 0:
                    return Realizability(Verdict.UNKNOWN, reason=tried(self.reason, self.granted))
                answer = method(max(50, min(limit, self.left())))
                if answer is not None:
                    return answer
        return Realizability(Verdict.UNKNOWN, reason=tried(self.reason, self.granted))

    def _without_outputs(self) -> Realizability:
        goal = conjunction(self.group.guarantees.values())
        answer = entails(self.assumptions, goal, effort=self.left(), seed=self.seed, variables=self.inputs)
        labels = tuple(self.group.guarantees)
        proofs = (self._shown(),) if answer.verdict is Verdict.PROVED else ()
        return Realizability(answer.verdict, answer.values, labels, answer.needed, answer.reason, answer.engine, proofs)

    def _shown(
        self, guarantees: Sequence[Term] | None = None, asked: Sequence[Witness] = (), least: bool = False
    ) -> Proof:
        formulas = (
            self.group.guarantees if guarantees is None else dict(zip(self.group.guarantees, guarantees, strict=True))
        )
        axioms = self._axioms(asked, formulas.values()) if asked else ()
        known = (*axioms, *(self.found.least if least else ()))
        return Proof(self.inputs, self.group.outputs, formulas, tuple(asked), known, self.found)

    def _direct(self, limit: int) -> Realizability | None:
        if any(isinstance(output.sort, FunctionSort) for output in self.group.outputs):
            return None
        if any(isinstance(v.sort, FunctionSort) for v in self.inputs):
            limit = max(50, limit // 3)  # an answer usually comes at once or not at all
        bound = {v: Variable(Role.BOUND, f"any {v.name}", v.sort) for v in self.group.outputs}
        goal = conjunction(self.group.guarantees.values())
        never = Quantified(Quantifier.FORALL, tuple(bound.values()), negation(substitute(goal, bound)))
        label = _unused("no output", self.assumptions)
        answer = solve(
            {**self.assumptions, label: never},
            effort=limit,
            seed=self.seed,
            variables=self.inputs,
        )
        if answer.status == "unsat":
            needed = tuple(c for c in answer.core if c != label)
            return Realizability(Verdict.PROVED, needed=needed, proofs=(self._shown(),))
        if answer.status == "sat":
            return self.judge(answer.values, limit)
        self.reason = answer.reason
        return None

    # -- witnesses -----------------------------------------------------------------------------------------------------

    def _witnessed(self, limit: int) -> Realizability | None:
        return self._prove(list(self.group.guarantees.values()), limit)

    def _strengthened(self, limit: int) -> Realizability | None:
        whole = list(self.group.guarantees.values())
        tried = []
        for wide, few in ((False, 1), (False, 2), (True, None)):
            stronger = [instantiate(self.found, guarantee, wide=wide) for guarantee in whole]
            if stronger != whole and (stronger, few) not in tried:
                tried.append((stronger, few))
                answer = self._prove(stronger, limit // 3, few)
                if answer is not None:
                    return answer
        return None

    def _prove(self, guarantees: Sequence[Term], limit: int, few: int | None = None) -> Realizability | None:
        if not allowed(limit):
            return None
        translator = Translator()
        facts = self._defeated(translator, guarantees, {}, few, limit)
        if limit >= WITNESS_PATIENT_EFFORT:
            facts += [translator.term(axiom) for axiom in self.found.least]
        facts += translator.background([*self.inputs, *self.found.constants])
        tracked = [(label, translator.term(formula)) for label, formula in self.assumptions.items()]
        answer = check(translator, facts, tracked=tracked, effort=limit, seed=self.seed)
        if answer.status == "unsat":
            proof = self._shown(guarantees, self._asked(few), limit >= WITNESS_PATIENT_EFFORT)
            return Realizability(Verdict.PROVED, needed=answer.core, engine="z3, by witnesses", proofs=(proof,))
        self.reason = answer.reason or self.reason
        return None

    def _defeated(
        self,
        translator: Translator,
        guarantees: Iterable[Term],
        meanings: Mapping[Variable, Meaning],
        few: int | None,
        limit: int,
    ) -> list[Expr]:
        """Facts: the constants satisfy their axioms, and no witness meets the guarantees (of those read off the
        contract, only the first `few`, and only as many as can be translated within the effort)."""
        end = until(limit)
        guarantees = list(guarantees)
        asked = self._asked(few)
        facts = [translator.term(axiom, meanings) for axiom in self._axioms(asked, guarantees)]
        for witness in asked:
            if spent() > end:
                break
            spend(WITNESS_STEPS)
            try:
                whole = {**meanings, **meanings_of(translator, witness, meanings)}
            except Unsupported:  # `<1 upto in.n>` as a value: leaving it out is sound
                continue
            met = [
                *translator.background(witness, whole),
                *(translator.term(applied(g, witness), whole) for g in guarantees),
            ]
            facts.append(z3.Not(z3.And(met)))
        return [*facts, *translator.opaque_facts()]

    def _asked(self, few: int | None) -> list[Witness]:
        return [*self.witnesses[: self.read][:few], *self.witnesses[self.read :]]

    def _axioms(self, asked: Iterable[Witness], guarantees: Iterable[Term]) -> list[Term]:
        """The axioms of the constants that these mention, and of those that these axioms mention in turn."""
        wanted = frozenset[Variable]().union(*map(free_variables, guarantees), *map(_mentioned, asked))
        left, found = dict.fromkeys(self.found.axioms), dict[Term, None]()
        while fresh := [axiom for axiom in left if free_variables(axiom) & wanted & set(self.found.constants)]:
            for axiom in fresh:
                wanted |= free_variables(axiom)
                found[axiom] = left.pop(axiom)
        return list(found)

    # -- refutation ----------------------------------------------------------------------------------------------------

    def _refute(self, limit: int) -> Realizability | None:
        # The first candidate is the likeliest: inputs that defeat it usually defeat all, and are much easier to find.
        return self._refuted(limit // 2, 1) or self._refuted(limit // 3)

    def _refuted(self, limit: int, few: int | None = None) -> Realizability | None:
        """Inputs without an output; None if none are found within the effort. `few`: the number of initial witnesses to
        defeat."""
        end = until(limit)
        known = len(self.witnesses)
        while spent() < end and (few is None or len(self.witnesses) < known + WITNESS_REFUTATIONS):
            inputs = self._defeat(effort_left(end), few)
            if inputs is None:
                return None
            before = len(self.witnesses)
            answer = self.judge(inputs, max(100, limit // 2))
            if answer is not None or len(self.witnesses) == before:
                return answer
        return None

    def _defeat(self, limit: int, few: int | None) -> dict[Variable, Value] | None:
        """Allowed inputs at which no known witness meets the guarantees; not yet judged."""
        translator = Translator()
        constants = [*self.inputs, *self.found.constants]
        ordinary = [v for v in constants if not isinstance(v.sort, FunctionSort)]
        functions = [v for v in constants if isinstance(v.sort, FunctionSort)]

        def build(meanings: Mapping[Variable, Meaning]) -> list[Expr]:
            facts = [translator.term(formula, meanings) for formula in self.assumptions.values()]
            return facts + self._defeated(translator, self.group.guarantees.values(), meanings, few, limit)

        values = search_tables(translator, build, ordinary, functions, effort=limit, seed=self.seed)
        if values is None:
            return None
        return {v: values[v] for v in self.inputs}

    def judge(self, inputs: Mapping[Variable, Value], limit: int) -> Realizability | None:
        """Is there no output at these inputs? If there is one, it becomes a witness."""
        inputs = {v: value for v, value in inputs.items() if v in self.inputs}
        if not replay(self.assumptions.values(), inputs, effort=limit):
            return None
        answer = solve(
            self.group.guarantees,
            effort=max(limit, 200),
            seed=self.seed,
            given=inputs,
            variables=self.group.outputs,
        )
        if answer.status == "unsat":
            return Realizability(Verdict.REFUTED, inputs, tuple(self.group.guarantees), engine=answer.engine)
        if answer.status == "sat" and answer.values.keys() >= set(self.group.outputs):
            witness = {output: Fixed(answer.values[output]) for output in self.group.outputs}
            if witness not in self.witnesses:
                self.witnesses.append(witness)
        return None


def _mentioned(witness: Witness) -> frozenset[Variable]:
    found: frozenset[Variable] = frozenset()
    for value in witness.values():
        match value:
            case Definition(body=body):
                found |= free_variables(body)
            case Fixed():
                pass
            case _:  # a term
                found |= free_variables(value)
    return found


def _unused(label: str, taken: Mapping[str, object]) -> str:
    while label in taken:
        label += "!"
    return label

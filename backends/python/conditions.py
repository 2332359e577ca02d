"""The conditions under which a step meets a guarantee, put to the solver."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from avow.backend_kit.programs.samples import around
from avow.base.plain import as_identifier
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, free_variables, negation, substitute
from avow.formulas.values import Value
from avow.language.contract import Clause
from avow.language.sorts import INTEGER, NATURAL, REAL, EnumSort, SequenceSort
from avow.language.terms import FALSE, Compare, Literal, Term, Variable, Widen
from avow.solving.limits import from_seconds, spent
from avow.solving.questions import solve
from avow.solving.second import CONTRADICTED, contradicted
from avow.solving.settling import Settler
from avow.solving.smtlib import formulas_script
from avow.solving.translation import Unsupported

from .invariants import Sequences, candidates
from .program import Step
from .reading import Reading
from .symbolic import Candidate, Check, End, Run, TooMuch
from .tuning import CANDIDATE_SECONDS, COMBINED, ROUNDS, SHOWN_SECONDS


@dataclass(frozen=True, slots=True)
class Found:
    """What was found of one guarantee. `models` are the solver's values where a proof fails."""

    verdict: Verdict
    why: str
    conditions: int = 0
    models: tuple[Mapping[Variable, Value], ...] = ()
    details: dict[str, object] = field(default_factory=dict)


@dataclass(slots=True)
class Conditions:
    """A step's conditions. `numbers` are those that contract, program and parameters write down."""

    reading: Reading
    step: Step
    numbers: frozenset[Fraction]
    deadline: float
    combined: bool = False
    """Rounded results are distinguished also at sums and products of two numbers: a second try, which costs more."""
    settler: Settler = field(default_factory=Settler)
    scripts: dict[str, str] = field(default_factory=dict)
    """Name → SMT-LIB of what was proved: `unsat` means that it holds."""
    proved: list[Term] = field(default_factory=list)
    """Formulas of which Z3 says that they cannot hold."""
    unkept: tuple[str, ...] = ()
    """What is assumed of memory without its being shown to last from step to step, in words."""
    _log: list[str] = field(default_factory=list)

    def log(self) -> str:
        return "\n".join(self._log) + "\n"

    def settle(self, claims: Sequence[tuple[str, Clause]]) -> dict[str, Found]:
        """Obligation id → what was found."""
        node = self.reading.job.node
        known = Sequences(node, self.step.sequences)
        flat = {name: known.flat(clause.formula) for name, clause in claims}
        assumed = [known.flat(a.formula) for a in node.assumptions]
        if any(a is None for a in assumed):
            return self.alike(claims, "an assumption compares a sequence as a whole")
        try:
            run, kept = self.run(known, [f for f in flat.values() if f is not None])
        except TooMuch:
            return self.alike(claims, "the step has more paths than this method handles")
        except KeyError as unknown:
            return self.alike(claims, f"{unknown} is no element of an enumeration of the node's")
        hypotheses = [a for a in assumed if a is not None]
        safe, why, models = self.safe(run, hypotheses)
        self.unkept = tuple(self.not_kept(run, hypotheses))
        found: dict[str, Found] = {}
        for name, clause in claims:
            goal = flat[name]
            if goal is None:
                found[name] = Found(Verdict.UNKNOWN, f"{clause.name} compares a sequence as a whole")
            elif not safe:
                one = self.guarantee(clause, goal, run, hypotheses, known)
                found[name] = Found(Verdict.UNKNOWN, why, models=(*models, *one.models))
            else:
                found[name] = self.guarantee(clause, goal, run, hypotheses, known)
        if run.ends and all(self.never(run, end) for end in run.ends):
            return self.alike(claims, "no path of the step is possible: the conditions contradict each other")
        details: dict[str, object] = {
            "invariants": [c.text for c in kept],
            "rounded_at_lines": sorted(set(run.rounds)),
        }
        found = {
            n: Found(f.verdict, f.why, f.conditions + len(run.checks), f.models, details) for n, f in found.items()
        }
        if any(f.verdict is Verdict.PROVED for f in found.values()) and contradicted(self.proved):
            return self.alike(claims, CONTRADICTED, Verdict.ERROR)
        return found

    def alike(
        self, claims: Sequence[tuple[str, Clause]], why: str, verdict: Verdict = Verdict.UNKNOWN
    ) -> dict[str, Found]:
        return {name: Found(verdict, why) for name, _ in claims}

    # -- the run -----------------------------------------------------------------------------------------

    def run(self, known: Sequences, promised: Sequence[Term]) -> tuple[Run, tuple[Candidate, ...]]:
        """The symbolic run with the largest set of candidates that all last."""
        first = self.once(known, ())
        if not first.loops:
            return first, ()
        job = self.reading.job
        kept = candidates(first.loops, job.node, job.contract, promised, known)
        assumed = [a for c in job.node.assumptions if (a := known.flat(c.formula)) is not None]
        for _ in range(ROUNDS):
            run = self.once(known, kept)
            lost = {
                check.candidate
                for check in run.checks
                if check.candidate is not None and not self.holds(check, run, assumed, CANDIDATE_SECONDS)
            }
            if not lost:
                self._log.append(f"invariants: {'; '.join(c.text for c in kept) or 'none'}")
                return run, kept
            kept = tuple(c for c in kept if c not in lost)
        return self.once(known, ()), ()

    def once(self, known: Sequences, kept: Sequence[Candidate]) -> Run:
        node = self.reading.job.node
        sorts = [p.sort for p in (*node.inputs, *node.outputs)]
        enumerations = [s for s in sorts if isinstance(s, EnumSort)]
        members: dict[str, EnumSort] = {}
        for sort in enumerations:
            for member in sort.members:
                if members.setdefault(member, sort) != sort:
                    raise KeyError(f"{member}, which is in two enumerations,")
        doubles = {d for n in self.numbers for d in around(n) if math.isfinite(d)} | {0.0}
        if self.combined:
            some = sorted(doubles, key=lambda d: (abs(d), d))[:COMBINED]
            both = itertools.combinations_with_replacement(some, 2)
            doubles |= {m for a, b in both for m in (a + b, a * b) if math.isfinite(m)}
        doubles |= {-d for d in doubles}
        apart = tuple(n for n in self.numbers if around(n)[0] != around(n)[1])
        run = Run(self.step, members, self.reading.exact, tuple(sorted(doubles)), (*apart, *(-n for n in apart)), kept)
        inputs: dict[str, Term] = {}
        for port in node.inputs:
            if port.name in self.step.memory:
                inputs[f"self.{self.step.memory[port.name]}"] = port.variable
            elif isinstance(port.sort, SequenceSort):
                length, elements = known.of(port.name)
                inputs[f"in.{port.name}#"], inputs[f"in.{port.name}"] = length, elements
            else:
                inputs[f"in.{port.name}"] = port.variable
        run.whole(inputs)
        ports = [f"out.{p.name}" for p in node.outputs if p.sort == NATURAL]
        ports += [f"memory.{p.name}" for p in node.inputs if p.sort == NATURAL and p.name in self.step.memory]
        for end in run.ends:
            for name in ports:
                goal = Compare(">=", end.outputs[name], Literal(0, INTEGER))
                run.checks.append(Check(end.facts, end.guard, goal, f"{name} is NATURAL", end.line))
        return run

    # -- questions ---------------------------------------------------------------------------------------

    def left(self) -> int:
        return max(0, int(self.deadline - spent()))

    def holds(self, check: Check, run: Run, assumed: Sequence[Term], seconds: float) -> bool:
        """Asked briefly: whoever does not get an answer does without the candidate."""
        hypotheses = (*assumed, *run.facts[: check.facts], check.guard)
        effort = min(self.left(), from_seconds(seconds))
        return self.settler.settles(hypotheses, check.goal, effort=effort) == "unsat"

    def proves(self, facts: Sequence[Term], goal: Term, name: str) -> bool:
        if self.settler.proves(facts, goal, effort=self.left()):
            self.keep(facts, goal, name)
            return True
        return False

    def keep(self, facts: Sequence[Term], goal: Term, name: str) -> None:
        """What was proved, for the second solver and for the archive."""
        self.proved.append(conjunction((*facts, negation(goal))))
        labelled = {**{f"F{k}": fact for k, fact in enumerate(facts, start=1)}, "denied": negation(goal)}
        with contextlib.suppress(Unsupported):
            file = f"{len(self.scripts) + 1:03d}-{name}.smt2"
            self.scripts[file] = formulas_script(labelled, comment=f"{name}: holds if unsat")

    def never(self, run: Run, end: End) -> bool:
        """Whether the facts exclude a way out; what is assumed is not among them."""
        effort = min(self.left(), from_seconds(CANDIDATE_SECONDS))
        return self.settler.settles((*run.facts[: end.facts], end.guard), FALSE, effort=effort) == "unsat"

    def safe(self, run: Run, assumed: Sequence[Term]) -> tuple[bool, str, tuple[Mapping[Variable, Value], ...]]:
        """Whether every run has an output: no division by zero, no index outside, nothing that overflows."""
        for check in run.checks:
            facts = (*assumed, *run.facts[: check.facts], check.guard)
            if check.candidate is not None:
                self.keep(facts, check.goal, f"invariant-line-{check.line}")
            elif not self.proves(facts, check.goal, f"safe-line-{check.line}"):
                name = self.reading.file.name
                self._log.append(f"line {check.line}: not shown: {check.what}")
                return False, f"{name}:{check.line}: not shown that {check.what}", self.models(facts, check.goal)
        return True, "", ()

    def guarantee(self, clause: Clause, goal: Term, run: Run, assumed: Sequence[Term], known: Sequences) -> Found:
        models: list[Mapping[Variable, Value]] = []
        why = ""
        for end in run.ends:
            wanted = substitute(goal, self.outputs(end))
            facts = (*assumed, *run.facts[: end.facts], end.guard)
            if self.proves(facts, wanted, f"{as_identifier(clause.name)}-line-{end.line}"):
                self._log.append(f"{clause.name}: proved at the return of line {end.line}")
                continue
            self._log.append(f"{clause.name}: not proved at the return of line {end.line}")
            why = why or f"{self.reading.file.name}:{end.line}: not shown that {clause.name} holds at this return"
            models += self.restored(self.models(facts, wanted), known)
        if why:
            return Found(Verdict.UNKNOWN, why, models=tuple(models))
        return Found(Verdict.PROVED, "proved", len(run.ends))

    def not_kept(self, run: Run, assumed: Sequence[Term]) -> Iterator[str]:
        """An assumption about memory alone has to hold again of what a step leaves there."""
        node = self.reading.job.node
        held = {node.input(port).variable: attribute for port, attribute in self.step.memory.items()}
        for clause in node.assumptions:
            free = free_variables(clause.formula)
            if not free & held.keys():
                continue
            if not free <= held.keys():
                yield f"memory: {clause.name}, which relates memory to inputs, holds at every step"
                continue
            for end in run.ends:
                after = {v: end.outputs[f"memory.{v.name}"] for v in free}
                facts = (*assumed, *run.facts[: end.facts], end.guard)
                if not self.proves(facts, substitute(clause.formula, after), f"kept-{as_identifier(clause.name)}"):
                    yield f"memory: {clause.name} holds at every step: it is not shown that a step keeps it"
                    break

    def outputs(self, end: End) -> dict[Variable, Term]:
        node = self.reading.job.node
        found: dict[Variable, Term] = {}
        for port in node.outputs:
            term = end.outputs[f"out.{port.name}"]
            found[port.variable] = Widen(term, REAL) if port.sort == REAL and term.sort != REAL else term
        return found

    def models(self, facts: Sequence[Term], goal: Term) -> tuple[Mapping[Variable, Value], ...]:
        """The solver's values where something does not follow: a hint for a run, no more."""
        effort = min(self.left(), from_seconds(SHOWN_SECONDS))
        inputs = [p.variable for p in self.reading.job.node.inputs if not isinstance(p.sort, SequenceSort)]
        found = solve([*facts, negation(goal)], effort=effort, variables=inputs)
        return (found.values,) if found.status == "sat" else ()

    def restored(self, models: Sequence[Mapping[Variable, Value]], known: Sequences) -> list[Mapping[Variable, Value]]:
        """With sequences in place of what stood for them."""
        restored: list[Mapping[Variable, Value]] = []
        for model in models:
            values: dict[Variable, Value] = dict(model)
            for variable, (length, elements) in known.parts.items():
                values[variable] = _sequence(model.get(length), model.get(elements))
            restored.append(values)
        return restored


def _sequence(length: Any, elements: Any) -> Any:
    from avow.formulas.values import FunctionValue, SequenceValue

    count = length if isinstance(length, int) and 0 <= length <= 64 else 0
    if not isinstance(elements, FunctionValue):
        return SequenceValue(())
    return SequenceValue(tuple(elements(k) for k in range(count)))

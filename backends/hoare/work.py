"""A job, read: program and table held against the node, and the triples that are to be proved; the program as a model
that can be run on single inputs; and where its numbers are others than the contract's."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

from avow.backend_kit.given import existing_file
from avow.backend_kit.programs.samples import numbers_of
from avow.backend_kit.protocol import Job, NoModel
from avow.backend_kit.stepping import Stepping
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.files import read_text
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Value
from avow.language.bounds import bounds
from avow.language.contract import Clause
from avow.language.printer import show_number
from avow.language.terms import TRUE, Role, Term, Variable
from avow.solving.settling import Settler

from .checker import Checked, check
from .guesses import filled
from .interpreter import Endless, Fault, Machine, NoEnd, State
from .memory import kept, knowing, steps_of
from .parser import parse_program
from .program import Assign, If, Program, Update, While, statements
from .triples import Triple, every_run, triples
from .wp import Condition, conditions


@dataclass(frozen=True)
class Work:
    """A job, read: the program checked against node and table, and the triples of each obligation."""

    job: Job
    checked: Checked
    text: str
    steps: Stepping | None = None
    """Where program or contract keeps something from step to step; the job's node is then the larger one."""
    lacking: tuple[str, ...] = ()
    """Why invariants of the plan are not known."""

    @cached_property
    def settler(self) -> Settler:
        """The solver that this program's questions are put to."""
        return Settler()

    @cached_property
    def triples(self) -> dict[str, tuple[Triple, ...]]:
        """Obligation id → its triples. Raises Rejected."""
        try:
            return {o.id: triples(o.id, self.job.clause(o), self.job.node, self.checked) for o in self.job.obligations}
        except RecursionError:
            message = "a clause of this node is nested too deeply for this method"
            raise Rejected(Diagnostic("HOARE100", message, self.job.node.span)) from None

    @cached_property
    def kept(self) -> tuple[Triple, ...]:
        """That a step keeps the plan's invariants."""
        steps = self.steps
        if steps is None:
            return ()
        return tuple(
            triple
            for k, each in enumerate(steps.invariants, start=1)
            for triple in kept(each, f"invariant-{k}", steps, self.job.node, self.checked)
        )

    @property
    def firsts(self) -> dict[str, Condition]:
        """That the plan's invariants hold before the first step."""
        steps = self.steps
        stated = steps.invariants if steps is not None else ()
        return {
            f"invariant-{k}": Condition("first", (), steps.first(i.formula), f"`{i.text}` holds before the first step")
            for k, i in enumerate(stated, start=1)
            if steps is not None
        }

    @cached_property
    def alone(self) -> dict[str, Triple]:
        """The triples without invariants, by name: what holds of these says nothing of the program."""
        if self.steps is None:
            return {}
        each = ((o, self.job.clause(o)) for o in self.job.obligations)
        return {t.name: t for o, c in each for t in triples(o.id, c, self.steps.node, self.checked)}

    @cached_property
    def every_run(self) -> Triple:
        """What any guarantee needs besides its own triples: that the program runs, whatever the input."""
        return every_run(self.job.node, self.checked)


def run_conditions(triple: Triple, program: Program) -> tuple[Condition, ...]:
    """The conditions of a triple, without those that say nothing. Raises TooLarge."""
    return tuple(c for c in conditions(triple, program.body) if c.goal != TRUE)


def load(job: Job) -> Work:
    """Read program and table. Raises Rejected with all that is wrong."""
    path = program_file(job)
    try:
        text = read_text(path, "utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        message = f"{path.name} cannot be read: {error}"
        raise Rejected(Diagnostic("HOARE400", message, job.method.options.at("program"))) from error
    source = parse_program(text, str(path))
    steps = steps_of(job, source)
    if steps is not None:
        job = knowing(job, steps, steps.invariants)
    return Work(job, check(source, job.contract, job.node, _table(job)), text, steps)


def program_file(job: Job) -> Path:
    """The plan's program. Raises Rejected (``HOARE400``) where there is none, or outside the system's folder."""
    return existing_file(job, "program", job.options.get("program", ""), wrong="HOARE400", absent="HOARE400")


def _table(job: Job) -> dict[str, tuple[str, Span]]:
    options = job.method.options
    given: Mapping[str, Any] = job.options.get("variables", {})
    words = {True: "TRUE", False: "FALSE"}
    return {
        str(key): (words[value] if isinstance(value, bool) else str(value), options.at("variables", key))
        for key, value in given.items()
    }


# -- the program as a model that can be run ----------------------------------------------------------------------------


def answering(job: Job) -> Callable[[Mapping[str, Value]], Mapping[str, Value]]:
    """Raises Rejected where the program is at fault, and NoModel where it is none of single steps on the contract's own
    inputs."""
    work = load(job)
    checked, machine = work.checked, Machine()
    terms = checked.reading.terms
    if work.steps is not None:
        raise NoModel("it keeps something from step to step")
    if checked.reading.predicates:
        raise NoModel("a relation is read as a formula")
    inputs: dict[str, Variable] = {}
    for port in job.node.inputs:
        term = terms.get((Role.INPUT, port.name))
        if isinstance(term, Variable):
            inputs[port.variable.qualified] = term
        elif term is not None:
            raise NoModel(f"in.{port.name} is read as an expression of the program")
    outputs = {
        p.variable.qualified: terms[Role.OUTPUT, p.name] for p in job.node.outputs if (Role.OUTPUT, p.name) in terms
    }
    ghosts = checked.program.ghosts

    def run(given: Mapping[str, Value]) -> Mapping[str, Value]:
        start: State = {}
        for name, variable in inputs.items():
            own = next((v for v, ghost in ghosts.items() if ghost == variable), variable)
            if name in given:  # one that a program is not given is anything
                start[own.name] = start[variable.name] = given[name]
        simplest = {v.name: value for v, value in filled({}, checked.program.state).items()}
        try:
            end = machine.run(checked.program.body, {**simplest, **start})
            return {name: evaluate(term, end) for name, term in outputs.items()}
        except (Fault, NoEnd, Endless, NotEvaluable, KeyError) as error:
            raise NoModel(str(error)) from error

    return run


# -- the numbers of program and contract, side by side -----------------------------------------------------------------


_COMMON = frozenset({Fraction(-1), Fraction(0), Fraction(1)})
"""Numbers that are common in programs and need not occur in the contract."""


def other_numbers(program: Program, clauses: Iterable[Clause]) -> Iterator[Diagnostic]:
    """A warning where the program compares with numbers that are not the contract's, and the contract with numbers that
    are not the program's: a hint, where a proof cannot give one. A program with other thresholds is refuted, as a rule;
    a guarantee that is weaker than it looks (a lost pair of parentheses can make it a tautology) is proved of it."""
    formulas = [clause.formula for clause in clauses]
    conditions = [s for s in statements(program.body) if isinstance(s, If | While)]
    assigned = [s.value for s in statements(program.body) if isinstance(s, Assign | Update)]
    in_program = numbers_of([*(s.condition for s in conditions), *assigned])
    foreign = _thresholds(s.condition for s in conditions) - numbers_of(formulas)
    missing = _thresholds(formulas) - in_program
    if not foreign or not missing:
        return
    first = next(s for s in conditions if _thresholds([s.condition]) & foreign)
    yield Diagnostic(
        "HOARE410",
        f"the program compares with {_shown(foreign)}, and the contract has no such number; the contract compares with "
        f"{_shown(missing)}, and the program does not",
        first.span,
        Severity.WARNING,
        hint="if the program means the contract's thresholds, write these",
    )


def left_unassigned(work: Work) -> Iterator[Diagnostic]:
    """A warning for each variable of an output that has no value on some path: the triples let it be anything."""
    for name in sorted(work.checked.unassigned):
        message = f"some path through the program assigns nothing to `{name}`, which an output is read from"
        yield Diagnostic("HOARE420", message, work.checked.program.body[-1].span, Severity.WARNING)


def _thresholds(formulas: Iterable[Term]) -> frozenset[Fraction]:
    return frozenset(b.number for formula in formulas for b in bounds(formula)) - _COMMON


def _shown(numbers: Iterable[Fraction]) -> str:
    texts = [show_number(number)[0] for number in sorted(numbers)]
    return ", ".join(texts[:6]) + (", …" if len(texts) > 6 else "")

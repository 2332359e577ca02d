"""A job, read: program and table held against the node, and the triples that are to be proved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from avow.backend_kit.given import existing_file
from avow.backend_kit.protocol import Job
from avow.backend_kit.stepping import Stepping
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import read_text
from avow.language.terms import TRUE
from avow.solving.settling import Settler

from .checker import Checked, check
from .memory import kept, knowing, steps_of
from .parser import parse_program
from .program import Program
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

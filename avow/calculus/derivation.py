"""Derivations: rule instances nested into a tree, as the paper writes them. Pure data; nothing here calls a solver.

The rules are those of the paper's section "Calculus for Combining Node Specifications": R1 sequence, R2 branching
outputs, R3 union of inputs, R4 loops. Their soundness is machine-checked in `proofs/` (Dafny, over traces); R4 is
unsound as printed, and gets one of the extra premises that the proof needs (`LoopForm`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum

from avow.base.diagnostics import Diagnostic
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Verdict
from avow.formulas.temporal.cell import CELL
from avow.system.plan import Edge


class Rule(StrEnum):
    PREMISE = "premise"
    """A node's own contract, which its verification shows."""
    R1 = "R1"
    R2 = "R2"
    R3 = "R3"
    R4 = "R4"
    ALL = "all"
    """Several conclusions side by side (conjunction)."""


class LoopForm(StrEnum):
    """The premise that R4 lacks as printed, in a form that makes it sound (proofs/r4.dfy)."""

    BOOTSTRAP = "bootstrap"
    """No assumption in the loop depends on fed-back values: it can be entered from outside (R4_bootstrap)."""
    INITIAL = "initial"
    """An initial value satisfies the assumptions, and one round of the loop keeps them (R4_initial, by induction)."""
    ENTERED = "entered"
    """The plan argues that the loop is entered (R4_entered)."""
    CIRCULAR = "circular"
    """The assumptions support one another circularly: refused."""
    OPEN = "open"
    """Not shown."""


class Phase(StrEnum):
    """The steps of the consumer's inputs that a side condition is about."""

    SAME_STEP = "same step"
    INITIAL = "first step"
    LATER = "every later step"


@dataclass(frozen=True, slots=True)
class ClauseName:
    """``agent.one_place``."""

    node: str
    clause: str

    def __str__(self) -> str:
        return f"{self.node}.{self.clause}"


@dataclass(frozen=True, slots=True)
class SideCondition:
    """The providers' guarantees imply one clause of the consumer's assumption.

    `providers` are the nodes whose guarantees may be used, `delayed` says that the clause mentions values of the step
    before, so that the first step is a separate case. `environment` are the plan's assumptions that may be used.
    """

    consumer: str
    clause: str
    providers: tuple[str, ...]
    delayed: bool = False
    environment: tuple[str, ...] = ()

    @property
    def about(self) -> ClauseName:
        return ClauseName(self.consumer, self.clause)


@dataclass(frozen=True, slots=True)
class Derivation:
    """One rule instance. `nodes` are in the order of the rule's numbering: R1 first to last, R2 root then leaves, R3
    sources then sink, R4 the loop's members. `assumed` and `guaranteed` form the conclusion: all assumed ⇒ ◇ each
    guaranteed node's guarantees."""

    rule: Rule
    nodes: tuple[str, ...]
    linking: tuple[Edge, ...] = ()
    outside: tuple[str, ...] = ()
    """Inputs of the consumers that the selected nodes do not provide: the linking holds only up to these."""
    side_conditions: tuple[SideCondition, ...] = ()
    hypotheses: tuple[str, ...] = ()
    assumed: tuple[ClauseName, ...] = ()
    guaranteed: tuple[str, ...] = ()
    children: tuple[Derivation, ...] = ()
    name: str = ""
    entries: tuple[str, ...] = ()
    """R4: the nodes outside the loop that feed it."""

    def walk(self) -> Iterator[Derivation]:
        """Every rule instance once, children first."""
        seen: set[int] = set()
        stack: list[tuple[Derivation, bool]] = [(self, False)]
        while stack:
            current, done = stack.pop()
            if done:
                yield current
            elif id(current) not in seen:
                seen.add(id(current))
                stack.append((current, True))
                stack.extend((child, False) for child in reversed(current.children))


@dataclass(frozen=True, slots=True)
class Goal:
    """A requested derivation, its result, and findings about what does not fit."""

    name: str
    nodes: tuple[str, ...]
    root: Derivation
    findings: tuple[Diagnostic, ...] = ()
    within: tuple[Goal, ...] = ()
    """The derivations of those nodes that are subsystems: these have to hold as well."""
    contract: tuple[str, ...] = ()
    """The derived contract of a subsystem in lines of text."""
    together: bool = False
    """Whether values of several nodes may be used at one step, beyond what the rules say."""

    @property
    def conditions(self) -> tuple[SideCondition, ...]:
        """Every side condition, each once."""
        found: dict[SideCondition, None] = {}
        for part in self.root.walk():
            found.update(dict.fromkeys(part.side_conditions))
        return tuple(found)

    @property
    def needs_persistence(self) -> bool:
        return self.together or any(part.rule in (Rule.R3, Rule.R4) for part in self.root.walk())

    def inner_first(self) -> tuple[Goal, ...]:
        """The derivations of the subsystems inside, at any depth, each after those inside it; then this one."""
        found: dict[str, Goal] = {}
        stack: list[tuple[Goal, bool]] = [(self, False)]
        while stack:
            goal, done = stack.pop()
            if done:
                found[goal.name] = goal
            elif goal.name not in found:
                stack.append((goal, True))
                stack.extend((inner, False) for inner in reversed(goal.within))
        return tuple(found.values())


def about_memory(label: str) -> bool:
    """Whether a hypothesis is only the definition of a cell or its initial value."""
    return label.startswith("memory ") or (label.startswith("initial ") and CELL in label)


@dataclass(frozen=True, slots=True)
class Case:
    """One solver query and its answer. `needed`: labels of the hypotheses that a proof uses."""

    phase: Phase
    verdict: Verdict
    needed: tuple[str, ...] = ()
    counterexample: Counterexample | None = None
    vacuous: bool = False
    reason: str = ""
    engine: str = ""
    depth: int = 1
    """The number of steps of an induction."""
    invariant: tuple[str, ...] = ()
    """An invariant that was found and makes it inductive (`avow.calculus.induction`)."""


@dataclass(frozen=True, slots=True)
class Settled:
    """A side condition with its answer. `used` are the nodes whose contracts the proof uses *at the same step*,
    `used_before` those at the step before."""

    condition: SideCondition
    verdict: Verdict
    cases: tuple[Case, ...]
    used: tuple[str, ...] = ()
    used_before: tuple[str, ...] = ()
    circle: tuple[str, ...] = field(default=())
    """The nodes on the cycle, if the proof would be circular."""

    @property
    def needed(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(label for case in self.cases for label in case.needed if not about_memory(label)))

    @property
    def trivial(self) -> bool:
        """Proved without any guarantee, from the types or the environment alone."""
        return self.verdict is Verdict.PROVED and not self.used and not self.used_before

    @property
    def vacuous(self) -> bool:
        return self.verdict is Verdict.PROVED and any(case.vacuous for case in self.cases)

"""The grade of each `proved`: established by the kernel in this very run, or by another tool; and everything that has
to be trusted for it.

No record of the ledger gives a grade: the pipeline passes in what the kernel re-established (`KernelRun`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from avow.base.plain import count, listed
from avow.base.records import dataclass
from avow.evidence.claims import Reestablished
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh

if TYPE_CHECKING:
    from avow.assurance.model import ObligationView
    from avow.evidence.record import Evidence

CALCULUS = "compose"
"""The engine whose proofs come with certificates."""

_CERTIFIABLE = (Kind.COMPOSITION, Kind.REQUIREMENT)


class Grade(StrEnum):
    """Whether the proofs of composition and requirements are certified."""

    CHECKED = "proofs not certified"
    """Some such proof has no certificate, or there is none, or the ledger's digests were not verified."""
    CERTIFIED = "proofs certified"
    """The kernel re-established every such proof of the calculus in this run, and every digest was verified."""

    @property
    def word(self) -> str:
        """The text after the word *proofs*; it is independent of the verdict beside it."""
        return self.removeprefix("proofs ")


class ProofGrade(StrEnum):
    CERTIFIED_2 = "certified-2"
    """Established by the kernel in this run; two solvers, of different makers, answered each of its queries."""
    CERTIFIED_1 = "certified-1"
    """Established by the kernel in this run, with Z3."""
    CLAIMED = "claimed"
    """The calculus reported it, and the kernel did not establish it in this run."""
    TOOL_TRUSTED = "tool-trusted"
    """Reported by another engine: its tools have to be trusted."""


@dataclass(frozen=True, slots=True)
class KernelRun:
    """The kernel's results in a run."""

    run: str = ""
    """The run's id; empty: the kernel did not run."""
    established: tuple[Reestablished, ...] = ()
    solvers: Mapping[str, str] = field(default_factory=dict)
    """Name → version."""
    certificates: Mapping[str, Any] = field(default_factory=dict)
    """Scope → certificate (``avow/certificate/1``)."""
    parts: tuple[tuple[str, str], ...] = ()
    """The parts of Avow that have to be trusted: name, and SHA-256 or version."""


@dataclass(frozen=True, slots=True)
class ProofView:
    """A `proved` with its grade."""

    obligation: str
    grade: ProofGrade
    tools: tuple[str, ...] = ()
    """The tools that reported it, with versions, if it has no certificate."""
    key: str = ""
    """The kernel's key of the input that it was established from."""


@dataclass(frozen=True, slots=True)
class Trusted:
    """A part of the trusted base: what it is, and which one (a version or a SHA-256)."""

    what: str
    which: str


def proof_views(views: Iterable[ObligationView], kernel: KernelRun, run: str) -> tuple[ProofView, ...]:
    """Every `proved` of the case with its grade, except those of parser and type checker (they are trusted). Results of
    the kernel in another run give no grade."""
    known = {one.obligation: one for one in kernel.established if kernel.run == run}
    return tuple(
        _graded(view, known.get(view.id))
        for view in views
        if view.status is Status.PROVED and view.obligation.kind is not Kind.WELL_FORMED
    )


def _graded(view: ObligationView, known: Reestablished | None) -> ProofView:
    proofs = [r for r in view.records if weigh(r).support is Status.PROVED]
    own = [e for e in proofs if e.backend == CALCULUS]
    certifiable = view.obligation.kind in _CERTIFIABLE
    if known is not None and own and certifiable:
        grade = ProofGrade.CERTIFIED_2 if known.solvers > 1 else ProofGrade.CERTIFIED_1
        return ProofView(view.id, grade, (), known.key)
    others = [e for e in proofs if e.backend != CALCULUS]
    if own and not others:
        return ProofView(view.id, ProofGrade.CLAIMED, tuple(sorted({f"{e.tool} {e.tool_version}" for e in own})))
    tools = set(map(named, others)) or {f"{r.backend}: another claim's proof" for r in view.records}
    return ProofView(view.id, ProofGrade.TOOL_TRUSTED, tuple(sorted(tools)))


def named(record: Evidence) -> str:
    """The tool, after the backend that asks it, in plain characters: commas and parentheses separate the tools in a
    list."""
    told = " ".join(re.sub(r"[^\w.+'-]", " ", record.tool_told).split())
    if record.backend == CALCULUS:
        return f"search by {told}"
    return told if told.startswith(record.backend) else f"{record.backend}: {told}"


def certifiable(proofs: Iterable[ProofView]) -> tuple[ProofView, ...]:
    """The proofs that should have a certificate: those of the calculus and of requirements."""
    return tuple(p for p in proofs if p.obligation.split("/")[2] in _CERTIFIABLE)


def claimed(proofs: Iterable[ProofView]) -> tuple[str, ...]:
    """The claims proved by the calculus without a certificate."""
    return tuple(p.obligation for p in proofs if p.grade is ProofGrade.CLAIMED)


def standing(proofs: Sequence[ProofView], kernel: KernelRun, run: str) -> tuple[bool, str]:
    """Whether every proof of the calculus and of a requirement was re-established in the run, and if not, why."""
    wanted = certifiable(proofs)
    if not wanted:
        return False, "nothing of the composition or of the requirements is proved: there is nothing to certify"
    if kernel.run != run:
        return False, "the kernel was not asked in this run"
    if lacking := claimed(wanted):
        names = listed([name.split("/", 1)[1] for name in lacking], 3)
        return False, f"{len(lacking)} of {len(wanted)} proofs have no certificate: {names}"
    certified = [p for p in wanted if p.grade is not ProofGrade.TOOL_TRUSTED]
    if not certified:
        return False, "no proof of the composition or of the requirements has a certificate"
    twice = sum(p.grade is ProofGrade.CERTIFIED_2 for p in certified)
    told = f"the kernel established {len(certified)} of {len(wanted)} proofs again in this run, {twice} by two solvers"
    trusted = len(wanted) - len(certified)
    return True, f"{told}; {trusted} by the word of a tool" if trusted else told


def trusted_base(proofs: Iterable[ProofView], kernel: KernelRun) -> tuple[Trusted, ...]:
    """Everything that has to be trusted for the proofs, besides the reasons that persons give."""
    own = [Trusted(what, which) for what, which in kernel.parts]
    solvers = [Trusted(f"solver {name}", version) for name, version in sorted(kernel.solvers.items())]
    tools: dict[str, int] = {}
    for proof in proofs:
        for tool in proof.tools:
            tools[tool] = tools.get(tool, 0) + 1
    words = [Trusted(f"{tool} (not certified)", count(n, "proof")) for tool, n in sorted(tools.items())]
    return (*own, *solvers, *words)

"""Results of the sanity analysis, and the limits on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields

from avow.base.diagnostics import Severity
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.formulas.values import Value
from avow.language.printer import show_term
from avow.language.terms import Term, Variable
from avow.sanity.claims import Claim


@dataclass(frozen=True, slots=True)
class Bounds:
    """Limits on the analysis of a node: effort for one query of a claim with severity error (a third of it for warnings
    and notes; the more went into claims that stayed open, the less), and the solver's seed."""

    effort: int = 3_000
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Finding:
    """The result for a claim."""

    verdict: Verdict
    explanation: str = ""
    clauses: tuple[str, ...] = ()
    """The clauses that a refutation or a proof depends on (for conflicts, of the first), without the node's name."""
    counterexample: Counterexample | None = None
    conflicts: tuple[tuple[tuple[str, ...], Counterexample], ...] = ()
    """Minimal sets of clauses that cannot all be met at some input, each with one and what each demands there."""
    because: str | None = None
    """The name of the result of which this one is only a consequence."""
    engine: str = "z3"
    example: Mapping[Variable, Value] = field(default_factory=dict)
    """Values for which the claim holds, if known."""


@dataclass(frozen=True, slots=True)
class SanityResult(Finding):
    """The result for one claim of a node, and the seconds that it took."""

    node: str = field(kw_only=True)
    asked: Claim = field(kw_only=True)
    seconds: float = field(kw_only=True)

    @classmethod
    def of(cls, node: str, claim: Claim, found: Finding, seconds: float) -> SanityResult:
        own = {each.name: getattr(found, each.name) for each in fields(found)}
        return cls(**own, node=node, asked=claim, seconds=seconds)

    @property
    def name(self) -> str:
        """``realizable``, ``not-vacuous-G1``."""
        return self.asked.name

    @property
    def fails(self) -> bool:
        """Whether it makes the contract bad: refuted, with severity error."""
        return self.verdict is Verdict.REFUTED and self.asked.severity is Severity.ERROR


@dataclass(slots=True)
class Patience:
    """Effort for one query: the more went into claims that stayed open, the less."""

    full: int
    lost: float = 0.0

    def lose(self, effort: float) -> None:
        self.lost += effort

    def effort(self, serious: bool) -> int:
        """Effort for one query; warnings and notes get a third of it."""
        share = 1 / (1 + self.lost / self.full)
        return max(1, int(self.full * share) // (1 if serious else 3))


def as_outcome(identity: str, node: str, name: str, result: SanityResult | None) -> Outcome:
    """A result as the outcome of an obligation; None says that there is no such claim."""
    if result is None:
        return Outcome(identity, Verdict.ERROR, f"{node} has no sanity claim named {name}")
    details: dict[str, object] = {"severity": str(result.asked.severity), "clauses": list(result.clauses)}
    details["solver"] = result.engine
    if result.because:
        details["because"] = result.because
    if result.conflicts:
        details["conflicts"] = [{"clauses": list(c), "counterexample": e.text()} for c, e in result.conflicts]
    return Outcome(
        identity,
        result.verdict,
        result.explanation or _SUMMARY[result.verdict],
        result.counterexample,
        details=details,
    )


_SUMMARY = {
    Verdict.PROVED: "proved",
    Verdict.REFUTED: "does not hold",
    Verdict.UNKNOWN: "the solver could not decide it",
}


def never_demanded(condition: Term, *, among: int) -> str:
    """The message that a guarantee's condition cannot arise; it names the condition if there are several."""
    if among == 1:
        return "what it demands is never demanded: its condition cannot come about"
    return f"one of its {among} conditions cannot come about: {show_term(condition)}"


def listing(labels: Sequence[str]) -> str:
    """``a, b and c``."""
    return labels[0] if len(labels) == 1 else f"{', '.join(labels[:-1])} and {labels[-1]}" if labels else "nothing"

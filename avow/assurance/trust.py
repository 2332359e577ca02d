"""The parts that a reader has to trust for the case, each with its mitigation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from avow.assurance.answers import Assumption, TrustLine
from avow.assurance.certification import KernelRun, ProofGrade, ProofView, certifiable, named
from avow.assurance.model import ObligationView
from avow.base.plain import count, listed
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh

_SAMPLED = (Status.CHECKED, Status.TESTED, Status.MONITORED)
_TOOLS = 3
"""Tools that are named, those with the most answers; the others are counted."""


def trust_lines(
    proofs: Sequence[ProofView],
    kernel: KernelRun,
    assumptions: Sequence[Assumption],
    views: Sequence[ObligationView],
    run: str,
    single: int,
) -> tuple[TrustLine, ...]:
    """The kernel, the solvers, the front end, tools whose answers are trusted, and assumptions without an owner.
    `single`: how many guarantees one method alone shows."""
    wanted = certifiable(proofs)
    certified = [p for p in wanted if p.grade in (ProofGrade.CERTIFIED_1, ProofGrade.CERTIFIED_2)]
    twice = sum(p.grade is ProofGrade.CERTIFIED_2 for p in certified)
    tested = "not qualified; tested against an independent evaluator"
    lines = [TrustLine("Avow's front end", "parser, type checker and translators", tested, True)]
    if wanted and kernel.run == run:
        lines.append(
            TrustLine(
                "the kernel",
                "of the composition's proofs",
                f"{len(certified)} of {count(len(wanted), 'proof')} re-established in this run",
                len(certified) < len(wanted),
            )
        )
    elif wanted:
        done = "the kernel did not run: nothing was done"
        lines.append(TrustLine("the calculus", count(len(wanted), "proof"), done, True))
    if kernel.solvers:
        names = " and ".join(f"{name} {version}" for name, version in sorted(kernel.solvers.items()))
        several = f"{twice} of {len(certified)} answered by two solvers" if certified else "no proof was answered"
        second = several if len(kernel.solvers) > 1 else "no second solver"
        lines.append(TrustLine("solvers", names, second, twice < len(certified) or not twice))
    tools = Counter(tool for proof in proofs for tool in proof.tools)
    tools.update(named(r) for v in views for r in v.records if weigh(r).support in _SAMPLED or weigh(r).refuted)
    if tools:
        (tool, many), *others = sorted(tools.items(), key=lambda found: (-found[1], found[0]))
        told = [f"{count(many, 'answer')} of {tool}", *(f"{many} of {tool}" for tool, many in others)]
        if len(rest := others[_TOOLS - 1 :]) > 1:
            told[_TOOLS:] = [f"{sum(many for _, many in rest)} of {count(len(rest), 'other tool')}"]
        shown = sum(v.obligation.kind is Kind.GUARANTEE and v.status.supports for v in views)
        again = f"{shown - single} of {count(shown, 'guarantee that holds has', 'guarantees that hold have')} "
        second = f"{again}a second method" if shown else "no guarantee holds"
        lines.append(TrustLine("tools whose answers have no certificate", ", ".join(told), second, True))
    bare = [a for a in assumptions if not a.owned]
    if bare:
        numbers = listed([a.number for a in bare], 6)
        lines.append(TrustLine("assumptions without an owner", numbers, "nobody keeps them true", True))
    return tuple(lines)

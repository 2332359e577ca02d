"""The data for the qualification of Avow as a tool, for one case: requirements, known problems, figures, independence.

The data beside this module (`qualification.yaml`) are kept by hand; everything else is computed from the case.
"""

from __future__ import annotations

from collections import Counter

from avow.assurance.certification import ProofGrade
from avow.assurance.gap import independent, reviewers
from avow.assurance.model import Case, ObligationView
from avow.base.packaged import packaged
from avow.base.persons import one_person
from avow.base.records import dataclass
from avow.base.verdict import Link
from avow.evidence.status import weigh
from avow.report.page import fill

DATA = "qualification.yaml"
"""The file that is kept by hand."""


@dataclass(frozen=True, slots=True)
class Independence:
    """How far the evidence that supports a guarantee is independent."""

    view: ObligationView
    methods: tuple[str, ...]
    tools: int
    """Methods that differ pairwise in backend and in tool."""
    ends: tuple[str, ...]
    """How the contract was interpreted: by a person's judgement, or by Avow's parser and type checker."""
    objects: tuple[str, ...]
    """The kinds of object that were examined."""
    persons: tuple[str, ...]
    """Reviewers; two names of one person are one."""


def independence(view: ObligationView) -> Independence:
    """Counts only evidence that supports the guarantee."""
    records = [r for r in view.records if weigh(r).support is not None]
    persons: list[str] = []
    for name in (name for r in records for name in reviewers(r)):
        persons += [] if any(one_person(name, known) for known in persons) else [name]
    ends = {"a person's judgement" if r.link is Link.GUIDED else "Avow's parser and type checker" for r in records}
    methods = dict.fromkeys(f"{r.method} ({r.tool_told})" for r in records)
    objects = {str(r.of or "not recorded") for r in records}
    return Independence(
        view, tuple(methods), independent(records), tuple(sorted(ends)), tuple(sorted(objects)), tuple(persons)
    )


def render_qualification(case: Case) -> str:
    """The page. Deterministic: same case, same bytes."""
    backends = {backend for node in case.nodes for _, backend in node.methods}
    grades = Counter(proof.grade for proof in case.proofs)
    return fill(
        "qualification.html.j2",
        case=case,
        data=packaged("avow.report", DATA),
        used=[m for m in case.methods if m.name in backends],
        backends=backends,
        grades=[(grade, grades[grade]) for grade in ProofGrade],
        rows=[independence(view) for view in case.guarantees],
        scored=[(view, r) for view in case.guarantees for r in view.records if "mutation" in r.details],
    )

"""Building THE case object: a pure function of obligations, ledger records and the plan.

The pipeline calls, once a system:

    ledger = Ledger(workspace.ledger(system.name))
    case = build_case(
        system,
        obligations,                       # every Obligation of the system, of every kind
        ledger.records(),                  # every Entry, oldest first; current, stale and superseded alike
        keys={(obligation.id, method_id): key},   # one item for each attempt that the plan asks for NOW; `key` as
                                           # computed afresh. No item: no method is planned (missing, or withdrawn).
        today=date,                        # handed in: nothing here reads a clock
        run=RunInfo(...),
        derivations=(Derivation(...), …),  # what the calculus derived (view dataclass in avow.assurance.model)
        methods=(MethodInfo(...), …),      # the backends known: for suggestions and for "what green means"
        tools=(ToolInfo(...), …),
        discrepancies=audit(...),          # avow.evidence.audit.audit(ledger, root, …)
        digests={"contracts/x/plan.yaml": sha256, …},
        ledger_head=ledger.head,
        graph_svg="<svg…>",
    )
    render_all(case, workspace.report(system.name))
    exit code: case.exit_code

Raises `Rejected` for a policy that cannot be used (call `avow.assurance.policy.read_policy(plan.policy)` when the plan
is loaded, so that this comes early).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date

from avow.assurance.model import Case, Derivation, Discrepancy, MethodInfo, RunInfo, ToolInfo
from avow.evidence.ledger import GENESIS, Entry
from avow.evidence.obligation import Obligation
from avow.system.plan import System


def build_case(
    system: System,
    obligations: Sequence[Obligation],
    records: Sequence[Entry],
    *,
    keys: Mapping[tuple[str, str], str],
    today: date,
    run: RunInfo,
    derivations: Sequence[Derivation] = (),
    methods: Sequence[MethodInfo] = (),
    tools: Sequence[ToolInfo] = (),
    discrepancies: Sequence[Discrepancy] = (),
    digests: Mapping[str, str] | None = None,
    ledger_head: str = GENESIS,
    graph_svg: str = "",
) -> Case:
    """The case. Pure: same arguments, same case. Raises Rejected for an unusable policy."""
    raise NotImplementedError

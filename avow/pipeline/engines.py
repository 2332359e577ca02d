"""The core's own engines, put so that the pipeline can treat them like backends."""

from __future__ import annotations

from collections.abc import Sequence

from avow.backend_kit.protocol import Limits, Report
from avow.evidence.obligation import Obligation
from avow.language.contract import Node
from avow.system.plan import System


def discharge_sanity(system: System, node: Node, obligations: Sequence[Obligation], limits: Limits) -> Report:
    """Settle sanity claims of one node by the solver."""
    from avow.calculus import providers
    from avow.calculus.interpretation import interpretation, ranges
    from avow.calculus.variables import frame
    from avow.sanity.analysis import Bounds, outcomes
    from avow.solving.questions import z3_version

    given = interpretation(node, system.plan.scenario)
    bounds = Bounds(seed=limits.seed)
    linked = {asked.claim.name: asked for asked in providers.provider_claims(frame(system), node)}
    own = {o.id: o.name for o in obligations if o.name not in linked}
    found = outcomes(node, own, scenario=given, ranges=ranges(system, node), bounds=bounds)
    found += providers.outcomes(node, {o.id: linked[o.name] for o in obligations if o.name in linked}, bounds)
    return Report(found, "z3", z3_version())


def discharge_composition(system: System, obligations: Sequence[Obligation], limits: Limits) -> Report:
    """Settle side conditions, loops and requirements by the calculus."""
    from avow.calculus.obligations import discharge
    from avow.solving.questions import z3_version

    return Report(discharge(system, obligations, limits), "z3", z3_version())

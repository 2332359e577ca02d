"""The core's own engines, put so that the pipeline can treat them like backends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from avow.backend_kit.protocol import Limits, Report
from avow.evidence.obligation import Obligation
from avow.pipeline.slices import SanitySlice


def discharge_sanity(cut: SanitySlice, obligations: Sequence[Obligation], limits: Limits) -> Report:
    """Settle sanity claims of one node by the solver."""
    from avow.calculus import providers
    from avow.sanity.analysis import outcomes
    from avow.sanity.results import Bounds
    from avow.solving.checking import z3_version
    from avow.solving.limits import effort_told, from_seconds

    bounds = Bounds(seed=limits.seed)
    if limits.asked:
        bounds = replace(bounds, effort=from_seconds(limits.seconds))
    linked = {asked.claim.name: asked for asked in cut.linked}
    own = {o.id: o.name for o in obligations if o.name not in linked}
    found = outcomes(cut.node, own, scenario=cut.given, ranges=cut.ranges, bounds=bounds)
    found += providers.outcomes(cut.node, {o.id: linked[o.name] for o in obligations if o.name in linked}, bounds)
    found = tuple(replace(o, details={**o.details, **effort_told(bounds.effort)}) for o in found)
    return Report(found, "z3", z3_version())

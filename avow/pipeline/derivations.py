"""What the calculus derived, as the assurance case shows it."""

from __future__ import annotations

from avow.assurance.model import Derivation, SideCondition
from avow.calculus.composition import composed
from avow.calculus.notation import Written, write_goal
from avow.calculus.obligations import discharged_by
from avow.system.folding import seen
from avow.system.graph import dataflow
from avow.system.graph_svg import sheet
from avow.system.plan import System


def derivation_views(system: System) -> tuple[Derivation, ...]:
    """One for each goal of the plan, the whole system's last; with the rule instances that they are made of."""
    return tuple(_view(system, write_goal(goal)) for goal in composed(system).goals)


def discharging(system: System) -> dict[str, tuple[str, ...]]:
    """Of each node the obligations (without the system) that settle its assumptions."""
    found = discharged_by(composed(system))
    return {node: tuple(hypothesis.name for hypothesis in behind) for node, behind in found.items()}


def graph_svg(system: System) -> str:
    """The dataflow picture."""
    return sheet(seen(system, dataflow(system)))


def _view(system: System, written: Written) -> Derivation:
    wiring = {node.name for node in system.contract.nodes if node.relay}  # nothing of it has to be shown
    return Derivation(
        written.name,
        written.rule,
        written.text,
        written.conclusion,
        tuple(name for name in written.premises if name not in wiring),
        tuple(
            SideCondition(c.text, f"{system.name}/{c.obligation}" if c.obligation else "")
            for c in written.side_conditions
        ),
        written.latex,
        written.conditional,
    )

"""What the calculus derived, as the assurance case shows it."""

from __future__ import annotations

from avow.assurance.model import Derivation
from avow.system.plan import System


def derivation_views(system: System) -> tuple[Derivation, ...]:
    """One for each goal of the plan, and the whole system's."""
    return ()


def graph_svg(system: System) -> str:
    """The dataflow picture."""
    return ""

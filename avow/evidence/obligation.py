"""Obligations: claims, generated from contract and plan, never typed in."""

from __future__ import annotations

import copy
import dataclasses
import functools
from dataclasses import field
from enum import StrEnum

from avow.base.diagnostics import Span
from avow.language.contract import TO_WRITE
from avow.language.printer import show_term
from avow.language.terms import TRUE


class Kind(StrEnum):
    WELL_FORMED = "well-formed"
    SANITY = "sanity"
    COMPOSITION = "composition"
    GUARANTEE = "guarantee"
    REQUIREMENT = "requirement"
    PROGRAM = "program"
    """Claims about a node's program, besides its contract: see `ProgramClaim`."""


class ProgramClaim(StrEnum):
    """The claims about a node's program, besides that it meets the contract; the claim's name."""

    FAULTLESS = "runs-without-fault"
    """No run within its assumptions ends by a signal or an exception, or has undefined behaviour."""
    LINKED = "agrees-with-model"
    """The model that was verified in its place gives the same outputs."""


_SAYS_NOTHING = show_term(TRUE)

SYSTEM_LEVEL = "system"
"""The node part of an id if an obligation belongs to no single node."""


@dataclasses.dataclass(frozen=True)  # without slots: it caches its id, which is read very often
class Obligation:
    """One claim. Pure data.

    `digest` is a SHA-256 of its *meaning* (typed, normalised formulas, the sorts that they use, the scenario, if one is
    used): comments, layout and bound names do not change it, a threshold does.
    """

    system: str
    node: str
    kind: Kind
    name: str
    claim: str
    """A sentence for readers."""
    formula: str
    """The formula in Unicode notation, or empty."""
    digest: str
    clauses: tuple[str, ...] = ()
    """``node.clause`` names that the claim is about."""
    span: Span | None = field(default=None, compare=False, repr=False)
    advisory: bool = False
    """Useful to know, but nothing is unsound if the claim is false: no gate requires it."""

    @functools.cached_property
    def id(self) -> str:
        """``system/node/kind/name``: for readers, stable under edits of the formula."""
        return f"{self.system}/{self.node}/{self.kind}/{self.name}"

    @property
    def unwritten(self) -> bool:
        """Whether it is a draft's placeholder (`avow.language.contract.Clause.unwritten`): no method answers it."""
        return self.kind is Kind.GUARANTEE and self.name == TO_WRITE and self.formula == _SAYS_NOTHING

    def at(self, span: Span | None) -> Obligation:
        """The same claim, with another position in a text."""
        other = copy.copy(self)  # there are thousands
        object.__setattr__(other, "span", span)
        return other

    @property
    def local_id(self) -> str:
        """The id without the system, as plans name it."""
        return f"{self.node}/{self.kind}/{self.name}"

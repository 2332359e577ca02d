"""A hazard with its mitigations, as a case holds them. `avow.assurance.mitigated` computes them."""

from __future__ import annotations

from dataclasses import field

from avow.assurance.answers import Level, Tone, WeakestEvidence
from avow.base.codec import LATER
from avow.base.records import dataclass
from avow.system.plan import Hazard

WORST_FIRST = tuple(level for level in reversed(Level) if level is not Level.EXAMINED)


@dataclass(frozen=True, slots=True)
class Mitigation:
    """One entry under `mitigated_by`."""

    name: str
    """The name in the hazards' file."""
    words: str
    """A description for readers."""
    level: Level
    """How far it is shown: the lowest level of its claims."""
    claims: tuple[str, ...]
    """A requirement's own claims, or the guarantees that the name covers."""


@dataclass(frozen=True, slots=True)
class HazardView:
    """A hazard with its mitigations. `level` is that of the weakest; *not shown* if there are none."""

    hazard: Hazard
    mitigations: tuple[Mitigation, ...]
    level: Level
    tone: Tone
    closure: tuple[str, ...] = field(default=(), metadata=LATER)
    """Every obligation that its mitigations rest on."""
    failing: tuple[str, ...] = field(default=(), metadata=LATER)
    """Those of them that do not hold."""
    weakest_evidence: WeakestEvidence | None = field(default=None, metadata=LATER)
    """The weakest of everything beneath it; of a hazard that is not mitigated, the claim that fails."""

    @property
    def weakest(self) -> str:
        """The weakest evidence in a phrase; a mitigation's name if it holds by no claim, or fails by none."""
        if self.weakest_evidence:
            return self.weakest_evidence.brief
        return min(self.mitigations, key=lambda m: WORST_FIRST.index(m.level)).name if self.mitigations else ""

    @property
    def meaning(self) -> str:
        """What a plan says of it, in a line: another line is another hazard, or one judged otherwise."""
        h = self.hazard
        judged = " ".join(filter(None, (h.severity, h.exposure)))
        return f"{h.text} ({judged}; mitigated by {', '.join(h.mitigated_by) or 'nothing'})"

    @property
    def stands(self) -> str:
        """Its level, in a phrase."""
        return f"{self.level} (weakest: {self.weakest})" if self.mitigations else "no mitigation"

"""What became of the publications of a clause: each is counted once."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Tally:
    """What became of one clause over a trace."""

    judged: int = 0
    """Held, broken, or undecided since no calculation told."""
    broken: int = 0
    excused: int = 0
    undecided: int = 0
    order: int = 0
    """Answers of which it is undecided what they answered."""
    early: int = 0
    """Answers before everything that it speaks of had a value."""
    unreadable: int = 0
    """Messages with one of its outputs that could not be read."""
    published: int = 0
    """Publications of its outputs: of several, of the one that was published most."""
    triggered: bool = False
    """Its antecedent held at least once (or it has none)."""

    hidden: bool = False
    """It speaks of something that no message shows."""
    unpaired: bool = False
    """It speaks of inputs and outputs, and nobody has said which input an answer answered."""

    @property
    def decided(self) -> int:
        return self.judged - self.undecided

    @property
    def share(self) -> float:
        """The share of what was published that was decided."""
        return self.decided / self.published if self.published else 0.0

    @property
    def incomplete(self) -> int:
        """Publications that were never part of a whole answer."""
        return self.published - self.judged - self.order - self.early - self.unreadable

    reason: str = ""
    """Why it is not judged at all, or the first reason why it was once undecided."""


def coverage(tally: Tally) -> str:
    """``published 201 times: held 198, broken 1 (1 excused), before the first value 2``."""
    held = tally.decided - tally.broken
    parts = [
        (held, "held {}"),
        (tally.broken, "broken {}" + (f" ({tally.excused} excused)" if tally.excused else "")),
        (tally.undecided, "undecided {}"),
        (tally.order, "undecided which input was answered {}"),
        (tally.early, "before the first value {}"),
        (tally.unreadable, "unreadable {}"),
        (max(0, tally.incomplete), "not part of a whole answer {}"),
    ]
    told = ", ".join(words.format(count) for count, words in parts if count)
    return f"published {tally.published} times" + (f": {told}" if told else "")

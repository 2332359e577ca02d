"""What became of the publications of a clause: each is counted once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field

from avow.base.records import dataclass

from .tuning import LEAST_SHARE


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
    awaited: dict[str, None] = field(default_factory=dict)
    """What had no value then."""
    unreadable: int = 0
    """Messages with one of its outputs that could not be read."""
    nameless: int = 0
    """Messages of a topic that other nodes publish too, which do not say whose they are."""
    partial: int = 0
    """Answers that were never whole, and that their parts alone do not decide."""
    supposed: int = 0
    """Answers that held by an initial value of the plan, before any message: neither for nor against."""
    forgotten: int = 0
    """Steps not decided, since steps before them went by unseen."""
    overdue: int = 0
    """Steps at which what had missed its deadline before was still missing: no breaches of their own."""
    open: int = 0
    """Runs at whose end a response was still demanded, or may have been."""
    published: int = 0
    """Answers: publications of its outputs, those that make one answer counted once."""
    triggered: bool = False
    """Its antecedent held at least once (or it has none)."""

    ages: dict[str, float] = field(default_factory=dict)
    """The greatest age of each input when an answer came, in seconds."""

    hidden: bool = False
    """It speaks of something that no message shows."""
    unpaired: bool = False
    """It speaks of inputs and outputs, and nobody has said which input an answer answered."""

    @property
    def decided(self) -> int:
        return self.judged - self.undecided

    @property
    def asked(self) -> int:
        """Answers that were to be decided."""
        return self.published - self.supposed - self.overdue

    def withdrawn(self, reason: str) -> None:
        """What was judged so far is undecided after all; breaches were told."""
        self.undecided = self.judged - self.broken
        self.reason = self.reason or reason

    def too_early(self, awaited: Iterable[str]) -> None:
        """An answer has come before these variables had a value."""
        self.early += 1
        self.awaited.update(dict.fromkeys(awaited))

    def unsure(self, reason: str) -> None:
        """Of an answer it is undecided what it answered."""
        self.order += 1
        self.reason = self.reason or reason

    def aged(self, now: float, heard: Mapping[str, float], names: Iterable[str]) -> None:
        """An answer has come; `heard`: when its inputs had, those of these names among them."""
        for name in names:
            self.aging(name, now - heard[name])

    def aging(self, name: str, age: float) -> None:
        """An input was so old when an answer came."""
        if age > self.ages.get(name, -1.0):
            self.ages[name] = max(age, 0.0)

    def unnamed(self, topic: str) -> None:
        """A message of a topic that other nodes publish too has come, which does not say whose it is."""
        self.published += 1
        self.nameless += 1
        self.reason = self.reason or f"several nodes publish {topic}, and a message does not say whose it is"

    reason: str = ""
    """Why it is not judged at all, or the first reason why it was once undecided."""


def coverage(tally: Tally) -> str:
    """``published 201 times: held 198, broken 1 (1 excused), before the first value 2``."""
    held = tally.decided - tally.broken
    parts = [
        (held, "held {}"),
        (tally.broken, "broken {}" + (f" ({tally.excused} excused)" if tally.excused else "")),
        (tally.overdue, "still overdue {}"),
        (tally.undecided, "undecided {}"),
        (tally.order, "undecided which input was answered {}"),
        (tally.early, "before the first value {}"),
        (tally.unreadable, "unreadable {}"),
        (tally.nameless, "whose it was is not told {}"),
        (tally.partial, "not part of a whole answer {}"),
        (tally.forgotten, "undecided, since steps before went by unseen {}"),
        (tally.supposed, "held by the plan's initial value, before any message {}"),
    ]
    told = ", ".join(words.format(count) for count, words in parts if count)
    told += f"; {old(tally.ages)}" if tally.ages else ""
    told += f"{'; ' if told else ''}a response was open at the end" if tally.open else ""
    return f"published {tally.published} times" + (f": {told}" if told else "")


def remedies(tally: Tally) -> str:
    """What the plan may say so that a clause of which too little was decided is monitored."""
    share = int(100 * tally.decided / tally.asked) / 100 if tally.asked else 0
    late = ", ".join(tally.awaited)
    first = (
        f"{late} had no value when answers came (a latched topic, or a late publisher): say what it was "
        f"before its first message, mapping: {{{next(iter(tally.awaited))}: {{…, initial: …}}}}"
        if late
        else ""
    )
    unpaired = "pair answers with inputs by a stamp or a key (`answers`)" if tally.order and tally.unpaired else ""
    less = f"say that less is enough, decided: {share:g}" if LEAST_SHARE <= share < 1 else ""
    return "; or ".join(part for part in (first, unpaired, less) if part)


def old(ages: Mapping[str, float]) -> str:
    """``inputs at most 0.12 s old (in.r), 3.1 s (in.at)``."""
    shown = [f"{age:.3g} s{' old' if k == 0 else ''} ({name})" for k, (name, age) in enumerate(ages.items())]
    return f"inputs at most {', '.join(shown)}" if shown else ""

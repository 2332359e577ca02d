"""The words for an answer.

A verdict says what one tool run showed about one claim. Unknown, time-out, crash and a missing tool are verdicts too.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from enum import StrEnum

from avow.base.files import sha256
from avow.base.records import dataclass


class Verdict(StrEnum):
    """What one piece of evidence says of one claim."""

    PROVED = "proved"
    """For all behaviours and inputs, by a sound method."""
    CHECKED = "checked"
    """Exhaustively, within a finite scenario that the evidence names."""
    TESTED = "tested"
    """On n cases; the evidence says n and what n justifies."""
    MONITORED = "monitored"
    """On a recorded or live trace."""
    REVIEWED = "reviewed"
    """By a person who said what was read and concluded."""
    JUSTIFIED = "justified"
    """A person's dated reason, in place of evidence."""
    PARTIAL = "partial"
    """Partial correctness: proved of every run that ends, while no one has shown that all of them do. It supports
    nothing by itself."""
    REFUTED = "refuted"
    """The claim is false: a counterexample is attached."""
    UNKNOWN = "unknown"
    """The method gave up: time, memory, incompleteness, a construct that it cannot treat."""
    ERROR = "error"
    """The tool failed or its answer could not be read."""
    NOT_RUN = "not-run"
    """The tool is not here; the evidence says how to install it."""

    @property
    def supports(self) -> bool:
        """Whether this verdict speaks for the claim at all."""
        return self in _SUPPORTING


_SUPPORTING = frozenset(
    {
        Verdict.PROVED,
        Verdict.CHECKED,
        Verdict.TESTED,
        Verdict.MONITORED,
        Verdict.REVIEWED,
        Verdict.JUSTIFIED,
    }
)


class Link(StrEnum):
    """How the thing that was verified hangs together with the contract's formula."""

    GENERATED = "generated"
    """Translated from the formula by Avow."""
    MAPPED = "mapped"
    """Through a table that a person wrote in the plan."""
    GUIDED = "guided"
    """By a person's judgement."""


class Object(StrEnum):
    """What was verified. How it hangs together with the formula is its `Link`."""

    MODEL = "model"
    """Something written to be verified: a program in a small language, an agent, a formula."""
    SOURCE = "source"
    """The node's declared source, byte for byte, and nothing else."""
    BINARY = "binary"
    """A program that was made of the source."""
    RECORDING = "recording"
    """What a running node was seen to do."""


class Isolation(StrEnum):
    """How far what was run was kept from its judge and from this machine; weakest first."""

    NONE = "none"
    """In the process that judges, or by a tool of its own that is not kept from anything."""
    PROCESSES = "processes"
    """In a process of its own, with a pipe to its judge; all that it starts ends with it. It is the same user."""
    SEALED = "sealed"
    """Besides, without network, without sight of other processes, with a view of the files that it cannot write."""

    @property
    def rank(self) -> int:
        return list(Isolation).index(self)


@dataclass(frozen=True, slots=True)
class Counterexample:
    """Why a claim is false, in the contract's own words.

    `values` are (name, value) pairs such as ``("in.r", "125")``; `trace` is a run, one tuple of pairs a step, and
    `loop` the index of the step to which its last step returns (a lasso), if it does. A name in parentheses, such as
    ``(believes)``, is the tool's, not the contract's: reports print it small, and `text` leaves it out.
    """

    values: tuple[tuple[str, str], ...] = ()
    explanation: str = ""
    trace: tuple[tuple[tuple[str, str], ...], ...] = ()
    loop: int | None = None

    def text(self) -> str:
        """One line for people: ``in.r = 125, out.status = green: guarantee 1 demands orange``."""
        values = ", ".join(f"{name} = {value}" for name, value in self.values if not name.startswith("("))
        return ": ".join(part for part in (values, self.explanation) if part)


class HypothesisKind(StrEnum):
    """What else an answer rests on."""

    CLAIM = "claim"
    """Another obligation of the case: `name` is its id without the system, `digest` that of what it says."""
    ASSUMPTION = "supposition"  # the spelling of the ledger's first format
    """What no tool shows and a person has to accept, by name: ``agent/assumption/termination``."""
    BOUND = "bound"
    """What limits a bounded answer, by name: ``scenario.steps``, ``scenario.domains.in.r``, ``type.Place``. What rests
    on one is at most `checked`, whatever it says of itself."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Something that an answer rests on, and that the case has to discharge.

    It is identified by kind and `digest` (SHA-256 of what is supposed), never by its wording: a claim of the case that
    says something else does not discharge it, whatever it is called.
    """

    kind: HypothesisKind
    name: str
    digest: str
    text: str = field(default="", compare=False)
    """For people."""


def bound(name: str, text: str) -> Hypothesis:
    """A limit of a bounded answer, in words that say what lies within."""
    return Hypothesis(HypothesisKind.BOUND, name, sha256(f"{name}\n{text}"), text)


def in_words(rests_on: Iterable[Hypothesis], hypotheses: Iterable[str]) -> tuple[str, ...]:
    """All that an answer supposes beside other claims and what a person accepts by name: its limits, and remarks."""
    return tuple(dict.fromkeys((*(h.text for h in rests_on if h.kind is HypothesisKind.BOUND), *hypotheses)))


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a method says of one obligation; the core makes an evidence record of it.

    `obligation` is the obligation's id. `bound` holds what limits the answer (cases, states, confidence, seed…),
    `rests_on` what the answer rests on and the case has to discharge, `hypotheses` remarks in words on what it supposes
    besides, `details` anything else worth keeping (JSON values).
    """

    obligation: str
    verdict: Verdict
    summary: str
    counterexample: Counterexample | None = None
    hypotheses: tuple[str, ...] = ()
    bound: dict[str, object] = field(default_factory=dict)
    details: dict[str, object] = field(default_factory=dict)
    link: Link | None = None
    vacuous: bool = False
    """The claim held, but its trigger was never met: it supports nothing."""
    rests_on: tuple[Hypothesis, ...] = ()
    of: Object | None = None
    """What was verified; None: what the method always verifies."""
    numbers: str = "exact"
    """What a REAL was, as plans have it under `numbers`."""

"""Gwendolen programs as data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import assert_never

from avow.base.diagnostics import Span

from .terms import Struct, Term, Var, show


class Sign(StrEnum):
    ADD = "+"
    DROP = "-"


class GoalKind(StrEnum):
    PERFORM = "perform"
    ACHIEVE = "achieve"


@dataclass(frozen=True, slots=True)
class Goal:
    """``serve(1) [perform]``; without a kind it is performed."""

    term: Term
    kind: GoalKind = GoalKind.PERFORM


@dataclass(frozen=True, slots=True)
class Event:
    """The trigger of a plan: ``+danger``, ``-danger``, ``+!serve(1)``, ``-!serve(1)``."""

    sign: Sign
    term: Term
    goal: GoalKind | None = None
    """None for a belief; in a plan's trigger a goal without a written kind matches both."""
    is_goal: bool = False


@dataclass(frozen=True, slots=True)
class Condition:
    """One conjunct of a guard or of a reasoning rule: ``~B danger``, ``G serve(1)``; ``True`` has no term."""

    term: Term | None
    positive: bool = True
    is_goal: bool = False
    goal: GoalKind | None = None
    """The kind of a goal; without a written kind it is either."""
    test: str | None = None
    """``<`` or ``==``: the term compares its two arguments as numbers."""
    group: tuple[Condition, ...] = ()
    """The body of a negated group: ``~(square(X, Y), ~empty(X, Y))``; it has no term."""
    is_cut: bool = False
    """``!`` in a reasoning rule: the bindings found so far are kept, and no other rule is tried."""

    def terms(self) -> Iterator[Term]:
        if self.term is not None:
            yield self.term
        for part in self.group:
            yield from part.terms()


class DeedKind(StrEnum):
    ADD_BELIEF = "+"
    DROP_BELIEF = "-"
    ADD_GOAL = "+!"
    DROP_GOAL = "-!"
    WAIT = "*"
    WAIT_NOT = "*~"
    LOCK = "+.lock"
    UNLOCK = "-.lock"
    SEND = ".send"
    ACTION = "action"
    NULL = "null"
    """No effect: the remainder of a deed that posted a goal to be performed."""


@dataclass(frozen=True, slots=True)
class Deed:
    kind: DeedKind
    term: Term
    goal: GoalKind = GoalKind.PERFORM

    @property
    def args(self) -> bool:
        """Whether there may be variables in it."""
        return isinstance(self.term, Var) or bool(self.term.args)


NULL = Deed(DeedKind.NULL, Struct("null"))


@dataclass(frozen=True, slots=True)
class Plan:
    """``event : { guard } <- deeds ;``"""

    event: Event
    guard: tuple[Condition, ...]
    deeds: tuple[Deed, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Rule:
    """A reasoning rule: ``safe :- ~danger_red, ~danger_orange;``"""

    head: Struct
    body: tuple[Condition, ...]
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Program:
    """One agent."""

    name: str
    beliefs: tuple[Struct, ...]
    rules: tuple[Rule, ...]
    goals: tuple[Goal, ...]
    plans: tuple[Plan, ...]
    name_span: Span | None = field(default=None, compare=False, repr=False)


RECEIVED, SENT = ".received", ".sent"
"""Names of the event of a received message, ``.received(From, To, tell, content)``, and of an agent's memory of a sent
one, ``.sent(to, from, tell, content)``."""


def show_event(event: Event) -> str:
    if isinstance(event.term, Struct) and event.term.functor in (RECEIVED, SENT):
        _, _, force, content = event.term.args
        return f"+{event.term.functor}(:{show(force)}, {show(content)})"
    return f"{event.sign}{'!' if event.is_goal else ''}{show(event.term)}{f' [{event.goal}]' if event.goal else ''}"


def show_deed(deed: Deed) -> str:
    match deed.kind:
        case DeedKind.ACTION:
            return show(deed.term)
        case DeedKind.SEND:
            assert isinstance(deed.term, Struct)
            to, force, content = deed.term.args
            return f".send({show(to)}, :{show(force)}, {show(content)})"
        case DeedKind.LOCK | DeedKind.UNLOCK | DeedKind.NULL:
            return str(deed.kind)
        case DeedKind.ADD_GOAL | DeedKind.DROP_GOAL:
            return f"{deed.kind}{show(deed.term)} [{deed.goal}]"
        case DeedKind.ADD_BELIEF | DeedKind.DROP_BELIEF | DeedKind.WAIT | DeedKind.WAIT_NOT:
            # belief and action: the sign before the term
            return f"{deed.kind}{show(deed.term)}"
        case _:
            assert_never(deed.kind)

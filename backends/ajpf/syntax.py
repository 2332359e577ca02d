"""Gwendolen programs and the terms in them, as data."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import count
from typing import assert_never

from avow.base.diagnostics import Span


@dataclass(frozen=True, slots=True)
class Var:
    """``Floor``; an anonymous ``_`` gets a name of its own when it is read."""

    name: str


@dataclass(frozen=True, slots=True)
class Struct:
    """``going(1)``, ``door``, ``-8.18``, ``"text"``: numbers and texts are constants too."""

    functor: str
    args: tuple[Term, ...] = ()


Term = Var | Struct
Bindings = dict[str, Term]


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
    """What triggers a plan: ``+danger``, ``-danger``, ``+!serve(1)``, ``-!serve(1)``."""

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
    """Of a goal: its kind; without a written kind it is either."""
    test: str | None = None
    """``<`` or ``==``: the term compares its two arguments as numbers."""
    group: tuple[Condition, ...] = ()
    """What a negated group denies: ``~(square(X, Y), ~empty(X, Y))``; it has no term."""
    is_cut: bool = False
    """``!`` in a reasoning rule: what was found so far stands, and no other rule is tried."""

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
    """Nothing: what is left of a deed that posted a goal to be performed."""


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


CONS, NIL = "[|]", "[]"
"""Lists are terms: ``[a, b|T]`` is ``[|](a, [|](b, T))``."""
OPERATORS = frozenset("+-")


def show(term: Term) -> str:
    """A term as Gwendolen writes it."""
    if isinstance(term, Var):
        return "_" if term.name.startswith("_") else term.name
    if term.functor == CONS:
        return _list(term, show, ", ")
    if term.functor in OPERATORS and len(term.args) == 2:
        return f"({show(term.args[0])} {term.functor} {show(term.args[1])})"
    return f"{term.functor}({', '.join(map(show, term.args))})" if term.args else term.functor


def _list(term: Term, say: Callable[[Term], str], comma: str) -> str:
    items = []
    while isinstance(term, Struct) and term.functor == CONS:
        items.append(say(term.args[0]))
        term = term.args[1]
    rest = "" if term == Struct(NIL) else f"|{say(term)}"
    return f"[{comma.join(items)}{rest}]"


def plain(term: Term) -> str:
    """A term as AIL's own texts write it, by which it also sorts: no space after a comma."""
    if isinstance(term, Var):
        return term.name
    if term.functor == CONS:
        return _list(term, plain, ",")
    return f"{term.functor}({','.join(map(plain, term.args))})" if term.args else term.functor


RECEIVED, SENT = ".received", ".sent"
"""Names of the event of a message received, ``.received(From, To, tell, content)``, and of what an agent remembers of
those that it sent, ``.sent(to, from, tell, content)``."""


def name_of(agent: Term) -> Term:
    """The agent that a message is for: AIL takes a text for a name, too."""
    text = isinstance(agent, Struct) and not agent.args and agent.functor[:1] in ("'", '"')
    return Struct(agent.functor[1:-1]) if isinstance(agent, Struct) and text else agent


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


def variables(term: Term) -> Iterator[str]:
    if isinstance(term, Var):
        yield term.name
        return
    for arg in term.args:
        yield from variables(arg)


def deeper(term: Term, most: int) -> bool:
    """Whether a term is nested deeper than that. A list nests as deep as it is long."""
    stack = [(term, 1)]
    while stack:
        part, depth = stack.pop()
        if depth > most:
            return True
        if isinstance(part, Struct):
            stack.extend((arg, depth + 1) for arg in part.args)
    return False


def is_ground(term: Term) -> bool:
    return isinstance(term, Struct) and all(map(is_ground, term.args))


def named_apart(term: Struct) -> Struct:
    """Each ``_`` of a property gets a name of its own, as it stands for anything."""
    numbers = count(1)

    def walk(part: Term) -> Term:
        if isinstance(part, Var):
            return Var(f"?{next(numbers)}")
        return Struct(part.functor, tuple(map(walk, part.args)))

    return Struct(term.functor, tuple(map(walk, term.args)))


def rename(term: Term, names: Mapping[str, Term]) -> Term:
    """The term with other variables in the place of its own, once: what comes in is not looked at again."""
    if isinstance(term, Var):
        return names.get(term.name, term)
    return Struct(term.functor, tuple(rename(arg, names) for arg in term.args)) if term.args else term


def apply(term: Term, bindings: Mapping[str, Term]) -> Term:
    """The term with its bound variables replaced, through chains of bindings."""
    if isinstance(term, Var):
        found = bindings.get(term.name)
        return term if found is None else apply(found, bindings)
    if not term.args:
        return term
    return Struct(term.functor, tuple(apply(arg, bindings) for arg in term.args))


def unify(left: Term, right: Term, bindings: Bindings) -> Bindings | None:
    """The most general extension of `bindings` that makes both equal, or None. No occurs check is needed: one side is
    always a belief, goal, event or deed of a running agent, whose variables are renamed apart."""
    stack = [(left, right)]
    result = bindings
    copied = False
    while stack:
        a, b = stack.pop()
        a, b = _resolve(a, result), _resolve(b, result)
        if a == b:
            continue
        if isinstance(b, Var) and not isinstance(a, Var):
            a, b = b, a
        if isinstance(a, Var):
            if not copied:
                result, copied = dict(result), True
            result[a.name] = b
            continue
        if not isinstance(b, Struct) or a.functor != b.functor or len(a.args) != len(b.args):
            return None
        stack.extend(zip(a.args, b.args, strict=True))
    return result


def _resolve(term: Term, bindings: Mapping[str, Term]) -> Term:
    while isinstance(term, Var):
        found = bindings.get(term.name)
        if found is None:
            return term
        term = found
    return term

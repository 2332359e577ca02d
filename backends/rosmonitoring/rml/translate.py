"""A node's guarantees as an RML specification over the events of its topics; correct, or refused with the reason.

A guarantee relates the latest values of several topics, so its equation carries them: by an event of the topic of r,
`Low<set_r, last_r>` becomes `Low<1, r>` with r from the event. The event at which the guarantee is judged has an event
type whose `with` condition is the guarantee without quantifiers (`quantifiers`). If it fails, no event type matches,
and the monitor's answer is false. A message that its rule cannot read matches no event type either.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count, product
from pathlib import PurePath
from typing import assert_never

from avow.backend_kit.one_step import refusal
from avow.evaluation.evaluate import free_names
from avow.formulas.values import Value
from avow.language import terms as t
from avow.language.contract import Clause
from avow.language.sorts import DataSort, RealSort, StringSort
from avow.language.terms import Role
from avow.ros.calls import is_part

from ..memory import triggers_of
from ..options import Setup, same_topic
from ..rules import Choice, Constant, FieldPath, Fields, Parameter, Previous, Rule
from ..tuning import CASES
from ..wires import parts_of
from . import symbols as sym
from . import syntax as rml
from .quantifiers import Eliminator


@dataclass(frozen=True, slots=True)
class Translation:
    """The file's text, and the reason for each guarantee that is not in it."""

    text: str
    refused: dict[str, str]


def translate(setup: Setup, guarantees: Sequence[Clause]) -> Translation:
    """Never raises, whatever the contract or the plan contain."""
    file = _File(setup)
    refused: dict[str, str] = {}
    for clause in guarantees:
        try:
            if reason := refusal("RML", setup.node, clause):
                raise rml.NotRml(reason)
            made = _Machine(file, clause)
            made.build()
            rml.write(rml.Specification((), tuple(rml.EventType("e", *rest) for rest in made.events), ()))
        except rml.NotRml as reason:
            refused[clause.name] = f"not monitorable in RML: {reason}"
            continue
        file.add(made)
    header = [
        f"Monitor of the node {setup.node.name}. Traces end at an event that breaks a guarantee or cannot be read.",
        *(f"Not here: guarantee {name}: {reason}" for name, reason in refused.items()),
    ]
    return Translation(
        rml.write(rml.Specification(tuple(header), file.events(), tuple(file.machines), file.notes)), refused
    )


_Event = tuple[tuple[str, ...], tuple[str, ...], rml.Condition]
"""An event type without its name: parameters, patterns, condition."""


class _File:
    """The parts that a node's machines share: event types, each once, and unique names."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.machines: list[rml.Machine] = []
        self.notes: dict[str, str] = {}
        self._events: dict[_Event, str] = {}
        self._taken: set[str] = {*rml.KEYWORDS, "main", "fresh", "last", "set"}
        self.stems = {name: self.name(name.partition(".")[2]) for name in setup.rules}
        """Variable → the prefix of the names of its parts."""

    def name(self, wanted: str, suffix: str = "") -> str:
        """A name in RML that resembles a contract's; each is given once. It has no `_` except that of the suffix, so
        that names that begin or end with it and a `_` are unique."""
        first, *words = re.findall("[A-Za-z0-9]+", wanted) or ["x"]
        text = "".join((first[0].lower() + first[1:], *(word[0].upper() + word[1:] for word in words)))
        text = text if text[0].isalpha() else f"x{text}"
        found = next(t for k in count(1) if (t := f"{text}{k if k > 1 else ''}{suffix}") not in self._taken)
        self._taken.add(found)
        return found

    def events(self) -> tuple[rml.EventType, ...]:
        return tuple(rml.EventType(name, *event) for event, name in self._events.items())

    def add(self, made: _Machine) -> None:
        span = made.clause.span
        where = f" ({PurePath(span.file).name}:{span.line}:{span.column})" if span else ""
        stem = self.name(made.clause.name)
        name = stem[0].upper() + stem[1:]
        steps = tuple(
            rml.Step(self._event(draft.event, *draft.called(stem)), draft.event[0], draft.binds, draft.then)
            for draft in made.drafts
        )
        relevant = self._event(made.relevant, "relevant")
        self.machines.append(rml.Machine(name, made.state, steps, made.initial, relevant))
        self.notes[name] = f"guarantee {made.clause.name}{where}"

    def _event(self, event: _Event, wanted: str, suffix: str = "") -> str:
        if event not in self._events:
            self._events[event] = self.name(wanted, suffix)
        return self._events[event]


@dataclass(frozen=True, slots=True)
class _Mode:
    """One way to take an event: its condition, the numbers that it sets besides those of its fields, and whether it
    ends an answer."""

    guard: rml.Condition
    sets: dict[str, rml.Numeric]
    judged: bool


@dataclass(frozen=True, slots=True)
class _Draft:
    """A step: an event of this shape, and the state after it."""

    topic: str
    fields: tuple[tuple[FieldPath, str], ...]
    binds: tuple[str, ...]
    used: tuple[str, ...]
    guard: rml.Condition
    then: tuple[rml.Numeric, ...]
    judged: bool

    @property
    def event(self) -> _Event:
        return (*self.binds, *self.used), (sym.pattern(self.topic, self.fields),), self.guard

    def called(self, clause: str) -> tuple[str, str]:
        """The name of its event type: from the clause if that is judged at it, otherwise from the topic."""
        return (clause, "_ok") if self.judged else (self.topic.rpartition("/")[2], "_event")

    def with_other(self, other: _Draft) -> _Draft | None:
        """Both as one, if they differ only in one field's constants; otherwise None."""
        if replace(self, fields=other.fields) != other or len(self.fields) != len(other.fields):
            return None
        pairs = list(zip(self.fields, other.fields, strict=True))
        differing = [k for k, (mine, theirs) in enumerate(pairs) if mine != theirs]
        if len(differing) != 1 or pairs[differing[0]][0][0] != pairs[differing[0]][1][0]:
            return None
        (path, mine), (_, theirs) = pairs[differing[0]]
        fields = tuple((path, f"{mine} | {theirs}") if k == differing[0] else f for k, f in enumerate(self.fields))
        return replace(self, fields=fields)


@dataclass(slots=True)
class _Machine:
    file: _File
    clause: Clause
    rules: dict[str, Rule] = field(default_factory=dict)
    symbols: dict[str, sym.Symbol] = field(default_factory=dict)
    flags: dict[str, str] = field(default_factory=dict)
    """Variable without an initial value → name of the number that is 1 once it has one."""
    fresh: dict[str, str] = field(default_factory=dict)
    """Each of several outputs → name of the number that is 1 once it has been published since the last judgement."""

    drafts: list[_Draft] = field(init=False)
    state: tuple[str, ...] = field(init=False)
    initial: tuple[rml.Numeric, ...] = field(init=False)
    relevant: _Event = field(init=False)

    @property
    def setup(self) -> Setup:
        return self.file.setup

    @property
    def events(self) -> list[_Event]:
        return [draft.event for draft in self.drafts]

    def build(self) -> None:
        names = sorted(free_names(self.clause.formula))
        for name in names:
            topic = getattr(self.setup.rules.get(name), "topic", "")
            if isinstance(self.setup.rules.get(name), Parameter):
                raise rml.NotRml(f"{name} is a parameter, and an event of {topic} tells of several")
            if is_part(topic):
                raise rml.NotRml(f"{name} is a part of a call ({topic}), and Avow writes RML about topics")
        self._choose(names)
        guard = Eliminator(self.symbols).condition(self.clause.formula)
        complete = rml.every(
            [rml.compare("==", rml.variable(self.flags[n]), rml.ONE) for n in names if n in self.flags]
        )
        judged = rml.some([*rml.negations(complete), guard])
        triggers = triggers_of(self.setup, tuple(names))
        together = self.setup.when == "outputs" and any(n.startswith(f"{Role.OUTPUT}.") for n in triggers)
        if together and len(triggers) > 1:
            self.fresh = {name: f"fresh_{self.file.stems[name]}" for name in triggers}
        state = [*self._state(), *self.fresh.values()]
        by_topic: dict[str, list[str]] = {}
        for name, rule in self.rules.items():
            if isinstance(rule, Fields | Choice):
                by_topic.setdefault(same_topic(rule.topic), []).append(name)
        if not by_topic:
            raise rml.NotRml("no message changes anything that it speaks of")
        drafts: list[_Draft] = []
        for topic, updated in by_topic.items():
            drafts += self._drafts(topic, updated, self._modes(judged, updated, triggers), state)
        needed = self._needed(state, drafts)
        kept = [at for at, name in enumerate(state) if name in needed]
        initial = self._initial(state)
        self.state, self.initial = tuple(state[k] for k in kept), tuple(initial[k] for k in kept)
        self.drafts = _merged(replace(draft, then=tuple(draft.then[k] for k in kept)) for draft in drafts)
        self.relevant = (), tuple(sym.pattern(self._written(topic), ()) for topic in by_topic), t.TRUE

    def _modes(self, judged: rml.Condition, updated: Sequence[str], triggers: Sequence[str]) -> list[_Mode]:
        """As in `engine.Monitor`: judged once each of its outputs has been published again, and not before."""
        mine = [n for n in triggers if n in updated]
        if not mine:
            return [_Mode(t.TRUE, {}, judged=False)]
        others = [self.fresh[n] for n in triggers if n not in updated and n in self.fresh]
        ready = rml.every([rml.compare("==", rml.variable(f), rml.ONE) for f in others])
        now = _Mode(rml.every([ready, judged]), dict.fromkeys(self.fresh.values(), rml.ZERO), judged=True)
        if not others:
            return [now]
        begun: dict[str, rml.Numeric] = {self.fresh[n]: rml.ONE for n in mine}
        return [now, _Mode(rml.opposite(ready), begun, judged=False)]

    def _needed(self, state: Sequence[str], drafts: Sequence[_Draft]) -> set[str]:
        """The carried numbers on which some later answer depends."""
        needed = {name for draft in drafts for name in draft.used}
        while True:
            used = {
                n
                for draft in drafts
                for name, value in zip(state, draft.then, strict=True)
                if name in needed
                for n in rml.names_in(value)
            }
            more = used & set(state) - needed
            if not more:
                return needed
            needed |= more

    def _choose(self, names: Iterable[str]) -> None:
        """The rules that matter, and the symbols of their variables."""
        wanted = list(names)
        for name in wanted:
            several = f"several nodes publish the topic of {name}, and an event does not name its publisher"
            if why := self.setup.hidden.get(name, several if name in self.setup.shared else ""):
                raise rml.NotRml(why)
            rule = self.setup.rules[name]
            if isinstance(rule, Previous) and rule.source not in wanted:
                if rule.source in self.setup.hidden:
                    raise rml.NotRml(self.setup.hidden[rule.source])
                wanted.append(rule.source)
        for name in wanted:
            rule, stem = self.setup.rules[name], self.file.stems[name]
            if isinstance(rule.variable.sort, StringSort):
                raise rml.NotRml(f"{name} is a string, and RML's conditions compare only numbers")
            self.rules[name] = rule
            self.symbols[name] = sym.carried(rule, dict(self.setup.rules), f"last_{stem}")
            if not isinstance(rule, Constant) and self._first(rule) is None:
                self.flags[name] = f"set_{stem}"

    def _first(self, rule: Fields | Choice | Previous) -> Value | None:
        """The value before any message."""
        if rule.initial is None and isinstance(rule, Previous):
            source = self.setup.rules[rule.source]
            return None if isinstance(source, Constant) else source.initial
        return rule.initial

    def _written(self, topic: str) -> str:
        """The topic's name as in the configuration."""
        for name in (*(name for name, _ in self.setup.named), *self.setup.topics):
            if same_topic(name) == topic:
                return name
        return topic

    def _state(self) -> list[str]:
        found: list[str] = []
        for name, symbol in self.symbols.items():
            found += [self.flags[name]] if name in self.flags else []
            found += sym.components(symbol)
        return found

    def _initial(self, state: Sequence[str]) -> list[rml.Numeric]:
        values: dict[str, rml.Numeric] = dict.fromkeys(state, rml.ZERO)
        for name, rule in self.rules.items():
            first = None if isinstance(rule, Constant) else self._first(rule)
            if first is None:
                continue
            symbol, known = self.symbols[name], sym.constant(first, rule.variable.sort)
            if isinstance(symbol, sym.Tracked):
                values.update(_seen_at_start(symbol, known))
                continue
            if not (parts := sym.parts(known)) and known != sym.Points(()):
                raise rml.NotRml("an initial value with more than one tuple")
            values.update(zip(sym.components(symbol), parts, strict=bool(parts)))
        return [values[name] for name in state]

    def _drafts(
        self, topic: str, updated: Sequence[str], modes: Sequence[_Mode], state: Sequence[str]
    ) -> Iterator[_Draft]:
        combinations = list(product(product(*(self._cases(name) for name in updated)), modes))
        if len(combinations) > CASES:
            raise rml.NotRml(f"a message of {topic} has {len(combinations)} shapes, more than {CASES}")
        for cases, mode in combinations:
            new: dict[str, rml.Numeric] = {}
            for name, case in zip(updated, cases, strict=True):
                if name in self.flags:
                    new[self.flags[name]] = rml.ONE
                new.update(zip(sym.components(self.symbols[name]), case.values, strict=True))
            guard = rml.every([*(case.guard for case in cases), rml.substitute(mode.guard, new)])
            if guard == t.FALSE:
                continue
            binds = tuple(b for case in cases for b in case.binds)
            used = tuple(n for n in state if n in rml.names_in(guard))
            fields = tuple(f for case in cases for f in case.fields)
            after = {**new, **mode.sets}
            for name, rule in self.rules.items():
                if isinstance(rule, Previous):
                    after.update(self._follow(name, rule, updated, new, mode))
            then = tuple(after.get(n, rml.variable(n)) for n in state)
            judged = mode.judged and mode.guard != t.TRUE
            yield _Draft(self._written(topic), fields, binds, used, guard, then, judged)

    def _follow(
        self, name: str, rule: Previous, updated: Sequence[str], new: dict[str, rml.Numeric], mode: _Mode
    ) -> dict[str, rml.Numeric]:
        """The previous value, for the next event: the source's value after this event, once it has one. If the source
        is one of several outputs: the value that it had in the answer that has just been judged."""
        if not (mode.judged if rule.source in self.fresh else rule.source in updated):
            return {}
        mine, theirs = sym.components(self.symbols[name]), sym.components(self.symbols[rule.source])
        found: dict[str, rml.Numeric] = {self.flags[name]: rml.ONE} if name in self.flags else {}
        found.update((m, new.get(other, rml.variable(other))) for m, other in zip(mine, theirs, strict=True))
        return found

    def _cases(self, name: str) -> list[sym.Case]:
        rule, stem = self.rules[name], self.file.stems[name]
        match rule:
            case Fields(variable=variable, paths=paths, names=names):
                if why := sym.no_pattern(rule):
                    raise rml.NotRml(f"{name} is {why}")
                per_field = [
                    sym.field_cases(path, s, bind, names)
                    for path, s, bind in zip(paths, parts_of(variable.sort), sym.binds_of(stem, paths), strict=True)
                ]
                symbol = self.symbols[name]
                if isinstance(symbol, sym.Tracked):
                    if RealSort() in parts_of(variable.sort):
                        raise rml.NotRml(f"{name} holds of all tuples seen, and these are of real numbers")
                    return [_tracked_case(symbol, parts) for parts in product(*per_field)]
                relation = isinstance(symbol, sym.Points)
                first: tuple[rml.Numeric, ...] = (rml.ONE,) if relation else ()
                return [sym.together(first, parts) for parts in product(*per_field)]
            case Choice(variable=variable):
                assert isinstance(variable.sort, DataSort)
                return sym.choice_cases(rule, variable.sort, stem)
            case Constant() | Previous():
                raise rml.NotRml(f"{name} has no message")
            case _:
                assert_never(rule)


def _merged(drafts: Iterable[_Draft]) -> list[_Draft]:
    """Merge drafts that differ only in a field's constants."""
    found: list[_Draft] = []
    for draft in drafts:
        both = ((k, joined) for k, other in enumerate(found) if (joined := other.with_other(draft)) is not None)
        at, made = next(both, (len(found), draft))
        found[at : at + 1] = [made]
    return found


def _tracked_case(symbol: sym.Tracked, parts: Sequence[sym.Case]) -> sym.Case:
    """A message sets the number of its tuple to 1: ``1 - (1 - n) * min(1, |value - asked|)``. RML's own monitor
    evaluates an argument only if its outermost operator is a sum or a product."""
    whole = sym.together((), parts)
    one, nothing = rml.ONE, rml.ZERO
    values: list[rml.Numeric] = []
    for at, flag in symbol.flags.items():
        apart: rml.Numeric = nothing
        for value, asked in zip(whole.values, at, strict=True):
            sides = _calculated("-", value, rml.literal(asked)), _calculated("-", rml.literal(asked), value)
            apart = _calculated("+", _calculated("max", *sides), apart)
        unseen = _calculated("*", _calculated("-", one, rml.variable(flag)), _calculated("min", one, apart))
        values.append(_calculated("-", one, unseen))
    return replace(whole, values=tuple(values))


def _calculated(operator: str, left: rml.Numeric, right: rml.Numeric) -> rml.Numeric:
    """The calculation, simplified as far as possible."""
    match operator, left, right:
        case "+" | "-", other, t.Literal(value=0):
            return other
        case "*", _, t.Literal(value=0):
            return right
        case _:  # as it is
            return rml.calculation(operator, left, right)


def _seen_at_start(symbol: sym.Tracked, known: sym.Symbol) -> dict[str, rml.Numeric]:
    assert isinstance(known, sym.Points)
    seen = {tuple(n.value for n in chain(*parts) if isinstance(n, t.Literal)) for _, parts in known.tuples}
    return {flag: rml.literal(at in seen) for at, flag in symbol.flags.items()}

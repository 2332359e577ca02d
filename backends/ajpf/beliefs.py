"""What an agent believes: belief bases, and derivation with its reasoning rules."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from .builtin import compare
from .syntax import SENT, Condition, Goal, Rule
from .terms import Bindings, Struct, Term, Var, apart, apply, is_ground, name_of, plain, unify
from .tuning import RULE_DEPTH, RULE_STEPS


class TooDeep(Exception):  # noqa: N818 - it names what happened
    """Reasoning rules call each other without end, or nearly so; or a query takes too many steps."""


@dataclass(frozen=True, slots=True)
class Beliefs:
    """`own` were added by the agent (or are in the program), `perceived` by perception; a belief of one kind is not
    added again as the other. Beliefs of one name are tried in the order of their texts."""

    own: frozenset[Struct]
    perceived: frozenset[Struct]
    index: Mapping[tuple[str, int], tuple[Struct, ...]] = field(compare=False, repr=False)
    percepts: tuple[Struct, ...] = field(compare=False, repr=False)
    """The percepts, in the order in which AIL checks whether they are gone."""

    @staticmethod
    def of(own: frozenset[Struct], perceived: frozenset[Struct]) -> Beliefs:
        index: dict[tuple[str, int], list[Struct]] = {}
        for belief in sorted(own | perceived, key=plain):
            index.setdefault((belief.functor, len(belief.args)), []).append(belief)
        percepts = tuple(sorted(perceived, key=lambda p: plain(p) + "[source(percept)]"))
        return Beliefs(own, perceived, {key: tuple(found) for key, found in index.items()}, percepts)

    def __contains__(self, belief: Struct) -> bool:
        return belief in self.own or belief in self.perceived

    def matching(self, pattern: Struct) -> tuple[Struct, ...]:
        """The beliefs that unify with the pattern."""
        found = self.index.get((pattern.functor, len(pattern.args)), ())
        return tuple(b for b in found if unify(pattern, apart(b, "''"), {}) is not None)


@dataclass(slots=True)
class Reasoner:
    """Derives literals from beliefs by backward chaining; negation is failure to derive."""

    rules: Mapping[tuple[str, int], Sequence[Rule]]
    fresh: Iterator[int] = field(default_factory=count)
    steps: int = 0
    """Beliefs and rules that were tried for the current query."""

    @staticmethod
    def of(rules: Sequence[Rule]) -> Reasoner:
        index: dict[tuple[str, int], list[Rule]] = {}
        for rule in rules:
            index.setdefault((rule.head.functor, len(rule.head.args)), []).append(rule)
        return Reasoner(index)

    def first_way(
        self, beliefs: Beliefs, conditions: Sequence[Condition], bindings: Bindings, goals: Sequence[Goal]
    ) -> Bindings | None:
        """The first way to meet all conditions, if any. Raises TooDeep."""
        self.steps = 0
        return next(self.holds(beliefs, conditions, bindings, goals), None)

    def derived(self, beliefs: Beliefs, term: Term) -> Bindings | None:
        """The first way to believe the term, if any. Raises TooDeep."""
        self.steps = 0
        return next(self.believes(beliefs, term, {}), None)

    def _tried(self) -> None:
        self.steps += 1
        if self.steps > RULE_STEPS:
            raise TooDeep

    def believes(self, beliefs: Beliefs, term: Term, bindings: Bindings, depth: int = 0) -> Iterator[Bindings]:
        """Every way to bind the term's variables so that it is believed or derivable. Raises TooDeep."""
        goal = apply(term, bindings)
        if isinstance(goal, Var):  # anything that is believed
            known = (b for group in beliefs.index.values() for b in group if b.functor != SENT)
            for belief in sorted(known, key=plain):
                yield {**bindings, goal.name: apart(belief, f"'{next(self.fresh)}")}
            return
        key = (goal.functor, len(goal.args))
        for belief in beliefs.index.get(key, ()):
            self._tried()
            known_as = belief if is_ground(belief) else apart(belief, f"'{next(self.fresh)}")
            found = unify(goal, known_as, bindings)
            if found is not None:
                yield found
        for rule in self.rules.get(key, ()):
            self._tried()
            if depth >= RULE_DEPTH:
                raise TooDeep
            renamed = renamed_rule(rule, f"'{next(self.fresh)}")
            found = unify(goal, renamed.head, bindings)
            if found is None:
                continue
            if len(renamed.body) > 1 and any(c.is_cut for c in renamed.body):
                if self._passes(beliefs, renamed.body[:-1], found, depth + 1):
                    return
                continue
            yield from self.holds(beliefs, renamed.body, found, (), depth + 1)

    def _passes(self, beliefs: Beliefs, conditions: Sequence[Condition], bindings: Bindings, depth: int) -> bool:
        """Whether a rule with a cut meets its last condition. AIL's iterator then treats it as cut before its first
        answer: such a rule derives nothing, and no later rule is tried. The bindings found before a cut are kept, and
        so is the first way to meet each condition after it."""
        at = next((n for n, c in enumerate(conditions) if c.is_cut), len(conditions))
        found = next(self.holds(beliefs, conditions[:at], bindings, (), depth), None)
        for condition in conditions[at:]:
            if found is not None:
                found = next(self._one(beliefs, condition, found, (), depth), None)
        return found is not None

    def holds(
        self,
        beliefs: Beliefs,
        conditions: Sequence[Condition],
        bindings: Bindings,
        goals: Sequence[Goal],
        depth: int = 0,
    ) -> Iterator[Bindings]:
        """Every way to meet all conditions."""
        if not conditions:
            yield bindings
            return
        first, rest = conditions[0], conditions[1:]
        for found in self._one(beliefs, first, bindings, goals, depth):
            yield from self.holds(beliefs, rest, found, goals, depth)

    def _one(
        self, beliefs: Beliefs, condition: Condition, bindings: Bindings, goals: Sequence[Goal], depth: int
    ) -> Iterator[Bindings]:
        ways: Iterator[Bindings]
        if condition.group:
            ways = self.holds(beliefs, condition.group, bindings, goals, depth)
        elif condition.term is None:
            yield bindings
            return
        elif condition.test is not None:
            ways = compare(condition.test, apply(condition.term, bindings), bindings)
        elif condition.is_goal:
            ways = (
                u
                for g in goals
                if (condition.goal is None or g.kind is condition.goal)
                and (u := unify(condition.term, g.term, bindings)) is not None
            )
        elif isinstance(condition.term, Struct) and condition.term.functor == SENT:
            ways = _sent(beliefs, condition.term, bindings)
        else:
            ways = self.believes(beliefs, condition.term, bindings, depth)
        if condition.positive:
            yield from ways
        elif next(ways, None) is None:
            yield bindings


def _sent(beliefs: Beliefs, term: Struct, bindings: Bindings) -> Iterator[Bindings]:
    """The matching messages that were sent. A variable for an agent's name is bound to a text, as in AIL: no belief
    about the agent has it then."""
    meant = apply(term, bindings)
    assert isinstance(meant, Struct)
    for message in beliefs.index.get((SENT, 4), ()):
        names = zip(meant.args[:2], message.args[:2], strict=True)
        sent = tuple(name if name_of(wanted) == wanted and is_ground(wanted) else _text(name) for wanted, name in names)
        found = unify(meant, Struct(SENT, (*sent, *message.args[2:])), bindings)
        if found is not None:
            yield found


def _text(name: Term) -> Struct:
    return Struct(f'"{plain(name)}"')


def renamed_rule(rule: Rule, suffix: str) -> Rule:
    """The rule with variables of its own."""
    head = apart(rule.head, suffix)
    assert isinstance(head, Struct)
    return Rule(head, tuple(renamed_condition(c, suffix) for c in rule.body), rule.span)


def renamed_condition(condition: Condition, suffix: str) -> Condition:
    """The condition with variables of its own."""
    term = None if condition.term is None else apart(condition.term, suffix)
    group = tuple(renamed_condition(part, suffix) for part in condition.group)
    return condition if term is condition.term and not group else replace(condition, term=term, group=group)

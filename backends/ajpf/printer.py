"""Programs as MCAPL's grammar wants them: one form of everything, kinds of goals written out, comments left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product

from .syntax import Condition, DeedKind, Event, GoalKind, Plan, Program, Rule, show, show_deed

_KINDS = (GoalKind.PERFORM, GoalKind.ACHIEVE)


def program_text(program: Program) -> str:
    lines = ["GWENDOLEN", "", f":name: {program.name}", "", ":Initial Beliefs:", ""]
    lines += [show(belief) for belief in program.beliefs]
    if program.rules:
        lines += ["", ":Reasoning Rules:", "", *map(_rule, program.rules)]
    lines += ["", ":Initial Goals:", "", *(f"{show(goal.term)} [{goal.kind}]" for goal in program.goals)]
    lines += ["", ":Plans:", "", *(_plan(kinded) for plan in program.plans for kinded in _kinded(plan))]
    return "\n".join(lines) + "\n"


def _kinded(plan: Plan) -> Iterator[Plan]:
    """What is written without a kind is for both: the plan is there twice."""
    events: Iterable[Event] = (plan.event,)
    if plan.event.is_goal and plan.event.goal is None:
        events = [replace(plan.event, goal=kind) for kind in _KINDS]
    for event in events:
        for guard in product(*map(_kinds, plan.guard)):
            yield replace(plan, event=event, guard=tuple(c for part in guard for c in part))


def _kinds(condition: Condition) -> list[tuple[Condition, ...]]:
    if not condition.is_goal or condition.goal is not None:
        return [(condition,)]
    both = [replace(condition, goal=kind) for kind in _KINDS]
    return [(c,) for c in both] if condition.positive else [tuple(both)]


def _rule(rule: Rule) -> str:
    return f"{show(rule.head)} :- {', '.join(map(_literal, rule.body))};" if rule.body else f"{show(rule.head)};"


def _literal(condition: Condition) -> str:
    assert condition.term is not None
    return f"{'' if condition.positive else '~'}{show(condition.term)}"


def _guard(condition: Condition) -> str:
    if condition.term is None:
        return "True"
    kind = f" [{condition.goal}]" if condition.is_goal else ""
    return f"{'' if condition.positive else '~'}{'G' if condition.is_goal else 'B'} {show(condition.term)}{kind}"


def _plan(plan: Plan) -> str:
    event = f"{plan.event.sign}{'!' if plan.event.is_goal else ''}{show(plan.event.term)}"
    if plan.event.is_goal:
        event += f" [{plan.event.goal}]"
    body = ", ".join(show_deed(deed) for deed in plan.deeds if deed.kind is not DeedKind.NULL)
    guard = ", ".join(map(_guard, plan.guard)) or "True"
    return f"{event} : {{ {guard} }}{f' <- {body}' if body else ''};"

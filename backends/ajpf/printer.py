"""Programs as MCAPL's grammar wants them: one form of everything, kinds of goals written out, comments left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product

from .syntax import SENT, Condition, DeedKind, Event, GoalKind, Plan, Program, Rule, Struct, show, show_deed, show_event

_KINDS = (GoalKind.PERFORM, GoalKind.ACHIEVE)


def program_text(programs: Iterable[Program]) -> str:
    """The agents of a system."""
    return "\n".join(["GWENDOLEN", *(line for program in programs for line in _agent(program))]) + "\n"


def _agent(program: Program) -> list[str]:
    lines = ["", f":name: {program.name}", "", ":Initial Beliefs:", ""]
    lines += [show(belief) for belief in program.beliefs]
    if program.rules:
        lines += ["", ":Reasoning Rules:", "", *map(_rule, program.rules)]
    lines += ["", ":Initial Goals:", "", *(f"{show(goal.term)} [{goal.kind}]" for goal in program.goals)]
    lines += ["", ":Plans:", "", *(_plan(kinded) for plan in program.plans for kinded in _kinded(plan))]
    return lines


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
    if condition.is_cut:
        return "!"
    sign = "" if condition.positive else "~"
    if condition.group:
        return f"~({', '.join(map(_literal, condition.group))})"
    assert condition.term is not None
    if condition.test is not None:
        return f"{sign}[{_comparison(condition)}]"
    return f"{sign}{show(condition.term)}"


def _comparison(condition: Condition) -> str:
    assert isinstance(condition.term, Struct)
    left, right = (show(side).removeprefix("(").removesuffix(")") for side in condition.term.args)
    return f"{left} {condition.test} {right}"


def _guard(condition: Condition) -> str:
    if condition.term is None:
        return "True"
    sign = "" if condition.positive else "~"
    if condition.test is not None:
        return f"{sign}{_comparison(condition)}"
    if isinstance(condition.term, Struct) and condition.term.functor == SENT:
        to, sender, force, content = condition.term.args
        by = "" if show(sender) == "_" else f"{show(sender)}, "
        return f"{sign}.sent({show(to)}, {by}:{show(force)}, {show(content)})"
    kind = f" [{condition.goal}]" if condition.is_goal else ""
    return f"{sign}{'G' if condition.is_goal else 'B'} {show(condition.term)}{kind}"


def _plan(plan: Plan) -> str:
    event = show_event(plan.event)
    body = ", ".join(show_deed(deed) for deed in plan.deeds if deed.kind is not DeedKind.NULL)
    guard = ", ".join(map(_guard, plan.guard)) or "True"
    return f"{event} : {{ {guard} }}{f' <- {body}' if body else ''};"

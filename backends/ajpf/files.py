"""The files that AJPF takes: properties (.psl), the plan's program (.gwen), agent system (.ail) and one run each
(.jpf); and a table of the meaning of each property. Pure: the same job gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import product

from avow.backend_kit.given import file_path
from avow.backend_kit.protocol import Job
from avow.base.codec import document
from avow.base.files import read_regular

from . import psl
from .checker import Property
from .instances import Instantiation
from .java import CLASS, environment_class
from .options import Setup
from .syntax import SENT, Condition, DeedKind, Event, GoalKind, Plan, Program, Rule, show_deed, show_event
from .terms import Struct, show

CLAIMS = "claims.json"
_BUILDER = "gwendolen.GwendolenMASBuilder"


def export_files(job: Job, setup: Setup, made: Instantiation) -> Mapping[str, str]:
    """Relative path → text."""
    name = setup.agent
    runs = {f"jpf/{p.key}.jpf": _run(name, p.key) for p in made.properties}
    properties = {f"{name}.psl": _psl_file(made.properties)}
    path = file_path(job, "program")
    assert path is not None  # `setup` was read from it
    program = {f"{name}.gwen": read_regular(path).decode("utf-8")}
    return {**system_files(setup, name), **program, **properties, CLAIMS: _claims(job, setup, made), **runs}


def system_files(setup: Setup, name: str, *, scripted: bool = False) -> dict[str, str]:
    """The agents and their environment."""
    return {
        f"{name}.gwen": program_text(setup.programs),
        f"{name}.ail": f"env = {CLASS}\nmas.file = {name}.gwen\nmas.builder = {_BUILDER}\n",
        f"{CLASS}.java": environment_class(setup.environment, agents=len(setup.programs), scripted=scripted),
    }


def _run(name: str, key: str) -> str:
    return f"@using = mcapl\n\ntarget = ail.util.AJPF_w_AIL\ntarget.args = {name}.ail,{name}.psl,{key}\n"


def _psl_file(properties: Iterable[Property]) -> str:
    """Lines ``key: formula``. Comments are ASCII and of one line, whatever the contract contains."""
    lines = []
    for p in properties:
        if p.about:
            lines.append(f"# {p.key}: {_plain(p.about)}")
        lines.append(f"{p.key}: {psl.show(p.formula)}")
    return "\n".join(lines) + "\n"


def _plain(text: str) -> str:
    return "".join(c if " " <= c <= "~" else "-" for c in text.replace("…", ".."))


def _claims(job: Job, setup: Setup, made: Instantiation) -> str:
    def entry(p: Property) -> dict[str, object]:
        return {"instance": p.about, "property": psl.show(p.formula)}

    data = {
        "agent": setup.agent,
        **({"agents": [p.name for p in setup.programs]} if len(setup.programs) > 1 else {}),
        "percept_semantics": str(setup.semantics),
        "environment": list(setup.environment.describe()),
        "table": {row.text: psl.show_template(row.formula) for row in setup.rows},
        "instances": {name: list(values) for name, values in setup.instances.items()},
        "guarantees": {
            claim.guarantee: {
                "formula": next((o.formula for o in job.obligations if o.name == claim.guarantee), ""),
                "properties": {p.key: entry(p) for p in claim.properties},
                **({"not covered": claim.not_covered} if claim.not_covered else {}),
                **({"settled by the scenario": list(claim.settled)} if claim.settled else {}),
                **({"taken for granted": list(claim.granted)} if claim.granted else {}),
                **({"left to": {left.forbidden: left.extra for left in claim.left}} if claim.left else {}),
            }
            for claim in made.claims
        },
        "further properties": {
            extra.name: {
                "guarantee": extra.guarantee,
                "counts": extra.counts,
                "because": extra.because,
                "properties": {p.key: entry(p) for p in properties},
            }
            for extra, properties in made.extras
        },
    }
    return document(data) + "\n"


# Programs as MCAPL's grammar requires: one form of everything, kinds of goals written out, comments left out

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
    """A trigger without a kind is for both kinds: the plan is written twice."""
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

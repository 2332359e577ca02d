"""A filter: messages of a node that would break its guarantees are not passed on.

As ROSMonitoring has it, the node is started with the topic remapped (``command:=command_mon``): what it says comes to
the monitor alone, which says it again on the topic. The messages of one topic are judged as they come, each by itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from avow.base.diagnostics import Diagnostic, Rejected
from avow.formulas.formula import free_variables
from avow.language.terms import Role

from .options import Setup, same_topic
from .watched import Fault

if TYPE_CHECKING:
    from .engine import Monitor

RAW = "_mon"
"""Behind the name of a topic that is filtered: what its node says."""

WITHHELD = (Fault.GUARANTEE, Fault.EXCUSED, Fault.MAPPING)
"""What keeps a message from being passed on; an assumption that is broken, or a silence, is not its fault."""


def raw(topic: str) -> str:
    return f"{topic}{RAW}"


def filtered(setups: Iterable[Setup]) -> frozenset[str]:
    """The topics that are filtered. Raises Rejected where the plan names none, and where a guarantee of what is
    filtered is not judged by a message of that topic alone, as it comes."""
    wrong: list[Diagnostic] = []
    found: set[str] = set()
    for setup in setups:
        if not setup.filtered:
            continue
        found |= setup.filtered
        name = setup.node.name
        if setup.answers is not None and setup.answers.by != "arrival":
            hint = "answers: {by: arrival, because: …}"
            wrong.append(Diagnostic("MON307", f"{name}: which input an answer answered shows only later", hint=hint))
        for clause in setup.node.guarantees:
            outputs = {v.qualified for v in free_variables(clause.formula) if v.role is Role.OUTPUT}
            topics = {same_topic(rule.topic) for name, rule in setup.carried.items() if name in outputs}
            if topics & setup.filtered and len(topics) > 1:
                text = f"{name}.{clause.name} speaks of several topics, {' and '.join(sorted(topics))}"
                hint = "the first of them would be passed on before it can be judged"
                wrong.append(Diagnostic("MON307", text, hint=hint))
    if not found:
        wrong.append(Diagnostic("MON307", "the plan filters nothing", hint="rosmonitoring: {filter: [out.command]}"))
    if wrong:
        raise Rejected(*wrong)
    return frozenset(found)


def told_withheld(monitors: Iterable[Monitor], counts: Mapping[str, int]) -> None:
    """A record behind a filter holds what its node said, and what was passed on. Where that is less, the guarantees
    were met by the filter, and it is no evidence of the node."""
    for monitor in monitors:
        for topic in sorted(monitor.setup.filtered):
            said, passed = counts.get(raw(topic), 0), counts.get(topic, 0)
            if said > passed:
                reason = f"{said - passed} of {said} messages of {topic} were withheld by a filter"
                monitor.backwards = monitor.backwards or reason

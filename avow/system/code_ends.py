"""What the nodes' code creates, against the contract and against each other; nothing is run.

A topic that the code creates and the contract does not declare is a warning. What the contract declares and the code
never creates, or creates with another type, is an error, and so are a publisher and a subscriber that DDS does not
connect because of their quality of service. What the code computes is not known, and no error. A warning says where
the contract's times contradict a topic's deadline.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.records import dataclass
from avow.base.suggestions import nearest, suggest
from avow.language.contract import Node, Topic
from avow.language.printer import show_number
from avow.language.terms import And, History, Limit, Past, Role, Term, Variable
from avow.ros.bags import NoBag
from avow.ros.calls import OWN_CALLS
from avow.ros.code import Code, Created, read_code
from avow.ros.definitions import canonical
from avow.ros.drafting import is_plumbing
from avow.ros.names import Placed
from avow.ros.parameters import OF_EVERY_NODE, flat
from avow.ros.quality import Quality, Recorded, recorded, unmet
from avow.system.formulas import environment_assumptions
from avow.system.graph import dataflow
from avow.system.launched import where
from avow.system.node_plan import parameter_place, parameters
from avow.system.plan import Driving, NodeEnds, Plan, Source, System

_CORRECT = "correct the contract's topic, the plan's `ros`, or the code"
_SIDES = {Role.OUTPUT: "publishes", Role.INPUT: "subscribes"}
_TOPICS = tuple(_SIDES.values())
_DOES = {"publishes": "publishes", "subscribes": "subscribes to", "serves": "serves", "calls": "calls"}
_DOES |= {"does": "serves the action", "orders": "calls the action"}


@dataclass(frozen=True, slots=True)
class _End:
    """A publisher or a subscriber, by the whole name of its topic. `node`: empty if it is not known."""

    node: str
    topic: str
    publishes: bool
    quality: Quality
    span: Span
    sure: bool = True
    """Whether it is created under no condition, by a node of the contract."""


def checked(system: System) -> Iterator[Diagnostic]:
    """The findings about the code and the quality of service of all nodes."""
    plan = system.plan
    ends: list[_End] = []
    for node in system.contract.nodes:
        placed = plan.ros.names.placed(node.name)
        said = next((each for each in plan.ends if each.node == node.name), NodeEnds(node.name))
        source = next((entry.source for entry in plan.nodes if entry.node == node.name), None)
        driven = source is not None and bool(source.python) and source.kind is not Driving.STEP
        code = _code(plan, source if driven else None, said)
        if code.created or code.unread:
            yield from _against_contract(node, placed, code)
            if code.unread:
                why, span = code.unread[0]
                more = f", and {len(code.unread) - 1} more" if len(code.unread) > 1 else ""
                text = f"the code of {node.name} may create more: {why}{more}"
                yield Diagnostic("ROS134", text, span, Severity.NOTE)
        if driven and source is not None and source.kind is Driving.RCLPY and code.created and not code.unread:
            yield from _never_declared(plan, source, placed, code)
        own = [
            _End(node.name, placed.resolved(c.name), c.side == "publishes", c.quality, c.span, c.sure)
            for c in code.created
            if c.side in _TOPICS
        ]
        yield from _declared(node, placed, said, own)
        ends += own
    yield from _recorded(system, ends)
    yield from _connected(ends)
    yield from _timed(system, ends)


def _code(plan: Plan, source: Source | None, said: NodeEnds) -> Code:
    files = [(path, "") for path in said.files]
    if source is not None:
        files.append((plan.root / source.python, source.class_name))
    read = [read_code(path, name, {other.name for other, _ in files}) for path, name in dict.fromkeys(files)]
    return Code(tuple(c for code in read for c in code.created), tuple(u for code in read for u in code.unread))


# -- code and contract -------------------------------------------------------------------------------------------------


def _base(placed: Placed, topic: Topic) -> tuple[str, str, bool]:
    """The whole name and the type of a topic, a service or an action of the contract; whether it is a topic."""
    name, kind = placed.resolved(topic.name.partition("/_action/")[0]), canonical(topic.ros_type)
    package, _, word = kind.partition("/")
    return name, f"{package}/{word.partition('_')[0]}", "_" not in word  # no message's name has an underscore


def _against_contract(node: Node, placed: Placed, code: Code) -> Iterator[Diagnostic]:
    topics = [(topic, *_base(placed, topic)) for topic in node.topics]
    known = {(name, plain) for _, name, _, plain in topics}
    ends = [(placed.resolved(end.name), end) for end in code.created if end.side != "declares"]
    plumbing = [name for name, _ in ends if is_plumbing(name) or name.startswith("/tf")]
    strange = {n: end for n, end in ends if (n, end.side in _TOPICS) not in known and n not in plumbing}
    calls: set[str] = set()
    blamed: set[tuple[str, str]] = set()
    for topic, name, kind, plain in topics:
        if not plain and name in calls:
            continue  # the request of a call whose response was examined
        calls |= set() if plain else {name}
        if is_plumbing(name) or kind.partition("/")[0] in (*OWN_CALLS, "actionlib_msgs"):
            continue
        mine = [end for whole, end in ends if whole == name and (end.side in _TOPICS) is plain]
        for found, fault in _wrong_type(topic, name, kind, mine):
            if found not in blamed:  # a package's wrong name is one fault, however many topics have its types
                yield fault
            blamed.add(found)
        sides = _SIDES if topic.port is None or not plain else {topic.port.role: _SIDES[topic.port.role]}
        if not code.unread and not any(not plain or end.side in sides.values() for end in mine):
            does = _DOES["".join(sides.values())] if len(sides) == 1 else "creates"
            if (name, does) in blamed:
                continue  # it carries several ports
            blamed.add((name, does))
            near = nearest(name, strange)
            if not near and topic.port is not None:  # the one end of this side and type that the contract lacks
                alike = [n for n, end in strange.items() if end.side == sides[topic.port.role] and end.kind == kind]
                near = alike if plain and len(alike) == 1 else []
            meant = [(at, strange.pop(at)) for at in near]  # one misspelt name is one fault
            meant += [(at, end) for at, end in ends if end in mine or not mine]
            notes = tuple((f"it {_DOES[end.side]} {at} here", end.span) for at, end in meant[:1])
            hint = suggest(name, near or sorted({at for at, _ in ends})) or _CORRECT
            yield Diagnostic(
                "ROS133", f"the code of {node.name} never {does} {name}", topic.span, hint=hint, notes=notes
            )
    for name, end in strange.items():
        text = f"the code of {node.name} {_DOES[end.side]} {name}, which the contract does not declare"
        hint = suggest(name, sorted({other for other, _ in known})) or "declare it under the node's `topics`"
        here = (("the contract's node is here", node.span),)
        yield Diagnostic("ROS132", text, end.span, Severity.WARNING, hint, here)


def _wrong_type(
    topic: Topic, name: str, kind: str, mine: Sequence[Created]
) -> Iterator[tuple[tuple[str, str], Diagnostic]]:
    """The fault with the names that differ: of the packages, if the types have one name in both."""
    for end in mine:
        if end.kind and end.kind != kind and "/_action/" not in topic.name:
            ours, theirs = kind.partition("/"), end.kind.partition("/")
            apart = (ours[0], theirs[0]) if ours[2] == theirs[2] else (name, end.kind)
            text = f"{name} is {kind} in the contract, and {end.kind} in the code"
            hint = "correct one of them"
            if apart == (ours[0], theirs[0]):
                hint = f"correct the import of {theirs[0]} in the code, or the package in the contract"
            notes = (("it is created here", end.span),)
            yield apart, Diagnostic("ROS133", text, topic.span, hint=hint, notes=notes)
            return


def _never_declared(plan: Plan, source: Source, placed: Placed, code: Code) -> Iterator[Diagnostic]:
    declared = [end.name for end in code.created if end.side == "declares"]
    values, wrong = parameters(plan.root, source, placed.name)
    for name, _ in () if wrong else flat(values):
        if name not in declared and name.partition(".")[0] not in OF_EVERY_NODE:
            span = parameter_place(plan.root, source, placed.name, name)
            text = f"`{Path(span.file).name}` sets {name}, which {source.class_name} never declares"
            hint = suggest(name, declared) or "correct its name, or remove it"
            yield Diagnostic("PLAN136", text, span, Severity.WARNING, hint)


# -- quality of service ------------------------------------------------------------------------------------------------


def _declared(node: Node, placed: Placed, said: NodeEnds, ends: list[_End]) -> Iterator[Diagnostic]:
    """Fills in what the plan says of the ends whose code does not tell; an error where the code tells otherwise."""
    for name, quality, span in said.qualities:
        topics = [t for t in node.topics if t.port is not None and placed.resolved(t.name) == placed.resolved(name)]
        if not topics:
            known = sorted({topic.name for topic in node.topics if topic.port is not None})
            text = f"ros.nodes.{node.name}.qos: {node.name} has no topic {name} with a port"
            yield Diagnostic("PLAN106", text, span, hint=suggest(name, known))
        for publishes in dict.fromkeys(t.port.role is Role.OUTPUT for t in topics if t.port is not None):
            whole = placed.resolved(name)
            mine = [k for k, end in enumerate(ends) if (end.topic, end.publishes) == (whole, publishes)]
            for at in mine:
                filled = _filled(ends[at].quality, quality)
                for policy, one, other in _different(ends[at].quality, quality):
                    text = f"{policy} of {whole} is {one} in the code of {node.name}, and {other} in the plan"
                    notes = (("the code says it here", ends[at].span),)
                    yield Diagnostic("ROS135", text, span, hint="remove it from the plan", notes=notes)
                ends[at] = replace(ends[at], quality=filled, span=ends[at].span if filled == ends[at].quality else span)
            if not mine:
                ends.append(_End(node.name, whole, publishes, quality, span))


def _filled(known: Quality, more: Quality) -> Quality:
    return replace(known, **{f.name: getattr(more, f.name) for f in fields(Quality) if getattr(known, f.name) is None})


def _different(one: Quality, other: Quality) -> Iterator[tuple[str, object, object]]:
    for each in fields(Quality):
        values = getattr(one, each.name), getattr(other, each.name)
        if None not in values and values[0] != values[1]:
            yield each.name, *values


def _recorded(system: System, ends: list[_End]) -> Iterator[Diagnostic]:
    """Adds what records tell: of a node of the contract whose quality of service is not known otherwise, and of other
    publishers and subscribers of the contract's topics."""
    called = {system.plan.ros.names.placed(node.name).name: node.name for node in system.contract.nodes}
    told: list[Recorded] = []
    for path in system.plan.records:
        try:
            told += recorded(path)
        except (NoBag, OSError, ValueError) as error:
            span = Span(str(path), 1, 1, 1, 2)
            yield Diagnostic("ROS136", f"no quality of service can be read from it: {error}", span, hint=_RECORDED)
    known = {(end.topic, end.publishes, end.node) for end in ends if end.quality != Quality()}
    offered = {(topic, publishes) for topic, publishes, _ in known if publishes}
    offered |= {(each.topic, True) for each in told if each.node and each.publishes}
    for each in told:
        node = called.get(each.node, each.node)
        at = (each.topic, each.publishes)
        if (at in offered) if not node else ((*at, node) in known):
            continue
        ends.append(_End(node, *at, each.quality, each.span, each.node in called))


_RECORDED = "for t in $(ros2 topic list); do echo $t; ros2 topic info --verbose $t; done > qos.txt"


def _connected(ends: Sequence[_End]) -> Iterator[Diagnostic]:
    """Each publisher and subscriber of a topic, of which one at least is a node's of the contract, that DDS does not
    connect. A warning if one of them may not be there."""
    for heard in (end for end in ends if not end.publishes):
        for said in (end for end in ends if end.publishes and end.topic == heard.topic):
            wrong = list(unmet(said.quality, heard.quality))
            if not wrong or not (said.sure or heard.sure):
                continue
            one, other = (" and ".join(words) for words in zip(*wrong, strict=True))
            by = said.node or "its publisher"
            text = f"{heard.topic}: {by} offers {one} at {where(said.span)}, and {heard.node} requests {other}"
            severity = Severity.ERROR if said.sure and heard.sure else Severity.WARNING
            notes = ((f"{by} offers it here", said.span),)
            yield Diagnostic("ROS131", f"{text}: DDS does not connect them", heard.span, severity, _OFFER, notes)


_OFFER = "offer at least what is requested, or request no more than is offered"


def _timed(system: System, ends: Sequence[_End]) -> Iterator[Diagnostic]:
    """Steps that may be further apart than the deadline of a topic that they publish, and messages that are assumed
    sooner than a deadline demands them: that of a publisher, or what the node itself requests."""
    said = {entry.port: entry.assume_span for entry in system.plan.environment}
    assumed = environment_assumptions(system, dataflow(system))
    known = [(end, Fraction(str(end.quality.deadline))) for end in ends if end.quality.deadline not in (None, math.inf)]
    for node in system.contract.nodes:
        placed = system.plan.ros.names.placed(node.name)
        topics = {t.port.variable: placed.resolved(t.name) for t in node.topics if t.port is not None}
        written = [(clause.formula, clause.span) for clause in node.clauses]
        written += [(each.formula, said[each.port]) for each in assumed if each.node == node.name]
        own = {topic: True for port, topic in topics.items() if port.role is Role.OUTPUT}
        for port, limit, span in ((*found, span) for formula, span in written for found in _limits(formula)):
            for topic, speaks in own.items() if port is None else [(topics.get(port), False)]:
                every = [(end, least) for end, least in known if end.topic == topic]
                offers = [one for one in every if one[0].publishes and (not speaks or one[0].node in (node.name, ""))]
                asks = [one for one in every if not one[0].publishes and (speaks or one[0].node == node.name)]
                end, least = min(offers or asks, key=lambda one: one[1], default=(None, limit.number))
                if end is not None and (limit.number > least if speaks else limit.number < least):
                    does = "may leave {} without a message for" if speaks else "assumes a message on {} within"
                    text = f"{node.name} {does.format(topic)} {show_number(limit.number)[0]} s, and its deadline is"
                    notes = ((f"it is {'offered' if end.publishes else 'requested'} here", end.span),)
                    text += f" {show_number(least)[0]} s"
                    yield Diagnostic("ROS137", text, span, Severity.WARNING, "correct one of the times", notes)


def _limits(formula: Term) -> Iterator[tuple[Variable | None, Limit]]:
    """How far apart a formula allows steps (None) to be, and how soon it demands the messages of an input."""
    match formula:
        case And(items=items):
            for item in items:
                yield from _limits(item)
        case History(Past.STEPS, limit=limit) if limit:
            yield None, limit
        case History(Past.ONCE, (History(Past.ARRIVED, (Variable() as port,)),), limit=limit) if (
            limit and not limit.steps
        ):
            yield port, limit

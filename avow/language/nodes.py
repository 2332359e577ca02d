"""Node clauses: ports, topics, assumptions and guarantees, checked against the contract's environment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Span
from avow.base.suggestions import did_you_mean
from avow.language.checker import Checker
from avow.language.contract import Chance, Clause, ClauseKind, Node, Port, Topic
from avow.language.declarations import Declarations, no_units
from avow.language.definedness import with_value
from avow.language.flat import flat_text
from avow.language.lexer import Token, unquote
from avow.language.printer import show_type
from avow.language.scope import Defined, Scope
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort, Sort, StringSort
from avow.language.source import Reports
from avow.language.subterms import histories
from avow.language.syntax import ChanceSyntax, ClauseSyntax, NodeSyntax, PortDeclaration, RosType, SetType
from avow.language.terms import TRUE, Role
from avow.language.units import BASES, DERIVED, ONE_UNIT, clashes, unit
from avow.ros.calls import part_topic
from avow.ros.names import is_name

PARAMETER = "parameter"
ONE_VALUE = (BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort, StringSort)
"""The sorts of parameters."""
ROS_BUILTINS = (
    *("bool", "byte", "char", "string", "wstring", "time", "duration", "float32", "float64"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)


def check_ports(
    node: NodeSyntax, declarations: Declarations, reports: Reports
) -> tuple[dict[str, Port], dict[str, Port]]:
    """The node's inputs and outputs by name."""
    found: list[dict[str, Port]] = []
    for role, tree in ((Role.INPUT, node.inputs), (Role.OUTPUT, node.outputs)):
        ports: dict[str, Port] = {}
        for part in tree.items if tree is not None else ():
            name = part.name
            if name.text in ports:
                notes = ((f"`{name.text}` is first declared here", ports[name.text].span),)
                message = f"node `{node.name.text}` has two {'in' if role is Role.INPUT else 'out'}puts `{name.text}`"
                reports.error("RCL214", message, name.start, name.end, notes=notes)
                continue
            sort = declarations.type_of(part.type, reports, name.text)
            if sort is None:
                node.broken.add(name.text)
                continue
            written = flat_text(reports.source.text[part.type.start : part.type.end])
            type_name = show_type(sort) if isinstance(part.type, SetType) and not part.type.elements else written
            span = reports.source.span(name.start, name.end)
            measured = _unit(part, sort, reports)
            parameter = _is_parameter(part, sort, reports)
            ports[name.text] = Port(role, name.text, sort, type_name, span, parameter, unit=measured)
        found.append(ports)
    return found[0], found[1]


def _unit(part: PortDeclaration, sort: Sort, reports: Reports) -> str:
    """The unit of a port as text, if it has one; a wrong one is reported."""
    token = part.unit
    if token is None:
        return ""
    if not isinstance(sort, RealSort | IntegerSort | NaturalSort):
        no_units((part,), reports)
    elif unit(token.text) is None:
        hint = f"REP 103 has {', '.join((*BASES, *DERIVED))}, and these with `*` and `/`"
        reports.error("RCL222", f"`{token.text}` is no unit", token.start, token.end, hint=hint)
    else:
        return token.text
    return ""


def _is_parameter(part: PortDeclaration, sort: Sort, reports: Reports) -> bool:
    """Whether an input is declared as a parameter; other words before its name, and other types, are reported."""
    marker = part.marker
    if marker is None:
        return False
    if marker.text != PARAMETER:
        hint = f"an input with one value during a run is written `{PARAMETER} {part.name.text} : TYPE`"
        reports.error("RCL221", f"`{marker.text}` before an input means nothing", marker.start, marker.end, hint=hint)
    elif not isinstance(sort, ONE_VALUE):
        message = f"a parameter is a number, a truth value, a text or an element, and not {show_type(sort)}"
        reports.error("RCL221", message, part.type.start, part.type.end)
    return True


def check_node(
    node: NodeSyntax,
    inputs: Mapping[str, Port],
    outputs: Mapping[str, Port],
    declarations: Declarations,
    reports: Reports,
) -> Node:
    """The node with its sound clauses; errors in the others are reported."""
    broken = set(node.broken)
    scope = Scope(declarations.environment, inputs, outputs, broken=broken, node=node.name.text, remembers=True)
    topics = tuple(_topics(node, scope, reports))
    scope.defined = _definitions(node, scope, declarations, reports)
    clauses: dict[ClauseKind, list[Clause]] = {ClauseKind.ASSUMPTION: [], ClauseKind.GUARANTEE: []}
    counts = dict.fromkeys(ClauseKind, 0)
    seen: dict[str, Span] = {}
    for syntax in node.clauses:
        if reports.full:
            break
        counts[syntax.kind] += 1
        clause = _clause(syntax, counts[syntax.kind], scope, seen, reports)
        if clause is not None:
            clauses[syntax.kind].append(clause)
    if any(port.unit for port in (*inputs.values(), *outputs.values())):
        for clause in (c for some in clauses.values() for c in some):
            for clash in clashes(clause.written or clause.formula, lambda v: scope.ports(v.role)[v.name].unit):
                reports.add(Diagnostic("RCL223", clash.message, clash.span or clause.span, hint=ONE_UNIT))
    if any(histories(clause.formula) for some in clauses.values() for clause in some):  # of one step, it says nothing
        kept = (port.constancy for port in inputs.values() if port.parameter)
        clauses[ClauseKind.ASSUMPTION] += [c for c in kept if c.name not in seen]
    return Node(
        node.name.text,
        tuple(inputs.values()),
        tuple(outputs.values()),
        topics,
        tuple(clauses[ClauseKind.ASSUMPTION]),
        tuple(clauses[ClauseKind.GUARANTEE]),
        reports.source.span(node.name.start, node.name.end),
        definitions=tuple(entry.found for entry in scope.defined.values() if entry.found is not None),
    )


def _definitions(node: NodeSyntax, scope: Scope, declarations: Declarations, reports: Reports) -> Mapping[str, Defined]:
    """The definitions that the node's clauses may use: those of the context, checked on use, and its own."""
    found = {
        name: entry if entry.found is not None or entry.state == "done" else replace(entry, state="new")
        for name, entry in declarations.definitions.items()
    }
    for tree in node.definitions:
        name, taken = tree.name, scope.taken(tree.name.text)
        other = found.get(name.text)
        if other is not None:
            taken = ("a definition", other.place)
        if name.text in ("length", "indices"):
            reports.error("RCL209", f"`{name.text}` is built in", name.start, name.end)
            continue
        if taken is not None:
            notes = ((f"`{name.text}` is declared here", taken[1]),) if taken[1] is not None else ()
            reports.error("RCL210", f"`{name.text}` is already {taken[0]}", name.start, name.end, notes=notes)
            continue
        declarations.define(tree, reports, found, scope)
    checker = Checker(replace(scope, defined=found), reports)
    for tree in node.definitions:
        if tree.name.text in found:
            checker.definition(found[tree.name.text])
    return found


def _clause(
    syntax: ClauseSyntax, position: int, scope: Scope, seen: dict[str, Span], reports: Reports
) -> Clause | None:
    letter = "A" if syntax.kind is ClauseKind.ASSUMPTION else "G"
    name = syntax.name.text if syntax.name is not None else f"{letter}{position}"
    place = syntax.name or Token("", "", syntax.start, syntax.start + 1)
    span = reports.source.span(place.start, place.end)
    if name in seen:
        notes = ((f"`{name}` is first used here", seen[name]),)
        message = f"two clauses of node `{scope.node}` are called `{name}`"
        hint = None if syntax.name is not None else "a clause without a name is called A1, G2, … by its position"
        reports.error("RCL215", message, place.start, place.end, hint=hint, notes=notes)
    seen.setdefault(name, span)
    if syntax.formula is None:
        return None
    if syntax.chance is not None:
        return _with_chance(syntax, syntax.chance, name, position, scope, reports)
    formula = Checker(scope, reports).clause(syntax.formula)
    if formula is None:
        return None
    text = reports.source.text[slice(*syntax.inside)].strip()
    return Clause(syntax.kind, name, position, with_value(formula), *_quoted(syntax, text, reports), formula)


def _quoted(syntax: ClauseSyntax, text: str, reports: Reports) -> tuple[str | None, str, Span, Span | None]:
    """The sentence, text, span and sentence's span of a clause."""
    sentence, span = syntax.sentence, reports.source.span
    quoted = (unquote(sentence.text), span(sentence.start, sentence.end)) if sentence is not None else (None, None)
    return quoted[0], text, span(syntax.start, syntax.end), quoted[1]


def _with_chance(
    syntax: ClauseSyntax, chance: ChanceSyntax, name: str, position: int, scope: Scope, reports: Reports
) -> Clause | None:
    """A guarantee with a probability, which is about single steps."""
    fault = _no_probability(syntax.kind, chance.least.text)
    if chance.per_run and chance.given is not None:
        fault = ("a probability per run has no `given`: it counts every run", "write `per run ( F -> G )`")
    if fault:
        message, hint = fault
        reports.error("RCL224", message, chance.start, chance.end, hint=hint)
    checker = Checker(replace(scope, remembers=False), reports)
    assert syntax.formula is not None
    given = TRUE if chance.given is None else checker.formula(chance.given)
    claim = checker.formula(syntax.formula)
    if fault or given is None or claim is None:
        return None
    text = f"{reports.source.text[chance.start : chance.end]} ( {reports.source.text[slice(*syntax.inside)].strip()} )"
    least, written = Fraction(chance.least.text), Chance(Fraction(chance.least.text), claim, given).always
    made = Chance(least, with_value(claim), with_value(given), chance.per_run)
    return Clause(syntax.kind, name, position, TRUE, *_quoted(syntax, text, reports), written, made)


def _no_probability(kind: ClauseKind, text: str) -> tuple[str, str] | None:
    """What is wrong with a bound, and a hint; None if nothing is."""
    if kind is ClauseKind.ASSUMPTION:
        return "an assumption has no probability", "assume what always holds; guarantees may have a probability"
    least = Fraction(text)
    if least > 1:
        return f"{text} is no probability", "write a number between 0 and 1"
    if least == 1:
        return "probability 1 says that the guarantee always holds", "leave `with probability >= 1` out"
    if least == 0:
        return "probability 0 demands nothing", "write a number between 0 and 1, or leave the guarantee out"
    return None


def _topics(node: NodeSyntax, scope: Scope, reports: Reports) -> Iterable[Topic]:
    """The topics. A topic may be listed several times, each time with a variable: its messages carry them all, each in
    its own fields."""
    seen: dict[str, list[Topic]] = {}
    for tree in node.topics.items if node.topics is not None else ():
        name = tree.name
        _check_ros_type(tree.type, reports)
        if not is_name(name.text.replace("'", "")):
            hint = "letters, digits and _, set apart by single slashes, with / or ~ before it"
            reports.error("RCL217", f"`{name.text}` is no name of a topic", name.start, name.end, hint=hint)
        port = _matched(tree.role, tree.port, scope, reports) if tree.port is not None else None
        if tree.port is not None and port is None:
            continue
        span, frame = reports.source.span(tree.start, tree.end), tree.frame.text if tree.frame is not None else ""
        topic = Topic("/".join(part.text for part in tree.type.names), name.text, port, span, frame)
        earlier = seen.setdefault(part_topic(name.text, topic.ros_type), [])  # a service has two types: its parts
        if _goes_with(topic, earlier, name, reports):
            earlier.append(topic)
            yield topic


def _goes_with(topic: Topic, earlier: Sequence[Topic], name: Token, reports: Reports) -> bool:
    """Whether a topic may be listed in addition to the earlier entries; reports it if not."""
    other = next((t for t in earlier if _same(t) != _same(topic) or t.port in (None, topic.port)), None)
    other = other or (earlier[0] if earlier and topic.port is None else None)
    if other is None:
        return True
    types = f", as {other.kind} and as {topic.kind}" if _same(other) != _same(topic) else ""
    message = f"the topic `{topic.name}` is listed twice{types}"
    hint = "list a topic once, or once for each variable with `matches(…)`"
    hint = "correct one of them: a topic has one type and one frame" if types else hint
    notes = ((f"`{topic.name}` is first listed here", other.span),)
    reports.error("RCL216", message, name.start, name.end, hint=hint, notes=notes)
    return False


def _same(topic: Topic) -> tuple[str, ...]:
    """A topic's frame, and its type in a form common to ROS 1 and 2: ``package/msg/Type`` is ``package/Type``."""
    parts = topic.ros_type.split("/")
    return (topic.frame, parts[0], parts[-1], *(p for p in parts[1:-1] if p != "msg"))


def _check_ros_type(tree: RosType, reports: Reports) -> None:
    parts = [part.text for part in tree.names]
    shown = "/".join(parts)
    if len(parts) == 1 and parts[0] not in ROS_BUILTINS:
        hint = did_you_mean(shown, ROS_BUILTINS) or f"write the package before it: `package/{shown}`"
        reports.error("RCL217", f"ROS has no built-in type `{shown}`", tree.start, tree.end, hint=hint)
    elif len(parts) > 3 or (len(parts) == 3 and parts[1] not in ("msg", "srv", "action")):
        hint = "a type of a package is written `package/Type` or `package/msg/Type`"
        reports.error("RCL217", f"`{shown}` is not a ROS type", tree.start, tree.end, hint=hint)


def _matched(role_text: str | None, name: Token, scope: Scope, reports: Reports) -> Port | None:
    text = name.text
    roles = [Role(role_text)] if role_text else [Role.INPUT, Role.OUTPUT]
    candidates = [scope.ports(r)[text] for r in roles if text in scope.ports(r)]
    if len(candidates) == 1 and candidates[0].parameter:
        message = f"`{text}` is a parameter: no topic carries it"
        reports.error("RCL218", message, name.start, name.end, hint="leave the topic out, or make it a plain input")
        return None
    if len(candidates) == 1:
        return candidates[0]
    if scope.is_broken(text):
        return None
    if candidates:
        hint: str | None = f"write `matches(in.{text})` or `matches(out.{text})`"
        message = f"`{text}` is both an input and an output of node `{scope.node}`"
        reports.error("RCL202", message, name.start, name.end, hint=hint)
        return None
    other = next((r for r in Role if r not in roles and r is not Role.BOUND and text in scope.ports(r)), None)
    if other is not None:
        hint = f"write `matches({other}.{text})`"
    else:
        hint = did_you_mean(text, (*scope.inputs, *scope.outputs))
    what = {"in": "input", "out": "output", None: "input or output"}[role_text]
    message = f"{scope.named} has no {what} `{text}` for this topic to match"
    reports.error("RCL218", message, name.start, name.end, hint=hint)
    return None

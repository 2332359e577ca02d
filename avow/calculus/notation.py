"""Derivations as the paper writes them: premises, linking equations, side conditions, a line, the conclusion.

Names come from contracts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from avow.base.records import dataclass
from avow.base.tuning.shown import RULE_NODES
from avow.base.verdict import Verdict
from avow.calculus.derivation import Derivation, Goal, Rule, Settled, SideCondition
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.system.plan import Edge


@dataclass(frozen=True, slots=True)
class Line:
    """One line of a derivation. `remark` is prose."""

    parts: tuple[str, ...]
    remark: str = ""


@dataclass(frozen=True, slots=True)
class Lines:
    """One rule instance as it is written."""

    rule: str
    name: str
    above: tuple[Line, ...]
    below: tuple[Line, ...]
    hypotheses: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Condition:
    """A side condition in words, with the local id of the obligation that settles it."""

    text: str
    obligation: str


@dataclass(frozen=True, slots=True)
class Written:
    """A derivation, ready to be shown: the whole of it (`name` is the goal's) or one instance within it."""

    name: str
    rule: str
    text: str
    conclusion: str
    premises: tuple[str, ...]
    """Nodes, or names of other derivations of this system."""
    side_conditions: tuple[Condition, ...]
    conditional: tuple[str, ...]
    """Hypotheses of the conclusion: local ids of obligations if there are any, otherwise prose."""
    findings: tuple[str, ...] = ()


def write_goal(goal: Goal, settled: Mapping[SideCondition, Settled] | None = None) -> Written:
    """A goal's derivation with all its rule instances, innermost first."""
    instances = [part for part in goal.root.walk() if part.rule is not Rule.PREMISE]
    names = {id(part): f"{goal.name}.{number}" for number, part in enumerate(instances[:-1], start=1)}
    if instances:
        names[id(instances[-1])] = goal.name
    inner = frozenset(part.name for part in goal.within)
    written = [_lines(part, names, settled or {}, inner) for part in instances or [goal.root]]
    conclusion = _conclusion(goal.root)
    conditions = tuple(
        Condition(_condition_text(condition), f"{SYSTEM_LEVEL}/{Kind.COMPOSITION}/{goal.name}.{condition.about}")
        for condition in goal.conditions
    )
    conditional: list[str] = []
    prefix = f"{SYSTEM_LEVEL}/{Kind.COMPOSITION}"
    for part in reversed(goal.inner_first()):  # a hypothesis of an inner derivation is one of the outer
        if part.needs_persistence:
            conditional += [f"{prefix}/{part.name}.persistence", f"{prefix}/{part.name}.one-output"]
    conditional += [f"assumed: {name}" for name in goal.root.assumed]
    return Written(
        goal.name,
        goal.root.rule.value,
        "\n\n".join([*map(_as_text, written), *_joined(goal.contract)]),
        _plain(conclusion.parts),
        tuple(dict.fromkeys(node for part in goal.root.walk() if part.rule is Rule.PREMISE for node in part.nodes)),
        conditions,
        tuple(conditional),
        tuple(finding.message for finding in goal.findings),
    )


# -- lines -------------------------------------------------------------------------------------------------------------


def _joined(lines: tuple[str, ...]) -> tuple[str, ...]:
    return ("\n".join(lines),) if lines else ()


def _lines(
    part: Derivation, names: Mapping[int, str], settled: Mapping[SideCondition, Settled], inner: frozenset[str]
) -> Lines:
    above: list[Line] = []
    for child in _shortened(part.children):
        if child is None:
            above.append(Line(("…",)))
        elif child.rule is Rule.PREMISE:
            above.append(_contract(child.nodes[0], "derived" if child.nodes[0] in inner else ""))
            above += _condition_lines(child, settled)

        else:
            conclusion = _conclusion(child)
            above.append(Line(conclusion.parts, f"by {child.rule} ({names.get(id(child), '')})"))
    above += _linking(part)
    above += _condition_lines(part, settled)
    kept = _conclusion(part)
    return Lines(part.rule.value, names.get(id(part), ""), tuple(above), (kept,), part.hypotheses)


def _shortened(children: tuple[Derivation, ...]) -> Iterator[Derivation | None]:
    if len(children) <= RULE_NODES:
        yield from children
        return
    yield from children[:3]
    yield None
    yield from children[-3:]


def _contract(node: str, remark: str = "") -> Line:
    i, o = _symbol("i", node), _symbol("o", node)
    return Line(("∀", i, ",", o, "·", *_applied("𝒜", node), "⇒", "◇", *_applied("𝒢", node)), remark)


def _symbol(kind: str, node: str) -> str:
    """``𝒢_navigation``, ``o_navigation``; `kind` is 𝒜, 𝒢, i or o."""
    return node if node == "…" else f"{kind}_{node}"


def _applied(kind: str, node: str) -> tuple[str, ...]:
    return _symbol(kind, node), "(", _symbol("i" if kind == "𝒜" else "o", node), ")"


def _linking(part: Derivation) -> Iterator[Line]:
    """``i_A = o_N ∪ o_R``, one line for each consumer; remarks give what the paper leaves out."""
    by_consumer: dict[str, list[Edge]] = {}
    for edge in part.linking:
        by_consumer.setdefault(edge.target.node, []).append(edge)
    for number, (consumer, edges) in enumerate(by_consumer.items()):
        if number >= RULE_NODES:
            yield Line(("…",))
            return
        parts: list[str] = [_symbol("i", consumer), "="]
        for k, provider in enumerate(dict.fromkeys(edge.source.node for edge in edges)):
            parts += ["∪", _symbol("o", provider)] if k else [_symbol("o", provider)]
        outside = [text for text in part.outside if text.startswith(f"{consumer}.")]
        remarks = [f"{edge.source} one step before" for edge in edges if edge.delayed]
        remarks += [f"up to {text}" for text in outside]
        yield Line(tuple(parts), "; ".join(remarks))


def _condition_lines(part: Derivation, settled: Mapping[SideCondition, Settled]) -> Iterator[Line]:
    """One line for each consumer, as in the paper; remarks say what each of its assumptions follows from."""
    consumers = tuple(dict.fromkeys(condition.consumer for condition in part.side_conditions))
    for number, consumer in enumerate(consumers):
        if number >= RULE_NODES:
            yield Line(("…",))
            return
        conditions = [condition for condition in part.side_conditions if condition.consumer == consumer]
        parts: list[str] = ["⊢", "("]
        for k, provider in enumerate(dict.fromkeys(e.source.node for e in part.linking if e.target.node == consumer)):
            parts += ["∧", *_applied("𝒢", provider)] if k else list(_applied("𝒢", provider))
        parts += [*["⊤"] * (len(parts) == 2), "⇒", *_applied("𝒜", consumer), ")"]
        yield Line(tuple(parts), "; ".join(_condition_remark(c, settled.get(c)) for c in conditions))


def _condition_remark(condition: SideCondition, settled: Settled | None) -> str:
    if settled is None:
        given = [*condition.providers, *(f"environment {port}" for port in condition.environment)]
        return f"{condition.clause} from {', '.join(given) or 'the types'}"
    if settled.verdict is not Verdict.PROVED:
        return f"{condition.clause} {settled.verdict}"
    needed = f"from {', '.join(settled.needed)}" if settled.needed else "by the types"
    return f"{condition.clause} {needed}" + (": no guarantee carries it" if settled.trivial else "")


def _condition_text(condition: SideCondition) -> str:
    given = " ∧ ".join(f"𝒢_{provider}" for provider in condition.providers) or "⊤"
    assumed = "".join(f" ∧ environment {port}" for port in condition.environment)
    return f"{given}{assumed} ⇒ {condition.about}"


def _conclusion(part: Derivation) -> Line:
    assumed = tuple(dict.fromkeys(name.node for name in part.assumed))
    parts: list[str] = ["∀"]
    for node in _few(assumed):
        parts += [_symbol("i", node), ","]
    for node in _few(part.guaranteed):
        parts += [_symbol("o", node), ","]
    parts[-1] = "·"
    for k, node in enumerate(_few(assumed)):
        parts += ["∧", *_applied("𝒜", node)] if k else list(_applied("𝒜", node))
    parts += ["⇒"] if assumed else ["⊤", "⇒"]
    for k, node in enumerate(_few(part.guaranteed)):
        parts += ["∧", "◇", *_applied("𝒢", node)] if k else ["◇", *_applied("𝒢", node)]
    clauses = [str(name) for name in part.assumed]
    shown = ", ".join(clauses) if len(clauses) <= 8 else f"{', '.join(clauses[:8])}, … ({len(clauses)} in all)"
    return Line(tuple(parts), f"assuming {shown}" if clauses else "")


def _few(nodes: tuple[str, ...]) -> tuple[str, ...]:
    return nodes if len(nodes) <= 12 else (*nodes[:6], "…", *nodes[-2:])


# -- printers ----------------------------------------------------------------------------------------------------------

_SPACED = ("⇒", "∧", "∪", "=", "⊆")


def _plain(parts: tuple[str, ...]) -> str:
    text = ""
    for part in parts:
        if part in _SPACED:
            text += f" {part} "
        elif part in (",", "·"):
            text += ", " if part == "," else " · "
        elif part in ("⊢", "∀"):
            text += f"{part} "
        else:
            text += part
    return text


def _as_text(lines: Lines) -> str:
    """Unicode text for a terminal or a fixed-width font."""
    above = [_remarked(_plain(line.parts), line.remark) for line in lines.above]
    below = [_remarked(_plain(line.parts), line.remark) for line in lines.below]
    width = min(100, max((len(line) for line in [*above, *below]), default=10))
    title = f"{lines.rule} ({lines.name})" if lines.name else lines.rule
    provided = [f"  provided that {hypothesis}" for hypothesis in lines.hypotheses]
    return "\n".join([title, *above, "─" * width, *below, *provided])


def _remarked(text: str, remark: str) -> str:
    return f"{text}    [{remark}]" if remark else text

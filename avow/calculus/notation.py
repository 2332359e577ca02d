"""Derivations as the paper writes them: premises, linking equations, side conditions, a line, the conclusion.

Names come from contracts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from avow.base.records import dataclass
from avow.base.tuning.shown import RULE_NODES
from avow.base.verdict import Verdict
from avow.calculus.derivation import Derivation, Goal, Rule, Settled, SideCondition
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.system.plan import Edge


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
    written = [_as_text(part, names, settled or {}, inner) for part in instances or [goal.root]]
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
        "\n\n".join([*written, *(["\n".join(goal.contract)] if goal.contract else [])]),
        _conclusion(goal.root),
        tuple(dict.fromkeys(node for part in goal.root.walk() if part.rule is Rule.PREMISE for node in part.nodes)),
        conditions,
        tuple(conditional),
        tuple(finding.message for finding in goal.findings),
    )


def _as_text(
    part: Derivation, names: Mapping[int, str], settled: Mapping[SideCondition, Settled], inner: frozenset[str]
) -> str:
    """One rule instance, in Unicode for a terminal or a fixed-width font."""
    above: list[str] = []
    for child in _shortened(part.children):
        if child is None:
            above.append("…")
        elif child.rule is Rule.PREMISE:
            node = child.nodes[0]
            above.append(_remarked(_implication((node,), (node,)), ["derived"] if node in inner else []))
            above += _condition_lines(child, settled)
        else:
            above.append(_remarked(_conclusion(child), [f"by {child.rule} ({names.get(id(child), '')})"]))
    above += _linking(part)
    above += _condition_lines(part, settled)
    clauses = [str(name) for name in part.assumed]
    shown = ", ".join(clauses) if len(clauses) <= 8 else f"{', '.join(clauses[:8])}, … ({len(clauses)} in all)"
    below = _remarked(_conclusion(part), [f"assuming {shown}"] if clauses else [])
    width = min(100, max(map(len, [*above, below])))
    title = f"{part.rule} ({names[id(part)]})" if id(part) in names else part.rule.value
    return "\n".join([title, *above, "─" * width, below, *(f"  provided that {h}" for h in part.hypotheses)])


def _remarked(text: str, remarks: Iterable[str]) -> str:
    remark = "; ".join(remarks)
    return f"{text}    [{remark}]" if remark else text


def _shortened(children: tuple[Derivation, ...]) -> Iterator[Derivation | None]:
    if len(children) <= RULE_NODES:
        yield from children
        return
    yield from children[:3]
    yield None
    yield from children[-3:]


def _symbol(kind: str, node: str) -> str:
    """``𝒢_navigation``, ``o_navigation``; `kind` is 𝒜, 𝒢, i or o."""
    return node if node == "…" else f"{kind}_{node}"


def _assumed(nodes: Iterable[str]) -> str:
    return " ∧ ".join(f"{_symbol('𝒜', node)}({_symbol('i', node)})" for node in nodes) or "⊤"


def _guaranteed(nodes: Iterable[str], sign: str = "◇") -> str:
    return " ∧ ".join(f"{sign}{_symbol('𝒢', node)}({_symbol('o', node)})" for node in nodes) or "⊤"


def _linking(part: Derivation) -> Iterator[str]:
    """``i_A = o_N ∪ o_R``, one line for each consumer; remarks give what the paper leaves out."""
    by_consumer: dict[str, list[Edge]] = {}
    for edge in part.linking:
        by_consumer.setdefault(edge.target.node, []).append(edge)
    for number, (consumer, edges) in enumerate(by_consumer.items()):
        if number >= RULE_NODES:
            yield "…"
            return
        outputs = " ∪ ".join(_symbol("o", provider) for provider in dict.fromkeys(edge.source.node for edge in edges))
        remarks = [f"{edge.source} one step before" for edge in edges if edge.delayed]
        remarks += [f"up to {text}" for text in part.outside if text.startswith(f"{consumer}.")]
        yield _remarked(f"{_symbol('i', consumer)} = {outputs}", remarks)


def _condition_lines(part: Derivation, settled: Mapping[SideCondition, Settled]) -> Iterator[str]:
    """One line for each consumer, as in the paper; remarks say what each of its assumptions follows from."""
    consumers = tuple(dict.fromkeys(condition.consumer for condition in part.side_conditions))
    for number, consumer in enumerate(consumers):
        if number >= RULE_NODES:
            yield "…"
            return
        conditions = [condition for condition in part.side_conditions if condition.consumer == consumer]
        providers = dict.fromkeys(e.source.node for e in part.linking if e.target.node == consumer)
        text = f"⊢ ({_guaranteed(providers, '')} ⇒ {_assumed((consumer,))})"
        yield _remarked(text, (_condition_remark(c, settled.get(c)) for c in conditions))


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


def _conclusion(part: Derivation) -> str:
    return _implication(_few(tuple(dict.fromkeys(name.node for name in part.assumed))), _few(part.guaranteed))


def _implication(assumed: tuple[str, ...], guaranteed: tuple[str, ...]) -> str:
    symbols = [*(_symbol("i", node) for node in assumed), *(_symbol("o", node) for node in guaranteed)]
    return f"∀ {', '.join(symbols)} · {_assumed(assumed)} ⇒ {_guaranteed(guaranteed)}"


def _few(nodes: tuple[str, ...]) -> tuple[str, ...]:
    return nodes if len(nodes) <= 12 else (*nodes[:6], "…", *nodes[-2:])

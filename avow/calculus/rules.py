"""Finds the rule instances of a selection of nodes (or of the whole system) in the graph and nests them. Pure.

Strongly connected components are loops (R4). Between them the graph is acyclic and is walked from providers to
consumers: one provider makes a sequence (R1), several make a union (R3), and a sole provider of several consumers makes
a branching (R2). Shared parts are shared in the tree, so that it is no larger than the graph.

All four are one instance of the theorem, `Nodes` in proofs/instances.dfy: nodes in causal order (R1 to R3), for a loop
also from the step before (R4). Persistence and one output are `Latched` there: they make a wire an equation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field, replace
from typing import assert_never

from avow.base.diagnostics import Diagnostic
from avow.base.graphs import components
from avow.base.records import dataclass
from avow.calculus.derivation import ClauseName, Derivation, Goal, Rule, SideCondition
from avow.calculus.variables import Frame
from avow.language.contract import Clause
from avow.language.terms import Role
from avow.system.plan import ComposeGoal, Edge, Endpoint

WHOLE = "whole"
"""The name of the derivation over every node."""

PERSISTENCE = "the outputs of {} persist once generated, until they are used together"
ONE_OUTPUT = "{} give at most one output element for each input element"


def derive(frame: Frame, goal: ComposeGoal | None = None, *, carry: bool = False, name: str = WHOLE) -> Goal:
    """The derivation for a goal of the plan; without a goal, the derivation of the whole system.

    `carry`: an assumption that mentions anything from outside the selection stays assumed in the conclusion, for a
    larger derivation to show; otherwise one that also mentions something from inside has to be shown here.
    """
    names = goal.select if goal is not None and goal.select else frame.graph.nodes
    builder = _Builder(frame, tuple(names), carry)
    name = goal.name if goal is not None else name
    root: Derivation | None = None
    findings: list[Diagnostic] = []
    if goal is not None and goal.rule is not None:
        root = builder.as_asked(Rule(goal.rule))
        if root is None:
            where = f"{'subsystems' if carry else 'compose'}.{name}"
            message = f"{where}: {goal.rule} does not fit {', '.join(names)}: {_WANTED[Rule(goal.rule)]}"
            findings.append(Diagnostic("PLAN125", message, goal.options.at("rule"), hint="leave the rule to Avow"))
    root = root or builder.found()
    return Goal(name, tuple(names), replace(root, name=name), tuple(findings))


_WANTED = {
    Rule.R1: "each node must feed the next",
    Rule.R2: "one node must feed all others",
    Rule.R3: "all others must feed one node",
    Rule.R4: "some of the nodes must form a loop",
}


@dataclass(slots=True)
class _Builder:
    frame: Frame
    nodes: tuple[str, ...]
    carry: bool = False
    selected: frozenset[str] = field(init=False)

    def __post_init__(self) -> None:
        self.selected = frozenset(self.nodes)

    # -- facts about the selection -------------------------------------------------------------------------------------

    def edges_into(self, node: str, providers: Iterable[str] | None = None) -> tuple[Edge, ...]:
        wanted = self.selected if providers is None else frozenset(providers)
        return tuple(e for e in self.frame.graph.feeding(node) if e.source.node in wanted)

    def providers(self, node: str) -> tuple[str, ...]:
        """The other selected nodes that feed a node."""
        return tuple(dict.fromkeys(e.source.node for e in self.edges_into(node) if e.source.node != node))

    def outside(self, node: str, providers: Iterable[str]) -> tuple[str, ...]:
        """Inputs of a node that the providers do not feed, each with its source."""
        given = frozenset(providers)
        found: list[str] = []
        of = self.frame.system.contract if node in self.frame.cells else self.frame
        for port in of.node(node).inputs:
            edge = self.frame.graph.by_target.get(Endpoint(node, port.name))
            if edge is None:
                found.append(f"{node}.{port.name} (environment)")
            elif edge.source.node not in given:
                found.append(f"{node}.{port.name} ({edge.source}{', delayed' if edge.delayed else ''})")
        return tuple(found)

    def conditions(
        self, node: str, providers: Sequence[str]
    ) -> tuple[tuple[SideCondition, ...], tuple[ClauseName, ...]]:
        """The side conditions of a consumer, and those of its assumptions that stay assumed in the conclusion."""
        given = frozenset(providers) | self.selected  # for every rule: all nodes that feed it
        conditions: list[SideCondition] = []
        kept: list[ClauseName] = []
        for clause in self.frame.node(node).assumptions:
            sources = self.sources(node, clause)
            edges = [edge for _, edge in sources if edge is not None and edge.source.node in given]
            environment = self.environment(node, [port for port, edge in sources if edge is None])
            beyond = [edge for _, edge in sources if edge is not None and edge.source.node not in self.selected]
            outside = environment and all(edge is None for _, edge in sources)
            if (self.carry and beyond) or (sources and not edges and not outside):
                kept.append(ClauseName(node, clause.name))
                continue
            direct = tuple(dict.fromkeys(edge.source.node for edge in edges))
            delayed = any(edge.delayed for edge in edges)
            conditions.append(SideCondition(node, clause.name, direct, delayed, environment))
        return tuple(conditions), tuple(kept)

    def sources(self, node: str, clause: Clause) -> list[tuple[str, Edge | None]]:
        """The inputs that a clause mentions, and the edge that feeds each (None: the environment). Earlier values come
        over a delayed edge, including earlier values of the node's own outputs."""
        found: list[tuple[str, Edge | None]] = []
        for port, remembered in self.frame.behind(node, clause.formula):
            at = Endpoint(node, port.name)
            if port.role is Role.INPUT:
                edge = self.frame.graph.by_target.get(at)
                found.append((port.name, replace(edge, delayed=True) if edge is not None and remembered else edge))
            elif remembered:
                found.append((port.name, Edge(at, at, delayed=True, implied=True)))
        return found

    def environment(self, node: str, ports: Sequence[str]) -> tuple[str, ...]:
        """The plan's assumptions on some environment inputs of a node."""
        names = {self.frame.entry(node, port) for port in ports}
        return tuple(a.port for a in self.frame.assumed if a.port in names)

    # -- instances -----------------------------------------------------------------------------------------------------

    def premise(self, node: str) -> Derivation:
        assumed = tuple(ClauseName(node, clause.name) for clause in self.frame.node(node).assumptions)
        return Derivation(Rule.PREMISE, (node,), assumed=assumed, guaranteed=(node,))

    def rooted(self, node: str) -> Derivation:
        """A node that no selected node feeds: assumptions that follow from the plan's environment are shown."""
        conditions, kept = self.conditions(node, ())
        return Derivation(
            Rule.PREMISE,
            (node,),
            outside=self.outside(node, ()),
            side_conditions=conditions,
            assumed=kept,
            guaranteed=(node,),
        )

    def instance(
        self,
        rule: Rule,
        nodes: Sequence[str],
        before: Sequence[Derivation],
        consumers: Sequence[str],
        givers: Sequence[str],
        hypotheses: tuple[str, ...] = (),
        entries: Sequence[str] = (),
    ) -> Derivation:
        """A rule instance that adds the consumers, each fed by the givers, to the earlier derivations."""
        parts = [self.conditions(node, givers) for node in consumers]
        return Derivation(
            rule,
            tuple(nodes),
            tuple(e for node in consumers for e in self.edges_into(node, givers)),
            tuple(o for node in consumers for o in self.outside(node, givers)),
            tuple(c for conditions, _ in parts for c in conditions),
            hypotheses,
            _union([*(part.assumed for part in before), *(kept for _, kept in parts)]),
            tuple(consumers),
            (*before, *(self.premise(node) for node in consumers)),
            entries=tuple(entries),
        )

    def sequence(self, before: Derivation, provider: str, node: str) -> Derivation:
        """R1: one more node at the end of a sequence, or a sequence of two."""
        found = self.instance(Rule.R1, (provider, node), (before,), (node,), (provider,))
        if before.rule is not Rule.R1 or before.nodes[-1] != provider:
            return found
        return replace(
            found,
            nodes=(*before.nodes, node),
            linking=before.linking + found.linking,
            outside=before.outside + found.outside,
            side_conditions=before.side_conditions + found.side_conditions,
            children=(*before.children, *found.children[1:]),
        )

    def branching(self, before: Derivation, root: str, leaves: Sequence[str]) -> Derivation:
        return self.instance(Rule.R2, (root, *leaves), (before,), leaves, (root,))

    def union(self, before: Sequence[Derivation], sources: Sequence[str], sink: str) -> Derivation:
        together = (PERSISTENCE.format(_listed(sources)), ONE_OUTPUT.format(_listed((*sources, sink))))
        return self.instance(Rule.R3, (*sources, sink), before, (sink,), sources, together)

    def loop(self, before: Sequence[Derivation], members: Sequence[str], entries: Sequence[str]) -> Derivation:
        givers = (*entries, *members)
        together = (PERSISTENCE.format(_listed(givers)), ONE_OUTPUT.format(_listed(givers)))
        return self.instance(Rule.R4, members, before, members, givers, together, entries)

    # -- as the plan asks ----------------------------------------------------------------------------------------------

    def as_asked(self, rule: Rule) -> Derivation | None:
        """One instance of the rule over all selected nodes, or None if it does not fit."""
        if len(self.nodes) < 2 and rule is not Rule.R4:
            return None
        match rule:
            case Rule.R1:
                if not all(
                    one in self.providers(other) for one, other in zip(self.nodes, self.nodes[1:], strict=False)
                ):
                    return None
                found = self.premise(self.nodes[0])
                for one, other in zip(self.nodes, self.nodes[1:], strict=False):
                    found = self.sequence(found, one, other)
                return found
            case Rule.R2:
                for root in self.nodes:
                    leaves = [node for node in self.nodes if node != root]
                    if all(root in self.providers(leaf) for leaf in leaves):
                        return self.branching(self.premise(root), root, leaves)
                return None
            case Rule.R3:
                # The last one named is the paper's node n; if it does not fit, any node that does.
                for sink in reversed(self.nodes):
                    sources = [node for node in self.nodes if node != sink]
                    if all(source in self.providers(sink) for source in sources):
                        return self.union([self.premise(source) for source in sources], sources, sink)
                return None
            case Rule.R4 | Rule.PREMISE | Rule.ALL:  # a plan can only name R4 of these
                whole = self.found()
                return whole if any(part.rule is Rule.R4 for part in whole.walk()) else None
            case _:
                assert_never(rule)

    # -- as it is found ------------------------------------------------------------------------------------------------

    def found(self) -> Derivation:
        arcs = [(e.source.node, node) for node in self.nodes for e in self.edges_into(node)]
        groups = components(self.nodes, arcs)
        home = {node: group for group in groups for node in group}
        made: dict[str, Derivation] = {}
        for group in groups:
            if group[0] in made:
                continue  # a leaf of an earlier branching
            entries = tuple(dict.fromkeys(p for node in group for p in self.providers(node) if home[p] != group))
            before = _distinct(made[entry] for entry in entries)
            if len(group) > 1 or self.depends_on_itself(group[0]):
                whole = self.loop(before, group, entries)
                made.update(dict.fromkeys(group, whole))
            elif not entries:
                made[group[0]] = self.rooted(group[0])
            elif len(entries) == 1:
                leaves = self.leaves(entries[0], home)
                if len(leaves) > 1:
                    made.update(dict.fromkeys(leaves, self.branching(before[0], entries[0], leaves)))
                else:
                    made[group[0]] = self.sequence(before[0], entries[0], group[0])
            else:
                made[group[0]] = self.union(before, entries, group[0])
        fed = {source for source, target in arcs if home[source] != home[target]}
        used = _distinct(made[source] for source in fed)
        last = _distinct(made[node] for group in groups for node in group if node not in fed)
        ends = [d for d in last if not any(d is u for u in used) or d.rule is Rule.R2] or last
        if len(ends) == 1:
            return ends[0]
        return Derivation(
            Rule.ALL,
            tuple(dict.fromkeys(node for end in ends for node in end.nodes)),
            assumed=_union(end.assumed for end in ends),
            guaranteed=tuple(dict.fromkeys(node for end in ends for node in end.guaranteed)),
            children=tuple(ends),
        )

    def leaves(self, root: str, home: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
        """The nodes whose only provider is `root` and that are not in loops."""
        return tuple(
            node
            for node in self.frame.graph.consumers(root)
            if node in self.selected
            and node != root
            and len(home[node]) == 1
            and self.providers(node) == (root,)
            and not self.depends_on_itself(node)
        )

    def depends_on_itself(self, node: str) -> bool:
        """Whether an assumption of the node mentions an input that the node itself feeds."""
        return any(
            edge is not None and edge.source.node == node
            for clause in self.frame.node(node).assumptions
            for _, edge in self.sources(node, clause)
        )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)


def _union(parts: Iterable[tuple[ClauseName, ...]]) -> tuple[ClauseName, ...]:
    return tuple(dict.fromkeys(name for part in parts for name in part))


def _distinct(parts: Iterable[Derivation]) -> list[Derivation]:
    """Each derivation once, by identity: comparing shared parts by value would walk them."""
    seen: dict[int, Derivation] = {}
    for part in parts:
        seen.setdefault(id(part), part)
    return list(seen.values())

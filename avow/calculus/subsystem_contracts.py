"""Subsystems as nodes of the calculus: their contracts are derived, and larger derivations use them like any node's.

A clause of a subsystem is a clause of a node inside, over the same variables, so that nothing is lost or renamed. The
subsystem guarantees everything that its nodes guarantee, and assumes what its own derivation leaves assumed: what its
nodes assume about values from outside. If such an assumption also mentions values from inside, the guarantees of the
nodes that produce them may be used at that step; it is carried outward as an implication from them.

This is sound: outside, a subsystem's assumptions are shown at a step before its guarantees are used there (a loop that
only closes outside is a loop of the larger derivation, and circular support in it is refused). Inside, its own
derivation shows from them, step by step, every assumption that is not carried; then all its nodes' guarantees hold. The
theorem is `Derived` in proofs/instances.dfy; the kernel's certificates are about the nodes inside, without subsystems.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace

from avow.base.records import dataclass
from avow.calculus.derivation import ClauseName, Goal
from avow.calculus.rules import PERSISTENCE
from avow.calculus.variables import Frame, bearing
from avow.formulas.formula import conjunction, free_variables, substitute
from avow.formulas.temporal.cell import CELL
from avow.language.contract import Clause, ClauseKind, Node, Port
from avow.language.printer import show_term
from avow.language.subterms import ports_of
from avow.language.terms import Implies, Role, Term, Variable
from avow.system.folding import Face, Folded
from avow.system.plan import Endpoint


@dataclass(slots=True)
class Level(Frame):
    """A system in which some subsystems are nodes; the variables are those of the whole system's nodes (`flat`)."""

    flat: Frame = field(kw_only=True)
    faces: Mapping[str, Face] = field(kw_only=True)

    def output(self, node: str, port: str, earlier: int = 0) -> Variable:
        at = self.meant(node, port)
        return self.flat.output(at.node, at.port, earlier)

    def input(self, node: str, port: str, earlier: int = 0) -> Variable:
        at = self.meant(node, port)
        return self.flat.input(at.node, at.port, earlier)

    def entry(self, node: str, port: str) -> str:
        at = self.meant(node, port)
        return self.flat.entry(at.node, at.port)

    def environment(self, earlier: int = 0) -> dict[str, Term]:
        return self.flat.environment(earlier)

    def memory(self, earlier: int = 0, of: str = "") -> dict[str, Term]:
        return self.flat.memory(earlier, of)

    def blank(self, of: str = "") -> dict[str, Term]:
        return self.flat.blank(of)

    def remembering(self, nodes: Iterable[str]) -> bool:
        return self.flat.remembering(self.leaves(nodes))

    def behind(self, node: str, formula: Term) -> tuple[tuple[Variable, bool], ...]:
        """A cell of a node inside remembers values of the subsystem's ports, as seen from outside."""
        face = self.faces.get(node)
        if face is None:
            return Frame.behind(self, node, formula)
        ports = {value: variable for variable, value in self.mapping(node).items() if CELL not in variable.name}
        found: dict[tuple[Variable, bool], None] = {}
        for variable in ports_of(formula):
            if CELL not in variable.name:
                found[variable, False] = None
                continue
            at = self.meant(node, variable.name)
            own = Variable(Role.INPUT, at.port, variable.sort)
            for inner, _ in self.flat.behind(at.node, own):
                value = self.flat.mapping(at.node).get(inner)
                if value in ports:
                    found[ports[value], True] = None
        return tuple(found)

    def initials(self, nodes: Iterable[str]) -> dict[str, Term]:
        return self.flat.initials(self.leaves(nodes))

    def leaves(self, nodes: Iterable[str]) -> tuple[str, ...]:
        wanted: set[str] = set()
        for name in nodes:
            wanted |= self.faces[name].inside if name in self.faces else {name}
        return tuple(name for name in self.flat.graph.nodes if name in wanted)

    def meant(self, node: str, port: str) -> Endpoint:
        """The port of a node inside that a subsystem's port stands for, or that node's cell."""
        face = self.faces.get(node)
        if face is not None and CELL in port:
            return Endpoint(*port.split(".", 1))
        return face.ports[Endpoint(node, port)] if face is not None else Endpoint(node, port)


def level(flat: Frame, folded: Folded, composed: Mapping[str, Node]) -> Frame:
    """The frame of a graph in which subsystems are nodes."""
    if not folded.faces:
        return flat
    nodes = {name: composed[name] if name in folded.faces else flat.node(name) for name in folded.graph.nodes}
    return Level(
        flat.system,
        folded.graph,
        flat.assumed,
        flat.own_inputs,
        flat.constants,
        flat.cells,
        flat.shared,
        flat.required,
        flat.observed,
        flat.left_out,
        nodes,
        flat=flat,
        faces=folded.faces,
    )


Reply = dict[ClauseName, Term]
"""The clauses of subsystems over the whole system's values, as written in the nodes inside: with `previous` and the
like, for which the calculus uses cells."""


def composed_node(frame: Frame, goal: Goal, face: Face, formulas: Reply) -> tuple[Node, tuple[str, ...]]:
    """The subsystem with its derived contract, and that contract as lines of text. Clauses are named ``camera.sharp``,
    by the node inside; their cells (``camera.once#…``) are inputs. The clauses as written are added to `formulas`."""
    flat = frame.flat if isinstance(frame, Level) else frame
    ports: dict[Variable, Variable] = {}
    for port in (*face.node.outputs, *face.node.inputs):
        at = face.ports[Endpoint(face.node.name, port.name)]
        find = flat.output if port.role is Role.OUTPUT else flat.input
        ports[find(at.node, at.port)] = port.variable
    kept: list[Port] = []
    for leaf, port in ((n, p) for n in flat.graph.nodes if n in face.inside for p in flat.node(n).inputs):
        meant = flat.input(leaf, port.name)
        if CELL in port.name and meant not in ports:
            kept.append(Port(Role.INPUT, f"{leaf}.{port.name}", port.sort, port.type_name))
            ports[meant] = kept[-1].variable
    clauses: dict[ClauseKind, list[Clause]] = {ClauseKind.ASSUMPTION: [], ClauseKind.GUARANTEE: []}
    guaranteed = (ClauseName(name, clause.name) for name in goal.nodes for clause in frame.node(name).guarantees)
    for kind, names in ((ClauseKind.ASSUMPTION, goal.root.assumed), (ClauseKind.GUARANTEE, guaranteed)):
        for number, name in enumerate(names, start=1):
            original = frame.node(name.node).clause(name.clause)
            term = carried(frame, goal, name) if kind is ClauseKind.ASSUMPTION else frame.clause(name.node, name.clause)
            formula = substitute(term, ports)
            clauses[kind].append(replace(original, kind=kind, name=str(name), position=number, formula=formula))
            used = _carrying(frame, goal, name) if kind is ClauseKind.ASSUMPTION else ()
            assumption = _under((_said(frame, name, formulas) for name in used), _said(frame, name, formulas))
            formulas[ClauseName(face.node.name, str(name))] = assumption
    node = replace(
        face.node,
        inputs=(*face.node.inputs, *kept),
        assumptions=tuple(clauses[ClauseKind.ASSUMPTION]),
        guarantees=tuple(clauses[ClauseKind.GUARANTEE]),
    )
    lines = [f"{node.name} as a node"]
    lines += [f"  reads {', '.join(port.name for port in face.node.inputs)}"] if face.node.inputs else []
    lines += [f"  puts out {', '.join(port.name for port in node.outputs)}"] if node.outputs else []
    for verb, these in (("assumes", node.assumptions), ("guarantees", node.guarantees)):
        for clause in (c for c in these if c.chance is None):  # a probability stays the node's
            formula = substitute(formulas[ClauseName(node.name, clause.name)], ports)
            lines.append(f"  {verb} {clause.name}: {show_term(formula)}")
    return node, tuple(lines)


def _said(frame: Frame, name: ClauseName, clauses: Reply) -> Term:
    """A clause of a node or subsystem as it was written, over the whole system's values; an unwritten one (that time
    advances) in the form that the calculus uses."""
    if name in clauses:
        return clauses[name]
    flat = frame.flat if isinstance(frame, Level) else frame
    node = flat.system.contract.node(name.node)
    written = next((clause.formula for clause in node.clauses if clause.name == name.clause), None)
    return frame.clause(name.node, name.clause) if written is None else flat.placed(name.node, written)


def carried(frame: Frame, goal: Goal, name: ClauseName) -> Term:
    """An assumption that a subsystem's derivation leaves assumed, as the subsystem makes it: if it mentions values from
    inside, as an implication from the contracts, at the same step, of the nodes that produce them (their assumptions
    are shown first).

    A node that the assuming node feeds at that step is left out: its guarantees may depend on this same assumption.
    """
    used = _carrying(frame, goal, name)
    return _under((frame.clause(each.node, each.clause) for each in used), frame.clause(name.node, name.clause))


def _under(conditions: Iterable[Term], claim: Term) -> Term:
    found = tuple(conditions)
    return Implies(conjunction(found), claim) if found else claim


def _carrying(frame: Frame, goal: Goal, name: ClauseName) -> tuple[ClauseName, ...]:
    """The clauses under which an assumption is carried outward."""
    claim = frame.clause(name.node, name.clause)
    selected = frozenset(goal.nodes)
    inside = {frame.output(node, port.name) for node in goal.nodes for port in frame.node(node).outputs}
    if inside.isdisjoint(free_variables(claim)):
        return ()
    after = frame.graph.heirs(name.node, selected)
    known: dict[ClauseName, Term] = {}
    for provider in frame.graph.ancestors(name.node, selected):
        if provider not in after:
            known |= {
                ClauseName(provider, c.name): frame.clause(provider, c.name) for c in frame.node(provider).clauses
            }
    near = bearing(known, free_variables(claim))
    return tuple(each for each in known if each in near)


def with_persistence(frame: Level, goal: Goal) -> Goal:
    """The goal, with R3's hypothesis if several nodes inside one subsystem feed a node. Seen from outside, they are one
    provider (R1), but their outputs are still used together."""
    selected = frozenset(goal.nodes)
    found: list[str] = []
    for node in goal.nodes:
        behind: dict[str, set[str]] = {}
        for edge in frame.graph.feeding(node):
            if edge.source.node in selected and edge.source.node in frame.faces and edge.source.node != node:
                source = frame.meant(edge.source.node, edge.source.port)
                behind.setdefault(edge.source.node, set()).add(source.node)
        found += [name for held in behind.values() if len(held) > 1 for name in sorted(held)]
    if not found:
        return goal
    hypothesis = PERSISTENCE.format(", ".join(dict.fromkeys(found)))
    root = replace(goal.root, hypotheses=tuple(dict.fromkeys((*goal.root.hypotheses, hypothesis))))
    return replace(goal, root=root, together=True)


def innermost(name: str) -> str:
    """The node's own clause: ``reader.scaled`` for ``robot.sensor.reader.scaled``."""
    return ".".join(name.split(".")[-2:])

"""A system's derivations, and the results that are computed once for them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace

from avow.base.files import sha256
from avow.base.graphs import components
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.tuning.effort import DEFEAT_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates
from avow.calculus.derivation import ClauseName, Goal, Settled, SideCondition
from avow.calculus.discharge import Answers, Bounds, Claim, Progress, settle
from avow.calculus.entailment import ask_once
from avow.calculus.rules import WHOLE, derive
from avow.calculus.scenario import world
from avow.calculus.subsystem_contracts import Level, Reply, composed_node, innermost, level, with_persistence
from avow.calculus.transition import Machine
from avow.calculus.variables import Frame, frame
from avow.formulas.finite import interpretation
from avow.formulas.formula import digest, free_variables, sort_digest, substitute
from avow.formulas.temporal.clock import one_pace
from avow.kernel.solvers import Solvers
from avow.language.contract import Clause, ClauseKind, Node, Port
from avow.language.sorts import BOOL, FunctionSort
from avow.language.subterms import histories, ports_of
from avow.language.terms import History, Not, Past, Role, Term, Variable
from avow.sanity import results
from avow.sanity.analysis import analyse
from avow.sanity.claims import Property, node_key, triggers
from avow.sanity.over_runs import OverRuns
from avow.sanity.results import SanityResult
from avow.system.folding import face, fold, inner_first, leaves, outermost, parents
from avow.system.formulas import environment_assumptions
from avow.system.plan import ComposeGoal, Endpoint, Subsystem, System


@dataclass(slots=True)
class Meanings:
    """Digests of what composition claims depend on: nodes with everything that flows into them, and the plan's
    formulas, but not names of clauses, layout or comments. Computed once for a system (as a Merkle tree over its
    loops)."""

    frame: Frame
    _nodes: dict[str, str] = field(default_factory=dict)
    _cones: dict[frozenset[str], dict[str, str]] = field(default_factory=dict)

    def node(self, name: str) -> str:
        """A node's ports and clauses."""
        if name not in self._nodes:
            node = self.frame.node(name)
            self._nodes[name] = sha256(
                "\n".join(
                    [
                        name,
                        *(f"{p.role} {p.name} {sort_digest(p.sort)}" for p in (*node.inputs, *node.outputs)),
                        *sorted(f"{clause.kind} {digest(clause.formula)}" for clause in node.clauses),
                    ]
                )
            )
        return self._nodes[name]

    def cone(self, name: str, selected: frozenset[str]) -> str:
        """A node and every selected node from which values flow to it, at any step."""
        if selected not in self._cones:
            self._cones[selected] = self._all_cones(selected)
        return self._cones[selected][name]

    def _all_cones(self, selected: frozenset[str]) -> dict[str, str]:
        graph = self.frame.graph
        inside = [edge for edge in graph.edges if edge.source.node in selected and edge.target.node in selected]
        into: dict[str, list[str]] = {}
        for edge in inside:
            text = (
                f"{edge.source} {edge.target} {edge.delayed} {self.initial(edge.source.node) if edge.delayed else ''}"
            )
            into.setdefault(edge.target.node, []).append(text)
        found: dict[str, str] = {}
        order = [name for name in graph.nodes if name in selected]
        for group in components(order, [(e.source.node, e.target.node) for e in inside]):
            members = set(group)
            parts = [self.node(name) for name in group]
            parts += sorted(text for name in group for text in into.get(name, ()))
            parts += sorted(
                {found[p] for name in group for p in graph.providers(name) if p in found and p not in members}
            )
            whole = sha256("\n".join(parts))
            found.update({name: sha256(f"{name} {whole}") for name in group})
        return found

    def initial(self, node: str) -> str:
        """The plan's conditions on a node's outputs before the first step."""
        return digest(*self.frame.initials(frozenset({node})).values())

    def environment(self, ports: Iterable[str] | None = None) -> str:
        """The plan's environment assumptions (on some ports)."""
        wanted = None if ports is None else set(ports)
        formulas = digest(*(a.formula for a in self.frame.assumed if wanted is None or a.port in wanted))
        own = (at if at == whose else f"{at} as {whose}" for at, whose in self.frame.own_inputs.items())
        return sha256("\n".join([formulas, *sorted(own), "constant", *sorted(self.frame.constants)]))

    def all(self, selected: frozenset[str]) -> str:
        """Everything that is selected."""
        return sha256("\n".join([*sorted(self.cone(n, selected) for n in selected), self.environment()]))


@dataclass(slots=True)
class Composition:
    """A system's derivations: for each goal of the plan, and for the whole system."""

    frame: Frame
    """The frame in which every node is a node of its own."""
    goals: tuple[Goal, ...]
    """Subsystems first, those inside others before these."""
    meanings: Meanings
    levels: Mapping[str, Level] = field(default_factory=dict)
    """Goal → the frame in which the subsystems among its nodes are nodes."""
    outermost: tuple[str, ...] = ()
    """The nodes of the system as a whole."""
    around: Mapping[str, str] = field(default_factory=dict)
    """Node or subsystem → the subsystem that it is directly in."""
    told: Progress | None = field(default=None, compare=False)
    """Called with each side condition of a goal as soon as it is answered."""
    claims: Mapping[str, Mapping[SideCondition, Claim]] = field(default_factory=dict, compare=False)
    """Goal → the claims of its side conditions, if only some of them are requested."""
    _level_meanings: dict[str, Meanings] = field(default_factory=dict)
    _answers: dict[str, Answers] = field(default_factory=dict)
    _machine: Machine | None = None
    _certificates: Certificates | None = None
    _surroundings: Node | None = None
    _lasting: SanityResult | None = None
    _excluded: tuple[str, ...] | None = None
    _whole: tuple[Goal, frozenset[ClauseName]] | None = None
    """The derivation over every node, and the assumptions that it shows."""

    def goal(self, name: str) -> Goal:
        return next(goal for goal in self.goals if goal.name == name)

    def settled(self, goal: Goal, bounds: Bounds) -> Answers:
        """The goal's side conditions, checked once."""
        if goal.name not in self._answers:
            self._answers[goal.name] = settle(self.frame_of(goal), goal, bounds, self.told, self.claims.get(goal.name))
        return self._answers[goal.name]

    def stands(self, goal: Goal, bounds: Bounds) -> Verdict:
        """The verdict of a derivation and those of its subsystems, up to their hypotheses: `proved` only if the kernel
        establishes it."""
        verdicts = {self.settled(part, bounds).verdict for part in goal.inner_first()}
        if Verdict.REFUTED in verdicts:
            return Verdict.REFUTED
        if verdicts - {Verdict.PROVED}:
            return Verdict.UNKNOWN
        conditions = ((part, str(condition.about)) for part in goal.inner_first() for condition in part.conditions)
        shown = all(self.certificates.condition(part, about, bounds) is not None for part, about in conditions)
        return Verdict.PROVED if shown else Verdict.UNKNOWN

    @property
    def certificates(self) -> Certificates:
        """The kernel's results for these derivations."""
        if self._certificates is None:
            self._certificates = Certificates(self, solvers=Solvers(z3=ask_once))
        return self._certificates

    def frame_of(self, goal: Goal) -> Frame:
        """The frame in which a goal's nodes are nodes."""
        return self.levels.get(goal.name, self.frame)

    def meanings_of(self, goal: Goal) -> Meanings:
        """Digests of what a goal depends on."""
        level = self.levels.get(goal.name)
        if level is None:
            return self.meanings
        if goal.name not in self._level_meanings:
            self._level_meanings[goal.name] = Meanings(level)
        return self._level_meanings[goal.name]

    def leaves(self, goal: Goal, nodes: Iterable[str]) -> tuple[str, ...]:
        """The contract's nodes that some nodes of a goal consist of."""
        level = self.levels.get(goal.name)
        return tuple(nodes) if level is None else level.leaves(nodes)

    def where(self, node: str, clause: str) -> tuple[Goal, ClauseName] | None:
        """The derivation that shows an assumption of a node, and the assumption's name there: that of the node's
        subsystem, of an enclosing one if the inner one carries it outward, or of the whole system; None if it stays
        assumed."""
        about = ClauseName(node, clause)
        while (name := self.around.get(about.node)) is not None:
            goal = self.goal(name)
            if about not in goal.root.assumed:
                return goal, about
            about = ClauseName(name, str(about))
        whole, shown = self._over_all()
        return (whole, about) if about in shown else None

    def known(self, goal: Goal) -> Mapping[SideCondition, Settled]:
        """The side conditions of a goal that have been answered; empty if the goal was not checked."""
        answers = self._answers.get(goal.name)
        return answers.settled if answers is not None else {}

    def fallen(self, goal: Goal, behind: str = "") -> tuple[str, ...]:
        """The side conditions of a goal that have been answered and do not hold: those of a node and of the nodes from
        which values flow to it, or all."""
        graph, nodes = self.frame_of(goal).graph, {behind: None} if behind else dict.fromkeys(goal.nodes)
        for node in (waiting := list(nodes)):
            waiting += (more := [p for p in graph.providers(node) if p not in nodes])
            nodes |= dict.fromkeys(more)
        known = self.known(goal).items()
        return tuple(
            f"{goal.name}.{c.about}" for c, s in known if s.verdict is not Verdict.PROVED and c.consumer in nodes
        )

    def machine(self, seed: int = 0, of: str = "") -> Machine:
        """The composed contracts as a transition system, made once; with the cells `of` a requirement, if it has any.
        Raises CannotRun."""
        if of in self.frame.observed:
            return Machine(world(self.frame), seed, of)
        if self._machine is None:
            self._machine = Machine(world(self.frame), seed)
        return self._machine

    def assumed(self, of: str = "") -> dict[str, Term]:
        """The assumptions about the system's environment, by the plan or by a node about inputs that no node provides;
        with the definitions of cells, also for a requirement (`of`)."""
        frame, found = self.frame, dict[str, Term]()
        for node in frame.system.contract.nodes:
            for clause in node.assumptions:
                ports = (Endpoint(node.name, v.name) for v, _ in frame.behind(node.name, clause.formula))
                if frame.graph.by_target.keys().isdisjoint(ports):
                    found[f"{node.name}.{clause.name}"] = frame.clause(node.name, clause.name)
        return found | frame.environment() | frame.memory(of=of)

    def left_to_environment(self) -> Iterator[tuple[ClauseName, tuple[str, ...]]]:
        """The assumptions of nodes that mention only environment inputs and stay assumed, with these inputs."""
        flat = self.frame
        for name in dict.fromkeys(ClauseName(*innermost(str(n)).split(".")) for n in self.whole.root.assumed):
            ports = tuple(v.name for v in ports_of(flat.system.contract.node(name.node).clause(name.clause).formula))
            if ports and not any(Endpoint(name.node, port) in flat.graph.by_target for port in ports):
                yield name, ports

    def restricting(self, node: str, situation: Term) -> dict[str, Term]:
        """The clauses of a node that may exclude a situation. A realizable node has outputs for all inputs that it
        assumes, so its guarantees exclude no situation that mentions inputs only."""
        frame, of = self.frame, self.frame.node(node)
        outputs = {frame.output(node, port.name) for port in of.outputs}
        if node in frame.cells or outputs & free_variables(situation):
            return frame.contracts((node,))
        return {f"{node}.{a.name}": frame.clause(node, a.name) for a in of.assumptions}

    def read_of(self, name: str) -> str:
        """Digest of what `EnvironmentQuestion` reads of a node: what its guarantees are about, and what restricts that;
        if other steps matter, all of it."""
        node = self.frame.system.contract.node(name)
        if self.frame.constants or any(histories(c.formula) for c in (*self.surroundings.assumptions, *node.clauses)):
            return f"{name} {node_key(node)}"
        found = list[str]()
        for guarantee in self.frame.node(name).guarantees:
            for situation in triggers(self.frame.clause(name, guarantee.name)):
                known = self.restricting(name, situation)
                found.append(f"{guarantee.name} {digest(situation)} {digest(*known.values())}")
        return "\n".join([name, *sorted(found)])

    @property
    def surroundings(self) -> Node:
        """A node with the environment's inputs and all assumptions about them."""
        if self._surroundings is None:
            flat, contract = self.frame, self.frame.system.contract
            found = [
                (a.node, f"environment {a.port}", a.formula) for a in environment_assumptions(flat.system, flat.graph)
            ]
            for name, _ in self.left_to_environment():
                found.append((name.node, str(name), contract.node(name.node).clause(name.clause).formula))
            ports: dict[Variable, None] = {}
            clauses: dict[str, Term] = {}
            for node, label, formula in sorted(found, key=lambda each: each[1]):  # the order of nodes does not matter
                entries = {
                    v: replace(v, name=flat.entry(node, v.name).removeprefix("in."), span=None)
                    for v in ports_of(formula)
                }
                ports |= dict.fromkeys(entries.values())
                clauses[label] = substitute(formula, entries)
            if any(map(histories, clauses.values())):  # otherwise each step may be like the first
                clauses |= {c.name: c.formula for c in self._unchanging({v.name: v for v in ports})}
            inputs = tuple(Port(Role.INPUT, v.name, v.sort, str(v.sort)) for v in ports)
            assumed = (Clause(ClauseKind.ASSUMPTION, label, 0, f) for label, f in clauses.items())
            paced = contract.nodes if one_pace(contract.nodes) else ()  # otherwise their steps differ
            paces = {digest(g.formula): g for node in paced for g in node.guarantees if g.pace is not None}
            self._surroundings = Node("environment", inputs, (), (), tuple(assumed), tuple(paces.values()))
        return self._surroundings

    def _unchanging(self, entries: Mapping[str, Variable]) -> Iterator[Clause]:
        """For each constant among these environment inputs: the assumption that it never changes."""
        for name, variable in entries.items():
            if {f"in.{name}", name} & self.frame.constants and not isinstance(variable.sort, FunctionSort):
                same = Not(History(Past.CHANGED, (variable,), BOOL))
                yield Clause(ClauseKind.ASSUMPTION, f"constant {name}", 0, same)

    def lasting(self, bounds: Bounds) -> SanityResult:
        """Whether an environment can satisfy all assumptions about it for ever."""
        if self._lasting is None:
            node = self.surroundings
            given = interpretation(node, self.frame.system.plan.scenario)
            asked = results.Bounds(bounds.effort, bounds.seed)
            (self._lasting,) = analyse(node, scenario=given, bounds=asked, wanted={Property.ASSUMPTIONS_SATISFIABLE})
        return self._lasting

    def excluded_over_runs(self, bounds: Bounds) -> tuple[str, ...]:
        """The guarantees (``node.name``) whose condition arises in no run of the assumed environment, but in some run
        of their node alone. Only if other steps matter: `EnvironmentQuestion` checks single steps."""
        if self._excluded is None:
            nodes = self.frame.system.contract.nodes
            self._excluded = tuple(f"{n.name}.{g}" for n in nodes if not n.relay for g in self._never_met(n, bounds))
        return self._excluded

    def _never_met(self, node: Node, bounds: Bounds) -> tuple[str, ...]:
        own = {
            self.frame.entry(node.name, port.name).removeprefix("in."): port.variable
            for port in node.inputs
            if Endpoint(node.name, port.name) in self.frame.graph.environment
        }
        assumed = []
        for clause in self.surroundings.assumptions:
            ports = {v: own[v.name] for v in ports_of(clause.formula) if v.name in own}
            if ports and len(ports) == len(set(ports_of(clause.formula))):
                assumed.append(replace(clause, formula=substitute(clause.formula, ports)))
        assumed += self._unchanging(own)
        over_runs = [clause.name for clause in (*assumed, *node.guarantees) if histories(clause.formula)]
        if not assumed or not over_runs:
            return ()
        asked = results.Patience(min(bounds.effort, DEFEAT_EFFORT)), bounds.seed
        within = OverRuns(replace(node, assumptions=(*node.assumptions, *assumed)), *asked)
        alone = OverRuns(node, *asked)
        names = (clause.name for clause in node.guarantees)
        return tuple(name for name in names if within.never_met(name) and not alone.never_met(name))

    @property
    def whole(self) -> Goal:
        """The derivation over every node: the plan's own, or the one named ``whole``."""
        return self._over_all()[0]

    def _over_all(self) -> tuple[Goal, frozenset[ClauseName]]:
        if self._whole is None:
            everything = set(self.outermost)
            complete = (goal for goal in self.goals if set(goal.nodes) == everything and not _left_open(self, goal))
            whole = next(complete, self.goals[-1])
            self._whole = whole, frozenset(condition.about for condition in whole.conditions)
        return self._whole


@by_identity(2)
def composed(system: System) -> Composition:
    """The same as `compose`, cached: for callers that only read it."""
    return compose(system)


def compose(system: System) -> Composition:
    """The derivations of a system. Pure. Raises Rejected if the plan's formulas are wrong."""
    return composed_over(frame(system))


def composed_over(flat: Frame) -> Composition:
    """The derivations of the system of a frame."""
    system = flat.system
    nodes = outermost(system)
    inside = leaves(system.plan)
    faces = {name: face(system, flat.graph, name, held) for name, held in inside.items()}
    composed: dict[str, Node] = {}
    clauses: Reply = {}
    goals: dict[str, Goal] = {}
    levels: dict[str, Level] = {}

    def add(goal: ComposeGoal | None, members: tuple[str, ...], *, carry: bool = False, name: str = WHOLE) -> Goal:
        parts = [faces[name] for name in members if name in faces]
        built = level(flat, fold(system, flat.graph, parts), composed) if parts else flat
        found = derive(built, goal, carry=carry, name=name)
        found = replace(found, within=tuple(goals[part.node.name] for part in parts))
        if isinstance(built, Level):
            levels[found.name] = built
            found = with_persistence(built, found)
        if _taken_together(flat, frozenset(inner for name in members for inner in inside.get(name, (name,)))):
            found = replace(found, together=True)
        goals[found.name] = found
        return found

    subsystems = {subsystem.name: subsystem for subsystem in system.plan.subsystems}
    for name in inner_first(system.plan):
        entry = subsystems[name]
        goal = add(ComposeGoal(name, entry.members, entry.rule, entry.options, entry.span), entry.members, carry=True)
        composed[name], contract = composed_node(levels.get(name, flat), goal, faces[name], clauses)
        goals[name] = replace(goal, contract=contract)
    for wanted in system.plan.compose:
        members = wanted.select or nodes
        add(replace(wanted, select=members), members)
    found = Composition(flat, tuple(goals.values()), Meanings(flat), levels, nodes, parents(system.plan))
    if any(set(goal.nodes) == set(nodes) and not _left_open(found, goal) for goal in goals.values()):
        return found
    # a rule that the plan names may leave assumptions about provided values: these are shown here
    name = WHOLE
    while name in goals:
        name += "_"
    add(None, nodes, name=name)
    return replace(found, goals=tuple(goals.values()), levels=levels)


def _taken_together(flat: Frame, nodes: frozenset[str]) -> bool:
    """Whether claims about these nodes may use values of several of them at one step: a value of the step before is
    read, or a requirement of the whole system mentions several nodes."""
    if any(e.delayed and {e.source.node, e.target.node} <= nodes for e in flat.graph.edges):
        return True
    if len(nodes) > 1 and flat.remembering(nodes):
        return True  # cells combine values of one step
    if nodes != frozenset(flat.graph.nodes):
        return False
    if len(nodes) > 1 and flat.observed:
        return True
    spoken = (ports_of(formula) for formula in flat.required.values())
    return any(len({v.name.partition(".")[0] for v in ports}) > 1 for ports in spoken)


def _left_open(composition: Composition, goal: Goal) -> bool:
    """Whether a derivation leaves an assumption about values that a node provides."""
    frame = composition.frame
    for name in goal.root.assumed:
        node, clause = innermost(str(name)).split(".")
        spoken = frame.behind(node, frame.node(node).clause(clause).formula)
        ports = (v.name for v, _ in spoken if v.role is Role.INPUT)
        if any(Endpoint(node, port) in frame.graph.by_target for port in ports):
            return True
    return False


def asked(system: System, goal: str) -> ComposeGoal | Subsystem | None:
    """The plan's entry for a derivation."""
    goals: tuple[ComposeGoal | Subsystem, ...] = (*system.plan.compose, *system.plan.subsystems)
    return next((entry for entry in goals if entry.name == goal), None)


def argument(composition: Composition, goal: str, key: str) -> str:
    """The plan's reason for a hypothesis of a goal, or empty."""
    entry = asked(composition.frame.system, goal)
    if entry is not None and isinstance(entry.options.data, dict):
        given = entry.options.data.get(key)
        if isinstance(given, dict):
            signed = ", ".join(str(given[part]) for part in ("who", "date") if given.get(part))
            return str(given["because"]) + (f" ({signed})" if signed else "")
    return ""

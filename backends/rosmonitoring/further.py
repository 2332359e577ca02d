"""What a recording breaks besides the guarantees that the plan names it for: guarantees and assumptions of any node,
what the plan assumes of the environment, and requirements about one node.

The first node of the contract that names a recording judges all of that; ``avow monitor`` and campaigns judge theirs.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from avow.backend_kit.further import Further, assumption, contradicted
from avow.backend_kit.protocol import Job
from avow.base.files import inside
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evidence.obligation import Kind
from avow.formulas.formula import free_variables
from avow.language.contract import Clause, ClauseKind, Node
from avow.language.subterms import ports_of
from avow.language.terms import Role
from avow.system.plan import Located, System

from .engine import Monitor
from .notes import readable
from .observing import method_of, outside, recordings, sources
from .options import Setup, origin, same_topic, setup
from .session import Session
from .verdicts import Run, Shown, outcome
from .watched import Fault, Violation


class _Apart(Session):
    """Of clauses that are no node's own: no node is to blame for them."""

    def with_causes(self, violations: list[Violation], *, over: bool = False) -> Iterator[Violation]:
        return iter(violations)


def contradictions(job: Job, names: Sequence[str], seconds: float) -> tuple[tuple[Outcome, ...], tuple[str, ...], str]:
    """The claims that these recordings refute, each once; the assumptions that they refute no other; and why not all
    claims could be judged."""
    found: dict[str, Outcome] = {}
    doubts: list[str] = []
    for name in names if job.further is not None else ():
        path = inside(job.root, name)
        if path is not None and leads(job, name):
            one = of_job(job, name, path, time.process_time() + seconds)
            found = {each.obligation: _elsewhere(job, name, each) for each in one.refuted()} | found
            doubts += one.doubts.values()
            if one.late:
                return tuple(found.values()), tuple(doubts), one.late
    return tuple(found.values()), tuple(doubts), ""


def _elsewhere(job: Job, name: str, found: Outcome) -> Outcome:
    """A refuted guarantee of another node may have been repaired since, and its own recording replaced."""
    node, kind, clause = found.obligation.split("/", 2)
    if kind != Kind.GUARANTEE or node == job.node.name:
        return found
    text = f"repair what the counterexample of {node}.{clause} shows; if {name}, which {job.node.name} names, was made "
    text += f"with an older program, record again, or name under `outside` the inputs that {node} fed"
    return replace(found, details={**found.details, "next": text})


def leads(job: Job, name: str) -> bool:
    """Whether no earlier node of the contract names the recording."""
    own = job.node.name
    naming = (n.name for n in job.contract.nodes if n.name == own or name in recordings(method_of(job.system, n.name)))
    return next(naming) == own


def of_job(job: Job, name: str, path: Path, deadline: float, apart: Mapping[str, str] | None = None) -> Recording:
    """A recording, for a job: what `apart` names was not kept on purpose (by default, what the plan's entry names)."""
    options = {n.name: method_of(job.system, n.name) for n in job.contract.nodes} | {job.node.name: job.method.options}
    given = {node: outside(own, name) for node, own in options.items()}
    given |= {} if apart is None else {job.node.name: apart}
    own = frozenset(o.local_id for o in job.obligations)
    return Recording(job.system, job.further or (), name, path, deadline, options, given, own)


@dataclass
class Recording:
    system: System
    further: Sequence[Further]
    name: str
    path: Path
    deadline: float
    """In seconds of processor time."""
    options: Mapping[str, Located | None]
    """Node → its method's options, for each node that is judged."""
    outside: Mapping[str, Mapping[str, str]]
    """Node → what was not kept on purpose, and why."""
    answered: frozenset[str] = frozenset()
    """The claims that the job itself answers."""
    late: str = ""
    doubts: dict[str, str] = field(default_factory=dict)
    """Clause → the assumption that no step breaks it: the recording's order does, and the order of steps is unknown."""

    def __post_init__(self) -> None:
        nodes = self.system.contract.nodes
        self.apart: dict[str, set[str]] = {}
        """Node → the ports whose messages did not come from the system, according to the plan."""
        for node in nodes:
            given = self.outside.get(node.name, {})
            ports = {v.name for c in node.assumptions if c.name in given for v in ports_of(c.formula)}
            self.apart[node.name] = ports | {key.removeprefix("in.") for key in given}
        played = (sources(self.system, node, port) for node in nodes for port in self.apart[node.name])
        self.played = {source.node for found in played for source in found}

    def refuted(self) -> Iterator[Outcome]:
        nodes = [node for node in self.system.contract.nodes if node.name in self.options]
        setups = {node.name: made for node in nodes if (made := self._setup(node)) is not None}
        runs = self._judge(Session, [self._promising(made) for made in setups.values()])
        broken = {each.obligation: each for run in runs for each in self._guarantees(run)}
        yield from (each for each in broken.values() if each.obligation not in self.answered)
        for run in runs:
            yield from self._assumptions(run, broken)
        claims = [f for f in self.further if f.clause.kind is ClauseKind.ASSUMPTION and f.node in setups]
        for run in self._judge(_Apart, [self._assumed(setups[f.node], f) for f in claims]) if claims else ():
            yield from self._environment(run, claims)

    def _setup(self, node: Node) -> Setup | None:
        if node.relay:
            return None
        made, faults = setup(self.system, node, self.options[node.name])
        return None if faults or readable(made, self.path, origin(self.system)) else made

    def _promising(self, made: Setup) -> Monitor:
        """A node's monitor, that also judges the requirements about it."""
        about = [f for f in self.further if f.node == made.node.name]
        required = tuple(f.clause for f in about if f.claim.startswith(f"system/{Kind.REQUIREMENT}/"))
        ports = self.apart[made.node.name]
        excused = tuple(f.clause for f in about if f.clause.kind is ClauseKind.ASSUMPTION and _names(f.clause) & ports)
        node = made.node
        node = replace(node, guarantees=(*node.guarantees, *required), assumptions=(*node.assumptions, *excused))
        return Monitor(replace(made, node=node))

    def _assumed(self, made: Setup, claim: Further) -> Monitor:
        node = replace(made.node, assumptions=(claim.clause,), guarantees=())
        return Monitor(replace(made, node=node, answers=None, fresh={}, rates={}))

    def _judge(self, kind: type[Session], monitors: Sequence[Monitor]) -> list[Run]:
        runs = [Run(self.name, monitor) for monitor in monitors]
        whole = kind(self.system, tuple(monitors))
        for _, violations in whole.judged(self.path):
            for run in runs if violations else ():
                names = {c.name for c in run.monitor.setup.node.clauses}
                run.note(v for v in violations if v.clause in names)
            if time.process_time() > self.deadline:
                self.late = f"{self.name}: time was up before all claims that it may contradict were judged"
                break
        return runs

    def _guarantees(self, run: Run) -> Iterator[Outcome]:
        node = run.monitor.setup.node
        claims = {f.clause.name: f.claim for f in self.further if f.node == node.name}
        if node.name in self.played:
            return
        for clause in node.guarantees:
            if clause.unwritten or clause.chance is not None:
                continue
            claim = claims.get(clause.name, f"{node.name}/{Kind.GUARANTEE}/{clause.name}")
            spoken = frozenset(v.qualified for v in free_variables(clause.formula))
            answer = outcome("", Shown(clause.name, [run], spoken, "an assumption was broken"))
            if answer.verdict is Verdict.REFUTED and answer.counterexample is not None:
                yield contradicted(claim, answer.summary, answer.counterexample)
            elif answer.counterexample is not None and claim not in self.answered:
                self._doubt(f"{node.name}.{clause.name}", answer.counterexample.explanation)

    def _assumptions(self, run: Run, broken: Mapping[str, Outcome]) -> Iterator[Outcome]:
        """The broken assumptions. One that another node's breach caused is discharged by what that breach refutes."""
        node = run.monitor.setup.node
        own = {c.name for c in self.system.contract.node(node.name).assumptions}
        for v in run.first.values():
            if v.fault not in (Fault.ASSUMPTION, Fault.PROVIDER) or v.clause not in own or node.name in self.played:
                continue
            by = v.origin.replace(".", f"/{Kind.GUARANTEE}/", 1)
            if by not in broken:
                yield from self._told(run, assumption(node.name, v.clause), v)

    def _environment(self, run: Run, claims: Sequence[Further]) -> Iterator[Outcome]:
        (clause,) = run.monitor.setup.node.assumptions
        claim = next(f.claim for f in claims if f.node == run.monitor.setup.node.name and f.clause == clause)
        first = next((v for v in run.first.values() if v.fault is Fault.ASSUMPTION), None)
        if first is not None:
            yield from self._told(run, claim, first)

    def _told(self, run: Run, claim: str, v: Violation) -> Iterator[Outcome]:
        """A breach refutes if its values belong together: if they are of one topic, or of one step."""
        monitor, clause = run.monitor, run.monitor.setup.node.clause(v.clause)
        if _names(clause) & self.apart[monitor.setup.node.name]:
            return
        rules = monitor.setup.carried
        topics = {same_topic(rule.topic) for name in _qualified(clause) if (rule := rules.get(name)) is not None}
        together = len(topics) == 1 or monitor.word is not None
        when = f" (t = {v.time})" if v.time else ""
        about = f"event {v.index}{when} of {self.name}: {v.explanation}"
        if together and not monitor.backwards and not monitor.tallies[clause.name].unpaired:
            yield contradicted(claim, f"broken at {about}", Counterexample((*v.bindings, *v.values), about))
        else:
            self._doubt(f"{monitor.setup.node.name}.{v.clause}", about)

    def _doubt(self, clause: str, about: str) -> None:
        why = "in the order of the recording it does, but the order of the steps is unknown"
        self.doubts.setdefault(clause, f"no step breaks {clause}: {why} ({about})")


def _names(clause: Clause) -> set[str]:
    return {v.name for v in ports_of(clause.formula) if v.role is Role.INPUT}


def _qualified(clause: Clause) -> set[str]:
    return {v.qualified for v in free_variables(clause.formula)}

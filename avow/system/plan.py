"""plan.yaml as data: a person's decisions about a system.

Reading, validation and located errors are in `avow.system.plan_file`; nothing here touches the disk.
Every part that can be wrong keeps its place in the file, so that a later stage can point at it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum
from pathlib import Path
from typing import Any

from avow.base import codec
from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.language.contract import Contract, Port
from avow.language.lints import uncarried, unspoken
from avow.ros.launch import Launched
from avow.ros.names import Resolver
from avow.ros.quality import Quality
from avow.system.pieces import Located as Located
from avow.system.probability import Probability

NOWHERE = Located({}, Span("", 1, 1, 1, 1))
"""Values that the plan's author did not write."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """``agent.command``: a node's port."""

    node: str
    port: str

    def __str__(self) -> str:
        return f"{self.node}.{self.port}"


@dataclass(frozen=True, slots=True)
class Edge:
    """An output that feeds an input. A delayed one carries the value of the step before, first `initial`."""

    source: Endpoint
    target: Endpoint
    delayed: bool = False
    initial: str | None = None
    """An RCL formula over ``out.<port>`` of the source or a value, as text; None: any value."""
    implied: bool = False
    """Made by a topic, or by names and types: the plan has no connection there."""
    topic: str = field(default="", compare=False)
    """The topic that carries it, by its whole name; empty if an end has none."""
    span: Span | None = field(default=None, compare=False, repr=False)
    initial_span: Span | None = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.source} → {self.target}" + (" (delayed)" if self.delayed else "")


@dataclass(frozen=True, slots=True)
class EnvironmentInput:
    """The assumption about an input that no node provides, and the reason to believe it."""

    port: str
    """``in.wayP`` (every node's input of that name) or ``agent.wayP``."""
    assume: str | None
    because: str | None
    span: Span | None = field(default=None, compare=False, repr=False)
    constant: bool = False
    """Whether its value is the same at every step (a map, a setting)."""
    stays: str = ""
    """The reason to believe it."""
    assume_span: Span | None = field(default=None, compare=False, repr=False)
    taken_in: bool = False
    """Whether it comes from another system's plan, which is a subsystem here (`avow.system.include`)."""

    @property
    def constancy(self) -> str:
        """The name of the claim that it does not change, and the plan's place for the statement about it."""
        return f"{self.port}.constant" if self.assume else self.port


@dataclass(frozen=True, slots=True)
class Statement:
    """A person's statement about something that results rely on without its being shown, in words for any reader.

    `place` says what it is about: ``environment.in.r``, ``environment.in.r.constant``, ``D1.persistence``,
    ``D1.one-output``, ``D1.entered``, ``assumptions.<method>.<word>`` or ``requirements.REQ1.validation``.
    """

    place: str
    says: str = ""
    """At most 14 words, none of them a name from a contract; empty if not yet written."""
    because: str = ""
    who: str = ""
    """Who is responsible for keeping it true; empty: no one is named."""
    until: str = ""
    """The last day (ISO 8601) on which it may be relied upon; empty: none is given."""
    date: str = field(default="", metadata=codec.LATER)
    """The day (ISO 8601) on which it was assumed; empty: none is given."""
    span: Span | None = field(default=None, compare=False, repr=False)
    until_span: Span | None = field(default=None, compare=False, repr=False, metadata=codec.LATER)
    """Where `until` is."""
    keys: str = field(default="", metadata=codec.LATER)
    """The plan's keys that lead to it: ``compose.D1.one_output``."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of a scenario's CSV file or list. Cells are exact text; `columns` names them."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    path: Path | None = None

    def column(self, name: str) -> tuple[str, ...]:
        """Raises ValueError for an unknown column."""
        at = self.columns.index(name)
        return tuple(row[at] for row in self.rows)


STEP_LENGTH = "dt"
"""Under `scenario.domains`: how long steps take, in seconds."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A finite interpretation, used by every bounded check; a verdict based on it says that it is bounded.

    `interpret` gives the rows at which a relation- or function-typed port holds (``in.wayP`` → table, columns);
    `domains` gives a quantified sort or an input its finite range (``NATURAL`` → ``places.id`` or a list of values).
    """

    tables: tuple[Table, ...] = ()
    interpret: Mapping[str, tuple[str, tuple[str, ...]]] = field(default_factory=dict)
    domains: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    steps: int | None = None
    digest: str = ""
    """Digest of all of it."""
    content: str = ""
    """Digest of tables, interpretation and domains: for results independent of the bound of a check (`steps`)."""

    def table(self, name: str) -> Table:
        """Raises KeyError."""
        for table in self.tables:
            if table.name == name:
                return table
        raise KeyError(name)

    def interpreted(self, node: str, port: Port) -> tuple[str, tuple[str, ...]] | None:
        """Table and columns of a node's port: an entry for this node takes precedence over one for every node."""
        return self.interpret.get(f"{node}.{port.name}") or self.interpret.get(port.variable.qualified)


@dataclass(frozen=True, slots=True)
class Method:
    """One way to discharge a node's guarantees: a backend and its options, as the plan gives them.

    `id` distinguishes several methods of one node (``hoare``, ``dafny``, ``ajpf-edge``); `guarantees` and `assumptions`
    are the names of the clauses that it covers (by default every guarantee).
    """

    id: str
    backend: str
    options: Located
    guarantees: tuple[str, ...]


class Numbers(StrEnum):
    """The meaning of REAL where a node's source runs."""

    EXACT = "exact"
    """An exact number as in the contract: nothing is rounded."""
    FLOAT64 = "float64"
    """An IEEE 754 double, rounded to nearest, ties to even."""
    FLOAT32 = "float32"
    """An IEEE 754 float of 32 bits, rounded likewise."""


class Driving(StrEnum):
    """How a node's class is driven."""

    STEP = "step"
    """By its method `step`, which takes inputs and returns outputs."""
    ROSPY = "rospy"
    """By its ROS 1 callbacks: subscribers and timers."""
    RCLPY = "rclpy"
    """By its ROS 2 callbacks: subscriptions and timers."""


@dataclass(frozen=True, slots=True)
class Source:
    """The program that implements the node, declared once for every method that uses it.

    Paths are relative to the system's folder; empty: none. `memory` maps an input of the node (and the output of its
    name, if it exists) to the attribute that holds it between two steps: its value before, and after.
    """

    python: str = ""
    class_name: str = ""
    cpp: str = ""
    """The adapter header of the C++ source."""
    parameters: str = ""
    """A YAML file with one mapping: the parameters with which the class is constructed."""
    numbers: Numbers = Numbers.FLOAT64
    memory: Mapping[str, str] = field(default_factory=dict)
    """Port → attribute, without ``self.``."""
    place: Located = field(default=NOWHERE, compare=False, repr=False)
    kind: Driving = Driving.STEP
    values: Mapping[str, Any] = field(default_factory=dict)
    """The parameters that the plan itself sets for the node."""
    run: str = ""
    """The method that the program calls on its node of rospy, such as its loop."""


@dataclass(frozen=True, slots=True)
class NodePlan:
    node: str
    criticality: str
    methods: tuple[Method, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    title: str = ""
    """Its name in a report's first screen; empty: its name in the contract, split into words."""
    source: Source | None = None
    parameters: Located = NOWHERE
    """The parameters that the plan itself sets, by name."""


@dataclass(frozen=True, slots=True)
class Validation:
    """A named person's confirmation that a requirement's formula, or the guarantees named under a sentence without one,
    express its sentence. The reason, and the date until which it is valid, are in the `Statement` of its place."""

    who: str
    date: str
    """The day (ISO 8601) on which the person read both."""
    sentence: str = ""
    """`Requirement.sentence_digest` as it was on that day."""
    formula: str = ""
    """`Requirement.formula_digest` as it was on that day."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """A system requirement in a person's words, with a formula or a temporal property if it has one.

    `supported_by` names guarantees (``agent.next_place``), derivations (``D1``) or whole nodes (``agent``).
    """

    id: str
    text: str
    formula: str | None
    temporal: str | None
    supported_by: tuple[str, ...]
    span: Span | None = field(default=None, compare=False, repr=False)
    formula_span: Span | None = field(default=None, compare=False, repr=False)
    """The position of the formula or the temporal property."""
    validation: Validation | None = None
    linked: str = ""
    """Digest of what the contract says about the names under `supported_by`: see `avow.system.links`."""
    source: str = ""
    """The document that it comes from, and the place in it."""
    probability: Probability | None = None
    """None: the formula has to hold at every step, without exception."""

    @property
    def sentence_digest(self) -> str:
        """Digest of the sentence, ignoring white space."""
        return sha256(" ".join(self.text.split()))[:16]

    @property
    def formula_digest(self) -> str:
        """Digest of the formula or temporal property, and of what is linked to it: names, and their meaning."""
        likely = (self.probability.words,) if self.probability else ()
        parts = (self.formula or "", self.temporal or "", *likely, *sorted(self.supported_by), self.linked)
        return sha256(repr(parts))[:16]

    @property
    def validated(self) -> bool:
        """Whether a person has read the current sentence and formula."""
        if self.validation is None:
            return False
        return (self.validation.sentence, self.validation.formula) == (self.sentence_digest, self.formula_digest)

    @property
    def outdated(self) -> bool:
        """Whether a person has read an earlier sentence or formula."""
        return self.validation is not None and bool(self.validation.sentence) and not self.validated


@dataclass(frozen=True, slots=True)
class Hazard:
    """A hazard or a security goal, and its mitigations according to the plan (see `avow.system.hazards`)."""

    id: str
    text: str
    severity: str
    """A severity category of MIL-STD-882E, table I."""
    exposure: str = ""
    """A probability level of MIL-STD-882E, table II; empty: not estimated."""
    source: str = ""
    """The document that it comes from, and the place in it."""
    kind: str = "safety"
    """``safety`` or ``security``."""
    causes: tuple[str, ...] = ()
    consequences: tuple[str, ...] = ()
    mitigated_by: tuple[str, ...] = ()
    """Requirements, nodes, guarantees (``node.guarantee``) or methods (``node/method``)."""
    mitigation_spans: tuple[Span, ...] = field(default=(), compare=False, repr=False)
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class ComposeGoal:
    """``D1: {select: [navigation, sensor, agent], rule: R3}``; `rule` None lets the calculus choose."""

    name: str
    select: tuple[str, ...]
    rule: str | None
    options: Located
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Subsystem:
    """Nodes (or other subsystems) combined into one node, whose contract is derived from theirs.

    `options` holds the place of every member, and the reasons that a derivation may need (`ComposeGoal`). `folder` is
    that of another system if its nodes are included from there.
    """

    name: str
    members: tuple[str, ...]
    rule: str | None
    options: Located
    folder: Path | None = None
    span: Span | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Finding:
    """An expected or accepted finding: an obligation's id without the system (glob allowed), and its verdict."""

    obligation: str
    verdict: str
    reason: str | None = None
    who: str | None = None
    date: str | None = None
    expires: str | None = None
    method: str | None = None
    span: Span | None = field(default=None, compare=False, repr=False)
    matched: tuple[str, ...] = ()
    """If `obligation` has wildcards: what it matched when it was written, and matches now."""
    found: str = ""
    """The mark of the finding when it was written: the entry accepts that finding, and no other of the claim."""
    says: str = ""
    """An accepted assumption in plain words."""


def is_wild(pattern: str) -> bool:
    """Whether a finding's `obligation` may match several obligations."""
    return "*" in pattern or "?" in pattern


@dataclass(frozen=True, slots=True)
class Ros:
    """The plan's entry for ROS: the distribution whose message types apply, and the names of nodes and topics."""

    distro: str | None = None
    names: Resolver = field(default_factory=Resolver)
    shared: tuple[tuple[str, tuple[str, ...]], ...] = ()
    """The topics that several nodes publish, and those nodes, by their whole names: a message need not identify its
    publisher."""


@dataclass(frozen=True, slots=True)
class NodeEnds:
    """What the plan says of a node's publishers and subscribers: `files` whose code creates them, and the quality of
    service of topics (as the node names them) that no code tells."""

    node: str
    files: tuple[Path, ...] = ()
    qualities: tuple[tuple[str, Quality, Span], ...] = ()


@dataclass(frozen=True, slots=True)
class Plan:
    """A whole plan.yaml, checked against its schema and against the contract's names."""

    system: str
    title: str
    path: Path
    contract_files: tuple[Path, ...]
    model: Located = NOWHERE
    messages: tuple[Path, ...] = ()
    connections: tuple[Edge, ...] = ()
    environment: tuple[EnvironmentInput, ...] = ()
    scenario: Scenario | None = None
    requirements: tuple[Requirement, ...] = ()
    compose: tuple[ComposeGoal, ...] = ()
    nodes: tuple[NodePlan, ...] = ()
    policy: Located = NOWHERE
    expected: tuple[Finding, ...] | None = None
    """None: no reproduction of known-bad material; a tuple (even empty): strict both ways."""
    accepted: tuple[Finding, ...] = ()
    plugins: tuple[str, ...] = ()
    """Modules with further backends."""
    lints_off: tuple[str, ...] = ()
    subsystems: tuple[Subsystem, ...] = ()
    statements: tuple[Statement, ...] = ()
    ros: Ros = Ros()
    launched: Launched | None = None
    """What the launch files start; None if the plan names none."""
    included: tuple[Path, ...] = ()
    """Files of hazards, launch files, and files of other systems that are included as subsystems: this plan depends on
    them too."""
    hazards: tuple[Hazard, ...] = ()
    ends: tuple[NodeEnds, ...] = field(default=(), metadata=codec.LATER)
    records: tuple[Path, ...] = field(default=(), metadata=codec.LATER)
    """Files that record quality of service."""

    @property
    def root(self) -> Path:
        """The system's folder; every path in the plan is relative to it and stays within it."""
        return self.path.parent

    @property
    def off(self) -> frozenset[str]:
        """The lints that are switched off: codes, and lints about topics of an input that is memory and about
        definitions that a formula of the plan names."""
        memory = ((entry.node, port) for entry in self.nodes if entry.source for port in entry.source.memory)
        formulas = [text for r in self.requirements for text in (r.formula, r.temporal)]
        formulas += [*(e.assume for e in self.environment), *(e.initial for e in self.connections)]
        options = (method.options.data for entry in self.nodes for method in entry.methods)
        formulas += [str(given.get("invariants")) for given in options if isinstance(given, Mapping)]
        used = {word for text in formulas for word in re.findall(r"(?<![.\w])\w+", text or "")}
        topics = (uncarried(node, f"in.{port}") for node, port in memory)
        return frozenset((*self.lints_off, *topics, *map(unspoken, used)))

    def node(self, name: str) -> NodePlan:
        """The plan of a node; a node that the plan does not mention has no methods and criticality ``medium``."""
        return _by_name(self.nodes).get(name) or NodePlan(name, "medium", ())


@by_identity(20_000)
def _by_name(nodes: tuple[NodePlan, ...]) -> dict[str, NodePlan]:
    """The first of a name is kept."""
    return {node.node: node for node in reversed(nodes)}


@dataclass(frozen=True, slots=True)
class System:
    """A checked contract and the plan for it: the input of every later stage."""

    plan: Plan
    contract: Contract

    @property
    def name(self) -> str:
        return self.plan.system

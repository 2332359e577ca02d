"""The assurance case as data: the only source of every report format.

One frozen object holds it all, so that two formats cannot disagree. The pipeline passes in the first part (`RunInfo`,
`ToolInfo`, `MethodInfo`, `Derivation`; `Discrepancy` is the audit's), and `conclude` makes the second. Times and dates
are texts in ISO 8601; paths are relative to the workspace; every text is data, never markup.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum

from avow.assurance.answers import Answers, Assumption, Baseline, Changes, Deficit, Level, Tone, WeakestEvidence
from avow.assurance.certification import Grade, KernelRun, ProofView, Trusted
from avow.assurance.hazards import HazardView
from avow.assurance.naming import is_advice
from avow.assurance.policy import Policy
from avow.assurance.rates import RateView
from avow.assurance.standards import StandardView
from avow.base import codec
from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.verdict import Link, Verdict
from avow.evidence.audit import Discrepancy
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Kind, Obligation
from avow.evidence.record import Evidence
from avow.evidence.status import Status
from avow.system.plan import Statement, Validation
from avow.system.probability import Probability


@dataclass(frozen=True, slots=True)
class RunInfo:
    """The run that requested this case. `limits` are what is needed to reproduce it (seed, seconds, megabytes…)."""

    id: str
    started: str
    seconds: float
    avow_version: str
    fresh: bool = False
    """Whether every cache was ignored (``avow verify --fresh``)."""
    command: str = ""
    revision: str = ""
    """The git revision of the workspace, if there is one."""
    limits: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ToolInfo:
    """A tool as found on the machine; `version` is None if it is missing."""

    name: str
    version: str | None
    install: str = ""


@dataclass(frozen=True, slots=True)
class MethodInfo:
    """A kind of method that could be used: one backend, in the core's terms."""

    name: str
    title: str
    strength: Verdict
    link: Link
    green_means: str = ""
    available: bool = True
    install: str = ""
    unsuited: tuple[str, ...] = ()
    """Nodes whose contracts do not have the form that it verifies: it is not suggested for them."""


@dataclass(frozen=True, slots=True)
class SideCondition:
    """One side condition of a rule's application: its text, and the composition obligation that discharges it."""

    text: str
    obligation: str
    """An obligation's full id; empty if the condition holds by form alone."""


@dataclass(frozen=True, slots=True)
class Derivation:
    """One derivation of the calculus, or one instance of a rule. `text` has it in the paper's notation, in lines;
    `premises` are nodes, whose guarantees it rests on, or derivations; `conditional` are the hypotheses of its
    conclusion."""

    name: str
    rule: str
    text: str
    conclusion: str
    premises: tuple[str, ...] = ()
    side_conditions: tuple[SideCondition, ...] = ()
    conditional: tuple[str, ...] = ()


class Currency(StrEnum):
    """Whether a record still counts, and if not, why; computed, never stored."""

    CURRENT = "current"
    SUPERSEDED = "superseded"
    """A newer attempt with the same key gave the same result, or answered where this one failed to."""
    SET_ASIDE = "set aside"
    """Of another run, and this run uses no earlier support (``--fresh``)."""
    STALE = "stale"
    """The claim, an input, an option or a tool has changed since."""
    EXPIRED = "expired"
    """The record was valid until a day (``valid_until`` in its details) that has passed."""
    WITHDRAWN = "withdrawn"
    """The plan no longer uses this method for this claim."""


@dataclass(frozen=True, slots=True)
class EvidenceView:
    entry: Entry
    currency: Currency
    counts: bool
    """Whether it contributes to the claim's status: exactly if it is current."""


@dataclass(frozen=True, slots=True)
class Handled:
    """A finding of the plan that was matched: `how` is ``expected`` or ``accepted``."""

    how: str
    pattern: str
    verdict: str
    method: str
    reason: str
    who: str
    date: str
    expires: str
    expired: bool
    obligations: tuple[str, ...]
    """The obligations that it covers; empty: none."""
    matched: tuple[str, ...] = ()
    """As the plan records it, if the pattern has wildcards."""
    unlisted: tuple[str, ...] = ()
    """Further matches of the wildcards: they are not handled."""
    found: str = field(default="", metadata=codec.LATER)
    """The mark of the finding that is meant, as the plan records it; empty: any finding."""
    now: str = field(default="", metadata=codec.LATER)
    """The mark of the present finding, if the plan has another or none: a finding with another mark is not handled."""
    says: str = field(default="", metadata=codec.LATER)
    """An accepted assumption in plain words."""


@dataclass(frozen=True, slots=True)
class Suggestion:
    """The cheapest step that would close a gap. `cost` orders suggestions and has no other meaning."""

    text: str
    method: str = ""
    cost: int = 0


@dataclasses.dataclass(frozen=True)  # without slots: it caches the records that count, which every format needs
class ObligationView:
    """One obligation with everything known about it."""

    obligation: Obligation
    criticality: str
    status: Status
    """By its own evidence alone; no format counts it."""
    standing: Status
    """The status with all claims below it: `unsupported` if its own evidence is good but one of them fails."""
    evidence: tuple[EvidenceView, ...]
    """Oldest first."""
    planned: tuple[tuple[str, str], ...]
    """(method, key as of now) of every attempt that the plan asks for."""
    rests_on: tuple[str, ...] = ()
    below: tuple[str, ...] = ()
    """Claims below it that fail by their own evidence."""
    hypotheses: tuple[str, ...] = ()
    link: Link | None = None
    handled: str = ""
    """``expected`` or ``accepted``, if the plan handles its finding."""
    suggestion: Suggestion | None = None
    level: Level | None = field(default=None, metadata=codec.LATER)
    """For a requirement's own obligation: how far the requirement is shown."""

    @property
    def id(self) -> str:
        return self.obligation.id

    @property
    def word(self) -> Level | Status:
        """How it stands, in the term that every format uses."""
        return self.level or self.standing

    @property
    def passes(self) -> bool:
        """Whether it is shown: not by a person's reason in place of evidence, and a requirement's claim only if the
        requirement is."""
        holds, own = (self.level.holds, self.status) if self.level else (self.standing.supports, self.standing)
        return holds and own is not Status.JUSTIFIED

    @property
    def advice(self) -> bool:
        """Whether its failure is useful to know, but makes nothing unsound."""
        return is_advice(self.obligation)

    @functools.cached_property
    def counting(self) -> tuple[EvidenceView, ...]:
        return tuple(view for view in self.evidence if view.counts)

    @functools.cached_property
    def records(self) -> tuple[Evidence, ...]:
        """The records that count, without their places in the ledger."""
        return tuple(view.entry.evidence for view in self.counting)


@dataclass(frozen=True, slots=True)
class RequirementView:
    """A system requirement: the answer that a reader looks for first."""

    id: str
    text: str
    formula: str
    temporal: str
    supported_by: tuple[str, ...]
    """As the plan names them."""
    rests_on: tuple[str, ...]
    """The claims that those names denote."""
    unknown_names: tuple[str, ...]
    """Names under `supported_by` that denote nothing."""
    status: Status
    """The lowest status below it, persons' reasons included. No format shows it: the one that stands is `level`."""
    weakest: str
    weakest_status: Status
    below: tuple[str, ...]
    hypotheses: tuple[str, ...]
    link: Link | None
    obligations: tuple[str, ...]
    """Its own obligations (entailment, model checking), if it has a formula or a temporal property."""
    answer: str
    """One line for readers."""
    level: Level = Level.NOT_SHOWN
    """How far it is shown: the term that every format uses."""
    bounded: bool = False
    """Whether its formula or property was discharged within the plan's finite scenario only."""
    tone: Tone = Tone.RED
    closure: tuple[str, ...] = ()
    """Every obligation below it, closed: a guarantee with what discharges its node's assumptions, and so on."""
    failing: tuple[str, ...] = ()
    """Those of them that do not hold."""
    weakest_evidence: WeakestEvidence | None = None
    supposes: tuple[str, ...] = ()
    """Keys of assumptions."""
    expired: bool = False
    """Whether one of these is past its last day."""
    rate: RateView | None = field(default=None, metadata=codec.LATER)
    """How often it may fail, if it rests on samples."""
    too_often: str = field(default="", metadata=codec.LATER)
    """The reason why its samples do not show the probability that is asked; empty if they do, or none is asked."""
    searched: str = field(default="", metadata=codec.LATER)
    """What bounds it, and how far that was searched; empty if nothing does."""
    span: Span | None = None
    validation: Validation | None = None
    validated: bool = False
    """Whether a person has read its present sentence against its present formula and support."""
    outdated: bool = False
    """Whether a person has read another sentence, formula or support."""
    linked: str = ""
    """Digest of the contract's text for the names under `supported_by`."""
    source: str = field(default="", metadata=codec.LATER)
    """The document that it comes from, and the position in it."""
    probability: Probability | None = field(default=None, metadata=codec.LATER)
    """None: its formula has to hold without exception."""

    @property
    def formal(self) -> str:
        """Its formula, with the probability that is asked, or temporal property; empty if it is prose."""
        return f"{self.formula}, {self.probability.words}" if self.probability else self.formula or self.temporal

    @property
    def meaning(self) -> str:
        """A digest of its text and formulas, and of the names under `supported_by`."""
        likely = (self.probability.words,) if self.probability else ()
        return sha256("\n".join((self.text, self.formula, self.temporal, *likely, *self.supported_by)))

    @property
    def noted(self) -> str:
        """The text beside its level: how often it may fail, how far it was searched, why it is not green."""
        why = "an assumption has no owner or end" * (self.level is Level.SHOWN and self.tone is Tone.AMBER)
        parts = (self.rate.brief if self.rate and self.rate.bound else "", self.searched or why)
        return "; ".join(part for part in parts if part) if self.level.holds else ""

    @property
    def stands(self) -> str:
        return f"{self.level} ({self.noted})" if self.noted else f"{self.level}"

    @property
    def awaits_validation(self) -> bool:
        """Whether only a person's validation of the sentence against the formula is missing."""
        fails = self.failing or self.unknown_names or self.expired or self.too_often
        return not (self.level.holds or fails) and self.status.supports

    @property
    def words(self) -> str:
        """Its text, in the plan's words if there are any."""
        return self.text or self.formal


@dataclass(frozen=True, slots=True)
class DerivationView:
    """A derivation and its status. `conditional` is what no obligation discharges."""

    derivation: Derivation
    status: Status
    weakest: str
    weakest_status: Status
    below: tuple[str, ...]
    rests_on: tuple[str, ...]
    conditional: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class NodeView:
    name: str
    criticality: str
    methods: tuple[tuple[str, str], ...]
    """(method id, backend)."""
    guarantees: tuple[tuple[str, str], ...]
    """(clause name, sentence or formula)."""
    assumptions: tuple[tuple[str, str], ...]
    title: str = ""
    """The node's name for readers."""
    discharged_by: tuple[str, ...] = ()
    """The obligations (without the system) that discharge its assumptions: its guarantees count only with these."""
    inputs: tuple[tuple[str, str], ...] = field(default=(), metadata=codec.LATER)
    """(input, the node that feeds it; empty: the environment does)."""


@dataclass(frozen=True, slots=True)
class EnvironmentView:
    port: str
    assume: str
    because: str
    constant: bool = False
    """Whether it is declared to have the same value at every step."""
    nodes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SourceView:
    """A text that the case was made from, unchanged: a contract with its comments, the plan, or a parameter file."""

    path: str
    """Relative to the workspace; `Case.digests` has the text's SHA-256 under the same name."""
    text: str

    @property
    def is_contract(self) -> bool:
        return self.path.endswith(".rcl")


@dataclass(frozen=True, slots=True)
class OpenItem:
    """Something that a reader must know before believing the rest. `kind` is a status word, ``expired`` or the like."""

    kind: str
    claim: str
    text: str
    suggestion: str = ""
    handled: str = ""
    advice: bool = False
    """Useful to know, but no gate fails for it."""
    title: str = ""
    """The claim, in a sentence."""
    reason: str = ""
    """The reason, in the words of the plan's `expected` or `accepted`."""


@dataclass(frozen=True, slots=True)
class Gate:
    """One demand of the policy. `claims` are those that fail it; `excused` those that the plan's findings excuse."""

    id: str
    title: str
    passed: bool
    reason: str
    claims: tuple[str, ...] = ()
    suggestions: tuple[Suggestion, ...] = ()
    excused: tuple[str, ...] = ()
    asks: str = ""
    """The policy's demand, as a phrase, if the title does not give all of it."""
    tool_failure: bool = False
    """It fails only because a tool is missing or broke (exit code 3)."""
    idle: bool = False
    """The policy asks nothing here: that the gate does not fail has no meaning."""
    relaxed: bool = field(default=False, metadata=codec.LATER)
    """The plan's policy accepts statuses that support nothing, as no profile does."""

    @property
    def state(self) -> str:
        passes = "passes but for findings that the plan excuses" if self.excused else "passes"
        passes += ", relaxed by the plan" if self.relaxed else ""
        return "does not apply" if self.idle else passes if self.passed else "fails"

    @property
    def mark(self) -> str:
        """The mark shown beside the state."""
        return "–" if self.idle else "✘" if not self.passed else "◐" if self.excused or self.relaxed else "✔"


@dataclass(frozen=True, slots=True)
class Case:
    """The whole case. `exit_code`: 0 every gate passes; 1 one fails; 3 one fails because of a tool, and no other."""

    system: str
    title: str
    today: str
    run: RunInfo
    grade: Grade
    grade_reason: str
    fresh: bool
    """Whether every answer was computed in this run, and every digest verified."""
    freshness: str
    """The reason for `fresh`."""
    kernel: KernelRun
    proofs: tuple[ProofView, ...]
    trusted: tuple[Trusted, ...]
    policy: Policy
    exit_code: int
    ledger_head: str
    digests: tuple[tuple[str, str], ...]
    answers: Answers
    requirements: tuple[RequirementView, ...]
    assumptions: tuple[Assumption, ...]
    deficits: tuple[Deficit, ...]
    changes: Changes
    open_items: tuple[OpenItem, ...]
    nodes: tuple[NodeView, ...]
    obligations: tuple[ObligationView, ...]
    derivations: tuple[DerivationView, ...]
    environment: tuple[EnvironmentView, ...]
    findings: tuple[Handled, ...]
    gates: tuple[Gate, ...]
    tools: tuple[ToolInfo, ...]
    methods: tuple[MethodInfo, ...]
    discrepancies: tuple[Discrepancy, ...]
    audited: bool
    """Whether every digest was computed again for this case; otherwise no discrepancy can be known."""
    strict: bool
    """Whether the plan lists the expected findings (strictly: all of these and no others)."""
    orphans: tuple[Entry, ...] = ()
    """Evidence for claims that no longer exist."""
    left_out: int = field(default=0, metadata=codec.LATER)
    """Records of earlier states that only the ledger has."""
    hazards: tuple[HazardView, ...] = field(default=(), metadata=codec.LATER)
    standard: StandardView | None = field(default=None, metadata=codec.LATER)
    """The objectives of the standard that the policy names."""
    graph_svg: str = ""
    """The dataflow diagram; shown as an image, never as markup."""
    statements: tuple[Statement, ...] = ()
    """The plan's words for the assumptions."""
    baseline: Baseline | None = None
    """The last signed report, as far as this one is compared with it."""
    sources: tuple[SourceView, ...] = ()
    """Contracts first, then the plan. No verdict depends on them; the remarks on how they are written do."""
    earlier: bool = False
    """Whether the system cannot be read now, or is gone: this case is then its earlier state."""

    def obligation(self, name: str) -> ObligationView:
        """The obligation of that id. Raises KeyError."""
        return _by_id(self.obligations)[name]

    @property
    def guarantees(self) -> tuple[ObligationView, ...]:
        return tuple(view for view in self.obligations if view.obligation.kind is Kind.GUARANTEE)

    @property
    def listed(self) -> tuple[RequirementView, ...]:
        """The requirements that have a row of their own on the first screen, in their order there."""
        known = {r.id: r for r in self.requirements}
        return tuple(known[name] for name in self.answers.listed)

    def said(self, name: str) -> Handled | None:
        """The plan's entry for a claim's finding: the first with a reason that matches it, else any."""
        matching = [finding for finding in self.findings if name in finding.obligations]
        return next((f for f in matching if f.reason), matching[0] if matching else None)

    @property
    def good(self) -> bool:
        return self.exit_code == 0


@by_identity(4)
def _by_id(views: tuple[ObligationView, ...]) -> Mapping[str, ObligationView]:
    return {view.id: view for view in reversed(views)}

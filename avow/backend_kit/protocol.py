"""The interface between a verification backend and the core.

A backend is a module-level object named in the entry-point group ``avow.backends`` (or the attribute ``BACKEND`` of a
module that a plan names under ``plugins``). The core calls `export` (pure) and `discharge` (the only place that runs a
tool) and makes the evidence records; a backend never writes to the ledger and never reads a clock for it.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, get_origin, get_type_hints

from avow.backend_kit.further import Further
from avow.base.codes import Code
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.records import dataclass
from avow.base.tools import Tool
from avow.base.verdict import Counterexample, Isolation, Link, Object, Outcome, Verdict
from avow.evidence.obligation import Obligation, ProgramClaim
from avow.evidence.record import RETRY
from avow.formulas.formula import substitute
from avow.formulas.values import Value
from avow.isolation.level import Unavailable
from avow.isolation.observed import Observed
from avow.language.contract import Clause, ClauseKind, Contract, Node
from avow.language.subterms import ports_of
from avow.language.terms import Role
from avow.system.formulas import initial_condition
from avow.system.graph import dataflow
from avow.system.plan import Driving, Edge, Method, Source, System

__all__ = [
    "COMMON_OPTIONS",
    "Backend",
    "Job",
    "Judged",
    "JudgedRun",
    "Limits",
    "NoModel",
    "Opens",
    "OutsideCheck",
    "Report",
    "Tool",
    "Translated",
    "asking",
    "lacks",
    "wired",
]


COMMON_OPTIONS = frozenset({"id", "guarantees", "seconds", "megabytes", "seed"})
"""Options of every method, for any backend: the pipeline reads and checks them. `id` names the method in records and
commands, `guarantees` are those that it discharges, the others are `Limits`."""


class Opens(StrEnum):
    """How a method treats the parameters of a contract."""

    INPUT = "input"
    """Its program has each as an input; an assumption gives the value, if there is one."""
    VALUES = "values"
    """Its program is made with them: without a value in the plan, once with each of some values."""
    ANY = "any"
    """As any other input; one with a value is a constant."""
    REFUSED = "refused"
    """It needs their values."""


@dataclass(frozen=True, slots=True)
class Job:
    """One method of one node: everything that a backend may read."""

    system: System
    node: Node
    method: Method
    obligations: tuple[Obligation, ...]
    """Kind GUARANTEE, one for each clause that the method discharges; `Obligation.name` is the clause's name."""
    claims: tuple[Obligation, ...] = ()
    """Kind PROGRAM, one for each of the backend's `claims`: they are answered with the obligations."""
    kept: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    """Obligation's id → cases that refuted it once, as this backend put them under `record.CASE` into an outcome's
    details. A backend that stores cases tries them first, with any options."""
    further: tuple[Further, ...] | None = None
    """For a method that judges recorded data (`Backend.compares`): the other claims that these may contradict."""

    @property
    def every(self) -> tuple[Obligation, ...]:
        """All obligations and claims to be answered."""
        return self.obligations + self.claims

    @property
    def contract(self) -> Contract:
        return self.system.contract

    @property
    def root(self) -> Path:
        """The system's folder: paths in the options are relative to it."""
        return self.system.plan.root

    @property
    def source(self) -> Source | None:
        """The node's program according to the plan."""
        return self.system.plan.node(self.node.name).source

    @property
    def remembered(self) -> tuple[Edge, ...]:
        """The connections over which the node gets back what its program keeps under `memory`."""
        source = self.source
        if source is None or not source.memory:
            return ()
        return tuple(e for e in dataflow(self.system).feeding(self.node.name) if e.target.port in source.memory)

    @property
    def begins(self) -> tuple[Clause, ...]:
        """The plan's first values of what the program itself keeps, as assumptions about these inputs."""
        found = []
        for edge in self.remembered:
            term, port = initial_condition(self.system, edge), edge.target.port
            if term is not None:
                held = {v: replace(v, role=Role.INPUT, name=port) for v in ports_of(term) if v.role is Role.OUTPUT}
                found.append(Clause(ClauseKind.ASSUMPTION, f"initial {port}", 0, substitute(term, held)))
        return tuple(found)

    @property
    def options(self) -> Mapping[str, Any]:
        """The method's options for the backend itself, as its schema describes them; empty if the plan gives no
        mapping."""
        return {key: value for key, value in self._given.items() if key not in COMMON_OPTIONS}

    @property
    def seed(self) -> int:
        """The plan's seed for this method, or 0."""
        seed: int = self._given.get("seed", 0)
        return seed

    @property
    def _given(self) -> Mapping[str, Any]:
        data = self.method.options.data
        return data if isinstance(data, Mapping) else {}

    def clause(self, obligation: Obligation) -> Clause:
        return self.node.clause(obligation.name)


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds on one discharge: wall-clock seconds and memory (MB) for each tool process; the random seed."""

    seconds: float = 60.0
    megabytes: int = 4096
    seed: int = 0
    asked: bool = False
    """The seconds were given on the command line: they replace the plan's and an engine's own."""


@dataclass(frozen=True, slots=True)
class Report:
    """The result of one call of `discharge`. `tool` is the engine that really answered."""

    outcomes: tuple[Outcome, ...]
    tool: str
    tool_version: str
    command: tuple[str, ...] = ()
    logs: Mapping[str, str] = field(default_factory=dict)
    """Name → text of logs and results to be kept beside the artifacts."""
    observed: tuple[Observed, ...] = ()
    """What the program under test read; it is part of the answer's key. If it contains `Seen.OUTSIDE`, every run
    repeats the answer."""
    isolation: Isolation = Isolation.NONE
    """How the program under test was isolated from its oracle."""
    contradicted: tuple[Outcome, ...] = ()
    """Refutations of claims that the job does not answer, by its data. `Outcome.obligation` is the claim's id without
    the system, or an assumption's (`avow.backend_kit.further`)."""

    @classmethod
    def alike(cls, job: Job, verdict: Verdict, summary: str, tool: str, tool_version: str) -> Report:
        """The same answer for every obligation and claim of the job: the tool is missing, an input is at fault, …"""
        return cls(tuple(Outcome(o.id, verdict, summary) for o in job.every), tool, tool_version)

    @classmethod
    def unanswered(cls, job: Job, verdict: Verdict, why: str, tool: str, tool_version: str) -> Report:
        """For a process that did not answer: the cause is unknown, and the next run re-runs it."""
        outcomes = (Outcome(o.id, verdict, why, details={RETRY: True}) for o in job.every)
        return cls(tuple(outcomes), tool, tool_version)

    @classmethod
    def unsealed(cls, job: Job, why: Unavailable, tool: str, tool_version: str) -> Report:
        """For a missing but required sandbox: the next run re-runs it."""
        return cls.unanswered(job, Verdict.NOT_RUN, str(why), tool, tool_version)


@dataclass(frozen=True, slots=True)
class OutsideCheck:
    """How a person checks a file without Avow."""

    file: Path
    """The file that holds the claim; absolute."""
    command: tuple[str | Path, ...]
    """Arguments of a command, run in the workspace's folder; a path is shown relative to it. Equal for all guarantees
    that one run decides."""
    guarantees: tuple[str, ...]
    """The guarantees that hold only if this check passes."""
    prints: str = ""
    """A line that the command prints exactly if the check passes. Empty: then it exits with code 0."""


@dataclass(frozen=True, slots=True)
class Translated:
    """A node in a notation of a backend's own."""

    files: Mapping[str, str]
    """Name → text; names are relative to a folder of the node's own. None if nothing of the node can be translated."""
    missing: tuple[Diagnostic, ...] = ()
    """A warning for each missing guarantee, with the reason."""


@dataclass(frozen=True, slots=True)
class Judged:
    """The result of a clause in one run of messages."""

    held: int = 0
    broken: int = 0
    """With no assumption broken."""
    excused: int = 0
    """With an assumption broken."""
    undecided: int = 0
    met: tuple[bool, ...] = ()
    """Of each condition under which it demands something: whether it was met."""
    shown: Counterexample | None = None
    """The first breach, or the first output value that is not of its type."""
    at: int = 0
    """The event at which that was, from 1."""
    reason: str = ""
    """Why something is undecided."""
    open: bool = False
    """The run ends before a response is due."""
    distance: float | None = None
    """In a recording: the least distance of a judgement from a breach, negative after one; None if none has one."""


@dataclass(frozen=True, slots=True)
class JudgedRun:
    """The contract's verdict on one run of messages."""

    clauses: Mapping[str, Judged]
    """Guarantee → its result."""
    assumption: tuple[int, str] | None = None
    """The first event (from 1) that breaks an assumption or whose input is no value of its type, and why."""
    unseen: tuple[str, ...] = ()
    """The assumptions that were not judged: the messages do not have their inputs."""


class NoModel(Exception):  # noqa: N818 - it names a state
    """There is no model to run, or it has no answer."""


_IN_WORKERS = frozenset({"discharge", "model", "steps"})
"""Methods that only a worker's process calls: an exception is the verdict `error`, with the traceback as its log."""

_MADE_WHOLE: Mapping[str, tuple[Callable[[Any], Any], type]] = {
    "tools": (tuple, Tool),
    "check": (tuple, Diagnostic),
    "files": (tuple, Path),
    "outside_checks": (tuple, OutsideCheck),
    "export": (dict, str),
}
"""Methods whose answer is listed at once, so that an exception of a generator is attributed to them; with the item's
type."""


@contextlib.contextmanager
def asking(name: str, part: str) -> Iterator[None]:
    """Reports an exception of a backend that was called in Avow's own process as the backend's defect. Raises
    Rejected."""
    try:
        yield
    except Rejected:
        raise
    except (Exception, SystemExit) as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        why = f"{type(error).__name__}: {error}, at {place.filename}:{place.lineno}"
        raise Rejected(Diagnostic("BACKEND008", f"the backend '{name}' failed in {part}: {why}")) from error


def _told(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
    """A backend's method, wrapped so that an exception is reported as the backend's defect."""

    @functools.wraps(method)
    def checked(tool: Backend, *arguments: Any, **named: Any) -> Any:
        with asking(tool.name, name):
            made = method(tool, *arguments, **named)
            if name not in _MADE_WHOLE:
                return made
            gather, kind = _MADE_WHOLE[name]
            whole = gather(made)
            for one in whole.values() if isinstance(whole, dict) else whole:
                if not isinstance(one, kind):
                    raise TypeError(f"{one!r} is no {kind.__name__}")
            return whole

    return checked


class Backend(ABC):
    """A verification method. A backend must define the attributes without a value here; the others have defaults.

    See `docs/developers/adding-a-backend.md`; `avow.conformance` checks a backend against all of this.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        for name in _asked() - _IN_WORKERS:
            method = inspect.getattr_static(cls, name)
            if not isinstance(method, staticmethod | classmethod):
                setattr(cls, name, _told(name, method))

    name: str
    """Its name in plans: a word of small letters, digits, `_` and `-`."""
    title: str
    """What it does, in one line, for the report."""
    version: str
    """Raised when the translation or the reading of answers changes: old evidence is then stale."""
    strength: Verdict
    """The strongest verdict that it may give."""
    link: Link
    """How its input relates to the contract's formula; an outcome may override it."""
    options_schema: Mapping[str, Any]
    """JSON schema (2020-12) of the method's own options in plan.yaml (not of `COMMON_OPTIONS`)."""
    green_means: str
    """What a good verdict of this backend shows and does not show, in a sentence or two."""

    uses_scenario: bool = True
    """Whether an answer may depend on the plan's scenario. False only if it cannot: with False a change there re-runs
    nothing, so that stale evidence would look current."""
    uses_steps: bool = True
    """Whether an answer may depend on the scenario's `steps`; likewise."""
    uses_wiring: bool = True
    """Whether an answer may depend on topics, connections or other nodes; likewise. For a callback class it always may
    (`wired`)."""
    uses_upstream: bool = False
    """Whether an answer may depend on the contracts of all nodes upstream (of all nodes at all where it `compares`),
    and on the same backend's options for them. With False the job has no clause of another node."""
    remembers: bool = False
    """Whether it judges clauses about other steps (`avow.formulas.temporal`), or does not read formulas at all. Other
    backends never see such a clause: the guarantee is refused by name."""
    chances: bool = False
    """Whether it judges guarantees with a probability by `Clause.chance`; their formula is TRUE. Other backends never
    see such an obligation."""
    uses_source: bool = False
    """Whether an answer may depend on the node's `source:`, `numbers:` and `memory:`. With False they are not in the
    job."""
    needs_source: str = ""
    """The key of `source:` that it cannot do without (`cpp`, `python`): reports suggest it only for nodes with one."""
    uses_criticality: bool = False
    """Whether an answer may depend on the node's `criticality:`. With False it is empty in the job."""
    claims: tuple[ProgramClaim, ...] = ()
    """Its claims about the node's program besides the guarantees (`Job.claims`)."""
    runs_models: bool = False
    """Whether what it verifies is a model that can be run on single inputs (`model`)."""
    not_run: str = ""
    """Why its models cannot be run on single inputs, in words: reported when a program is compared with the node's
    models."""
    records: bool = False
    """Whether its options name recordings of the running node, whose steps it can extract (`steps`)."""
    judges_runs: bool = False
    """Whether it can judge runs of messages that another backend makes (`judge`)."""
    campaigns: str = ""
    """The option under which it has recorded runs judged by the node's monitors (`judges_runs`). With that option, an
    answer depends on the monitors' options and files, and on topics, connections and scenario. Empty: it has none."""
    of: Object = Object.MODEL
    """The kind of artifact that it verifies; an outcome may override it."""
    portable: bool = False
    """Whether an answer depends only on the job and the bytes of `files`: not on the exported files, on other files of
    the system's folder, or on what they start. Such a job can run on another machine; others run where the workspace
    is."""
    codes: Mapping[str, Code] = {}
    """The diagnostic codes that `check` and `translate` use (`avow.base.codes.register`)."""
    translations: Mapping[str, str] = {}
    """Notation for `avow translate --to …` → what it is, in a few words."""

    def tools(self) -> tuple[Tool, ...]:
        """The outside tools that it can use, as found now. Cheap; never raises."""
        return ()

    def suits(self, node: Node) -> bool:
        """Whether the node's contract suits the backend: reports suggest it only then. Cheap; a guess is good
        enough."""
        return True

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        """Why a backend that `remembers` cannot check a guarantee about other steps, or one whose node has such an
        assumption; None if it can. See `avow.backend_kit.one_step`."""
        return None

    def answers_itself(self, job: Job) -> bool:
        """Whether a backend that `remembers` itself answers what it cannot express in this job: `unsaid` is then not
        called."""
        return False

    def compares(self, job: Job) -> bool:
        """Whether recorded data are compared with `job.further`, too: not if another node's method does it."""
        return self.of is Object.RECORDING

    def opens(self, job: Job) -> Opens:
        """How it treats parameters. See `avow.backend_kit.one_step`."""
        return Opens.REFUSED

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        """Faults of the plan's options: missing files, unknown names, models that do not parse."""
        return ()

    def files(self, job: Job) -> tuple[Path, ...]:
        """The files of the plan (programs, data, reviews) that the answer depends on; absolute, including missing ones.
        Never raises for faulty options."""
        return ()

    def export(self, job: Job) -> Mapping[str, str]:
        """Relative path → text of every generated file. Pure: same job, same bytes; no clock, no tool. Raises Rejected
        with the faults that `check` reports, or leaves out what cannot be expressed."""
        return {}

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        """How a person checks the exported files without Avow; the node's `index.md` lists them. `folder` holds the
        files that `export` gave these names. None for a guarantee that Avow itself judges."""
        return ()

    @abstractmethod
    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        """Discharge `job.obligations` and `job.claims`, one outcome for each. `folder` holds the exported files. Never
        raises for faults of contract, plan or tool: a crash, a time-out, a missing tool are outcomes."""

    def model(self, job: Job) -> Callable[[Mapping[str, Value]], Mapping[str, Value]]:
        """The verified model as a function from one step's inputs to its outputs, by qualified name. Raises Rejected if
        the plan's input is at fault, and NoModel if there is no model to run; a call without an answer also raises
        NoModel."""
        raise NoModel(f"{self.name} has no model that can be run")

    def steps(self, job: Job) -> Iterator[tuple[Mapping[str, Value], ...]]:
        """The node's steps in each recording that the method's options name: the known inputs, by qualified name.
        Raises Rejected if one cannot be read."""
        raise NotImplementedError(self.name)

    def judge(self, job: Job) -> Callable[[Iterable[Mapping[str, Any]] | Path], JudgedRun]:
        """The contract's verdict on whole runs of messages on the node's topics: events as recordings have them
        (`topic`, `time` in seconds, fields; a last one without a topic gives the length), or a recording, by its
        path in the system's folder: what would be no evidence for a clause is undecided there. Uses the method's
        options in `avow.backend_kit.given.READING`, and all for a recording. Raises Rejected if they are at fault."""
        raise NotImplementedError(self.name)

    def contradictions(self, job: Job, recording: Path, outside: Mapping[str, str]) -> tuple[Outcome, ...]:
        """With `judge`: as `Report.contradicted`, the claims besides the job's that a recording refutes. `outside`: the
        assumptions or inputs of the job's node that were not kept on purpose, and why. Raises Rejected if the plan is
        at fault."""
        raise NotImplementedError(self.name)

    def translate(self, notation: str, system: System, node: Node) -> Translated:
        """The node in one of `translations`. Pure, like `export`. Raises Rejected if the input is at fault; clauses
        that the notation cannot express are in `Translated.missing`."""
        raise NotImplementedError(notation)


def _asked() -> frozenset[str]:
    """The methods of a backend."""
    return frozenset(name for name, one in vars(Backend).items() if inspect.isfunction(one) and name[0] != "_")


@functools.cache
def _required() -> Mapping[str, type]:
    """The attributes of a backend with their types, as annotated above."""
    return {name: get_origin(kind) or kind for name, kind in get_type_hints(Backend).items()}


def wired(tool: Backend, source: Source | None) -> bool:
    """Whether an answer may depend on topics, connections and other nodes. For a callback class, which gets its
    messages through them, this holds for every method that reads the source."""
    return tool.uses_wiring or (tool.uses_source and source is not None and source.kind is not Driving.STEP)


def lacks(found: object) -> str:
    """Why an object is no backend, in words; empty if it is one."""
    if not isinstance(found, Backend):
        return "it is no instance of avow.backend_kit.protocol.Backend"
    missing = [name for name in _required() if not hasattr(found, name)]
    if missing:
        return f"it lacks {', '.join(missing)}"
    wrong = [name for name, kind in _required().items() if not isinstance(getattr(found, name), kind)]
    return f"it has a wrong type in {', '.join(wrong)}" if wrong else ""

"""What a verification backend promises to the core, and what it gets from it.

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
from dataclasses import field
from pathlib import Path
from typing import Any, get_origin, get_type_hints

from avow.base.codes import Code
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.records import dataclass
from avow.base.tools import Tool
from avow.base.verdict import Counterexample, Isolation, Link, Object, Outcome, Verdict
from avow.evidence.obligation import Obligation, ProgramClaim
from avow.evidence.record import RETRY
from avow.formulas.values import Value
from avow.isolation.level import Unavailable
from avow.isolation.observed import Observed
from avow.language.contract import Clause, Contract, Node
from avow.system.plan import Driving, Method, Source, System

__all__ = [
    "COMMON_OPTIONS",
    "Backend",
    "Job",
    "Judged",
    "JudgedRun",
    "Limits",
    "NoModel",
    "OutsideCheck",
    "Report",
    "Tool",
    "Translated",
    "asking",
    "lacks",
    "wired",
]


COMMON_OPTIONS = frozenset({"id", "guarantees", "seconds", "megabytes", "seed"})
"""Options of every method, whatever its backend: they are the pipeline's, which reads and checks them. `id` names the
method in records and commands, `guarantees` are those that it takes on, the others are `Limits`."""


@dataclass(frozen=True, slots=True)
class Job:
    """One method of one node: all that a backend may look at."""

    system: System
    node: Node
    method: Method
    obligations: tuple[Obligation, ...]
    """Kind GUARANTEE, one for each clause that the method takes on; `Obligation.name` is the clause's name."""
    claims: tuple[Obligation, ...] = ()
    """Kind PROGRAM, one for each of the backend's `claims`: they are answered beside the obligations."""
    kept: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    """Obligation's id → cases that refuted it once, as this backend put them under `record.CASE` into an outcome's
    details. A backend that puts any there tries them first, whatever its options say."""

    @property
    def every(self) -> tuple[Obligation, ...]:
        """All that is to be answered."""
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
        """The program that the plan says the node is."""
        return self.system.plan.node(self.node.name).source

    @property
    def options(self) -> Mapping[str, Any]:
        """The method's options that are the backend's own, as its schema describes them; none where the plan gives no
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
    """A person gave the seconds on the command line: they stand in place of the plan's and of an engine's own."""


@dataclass(frozen=True, slots=True)
class Report:
    """All that one call of `discharge` found. `tool` is the engine that really answered."""

    outcomes: tuple[Outcome, ...]
    tool: str
    tool_version: str
    command: tuple[str, ...] = ()
    logs: Mapping[str, str] = field(default_factory=dict)
    """Name → text of logs and results to be kept beside the artifacts."""
    observed: tuple[Observed, ...] = ()
    """What the program under test was seen to look at; the core keys the answer by it. With something `Seen.OUTSIDE` in
    it the answer is re-run in every run."""
    isolation: Isolation = Isolation.NONE
    """How far the subject was kept from whoever judged it."""

    @classmethod
    def alike(cls, job: Job, verdict: Verdict, summary: str, tool: str, tool_version: str) -> Report:
        """The same answer for every obligation and claim of the job: the tool is missing, an input is at fault, …"""
        return cls(tuple(Outcome(o.id, verdict, summary) for o in job.every), tool, tool_version)

    @classmethod
    def unanswered(cls, job: Job, verdict: Verdict, why: str, tool: str, tool_version: str) -> Report:
        """Where the process that was to answer did not: what it hung on nobody knows, and the next run asks again."""
        outcomes = (Outcome(o.id, verdict, why, details={RETRY: True}) for o in job.every)
        return cls(tuple(outcomes), tool, tool_version)

    @classmethod
    def unsealed(cls, job: Job, why: Unavailable, tool: str, tool_version: str) -> Report:
        """Where a sandbox is required, and there is none: the next run asks again."""
        return cls.unanswered(job, Verdict.NOT_RUN, str(why), tool, tool_version)


@dataclass(frozen=True, slots=True)
class OutsideCheck:
    """How a person checks a file without Avow."""

    file: Path
    """The file that holds the claim; absolute."""
    command: tuple[str | Path, ...]
    """Words for the shell, run in the workspace's folder; a path is shown relative to it. The same for all guarantees
    that one run decides."""
    guarantees: tuple[str, ...]
    """The guarantees that hold only if this check passes."""
    prints: str = ""
    """A line that the command prints exactly if the check passes. Empty: then it exits with code 0."""


@dataclass(frozen=True, slots=True)
class Translated:
    """A node in a notation of a backend's own."""

    files: Mapping[str, str]
    """Name → text; names are relative to a folder of the node's own. None, where nothing of the node can be said."""
    missing: tuple[Diagnostic, ...] = ()
    """A warning for each guarantee that is not in them, with the reason."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What became of a clause in one run of messages."""

    held: int = 0
    broken: int = 0
    """With no assumption broken."""
    excused: int = 0
    """With an assumption broken."""
    undecided: int = 0
    triggered: bool = False
    """Its antecedent was met, or it has none."""
    shown: Counterexample | None = None
    """The first breach, or the first value of an output that is none of its type."""
    at: int = 0
    """The event at which that was, from 1."""
    reason: str = ""
    """Why something is undecided."""


@dataclass(frozen=True, slots=True)
class JudgedRun:
    """The contract's word on one run of messages."""

    clauses: Mapping[str, Judged]
    """Guarantee → what became of it."""
    assumption: tuple[int, str] | None = None
    """The first event (from 1) that breaks an assumption or whose input is no value of its type, and why."""


class NoModel(Exception):  # noqa: N818 - it names a state
    """There is no model to be run, or it has no answer."""


_IN_WORKERS = frozenset({"discharge", "model", "steps"})
"""Methods that only a worker's process asks: what they raise is the verdict `error`, with the traceback as its log."""

_MADE_WHOLE: Mapping[str, tuple[Callable[[Any], Any], type]] = {
    "tools": (tuple, Tool),
    "check": (tuple, Diagnostic),
    "files": (tuple, Path),
    "outside_checks": (tuple, OutsideCheck),
    "export": (dict, str),
}
"""Methods whose answer is gone through at once, so that what a generator raises is theirs, too; and what it has."""


@contextlib.contextmanager
def asking(name: str, part: str) -> Iterator[None]:
    """What a backend raises of itself where it is asked in Avow's own process, as its defect. Raises Rejected."""
    try:
        yield
    except Rejected:
        raise
    except (Exception, SystemExit) as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        why = f"{type(error).__name__}: {error}, at {place.filename}:{place.lineno}"
        raise Rejected(Diagnostic("BACKEND008", f"the backend '{name}' failed in {part}: {why}")) from error


def _told(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
    """A method of a backend, of which whoever calls it is told that what it raises is the backend's defect."""

    @functools.wraps(method)
    def told(tool: Backend, *arguments: Any, **named: Any) -> Any:
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

    return told


class Backend(ABC):
    """A verification method. What has no value here, a backend must say; the rest may stay as it is.

    See `docs/developers/adding-a-backend.md`; `avow.conformance` holds a backend to all of this.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        for name in _asked() - _IN_WORKERS:
            method = inspect.getattr_static(cls, name)
            if not isinstance(method, staticmethod | classmethod):
                setattr(cls, name, _told(name, method))

    name: str
    """As plans write it: a word of small letters, digits, `_` and `-`."""
    title: str
    """What it does, in one line, for the report."""
    version: str
    """Raised when the translation or the reading of answers changes: old evidence is then stale."""
    strength: Verdict
    """The best verdict that it may give."""
    link: Link
    """How what it verifies hangs together with the contract's formula; an outcome may say otherwise for itself."""
    options_schema: Mapping[str, Any]
    """JSON schema (2020-12) of the method's own options in plan.yaml (not of `COMMON_OPTIONS`)."""
    green_means: str
    """What a good verdict of this backend does and does not show, in a sentence or two."""

    uses_scenario: bool = True
    """Whether an answer may depend on the plan's scenario. Say False only if it cannot: a change there then re-runs
    nothing, and evidence that should be stale would look current."""
    uses_steps: bool = True
    """Whether an answer may depend on the scenario's `steps`; likewise."""
    uses_wiring: bool = True
    """Whether an answer may depend on topics, connections or other nodes; likewise. Of a callback class it always may
    (`wired`)."""
    uses_upstream: bool = False
    """Whether an answer may depend on the contracts of the nodes from which data reaches the node, over however many
    others, and on what the same backend is told of them. Where it is False the job has no clause of another node."""
    remembers: bool = False
    """Whether it judges clauses that speak of other steps (`avow.formulas.temporal`), or does not read formulas at all.
    The others are never shown such a clause: what the plan asks of them is refused by name."""
    uses_source: bool = False
    """Whether an answer may depend on the node's `source:`, `numbers:` and `memory:`. Where it is False they are not
    in the job at all."""
    uses_criticality: bool = False
    """Whether an answer may depend on the node's `criticality:`. Where it is False, that is empty in the job."""
    claims: tuple[ProgramClaim, ...] = ()
    """What it says of the node's program besides its guarantees (`Job.claims`)."""
    runs_models: bool = False
    """Whether what it verifies is a model that can be run on single inputs (`model`)."""
    not_run: str = ""
    """Why the models that it verifies cannot be run on single inputs, in words: told where a program is held against
    the node's models."""
    records: bool = False
    """Whether the plan names recordings of the running node to it, whose steps it can tell (`steps`)."""
    judges_runs: bool = False
    """Whether it can judge runs of messages that another backend makes (`judge`)."""
    of: Object = Object.MODEL
    """What is verified; an outcome may say otherwise for itself."""
    portable: bool = False
    """Whether an answer depends on the job and the bytes of `files` alone: not on the exported files, on other files of
    the system's folder, or on what they start. Such a work can be sent to another machine; others run where the
    workspace is."""
    codes: Mapping[str, Code] = {}
    """The diagnostic codes that `check` and `translate` use (`avow.base.codes.register`)."""
    translations: Mapping[str, str] = {}
    """Notation for `avow translate --to …` → what it is, in a few words."""

    def tools(self) -> tuple[Tool, ...]:
        """The outside tools that it can use, as found now. Cheap; never raises."""
        return ()

    def suits(self, node: Node) -> bool:
        """Whether the node's contract looks like what the backend verifies: only there do reports suggest it. Cheap; a
        guess is good enough."""
        return True

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        """Why a backend that `remembers` cannot be asked about a guarantee that speaks of other steps, or whose node
        assumes something that does; None where it can. See `avow.backend_kit.one_step`."""
        return None

    def answers_itself(self, job: Job) -> bool:
        """Whether of this job a backend that `remembers` answers itself for what it cannot say: `unsaid` is not
        asked."""
        return False

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        """What is wrong with the plan's options: missing files, unknown names, models that do not parse."""
        return ()

    def files(self, job: Job) -> tuple[Path, ...]:
        """The files of the plan (programs, data, reviews) that the answer depends on; absolute, also where they do not
        exist. Never raises for what the options say."""
        return ()

    def export(self, job: Job) -> Mapping[str, str]:
        """Relative path → text of every generated file. Pure: same job, same bytes; no clock, no tool. Raises Rejected
        with what `check` says, or leaves out what cannot be said."""
        return {}

    def outside_checks(self, job: Job, folder: Path, names: Sequence[str]) -> Iterable[OutsideCheck]:
        """How a person checks the exported files without Avow; the node's `index.md` lists them. `folder` holds the
        files that `export` gave these names. None for a guarantee that Avow itself judges."""
        return ()

    @abstractmethod
    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        """Settle `job.obligations` and `job.claims`, one outcome for each. `folder` holds the exported files. Never
        raises for what the contract, the plan or a tool may do: a crash, a time-out, a missing tool are outcomes."""

    def model(self, job: Job) -> Callable[[Mapping[str, Value]], Mapping[str, Value]]:
        """What it verifies, to be run on one step's inputs: both by qualified name. Raises Rejected where the plan's
        input is at fault, and NoModel where there is nothing to be run; so does a call that has no answer."""
        raise NoModel(f"{self.name} has no model that can be run")

    def steps(self, job: Job) -> Iterator[tuple[Mapping[str, Value], ...]]:
        """Of each recording that the method's options name the node's steps: the inputs that were known, by qualified
        name. Raises Rejected where one cannot be read."""
        raise NotImplementedError(self.name)

    def judge(self, job: Job) -> Callable[[Iterable[Mapping[str, Any]]], JudgedRun]:
        """The contract's word on whole runs of messages on the node's topics: events as recordings have them (`topic`,
        `time` in seconds, fields; at the end one without a topic says how long it was). Of the method's options those
        in `avow.backend_kit.given.READING` count. Raises Rejected where they are at fault."""
        raise NotImplementedError(self.name)

    def translate(self, notation: str, system: System, node: Node) -> Translated:
        """The node in one of `translations`. Pure, like `export`. Raises Rejected where the input is at fault: what the
        notation merely cannot say is `Translated.missing`."""
        raise NotImplementedError(notation)


def _asked() -> frozenset[str]:
    """The methods of a backend."""
    return frozenset(name for name, one in vars(Backend).items() if inspect.isfunction(one) and name[0] != "_")


@functools.cache
def _required() -> Mapping[str, type]:
    """What a backend says of itself, each with its type: what stands above, annotated."""
    return {name: get_origin(kind) or kind for name, kind in get_type_hints(Backend).items()}


def wired(tool: Backend, source: Source | None) -> bool:
    """Whether an answer may depend on topics, connections and other nodes: of a callback class, whose messages come by
    them, that of every method that looks at the source."""
    return tool.uses_wiring or (tool.uses_source and source is not None and source.kind is not Driving.STEP)


def lacks(found: object) -> str:
    """Why an object is no backend, in words; empty where it is one."""
    if not isinstance(found, Backend):
        return "it is no instance of avow.backend_kit.protocol.Backend"
    missing = [name for name in _required() if not hasattr(found, name)]
    if missing:
        return f"it lacks {', '.join(missing)}"
    wrong = [name for name, kind in _required().items() if not isinstance(getattr(found, name), kind)]
    return f"it has a wrong type in {', '.join(wrong)}" if wrong else ""

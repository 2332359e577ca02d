"""What a verification backend promises to the core, and what it gets from it.

A backend is a module-level object named in the entry-point group ``avow.backends`` (or the attribute ``BACKEND`` of a
module that a plan names under ``plugins``). The core calls `export` (pure) and `discharge` (the only place that runs a
tool) and makes the evidence records; a backend never writes to the ledger and never reads a clock for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from avow.base.diagnostics import Diagnostic
from avow.base.verdict import Link, Outcome, Verdict
from avow.evidence.obligation import Obligation
from avow.language.contract import Clause, Contract, Node
from avow.system.plan import Method, System


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool as found on this machine. `version` is None where it is missing; `install` is one command."""

    name: str
    version: str | None
    path: str | None
    install: str
    optional: bool = True

    @property
    def present(self) -> bool:
        return self.version is not None


@dataclass(frozen=True, slots=True)
class Job:
    """One method of one node: all that a backend may look at."""

    system: System
    node: Node
    method: Method
    obligations: tuple[Obligation, ...]
    """Kind GUARANTEE, one for each clause that the method takes on; `Obligation.name` is the clause's name."""

    @property
    def contract(self) -> Contract:
        return self.system.contract

    @property
    def root(self) -> Path:
        """The system's folder: paths in the options are relative to it."""
        return self.system.plan.root

    @property
    def options(self) -> Mapping[str, Any]:
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


@dataclass(frozen=True, slots=True)
class Report:
    """All that one call of `discharge` found. `tool` is the engine that really answered."""

    outcomes: tuple[Outcome, ...]
    tool: str
    tool_version: str
    command: tuple[str, ...] = ()
    logs: Mapping[str, str] = field(default_factory=dict)
    """Name → text of logs and results to be kept beside the artifacts."""


@dataclass(frozen=True, slots=True)
class Translated:
    """A node in a notation of a backend's own."""

    files: Mapping[str, str]
    """Name → text; names are relative to a folder of the node's own. None, where nothing of the node can be said."""
    missing: tuple[Diagnostic, ...] = ()
    """A warning for each guarantee that is not in them, with the reason."""


@runtime_checkable
class Translates(Protocol):
    """What a backend may offer besides: notations for `avow translate --to …`."""

    translations: Mapping[str, str]
    """Notation → what it is, in a few words."""

    def translate(self, notation: str, system: System, node: Node) -> Translated:
        """Pure, like `export`. Raises Rejected where the input is at fault: what the notation merely cannot say is
        `Translated.missing`."""
        ...


@runtime_checkable
class Suits(Protocol):
    """What a backend may offer besides: whether it is worth suggesting for a node."""

    def suits(self, node: Node) -> bool:
        """Whether the node's contract looks like what the backend verifies. Cheap; a guess is good enough."""
        ...


@runtime_checkable
class Backend(Protocol):
    """See `docs/adding-a-backend.md`."""

    name: str
    title: str
    """What it does, in one line, for the report."""
    version: str
    """Raised when the translation or the reading of answers changes: old evidence is then stale."""
    strength: Verdict
    link: Link
    options_schema: Mapping[str, Any]
    """JSON schema (2020-12) of the method's options in plan.yaml."""
    # Optional: `uses_scenario = False` for a backend that never looks at the plan's scenario, `uses_steps = False` for
    # one that looks at all of it but its `steps`, `uses_wiring = False` for one that looks at no topics, connections or
    # other nodes. Then a change there re-runs nothing of it.
    green_means: str
    """What a good verdict of this backend does and does not show, in a sentence or two."""

    def tools(self) -> tuple[Tool, ...]:
        """The outside tools that it can use, as found now. Cheap; never raises."""
        ...

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        """What is wrong with the plan's options: missing files, unknown names, models that do not parse."""
        ...

    def files(self, job: Job) -> tuple[Path, ...]:
        """The files of the plan (programs, data, reviews) that the answer depends on; absolute."""
        ...

    def export(self, job: Job) -> Mapping[str, str]:
        """Relative path → text of every generated file. Pure: same job, same bytes; no clock, no tool."""
        ...

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        """Settle `job.obligations`, one outcome for each. `folder` holds the exported files. Never raises for what
        the contract, the plan or a tool may do: a crash, a time-out, a missing tool are outcomes."""
        ...

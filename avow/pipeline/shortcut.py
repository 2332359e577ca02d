"""Detects a run with nothing to do from files' identities only, without reading a contract.

After a complete run of everything, `keep` notes the identity (inode, size, times of change) of every file that the
answer depends on: contracts, artifacts, reports, Avow's own code, and the folders in which tools and packages would
appear; and the environment. While all of that is the same, the next `doit verify` has nothing to do and says so. Times
of *change* (ctime) cannot be set back, so edits and copies are always detected; a touched file only costs a full run.
On file systems without such times, the bytes are compared (`files.identity`). A file that changed within the current
tick of the clock is not trusted: the check waits for the next tick.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from datetime import datetime
from pathlib import Path

import avow.backends
from avow.base.files import identity, read_regular
from avow.base.notes import read_note, write_note
from avow.base.records import dataclass
from avow.base.tools import LIBRARIES, package_digest, program_files
from avow.base.tuning.running import TICK_SECONDS
from avow.base.workspace import WRITTEN_ON_DEMAND, Workspace
from avow.isolation.level import SANDBOX
from avow.isolation.observed import Observed, Seen, look, marks
from avow.pipeline.results import Result
from avow.pipeline.settings import EXPLAIN, FRESH, KEY, ON, SECONDS, signing_key

_ENVIRONMENT = ("PATH", "PYTHONPATH", "AJPF_HOME", "AVOW_AJPF_JAVA", "HOME", EXPLAIN, FRESH, SANDBOX, ON, SECONDS, KEY)
_CODE = tuple(Path(place) for package in (avow, avow.backends) for place in package.__path__)
"""Avow's own code, wherever it is installed."""
_OURS = (".doit.json", ".lock", ".settled.json", *WRITTEN_ON_DEMAND)
"""Excluded among the artifacts: doit's own memory and our locks, which change with every run, and files written on
demand."""
_PACKAGES = (*LIBRARIES, "hypothesis", "rosbags")
"""Tools that are packages: for other folders on the module path only additions and removals count."""


@dataclass(frozen=True, slots=True)
class _Settled:
    """The inputs of a complete run, and its results."""

    sources: str
    identity: str
    observed: tuple[Observed, ...]
    results: tuple[Result, ...]


class Shortcut:
    """The memory of a workspace's last complete run, looked at before anything is read and renewed at the end."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._begun: str | None = None
        """The state of the sources before this run read them."""

    def nothing_to_do(self, wanted: Sequence[str]) -> tuple[Result, ...] | None:
        """The results of the last run, if only verification is `wanted` and nothing has changed since; else None.
        Called before anything is read."""
        found = self._settled(wanted)
        if found is None:
            time.sleep(TICK_SECONDS)  # an edit from now on has a later time
        return found

    def _settled(self, wanted: Sequence[str]) -> tuple[Result, ...] | None:
        with contextlib.suppress(OSError):
            self._begun = _sources(self.workspace)
        if not wanted or any(name.split(":")[0] != "verify" for name in wanted) or os.environ.get(FRESH):
            return None
        try:
            kept = read_note(_Settled, _stamp(self.workspace))
            if kept is None or self._begun != kept.sources:  # then the rest need not be looked at
                return None
            if kept.identity != _identity(self.workspace, kept.sources, kept.observed):
                return None
        except (OSError, ValueError):
            return None
        names = {r.system for r in kept.results}
        asked = {name.partition(":")[2] for name in wanted}
        return kept.results if asked - {""} <= names else None

    def keep(self, results: Sequence[Result], programs: Iterable[str] = ()) -> None:
        """Note that everything is up to date, including the outside tools' `programs`. Without effect if a link leads
        out of the workspace, if a plan reads launch files (which may be anywhere and name further files), or if
        something was edited during the run, so that the results are of an earlier state."""
        time.sleep(TICK_SECONDS)
        try:
            sources = _sources(self.workspace)
            if self._begun != sources or _reads_elsewhere(self.workspace):
                return
            seen = _observed(self.workspace)
            tools = (Observed(Seen.READ, str(file)) for path in programs for file in program_files(path))
            observed = (*seen, *dict.fromkeys(tools))
            identity = _identity(self.workspace, sources, observed)
            write_note(_stamp(self.workspace), _Settled(sources, identity, observed, tuple(results)))
        except OSError:
            return


def _reads_elsewhere(workspace: Workspace) -> bool:
    """Whether a plan may read files outside ``contracts/``: it contains `launch`, `code` or `qos` outside comments, or
    an escape that may spell it. Raises OSError."""
    plans = (read_regular(path) for path in workspace.contracts.rglob("plan.yaml"))
    lines = [line.lstrip() for plan in plans for line in plan.splitlines()]
    said = (line for line in lines if not (line.startswith(b"#") and line.isascii()))  # YAML has more line ends
    return any(word in line for line in said for word in (b"launch", b"code:", b"qos", b"\\"))


def _stamp(workspace: Workspace) -> Path:
    return workspace.artifacts / ".settled.json"


def _observed(workspace: Workspace) -> tuple[Observed, ...]:
    """The files that programs under test read, inside or outside the workspace."""
    from avow.evidence.currency import looked_at
    from avow.evidence.ledger import ledger_of

    entries = [e for path in sorted(workspace.ledgers.glob("*.jsonl")) for e in ledger_of(path).records()]
    return looked_at(entries, workspace.root)


def _identity(workspace: Workspace, sources: str, observed: Sequence[Observed]) -> str:
    """`sources`: the result of `_sources`. Raises OSError for anything that cannot be read."""
    digest = hashlib.sha256(sources.encode())
    for o in observed:
        mark = marks(o) or look(o.kind, o.path)
        digest.update(f"{o.kind} {o.path} {mark}\n".encode("utf-8", "surrogateescape"))
    _add_files(digest, _OURS, workspace.artifacts, workspace.reports)
    return digest.hexdigest()


def _sources(workspace: Workspace) -> str:
    """As `_identity`, for what no run writes: contracts, code, tools, environment."""
    digest = hashlib.sha256()
    environment = [(name, os.environ.get(name)) for name in _ENVIRONMENT]
    today = str(datetime.now().astimezone().date())
    digest.update(json.dumps([environment, today, sys.version, sys.executable, sys.path]).encode())
    key = signing_key()
    digest.update(_mark(str(key)).encode() if key is not None else b"")
    signed = (workspace.signed,) if workspace.signed.is_dir() else ()  # most workspaces have none
    _add_files(digest, (), workspace.contracts, *signed)  # a plan may name any file
    _add_files(digest, ("__pycache__",), *_CODE)
    digest.update(json.dumps([package_digest(name) for name in _PACKAGES]).encode())
    for name in dict.fromkeys([*os.environ.get("PATH", "").split(os.pathsep), *sys.path]):
        digest.update(f"{name} {_searched(name, workspace)}\n".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()


def _searched(name: str, workspace: Workspace) -> str:
    """A folder that is searched for tools and modules. In the workspace itself a run leaves its own folders and other
    tools' caches, which are no inputs."""
    if not Path(name).is_dir():
        return ""
    if not Path(name).samefile(workspace.root):
        return _mark(name)
    ours = (workspace.artifacts.name, workspace.reports.name, "__pycache__")
    with os.scandir(name) as entries:
        there = sorted((e for e in entries if e.name not in ours and e.name[:1] != "."), key=lambda e: e.name)
        return json.dumps([[e.name, "" if e.is_dir() else _mark(e.path)] for e in there])


def _add_files(digest: hashlib._Hash, without: Collection[str], *folders: Path) -> None:
    for folder in folders:
        for line in _files(folder, without):
            digest.update(line.encode("utf-8", "surrogateescape"))


def _files(folder: Path, without: Collection[str]) -> Iterator[str]:
    stack = [str(folder)]
    while stack:
        current = stack.pop()
        with os.scandir(current) as entries:
            for entry in sorted(entries, key=lambda e: e.name):
                if entry.name in without:
                    continue
                if entry.is_dir(follow_symlinks=False):
                    stack.append(entry.path)
                elif entry.is_dir():
                    raise OSError(f"{entry.path} leads elsewhere")
                else:
                    yield f"{entry.path} {_mark(entry.path)}\n"


def _mark(path: str) -> str:
    return " ".join(map(str, identity(os.stat(path), path)))  # noqa: PTH116 - the run that is to cost nothing asks of each

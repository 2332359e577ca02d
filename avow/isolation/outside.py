"""Runs outside tools so that undeclared inputs are either excluded or recorded.

A tool gets only the variables that Avow sets, an empty home folder, and a PATH with the system's programs and its own.
`strace` records what else it opens, executes and looks for. Without strace its reads are unknown, and its answer is
re-run each time.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from avow.base import process
from avow.base.process import Completed, ToolMissing
from avow.base.tools import Tool, program_files, program_folders
from avow.isolation.observed import Observed, folded, recorded
from avow.isolation.tracing import Trace, remedy, traces

_SYSTEM = ("/usr/local/sbin", "/usr/local/bin", "/usr/sbin", "/usr/bin", "/sbin", "/bin")


@dataclass(frozen=True, slots=True)
class Outside:
    """Runs of these tools for one answer; safe to use from several threads. The tools' own files are in the answer's
    key and are not recorded again."""

    tools: tuple[Tool, ...]
    _events: dict[tuple[str, str], None] = field(default_factory=dict)

    def run(
        self,
        command: Sequence[str],
        *,
        cwd: Path,
        seconds: float,
        megabytes: int | None = None,
        env: Mapping[str, str] | None = None,
    ) -> Completed:
        """As `process.run`. `cwd` is a folder made for this run: its files are not recorded."""
        program = shutil.which(command[0]) if os.sep not in command[0] else str(cwd / command[0])
        if program is None or not os.access(program, os.X_OK):
            raise ToolMissing(f"{command[0]}: not found, or not to be executed")
        trace = Trace() if traces() else None
        with tempfile.TemporaryDirectory(prefix=process.HOME_PREFIX, ignore_cleanup_errors=True) as home:
            given = {**process.bare(home), "PATH": self._path(program), **(env or {})}
            whole = [program, *command[1:]]
            started = whole if trace is None else trace.around([*_with_its_tracer(), *whole])
            done = process.run(started, cwd=cwd, seconds=seconds, megabytes=megabytes, env=given)
            if trace is None:
                what = f"what {os.path.basename(command[0])} reads, which nothing records here ({remedy()})"  # noqa: PTH119
                self._events["outside", what] = None
            else:
                events = trace.read_all(program, cwd)
                if events is None and done.code is not None:
                    events = (("outside", f"what no trace tells of {command[0]}"),)
                own = tuple(os.path.realpath(place) + os.sep for place in (home, cwd))
                self._events.update((event, None) for event in _beyond(events or (), own))
        return Completed(tuple(command), done.code, done.stdout, done.stderr, done.seconds)

    def observed(self) -> tuple[Observed, ...]:
        """The inputs so far that are in no key."""
        places = [place for tool in self.tools for place in tool.places]
        known = {str(file) for place in places for file in program_files(place)}
        within = tuple(f"{folder}{os.sep}" for place in places for folder in program_folders(place))

        def reported(event: str, path: str) -> bool:
            real = os.path.realpath(path)
            return event == "outside" or (real not in known and not f"{real}{os.sep}".startswith(within))

        seen = recorded((event, path) for event, path in list(self._events) if reported(event, path))
        return folded(seen)

    def _path(self, program: str) -> str:
        places = (program, *(place for tool in self.tools for place in tool.places))
        beside = [os.path.dirname(place) for place in places if Path(place).is_file()]  # noqa: PTH120
        return os.pathsep.join(dict.fromkeys([*beside, *_SYSTEM]))


def _beyond(events: Iterable[tuple[str, str]], own: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """The events outside the tool's own folders; for a link inside, those of its target."""
    for event, path in events:
        if event == "outside":
            yield event, path
            continue
        real = os.path.realpath(path)
        if not f"{real}{os.sep}".startswith(own):
            inside = path.startswith(own)
            yield "kind" if event == "state" and os.path.isdir(real) else event, real if inside else path  # noqa: PTH112


def _with_its_tracer() -> list[str]:
    """Arguments that make the program end with strace, its parent process."""
    program = shutil.which("setpriv")
    return [program, "--pdeathsig", "KILL", "--"] if program is not None else []

"""What a run prints: each stage as it ends, then one short table over all systems."""

from __future__ import annotations

import contextlib
import fcntl
import shutil
import sys
import threading
import time
from typing import IO, Any
from urllib.parse import unquote

from doit.reporter import ConsoleReporter

from avow.base import process
from avow.base.files import PART
from avow.base.workspace import Workspace
from avow.pipeline.state import State, system_of

_SILENT = ("certify", "verify")
"""Stages without a line of their own, as the report and the final table show their result; every run that does any work
executes them."""

_ASK_NOTHING = {"check", "obligations", "export", "report"}
"""Stages that give no worker anything to do."""


class PipelineReporter(ConsoleReporter):  # type: ignore[misc]
    """doit's reporter interface; `-r avow` is not needed, DOIT_CONFIG names it."""

    desc = "progress, then what was proved, checked, tested, refuted and not run"

    _state: State
    """The run that it reports: set by `reporter_of`, since doit makes the instance."""

    def __init__(self, outstream: IO[str], options: dict[str, Any]) -> None:
        super().__init__(outstream, options)
        self._running: dict[str, float] = {}
        self._lock = threading.Lock()
        self._live = outstream.isatty()
        self._start = time.monotonic()
        self._done = 0
        self._selected: list[str] = []
        self._seen: set[str] = set()
        self._run_lock: IO[str] | None = None

    def initialize(self, tasks: dict[str, Any], selected_tasks: list[str]) -> None:
        self._selected = list(selected_tasks)
        self._run_lock = _lock_run(self._state.workspace, self.outstream)
        if self._run_lock is not None and self._state.read:
            _sweep(self._state.workspace)
        if self._state.read and not {name.partition(":")[0] for name in selected_tasks} <= _ASK_NOTHING:
            from avow.pipeline.discharge import prepare

            prepare(self._state)

    def execute_task(self, task: Any) -> None:
        with self._lock:
            if task.actions:
                self._running[task.name] = time.monotonic()
            self._status()

    def add_success(self, task: Any) -> None:
        with self._lock:
            self._seen.add(task.name)
            start = self._running.pop(task.name, None)
            if start is None:
                return
            stage, _, subject = task.name.partition(":")
            if stage == "certify" and subject in self._state.certified:
                self._line(f"  {stage:<11} {subject:<40} {self._state.certified[subject]}")
            if stage not in _SILENT:
                self._done += 1
                seconds = time.monotonic() - start
                took = f"{seconds:6.1f} s" if seconds >= 0.05 else " " * 8
                self._line(f"  {stage:<11} {subject:<56} {took}")
            self._status()

    def add_failure(self, task: Any, fail: Any) -> None:
        with self._lock:
            self._seen.add(task.name)
            self._running.pop(task.name, None)
            if not getattr(fail, "report", True):
                return
            stage, _, subject = unquote(task.name).partition(":")
            message = fail.get_msg().strip().splitlines()
            if type(fail).__name__ != "UnmetDependency" and message:
                self._line(f"  {stage:<11} {subject:<40} {message[-1]}")
            self.failures.append({"task": task, "exception": fail})
            self._status()

    def skip_uptodate(self, task: Any) -> None:
        self._seen.add(task.name)

    def skip_ignore(self, task: Any) -> None:
        self._seen.add(task.name)

    def runtime_error(self, msg: str) -> None:
        self.runtime_errors.append(msg)

    def complete_run(self) -> None:
        from avow.pipeline.summary import print_summary, results_json

        results = self._state.results
        if sys.exc_info()[0] is None:
            self._state.run.close()
        process.kill_all()  # no process may outlive the run, even an interrupted one
        with self._lock:
            self._clear()
        self._write_index()
        broken = sorted(
            {name for f in self.failures if (name := system_of(f["task"].name))} - set(self._state.results.finished)
        )
        print_summary(results.all, broken, self._earlier(), self._done, time.monotonic() - self._start, self.outstream)
        if self._state.answer:
            self._state.answer.write(results_json(results.all, broken, self._earlier(), results.exit_code))
        if sys.exc_info()[0] is None and not self._seen.issuperset(self._selected):
            self.runtime_errors.append("not all of it was run: is the number after -n below 0?")
        for message in self.runtime_errors:
            self.outstream.write(message + "\n")
        self._keep()
        if self._run_lock is not None:
            self._run_lock.close()
        if self.runtime_errors:
            raise SystemExit(2)
        # A failing gate is no failing task: doit would call its group an error (2), and it knows no code 3.
        if not self.failures and results.exit_code:
            raise SystemExit(results.exit_code)

    def _write_index(self) -> None:
        if self._state.read:  # else nothing can have changed
            from avow.pipeline.assess import index_is_due, mark_earlier, write_overview

            try:
                mark_earlier(self._state)
                if index_is_due(self._state):
                    write_overview(self._state)
            except OSError as error:
                self.runtime_errors.append(f"the page over all systems cannot be written: {error}")

    def _earlier(self) -> tuple[str, ...]:
        if not self._state.read:
            return ()
        from avow.pipeline.assess import earlier

        return earlier(self._state)

    def _keep(self) -> None:
        """Note for the next run whether everything is up to date."""
        state = self._state
        if not state.read:
            return
        from avow.pipeline.assess import is_settled

        complete = {surveyed.system.name for surveyed in state.surveyed} == set(state.results.finished)
        plugins = any(surveyed.system.plan.plugins for surveyed in state.surveyed)  # their code may be anywhere
        undisturbed = not (plugins or self.failures or self.runtime_errors or self._earlier())
        if "verify" in self._selected and complete and undisturbed and is_settled(state):
            from avow.pipeline.work import programs

            works = (work for surveyed in state.surveyed for work in surveyed.catalogue.works)
            state.shortcut.keep(state.results.all, programs(works))

    def _line(self, text: str) -> None:
        self._clear()
        self.outstream.write(text.rstrip() + "\n")
        self.outstream.flush()

    def _status(self) -> None:
        if self._live and self._running:
            width = shutil.get_terminal_size().columns - 1
            text = "… " + ", ".join(self._running)
            self.outstream.write("\r" + text[:width].ljust(width))
            self.outstream.flush()

    def _clear(self) -> None:
        if self._live:
            self.outstream.write("\r" + " " * (shutil.get_terminal_size().columns - 1) + "\r")


def reporter_of(state: State) -> type[PipelineReporter]:
    """The reporter of one run, as doit's configuration wants it: a class."""
    return type("ReporterOfRun", (PipelineReporter,), {"_state": state})


def _sweep(workspace: Workspace) -> None:
    """Remove what a killed run left half written; no other run is under way now."""
    for folder in (workspace.artifacts, workspace.reports):
        for left in folder.rglob(f".*{PART}"):
            with contextlib.suppress(OSError):
                left.unlink()


def _lock_run(workspace: Workspace, out: IO[str]) -> IO[str] | None:
    """One run at a time in a workspace: a second waits for the first and then finds its work done. None if nothing can
    be written: such runs cannot conflict."""
    place = workspace.artifacts / ".lock"
    try:
        if place.exists() and not place.is_file():
            place.unlink()  # opening a pipe in its place would block
        file = place.open("w")
    except OSError:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        out.write("another run is under way here; waiting for it\n")
        out.flush()
        fcntl.flock(file, fcntl.LOCK_EX)
    return file


if sys.platform == "win32":  # pragma: no cover - flock and process groups are POSIX
    raise ImportError("Avow's pipeline needs a POSIX system")

"""Works of a made system, who carries them about, and a cluster on this machine."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from helpers import command, edit, wait_for

from avow.backend_kit.registry import backend
from avow.base.tools import find_tool
from avow.base.workspace import Workspace
from avow.evidence.ledger import Ledger, ledger_of
from avow.pipeline import dispatch
from avow.pipeline.discharge import discharge
from avow.pipeline.methods import tool_identities
from avow.pipeline.remote import Remote
from avow.pipeline.requests import Request, Response, read_response, request_bytes, request_digest
from avow.pipeline.run_info import Run
from avow.pipeline.work import Work, catalogue
from avow.pipeline.worker import answer
from avow.system.load import load_system


def works(place: Workspace, there: Remote | None = None) -> list[Work]:
    found = catalogue(load_system(place.contracts / "made"), there.tools if there else None).works
    return [work for work in found if work.cut is not None]


def recorded(place: Workspace) -> list[object]:
    """The ledger, without what differs from run to run."""
    records = [dataclasses.asdict(e.evidence) for e in Ledger(place.ledger("made")).records()]
    for record in records:
        for name in ("started", "seconds", "run"):
            del record[name]
    return sorted(json.loads(json.dumps(records, default=str)), key=lambda r: (r["obligation"], r["method"]))


def settle(place: Workspace, there: Remote | None = None) -> list[object]:
    place.ledger("made").unlink(missing_ok=True)
    ledger_of.cache_clear()
    run = Run("a", False, remote=there)
    for work in works(place, there):
        discharge(place, work, run)
    return recorded(place)


class Answering:
    """A remote executor that answers in this process."""

    def offers(self) -> Mapping[str, frozenset[tuple[str, ...]]]:
        return {"here": frozenset(tool_identities(backend("hoare")))}

    def run(self, request: Request) -> Response:
        data = request_bytes(request)
        return read_response(answer(data), request_digest(data))


def one(place: Workspace, engine: str = "hoare") -> tuple[Work, Request]:
    work = next(w for w in works(place) if w.engine == engine)
    return work, dispatch.request_of(place, work, work.obligations, place.root / "artifacts")


HANGS = """#!/bin/sh
case "$*" in *version*) echo 4.9.1;; *) exec sleep {seconds};; esac
"""


def with_dafny(place: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Let the first node have a method by Dafny, for which this stands in."""
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "dafny").write_text(script)
    (tools / "dafny").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    find_tool.cache_clear()
    folder = place.contracts / "made"
    (folder / "models" / "n0.dfy").write_text("method step(x0: int) returns (y0: int) { y0 := x0; }\n")
    edit(folder / "plan.yaml", ("hoare: {program: models/n0.imp}", "dafny: {implementation: models/n0.dfy}"))


class Machines:
    """A scheduler and some workers, each a process."""

    def __init__(self, *words: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.url = f"dask+{'tls' if words else 'tcp'}://127.0.0.1:{self.port}"
        dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--host", "127.0.0.1"]
        self.processes = [subprocess.Popen([*dask, "--port", str(self.port), *words], stderr=subprocess.DEVNULL)]

    def worker(self, *around: str) -> subprocess.Popen[bytes]:
        """`around`: a command that runs it."""
        command = [*around, sys.executable, "-m", "avow", "worker", "--on", self.url, "--slots", "1"]
        marked = {**os.environ, "AVOW_TEST_CLUSTER": self.url}
        self.processes.append(
            subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=marked)
        )
        return self.processes[-1]

    @contextlib.contextmanager
    def cluster(self, workers: int = 1) -> Iterator[Any]:
        """Joined from here, once so many workers offer their tools."""
        from avow.pipeline.cluster import Address, Cluster

        found = Cluster(Address.read(self.url))
        try:
            wait_for(lambda: len(found.offers()) >= workers)
            yield found
        finally:
            found.close()

    @property
    def seconds(self) -> str:
        """For which a tool of this cluster hangs: an argument that no other process has. Its environment tells nothing:
        tools get none of a worker's."""
        return f"1000.{self.url.rpartition(':')[2]}"

    def left(self) -> list[str]:
        """What runs of all that the workers started, and they themselves."""
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                mark = f"AVOW_TEST_CLUSTER={self.url}".encode()
                marked = mark in (entry / "environ").read_bytes().split(b"\0")
                if marked or self.seconds.encode() in (entry / "cmdline").read_bytes().split(b"\0"):
                    found.append(entry.name)
        return found

    def hanging(self) -> bool:
        """Whether a tool hangs, as `HANGS` does."""
        return any(b"sleep" in command(pid) for pid in self.left())

    def close(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()

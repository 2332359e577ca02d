"""Where works are done: on this machine (`answered`), or on others by an executor (`avow.pipeline.cluster`).

An executor carries bytes to workers and back. What comes back is judged by whoever asked (`avow.pipeline.asking`); only
the process that asked writes ledger, artifacts and reports.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Protocol

from avow.base.process import Completed
from avow.base.records import dataclass
from avow.base.tuning.running import QUEUE_PATIENCE, WORKER_GRACE
from avow.pipeline.forks import Forks
from avow.pipeline.requests import Request, request_bytes, request_digest


@dataclass(frozen=True, slots=True)
class Asked:
    """A request as it travels. `key` is its digest: to submit it again is to ask the same again."""

    request: Request
    data: bytes
    key: str

    @classmethod
    def of(cls, request: Request) -> Asked:
        data = request_bytes(request)
        return cls(request, data, request_digest(data))


@dataclass(frozen=True, slots=True)
class Came:
    """What came of a request: an answer's bytes, or why there is none."""

    key: str
    data: object = None
    failure: str = ""
    timed_out: bool = False
    log: str = ""


@dataclass(frozen=True, slots=True)
class Failed:
    """Why there is no answer, as a worker says it."""

    failure: str
    timed_out: bool
    log: str


class Executor(Protocol):
    """Runs works somewhere."""

    def offers(self) -> Mapping[str, frozenset[tuple[str, ...]]]:
        """Worker → the identities of the tools that it has."""
        ...

    def submit(self, asked: Asked) -> None:
        """Have it done; nothing happens where it is under way already."""
        ...

    def results(self) -> Iterator[Came]:
        """As they come, until the executor is closed."""
        ...

    def cancel(self, keys: Collection[str]) -> None:
        """What is under way for these ends, and its tools with it; no result comes."""
        ...

    def close(self) -> None:
        """End everything."""
        ...


def answered(
    forks: Forks, data: bytes, key: str, seconds: float, cwd: Path, stopped: Callable[[], bool] | None = None
) -> Came:
    """Do a work in a process of its own on this machine. Ends it as soon as `stopped` says so."""
    with tempfile.TemporaryDirectory(prefix="avow-request-") as place:
        question, answer = Path(place, "request"), Path(place, "response")
        question.write_bytes(data)
        done = forks.run([str(question), str(answer)], cwd=cwd, seconds=seconds, stopped=stopped)
        if done.timed_out:
            return Came(key, failure=f"no answer within {seconds:.0f} s", timed_out=True, log=done.stderr)
        if done.code != 0 or not answer.is_file():
            return Came(key, failure=f"the engine crashed: {_last_line(done)}", log=done.stderr)
        return Came(key, answer.read_bytes(), log=done.stderr)


def _last_line(done: Completed) -> str:
    last = done.stderr.strip().splitlines()[-1:] or [f"the worker ended with code {done.code}"]
    return last[0][:300]


@dataclass(slots=True)
class Desk:
    """Asks an executor on behalf of many threads, each of which waits for its own answer. The first answer to a request
    counts; another that comes later and says something else is an alarm."""

    executor: Executor
    said: Callable[[Asked, Came], object] = lambda asked, came: came.data
    """What an answer says, to be compared."""
    alarms: list[str] = field(default_factory=list)
    _waiting: dict[str, _Waiting] = field(default_factory=dict)
    _past: dict[str, _Waiting] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _thread: threading.Thread | None = None

    def ask(self, request: Request) -> tuple[Asked, Came]:
        asked = Asked.of(request)
        with self._lock:
            waiting = self._waiting.setdefault(asked.key, _Waiting(asked))
            waiting.asked_by += 1
            first = waiting.asked_by == 1 and waiting.came is None
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._listen, daemon=True)
                self._thread.start()
        if first:
            self.executor.submit(asked)
        # the executor bounds the time; what lies beyond that is its own fault, and must not hang a run
        came = waiting.there.wait(request.seconds + WORKER_GRACE + QUEUE_PATIENCE)
        with self._lock:
            waiting.asked_by -= 1
            if not waiting.asked_by:  # who asks again later wants to know how it is then
                del self._waiting[asked.key]
                self._past[asked.key] = waiting
        if not came:
            self.executor.cancel([asked.key])
            return asked, Came(asked.key, failure="no answer, not even that there is none", timed_out=True)
        assert waiting.came is not None
        return asked, waiting.came

    def _listen(self) -> None:
        for came in self.executor.results():
            with self._lock:
                waiting = self._waiting.get(came.key) or self._past.get(came.key)
            if waiting is None:
                self._alarm(f"an answer came to what nobody asked ({came.key[:12]})")
            elif waiting.came is None:
                waiting.came = came
                waiting.there.set()
            elif came.data is not None and self.said(waiting.asked, came) != self.said(waiting.asked, waiting.came):
                self._alarm(f"{waiting.asked.request.system}: two workers answer one request differently")

    def _alarm(self, text: str) -> None:
        self.alarms.append(text)
        print(f"warning: {text}", file=sys.stderr)


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Other machines, where a run sends what can be sent."""

    desk: Desk
    tools: Mapping[str, tuple[str, str]]
    """Tool → version and program's digest there: what is settled there is of these."""
    again: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(os.cpu_count() or 1), repr=False
    )
    """For what is done again on this machine: not as much at once as a cluster does."""
    _told: set[str] = field(default_factory=set, repr=False)

    def tell(self, text: str) -> None:
        """On standard error, once."""
        if text not in self._told:
            self._told.add(text)
            print(f"warning: {text}", file=sys.stderr)


@dataclass(slots=True)
class _Waiting:
    asked: Asked
    came: Came | None = None
    there: threading.Event = field(default_factory=threading.Event)
    asked_by: int = 0

"""A job's request and response as bytes; the response names the request's digest."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Limits, Report
from avow.base.codec import Unreadable, canonical, from_text, to_json
from avow.base.records import dataclass
from avow.base.tuning.running import WALL

Tools = tuple[tuple[str, ...], ...]
"""Name, version, … of each outside tool, as the keys have them; no version where it is missing."""


@dataclass(frozen=True, slots=True)
class Request:
    """One job. The process that executes it reads nothing but what the request holds, unless that names a `root`."""

    system: str
    node: str
    method: str
    engine: str
    keys: Mapping[str, str]
    """Obligation → key of its answer: the worker computes it again from the slice."""
    limits: Limits
    cut: bytes
    """The slice (`avow.pipeline.slices`), as `avow.pipeline.blobs` writes it."""
    home: str
    """The system's folder within the workspace, for messages."""
    files: Mapping[str, bytes] = field(default_factory=dict)
    """The plan's files that the answer depends on, by their path in the system's folder."""
    tools: Tools = ()
    root: str = ""
    """The system's folder, for a method that reads more than those files: its job runs where that folder is."""
    folder: str = ""
    """Where the exported files are; relative to the workspace."""
    kept: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    """Obligation → earlier refuting cases, as its backend wrote them (`record.CASE`): they are tried first."""
    earlier: str = ""
    """Hints that the engine kept in its last job (`avow.calculus.entailment`)."""

    @property
    def wanted(self) -> Tools:
        """The tools that have to be on the machine."""
        return tuple(tool for tool in self.tools if tool[1])

    @property
    def seconds(self) -> float:
        """Limits for all its obligations together."""
        return self.limits.seconds * max(WALL + 1, len(self.keys))


@dataclass(frozen=True, slots=True)
class Response:
    """The answer to the request with that digest: a report, or why there is none."""

    request: str
    report: Report | None = None
    failure: str = ""
    timed_out: bool = False
    worker: str = ""
    """The machine's name."""
    log: str = ""
    """What the process wrote to standard error."""


def request_bytes(request: Request) -> bytes:
    return canonical(to_json(request)).encode()


def request_digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def read_request(data: bytes) -> Request:
    """Raises Unreadable."""
    return from_text(Request, data)


def response_bytes(response: Response) -> bytes:
    return canonical(to_json(response)).encode()


def read_response(data: object, digest: str) -> Response:
    """The response to the request with that digest. Anything else becomes a response that reports the failure."""
    try:
        found = from_text(Response, data) if isinstance(data, bytes) else None
    except (Unreadable, UnicodeError) as error:
        return Response(digest, failure=f"the engine's answer cannot be read: {error}"[:300])
    if found is None or found.request != digest:
        return Response(digest, failure="the engine answers another request")
    if (found.report is None) is not bool(found.failure):
        return Response(digest, failure="the engine's answer has neither a report nor a reason")
    return found


def lay_out(files: Mapping[str, bytes], root: Path) -> None:
    """Write a request's files. Raises ValueError for one outside the folder."""
    for name, data in files.items():
        path = root / name
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise ValueError(f"{name} leaves the folder")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)

"""What a worker is asked, and what it answers: bytes both ways, with a digest of all that they say."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Limits, Report
from avow.base.codec import Unreadable, canonical, from_text, to_json
from avow.base.records import dataclass
from avow.language.contract import Clause, Node
from avow.sanity.mutants import Mutant, telling
from avow.system.plan import System

Tools = tuple[tuple[str, ...], ...]
"""Name, version, … of each outside tool, as the keys have them; no version where it is missing."""


@dataclass(frozen=True, slots=True)
class Altered:
    """Which mutant of which guarantee stands in for the guarantee (see `avow.pipeline.mutation`)."""

    clause: str
    number: int
    limit: int


@dataclass(frozen=True, slots=True)
class Request:
    """One work. It is answered where it comes to: nothing is read but what it holds, unless it names a `root`."""

    system: str
    node: str
    method: str
    engine: str
    keys: Mapping[str, str]
    """Obligation → what its answer depends on: computed again by the worker, from the slice."""
    limits: Limits
    cut: bytes
    """The slice (`avow.pipeline.slices`), as `avow.pipeline.blobs` writes it."""
    home: str
    """The system's folder within the workspace, for messages."""
    files: Mapping[str, bytes] = field(default_factory=dict)
    """The plan's files that the answer depends on, by their path in the system's folder."""
    tools: Tools = ()
    root: str = ""
    """The system's folder, for a method that looks at more than those files: it runs where that folder is."""
    folder: str = ""
    """Where the exported files are; relative to the workspace."""
    altered: Altered | None = None
    kept: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    """Obligation → cases that refuted it once, as its backend wrote them (`record.CASE`): to be tried first."""
    earlier: str = ""
    """What the engine kept for itself when it was asked last (`avow.calculus.kept_answers`): hints."""

    @property
    def wanted(self) -> Tools:
        """The tools that have to be on the machine."""
        return tuple(tool for tool in self.tools if tool[1])

    @property
    def seconds(self) -> float:
        """What all its obligations together may take."""
        return self.limits.seconds * max(2, len(self.keys))


@dataclass(frozen=True, slots=True)
class Response:
    """The answer to the request of that digest; `refused` says why there is none."""

    request: str
    report: Report | None
    refused: str = ""
    worker: str = ""
    cpu: float = 0.0
    """Processor seconds."""


class Unanswered(ValueError):  # noqa: N818 - it says what it is
    """Bytes that are no answer to what was asked."""


def request_bytes(request: Request) -> bytes:
    return canonical(to_json(request)).encode()


def read_request(data: bytes) -> Request:
    """Raises Unreadable."""
    return from_text(Request, data)


def response_bytes(response: Response) -> bytes:
    text = canonical(to_json(response))
    return json.dumps({"body": text, "sha256": hashlib.sha256(text.encode()).hexdigest()}).encode()


def read_response(data: object, asked: bytes) -> Response:
    """Raises Unanswered for anything but an answer to what was asked, whole."""
    if not isinstance(data, bytes):
        raise Unanswered(f"an answer is bytes, not {type(data).__name__}")
    try:
        outer = from_text(dict[str, str], data)
        text = outer["body"]
        if hashlib.sha256(text.encode()).hexdigest() != outer["sha256"]:
            raise Unanswered("its digest is not that of what it says")
        found = from_text(Response, text)
    except (Unreadable, KeyError, UnicodeError) as error:
        raise Unanswered(f"{type(error).__name__}: {error}"[:300]) from error
    if found.request != request_digest(asked):
        raise Unanswered("it answers another request")
    if (found.report is None) is not bool(found.refused):
        raise Unanswered("it neither answers nor says why not")
    return found


def request_digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def lay_out(files: Mapping[str, bytes], root: Path) -> None:
    """Write a request's files. Raises ValueError for one that would lie elsewhere."""
    for name, data in files.items():
        path = root / name
        if Path(name).is_absolute() or ".." in Path(name).parts:
            raise ValueError(f"{name} leaves the folder")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def alter(system: System, node: Node, altered: Altered) -> System:
    """The system with a mutant in place of a guarantee. Raises KeyError and IndexError for one that there is not."""
    clause = node.clause(altered.clause)
    mutant = chosen(node, clause, altered.limit)[altered.number]
    guarantees = tuple(replace(c, formula=mutant.formula) if c.name == clause.name else c for c in node.guarantees)
    changed = replace(node, guarantees=guarantees)
    nodes = tuple(changed if n.name == node.name else n for n in system.contract.nodes)
    return replace(system, contract=replace(system.contract, nodes=nodes))


def chosen(node: Node, clause: Clause, limit: int) -> tuple[Mutant, ...]:
    """The mutants that are tried: the same ones, in the same order, in every process."""
    others = tuple(g.formula for g in node.guarantees if g.name != clause.name)
    return telling(clause.formula, tuple(a.formula for a in node.assumptions), limit, others=others)

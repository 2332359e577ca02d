"""The export stage: writes what each method generates, so that later edits of these files are detected."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from avow.backend_kit import one_step
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import digest_file, is_intact, sha256, write
from avow.base.notes import read_note, write_note
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.workspace import Workspace
from avow.language.contract import Node
from avow.pipeline.blobs import encode
from avow.pipeline.methods import method_job
from avow.pipeline.slices import MethodSlice, whole_node
from avow.pipeline.work import Work

STAMP = ".export.json"


@dataclass(frozen=True, slots=True)
class Stamp:
    """What the files were generated from, and their digests."""

    key: str
    files: Mapping[str, str]


def folder(workspace: Workspace, work: Work) -> Path:
    return workspace.node(work.system.name, work.node, work.method)


def is_current(workspace: Workspace, work: Work, key: str) -> bool:
    """Whether the files on disk are what this key generated: an edited or missing artifact is not."""
    place = folder(workspace, work)
    stamp = read_stamp(place)
    return stamp is not None and stamp.key == key and all(is_intact(place / n, sha) for n, sha in stamp.files.items())


@by_identity(20_000)
def key(work: Work) -> str:
    """An artifact may show more than its obligations' meaning (names, sentences): all that its slice says."""
    assert work.shown is not None
    cut, root = work.shown(), work.system.plan.root.absolute()
    assert isinstance(cut, MethodSlice)
    given, node = work.system.contract.node(work.node), cut.system.contract.node(cut.node)
    whole = whole_node(given)
    if node == whole and node.definitions == whole.definitions:
        said = whole_digest(given)
        nodes = tuple(Node(n.name, (), (), (), (), ()) if n is node else n for n in cut.system.contract.nodes)
        cut = replace(cut, system=replace(cut.system, contract=replace(cut.system.contract, nodes=nodes)))
    else:
        said = ""
    told = [said, encode(cut, root).decode("utf-8", "surrogatepass"), sorted(work.keys.items())]
    return sha256(json.dumps(told))


@by_identity(20_000)
def whole_digest(node: Node) -> str:
    """SHA-256 of everything that a method may read about the node."""
    return sha256(encode(whole_node(node), Path()))


def generated(work: Work) -> Mapping[str, str]:
    """The files that the backend generates from the job's slice and its sentences. Raises Rejected."""
    assert work.shown is not None
    cut = work.shown()
    assert isinstance(cut, MethodSlice)
    assert work.planned is not None
    method = cut.system.plan.node(cut.node).methods[0]
    job = method_job(cut.system, cut.system.contract.node(cut.node), method, work.planned[0], cut)
    return one_step.export(work.planned[0], job)


def export(workspace: Workspace, work: Work, key: str) -> tuple[str, ...]:
    """Write what the backend generates, remove what it generated only before, and return the files' names."""
    files = generated(work)
    place = folder(workspace, work)
    for name in files:
        _inside(name, work)
    for name in _listed(place):
        if name not in files:
            (place / name).unlink(missing_ok=True)
    for name, text in files.items():
        write(place / name, text)
    digests = {name: sha256(text) for name, text in sorted(files.items())}
    write_note(place / STAMP, Stamp(key, digests))
    return tuple(sorted(files))


def edited(workspace: Workspace, work: Work) -> tuple[Path, ...]:
    """The generated files that are neither what the backend generates today nor what it generated before. Raises
    Rejected and OSError."""
    place, stamp = folder(workspace, work), read_stamp(folder(workspace, work))
    before = stamp.files if stamp is not None else {}
    known = {name: {sha256(text), before.get(name)} for name, text in generated(work).items()}
    return tuple(
        place / name
        for name, digests in known.items()
        if (place / name).is_file() and digest_file(place / name) not in digests
    )


def clean(workspace: Workspace, work: Work, dryrun: bool) -> None:
    """Remove what was generated, and only that."""
    place = folder(workspace, work)
    for name in (*_listed(place), STAMP):
        if (place / name).is_file():
            print(f"{workspace.relative(place / name)}: removed")
            if not dryrun:
                (place / name).unlink()


def _listed(place: Path) -> Iterable[str]:
    """The names of the files that were generated there."""
    stamp = read_stamp(place)
    return stamp.files if stamp is not None else ()


def read_stamp(place: Path) -> Stamp | None:
    return read_note(Stamp, place / STAMP)


def _inside(name: str, work: Work) -> None:
    if name.startswith("/") or ".." in name.split("/"):
        raise Rejected(
            Diagnostic("BACKEND004", f"the backend '{work.engine}' wants to write outside its folder: {name}")
        )

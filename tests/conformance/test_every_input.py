"""Each kind of thing that an answer depends on, of each backend and of the core's engines: a change of it is noticed,
and what is no input asks nothing again.

Which files a method reads is not taken from what it says: they are watched while it runs.
"""

from __future__ import annotations

import ctypes
import os
import re
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import test_shipped_backends as shipped

from avow.backend_kit.protocol import Backend
from avow.base import tools
from avow.base.diagnostics import Rejected
from avow.base.files import write
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.conformance import Conformance, Seeded
from avow.isolation.tracing import traces
from avow.pipeline import methods as methods_module
from avow.pipeline import work as work_module
from avow.pipeline.discharge import discharge, open_obligations
from avow.pipeline.run_info import Run
from avow.pipeline.work import COMPOSE, SANITY, Work
from avow.pipeline.workload import Survey, survey

SEEDED: dict[str, tuple[Backend, Seeded]] = {
    suite.backend.name: (suite.backend, suite.seeded[0])
    for suite in vars(shipped).values()
    if isinstance(suite, type) and issubclass(suite, Conformance) and suite is not Conformance
}
LONG = ("ajpf", "dafny", "fuzz", "python")
TWO = """
node first { inputs( a : REAL ) outputs( b : REAL ) topics()
  guarantee low ( out.b >= 1 )
}
node second { inputs( b : REAL ) outputs( c : REAL ) topics()
  assume( in.b >= 0 )
  guarantee high ( out.c >= 2 )
}
"""
"""Of one node nothing is composed."""


def test_every_shipped_backend_has_its_row() -> None:
    ours = {name for name, point in shipped.installed().items() if point.value.startswith("avow.backends.")}
    assert set(SEEDED) == ours


def written(name: str, root: Path) -> Path:
    folder = root / "contracts" / "s"
    if name in SEEDED:
        backend, case = SEEDED[name]
        case.written(backend, folder)
    else:
        write(folder / "system.rcl", TWO)
        write(folder / "plan.yaml", "contract: system.rcl\n")
    (folder / "notes.txt").write_text("nobody reads this\n")
    return folder


Keys = dict[tuple[str, str], str]


def keys(folder: Path, *names: str) -> Keys:
    """Of the backends' works, or of the engines'."""
    work_module.engine_identity.cache_clear()
    tools.libraries.cache_clear()
    found = survey(folder)
    assert isinstance(found, Survey), found
    works = [work for work in found.catalogue.works if work.engine in names]
    assert {work.engine for work in works if work.keys} == {*names}
    return {(work.node, work.method, claim): key for work in works for claim, key in work.keys.items()}


# -- what is an input by what it is --------------------------------------------------------------------------------

Change = Callable[[Path, pytest.MonkeyPatch], object]


def edited(pattern: str, old: str, new: str) -> Change:
    def change(folder: Path, _: pytest.MonkeyPatch) -> None:
        (path,) = folder.glob(pattern)
        text = path.read_text()
        assert old in text, text
        path.write_text(text.replace(old, new, 1))

    return change


def replaced(name: str) -> Change:
    """One of the functions by which a key is made says something else."""
    return lambda _, patch: patch.setattr(work_module, name, lambda *a: "another")


def another_library(_: Path, patch: pytest.MonkeyPatch) -> None:
    real = tools.package_digest
    patch.setattr(tools, "package_digest", lambda name: "another" if name == "cvc5" else real(name))


def another_tool(_: Path, patch: pytest.MonkeyPatch) -> None:
    for name in ("program_digest", "package_digest"):
        patch.setattr(methods_module, name, lambda *a: "another")


def another_claim(folder: Path, _: pytest.MonkeyPatch) -> None:
    path = folder / "system.rcl"
    clause = re.compile(r'(guarantee \w+\s+(?:"[^"]*"\s*)?)\( ?(.*?) ?\)$', re.MULTILINE)
    text, count = clause.subn(r"\1( not (\2) )", path.read_text())
    assert count
    path.write_text(text)


INPUTS: dict[str, Change] = {
    "the claim": another_claim,
    "an option": edited("plan.yaml", "guarantees:", "megabytes: 1999\n        guarantees:"),
    "a library": another_library,
    "the code that answers": replaced("backend_digest"),
}
OF_TOOLS: dict[str, Change] = {"its tool": another_tool}
OF_ENGINES: dict[str, Change] = {
    "the claim": INPUTS["the claim"],
    "a library": another_library,
    "the code that answers": replaced("engine_digest"),
}
NO_INPUTS: dict[str, Change] = {
    "a comment": edited("*.rcl", "node ", "// a comment ∀ (\nnode "),
    "white space": edited("*.rcl", "( ", "(\n     "),
    "a comment in the plan": lambda folder, _: (folder / "plan.yaml").write_text(
        "# why: {}\n" + (folder / "plan.yaml").read_text()
    ),
    "a title": lambda folder, _: (folder / "plan.yaml").write_text(
        "title: Another\n" + (folder / "plan.yaml").read_text()
    ),
    "a file that nobody reads": lambda folder, _: (folder / "notes.txt").write_text("other\n"),
    "a new file": lambda folder, _: (folder / "more.txt").write_text("\n"),
    "variables": lambda _, patch: [patch.setenv(k, "xx") for k in ("TZ", "LANG", "LC_ALL", "HOSTNAME", "COLUMNS")],
}


@pytest.mark.parametrize("what", [*INPUTS, *OF_TOOLS])
@pytest.mark.parametrize("name", SEEDED)
def test_a_change_of_an_input_asks_again(tmp_path: Path, name: str, what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = written(name, tmp_path)
    if what in OF_TOOLS and not SEEDED[name][0].tools():
        pytest.skip("it has no tool")
    before = keys(folder, name)
    (INPUTS | OF_TOOLS)[what](folder, monkeypatch)
    after = keys(folder, name)
    assert not before.items() & after.items()


@pytest.mark.parametrize("what", OF_ENGINES)
@pytest.mark.parametrize("name", [SANITY, COMPOSE])
def test_a_change_of_an_engines_input_asks_again(
    tmp_path: Path, name: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = written(name, tmp_path)
    before = keys(folder, name)
    OF_ENGINES[what](folder, monkeypatch)
    after = keys(folder, name)
    if what == "the claim":
        assert before != after
    else:
        assert not before.items() & after.items()


@pytest.mark.parametrize("what", NO_INPUTS)
@pytest.mark.parametrize("name", [*SEEDED, COMPOSE])
def test_what_is_no_input_asks_nothing_again(
    tmp_path: Path, name: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = written(name, tmp_path)
    before = keys(folder, name, SANITY)
    NO_INPUTS[what](folder, monkeypatch)
    assert keys(folder, name, SANITY) == before


# -- what is an input because it was read ----------------------------------------------------------------------------

_OPENED = 0x20


class Watching:
    """Which files of a folder any process opens, as the kernel tells (inotify)."""

    def __init__(self, root: Path) -> None:
        libc = ctypes.CDLL(None)
        self._events = libc.inotify_init1(os.O_NONBLOCK)
        folders = [root, *(path for path in root.rglob("*") if path.is_dir())]
        self._folders = {libc.inotify_add_watch(self._events, os.fsencode(f), _OPENED): f for f in folders}

    def opened(self) -> Iterator[Path]:
        """Since it began, or since it was last asked."""
        while True:
            try:
                data = os.read(self._events, 1 << 16)
            except BlockingIOError:
                return
            while data:
                watch, mask, _, length = struct.unpack_from("iIII", data)
                name = data[16 : 16 + length].rstrip(b"\0")
                if name and not mask & 0x40000000:  # a folder
                    yield self._folders[watch] / os.fsdecode(name)
                data = data[16 + length :]


def method(folder: Path, name: str) -> Work:
    found = survey(folder)
    assert isinstance(found, Survey)
    (work,) = [w for w in found.catalogue.works if w.engine == name]
    return work


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the kernel tells of files on Linux")
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.nightly] * (n in LONG)) for n in SEEDED])
def test_a_change_of_whatever_was_read_asks_again(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And of nothing else; and what stands in the environment changes no answer."""
    if any(
        not t.present
        for t in SEEDED[name][0].tools()
        if not t.optional or name in ("dafny", "fuzz", "onnx", "reach", "storm")
    ):
        pytest.skip("its tool is not here")
    if name in ("dafny", "fuzz") and not traces():
        pytest.skip("strace does not run here")
    folder, workspace = written(name, tmp_path), Workspace(tmp_path)
    for path in (tmp_path / "artifacts", tmp_path / "reports"):
        path.mkdir()
    watching = Watching(folder)
    found = discharge(workspace, method(folder, name), Run("first", False))
    assert any(o.verdict.supports for o in found), [(o.verdict, o.summary) for o in found]
    read = set(watching.opened()) - {folder / "plan.yaml", folder / "system.rcl"}
    assert {folder / f for f in SEEDED[name][1].files} <= read
    assert folder / "notes.txt" not in read
    assert not open_obligations(workspace, method(folder, name), Run("again", False))
    for path in sorted(read):
        kept = path.read_bytes()
        path.write_bytes(kept + b"\n")
        try:
            asked = open_obligations(workspace, method(folder, name), Run("again", False))
        except (AssertionError, Rejected):
            asked = method  # the plan is refused with it
        assert asked, path
        path.write_bytes(kept)
        assert not open_obligations(workspace, method(folder, name), Run("again", False)), path
    NO_INPUTS["a file that nobody reads"](folder, monkeypatch)
    assert not open_obligations(workspace, method(folder, name), Run("again", False))
    for variable in ("TZ", "LANG", "LC_ALL", "HOSTNAME", "COLUMNS", "LD_BIND_NOW", "JAVA_TOOL_OPTIONS", "CPATH"):
        monkeypatch.setenv(variable, "tr_TR.UTF-8")
    again = discharge(workspace, method(folder, name), Run("fresh", True))
    assert [(o.verdict, o.summary) for o in again] == [(o.verdict, o.summary) for o in found]


def test_all_verdicts_of_the_table_are_good() -> None:
    """A row whose answer is not good would say nothing of what keeps a good answer from being believed."""
    assert all(set(case.verdicts.values()) & {v for v in Verdict if v.supports} for _, case in SEEDED.values())

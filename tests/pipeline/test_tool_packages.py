"""A tool counts by the bytes of all the files that it is made of."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from avow.base import process, tools
from avow.base.notes import cache_folder
from avow.base.workspace import Workspace
from avow.pipeline import shortcut
from avow.pipeline.methods import tool_identities
from avow.pipeline.results import Result
from avow.pipeline.work import engine_identity


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that is no tool, on the module path."""
    folder = tmp_path / "modules" / "madetool" / "lib"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.py").write_text("")
    (folder / "libmade.so").write_bytes(b"\0" * 100)
    monkeypatch.syspath_prepend(str(tmp_path / "modules"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return folder.parent


def now(name: str = "madetool") -> str:
    tools.package_digest.cache_clear()
    return tools.package_digest(name)


def an_edit_with_its_times_put_back(place: Path) -> None:
    path = place / "lib" / "libmade.so"
    before = path.stat()
    path.write_bytes(b"\1" * 100)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.mark.parametrize(
    "change",
    [
        an_edit_with_its_times_put_back,
        lambda place: (place / "lib" / "libmore.so").write_bytes(b""),
        lambda place: (place / "__init__.py").rename(place / "other.py"),
        lambda place: (place / "lib" / "libmade.so").unlink(),
    ],
)
def test_any_change_of_a_file_is_seen(place: Path, change: Callable[[Path], object]) -> None:
    before = now()
    assert now() == before
    change(place)
    assert now() != before


def test_byte_code_and_an_edited_note_change_nothing(place: Path) -> None:
    before = now()
    (place / "__pycache__").mkdir()
    (place / "__pycache__" / "x.pyc").write_bytes(b"")
    assert now() == before
    (note,) = cache_folder().glob("package-madetool-*.json")
    said = json.loads(note.read_text())
    note.write_text(json.dumps({**said, "digest": "0" * 64}))
    assert now() == before
    assert now("nothing_of_that_name") == ""


def test_solver_and_generator_are_in_the_keys_and_in_the_shortcut() -> None:
    from avow.backend_kit.registry import backend

    assert tools.package_digest("z3") in engine_identity()
    for name, package in (("hoare", "z3"), ("python", "z3"), ("hypothesis", "hypothesis")):
        assert tools.package_digest(package) in {mark for _, _, mark in tool_identities(backend(name))}
        assert package in shortcut._PACKAGES


def _program(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)
    return path


@pytest.mark.slow
def test_a_launcher_counts_with_all_that_it_launches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    engine = _program(tmp_path / "lib" / "made" / "engine.exe", "1")
    elsewhere = _program(tmp_path / "other" / "shared.dll", "1")
    (engine.parent / "shared.dll").symlink_to(elsewhere)
    launcher = _program(tmp_path / "bin" / "made", f'#!/bin/sh\nexec {engine} "$@"\n')
    _program(launcher.with_name("neighbour"), "a program of its own")
    assert not {p.name for p in tools.program_files(str(launcher))} & {"neighbour"}

    def now() -> str:
        tools.program_files.cache_clear()
        return tools.program_digest((str(launcher),))

    known = [now()]
    assert now() == known[0]
    for path, text in ((engine, "2"), (elsewhere, "2"), (engine.with_name("prelude"), ""), (launcher, "#!/bin/sh\n")):
        path.write_text(text)
        known.append(now())
    assert len(set(known)) == len(known)


def test_a_binary_counts_with_its_libraries() -> None:
    files = tools.program_files(os.path.realpath("/bin/sh"))
    if not Path("/usr/bin/ldd").exists():
        pytest.skip("no ldd")
    assert any(p.name.startswith("libc.") for p in files)


def test_a_binarys_libraries_are_asked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    run = process.run

    def counted(command: Sequence[str], **given: Any) -> process.Completed:
        asked.extend(command[1:])
        return run(command, **given)

    monkeypatch.setattr(process, "run", counted)
    program = os.path.realpath("/bin/sh")
    tools.program_files.cache_clear()
    assert len(tools.program_files(program)) > 1 or not Path("/usr/bin/ldd").exists()
    assert asked == [program], "what ldd lists has the libraries of libraries in it"


def test_where_a_tools_library_is_another_there_is_something_to_do(tmp_path: Path) -> None:
    library = _program(tmp_path / "made" / "engine.exe", "1")
    workspace, done = Workspace(tmp_path / "here"), Result("s", 0, {}, "", ())
    for folder in (workspace.contracts, workspace.artifacts, workspace.reports):
        folder.mkdir(parents=True)
    first = shortcut.Shortcut(workspace)
    assert first.nothing_to_do(("verify",)) is None
    first.keep([done], [str(library)])
    assert shortcut.Shortcut(workspace).nothing_to_do(("verify",)) == (done,)
    library.write_text("2")
    assert shortcut.Shortcut(workspace).nothing_to_do(("verify",)) is None

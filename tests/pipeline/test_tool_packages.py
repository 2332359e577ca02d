"""A tool that is a Python package counts by the bytes of all its files."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from avow.base import tools
from avow.base.notes import cache_folder
from avow.pipeline import shortcut
from avow.pipeline.work import engine_identity, tool_identities


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

"""What lies in the user's cache folder is believed only where this user's Avow wrote it."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import pickle
from pathlib import Path

import pytest

from avow.base import tools
from avow.base.grammars import lark_of
from avow.base.notes import cache_folder, read_note, write_note

ORDERED = 'start: "a" ORDER "b"\nORDER: "<" | "<="\n'


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "avow"


def _grammar(folder: Path) -> Path:
    (folder / "g.lark").write_text(ORDERED)
    return folder / "g.lark"


def tables(tmp_path: Path, cache: Path) -> Path:
    """Of the grammar, which is read once and again."""
    for _ in range(2):
        parser = lark_of.__wrapped__(_grammar(tmp_path), "g", ("start",))
        assert str(parser.parse("a<=b").children[0]) == "<="
    (made,) = cache.glob("g-*.lark")
    return made


class Executed:
    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> object:
        return Path.touch, (self.mark,)


def test_tables_that_somebody_else_wrote_are_not_even_loaded(tmp_path: Path, cache: Path) -> None:
    made = tables(tmp_path, cache)
    kept = made.read_bytes()
    mark = tmp_path / "executed"
    first = kept.partition(b"\n")[0]
    made.write_bytes(first + b"\n" + pickle.dumps(set()) + pickle.dumps(Executed(mark)))
    tables(tmp_path, cache)
    assert not mark.exists()


def test_kept_tables_are_used(tmp_path: Path, cache: Path) -> None:
    made = tables(tmp_path, cache)
    before = made.stat().st_mtime_ns
    tables(tmp_path, cache)
    assert made.stat().st_mtime_ns == before


@pytest.mark.parametrize("variable", ["XDG_CACHE_HOME", "HOME"])
@pytest.mark.parametrize("value", [".", "cache", ""])
def test_the_cache_is_never_in_the_folder_of_the_workspace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv(variable, value)
    monkeypatch.chdir(tmp_path)
    assert cache_folder().is_absolute()
    assert not cache_folder().is_relative_to(tmp_path)


def test_an_edited_version_of_a_tool_is_asked_again(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "bin" / "madetool"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\necho madetool 2.3.0\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent), prepend=":")

    def version() -> str | None:
        tools.find_tool.cache_clear()
        return tools.find_tool("madetool", install="").version

    assert version() == version() == "2.3.0"
    kept = cache / "tools.json"
    assert "2.3.0" in kept.read_text()
    kept.write_text(kept.read_text().replace("2.3.0", "4.9.0"))
    assert version() == "2.3.0"


@pytest.mark.parametrize("edited", ["madetool", "engine"])
def test_a_version_is_asked_again_when_any_part_of_the_program_is_another(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch, edited: str
) -> None:
    """Also under the same length and time."""
    (tmp_path / "made").mkdir()
    engine = tmp_path / "made" / "engine"
    for path, text in (
        (engine, "echo 2.3.0"),
        (engine.with_name("madetool"), f'#!/bin/sh\n. {engine} && echo "a" >&2\n'),
    ):
        path.write_text(text)
        path.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path / "made"), prepend=":")

    def version() -> str | None:
        for known in (tools.find_tool, tools.program_files):
            known.cache_clear()
        return tools.find_tool("madetool", install="", pattern=r"\d[\d.]+|b").version

    assert version() == version() == "2.3.0"
    path = tmp_path / "made" / edited
    before = path.stat()
    path.write_text(path.read_text().replace("2.3.0", "2.4.0").replace(". /", ": /").replace('"a"', '"b"'))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_size == before.st_size
    assert version() == {"engine": "2.4.0", "madetool": "b"}[edited]


def test_a_user_without_a_home_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)

    def unknown(number: int) -> object:
        raise KeyError(f"getpwuid(): uid not found: {number}")

    monkeypatch.setattr("pwd.getpwuid", unknown)
    tables = lark_of.__wrapped__(_grammar(tmp_path), "g", ("start",))
    assert str(tables.parse("a<=b").children[0]) == "<="
    assert not cache_folder().exists()
    write_note(tmp_path / "note.json", {"a": 1})
    assert read_note(dict[str, int], tmp_path / "note.json") == {"a": 1}


@pytest.mark.parametrize("bad", ["", "00", "no key"])
def test_what_is_no_whole_key_marks_nothing(tmp_path: Path, cache: Path, bad: str) -> None:
    note = tmp_path / "note.json"
    cache.mkdir(parents=True)
    (cache / "notes.key").write_text(bad)
    write_note(note, {"a": 1})
    assert read_note(dict[str, int], note) == {"a": 1}
    body = json.dumps([note.parts, {"a": 2}], sort_keys=True)
    key = bytes.fromhex(bad) if bad != "no key" else b""
    made_up = {"a": 2, "mark": hmac.new(key, body.encode(), hashlib.sha256).hexdigest()}
    note.write_text(json.dumps(made_up))
    assert read_note(dict[str, int], note) is None
    assert len(bytes.fromhex((cache / "notes.key").read_text())) == 32

"""Files are written whole or not at all."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from avow.base import files


def test_write_says_whether_it_changed_anything(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b.txt"
    assert files.write(path, "one")
    assert not files.write(path, "one")
    assert files.write(path, b"two")
    assert path.read_text() == "two"
    assert [p.name for p in path.parent.iterdir()] == ["b.txt"]


def test_an_unchanged_file_keeps_its_time(tmp_path: Path) -> None:
    path = tmp_path / "a"
    files.write(path, "x")
    before = path.stat().st_mtime_ns
    files.write(path, "x")
    assert path.stat().st_mtime_ns == before


def test_a_failed_write_leaves_the_old_content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a"
    files.write(path, "old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(OSError, match="No space"):
        files.write(path, "new")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_digest_of_text_and_file_agree(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("grün", encoding="utf-8")
    assert files.sha256("grün") == files.digest_file(tmp_path / "a") == files.sha256("grün".encode())


def test_a_pipe_in_a_file_s_place_is_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    assert files.write(tmp_path / "a", "x")
    assert (tmp_path / "a").read_text() == "x"


def test_a_folder_is_no_place_for_a_text(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError, match=re.escape(f"this is a folder: name a file: '{tmp_path}'")):
        files.write_out(tmp_path, "x")
    assert list(tmp_path.iterdir()) == []


def test_what_goes_where_the_user_asked_for_it_goes_into_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    with os.fdopen(os.open(tmp_path / "a", os.O_RDONLY | os.O_NONBLOCK)) as reader:
        files.write_out(tmp_path / "a", "x")
        assert reader.read() == "x"
    assert not (tmp_path / "a").is_file()

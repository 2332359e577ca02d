"""Whatever stands where a path is wanted: a message and exit code 2, never a traceback, a hang, or a harmed file."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest

import avow.cli
from avow.base.files import write_out
from avow.cli import COMMANDS, main

GOOD = "node n { inputs( a : REAL ) outputs( b : BOOL ) topics() guarantee( b <=> a > 0 ) }\n"


ODD: dict[str, Callable[[Path], object]] = {
    "a pipe": lambda folder: os.mkfifo(folder / "odd.rcl"),
    "a broken link": lambda folder: (folder / "odd.rcl").symlink_to("nowhere"),
    "a folder": lambda folder: (folder / "odd.rcl").mkdir(),
    "large": lambda folder: (folder / "odd.rcl").write_text(GOOD + "//" + "x" * 10_000_000),
    "binary": lambda folder: (folder / "odd.rcl").write_bytes(b"node \xff\xfe"),
    "NUL": lambda folder: (folder / "odd.rcl").write_text("node\0"),
    "nothing": lambda folder: None,
}
FORMS = {
    "check": ("check", "@"),
    "json": ("check", "--json", "@"),
    "fmt": ("fmt", "@"),
    "translate": ("translate", "--to", "text", "@"),
    "sanity": ("sanity", "@"),
    "compose": ("compose", "@"),
    "refines": ("refines", "@", "good.rcl"),
    "refined": ("refines", "good.rcl", "@"),
}


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int | str | None, str]:
    with pytest.raises(SystemExit) as leave:
        main(arguments)
    said = capsys.readouterr()
    return leave.value.code, said.out + said.err


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.rcl").write_text(GOOD)
    return tmp_path


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("odd", ODD)
def test_odd_files(odd: str, form: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ODD[odd](place)
    code, said = run([a.replace("@", "odd.rcl") for a in FORMS[form]], capsys)
    assert code == 2, said
    assert said.strip()
    assert len(said) < 5000


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("path", ["", "/dev/null", "/dev/zero", "x" * 300 + ".rcl", "good.rcl/y.rcl"])
def test_odd_paths(path: str, form: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = run([a.replace("@", path) if a == "@" else a for a in FORMS[form]], capsys)
    assert code == 2, said
    assert said.strip()


def paths_of(command: click.Command) -> list[str]:
    return [p.name or "" for p in command.params if isinstance(p, click.Argument)]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_no_command_takes_an_empty_argument_for_the_current_folder(
    name: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = avow.cli.command(name)
    wanted = paths_of(command)
    if not wanted:
        pytest.skip("takes no argument")
    more = ["--to", "text"] if name == "translate" else []
    before = sorted(place.rglob("*"))
    code, said = run([name, *[""] * len(wanted), *more], capsys)
    assert code == 2, (code, said)
    assert "Traceback" not in said
    assert sorted(place.rglob("*")) == before
    assert (place / "good.rcl").read_text() == GOOD


def test_folders_without_contracts(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "empty").mkdir()
    for form in ("check", "fmt", "translate", "sanity", "compose"):
        code, said = run([a.replace("@", "empty") for a in FORMS[form]], capsys)
        assert code == 2, (form, said)
        assert "no" in said


def test_writing_to_a_device_leaves_it_one(tmp_path: Path) -> None:
    """`-o /dev/null`, as root, must not put a file in its place."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE) as reader:
        write_out(pipe, "text")
        assert reader.communicate()[0] == b"text"
    assert pipe.is_fifo()


def test_output_in_a_poor_encoding(place: Path) -> None:
    environment = {**os.environ, "PYTHONIOENCODING": "latin-1"}
    done = subprocess.run(
        [sys.executable, "-m", "avow", "translate", "--to", "unicode", "good.rcl"],
        capture_output=True,
        timeout=60,
        check=False,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    assert b"\\u2194" in done.stdout

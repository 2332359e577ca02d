"""The folder `backends/` is the package `avow.backends`, by no other name and without a link."""

from __future__ import annotations

import ast
import dataclasses
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from helpers import keys_of, nodes, parsed

import avow.backends
from avow.backend_kit.protocol import Backend, Job, Limits, Report
from avow.backend_kit.registry import backend, installed
from avow.pipeline.engine_code import _ROOMS, _ROOMS_OF_BACKENDS

ROOT = Path(__file__).parents[2]


def test_the_package_is_the_folder() -> None:
    assert [Path(place) for place in avow.backends.__path__] == [ROOT / "backends"]


def test_no_link_is_needed() -> None:
    links = [path for name in ("avow", "backends") for path in (ROOT / name).rglob("*") if path.is_symlink()]
    assert links == []


@pytest.mark.parametrize("name", ["backends", "backends.hoare"])
def test_a_second_copy_cannot_be_imported(name: str) -> None:
    """Also where the checkout itself is on `sys.path`, as it is for `python -c` in its folder."""
    done = subprocess.run([sys.executable, "-c", f"import {name}"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1
    assert "import the backends as avow.backends" in done.stderr


def test_each_folder_is_declared_and_documented() -> None:
    folders = {path.parent.name for path in (ROOT / "backends").glob("*/__init__.py")}
    ours = {name for name, point in installed().items() if point.value.startswith("avow.backends.")}
    assert folders == ours, "an entry point in pyproject.toml for each folder; then `pip install -e .` again"
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (apart,) = [set(c["modules"]) for c in contracts if c["type"] == "independence"]
    assert apart == {f"backends.{name}" for name in folders}, "the import-linter's contract in pyproject.toml"
    pages = {path.stem for path in (ROOT / "docs" / "backends").glob("*.md")}
    assert folders <= pages, "a page in docs/backends/ for each"
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [name for name in folders if f"docs/backends/{name}.md" not in readme] == [], "README.md: Where to go next"


@pytest.mark.parametrize("name", sorted(p.parent.name for p in (ROOT / "backends").glob("*/__init__.py")))
def test_its_page_has_every_option(name: str) -> None:
    """Itself, or a backend's page that it links to: options that several have are described once."""
    folder = ROOT / "docs" / "backends"
    own = (folder / f"{name}.md").read_text(encoding="utf-8")
    page = own + "".join((folder / other).read_text(encoding="utf-8") for other in re.findall(r"\((\w+\.md)", own))
    options = keys_of(backend(name).options_schema)
    missing = [option for option in options if not re.search(rf"\b{option}\b", page)]
    assert missing == [], f"docs/backends/{name}.md says what it is"


def test_the_page_for_those_who_write_one_has_every_member() -> None:
    page = (ROOT / "docs" / "developers" / "adding-a-backend.md").read_text(encoding="utf-8")
    members = {name for name in (*vars(Backend), *Backend.__annotations__) if not name.startswith("_")}
    members |= {field.name for kind in (Job, Report, Limits) for field in dataclasses.fields(kind)}
    assert {name for name in members if not re.search(rf"\b{name}\b", page)} == set()


def test_every_file_that_the_map_names_is_there() -> None:
    """The map of rooms and the recipes in docs/developers/architecture.md."""
    page = (ROOT / "docs" / "developers" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:avow|backends|tests)/[\w/.]+)`", page)
    assert len(named) > 12
    assert [name for name in named if "NAME" not in name and not (ROOT / name).exists()] == []
    rows = re.findall(r"^\|[^|]*\| `(\w+)` \|[^|]*\| (.*) \|$", page, re.MULTILINE)
    rooms = {p.parent.name for p in (ROOT / "avow").glob("*/__init__.py")} - {"backends"}
    assert rooms <= {room for room, _ in rows}
    first = re.findall(r"^\|[^|]*\| `([\w/*]+)` \|[^|]*\| (.*) \|$", page, re.MULTILINE)
    assert first[-1][0] == "recount"
    told = [(room, name) for room, names in first for name in re.findall(r"`([\w./]+)`", names)]
    assert len(told) > len(rows)
    backends = [f"backends/{folder.parent.name}" for folder in (ROOT / "backends").glob("*/__init__.py")]
    folders = {"backends/*": backends} | {room: [f"avow/{room}"] for room, _ in rows}
    assert [
        (folder, name)
        for room, name in told
        for folder in folders[room]
        if not name.startswith("avow/") and not (ROOT / folder / name).exists()
    ] == []
    for room, doors in rows:
        for door in re.findall(r"`([\w/]+\.py)`", doors):
            assert (ROOT / "avow" / room / door).is_file() or (ROOT / door).is_file(), (room, door)


UNASKED = {"evidence", "backends"}
"""Rooms that engines import and whose code changes no answer: what answers are written down as, and a backend's own
folder, which is in its own keys."""


@pytest.mark.parametrize(("kept", "own"), [(_ROOMS, ()), (_ROOMS_OF_BACKENDS, (ROOT / "backends",))])
def test_whatever_code_an_answer_hangs_on_is_in_its_key(kept: tuple[str, ...], own: tuple[Path, ...]) -> None:
    places = [*(ROOT / "avow" / room for room in kept), *own]
    files = [p for place in places for p in (place.rglob("*.py") if place.is_dir() else [place])]
    found = {room for p in files for room in re.findall(r"^ *from avow\.(\w+)", p.read_text("utf-8"), re.MULTILINE)}
    assert found <= {*kept, *UNASKED}


PUBLIC = {
    "lark": {"lark", "lark.exceptions", "lark.visitors"},
    "hypothesis": {"hypothesis", "hypothesis.strategies", "hypothesis.errors", "hypothesis.stateful"},
    "z3": {"z3"},
}
PRIVATE = {
    # Without this, the same seed draws other cases in a checkout than from a wheel.
    ("backends/hypothesis/running.py", "hypothesis.internal.conjecture"),
}
"""What no release of a library promises, and why it is used all the same."""


def test_nothing_private_of_a_library_is_used_without_a_reason() -> None:
    used = set()
    for path in (p for top in ("avow", "backends") for p in (ROOT / top).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not any(library in text for library in PUBLIC):
            continue
        for node in nodes(parsed(text)):
            match node:
                case ast.ImportFrom(module=str(name), level=0):
                    names = [name]
                case ast.Import():
                    names = [alias.name for alias in node.names]
                case _:
                    continue
            for name in names:
                if name not in PUBLIC.get(name.partition(".")[0], {name}):
                    used.add((path.relative_to(ROOT).as_posix(), name))
    assert used == PRIVATE

"""The folder `backends/` is the package `avow.backends`, by no other name and without a link."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import avow.backends
from avow.backend_kit.registry import installed

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


def test_each_folder_is_an_entry_point() -> None:
    folders = {path.parent.name for path in (ROOT / "backends").glob("*/__init__.py")}
    ours = {name for name, point in installed().items() if point.value.startswith("avow.backends.")}
    assert folders == ours

"""Where something is found is an input, too: the same file is not what is found once something else comes before it."""

from __future__ import annotations

import py_compile
import site
import sysconfig
from pathlib import Path

import pytest
from helpers import some

from avow.isolation.level import SANDBOX
from avow.isolation.observed import Observed, Seen, as_here, look, recorded
from avow.isolation.subject import SubjectProcess

SEARCHED = {
    "a module of PYTHONPATH's": ("import other", "PYTHONPATH", "b"),
    "a module that is compiled": ("import other", "a/other.py", ""),
    "a package of PYTHONPATH's without __init__": ("import folder.part", "PYTHONPATH", "b"),
    "a module that PYTHONPATH has not yet": ("try:\n    import later\nexcept ImportError:\n    pass", "a/later.py", ""),
    "a module in the place of the library's": ("import json", "a/json.py", ""),
    "a file's way through a link": ("open('d/../value').read()", "d", "two/sub"),
    "a file's way through a link to a link": ("open('twice/../value').read()", "d", "two/sub"),
    "a file's way back from a folder": ("open('own/../value').read()", "own", "two/sub"),
    "a folder that it goes into by a link": ("import os\nos.chdir('d')\nopen('value').read()", "d", "two/sub"),
    "a folder that it opens by a link": (
        "import os\nopen(os.open('value', 0, dir_fd=os.open('d', 0))).read()",
        "d",
        "two/sub",
    ),
    "a folder that a program goes into": ("import os\nassert not os.system('cd d && cat value')", "d", "two/sub"),
    "a file beside compiled ones": ("open('__pycache__/value').read()", "models/__pycache__/value", ""),
    "a program on the PATH": ("import subprocess\nsubprocess.run(['tool'])", "PATH", "b"),
    "a program on the PATH, by a shell": ("import os\nos.system('tool')", "PATH", "b"),
}


@pytest.mark.parametrize("name", some(SEARCHED, 5, slow=len(SEARCHED) - 5))
def test_where_something_is_found_is_an_input(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asks, what, new = SEARCHED[name]
    for folder in ("a", "b"):
        (tmp_path / folder / "folder").mkdir(parents=True)
        (tmp_path / folder / "other.py").touch()
        py_compile.compile(str(tmp_path / folder / "other.py"))
        (tmp_path / folder / "folder" / "part.py").touch()
        (tmp_path / folder / "tool").write_text("#!/bin/sh\n")
        (tmp_path / folder / "tool").chmod(0o755)
    models = tmp_path / "models"
    for place in ("one/sub", "two/sub", "own"):
        (models / place).mkdir(parents=True)
    for place in ("one", "two", "."):
        (models / place / "value").write_text(place)
        (models / place / "sub").mkdir(exist_ok=True)
        (models / place / "sub" / "value").write_text(place)
    (models / "d").symlink_to("one/sub")
    (models / "__pycache__").mkdir()
    (models / "__pycache__" / "value").touch()
    (models / "twice").symlink_to(models / "d")
    (models / "m.py").write_text(f"{asks}\ndef step(): return 1\n")
    monkeypatch.setenv(SANDBOX, "off")  # a sealed one would not see these folders, which lie under /tmp
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "a"))
    monkeypatch.setenv("PATH", f"{tmp_path / 'a'}:/usr/bin:/bin")
    subject = SubjectProcess(models / "m.py", "step", 10.0)
    assert subject.ask({}) == {"q": ["1", "1"], "w": True}
    assert not subject.close()
    seen = [o for o in subject.observed() if o.kind is not Seen.OUTSIDE]
    assert all(look(o.kind, o.path) == o.digest for o in seen)
    if what.isupper():
        monkeypatch.setenv(what, f"{tmp_path / new}:/usr/bin:/bin")
    elif new:
        place = models / what
        place.unlink() if place.is_symlink() else place.rmdir()
        place.symlink_to(new)
    else:
        (tmp_path / what).write_text("other = 1\n")
    assert any(look(o.kind, o.path) != o.digest for o in seen)


@pytest.mark.parametrize("name", ["more.pth", "known.pth", "sitecustomize.py", "usercustomize.py"])
def test_what_adds_to_python_s_path_is_an_input(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "known.pth").write_text("/a\n")
    monkeypatch.setattr(site, "getsitepackages", lambda: [str(tmp_path)])
    before = as_here(Seen.MODULES)
    (tmp_path / "package.py").touch()
    assert as_here(Seen.MODULES) == before
    (tmp_path / name).write_text("/b\n")
    assert as_here(Seen.MODULES) != before


@pytest.mark.parametrize("name", ["purelib", "platlib"])
def test_what_is_installed_is_an_input(name: str) -> None:
    folder = sysconfig.get_path(name)
    (row,) = recorded([("import", folder)])
    assert row == Observed(Seen.LISTING, folder, look(Seen.LISTING, folder))
    assert not recorded([("import", sysconfig.get_path("stdlib"))])

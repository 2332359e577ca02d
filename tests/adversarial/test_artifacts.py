"""Artifacts that were overwritten with anything at all are made again; what they say is never taken as an order."""

from __future__ import annotations

import io
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from helpers import edit

from avow.base.files import is_intact
from avow.base.notes import write_note
from avow.base.workspace import Workspace
from avow.pipeline import export as exporting
from avow.pipeline.export import read_stamp
from avow.pipeline.summary import print_obligations
from avow.pipeline.workload import Survey, survey, write_obligations

TEMPLATE = Path(__file__).parents[2] / "avow" / "cli" / "template" / "contracts" / "thermostat"


def test_obligations_that_are_no_text(workspace: Path) -> None:
    folder = shutil.copytree(TEMPLATE, workspace / "contracts" / "thermostat")
    found, place = survey(Path(folder)), Workspace(workspace)
    assert isinstance(found, Survey)
    assert write_obligations(place, found)
    assert write_obligations(place, found, dry=True)
    (workspace / "artifacts" / "thermostat" / "obligations.json").write_bytes(b"\xff\xfe")
    assert not write_obligations(place, found, dry=True)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace('"methods"', '"method"', 1), "listing.obligations[0]: fields missing: ['methods']"),
        (lambda text: text.replace('"claim": "', '"claim": 7, "claim": "', 1), "stands twice"),
        (lambda text: text.replace('"clauses": [', '"clauses": [NaN, ', 1), "NaN"),
        (lambda text: "[" * 100_000, "nested too deeply"),
        (lambda text: "", "Expecting value: line 1"),
    ],
    ids=range(5),
)
def test_a_list_of_obligations_that_was_changed_is_told(
    workspace: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[str], str], said: str
) -> None:
    folder = shutil.copytree(TEMPLATE, workspace / "contracts" / "thermostat")
    found, place = survey(Path(folder)), Workspace(workspace)
    assert isinstance(found, Survey)
    write_obligations(place, found)
    listed = workspace / "artifacts" / "thermostat" / "obligations.json"
    monkeypatch.chdir(workspace)
    for text, expected in ((listed.read_text(), "guarantee"), (change(listed.read_text()), said)):
        listed.write_text(text)
        print_obligations(["obligations"], out := io.StringIO())
        assert expected in " ".join(out.getvalue().split())


def test_a_stamp_names_no_file_elsewhere(tmp_path: Path) -> None:
    for name in ("../../plan.yaml", "/etc/passwd", "a/../../b"):
        write_note(tmp_path / ".export.json", {"key": "k", "files": {name: "0"}})
        assert read_stamp(tmp_path) is None
    write_note(tmp_path / ".export.json", {"key": "k", "files": {"a/b": "0"}})
    assert read_stamp(tmp_path) is not None
    edit(tmp_path / ".export.json", ("a/b", "a/c"))
    assert read_stamp(tmp_path) is None, "an edited note is none"


def overwritten(file: Path) -> None:
    file.write_bytes(file.read_bytes()[::-1])


def restored(file: Path) -> None:
    other = shutil.copy2(file, file.with_name("other"))
    overwritten(Path(other))
    os.utime(other, ns=(file.stat().st_atime_ns, file.stat().st_mtime_ns))
    Path(other).rename(file)


@pytest.mark.parametrize("change", [overwritten, restored, Path.unlink])
def test_an_artifact_that_was_seen_whole_is_read_again_once_it_is_another(
    workspace: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], None]
) -> None:
    found, place = survey(shutil.copytree(TEMPLATE, workspace / "contracts" / "thermostat")), Workspace(workspace)
    assert isinstance(found, Survey)
    works = ((w, exporting.key(w)) for w in found.catalogue.works if not w.is_engine)
    work, key = next((w, k) for w, k in works if exporting.export(place, w, k))
    digested: list[Path] = []
    monkeypatch.setattr(exporting, "is_intact", lambda path, sha: (digested.append(path), is_intact(path, sha))[1])
    monkeypatch.setattr(exporting, "SETTLED_NS", 10**18)
    assert exporting.is_current(place, work, key)
    assert exporting.is_current(place, work, key)
    assert len(digested) % 2 == 0, "what was only just written may be changed without a new time"
    monkeypatch.setattr(exporting, "SETTLED_NS", -(10**18))
    assert exporting.is_current(place, work, key)
    digested.clear()
    assert exporting.is_current(place, work, key)
    assert not digested
    change(sorted(f for f in exporting.folder(place, work).rglob("*") if f.name[0] != "." and f.is_file())[0])
    assert not exporting.is_current(place, work, key)

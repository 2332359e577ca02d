"""Artifacts that were overwritten with anything at all are made again; what they say is never taken as an order."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from avow.base.files import is_intact
from avow.base.workspace import Workspace
from avow.pipeline import export as exporting
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

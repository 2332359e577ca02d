"""Artifacts that were overwritten with anything at all are made again; what they say is never taken as an order."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

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
def test_an_artifact_that_was_seen_whole_is_made_again_once_it_is_another(
    workspace: Path, change: Callable[[Path], None]
) -> None:
    found, place = survey(shutil.copytree(TEMPLATE, workspace / "contracts" / "thermostat")), Workspace(workspace)
    assert isinstance(found, Survey)
    works = ((w, exporting.key(w)) for w in found.catalogue.works if not w.is_engine)
    work, key = next((w, k) for w, k in works if exporting.export(place, w, k))
    assert exporting.is_current(place, work, key)
    change(sorted(f for f in exporting.folder(place, work).rglob("*") if f.name[0] != "." and f.is_file())[0])
    assert not exporting.is_current(place, work, key)

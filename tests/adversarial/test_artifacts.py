"""Artifacts that were overwritten with anything at all are made again; what they say is never taken as an order."""

from __future__ import annotations

import shutil
from pathlib import Path

from helpers import edit

from avow.base.notes import write_note
from avow.base.workspace import Workspace
from avow.pipeline.export import read_stamp
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


def test_a_stamp_names_no_file_elsewhere(tmp_path: Path) -> None:
    for name in ("../../plan.yaml", "/etc/passwd", "a/../../b"):
        write_note(tmp_path / ".export.json", {"key": "k", "files": {name: "0"}})
        assert read_stamp(tmp_path) is None
    write_note(tmp_path / ".export.json", {"key": "k", "files": {"a/b": "0"}})
    assert read_stamp(tmp_path) is not None
    edit(tmp_path / ".export.json", ("a/b", "a/c"))
    assert read_stamp(tmp_path) is None, "an edited note is none"

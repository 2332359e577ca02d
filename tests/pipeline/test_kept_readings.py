"""What a run finds with most of its nodes' texts kept from earlier runs is what a run finds that believes none."""

from __future__ import annotations

import random
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from language.test_pieces import edited, told
from scale.made import programs

from avow.base import remembered
from avow.cli.check import command
from avow.language import load
from avow.pipeline.export import key
from avow.pipeline.workload import Survey, survey

ROOT = Path(__file__).parents[2]


def found(folder: Path, fresh: bool) -> Any:
    """All that a run goes by: the contract with its places, the claims, what each answer and each file depends on."""
    load._lately.clear()
    read = survey(folder, fresh=fresh)
    if not isinstance(read, Survey):
        return ["wrong", read.diagnostics]
    works = [(w.node, w.method, w.keys, key(w) if w.shown is not None else "") for w in read.catalogue.works]
    return ["right", told((read.system.contract, read.catalogue.obligations, read.digest)), works]


def checked(folder: Path) -> str:
    load._lately.clear()
    return CliRunner().invoke(command, [str(folder), "--json"], standalone_mode=False).output


@pytest.mark.slow
@pytest.mark.parametrize(("name", "edits"), [("made", 10), ("remote_inspection", 2)])
def test_kept_or_not_a_run_goes_by_the_same(
    name: str, edits: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "contracts" / name
    if name == "made":
        programs(folder, 6, 3)
    else:
        shutil.copytree(ROOT / "contracts" / name, folder)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "warm"))
    contract, draw, right = folder / "system.rcl", random.Random(name), 0
    first = contract.read_text()
    for at in range(edits):
        if at % 3 == 0:
            contract.write_text(first)
        else:
            contract.write_text(edited(contract.read_text(), draw))
        kept = found(folder, fresh=False)
        right += kept[0] == "right"
        assert kept == found(folder, fresh=True)
        said = checked(folder)
        with monkeypatch.context() as empty:
            empty.setattr(remembered, "unsealed", lambda path: None)
            assert said == checked(folder)
    assert right

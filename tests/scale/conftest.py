"""A made system, and a cluster to settle it on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from avow.base.workspace import Workspace
from avow.evidence.ledger import ledger_of

from .machines import Machines
from .made import programs


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Workspace]:
    programs(tmp_path / "contracts" / "made", 3, 2)
    (tmp_path / "dodo.py").touch()
    yield Workspace(tmp_path)
    ledger_of.cache_clear()


@pytest.fixture
def machines() -> Iterator[Machines]:
    pytest.importorskip("distributed")
    found = Machines()
    yield found
    found.close()

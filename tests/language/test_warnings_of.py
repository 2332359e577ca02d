"""A run has checked the contract as it stands on disk; the report names its files from the workspace's root."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.language import load
from avow.language.load import check_sources, warnings_of
from avow.language.source import Source

CONTRACTS = sorted(Path(__file__).parents[2].glob("contracts/*/*.rcl"))
MORE = "\nnode unheard { inputs( a : REAL ) outputs( v : REAL ) topics() guarantee( out.v > 0 ) }\n"


@pytest.mark.parametrize("path", CONTRACTS, ids=lambda path: path.parent.name)
def test_warnings_are_the_same_under_other_names(path: Path) -> None:
    def forget() -> None:
        load._under.clear()
        load._lately.clear()

    text = path.read_text() + MORE
    named = ((f"contracts/{path.name}", text),)
    forget()
    alone = warnings_of(named)[1]
    assert alone
    forget()
    check_sources([Source(str(path), text)])
    checked = list(load._lately)
    assert warnings_of(named)[1] == alone
    assert list(load._lately) == checked

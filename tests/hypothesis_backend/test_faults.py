"""Seeded faults of many kinds are found, and each honest twin passes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from helpers import some
from hoare.systems import make_job

from avow.backend_kit.protocol import Limits
from avow.backends.hypothesis import BACKEND
from avow.base.verdict import Outcome, Verdict
from avow.conformance.seeded import settle

from .faults import FAULTS, Fault

UNSEEN = (
    "turned bits",
    "a text of two parts",
    "a quotient",
    "packed",
    "shifted",
    "a sum",
    "first and last",
    "many points",
    "one apart",
    "a multiple",
    "a square",
    "near a parabola",
    "a circle",
    "one behind another",
    "five deep",
    "by a search",
    "a look-alike",
    "a text that is put together",
    "a coded text",
    "an expression",
    "after many calls",
    "a sum that grows",
    "after many, at a number",
)
"""Faults that drawn inputs meet by chance only: at a value that stands in no source, at two unlikely inputs, or
after more than ten thousand calls."""

REMEMBERS = ("at one call", "a list that grows", "the same again")
"""Functions that change their answers: the number of calls, or the last one, is an undeclared input."""


def outcome_of(folder: Path, fault: Fault, *, faulty: bool, seed: int = 0) -> Outcome:
    files = {"made.py": fault.program(faulty=faulty), **fault.files}
    options: dict[str, Any] = {"subject": "made.py:y", "cases": 300, "numbers": fault.numbers}
    job = make_job(folder, fault.contract(), "made", options, files, "hypothesis")
    (found,) = settle(BACKEND, job, folder / "made", Limits(seconds=120, seed=seed)).outcomes
    return found


@pytest.mark.parametrize("fault", some([f for f in FAULTS if f.name not in UNSEEN], 0, 28), ids=lambda f: f.name)
def test_a_fault_is_found(tmp_path: Path, fault: Fault) -> None:
    """By one of three seeds, so that a change of what is drawn first is no change of what is found."""
    wanted = Verdict.UNKNOWN if fault.name in REMEMBERS else Verdict.REFUTED
    assert any(outcome_of(tmp_path / str(n), fault, faulty=True, seed=n).verdict is wanted for n in range(3))


@pytest.mark.parametrize("fault", some(FAULTS, 0, 14), ids=lambda f: f.name)
def test_its_honest_twin_passes(tmp_path: Path, fault: Fault) -> None:
    found = outcome_of(tmp_path, fault, faulty=False)
    assert found.verdict is Verdict.TESTED, found.summary

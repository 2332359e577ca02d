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
    "only the first",
    "a length far off",
    "a file of parameters",
    "a file of lines",
    "a sum of constants",
    "a product far off",
    "a value of the library",
    "a text made of digits",
    "digits of a number",
    "turned bits",
    "a number in a text",
    "a text of two parts",
    "a long text that ends so",
    "a quotient",
    "packed",
    "shifted",
    "a loop with an end",
    "only seven",
    "a sum",
    "a sorted one",
    "as long as a number",
    "first and last",
    "many points",
    "a point far off",
    "an argument at a sum",
    "a strip of two",
    "a thin strip",
    "one apart",
    "a multiple",
    "a product",
    "a square",
    "near a parabola",
    "a circle",
    "one behind another",
    "five deep",
    "of one mode",
    "by a table",
    "by a set",
    "by a match",
    "a look-alike",
    "a text without marks",
    "a text that is put together",
    "a number as text",
    "a long text",
    "a coded text",
    "an expression",
    "after many calls",
    "at one call",
    "a list that grows",
    "a sum that grows",
    "the same again",
    "after many, at a number",
    "one unit aside",
    "absorbed",
    "a rounded sum",
    "too large to square",
    "too small to square",
    "divided",
    "rounded",
)
"""Faults that drawn inputs meet by chance only: at a value that stands in no source, at two unlikely inputs together,
or after thousands of calls."""


def outcome_of(folder: Path, fault: Fault, *, faulty: bool) -> Outcome:
    files = {"made.py": fault.program(faulty=faulty), **fault.files}
    options: dict[str, Any] = {"subject": "made.py:y", "cases": 300, "numbers": fault.numbers}
    job = make_job(folder, fault.contract(), "made", options, files, "hypothesis")
    (found,) = settle(BACKEND, job, folder / "made", Limits(seconds=120)).outcomes
    return found


@pytest.mark.parametrize("fault", some([f for f in FAULTS if f.name not in UNSEEN], 0, 28), ids=lambda f: f.name)
def test_a_fault_is_found(tmp_path: Path, fault: Fault) -> None:
    found = outcome_of(tmp_path, fault, faulty=True)
    assert found.verdict is Verdict.REFUTED, found.summary


@pytest.mark.parametrize("fault", some(FAULTS, 0, 14), ids=lambda f: f.name)
def test_its_honest_twin_passes(tmp_path: Path, fault: Fault) -> None:
    found = outcome_of(tmp_path, fault, faulty=False)
    assert found.verdict is Verdict.TESTED, found.summary

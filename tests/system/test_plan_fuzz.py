"""Damaged plans are systems or located diagnostics. AVOW_FUZZ_PLANS=10000 makes it a long run."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from . import plan_fuzzing


@pytest.mark.slow
def test_damaged_plans(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan_fuzzing.language_load, "load_contract", plan_fuzzing.remembered)
    systems = plan_fuzzing.folders(root, tmp_path)
    assert len(systems) >= 4
    count = int(os.environ.get("AVOW_FUZZ_PLANS", "40"))
    accepted = [
        plan_fuzzing.examine(folder, text) is not None for folder, text in plan_fuzzing.plans(systems, 20261121, count)
    ]
    assert 0 < sum(accepted) < count

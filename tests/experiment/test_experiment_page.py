"""docs/backends/experiment.md: its contract, plan and data give the answer that it prints."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from avow.backend_kit.protocol import Limits
from avow.backends.experiment import BACKEND
from avow.base.verdict import Verdict
from avow.conformance.seeded import Seeded

PAGE = (Path(__file__).parents[2] / "docs/backends/experiment.md").read_text()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.S)
    assert found is not None
    return found[1]


def test_the_pages_example_gives_the_pages_answer(tmp_path: Path) -> None:
    ((_, options),) = yaml.safe_load(block("yaml"))[0].items()
    header, fast, slow = block("csv").splitlines()
    lines = [f"{n},{(fast if n <= 17 else slow).partition(',')[2]}" for n in range(1, 106)]
    files = {options["data"]: "\n".join([header, *lines]) + "\n"}
    case = Seeded("page", block("rcl"), options, {"stops": Verdict.TESTED}, files)
    job = case.written(BACKEND, tmp_path)
    (outcome,) = BACKEND.discharge(job, job.root, Limits()).outcomes
    assert outcome.verdict is Verdict.TESTED
    assert f"    {outcome.summary}\n" in PAGE

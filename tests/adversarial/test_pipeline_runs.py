"""Random systems through edits in one workspace, by the real command: what is kept of earlier runs never makes a status
better than a run from nothing does, and no requirement is proved that some run breaks."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.calculus.composition import compose
from avow.system.load import load_system

from .test_case_runs import Judged

AVOW = str(Path(sys.executable).with_name("avow"))
GOOD = ("proved", "checked", "justified", "tested")


def written(root: Path, name: str, made: Judged) -> bool:
    """Whether the system is one: its files are in the workspace then."""
    folder = root / "contracts" / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "system.rcl").write_text(made.text)
    (folder / "plan.yaml").write_text(f"system: {name}\ncontract: system.rcl\n{made.plan}")
    try:
        findings = compose(load_system(folder)).frame.graph.findings
    except Rejected:
        return False
    return not any(finding.is_error for finding in findings)


def statuses(root: Path, names: list[str], *options: str) -> dict[tuple[str, str], str]:
    words = [AVOW, "verify", *options]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode in (0, 1, 3), done.stdout + done.stderr
    found = {}
    for name in names:
        case = json.loads((root / "reports" / name / "report.json").read_text())
        for o in case["obligations"]:
            about = o["obligation"]
            found[name, f"{about['node']}/{about['kind']}/{about['name']}"] = o["status"]
    return found


def followed(root: Path, seeds: range, edits: int) -> int:
    """How many requirements' formulas are proved, over all edits."""
    made = {f"s{seed}": Judged(seed, rich=True) for seed in seeds}
    (root / "dodo.py").write_text("")
    count = 0
    for edit in range(edits):
        for name in [name for name in made if not written(root, name, made[name])]:
            del made[name]
            for part in ("contracts", "reports"):
                shutil.rmtree(root / part / name, ignore_errors=True)
        kept = statuses(root, list(made))
        fresh = statuses(root, list(made), "--fresh")
        better = {at: (kept[at], fresh.get(at)) for at in kept if kept[at] in GOOD and kept[at] != fresh.get(at)}
        assert not better, (seeds, edit, better)
        for name, system in made.items():
            proved = {at[1].rpartition("/")[2] for at, said in kept.items() if at[0] == name and said == "proved"}
            claims = [(k, each) for k, each in enumerate(system.required) if f"R{k}" in proved]
            count += len(claims)
            for now, _, _ in system.steps(granted=True) if claims else ():
                for k, each in claims:
                    assert each({f"{n}.o{n}": value for n, value in now.items()}), (name, edit, k, now)
        for system in made.values():
            system.edited(system.chance)
    return count


@pytest.mark.nightly
@pytest.mark.parametrize("start", range(0, 24, 4))
def test_nothing_is_better_for_what_was_kept(start: int, tmp_path: Path) -> None:
    followed(tmp_path, range(start, start + 4), 3)

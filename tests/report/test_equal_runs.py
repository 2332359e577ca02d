"""Which method answered first is chance: two runs that found the same have reports that say the same, byte for byte,
but for times, the runs' names, and what follows from a record's place in the ledger (its number and its hashes)."""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml
from assurance.sample import case, evidence, rover_parts
from helpers import avow, every_text, some
from scale.made import programs

from avow.base.verdict import Verdict
from avow.evidence.ledger import Ledger

_OWN = re.compile(
    r"\d{8}T\d{6}\.\d+-\d+|\d{4}-\d\d-\d\d[T ]\d\d:\d\d[\d:.+Z]*|\b_?[0-9a-f]{8,64}\b"
    r'|\b(?:[Rr]ecord|no\.|#)\s*[0-9a-f]+\b|[\d.]+ s\b|"(?:number|n|seconds)": [\d.]+'
)


def plain(text: str) -> list[str]:
    return _OWN.sub("…", text).splitlines()


@pytest.mark.parametrize("seed", some(range(3), 1, slow=2))
def test_a_report_does_not_hang_on_the_order_in_which_methods_answered(seed: int) -> None:
    subject, obligations, records, keys, extras = rover_parts()
    claim = next(o for o in obligations if o.name == "arrives")
    more = [evidence(claim, Verdict.UNKNOWN, method) for method in ("dafny", "ajpf", "review")]
    gone = [evidence(f"lost.{name}", Verdict.PROVED, method) for name in "ba" for method in ("hoare", "dafny")]
    records = [*records, *more, *gone]
    keys = {**keys, **{(r.obligation, r.method): r.key for r in more}}
    by_method: dict[tuple[str, str], list[int]] = {}
    for at, record in enumerate(records):
        by_method.setdefault((record.run, record.method), []).append(at)
    runs = list(dict.fromkeys(record.run for record in records))
    methods = sorted(by_method)
    random.Random(seed).shuffle(methods)
    order = [at for run in runs for pair in methods if pair[0] == run for at in by_method[pair]]
    assert order != sorted(order)

    def told(which: list[int]) -> Mapping[str, list[str]]:
        made = case(subject, obligations, [records[at] for at in which], keys=keys, **extras)
        return {name: plain(found) for name, found in every_text(made) if isinstance(found, str)}

    expected = told(sorted(order))
    for name, lines in told(order).items():
        assert lines == expected[name], name


@pytest.mark.slow
def test_two_runs_of_a_workspace_say_the_same(tmp_path: Path) -> None:
    """What the first found is put into a ledger in two orders of arrival."""
    first = tmp_path / "first"
    folder = programs(first / "contracts" / "made", 2, 2)
    (first / "dodo.py").write_text("")
    (folder / "subject.py").write_text("def step(**given):\n    return {}\n")
    plan = yaml.safe_load((folder / "plan.yaml").read_text())
    for node in plan["nodes"].values():
        node["methods"].append({"hypothesis": {"subject": "subject.py:step", "cases": 3}})
    (folder / "plan.yaml").write_text(yaml.safe_dump(plan))
    avow("verify", cwd=first)
    found = [entry.evidence for entry in Ledger(first / "artifacts" / "ledger" / "made.jsonl").records()]
    shuffled = random.Random(1).sample(found, len(found))
    told = []
    for at, order in enumerate((found, found[::-1], shuffled)):
        root = tmp_path / str(at)
        shutil.copytree(first, root, ignore=shutil.ignore_patterns("reports", "ledger", "report.json", ".settled.json"))
        Ledger(root / "artifacts" / "ledger" / "made.jsonl").append_all(order)
        avow("verify", cwd=root)
        assert len(Ledger(root / "artifacts" / "ledger" / "made.jsonl").records()) == len(found)
        files = {f.relative_to(root).as_posix(): f for f in (root / "reports").rglob("*") if f.suffix != ".pdf"}
        told.append({n: plain(f.read_text()) for n, f in files.items() if f.is_file()})
    for other in told[1:]:
        assert other.keys() == told[0].keys()
        for name, lines in other.items():
            assert lines == told[0][name], name

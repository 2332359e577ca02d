"""Processor time of a case of ten thousand obligations and its reports: ``python benchmarks/report_10000.py``."""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from assurance.sample import case, evidence, guarantee, node_plan, system

from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.report import formats
from avow.system.plan import Requirement


def main() -> None:
    nodes = {f"node{n}": [f"g{k}" for k in range(100)] for n in range(100)}
    obligations = [
        guarantee(n, g, f"{n} does {g}", "∀ x ∈ ℝ · in.x < 3 ⇒ out.y = 2") for n, gs in nodes.items() for g in gs
    ]
    records = [evidence(o) for o in obligations]
    records += [evidence(o, Verdict.TESTED, "hypothesis", bound={"cases": 100}) for o in obligations[::2]]
    requirements = [
        Requirement(f"R{k}", "text", None, None, tuple(f"node{k}.g{j}" for j in range(100))) for k in range(100)
    ]
    subject = system(
        nodes, plans=[node_plan(n, "high", "hoare", "hypothesis") for n in nodes], requirements=requirements
    )
    text = "".join(
        f"node {n} {{\n" + "".join(f'  guarantee {g} "it does" ( in.x < 3 -> out.y == 2 ) // {n}\n' for g in gs) + "}\n"
        for n, gs in nodes.items()
    )
    path = "contracts/rover/system.rcl"
    start = time.process_time()
    found = case(subject, obligations, records, digests={path: sha256(text)}, sources={path: text})
    print(
        f"{'the case':18} {time.process_time() - start:6.2f} s   {len(obligations)} obligations, {len(records)} records"
    )
    start = time.process_time()
    for name, content in formats(found):
        size = f"{len(content) / 1e6:.1f} MB"
        print(f"{name:18} {time.process_time() - start:6.2f} s   {size}")
        start = time.process_time()


if __name__ == "__main__":
    main()

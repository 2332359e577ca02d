"""A seeded case: a contract and the method's part of the plan, with the correct verdicts."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from avow.backend_kit import one_step
from avow.backend_kit.protocol import Backend, Job, Limits, Report
from avow.base.codec import from_json, to_json
from avow.base.files import write
from avow.base.verdict import Verdict
from avow.pipeline.methods import method_job
from avow.system.load import load_system


@dataclass(frozen=True, slots=True)
class Seeded:
    """One node, one method, and the expected verdicts."""

    name: str
    contract: str
    """RCL. The method is that of its first node."""
    options: Any
    """The method's options, as in plan.yaml."""
    verdicts: Mapping[str, Verdict]
    """Guarantee → its correct verdict. A guarantee left out is not given to the method."""
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    """Path in the system's folder → text or bytes: programs, data, mappings. The answer depends on each of them."""
    plan: Mapping[str, Any] = field(default_factory=dict)
    """More keys of plan.yaml: a scenario, connections, …"""
    declared: Mapping[str, Any] = field(default_factory=dict)
    """More of the node's entry in plan.yaml: its source, numbers and memory."""
    prepare: Callable[[Path], None] | None = None
    """Called with the system's folder when all is written: for files made from the others, such as digests."""

    @property
    def node(self) -> str:
        found = re.search(r"\bnode\s+(\w+)", self.contract)
        assert found is not None, f"{self.name}: the contract has no node"
        return found[1]

    def written(self, backend: Backend, folder: Path) -> Job:
        """The case as a system's folder, read back. Raises Rejected if contract or plan have errors."""
        for name, text in self.files.items():
            write(folder / name, text)
        write(folder / "system.rcl", self.contract)
        options = self.options
        if isinstance(options, Mapping):
            options = {"guarantees": list(self.verdicts), **options}
        node = {**self.declared, "methods": [{backend.name: options}]}
        plan = {**self.plan, "contract": "system.rcl", "nodes": {self.node: node}}
        write(folder / "plan.yaml", yaml.safe_dump(plan, allow_unicode=True, sort_keys=False))
        if self.prepare is not None:
            self.prepare(folder)
        system = load_system(folder)
        (method,) = system.plan.node(self.node).methods
        return method_job(system, system.contract.node(self.node), method, backend)

    def renamed(self, words: Mapping[str, str]) -> Seeded:
        """The case with names replaced wherever they occur as words: in the contract, the options, the files and the
        plan."""
        if not words:
            return self
        word = re.compile(r"(?<![\w'])(" + "|".join(map(re.escape, words)) + r")(?![\w'])")

        def text(old: str) -> str:
            return word.sub(lambda m: words[m[1]], old)

        def value(old: Any) -> Any:
            match old:
                case str():
                    return text(old)
                case Mapping():
                    return {value(k): value(v) for k, v in old.items()}
                case list() | tuple():
                    return [value(item) for item in old]
                case _:  # it contains no names
                    return old

        return replace(
            self,
            contract=text(self.contract),
            options=value(self.options),
            verdicts={text(name): verdict for name, verdict in self.verdicts.items()},
            files={text(name): value(content) for name, content in self.files.items()},
            plan=value(self.plan),
            declared=value(self.declared),
        )


def settle(backend: Backend, job: Job, folder: Path, limits: Limits) -> Report:
    """Export and discharge as in the pipeline, which reads the report from another process."""
    for name, text in one_step.export(backend, job).items():
        write(folder / name, text)
    folder.mkdir(parents=True, exist_ok=True)
    report = one_step.discharge(backend, job, folder, limits)
    return from_json(Report, json.loads(json.dumps(to_json(report), default=str)))


def verdicts(job: Job, report: Report) -> dict[str, Verdict]:
    """Guarantee → verdict. Fails if an obligation has no outcome, or several."""
    names = {o.id: o.name for o in job.every}
    answered = [outcome.obligation for outcome in report.outcomes]
    assert sorted(answered) == sorted(names), f"one outcome for each obligation, not {answered} for {sorted(names)}"
    own = {o.id for o in job.obligations}
    return {names[o.obligation]: o.verdict for o in report.outcomes if o.obligation in own}

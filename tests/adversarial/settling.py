"""A system written into a folder, and one method of one node asked in this process."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from avow.backend_kit.protocol import Limits
from avow.base.verdict import Outcome
from avow.pipeline.methods import method_backend, method_job
from avow.system.load import load_system


def settle(folder: Path, contract: str, method: str, files: Mapping[str, str], node: str = "n") -> dict[str, Outcome]:
    """Guarantee → outcome. `method` is the plan's one line of it."""
    (folder / "system.rcl").write_text(contract)
    (folder / "plan.yaml").write_text(f"system: s\nnodes:\n  {node}:\n    methods:\n      - {method}\n")
    for name, text in files.items():
        (folder / name).write_text(text)
    system = load_system(folder)
    entry = system.plan.node(node)
    assert entry is not None
    tool = method_backend(system, entry.methods[0])
    job = method_job(system, system.contract.node(node), entry.methods[0])
    assert not [d for d in tool.check(job) if d.is_error]
    artifacts = folder / "artifacts"
    artifacts.mkdir()
    for name, text in tool.export(job).items():
        (artifacts / name).parent.mkdir(parents=True, exist_ok=True)
        (artifacts / name).write_text(text)
    report = tool.discharge(job, artifacts, Limits(seconds=30))
    return {o.obligation.rpartition("/")[2]: o for o in report.outcomes}

"""Jobs for the AJPF backend, built from the repository's systems and from a small lift."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from avow.backend_kit.protocol import Job
from avow.evidence.obligation import Kind, Obligation
from avow.system.load import load_system

FIXTURES = Path(__file__).parent / "fixtures"
ROOT = Path(__file__).parent.parent.parent

MakeJob = Callable[..., Job]


@pytest.fixture
def lift(tmp_path: Path) -> MakeJob:
    """The lift's job; `options` are laid over the plan's (None removes one), `files` over the folder's."""

    def make(options: Mapping[str, Any] | None = None, files: Mapping[str, str] | None = None) -> Job:
        folder = tmp_path / "lift"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(FIXTURES / "lift", folder)
        for name, text in (files or {}).items():
            (folder / name).write_text(text)
        return _job(folder, "cabin", options or {})

    return make


@pytest.fixture
def rover(tmp_path: Path) -> MakeJob:
    """A case study's agent: `system` is the folder's name, `method` the fixture with its method."""

    def make(
        system: str, method: str, options: Mapping[str, Any] | None = None, program: Callable[[str], str] | None = None
    ) -> Job:
        folder = tmp_path / system
        shutil.rmtree(folder, ignore_errors=True)
        models = ROOT / "contracts" / system / "models"
        (folder / "models").mkdir(parents=True)
        for name in ("agent.gwen", "agent_environment.yaml", "waypoints.csv"):
            shutil.copyfile(models / name, folder / "models" / name)
        shutil.copyfile(models.parent / "system.rcl", folder / "system.rcl")
        if program is not None:
            path = folder / "models" / "agent.gwen"
            old = path.read_text()
            new = program(old)
            assert new != old, "the fault was not seeded"
            path.write_text(new)
        plan = {
            "system": system,
            "title": "The agent",
            "contract": "system.rcl",
            "scenario": {
                "waypoints": "models/waypoints.csv",
                "interpret": {"agent.wayP": "waypoints(x, y, id)"},
                "domains": {"NATURAL": "waypoints.id"},
            },
            "nodes": {"agent": {"criticality": "high", "methods": yaml.safe_load((FIXTURES / method).read_text())}},
        }
        (folder / "plan.yaml").write_text(yaml.safe_dump(plan, sort_keys=False))
        return _job(folder, "agent", options or {})

    return make


def _job(folder: Path, node_name: str, options: Mapping[str, Any]) -> Job:
    path = folder / "plan.yaml"
    plan = yaml.safe_load(path.read_text())
    given = plan["nodes"][node_name]["methods"][0]["ajpf"]
    for key, value in options.items():
        if value is None:
            given.pop(key, None)
        else:
            given[key] = value
    path.write_text(yaml.safe_dump(plan, sort_keys=False))
    system = load_system(folder)
    node = system.contract.node(node_name)
    method = system.plan.node(node_name).methods[0]
    names = method.guarantees or tuple(clause.name for clause in node.guarantees)
    method = replace(method, guarantees=names)
    obligations = tuple(Obligation(system.name, node_name, Kind.GUARANTEE, name, "", "", "") for name in names)
    return Job(system, node, method, obligations)

"""The case study with the monitors' options in its plan, and small systems written on the spot."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from avow.backend_kit.protocol import Job
from avow.backends.rosmonitoring.options import origin
from avow.backends.rosmonitoring.session import Session
from avow.backends.rosmonitoring.traces import read_trace
from avow.backends.rosmonitoring.watched import Violation
from avow.evidence.obligation import Kind, Obligation
from avow.system.load import load_system
from avow.system.plan import System

ROOT = Path(__file__).parents[2]
CASE = ROOT / "contracts" / "remote_inspection"

ARRIVAL = {"by": "arrival", "because": "one process writes the trace"}
MAPPINGS: dict[str, dict[str, Any]] = {
    "localisation": {"out.position": ["posX", "posY"]},
    "navigation": {"in.position": ["posX", "posY"], "out.at": ["posX", "posY"]},
    "agent": {
        "in.wayP": {"scenario": True, "fields": ["posX", "posY", "id"]},
        "out.command": {"constructor": "command", "move": ["posX", "posY"], "inspect": ["id"]},
        "out.phase": {"topic": "phase", "type": "gazebo_radiation_plugins/Snapshot", "field": "phase"},
    },
    "radiationSensor": {
        "in.r": "radiation",
        "out.radiationStatus": "level",
        "out.inspected": {"fields": ["id"], "hold": "seen"},
    },
}


def write_case(folder: Path, traces: dict[str, list[str]] | None = None) -> Path:
    """A copy of the case study whose plan has the monitors' method blocks, and no other."""
    target = folder / "remote_inspection"
    shutil.copytree(CASE, target)
    text = (target / "plan.yaml").read_text(encoding="utf-8")
    plan = yaml.safe_load(re.sub(r"\bon:", '"on":', text))  # a key, and not the truth value of YAML 1.1
    for name, mapping in MAPPINGS.items():
        options: dict[str, Any] = {"mapping": mapping, "answers": ARRIVAL, "decided": 0.9}
        if traces is not None:
            options["traces"] = traces.get(name, ["traces/nominal.jsonl"])
        plan["nodes"][name]["methods"] = [{"rosmonitoring": options}]
    plan.pop("expected", None)
    plan.pop("accepted", None)
    plan.pop("assumptions", None)
    (target / "plan.yaml").write_text(json.dumps(plan, default=str), encoding="utf-8")
    return target


@pytest.fixture(scope="session")
def case_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_case(tmp_path_factory.mktemp("case"), {})


@pytest.fixture(scope="session")
def case(case_folder: Path) -> System:
    return load_system(case_folder)


@pytest.fixture(scope="session")
def nominal() -> list[dict[str, Any]]:
    text = (CASE / "traces" / "nominal.jsonl").read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines()]


@pytest.fixture
def make_system(tmp_path: Path) -> Callable[..., System]:
    """``make_system(rcl, mapping={...}, messages={"a/N": "int32 count"}, **options)``: one node and its monitor."""

    def make(rcl: str, mapping: dict[str, Any] | None = None, **more: Any) -> System:
        folder = tmp_path / f"system{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        (folder / "system.rcl").write_text(rcl, encoding="utf-8")
        plan_parts = more.pop("plan", {})
        messages: dict[str, str] = more.pop("messages", {})
        for kind, text in messages.items():
            package, _, kind_name = kind.partition("/")
            (folder / "msgs" / package / "msg").mkdir(parents=True, exist_ok=True)
            (folder / "msgs" / package / "msg" / f"{kind_name}.msg").write_text(text, encoding="utf-8")
        if messages:
            plan_parts = {"messages": ["msgs"], **plan_parts}
        name = rcl.split("node", 1)[1].split("{", 1)[0].strip()
        given = {"answers": ARRIVAL, **more, "mapping": mapping or {}}
        options = {name: option for name, option in given.items() if option is not None}
        plan = {"contract": "system.rcl", "nodes": {name: {"methods": [{"rosmonitoring": options}]}}, **plan_parts}
        (folder / "plan.yaml").write_text(json.dumps(plan), encoding="utf-8")
        return load_system(folder)

    return make


def job_for(system: System, name: str) -> Job:
    node = system.contract.node(name)
    method = system.plan.node(name).methods[0]
    obligations = tuple(
        Obligation(system.name, name, Kind.GUARANTEE, g.name, g.sentence or "", g.text, "0" * 64, (f"{name}.{g.name}",))
        for g in node.guarantees
    )
    return Job(system, node, method, obligations)


def one_by_one(running: Session, path: Path) -> Iterator[Violation]:
    """As `Session.run`, by the engine alone: no event is passed over as being like another."""
    for recorded in read_trace(path, origin(running.system), running.listens):
        yield from running.step(recorded.event)
    yield from running.finish()

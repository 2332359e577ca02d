"""The law for what is installed: after a tool came, went or was replaced, `avow verify` says what `--fresh` says."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import yaml

AVOW = str(Path(sys.executable).with_name("avow"))
RCL = """node sensor {
  inputs( r : REAL ) outputs( high : BOOL ) topics( p/R r matches(in.r), p/H high matches(out.high) )
  guarantee warns ( in.r > 120 -> out.high )
}
"""
ADAPTER = """#include "avow_node.hpp"
struct AvowNode {
  explicit AvowNode(const avow::Parameters&) {}
  void step(const avow::Inputs& in, avow::Outputs& out) { out.truth("high", in.real("r") > 100); }
};
"""
DAFNY = """include "sensor_spec.dfy"
module {:options "--function-syntax:3"} SensorImpl refines SensorSpec {
  predicate Env(in_r: real) { true }
  lemma EnvNotEmpty() returns (in_r: real) { in_r := 0.0; }
  method Step(in_r: real) returns (out_high: bool) { out_high := in_r > 100.0; }
}
"""


@dataclass(frozen=True)
class Sample:
    """A system of one node, and the tools that its evidence hangs on."""

    method: dict[str, object]
    files: dict[str, str]
    tools: tuple[str, ...]
    declared: dict[str, object] = field(default_factory=dict)
    node: str = "sensor"
    contract: str = RCL


GUARDS = ("strace", "bwrap")
SAMPLES = {
    "dafny": Sample({"dafny": {"implementation": "s.dfy"}}, {"s.dfy": DAFNY}, ("dafny", "z3", "strace")),
    "fuzz": Sample({"fuzz": {"runs": 100}}, {"n.hpp": ADAPTER}, ("clang++",), {"source": {"cpp": "n.hpp"}}),
}


class World:
    """A workspace, and a folder of links to all the programs that there are: the whole PATH."""

    def __init__(self, place: Path, programs: Path, sample: Sample) -> None:
        self.root, self.programs = place / "w", programs
        folder = self.root / "contracts" / "s"
        folder.mkdir(parents=True)
        (self.root / "dodo.py").write_text("")
        (folder / "s.rcl").write_text(sample.contract)
        for name, text in sample.files.items():
            (folder / name).write_text(text)
        plan = {"system": "s", "nodes": {sample.node: {**sample.declared, "methods": [sample.method]}}}
        (folder / "plan.yaml").write_text(yaml.safe_dump(plan))
        for there in Path("/usr/bin").iterdir():
            (self.programs / there.name).symlink_to(there)
        self.environment = {**os.environ, "PATH": str(self.programs), "XDG_CACHE_HOME": str(place / "cache")}
        self.environment.pop("AVOW_SANDBOX", None)

    def hide(self, tool: str) -> None:
        (self.programs / tool).unlink()

    def wrap(self, tool: str) -> None:
        """Another program of that name, which does the same."""
        self.hide(tool)
        (self.programs / tool).write_text(f'#!/bin/sh\nexec /usr/bin/{tool} "$@"\n')
        (self.programs / tool).chmod(0o755)

    def silence(self, tool: str) -> None:
        """A program of that name that does nothing."""
        self.hide(tool)
        (self.programs / tool).write_text("#!/bin/sh\nexit 0\n")
        (self.programs / tool).chmod(0o755)

    def bring(self, tool: str) -> None:
        (self.programs / tool).unlink(missing_ok=True)
        (self.programs / tool).symlink_to(f"/usr/bin/{tool}")

    def verify(self, *options: str) -> dict[str, object]:
        done = subprocess.run(
            [AVOW, "verify", *options],
            cwd=self.root,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
            env=self.environment,
        )
        assert "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr
        case = json.loads((self.root / "reports" / "s" / "report.json").read_text())
        said: dict[str, object] = {"exit": done.returncode}
        for o in case["obligations"]:
            counting = [e["entry"]["evidence"]["details"] for e in o["evidence"] if e["currency"] == "current"]
            said[o["obligation"]["name"]] = o["standing"], [details.get("isolation") for details in counting[-1:]]
        return said

    def records(self) -> int:
        return len((self.root / "artifacts" / "ledger" / "s.jsonl").read_text().splitlines())


CHANGES: dict[str, Callable[[World, str], None]] = {"gone": World.hide, "other": World.wrap, "mute": World.silence}
CASES = [f"{n} {t} {how}" for n, sample in SAMPLES.items() for t in sample.tools for how in CHANGES]
CASES.remove("dafny strace mute")  # a tracer that starts nothing fails a run, and says nothing about one before
SLOW = ("dafny z3 gone",)


@pytest.fixture
def programs() -> Iterator[Path]:
    """Not below ``/tmp``, of which who is sealed sees nothing."""
    with tempfile.TemporaryDirectory(dir="/var/tmp") as name:
        yield Path(name)


@pytest.mark.parametrize(
    "case", [pytest.param(c, marks=pytest.mark.slow if c in SLOW else pytest.mark.nightly) for c in CASES]
)
def test_the_law_when_a_tool_comes_or_goes(tmp_path: Path, programs: Path, case: str) -> None:
    name, tool, how = case.split()
    if shutil.which(tool) is None:
        pytest.skip(f"{tool} is not here")
    world = World(tmp_path, programs, SAMPLES[name])
    first = world.verify()
    records = world.records()
    assert world.verify() == first
    assert world.records() == records
    CHANGES[how](world, tool)
    changed = world.verify()
    if tool not in GUARDS:  # what was recorded with a tracer is still known in full without it
        assert world.records() > records, "nothing was asked again"
    records = world.records()
    assert world.verify() == changed
    assert changed == world.verify("--fresh")
    world.bring(tool)
    again = world.verify()
    assert again == first
    assert again == world.verify("--fresh")


@pytest.mark.slow
def test_a_run_with_nothing_to_do_starts_neither_tracer_nor_sandbox(tmp_path: Path, programs: Path) -> None:
    world, log = World(tmp_path, programs, SAMPLES["dafny"]), tmp_path / "log"
    for name in filter(lambda name: (programs / name).exists(), GUARDS):  # bwrap is optional
        world.hide(name)
        (programs / name).write_text(f'#!/bin/sh\necho {name} >>{log}\nexec /usr/bin/{name} "$@"\n')
        (programs / name).chmod(0o755)
    first = world.verify()
    started = log.read_text()
    assert "strace" in started
    assert world.verify() == first
    assert log.read_text() == started

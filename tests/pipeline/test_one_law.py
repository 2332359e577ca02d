"""One law over all of it: whatever happened before, `avow verify` says what `avow verify --fresh` says."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

AVOW = str(Path(sys.executable).with_name("avow"))
RCL = """node n {{ inputs( x : REAL ) outputs( y : REAL ) topics()
  assume some ( in.x >= {least} )
  guarantee small ( out.y <= {most} )
  guarantee large ( out.y >= {low} )
}}
"""
PLAN = """system: s
requirements:
  R: {{text: "The output is small.", supported_by: [n.small]}}
nodes: {{n: {{criticality: low, methods: [{{hypothesis: {{subject: '{file}:step', cases: {cases}, seed: {seed}}}}}]}}}}
"""
SUBJECTS = {
    "right": "from lib import limit\ndef step(x):\n    return min(x, limit.TOP)\n",
    "wrong": "def step(x):\n    return x\n",
    "reads": "top = float(open('top.txt').read())\ndef step(x):\n    return min(x, top)\n",
    "raises": "def step(x):\n    raise ValueError\n",
}


class World:
    """A workspace, and what may happen to it."""

    def __init__(self, root: Path, rng: random.Random) -> None:
        self.root, self.rng = root, rng
        self.folder = root / "contracts" / "s"
        (self.folder / "lib").mkdir(parents=True)
        (root / "dodo.py").write_text("")
        (self.folder / "lib" / "limit.py").write_text("TOP = 5\n")
        (self.folder / "top.txt").write_text("5")
        self.told = {"least": 0, "most": 10, "low": -100, "cases": 20, "seed": 0, "file": "m.py"}
        self.subject = "right"
        self.kept: list[Path] = []
        self.rolled_back = False
        self.contract = "s.rcl"
        self.environment = dict(os.environ)
        self.write()

    def write(self) -> None:
        (self.folder / self.contract).write_text(RCL.format(**self.told))
        (self.folder / "plan.yaml").write_text(PLAN.format(**self.told))
        for old in self.folder.glob("m*.py"):
            old.unlink()
        (self.folder / str(self.told["file"])).write_text(SUBJECTS[self.subject])

    def option(self) -> None:
        name = self.rng.choice(["least", "most", "low", "cases", "seed"])
        self.told[name] = self.rng.choice({"cases": [5, 20], "seed": [0, 1, 2]}.get(name, [-1, 0, 4, 10]))
        self.write()

    def rename(self) -> None:
        self.told["file"] = self.rng.choice(["m.py", "m2.py", "m3.py"])
        self.write()

    def swap(self) -> None:
        self.subject = self.rng.choice([*SUBJECTS])
        self.write()

    def data(self) -> None:
        path = self.rng.choice([self.folder / "top.txt", self.folder / "lib" / "limit.py"])
        number = self.rng.choice([3, 5, 50])
        path.write_text(str(number) if path.suffix == ".txt" else f"TOP = {number}\n")

    def move(self) -> None:
        """The contract's file has another name."""
        old = next(self.folder.glob("*.rcl"))
        self.contract = self.rng.choice(["s.rcl", "a.rcl"])
        old.rename(self.folder / self.contract)

    def sandbox(self) -> None:
        """From now on programs are sealed, or not."""
        self.environment["AVOW_SANDBOX"] = self.rng.choice(["off", ""])

    def missing(self) -> None:
        path = self.folder / "top.txt"
        if path.exists():
            path.unlink()
        else:
            path.write_text("5")

    def comment(self) -> None:
        path = self.folder / self.contract
        path.write_text(path.read_text() + f"// {self.rng.random()}\n")

    def edit_notes(self) -> None:
        files = [f for place in ("artifacts", "reports") for f in (self.root / place).rglob("*") if f.is_file()]
        files = [f for f in files if f.parent.name != "ledger"]
        for path in self.rng.sample(files, min(3, len(files))):
            match self.rng.randrange(3):
                case 0:
                    path.unlink()
                case 1:  # a report that names another newest record is reported as a lost ledger, and rightly
                    one, none = (b" 1", b" 0") if path.name == "report.json" else (b"1", b"0")
                    path.write_bytes(path.read_bytes().replace(one, none).replace(b"refuted", b"proved"))
                case _:
                    path.write_bytes(b"")

    def keep(self) -> None:
        place = self.root.with_name(f"{self.root.name}-kept{len(self.kept)}")
        if (self.root / "artifacts" / "s").is_dir():  # not where the first run was killed at once
            shutil.copytree(self.root / "artifacts" / "s", place, dirs_exist_ok=True)
            self.kept.append(place)

    def restore(self) -> None:
        if self.kept:
            shutil.copytree(self.rng.choice(self.kept), self.root / "artifacts" / "s", dirs_exist_ok=True)

    def roll_back(self) -> None:
        """The ledger as it was some records ago."""
        path = self.root / "artifacts" / "ledger" / "s.jsonl"
        lines = path.read_bytes().splitlines(keepends=True) if path.is_file() else []
        if len(lines) > 1:
            path.write_bytes(b"".join(lines[: self.rng.randrange(1, len(lines))]))
            self.rolled_back = True

    def killed(self) -> None:
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        run = subprocess.Popen([AVOW, "verify"], cwd=self.root, env=self.environment, **quiet)
        time.sleep(self.rng.random() * 2)
        run.send_signal(signal.SIGKILL)
        run.wait()

    def happenings(self) -> list[Callable[[], None]]:
        return [
            *(self.option, self.rename, self.swap, self.data, self.missing, self.comment),
            *(self.edit_notes, self.keep, self.restore, self.roll_back, self.killed, self.move, self.sandbox),
        ]

    def verify(self, *options: str) -> tuple[int, dict[str, str]]:
        command = [AVOW, "verify", *options]
        done = subprocess.run(
            command, cwd=self.root, capture_output=True, text=True, timeout=120, check=False, env=self.environment
        )
        assert "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr
        case = json.loads((self.root / "reports" / "s" / "report.json").read_text())
        standings = {f"{o['obligation']['node']}/{o['obligation']['name']}": o["standing"] for o in case["obligations"]}
        gates = {f"gate {gate['id']}": "passes" if gate["passed"] else "fails" for gate in case["gates"]}
        return done.returncode, standings | gates


def hold(root: Path, seed: int, steps: int, seconds: float) -> None:
    """A walk of so many steps; none is begun after so many seconds."""
    end = time.monotonic() + seconds
    rng = random.Random(seed)
    world = World(root, rng)
    done = []
    for step in range(steps):
        if step and time.monotonic() > end:
            break
        for happens in rng.choices(world.happenings(), k=rng.randrange(1, 4)):
            done.append(happens.__name__)
            happens()
        said = world.verify()
        # who lost records has to say so: no run forgets it, fresh or not
        assert said[1]["gate integrity"] == ("fails" if world.rolled_back else "passes"), (seed, done)
        assert said == world.verify("--fresh"), (seed, done)
        assert said == world.verify(), (seed, done)


@pytest.mark.nightly
def test_the_law_on_a_short_walk(tmp_path: Path) -> None:
    hold(tmp_path / "w", 1, 1, 60)


@pytest.mark.nightly
def test_the_law_after_a_ledger_was_rolled_back(tmp_path: Path) -> None:
    world = World(tmp_path / "w", random.Random(3))
    assert world.verify()[1]["gate integrity"] == "passes"
    world.subject = "wrong"
    world.write()
    world.verify()
    world.roll_back()
    said = world.verify()
    assert said[0] == 1
    assert said[1]["gate integrity"] == "fails"
    assert said == world.verify("--fresh") == world.verify()


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(int(os.environ.get("AVOW_WALKS", "25"))))
def test_the_law_on_random_walks(tmp_path: Path, seed: int) -> None:
    """Six steps of two edits on average: 25 walks make 300."""
    hold(tmp_path / "w", 100 + seed, 6, float(os.environ.get("AVOW_WALK_SECONDS", "600")))

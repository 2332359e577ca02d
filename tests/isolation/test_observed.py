"""What a subject looks at without anybody having declared it: a change of it makes the evidence stale."""

from __future__ import annotations

import py_compile
from collections.abc import Iterator
from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.currency import as_of_now
from avow.evidence.ledger import ledger_of
from avow.isolation.level import SANDBOX, seals
from avow.isolation.observed import Observed, Seen, look
from avow.isolation.subject import SubjectProcess
from avow.pipeline.discharge import discharge, open_obligations
from avow.pipeline.run_info import Run
from avow.pipeline.work import Work
from avow.pipeline.workload import Survey, survey

RCL = """
node limiter {
  inputs ( wish: REAL )
  outputs ( speed: REAL )
  topics ( )
  guarantee limited ( out.speed <= 10 )
}
"""

PLAN = """
system: robot
contract: robot.rcl
nodes:
  limiter:
    methods:
      - hypothesis: {subject: models/limiter.py:step, cases: 20}
"""

SUBJECT = """
import glob, json, os, pathlib
from pkg import part
from pkg.deep import leaf
import space.inner
from space import bare
here = pathlib.Path(__file__).parent
limits = json.loads((here.parent / "config" / "limits.json").read_text())
try:
    bonus = float(open("config/bonus.txt").read())
except OSError:
    bonus = 0
extra = sum(1 for name in os.listdir(here / "plugins"))
later = len(glob.glob(str(here / "many" / "*.txt")))
import sys
sys.path.insert(0, str(here / "vendor"))
import vendored
outside = (pathlib.Path(OUTSIDE)).read_text()

def step(wish):
    return min(wish, 10 if limits["top"] and part.ON and leaf.ON and space.inner.ON and vendored.ON else 1000)
"""

FILES = {
    "robot.rcl": RCL,
    "plan.yaml": PLAN,
    "config/limits.json": '{"top": 1}',
    "models/pkg/__init__.py": "",
    "models/pkg/part.py": "from . import twin\nON = twin.ON\n",
    "models/pkg/twin.py": "ON = True\n",
    "models/pkg/deep/__init__.py": "from ..twin import ON as _\n",
    "models/pkg/deep/leaf.py": "ON = True\n",
    "models/space/inner.py": "ON = True\n",
    "models/space/bare/data.txt": "",
    "models/plugins/a.py": "",
    "models/many/a.txt": "",
    "models/vendor/vendored.py": "ON = True\n",
}


CHANGES = {
    "a module of a package": ("models/pkg/part.py", "from . import twin\nON = 0\n"),
    "a relative import": ("models/pkg/twin.py", "ON = False\n"),
    "a package's __init__": ("models/pkg/__init__.py", "x = 1\n"),
    "a nested package": ("models/pkg/deep/leaf.py", "ON = False\n"),
    "a namespace package": ("models/space/inner.py", "ON = False\n"),
    "a parameter file": ("config/limits.json", '{"top": 0}'),
    "a missing file that appears": ("config/bonus.txt", "5"),
    "a listed folder": ("models/plugins/b.py", ""),
    "a globbed folder": ("models/many/b.txt", ""),
    "a folder put on the path": ("models/vendor/vendored.py", "ON = False\n"),
    "a module that comes first": ("models/json.py", "def loads(text): return {'top': 0}\n"),
    "a package in place of a namespace": ("models/space/__init__.py", "ON = False\n"),
    "a package where only a folder was": ("models/space/bare/__init__.py", "ON = False\n"),
    "a file outside": ("../../outside.txt", "other"),
    "the subject": ("models/limiter.py", "def step(wish): return 0\n"),
}


@pytest.fixture(scope="module")
def settled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Workspace, Work]]:
    root = tmp_path_factory.mktemp("observed")
    workspace = Workspace(root)
    folder = root / "contracts" / "robot"
    (root / "outside.txt").write_text("one")
    subject = SUBJECT.replace("OUTSIDE", repr(str(root / "outside.txt")))
    for name, text in {**FILES, "models/limiter.py": subject}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    work = method(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(SANDBOX, "off")  # a sealed one would not see the file outside, which lies under /tmp
        outcomes = discharge(workspace, work, Run("first", False))
        assert [o.verdict for o in outcomes] == [Verdict.TESTED], outcomes
        assert not open_obligations(workspace, work, Run("second", False))
        yield workspace, work


def method(folder: Path) -> Work:
    found = survey(folder)
    assert isinstance(found, Survey), found
    return found.work("hypothesis")


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_of_it_makes_stale_and_the_old_state_is_known_again(
    settled: tuple[Workspace, Work], name: str
) -> None:
    workspace, _ = settled
    folder = workspace.contracts / "robot"
    place, text = CHANGES[name]
    path = folder / place
    before = path.read_text() if path.exists() else None
    try:
        path.write_text(text)
        assert open_obligations(workspace, method(folder), Run("third", False))
    finally:
        path.unlink() if before is None else path.write_text(before)
    assert not open_obligations(workspace, method(folder), Run("fourth", False))


def test_a_file_that_goes_makes_stale(settled: tuple[Workspace, Work]) -> None:
    workspace, _ = settled
    path = workspace.contracts / "robot" / "config" / "limits.json"
    text = path.read_text()
    path.unlink()
    assert open_obligations(workspace, method(workspace.contracts / "robot"), Run("third", False))
    path.write_text(text)


def test_what_nobody_looked_at_changes_nothing(settled: tuple[Workspace, Work]) -> None:
    workspace, _ = settled
    (workspace.contracts / "robot" / "config" / "notes.txt").write_text("nobody reads this")
    assert not open_obligations(workspace, method(workspace.contracts / "robot"), Run("third", False))


def test_a_sandbox_asked_for_later_asks_again(settled: tuple[Workspace, Work], monkeypatch: pytest.MonkeyPatch) -> None:
    workspace, work = settled
    assert ledger_of(workspace.ledger("robot")).records()[-1].evidence.details["isolation"] == "processes"
    monkeypatch.setenv(SANDBOX, "required")
    assert open_obligations(workspace, work, Run("third", False))


HIDDEN = """import pathlib
place = pathlib.Path(OUTSIDE)
def step(wish): return 1000 if place.exists() and place.read_text() == "fast" else min(wish, 10)
"""


@pytest.mark.slow
@pytest.mark.parametrize("first", ["off", "required"])
def test_a_sandbox_hides_no_file_and_no_isolation_clears_a_refutation(
    first: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file of ``/tmp`` decides what the program does."""
    folder = tmp_path / "contracts" / "robot"
    (folder / "models").mkdir(parents=True)
    (folder / "robot.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN)
    (tmp_path / "mode").write_text("fast")
    (folder / "models" / "limiter.py").write_text(HIDDEN.replace("OUTSIDE", repr(str(tmp_path / "mode"))))
    workspace = Workspace(tmp_path)
    for run, sandbox in enumerate((first, "off", "required")):
        monkeypatch.setenv(SANDBOX, sandbox if seals() else "off")
        assert [o.verdict for o in discharge(workspace, method(folder), Run(str(run), True))] == [Verdict.REFUTED]
    monkeypatch.setenv(SANDBOX, "off")
    records = as_of_now(ledger_of(workspace.ledger("robot")), tmp_path)
    keys = method(folder).keys
    standing = [e.evidence.verdict for e in records if e.evidence.key == keys[e.evidence.obligation]]
    assert set(standing) == {Verdict.REFUTED}
    (tmp_path / "mode").write_text("slow")
    assert [o.verdict for o in discharge(workspace, method(folder), Run("last", True))] == [Verdict.TESTED]


UNRECORDABLE = {
    "a program": "import subprocess\ntop = 10 if subprocess.run(['cat', 'top.txt'], stdout=-1).stdout else 1000\n",
    "the network": "import socket\ns = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\ns.connect(('127.0.0.1', 9))\n",
    "a library": "import ctypes\nctypes.CDLL('libc.so.6')\n",
    "a database": "import sqlite3, tempfile\nsqlite3.connect(tempfile.mkdtemp() + '/d').close()\n",
    "another process": "import os\nif not os.fork():\n    os._exit(0)\nos.wait()\n",
}


@pytest.mark.parametrize("name", UNRECORDABLE)
def test_what_cannot_be_recorded_is_said(tmp_path: Path, name: str) -> None:
    (tmp_path / "top.txt").write_text("10")
    assert any(what.startswith(f"{name} (") for what in outside(tmp_path, UNRECORDABLE[name]))


@pytest.mark.parametrize(
    ("text", "told"), [("import os\nx = os.getenv('X', 1)\n", True), ("import os\nx = os.getpid\n", False)]
)
def test_variables_of_the_environment_are_an_assumption(tmp_path: Path, text: str, told: bool) -> None:
    folder = tmp_path / "contracts" / "robot"
    (folder / "models").mkdir(parents=True)
    files = {"robot.rcl": RCL, "plan.yaml": PLAN, "models/part.py": text}
    files["models/limiter.py"] = "import part\ndef step(wish): return min(wish, 10)\n"
    for name, content in files.items():
        (folder / name).write_text(content)
    (outcome,) = discharge(Workspace(tmp_path), method(folder), Run("first", False))
    assert outcome.verdict is Verdict.TESTED
    assert [*outcome.hypotheses] == [
        "the robot sets no environment variable that contracts/robot/models/part.py reads: in tests none is set"
    ] * told


@pytest.mark.parametrize("network", [False, True])
def test_an_answer_that_rests_on_it_counts_and_is_re_run_in_every_run(tmp_path: Path, network: bool) -> None:
    folder = tmp_path / "contracts" / "robot"
    (folder / "models").mkdir(parents=True)
    (folder / "robot.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN)
    text = UNRECORDABLE["the network"] if network else ""
    (folder / "models" / "limiter.py").write_text(text + "def step(wish): return min(wish, 10)\n")
    first = Run("first", False)
    outcomes = discharge(Workspace(tmp_path), method(folder), first)
    assert [o.verdict for o in outcomes] == [Verdict.TESTED]
    assert ("re-run in every run" in outcomes[0].summary) is network
    assert not open_obligations(Workspace(tmp_path), method(folder), first)
    assert bool(open_obligations(Workspace(tmp_path), method(folder), Run("second", False))) is network


SAME = {
    "a seed": "import random\nassert random.random() == random.Random(0).random()\n",
    "the library for itself": "import asyncio, logging, tempfile, threading\n"
    "async def f():\n    await asyncio.sleep(0.01)\nasyncio.run(f())\nlogging.getLogger().warning('x')\n"
    "with tempfile.TemporaryDirectory() as d:\n    open(d + '/a', 'w').close()\n"
    "t = threading.Thread(target=int)\nt.start()\nt.join(5)\n",
    "the time zone": "import os, time\nassert os.environ['TZ'] == 'UTC' == time.tzname[0]\n",
}


@pytest.mark.parametrize("name", SAME)
def test_what_is_the_same_at_every_run_is_recorded(tmp_path: Path, name: str) -> None:
    assert not outside(tmp_path, SAME[name])


def outside(folder: Path, text: str) -> list[str]:
    """What a program whose module begins with a text uses that cannot be recorded."""
    (folder / "m.py").write_text(text + "def step(): return 10\n")
    subject = SubjectProcess(folder / "m.py", "step", 10.0)
    assert subject.ask({}) == {"i": "10"}
    assert not subject.close()
    return [o.path for o in subject.observed() if o.kind is Seen.OUTSIDE]


@pytest.mark.parametrize("name", ["json", "fractions", "signal"])
@pytest.mark.parametrize("file", ["{}.py", "{}/__init__.py"])
def test_a_module_beside_the_program_replaces_pythons_own(name: str, file: str, tmp_path: Path) -> None:
    (tmp_path / "m.py").write_text(f"import {name}\ndef step(): return getattr({name}, 'OWN', 0)\n")

    def asked() -> tuple[object, tuple[Observed, ...]]:
        subject = SubjectProcess(tmp_path / "m.py", "step", 10.0)
        return subject.ask({}), subject.observed()

    found, before = asked()
    assert found == {"i": "0"}
    (tmp_path / file.format(name)).parent.mkdir(exist_ok=True)
    (tmp_path / file.format(name)).write_text("OWN = 1\n")
    assert [one for one in before if look(one.kind, one.path) != one.digest]  # the folder's listing
    assert asked()[0] == {"i": "1"}


@pytest.mark.slow
def test_a_compiled_file_never_stands_for_its_source(tmp_path: Path) -> None:
    folder = tmp_path / "contracts" / "robot"
    (folder / "models").mkdir(parents=True)
    (folder / "robot.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN)
    (folder / "models" / "limiter.py").write_text("import helper\ndef step(wish): return helper.f(wish)\n")
    helper = folder / "models" / "helper.py"
    helper.write_text("def f(x): return min(x, 10)\n")
    py_compile.compile(str(helper), invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH)
    helper.write_text("def f(x): return x\n")
    outcomes = discharge(Workspace(tmp_path), method(folder), Run("first", False))
    assert [o.verdict for o in outcomes] == [Verdict.REFUTED]

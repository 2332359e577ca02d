"""What a subject looks at without anybody having declared it: a change of it makes the evidence stale."""

from __future__ import annotations

import importlib.util
import py_compile
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import ledger_of
from avow.isolation import subject as subject_module
from avow.isolation import tracing
from avow.isolation.level import SANDBOX, seals
from avow.isolation.observed import Seen, look
from avow.isolation.subject import SubjectProcess
from avow.isolation.tracing import traces
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
import ctypes, glob, json, os, pathlib
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
if (here / "boost").exists():
    bonus += 100
extra = sum(1 for name in os.listdir(here / "plugins"))
later = len(glob.glob(str(here / "many" / "*.txt")))
size = os.path.getsize(here / "size.bin")
sizes = [entry.stat().st_size for entry in os.scandir(here / "sized")]
allowed = os.access(here / "mode.txt", os.X_OK), (here / "mode2.txt").stat().st_mode
chosen = os.path.realpath(here / "chosen"), os.readlink(here / "dangling")
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
    "models/size.bin": "xx",
    "models/sized/a": "xx",
    "models/mode.txt": "",
    "models/mode2.txt": "",
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
    "a file that is only looked for": ("models/boost", ""),
    "a listed folder": ("models/plugins/b.py", ""),
    "a globbed folder": ("models/many/b.txt", ""),
    "a file's size": ("models/size.bin", "xxx"),
    "the size of an entry": ("models/sized/a", "xxx"),
    "a folder put on the path": ("models/vendor/vendored.py", "ON = False\n"),
    "a module that comes first": ("models/json.py", "def loads(text): return {'top': 0}\n"),
    "a package in place of a namespace": ("models/space/__init__.py", "ON = False\n"),
    "a package where only a folder was": ("models/space/bare/__init__.py", "ON = False\n"),
    "a file outside": ("../../outside.txt", "other"),
    "the subject": ("models/limiter.py", "def step(wish): return 0\n"),
}


LINKS = {"models/chosen": "mode.txt", "models/dangling": "nowhere"}


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
    for name, target in LINKS.items():
        (folder / name).symlink_to(target)
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


@pytest.mark.parametrize("name", ["models/mode.txt", "models/mode2.txt"])
def test_another_mode_makes_stale(settled: tuple[Workspace, Work], name: str) -> None:
    workspace, _ = settled
    folder = workspace.contracts / "robot"
    mode = (folder / name).stat().st_mode
    (folder / name).chmod(mode ^ 0o100)
    assert open_obligations(workspace, method(folder), Run("third", False))
    (folder / name).chmod(mode)
    assert not open_obligations(workspace, method(folder), Run("fourth", False))


@pytest.mark.parametrize("name", LINKS)
def test_another_target_of_a_link_makes_stale(settled: tuple[Workspace, Work], name: str) -> None:
    """Of one with the same content, and of one that is not there."""
    workspace, _ = settled
    path = workspace.contracts / "robot" / name
    path.unlink()
    path.symlink_to("mode2.txt" if name == "models/chosen" else "elsewhere")
    assert open_obligations(workspace, method(workspace.contracts / "robot"), Run("third", False))
    path.unlink()
    path.symlink_to(LINKS[name])
    assert not open_obligations(workspace, method(workspace.contracts / "robot"), Run("fourth", False))


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


PROGRAM = "import subprocess\ntop = 10 if b'10' in subprocess.run(['cat', 'top.txt'], stdout=-1).stdout else 1000\n"


@pytest.fixture
def started(tmp_path: Path) -> Path:
    """A system whose subject asks a program that reads a file."""
    folder = tmp_path / "contracts" / "robot"
    (folder / "models").mkdir(parents=True)
    (folder / "robot.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN)
    (folder / "top.txt").write_text("10")
    (folder / "models" / "limiter.py").write_text(PROGRAM + "def step(wish): return min(wish, top)\n")
    return folder


@pytest.mark.skipif(not traces(), reason="strace does not run here")
@pytest.mark.slow
@pytest.mark.parametrize("sandbox", ["off", "required"])
def test_what_a_started_program_reads_is_an_input(
    started: Path, tmp_path: Path, sandbox: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if sandbox == "required" and not seals():
        pytest.skip("bubblewrap does not run here")
    monkeypatch.setenv(SANDBOX, sandbox)
    workspace = Workspace(tmp_path)
    outcomes = discharge(workspace, method(started), Run("first", False))
    assert [o.verdict for o in outcomes] == [Verdict.TESTED], outcomes
    record = ledger_of(workspace.ledger("robot")).records()[-1].evidence
    seen = {path for kind, path, _ in record.details["observed"] if kind == "read"}
    assert "contracts/robot/top.txt" in seen
    assert any(path.endswith("/cat") for path in seen)
    assert not open_obligations(workspace, method(started), Run("second", False))
    (started / "top.txt").write_text("1000")
    assert open_obligations(workspace, method(started), Run("third", False))


@pytest.mark.slow
def test_a_started_program_is_undeclared_where_nothing_traces_it(
    started: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    programs = tmp_path / "programs"
    programs.mkdir()
    for name in ("cat", "bwrap"):
        found = shutil.which(name)
        if found is not None:
            (programs / name).symlink_to(found)
    monkeypatch.setenv("PATH", str(programs))
    outcomes = discharge(Workspace(tmp_path), method(started), Run("first", False))
    assert [o.verdict for o in outcomes] == [Verdict.UNKNOWN]
    assert "undeclared input" in outcomes[0].summary


UNRECORDABLE = {
    "the clock": "import time\ntop = 10 if time.time() < 4e9 else 1000\n",
    "the clock by name": "from time import perf_counter as c\ntop = 10 if c() > 0 else 1000\n",
    "the day": "import datetime\ntop = 10 if datetime.date.today().year < 2999 else 1000\n",
    "the hour": "from datetime import datetime\ntop = 10 if datetime.now().year < 2999 else 1000\n",
    "the time as text": "import time\ntop = 10 if time.strftime('%Y') < '2999' else 1000\n",
    "chance": "import random\ntop = 10 if random.random() < 2 else 1000\n",
    "chance that is seeded too late": "import random\ntop = 10 if random.random() < 2 else 1000\nrandom.seed(1)\n",
    "chance of one's own": "import random\ntop = 10 if random.Random().random() < 2 else 1000\n",
    "chance of the system": "import os, secrets\ntop = 10 if secrets.randbelow(5) < 9 else 1000\n",
    "chance in a name": "import uuid\ntop = 10 if uuid.uuid4() else 1000\n",
    "a device of chance": "top = 10 if open('/dev/urandom', 'rb').read(1) else 1000\n",
    "the network": "import socket\nsocket.socket(socket.AF_UNIX).close()\ntop = 10\n",
    "a pair of sockets of one's own": "import socket\nsocket.socketpair()\ntop = 10\n",
    "a pair of sockets, from C": "import _socket\n_socket.socketpair()\ntop = 10\n",
    "a library": "import ctypes\nctypes.CDLL(None).getpid()\ntop = 10\n",
    "a device": "open('/dev/full', 'rb').close()\nopen('/proc/self/stat').close()\ntop = 10\n",
    "SQLite's clock": "import sqlite3\n"
    "sqlite3.connect(':memory:').execute(\"select strftime('%s','now')\")\ntop = 10\n",
    "the clock of a log": "import logging\nlogging.LogRecord('a', 1, 'b', 1, 'm', (), None).created\ntop = 10\n",
    "the clock of a log since it began": (
        "import logging\nlogging.LogRecord('a', 1, 'b', 1, 'm', (), None).relativeCreated\ntop = 10\n"
    ),
    "the clock of a log, its part of a second": "import logging\nlogging.makeLogRecord({}).msecs\ntop = 10\n",
    "the clock of a loop": "import asyncio\nasyncio.base_events.BaseEventLoop().time()\ntop = 10\n",
    "when something is due": "import asyncio\nasyncio.new_event_loop().call_later(1, print).when()\ntop = 10\n",
    "when something is due, as text": "import asyncio\nstr(asyncio.new_event_loop().call_later(1, id))\ntop = 10\n",
    "a time of a loop": "import asyncio\nasyncio.new_event_loop().call_at(99, print)\ntop = 10\n",
    "a time-out's time": (
        "import asyncio\nasync def f():\n  async with asyncio.timeout(1) as t: t.when()\nasyncio.run(f())\ntop = 10\n"
    ),
    "the size of a folder": "import os\nos.path.getsize('.')\ntop = 10\n",
    "a process by its link": "import os\nos.readlink('/proc/self')\ntop = 10\n",
    "a pipe's place by its link": "import os\nos.readlink('/proc/self/fd/1')\ntop = 10\n",
    "a thread by its folder": "import os\nos.path.exists('/proc/self/task/1')\ntop = 10\n",
    "a file by where it runs": "import os\nos.path.exists('/proc/self/cwd/top.txt')\ntop = 10\n",
    "a file by its root": "import os\nos.path.exists('/proc/thread-self/root/etc/top.txt')\ntop = 10\n",
    "a file by its descriptor's folder": "import os\nos.path.exists(f'/dev/fd/{os.open(\".\", 0)}/x')\ntop = 10\n",
    "a file by a link to where it runs": "import os\nos.path.exists('here/top.txt')\ntop = 10\n",
    "what is read by such a link": "open('here/m.py').close()\ntop = 10\n",
    "what is listed by such a link": "import os\nos.listdir('here/.')\ntop = 10\n",
    "the time of a file of its own": "import os, tempfile\np = tempfile.mkstemp()[1]\nos.stat(p).st_mtime\ntop = 10\n",
    "the time of an open file": "import os\nf = open(__file__)\nos.fstat(f.fileno())[8]\ntop = 10\n",
    "the time of an entry": "import os\n[e.stat().st_mtime_ns for e in os.scandir('.')]\ntop = 10\n",
    "the time by path": "import os\nos.path.getmtime(__file__)\ntop = 10\n",
    "the time of a process": "import pathlib\npathlib.Path('/proc/self').stat().st_ctime\ntop = 10\n",
    **{
        call: f"import os, platform, posix, pwd, resource, shutil, uuid\n{call}\ntop = 10\n"
        for call in (
            "os.uname().nodename",
            "posix.uname()",
            "platform.node()",
            "os.statvfs('/')",
            "shutil.disk_usage('.')",
            "os.getpid()",
            "os.sched_getaffinity(0)",
            "os.cpu_count()",
            "os.nice(0)",
            "os.umask(0o22)",
            "os.getuid()",
            "os.listxattr('.')",
            "pwd.getpwuid(0)",
            "resource.getrlimit(resource.RLIMIT_NOFILE)",
            "resource.getrusage(0)",
        )
    },
    "another interpreter": "import _xxsubinterpreters as i\n"
    "i.run_string(i.create(), 'import time; time.time()')\ntop = 10\n",
    "the hour, from C": "import _datetime\n_datetime.datetime.now()\ntop = 10\n",
    "chance, from C": "import _random\n_random.Random().random()\ntop = 10\n",
    "chance of OpenSSL": "import ssl\nssl.RAND_bytes(1)\ntop = 10\n",
    "SQLite's clock by its class": "import sqlite3\n"
    "sqlite3.Connection(':memory:').execute(\"select datetime('now')\")\ntop = 10\n",
    "another process": "import os\nos.path.exists('/proc/1')\ntop = 10\n",
    "a clock that rings": "import signal\nsignal.getitimer(signal.ITIMER_REAL)\ntop = 10\n",
    "a profile": "import cProfile\ntop = 10\n",
    "names of the network": "import socket\nsocket.if_nameindex()\ntop = 10\n",
    "processors by way of the library": "import multiprocessing\nmultiprocessing.cpu_count()\ntop = 10\n",
    "the number of a thread": "import threading\nthreading.get_native_id()\ntop = 10\n",
    "a pipe": "import os\nos.close(os.open('pipe', os.O_RDONLY | os.O_NONBLOCK))\ntop = 10\n",
}


BY_PROGRAMS = {"the clock": ["date"], "the machine": ["hostname"]}


@pytest.mark.skipif(not traces(), reason="strace does not run here")
@pytest.mark.parametrize("name", some(BY_PROGRAMS, 1, slow=1))
def test_what_a_started_program_asks_is_told(tmp_path: Path, name: str) -> None:
    """The clock, which it reads without asking the kernel, and what it asks the kernel."""
    (command,) = BY_PROGRAMS[name]
    if shutil.which(command) is None:
        pytest.skip(f"{command} is not here")
    text = f"import subprocess\nsubprocess.run([{command!r}], stdout=-3)\ntop = 10\n"
    assert any(name in what for what in outside(tmp_path, text))
    assert not outside(tmp_path, "import subprocess\nsubprocess.run(['cat', '/dev/null'])\ntop = 10\n")


BY_THE_C_LIBRARY = {
    "locales": "import locale\nlocale.setlocale(locale.LC_ALL, 'C')\ntop = 10\n",
    "time zones": "import time\ntime.tzset()\ntop = 10\n",
    "certificates": "import ssl\ntop = 10\n",
    "another file of SQLite": "import sqlite3\nopen('o', 'rb').close()\n"
    "sqlite3.connect(':memory:').execute(\"attach 'file:o?mode=ro' as o\")\ntop = 10\n",
    "an extension module": "import _cffi_backend\ntop = 10\n",
    "passwords": "import spwd\ntop = 10\n",
}


@pytest.mark.parametrize("name", some(BY_THE_C_LIBRARY, 1, slow=1))
def test_what_machine_code_reads_is_told_by_a_trace_or_undeclared(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "o").write_bytes(b"")
    text = BY_THE_C_LIBRARY[name]
    if "_cffi_backend" in text and importlib.util.find_spec("_cffi_backend") is None:
        pytest.skip("there is no extension module here")
    if traces():
        assert not outside(tmp_path, text)
    for module in (subject_module, tracing):
        monkeypatch.setattr(module, "traces", lambda: False)
    assert [what for what in outside(tmp_path, text) if tracing.remedy() in what]


@pytest.mark.parametrize("name", some(UNRECORDABLE, 2, slow=2))
def test_what_cannot_be_recorded_is_told(tmp_path: Path, name: str) -> None:
    if name == "a pipe":
        subprocess.run(["mkfifo", str(tmp_path / "pipe")], check=True)
    (tmp_path / "here").symlink_to("/proc/self/cwd")
    assert outside(tmp_path, UNRECORDABLE[name])


@pytest.mark.slow
def test_what_cannot_be_recorded_is_not_green(tmp_path: Path) -> None:
    folder = tmp_path / "contracts" / "robot"
    (folder / "models").mkdir(parents=True)
    (folder / "robot.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN)
    text = UNRECORDABLE["the clock"] + "def step(wish): return min(wish, top)\n"
    (folder / "models" / "limiter.py").write_text(text)
    outcomes = discharge(Workspace(tmp_path), method(folder), Run("first", False))
    assert [o.verdict for o in outcomes] == [Verdict.UNKNOWN]
    assert "undeclared input" in outcomes[0].summary


SEEN_THROUGH = {
    "a seed": "import random\nrandom.seed(7)\ntop = 10 if random.random() < 2 else 1000\n",
    "a generator with a seed": "import random\ntop = 10 if random.Random(7).random() < 2 else 1000\n",
    "times that are given": "import time\ntop = 10 if time.strftime('%Y', time.gmtime(0)) == '1970' else 1000\n",
    "days that are given": "import datetime\nd = datetime.datetime(2020, 1, 1)\n"
    "assert isinstance(d, datetime.datetime)\nassert isinstance(d + datetime.timedelta(1), datetime.date)\ntop = 10\n",
    "what the library knows of a file": "import os, pathlib, shutil, tempfile, linecache, platform, sys\n"
    "assert isinstance(os.stat('.'), os.stat_result) and len(os.stat('.')) == 10 and sys.argv == [__file__]\n"
    "d = tempfile.mkdtemp()\nshutil.copy2(__file__, d)\nassert os.path.samefile(d, d)\n"
    "assert [n for _, _, n in os.walk(d)] and list(pathlib.Path(d).rglob('*.py')) and os.path.ismount('/')\n"
    "linecache.checkcache()\nlinecache.getlines(__file__)\nassert platform.system()\ntop = 10\n",
    "a loop": "import asyncio\nasync def f():\n    await asyncio.sleep(0.01)\n    return 10\n"
    "async def g():\n    return max(await asyncio.gather(f(), asyncio.to_thread(int, 3), asyncio.wait_for(f(), 5)))\n"
    "top = asyncio.run(g())\n",
    "what the library does for itself": "import logging, tempfile, threading, queue, uuid, random\n"
    "logging.getLogger().warning('x')\ntempfile.TemporaryFile().close()\n"
    "t = threading.Thread(target=queue.Queue().put, args=(1,))\nt.start()\nt.join(5)\ntop = 10\n",
}


SEEN_THROUGH["what it makes and removes of its own"] = (
    "import os, pathlib, shutil, tempfile\n"
    "with tempfile.TemporaryDirectory() as d:\n"
    "    (pathlib.Path(d) / 'a').mkdir()\n    (pathlib.Path(d) / 'a' / 'b').write_text('x')\n"
    "d = tempfile.mkdtemp()\n(pathlib.Path(d) / 'c').write_text('x')\nshutil.rmtree(d)\n"
    "assert not os.path.exists(d)\ntop = 10\n"
)

WHERE = {
    "its folder": ("import os\nos.getcwd()\ntop = 10\n", Seen.PLACE),
    "its folder by the library": ("import os\nos.path.abspath('x')\ntop = 10\n", Seen.PLACE),
    "a variable": ("import os\nos.environ['PATH']\ntop = 10\n", Seen.VARIABLE),
    "all variables": ("import os\ndict(os.environ)\ntop = 10\n", Seen.VARIABLE),
    "variables as they came": ("import posix\nposix.environ[b'PYTHONPATH']\ntop = 10\n", Seen.VARIABLE),
    "nothing": ("import os\nos.environ['TZ']\ntop = 10\n", None),
}


@pytest.mark.parametrize("name", some(WHERE, 3, slow=len(WHERE) - 3))
def test_where_a_subject_runs_is_an_input_where_it_asks(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, kind = WHERE[name]
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "m.py").write_text(text + "def step(): return top\n")
    subject = SubjectProcess(tmp_path / "a" / "m.py", "step", 10.0)
    subject.ask({})
    assert not subject.close()
    seen = [o for o in subject.observed() if o.kind in (Seen.PLACE, Seen.VARIABLE)]
    assert [kind] * bool(kind) == list(dict.fromkeys(o.kind for o in seen))
    assert all(look(o.kind, o.path) == o.digest for o in seen)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    here = [str(tmp_path / "b") if o.kind is Seen.PLACE else o.path for o in seen]
    assert all(look(o.kind, path) != o.digest for o, path in zip(seen, here, strict=True))


@pytest.mark.parametrize("name", some(SEEN_THROUGH, 2))
def test_what_is_the_same_at_every_run_is_no_undeclared_input(tmp_path: Path, name: str) -> None:
    assert not outside(tmp_path, SEEN_THROUGH[name])


def outside(folder: Path, text: str) -> list[str]:
    """What a subject whose module begins with a text uses that cannot be recorded."""
    (folder / "m.py").write_text(text + "def step(): return top\n")
    subject = SubjectProcess(folder / "m.py", "step", 10.0)
    assert subject.ask({}) == {"q": ["10", "1"], "w": True}
    assert not subject.close()
    return [o.path for o in subject.observed() if o.kind is Seen.OUTSIDE]


def test_the_machine_s_time_zone_is_no_subject_s(tmp_path: Path) -> None:
    """Without the variable, the C library would take that of ``/etc/localtime``."""
    assert not outside(tmp_path, "import os, time\ntop = 10 if os.environ['TZ'] == 'UTC' == time.tzname[0] else 9\n")


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

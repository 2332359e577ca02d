"""Files are generated in a fork of the run, and by the run itself where that says nothing."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

from helpers import alive

from avow.pipeline.beside import Beside
from avow.pipeline.forks import PLAIN

_RUN = """
import json, os, signal, sys, time
from pathlib import Path
from avow.pipeline.beside import Beside

def make(name):
    if name == "end":
        os.kill(os.getpid(), signal.SIGKILL)
    return {"pid": str(os.getpid()), "name": name, "odd": "\\udc80\\n"} if name != "wrong" else 1 / 0

beside = Beside()
before = beside.ask("early")
beside.prepare(Path("."), make)
said = [beside.ask(name) for name in ("one", "wrong", "two\\n")]
ended = [beside.ask(name) for name in ("end", "late")]
print(json.dumps([os.getpid(), before, said, ended]))
"""


def _ran(**more: str) -> list[object]:
    """What stands on the last line of a Python with one thread."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", _RUN], capture_output=True, text=True, check=True, env={"PATH": "", **more}
    )
    found: list[object] = json.loads(done.stdout)
    return found


def test_it_says_what_the_run_would_and_else_nothing() -> None:
    own, before, said, ended = _ran()
    assert before is None
    assert isinstance(said, list)
    one, wrong, two = said
    assert one["name"] == "one"
    assert one["odd"] == "\udc80\n"
    assert int(one["pid"]) != own
    assert wrong is None, "the run makes it itself, and tells what is wrong"
    assert (two["name"], two["pid"]) == ("two\n", one["pid"]), "one fork for all"
    assert ended == [None, None]


def test_where_a_fork_is_not_wanted_there_is_none() -> None:
    assert _ran(**{PLAIN: "1"})[1:] == [None, [None, None, None], [None, None]]


def test_unprepared_it_says_nothing() -> None:
    assert Beside().ask("anything") is None


def test_it_ends_with_its_run(tmp_path: Path) -> None:
    waits = tmp_path / "waits.py"
    waits.write_text(
        "import time\n"
        "from pathlib import Path\n"
        "from avow.pipeline.beside import Beside\n"
        "beside = Beside()\n"
        "beside.prepare(Path('.'), lambda name: {'pid': str(__import__('os').getpid())})\n"
        "print(beside.ask('x')['pid'], flush=True)\n"
        "time.sleep(600)\n"
    )
    with subprocess.Popen([sys.executable, "-P", str(waits)], stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        fork = int(run.stdout.readline())
        assert alive(fork)
        run.kill()
    deadline = time.monotonic() + 120
    while alive(fork):
        assert time.monotonic() < deadline, "it outlives its run"
        time.sleep(0.01)

"""Subjects that attack their judge: whatever they do, no answer of theirs is believed; and nothing of them is left."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from helpers import some
from hoare.systems import make_job, sensor

from avow.backend_kit.protocol import Limits, Report
from avow.backends.hypothesis import BACKEND
from avow.base.verdict import Verdict
from avow.isolation.level import SANDBOX, Isolation, seals
from avow.isolation.observed import Seen

LEVELS = [
    pytest.param("off", id="processes"),
    pytest.param("required", id="sealed", marks=pytest.mark.skipif(not seals(), reason="bubblewrap does not run here")),
]

WRONG = "return {'colour': 'green', 'done': set()}\n"
"""False for a reading of 120 or more."""

FORGERY = (
    '{"valid": 9, "edges": 9, "rejected": 0, "undecided": 0, "wanted": 9, "stopped": "", "observed": [], '
    '"isolation": "sealed", "crash": null, "fault": "", "guarantees": {}}'
)

DAEMON = """
import glob, os, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        for _ in range(300):
            for place in glob.glob("/tmp/avow-*"):
                for name in ("result.json", ".response.json"):
                    try:
                        open(place + "/" + name, "w").write(FORGERY)
                    except OSError:
                        pass
            time.sleep(0.05)
    os._exit(0)
"""

ATTACKS = {
    "forks": "import os\ndef step(**inputs):\n    if os.fork() == 0:\n        os._exit(0)\n    " + WRONG,
    "daemonises": f"FORGERY = {FORGERY!r}\n{DAEMON}\ndef step(**inputs):\n    " + WRONG,
    "leaves a child": "import subprocess\nsubprocess.Popen(['sleep', '30'], start_new_session=True)\n"
    "def step(**inputs):\n    " + WRONG,
    "kills its judge": "import os, signal\ndef step(**inputs):\n    os.kill(os.getppid(), signal.SIGKILL)\n    "
    + WRONG,
    "kills all": "import os, signal\ndef step(**inputs):\n    os.kill(-1, 0)\n    " + WRONG,
    "ends well": "import os\ndef step(**inputs):\n    os._exit(0)\n",
    "writes to its judge": "import os\ndef step(**inputs):\n    for n in range(3, 40):\n        try:\n"
    f"            open('/proc/%d/fd/%d' % (os.getppid(), n), 'w').write({FORGERY!r} + chr(10))\n"
    "        except OSError:\n            pass\n    " + WRONG,
    "reads its judge": "import os\ndef step(**inputs):\n    try:\n        open('/proc/%d/mem' % os.getppid(), 'rb')\n"
    "    except OSError:\n        pass\n    " + WRONG,
    "writes beside itself": "import pathlib\ndef step(**inputs):\n    try:\n"
    "        pathlib.Path(__file__).with_name('s2.py').write_text('x')\n    except OSError:\n        pass\n    "
    + WRONG,
    "changes itself": "import pathlib\ndef step(**inputs):\n    try:\n"
    "        pathlib.Path(__file__).write_text('x')\n    except OSError:\n        pass\n    " + WRONG,
    "writes to every descriptor": "import os\ndef step(**inputs):\n    for n in range(40):\n        try:\n"
    f"            os.write(n, ({FORGERY!r} + chr(10)).encode())\n        except OSError:\n            pass\n    "
    + WRONG,
    "patches what it finds": "import json, sys\njson.dumps = lambda *a, **k: '{}'\n"
    "host = sys.modules['__main__']\nhost.coded = lambda v, depth=0: {'m': []}\n"
    "host.answer = lambda *a: {'value': {}}\n"
    "def step(**inputs):\n    " + WRONG,
}


def settle(folder: Path, text: str) -> Report:
    given = {"subject": "s.py:step", "cases": 40}
    job = make_job(folder, sensor(), "sensor", given, {"s.py": text}, "hypothesis")
    return BACKEND.discharge(job, folder, Limits(seconds=30))


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", some(ATTACKS, 6))
def test_no_attack_is_believed(tmp_path: Path, name: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, level)
    report = settle(tmp_path, ATTACKS[name])
    bad = {Verdict.ERROR, Verdict.REFUTED}
    if any(o.kind is Seen.OUTSIDE for o in report.observed):
        bad |= {Verdict.TESTED}  # which the core does not let count: see test_observed
    assert {o.verdict for o in report.outcomes} <= bad, [o.summary for o in report.outcomes]
    assert (tmp_path / "s.py").read_text() == ATTACKS[name]
    assert not (tmp_path / "s2.py").exists()


@pytest.mark.parametrize("level", LEVELS)
def test_nothing_of_a_subject_is_left(tmp_path: Path, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, level)
    token = f"avow-left-{os.getpid()}-{time.monotonic_ns()}"
    text = (
        "import os, time\nif os.fork() == 0:\n    os.setsid()\n    if os.fork() == 0:\n"
        f"        os.execvp('sh', ['sh', '-c', 'sleep 60; : {token}'])\n    os._exit(0)\ntime.sleep(0.3)\n"
        f"def step(**inputs):\n    {WRONG}"
    )
    settle(tmp_path, text)
    assert not any(token in _command(pid) for pid in Path("/proc").glob("[0-9]*"))


def _command(process: Path) -> str:
    try:
        return (process / "cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return ""


@pytest.mark.parametrize("level", LEVELS)
def test_a_subject_that_looks_at_nothing_was_seen_to_look_at_nothing(
    tmp_path: Path, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SANDBOX, level)
    python, subject = settle(tmp_path, f"def step(**inputs):\n    {WRONG}").observed
    assert Path(python.path).name.startswith("python")
    assert subject.path == str(tmp_path / "s.py")


def test_the_level_is_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    assert settle(tmp_path, f"def step(**inputs):\n    {WRONG}").isolation is Isolation.PROCESSES


def test_a_required_sandbox_that_is_missing_runs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "required")
    monkeypatch.setattr("avow.isolation.level.seals", lambda: False)
    report = settle(tmp_path, f"def step(**inputs):\n    {WRONG}")
    assert {o.verdict for o in report.outcomes} == {Verdict.NOT_RUN}
    assert "bubblewrap" in report.outcomes[0].summary


@pytest.mark.skipif(not seals(), reason="bubblewrap does not run here")
def test_a_sealed_subject_has_no_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "required")
    text = (
        "def step(**inputs):\n    n = len(open('/proc/net/dev').read().splitlines())\n    assert n == 3, n\n    "
        + WRONG
    )
    report = settle(tmp_path, text)
    assert not any("AssertionError" in o.summary for o in report.outcomes), report.outcomes[0].summary

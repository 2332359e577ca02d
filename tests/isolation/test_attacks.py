"""Subjects that attack their judge: whatever they do, no answer of theirs is believed; and nothing of them is left."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

import pytest
from helpers import command, some
from hoare.systems import make_job, sensor

from avow.backend_kit.protocol import Limits, Report
from avow.backends.hypothesis import BACKEND
from avow.backends.hypothesis.exchange import Answer, Met, Tried
from avow.base import process
from avow.base.codec import from_text, to_json
from avow.base.verdict import Isolation, Verdict
from avow.isolation import judge
from avow.isolation.level import SANDBOX, seals
from avow.isolation.observed import Seen
from avow.isolation.subject import SubjectFailed, SubjectProcess

LEVELS = [
    pytest.param("off", id="processes"),
    pytest.param("required", id="sealed", marks=pytest.mark.skipif(not seals(), reason="bubblewrap does not run here")),
]

WRONG = "return {'colour': 'green', 'done': set()}\n"
"""False for a reading of 120 or more."""

GREEN = {name: Tried((Met("in.reading >= 0", 9, 9, 0),), 0) for name in ("low", "high")}
FORGERY = json.dumps(
    to_json(
        Answer(
            **dict.fromkeys(("valid", "edges", "wanted"), 9),
            **dict.fromkeys(("replayed", "rejected", "undecided", "repeated"), 0),
            **dict.fromkeys(("stopped", "silent"), ""),
            **dict.fromkeys(("left_out", "observed", "apart"), ()),
            **dict.fromkeys(("unsteady", "crash", "crash_trace", "runs"), None),
            isolation=Isolation.SEALED,
            guarantees=GREEN,
        )
    )
)
"""A good answer, in the form that is read."""

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

STEP = "\ndef step(**inputs):\n    " + WRONG
FORGE = f"""
import os
FORGERY = ({FORGERY!r} + chr(10)).encode()
def forge(*ignored):
    for n in range(3, 40):
        try:
            os.write(n, FORGERY)
        except OSError:
            pass
"""
ATTACKS |= {
    "a thread that writes on": FORGE + "import threading\ndef on():\n    while True:\n        forge()\n"
    "threading.Thread(target=on, daemon=True).start()" + STEP,
    "writes as it ends": FORGE + "import atexit\natexit.register(forge)\nstep = lambda **k: exit(0)\n",
    "writes at a signal": FORGE + "import signal\nsignal.signal(signal.SIGALRM, forge)\n"
    "signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)" + STEP,
    "writes when it is collected": FORGE + "class C:\n    __del__ = forge\nkept = C()\n"
    "def step(**inputs):\n    global kept\n    kept = C()\n    " + WRONG,
    "writes as it is traced": FORGE + "import sys\nsys.setprofile(forge)" + STEP,
    "takes the channels": "import os\nfor n in range(3, 40):\n    try:\n        os.dup2(1, n)\n    except OSError:\n"
    "        pass" + STEP,
    "closes the channels": "import os\nos.closerange(3, 40)" + STEP,
    "ends with a code": "import sys\ndef step(**inputs):\n    sys.exit(0)\n",
    "aborts": "import os\ndef step(**inputs):\n    os.abort()\n",
    "kills itself": "import signal\ndef step(**inputs):\n    signal.raise_signal(9)\n",
    "stops itself": "import signal\ndef step(**inputs):\n    signal.raise_signal(signal.SIGSTOP)\n",
    "recurses": "def step(**inputs):\n    return step(**inputs)\n",
    "answers without end": "def step(**inputs):\n    return {'colour': 'x' * 20_000_000, 'done': set()}\n",
    "answers what never ends": "import itertools\nfrom collections.abc import Mapping\nclass M(dict):\n"
    "    def items(self):\n        return ((n, 0) for n in itertools.count())\ndef step(**inputs):\n    return M()\n",
    "answers what pretends": "class S(str):\n    __eq__ = lambda *a: True\n    __hash__ = str.__hash__\n"
    "def step(**inputs):\n    return {'colour': S('green'), 'done': set()}\n",
    "patches the language": "import builtins, fractions\nbuiltins.isinstance = lambda *a: True\n"
    "builtins.len = lambda x: 0\nfractions.Fraction.__lt__ = lambda *a: True" + STEP,
    "makes its faults forgotten": "import gc\ndef step(**inputs):\n    try:\n        open('x', 'w')\n"
    "    except OSError:\n        pass\n    for o in gc.get_objects():\n        if type(o) is list and o and "
    "type(o[0]) is str and 'writes' in o[0]:\n            o.clear()\n    " + WRONG,
    "a pool": "import multiprocessing as m\ndef f(x):\n    return x\ndef step(**inputs):\n    try:\n"
    "        m.Pool(1).map(f, [1])\n    except OSError:\n        pass\n    " + WRONG,
    "a spawned process": "import os\nos.posix_spawn('/bin/sleep', ['sleep', '30'], {})" + STEP,
    "a shell in the background": "import os\nos.system('sleep 30 &')" + STEP,
    "a daemon in the background": "import os\nos.system('setsid sleep 30 >/dev/null 2>&1 &')" + STEP,
    "forks by hand": "import ctypes\nif ctypes.CDLL(None).fork() == 0:\n    import time\n    time.sleep(30)" + STEP,
    "another copy of a module": "import importlib.util as u\nspec = u.find_spec('_posixsubprocess')\n"
    "m = u.module_from_spec(spec)\nspec.loader.exec_module(m)\nimport os, subprocess\n"
    "subprocess._fork_exec = m.fork_exec\nsubprocess.Popen(['sleep', '30'])" + STEP,
    "traces its parent": "import ctypes, os\nctypes.CDLL(None).ptrace(16, os.getppid(), 0, 0)" + STEP,
    "a database beside itself": "import sqlite3\ntry:\n    sqlite3.connect('s2.py').execute('create table t(x)')\n"
    "except Exception:\n    pass" + STEP,
    "a link beside itself": "import os\ntry:\n    os.symlink('/etc/passwd', 's2.py')\nexcept OSError:\n    pass" + STEP,
    "a file moved onto another": "import os, tempfile\ntry:\n    os.rename(tempfile.mkstemp()[1], 's2.py')\n"
    "except OSError:\n    pass" + STEP,
    "another name of a file": "import os, tempfile\ntry:\n    os.link(__file__, tempfile.gettempdir() + '/x')\n"
    "except OSError:\n    pass" + STEP,
    "a link of its own that leads out": "import os, tempfile\ntry:\n"
    "    os.symlink(__file__, tempfile.gettempdir() + '/x')\n"
    "except OSError:\n    pass" + STEP,
    "a mode by descriptor": "import os\nos.chmod(os.open(__file__, os.O_RDONLY), 0o600)" + STEP,
    "a file by its folder's descriptor": "import os, tempfile\nf = os.open('.', os.O_RDONLY)\n"
    "os.chdir(tempfile.gettempdir())\ntry:\n    os.open('s2.py', os.O_WRONLY | os.O_CREAT, dir_fd=f)\n"
    "except OSError:\n    pass" + STEP,
    "a program that moves": "import os, subprocess, tempfile\n"
    "subprocess.run(['mv', tempfile.mkstemp()[1], 's2.py'], stderr=-3)" + STEP,
    "a program that links": "import os, subprocess, tempfile\n"
    "subprocess.run(['ln', '-s', tempfile.gettempdir(), 's2.py'], stderr=-3)" + STEP,
    "a program that writes": "import subprocess\nsubprocess.run(['sh', '-c', 'echo x > s2.py'], stderr=-3)" + STEP,
    "a program that kills": "import os, subprocess\n"
    "subprocess.run(['sh', '-c', 'kill -0 %d' % os.getppid()], stderr=-3)" + STEP,
    "a module's name": "import sys\nsys.modules['__main__'].__dict__['say'] = None\nsys.modules['json'] = None" + STEP,
    "an endless import": "while True:\n    pass\n",
}

ONLY_WRONG = ("answers what pretends", "a module's name")
"""These do nothing forbidden: what they answer is judged as any other's answer, and one guarantee holds of it."""


def settle(folder: Path, text: str) -> Report:
    given = {"subject": "s.py:step", "cases": 40}
    job = make_job(folder, sensor(), "sensor", given, {"s.py": text}, "hypothesis")
    return BACKEND.discharge(job, folder, Limits(seconds=30))


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", some(ATTACKS, 6))
def test_no_attack_is_believed(tmp_path: Path, name: str, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, level)
    report = settle(tmp_path, ATTACKS[name])
    found = {o.obligation.rpartition("/")[2]: o.verdict for o in report.outcomes}
    if name in ONLY_WRONG:
        assert found.pop("low") is Verdict.TESTED
    bad = {Verdict.ERROR, Verdict.REFUTED}
    if name == "writes at a signal":
        bad |= {Verdict.UNKNOWN}  # when it strikes is chance: it may be only that it does not answer alike twice
        if found["high"] is Verdict.REFUTED:  # what it wrote reached nothing, and its answers were judged: `low` is
            found.pop("low")  # true of a step that always says green
    if any(o.kind is Seen.OUTSIDE for o in report.observed):
        bad |= {Verdict.TESTED}  # which the core does not let count: see test_observed
    assert {*found.values()} <= bad, [o.summary for o in report.outcomes]
    assert (tmp_path / "s.py").read_text() == ATTACKS[name]
    if level != "off" or not name.startswith("a program that"):  # there nothing keeps it from writing: it is an error
        assert not (tmp_path / "s2.py").exists()


@pytest.mark.parametrize("level", LEVELS)
def test_nothing_of_a_subject_is_left_and_the_level_is_recorded(
    tmp_path: Path, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SANDBOX, level)
    token = f"avow-left-{os.getpid()}-{time.monotonic_ns()}"
    text = (
        "import os, time\nif os.fork() == 0:\n    os.setsid()\n    if os.fork() == 0:\n"
        f"        os.execvp('sh', ['sh', '-c', 'sleep 60; : {token}'])\n    os._exit(0)\ntime.sleep(0.3)\n"
        f"def step(**inputs):\n    {WRONG}"
    )
    assert settle(tmp_path, text).isolation is (Isolation.PROCESSES if level == "off" else Isolation.SEALED)
    assert not any(token.encode() in command(process.name) for process in Path("/proc").glob("[0-9]*"))


@pytest.mark.slow
@pytest.mark.parametrize("level", some(LEVELS, 1))
def test_a_subject_that_looks_at_nothing_was_seen_to_look_at_nothing(
    tmp_path: Path, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SANDBOX, level)
    python, modules, *files, tracer, sandbox = settle(tmp_path, f"def step(**inputs):\n    {WRONG}").observed
    assert Path(python.path).name.startswith("python")
    pythons = (sys.prefix, sys.base_prefix)  # what it imports by itself, and where it looks first
    assert [o.path for o in files if not o.path.startswith(pythons)] == [str(tmp_path / "s.py")]
    assert [o.kind for o in (modules, tracer, sandbox)] == [Seen.MODULES, Seen.TRACER, Seen.SANDBOX]


def test_a_required_sandbox_that_is_missing_runs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "required")
    monkeypatch.setattr("avow.isolation.level.seals", lambda: False)
    report = settle(tmp_path, f"def step(**inputs):\n    {WRONG}")
    assert {o.verdict for o in report.outcomes} == {Verdict.NOT_RUN}
    assert "bubblewrap" in report.outcomes[0].summary


@pytest.mark.slow
@pytest.mark.skipif(not seals(), reason="bubblewrap does not run here")
def test_a_sealed_subject_has_no_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "required")
    text = (
        "def step(**inputs):\n    n = len(open('/proc/net/dev').read().splitlines())\n    assert n == 3, n\n    "
        + WRONG
    )
    report = settle(tmp_path, text)
    assert not any("AssertionError" in o.summary for o in report.outcomes), report.outcomes[0].summary


@pytest.mark.parametrize("level", LEVELS)
def test_a_subject_that_somebody_else_ends_is_asked_again(
    tmp_path: Path, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill says nothing of what was given: the next run must not be content with it."""
    monkeypatch.setenv(SANDBOX, level)
    monkeypatch.setattr(process.here, "ended_by_others", False)
    (tmp_path / "s.py").write_text("import time\ndef step():\n    time.sleep(60)\n")
    subject = SubjectProcess(tmp_path / "s.py", "step", 30.0)
    send = subject._send

    def sent_and_killed(request: bytes) -> None:
        send(request)
        assert subject.process is not None
        os.kill(process._descendants(subject.process.pid)[-1], signal.SIGKILL)

    monkeypatch.setattr(subject, "_send", sent_and_killed)
    with pytest.raises(SubjectFailed):
        subject.ask({})
    assert process.ended_by_others()


@pytest.mark.parametrize("killed", [True, False])
def test_a_judge_tells_that_its_subject_was_ended(
    tmp_path: Path, killed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process.here, "ended_by_others", False)
    code = -signal.SIGKILL if killed else 0
    (tmp_path / "j.py").write_text(
        "import sys\nfrom avow.base import process\nfrom avow.isolation import judge\n"
        f"process.ended_with({code})\njudge.say(int(sys.argv[1]), {{'a': 1}})\n"
    )
    _, said = judge.ask(dict[str, int], str(tmp_path / "j.py"), [], cwd=tmp_path, seconds=30, megabytes=4000, env={})
    assert said == {"a": 1}
    assert process.ended_by_others() is killed


def test_what_was_killed_from_outside_says_so_and_what_ended_itself_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "s.py"
    for killed, text in ((True, "def step(x): return {}"), (False, "raise SystemExit")):
        monkeypatch.setattr(process.here, "ended_by_others", False)
        path.write_text(text)
        subject = SubjectProcess(path, "step", 60.0)
        try:
            if killed:
                subject.ask({"x": 1})
                assert subject.process is not None
                os.kill(_youngest(subject.process.pid), signal.SIGKILL)
                subject.process.wait(60)
            with pytest.raises(SubjectFailed):
                subject.ask({"x": 1})
            assert bool(subject.silent) == killed
        finally:
            subject.close()


def _youngest(pid: int) -> int:
    """The subject itself, where a tracer or a cage is around it."""
    while children := Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        pid = int(children[-1])
    return pid


READY = '{"ready": true}'


@pytest.mark.parametrize(
    "said",
    [
        ["7"],
        ["[" * 100_000],
        ['{"ready": 1}'],
        ['{"ready": true, "more": 1}'],
        ['{"ready": true, "seen": [["read"]]}'],
        ['{"ready": true, "faults": "none"}'],
        [READY, '{"replies": {"value": 1}}'],
        [READY, '{"replies": []}'],
        [READY, '{"replies": [{"value": 1}], "turn": 3}'],
        [READY, '{"replies": [{"value": 1}, {"value": 1}]}'],
        [READY, '{"replies": [7]}'],
        [READY, "\udcff"],
    ],
    ids=range(12),
)
def test_what_is_no_message_is_the_fault_of_the_subject(tmp_path: Path, said: list[str]) -> None:
    class Odd(SubjectProcess):
        def _command(self, there: int, back: int, mark: str) -> tuple[list[str], tuple[Path, ...]]:
            script = (
                "import os, sys\nfor text in open(sys.argv[1], 'rb'):\n os.write(int(sys.argv[3]), text)\n"
                " os.read(int(sys.argv[2]), 9)\n"
            )
            lines = self.path.with_suffix(".lines")
            lines.write_text("".join(f"{line}\n" for line in said), errors="surrogateescape")
            command = [sys.executable, "-c", script, str(lines), str(there), str(back)]
            return command, (Path(sys.prefix), Path(sys.base_prefix))

    subject = Odd(tmp_path / "s.py", "step", 60.0)
    try:
        with pytest.raises(SubjectFailed, match="is no data"):
            subject.ask({})
    finally:
        subject.close()


def test_a_judge_whose_answer_is_another_has_given_none(tmp_path: Path) -> None:
    (tmp_path / "j.py").write_text(
        "import sys\nfrom avow.isolation import judge\njudge.say(int(sys.argv[1]), {'a': '1'})\n"
    )
    done, said = judge.ask(dict[str, int], str(tmp_path / "j.py"), [], cwd=tmp_path, seconds=30, megabytes=4000, env={})
    assert (done.code, said) == (0, None)


def test_the_forgery_would_be_read() -> None:
    assert from_text(Answer, FORGERY).guarantees == GREEN

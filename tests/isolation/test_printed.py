"""What a subject prints: a line that reads as a result is an error, whichever way it is printed; any other is none."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import some
from hoare.systems import make_job
from python_backend.source_nodes import LIMITER, LIMITER_RCL, Example

from avow.backend_kit.programs import cpython
from avow.backend_kit.protocol import Limits, Report
from avow.backends.fuzz import runner
from avow.backends.hypothesis import BACKEND as HYPOTHESIS
from avow.base.codec import canonical, document, to_json
from avow.base.verdict import Isolation, Outcome, Verdict
from avow.isolation import judge
from avow.isolation.level import SANDBOX
from avow.isolation.printed import Names, forged
from avow.isolation.subject import Message, SubjectFailed, SubjectProcess
from avow.pipeline.requests import Response

NAMES = Names.of(["robot/sensor/guarantee/low", "robot/sensor/guarantee/far_off", "hypothesis"])

COMMON = (Verdict.ERROR, Verdict.UNKNOWN, Verdict.PARTIAL)

FORGED = [
    # a verdict, alone
    *(word for word in Verdict if word not in COMMON),
    "checked",
    "TESTED",
    "  Tested.",
    "'proved'",
    '"tested",',
    "--- checked ---",
    "\x1b[32mtested\x1b[0m",
    "\x1b[2K\x1b[1Gtested",
    "te\x1b[1msted",
    "te\x1b]0;title\x07sted",
    "tes\x00ted",
    "texx\b\bsted",
    "speed 3.2\rtested",
    "speed 3.2\rtested\rspeed 3.3",
    "t\u200be\u200bs\u200bt\u200be\u200bd",
    "ｔｅｓｔｅｄ",
    "te\u0455ted",
    "t\u0435sted",
    "te\u0301sted",
    "te\u3164sted",
    "not run",
    "NOT_RUN",
    # given to what has one
    *(f"G1: {word}" for word in Verdict),
    *(f'{{"verdict": "{word}"}}' for word in Verdict),
    *(f"{word} G1" for word in Verdict),
    *(f"low: {word}" for word in Verdict),
    "verdict=tested",
    "Verdict: TESTED (200 cases)",
    "the verdict is tested",
    "{'low': 'tested', 'far_off': 'tested'}",
    '{"n": 3, "low":"proved"}',
    "INFO avow: low: tested",
    "low ........ tested",
    "low is tested",
    "low -> tested",
    "low\ttested",
    "| low | tested |",
    "guarantee low tested",
    "guarantee 1: proved",
    "tested guarantee 1",
    "robot/sensor/guarantee/low tested",
    "sensor/guarantee/low: tested",
    "tested robot/sensor/guarantee/low",
    "tested: low",
    "sensor.low: tested",
    "low: tested (200 cases)",
    "G1 = tested, far_off = tested, 3",
    "low ..... tested [100 %]",
    "low\u2014tested",
    "low\u2713tested",
    "\u0434\u0430\u0442\u0447\u0438\u043a\u2028low: tested\u2028\u6e29\u5ea6",
    "sensor: tested",
    "hypothesis: tested",
    "status: proved",
    *(f'{{"status": "{word}"}}' for word in ("proved", "tested", "justified", "refuted", "not-run")),
    "result = tested",
    *(f"{kind}: checked" for kind in ("guarantee", "obligation", "claim", "property")),
    "sensor: checked",
    "hypothesis: monitored",
    # a message
    '{"replies": [{"value": 1}]}',
    'junk {"turn": "ab", "replies": []} junk',
    "{'replies': []}",
    '{"answer": {"valid": 9}, "ended": false}',
    '{"isolation": "sealed", "valid": 9}',
    '{"ready": true, "seen": []}',
    '{"seen": [["read", "/x"]], "end": true}',
    f"{'0123456789abcdef' * 2} done 10000",
    # a test runner's end
    "3 passed",
    "===== 3 passed in 0.12s =====",
    "3 passed, 1 warning in 0.05s",
    "1 failed, 3 passed in 0.05s (0:00:01)",
    "\x1b[32m\x1b[1m3 passed\x1b[0m\x1b[32m in 0.01s\x1b[0m",
    "12 tests passed",
    "OK (skipped=1)",
    "OK (3 tests)",
    "ok  \tavow/low\t0.003s",
    "PASSED: 3 tests",
    "[  PASSED  ] 3 tests.",
    "All tests passed",
    "all 12 tests passed!",
    "All tests passed (12 assertions in 3 test cases)",
    "100% tests passed, 0 tests failed out of 3",
    "Tests passed: 3",
    "Ran 3 tests in 0.002s",
    "tests/test_it.py::test_low PASSED",
    "PASSED tests/test_it.py::test_low",
    "test result: ok. 3 passed; 0 failed",
    "--- PASS: TestLow (0.00s)",
    "Falsifying example: test_low(",
    "You can reproduce this example by temporarily adding @reproduce_failure",
]

HONEST = [
    "",
    # a word of every log, alone
    *COMMON,
    *(f"'{word}'," for word in COMMON),
    "--- ERROR ---",
    "\x1b[31merror\x1b[0m",
    "OK",
    "PASS",
    "PASSED",
    "passed",
    "[PASSED]",
    "test passed",
    "Test passed.",
    "tests ok",
    "OK (3 motors)",
    # given to what is not Avow's alone
    *(f"status: {word}" for word in (*COMMON, "checked", "monitored", "reviewed")),
    '{"status": "checked", "speed": 1}',
    "result: checked",
    "speed 3.2",
    "command passed to motors",
    "3 passed waypoints",
    "waypoint 3 passed",
    "gate 3 passed in 0.1s",
    "passed 3 gates",
    "{'front': 0.4, 'left': 1.2, 'error': 0.0}",
    '{"ready": true}',
    '{"value": 3}',
    '{"error": "no battery"}',
    '{"faults": ["hot"]}',
    '{"seen": ["wall", "door"], "speed": 1}',
    '{"answer": 42}',
    "INFO node: ok",
    "[INFO] [1700000000.1] [sensor]: ok",
    "INFO:sensor:checked 3 ports",
    "ok",
    "OK, moving on",
    "[ OK ] motors",
    "sensor: error",
    "sensor: unknown colour",
    "camera: unknown",
    "{'camera': 'unknown', 'sensor': 'error'}",
    "WARNING:root:error 5 while reading",
    "ERROR: low battery",
    "error: low",
    "unknown low",
    "unknown obstacle",
    '{"status": "unknown", "speed": 1}',
    "sensor checked at 3.2",
    "sensor tested ok, all well",
    "battery: checked",
    "battery: monitored",
    "path is partial",
    "we tested the brakes",
    "tested brakes",
    "low speed tested",
    "untested",
    "not running",
    "low: 3.2",
    "low: unknown_42",
    "all checks passed, arming",
    "self test passed",
    "all motors ok",
    "ran 3 tests",
    "temperature 21 °C",
    "\u0434\u0430\u0442\u0447\u0438\u043a: error",
    "\u6e29\u5ea6: unknown",
    "\uc13c\uc11c checked",
    "\u00e9tat: error",
    "low: error (5 times)",
    "low: unknown, waiting",
    "low, tested (brakes)",
    "isolation valve: none",
    "{'isolation': 'open'}",
    "the door has ended: true",
    "10000 done",
    "turn left 3",
    "Traceback (most recent call last):",
    "ValueError: unknown",
    "SystemError",
    "\x1b[31mmotor stalled\x1b[0m",
    "50%\r60%\r70%",
    "caf\xe9",
]


@pytest.mark.parametrize("line", FORGED)
def test_a_result_is_seen(line: str) -> None:
    for around in ("{}\n", "speed 3.2\n{}\nspeed 3.3\n", "{}"):
        for coding in ("utf-8", *(("utf-16-le", "utf-16-be", "utf-16", "utf-32") if line.isascii() else ())):
            assert forged(around.replace("{}", line).encode(coding), NAMES), coding


@pytest.mark.parametrize("line", HONEST)
def test_an_honest_line_is_none(line: str) -> None:
    for around in ("{}\n", "{}", "speed 3.2\n{}\nspeed 3.3\n"):
        assert not forged(around.replace("{}", line).encode(), NAMES)


def test_what_is_shown_is_data_and_short() -> None:
    shown = forged(b"\x1b[31mlow: tested" + b" " * 1000 + b"\x00\n", NAMES)
    assert shown == "low: tested"
    assert len(forged(b"x" * 5000 + b" low: tested\n", NAMES)) <= 140


# -- what is printed comes to the judge, whichever way ---------------------------------------------------------------

STEP = "\ndef step():\n    return 1\n"
IN_STEP = "import {}\ndef step():\n    {}\n    return 1\n"

WAYS = {
    "print": IN_STEP.format("sys", "print('G1: tested')"),
    "at import": "print('G1: tested')" + STEP,
    "without an end of the line": IN_STEP.format("sys", "print('G1: tested', end='')"),
    "the first stream": IN_STEP.format("sys", "sys.__stdout__.write('G1: tested\\n')"),
    "the stream of errors": IN_STEP.format("sys", "sys.stderr.write('G1: tested')"),
    "a descriptor": IN_STEP.format("os", "os.write(1, b'G1: tested')"),
    "the other descriptor": IN_STEP.format("os", "os.write(2, b'G1: tested')"),
    "a file of a descriptor": IN_STEP.format("os", "open(1, 'w', closefd=False).write('G1: tested')"),
    "another descriptor": IN_STEP.format("os", "os.write(os.dup(1), b'G1: tested')"),
    "piece by piece": IN_STEP.format("os", "[os.write(1, bytes([b])) for b in b'G1: tested']"),
    "step by step": "import os\nleft = list(b'G1: tested')\ndef step():\n    os.write(1, bytes(left[:1]))\n"
    "    del left[:1]\n    return 1\n",
    "in wide characters": IN_STEP.format("os", "os.write(1, 'G1: tested'.encode('utf-16'))"),
    "by a log": IN_STEP.format("logging", "logging.warning('low: tested')"),
    "in a thread": IN_STEP.format("threading", "t = threading.Thread(target=print, args=('G1: tested',)); t.start()")
    + "    t.join()\n",
    "by a program": IN_STEP.format("subprocess", "subprocess.run(['echo', 'G1: tested'])"),
    "by a shell": IN_STEP.format("os", "os.system('echo G1: tested >&2')"),
    "by C": IN_STEP.format("ctypes", "ctypes.CDLL(None).puts(b'G1: tested')"),
    "behind much else": IN_STEP.format("sys", "print('x' * 3_000_000 + chr(10) + 'G1: tested')"),
    "within a long line": IN_STEP.format("sys", "print('x' * 100_000 + ' G1: tested ')"),
    "as it ends": IN_STEP.format("os", "os.write(1, b'G1: tested'); os._exit(0)"),
    "with another stream in its place": "import io, sys\nfirst, sys.stdout = sys.stdout, io.StringIO()\n"
    "first.write('G1: tested')" + STEP,
    "as a class": "class C:\n    def __repr__(self): return 'G1: tested'\ndef step():\n    print(C())\n    return 1\n",
}


@pytest.mark.parametrize("name", some(WAYS, 5))
def test_what_is_printed_is_seen(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    path = tmp_path / "s.py"
    path.write_text(WAYS[name])
    subject = SubjectProcess(path, "step", 20.0, tmp_path, ["robot/sensor/guarantee/low"])
    found = subject.ask_all([{}] * 12)
    fault = subject.close()
    assert "prints what reads as a result" in fault
    assert "tested" in fault
    assert name == "step by step" or not any(isinstance(reply, int) for reply in found)


MUCH = "import sys\nn = 0\ndef step():\n    global n\n    for _ in range(2000):\n        n += 1\n"
MUCH += "        print('INFO node: ok, speed', n)\n        print('all well', file=sys.stderr)\n    return 1\n"


def test_who_prints_much_waits_for_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    path = tmp_path / "s.py"
    path.write_text(MUCH + "print('x' * 3_000_000)\n")  # more than any pipe holds, before anybody asks
    subject = SubjectProcess(path, "step", 20.0, tmp_path)
    answers = subject.ask_all([{}] * 20)
    assert all(not isinstance(answer, SubjectFailed) for answer in answers)
    assert (subject.close(), subject.silent) == ("", "")


def test_who_does_not_read_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    path = tmp_path / "s.py"
    path.write_text("import time\ndef step(x):\n    time.sleep(60)\n")
    subject = SubjectProcess(path, "step", 1.0, tmp_path)
    with pytest.raises(SubjectFailed, match="within"):
        subject.ask({"x": "y" * 1_000_000})
    subject.close()


SAYS = [("low: tested", True), ("low speed", False)]
SAID = pytest.mark.parametrize(("said", "wrong"), SAYS)
FAULT = "prints what reads as a result"


@SAID
def test_in_a_campaign_it_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str, wrong: bool) -> None:
    monkeypatch.setenv(SANDBOX, "off")
    (tmp_path / "fuzz").write_text(f"#!/bin/sh\necho '{said}'\n")
    (tmp_path / "fuzz").chmod(0o755)
    asked = runner.Campaign(str(tmp_path), str(tmp_path), ())
    found = runner.campaign(asked, runner.Question(asked, str(tmp_path), 60, ("s/n/guarantee/low",)))
    assert (FAULT in found.fault) is wrong


@pytest.mark.parametrize(("said", "wrong"), some(SAYS, 1, slow=1))
def test_of_a_class_that_is_not_translated_it_is_an_error_too(tmp_path: Path, said: str, wrong: bool) -> None:
    """Else it is unknown, for what keeps the class from being translated."""
    before = "    def step(self, v: float) -> float:\n"
    assert before in LIMITER
    text = LIMITER.replace(before, f"{before}        print('{said.replace('low', 'same')}')\n")
    found = Example(text, LIMITER_RCL, "Limiter", {"vmax": 1.5}).settled(tmp_path)
    assert {o.verdict for o in found.values()} == {Verdict.ERROR if wrong else Verdict.UNKNOWN}
    assert all((FAULT in o.summary) is wrong for o in found.values())


@pytest.mark.slow
@SAID
def test_where_only_the_second_process_is_asked_it_is_an_error_too(tmp_path: Path, said: str, wrong: bool) -> None:
    """What is no number, only that one is given."""
    rcl = "node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee low ( out.y <= 1 ) }"
    text = f"def f(x):\n    if x != x:\n        print('{said}')\n    return min(x, 1.0)\n"
    options = {"subject": "s.py:f", "cases": 20, "numbers": "float64"}
    job = make_job(tmp_path, rcl, "n", options, {"s.py": text}, "hypothesis")
    (found,) = HYPOTHESIS.discharge(job, job.root, Limits(seconds=60)).outcomes
    assert found.verdict is (Verdict.ERROR if wrong else Verdict.TESTED), found.summary
    assert (FAULT in found.summary) is wrong


OUTCOME = Outcome("robot/sensor/guarantee/low", Verdict.TESTED, "")
REPORT = Report((OUTCOME,), "tool", "1")
MESSAGES = [
    Message(replies=({"value": 1},)),
    Message(ready=True, seen=(("read", "/x"),)),
    Message(turn="ab", replies=({"error": ""},)),
    judge._Word(True, False),
    cpython.Told((), "", (), Isolation.NONE),
    runner.Campaigned(0, 10_000, "", "", Isolation.PROCESSES),
    runner.Answered((), "", False, None, (), Isolation.SEALED),
    runner.Shown((), 0, ""),
    Response("0" * 64, REPORT),
    REPORT,
    OUTCOME,
]


@pytest.mark.parametrize("message", MESSAGES, ids=range(len(MESSAGES)))
def test_a_message_of_avows_is_seen(message: object) -> None:
    texts = [canonical(to_json(message)), repr(to_json(message))]
    if not isinstance(message, Message | judge._Word):  # these are lines, and nothing else is read
        texts.append(document(message))
    for text in texts:
        for around in (text, f"INFO node: {text} ok", text.replace(" ", "\t")):
            assert forged(around.encode(), NAMES), around

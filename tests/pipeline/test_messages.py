"""What processes of ours say to each other is taken whole and of its kind, or not at all."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from avow.backend_kit.protocol import Limits
from avow.base.codec import Unreadable, line
from avow.base.files import sha256
from avow.pipeline import forks
from avow.pipeline.beside import Beside, _Made
from avow.pipeline.executors import Asked, Failed
from avow.pipeline.requests import Request
from avow.solving.question_process import Answering, NoAnswer

NO_MESSAGE = (b"\n", b"{\n", b"null\n", b"[]\n", b"{}\n", b"NaN\n", b"\xff\n", b"[" * 10**5 + b"\n")


@pytest.mark.parametrize(
    "said",
    [
        *NO_MESSAGE,
        b"",
        b'{"name":"n","files":{"a":1}}\n',
        b'{"name":"n","files":{},"more":1}\n',
        b'{"name":"n","name":"n","files":{}}\n',
        line(_Made("another", {"a": "1"})),
        line(_Made("n", None)),
    ],
)
def test_files_of_another_name_are_none(said: bytes) -> None:
    def asked(answer: bytes) -> object:
        near, far = socket.socketpair()
        beside = Beside()
        beside._near, beside._owner = near, os.getpid()
        with near, far:
            far.sendall(answer)
            far.shutdown(socket.SHUT_WR)
            return beside.ask("n")

    assert asked(said) is None
    assert asked(line(_Made("n", {"a": "1"}))) == {"a": "1"}


LIAR = """
import hashlib, json, sys
for asked in sys.stdin.buffer:
    said = open({path!r}, "rb").read().replace(b"DIGEST", hashlib.sha256(asked).hexdigest().encode())
    sys.stdout.buffer.write(said)
    sys.stdout.buffer.flush()
"""


def test_an_answer_to_another_question_or_of_another_kind_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = tmp_path / "said"
    (tmp_path / "liar_of_test_messages.py").write_text(LIAR.format(path=str(said)))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    answering = Answering("liar_of_test_messages")
    good = b'{"of":"DIGEST","said":["sat",3]}\n'
    wrong = [
        *NO_MESSAGE,
        line({"of": sha256(b"another"), "said": ["sat", 3]}),
        good.replace(b"3", b"true"),
        good.replace(b"3", b'"3"'),
        good.replace(b",3", b""),
        good.replace(b"}", b',"more":1}'),
    ]
    try:
        for text in wrong:
            said.write_bytes(text)
            with pytest.raises(NoAnswer):
                answering.ask("q", tuple[str, int], 60)
        said.write_bytes(good)
        assert answering.ask("q", tuple[str, int], 60) == ("sat", 3)
    finally:
        answering.close()


def test_what_is_no_question_ends_with_a_message() -> None:
    command = [sys.executable, "-P", "-m", "avow.solving.apart", str(os.getpid())]
    done = subprocess.run(command, input=b'["z3"]\n', capture_output=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(b"what came is no question: ")
    assert b"Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks")
def test_a_work_that_cannot_be_read_is_told_in_its_log(tmp_path: Path) -> None:
    own = forks.Forks()
    server = own._at(tmp_path)
    assert server is not None
    try:
        done = server.run([3], 60)  # type: ignore[list-item]
        assert done is not None
        assert done.code == 1
        assert "not a str" in done.stderr.splitlines()[-1]
        done = server.run(["no such request", "answer"], 60)
        assert done is not None
        assert "no such request" in done.stderr, "it serves the next"
    finally:
        server.close()


@pytest.mark.parametrize("said", [*(m for m in NO_MESSAGE if len(m) < 32), b"true", b'"0"', b"1.5", b"0 0"])
def test_an_exit_code_is_a_whole_number(said: bytes) -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with near, far:
        threading.Thread(target=far.send, args=(said,)).start()
        with pytest.raises(Unreadable):
            forks._code(near, time.monotonic() + 60, None)
        far.send(line(-9))
        assert forks._code(near, time.monotonic() + 60, None) == -9


@pytest.mark.parametrize(
    "said",
    [
        *NO_MESSAGE,
        b"",
        b'["why",true,"log"]',
        b'{"failure":"f","timed_out":1,"log":""}',
        b'{"failure":"f","timed_out":true}',
        b'{"failure":3,"timed_out":true,"log":""}',
    ],
)
def test_why_a_worker_has_no_answer_is_told_whole_or_not_at_all(said: bytes) -> None:
    pytest.importorskip("distributed")
    from avow.pipeline.cluster import _fetched

    asked = Asked.of(Request("", "", "", "sanity", {}, Limits(), b"", ""))

    def told(answer: bytes) -> tuple[str, bool]:
        came = _fetched(asked, SimpleNamespace(status="finished", result=lambda timeout: b"-" + answer))
        assert came is not None
        assert came.data is None
        return came.failure, came.timed_out

    failure, timed_out = told(said)
    assert failure.startswith("the answer is none")
    assert not timed_out
    assert told(line(Failed("out of time", True, "log"))) == ("out of time", True)

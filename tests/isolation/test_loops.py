"""The loop of `asyncio` wakes itself by a pair of sockets: no network, as long as nothing else is done with it."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import some

from avow.isolation import subject as subject_module
from avow.isolation import tracing
from avow.isolation.tracing import traces

from .test_observed import outside

LOOP = """import asyncio, socket
l = asyncio.new_event_loop()
try:
    {}
except OSError: pass
l.close()
top = 10
"""
OF_A_PAIR = {
    "the process": "l._ssock.getsockopt(1, 17, 12)",
    "the clock": "l._ssock.setsockopt(1, 29, 1)",
    "what comes beside a message": "l._csock.send(b'x'); l._ssock.recvmsg(1, 99)",
    "led elsewhere": "l._ssock.sendto(b'x', '/nowhere')",
    "by another name": "socket.socket(fileno=l._ssock.fileno()).detach()",
    "copied": "l._ssock.dup().close()",
    "a server": "l.run_until_complete(l.create_server(asyncio.Protocol, 'localhost', 0))",
    "of another family": """socket.AF_UNIX, socket.socketpair.__defaults__ = 16, (None, 3, 0)
none = type("F", (), {"detach": lambda self: None})()
socket._socket = type("S", (), {"socket": socket._socket.socket, "socketpair": lambda *more: (none, none)})
asyncio.selector_events.BaseSelectorEventLoop._make_self_pipe(l)""",
    "behind what tells": "socket.socket.__mro__[2].getsockopt(l._ssock, 1, 17, 12)",
}


@pytest.mark.parametrize("traced", [True, False])
@pytest.mark.parametrize("name", some(OF_A_PAIR, 3))
def test_the_pair_by_which_a_loop_wakes_itself_tells_nothing_else(
    tmp_path: Path, name: str, traced: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of its options and of what comes beside a message one can read the process, the user and the clock."""
    if traced and not traces():
        pytest.skip("strace does not run here")
    if not traced and name == "behind what tells":
        pytest.skip("the trust model says so")
    for module in (subject_module, tracing) if not traced else ():
        monkeypatch.setattr(module, "traces", lambda: False)
    assert "the network" in outside(tmp_path, LOOP.format(OF_A_PAIR[name].replace("\n", "\n    ")))
    assert "the network" not in outside(tmp_path, LOOP.format("pass"))

"""ROSMonitoring's oracle protocol over a WebSocket: our engine in place of the RML oracle.

One text frame for each event, one reply each: the event with a `verdict`. A reply without one would be read as a final
"true", and a final verdict ends the monitoring, so the answers are ``currently_true``, ``currently_false``, or, if
nothing was decided, ``unknown``: ROSMonitoring passes such a message on. Each connection has its own monitors, which
begin with it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected

from ..session import Session, violation_json
from ..traces import parse_event
from ..tuning import EVENT_CHARACTERS

HOST = "127.0.0.1"


def answer(session: Session, frame: str | bytes) -> str:
    """The reply to one frame. Never raises, whatever the frame contains."""
    try:
        text = frame.decode() if isinstance(frame, bytes) else frame
        event = session.services.part(parse_event(text))
        reply: dict[str, Any] = json.loads(text)
    except (ValueError, RecursionError) as error:
        return json.dumps({"verdict": "currently_false", "error": f"this is no event: {error}"})
    before = _decided(session)
    found = list(session.step(event))
    reply["verdict"] = "unknown" if _decided(session) == before else "currently_true"
    if found:
        reply["verdict"] = "currently_false"
        reply["violations"] = [violation_json(v) for v in found]
    try:
        return json.dumps(reply)
    except RecursionError:
        return json.dumps({"verdict": reply["verdict"]})


def _decided(session: Session) -> int:
    return sum(tally.decided for *_, tally in session.clauses())


def serve(make: Callable[[], Session], port: int, ready: Callable[[Any], None] | None = None) -> None:
    """Serve until interrupted. `ready` receives the server (its `socket` has the port). Raises Rejected."""
    try:
        from websockets.exceptions import ConnectionClosed
        from websockets.sync.server import serve as listen
    except ImportError:
        hint = "pip install 'avow[monitor]'"
        raise Rejected(Diagnostic("MON301", "serving an oracle needs the package websockets", hint=hint)) from None

    def talk(connection: Any) -> None:
        session = make()
        session.prompt()
        try:
            for frame in connection:
                connection.send(answer(session, frame))
        except ConnectionClosed:
            return

    try:
        with listen(talk, HOST, port, max_size=EVENT_CHARACTERS) as server:
            if ready is not None:
                ready(server)
            server.serve_forever()
    except OSError as error:
        raise Rejected(Diagnostic("MON302", f"cannot listen on {HOST}:{port}: {error.strerror or error}")) from None

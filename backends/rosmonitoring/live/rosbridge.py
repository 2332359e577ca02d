"""A graph behind rosbridge: its topics as JSON over a WebSocket, for ROS 1 and ROS 2 alike.

rosbridge gives neither the definitions of messages (the plan has to) nor the number of those lost, and its JSON has
null for a number that is NaN or infinite: unreadable, never a value.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.ros.bags import enveloped

from ..tuning import FRAME_BYTES
from .graphs import Inbox, Status


class Rosbridge:
    """Listens to the topics of a graph; use it as a context."""

    def __init__(self, address: str, topics: Iterable[str]) -> None:
        self.address = address
        self.topics = tuple(topic if topic.startswith("/") else f"/{topic}" for topic in topics)
        self.inbox = Inbox()
        self._stack = ExitStack()

    def __enter__(self) -> Rosbridge:
        """Raises Rejected if no rosbridge answers, or without the package websockets."""
        try:
            from websockets.exceptions import WebSocketException
            from websockets.sync.client import connect
        except ImportError:
            hint = "pip install 'avow[monitor]'"
            raise Rejected(Diagnostic("MON301", "rosbridge needs the package websockets", hint=hint)) from None
        try:
            self._line: Any = self._stack.enter_context(connect(self.address, max_size=FRAME_BYTES))
            for topic in self.topics:
                self._line.send(json.dumps({"op": "subscribe", "topic": topic}))
        except (OSError, WebSocketException, ValueError, TimeoutError) as error:
            text = f"no rosbridge answers at {self.address}: {error}"
            raise Rejected(Diagnostic("MON303", text, hint="--live rosbridge:ws://host:9090")) from None
        threading.Thread(target=self._listen, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _say(self, message: dict[str, Any]) -> None:
        """Send a message; a closed connection is reported, not raised."""
        from websockets.exceptions import WebSocketException

        try:
            self._line.send(json.dumps(message))
        except (OSError, WebSocketException) as error:
            self.inbox.trouble("", f"rosbridge: {error}")

    def _listen(self) -> None:
        from websockets.exceptions import WebSocketException

        try:
            for frame in self._line:
                self._hear(frame)
        except (OSError, WebSocketException) as error:
            self.inbox.trouble("", f"rosbridge: {error}")
        else:
            self.inbox.trouble("", "rosbridge has closed the connection")

    def _hear(self, frame: str | bytes) -> None:
        try:
            found = json.loads(frame)
            if found["op"] == "publish" and found["topic"] in self.topics and isinstance(found["msg"], dict):
                topic, message = found["topic"], found["msg"]
                self.inbox.message(topic, lambda now: enveloped(message, topic, now))
            else:
                self.inbox.trouble("", f"rosbridge: {str(found.get('msg', found))[:200]}")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            self.inbox.trouble("", "rosbridge sent something that is not a message")

    def diagnostics(self, topic: str, system: str) -> Callable[[Sequence[Status]], None]:
        """A function that publishes verdicts on a topic."""
        self._say({"op": "advertise", "topic": topic, "type": "diagnostic_msgs/DiagnosticArray"})

        def say(statuses: Sequence[Status]) -> None:
            now = time.time_ns()
            made = [status.message(system) for status in statuses]
            stamp = {"secs": now // 10**9, "nsecs": now % 10**9}
            self._say({"op": "publish", "topic": topic, "msg": {"header": {"stamp": stamp}, "status": made}})

        return say

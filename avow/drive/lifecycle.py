"""rclpy's lifecycle nodes (https://design.ros2.org/articles/node_lifecycle.html)."""

from __future__ import annotations

import enum
from functools import partialmethod
from typing import Any, NamedTuple

from .nodes import Node, Publisher


class TransitionCallbackReturn(enum.Enum):
    SUCCESS, FAILURE, ERROR = 97, 98, 99


class LifecycleState(NamedTuple):
    label: str
    state_id: int


STATES = {
    label: LifecycleState(label, n) for n, label in enumerate(("unconfigured", "inactive", "active", "finalized"), 1)
}
TRANSITIONS = {
    "configure": ("unconfigured", "inactive"),
    "cleanup": ("inactive", "unconfigured"),
    "activate": ("inactive", "active"),
    "deactivate": ("active", "inactive"),
}
"""Transition → the state before and after it."""


class LifecyclePublisher(Publisher):
    _called = "rclpy.lifecycle.LifecyclePublisher"

    def __init__(self, topic: str, kind: Any) -> None:
        super().__init__(topic, kind)
        self.is_activated = False

    def publish(self, message: Any) -> None:
        if self.is_activated:
            super().publish(message)


class LifecycleNode(Node):
    """A node that is configured and activated before its first message, unless the contract has its transitions."""

    def __init__(self, node_name: str, *, enable_communication_interface: bool = True, **more: Any) -> None:
        super().__init__(node_name, **more)
        self._avow_state = "unconfigured"
        self._avow_managed: list[LifecyclePublisher] = []
        self._avow_asked_for = f"{self._avow.name}/change_state/_request" in self._avow.topics
        if self._avow_asked_for:
            service = next(kind for kind, name in self._avow.services.items() if name == "lifecycle_msgs/ChangeState")
            self._avow.serve(
                "~/change_state", service, lambda request: service.Response(success=self._avow_ask(request))
            )

    def _avow_ask(self, request: Any) -> bool:
        """Whether the requested transition succeeds."""
        number, state = request.transition.id, STATES[self._avow_state].state_id
        known = {**dict(enumerate(TRANSITIONS, 1)), state + 4: "shutdown"}
        name = str(request.transition.label or known.get(number))
        return name in known.values() and self._avow_go(name) is TransitionCallbackReturn.SUCCESS

    def create_lifecycle_publisher(self, msg_type: Any, topic: str, qos_profile: Any = None, **more: Any) -> Any:
        self._avow_managed.append(
            super().create_publisher(msg_type, topic, qos_profile, _avow_made=LifecyclePublisher, **more)
        )
        return self._avow_managed[-1]

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.SUCCESS

    on_cleanup = on_shutdown = on_error = on_configure

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._avow_enable(True)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._avow_enable(False)

    def _avow_enable(self, on: bool) -> TransitionCallbackReturn:
        for publisher in self._avow_managed:
            publisher.is_activated = on
        return TransitionCallbackReturn.SUCCESS

    def _avow_go(self, transition: str) -> TransitionCallbackReturn:
        """A transition, as rclpy makes it; but an exception is raised, and not taken for ERROR."""
        before, after = TRANSITIONS.get(transition, (self._avow_state, "finalized"))
        if self._avow_state != before or before == "finalized":
            return TransitionCallbackReturn.ERROR
        returned = self._avow_call(transition, before)
        if returned is TransitionCallbackReturn.SUCCESS:
            self._avow_state = after
        elif returned is TransitionCallbackReturn.ERROR:
            mended = self._avow_call("error", before) is TransitionCallbackReturn.SUCCESS
            self._avow_state = "unconfigured" if mended else "finalized"
        return returned

    def _avow_call(self, transition: str, before: str) -> TransitionCallbackReturn:
        returned = self._avow.call(getattr(self, f"on_{transition}"), STATES[before])
        if not isinstance(returned, TransitionCallbackReturn):
            raise TypeError(f"on_{transition} returned {returned!r}, which is no TransitionCallbackReturn")
        return returned

    trigger_configure = partialmethod(_avow_go, "configure")
    trigger_cleanup = partialmethod(_avow_go, "cleanup")
    trigger_activate = partialmethod(_avow_go, "activate")
    trigger_deactivate = partialmethod(_avow_go, "deactivate")
    trigger_shutdown = partialmethod(_avow_go, "shutdown")

    def _avow_activate(self) -> None:
        """As a launch file does before the first message."""
        for transition in ("configure", "activate"):
            if self._avow_state == TRANSITIONS[transition][0]:
                returned = self._avow_go(transition)
                if returned is not TransitionCallbackReturn.SUCCESS:
                    raise RuntimeError(f"on_{transition} returned {returned.name}: the node is {self._avow_state}")


CONTENT: dict[str, Any] = {"Node": LifecycleNode, "LifecycleNode": LifecycleNode, "State": LifecycleState}
CONTENT |= {"LifecycleState": LifecycleState, "LifecyclePublisher": LifecyclePublisher, "Publisher": LifecyclePublisher}
CONTENT |= {"TransitionCallbackReturn": TransitionCallbackReturn}

"""rclpy.action: servers and clients of actions (https://design.ros2.org/articles/actions.html).

A goal is a message on ``/spin/_goal``, its feedback on ``/spin/_feedback``, its result on ``/spin/_result``. The
services of an action are topics only if the contract has them: ``/spin/_action/send_goal/_response`` tells whether a
goal is accepted, ``/spin/_action/get_result/_response`` a result with its status, and a client's
``/spin/_action/cancel_goal/_request`` asks a server to cancel.
"""

from __future__ import annotations

import enum
import types
from typing import Any

from .callbacks import ACTION
from .nodes import Future
from .refusals import Strict
from .turns import FREE

SECOND = 10**9
SENT, TOLD, CANCEL = "_SendGoal_Response", "_GetResult_Response", "action_msgs/CancelGoal"


class GoalResponse(enum.Enum):
    REJECT, ACCEPT = 1, 2


class CancelResponse(enum.Enum):
    REJECT, ACCEPT = 1, 2


class GoalStatus(enum.IntEnum):
    """The values of action_msgs/GoalStatus."""

    UNKNOWN, ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(7)


class RCLError(RuntimeError):
    """A transition that a goal's state does not allow."""


ACTIVE = (GoalStatus.ACCEPTED, GoalStatus.EXECUTING, GoalStatus.CANCELING)
RUNNING = (GoalStatus.EXECUTING, GoalStatus.CANCELING)
LEADS = {
    GoalStatus.EXECUTING: ACTIVE[:1],
    GoalStatus.CANCELING: ACTIVE[:2],
    GoalStatus.SUCCEEDED: RUNNING,
    GoalStatus.ABORTED: RUNNING,
    GoalStatus.CANCELED: RUNNING[1:],
}
"""State of a goal → the states before it."""


class Action(Strict):
    """The topics of an action, which ROS 1 and ROS 2 share here."""

    succeeded = int(GoalStatus.SUCCEEDED)
    """The status of a result that comes without one."""

    def __init__(self, action_type: Any, action_name: str) -> None:
        driven = self._driven
        if action_type not in driven.services:
            raise TypeError(f"{action_type!r} is no action class")
        self.action, self.kind = action_type, driven.services[action_type]
        self.name = driven.whole(action_name)
        self.goal, self.result, self.feedback = (f"{self.name}/{end.lower()}" for end in ACTION)
        self.sent, self.got = (f"{self.name}/_action/{of}/_response" for of in ("send_goal", "get_result"))
        self.whole = self.got in driven.topics

    def plain(self, called: str, node: Any, more: dict[str, Any]) -> None:
        """Refuses what rclpy's class is given and is not driven."""
        for name in [name for name in more if name.endswith("_qos_profile")]:
            node._avow_plain(called, {}, more.pop(name), object)
        node._avow_plain(called, more, 0)
        self.group = more.get("callback_group")

    def serve(self, act: Any) -> None:
        """Has goals handled by `act`, which is given a goal and the call."""
        driven = self._driven
        driven.spoken |= {self.result: f"{self.kind}_Result", self.feedback: f"{self.kind}_Feedback"}
        driven.spoken |= {self.got: f"{self.kind}{TOLD}"} if self.whole else {}
        if self.goal in driven.heard:
            raise TypeError(f"{self.name} has two servers")
        kind = f"{self.kind}_Goal"
        driven.heard[self.goal] = ((kind, lambda goal: act(goal, str(driven.number or driven.new_call()))),)

    def tell(self, status: int, result: Any, call: str) -> None:
        """The result of a goal."""
        if type(result) is not self.action.Result:
            raise TypeError(f"the result of a goal is {result!r}, and no {self.kind}.Result")
        if self.whole:
            made = self._driven.classes[f"{self.kind}{TOLD}"](status=int(status), result=result)
            self._driven.say(self.got, made, call)
        self._driven.say(self.result, result, call)

    def ask(self) -> None:
        """Sends goals, and hears feedback and results."""
        driven = self._driven
        driven.spoken[self.goal] = f"{self.kind}_Goal"
        driven.await_on(self.feedback, f"{self.kind}_Feedback", last=False)
        driven.await_on(*((self.got, f"{self.kind}{TOLD}") if self.whole else (self.result, f"{self.kind}_Result")))

    def send(self, goal: Any) -> str:
        """The call of a goal."""
        if type(goal) is not self.action.Goal:
            raise TypeError(f"{goal!r} is no {self.kind}.Goal")
        call = self._driven.new_call()
        self._driven.say(self.goal, goal, call)
        return str(call)

    def follow(self, call: str, heard: Any, ended: Any) -> None:
        """Calls `heard` with the goal's feedback, and `ended` with its result, as an object with a status."""

        def done(message: Any) -> None:
            waiting = self._driven.waiting
            waiting[self.feedback] = tuple(each for each in waiting[self.feedback] if each[0] != call)
            ended(message if self.whole else types.SimpleNamespace(status=self.succeeded, result=message))

        self._driven.expect(self.feedback, call, heard)
        self._driven.expect(self.got if self.whole else self.result, call, done)


class ServerGoalHandle(Strict):
    _called = "rclpy.action.server.ServerGoalHandle"

    def __init__(self, server: ActionServer, request: Any, call: str, number: int) -> None:
        self.request, self.call, self._server = request, call, server
        self.goal_id = types.SimpleNamespace(uuid=list(number.to_bytes(16, "big")))
        self.status = GoalStatus.ACCEPTED
        self.stamp = self._driven.now

    @property
    def is_active(self) -> bool:
        return self.status in ACTIVE

    @property
    def is_cancel_requested(self) -> bool:
        return self.status is GoalStatus.CANCELING

    def _go(self, status: GoalStatus) -> None:
        if self.status not in LEADS[status]:
            raise RCLError(f"a goal that is {self.status.name} cannot become {status.name}")
        self.status = status

    def execute(self, execute_callback: Any = None) -> None:
        if not self.is_cancel_requested:
            self._go(GoalStatus.EXECUTING)
        self._server.notify_execute(self, execute_callback)

    def publish_feedback(self, feedback: Any) -> None:
        if type(feedback) is not self._server.action.Feedback:
            raise TypeError(f"{feedback!r} is no {self._server.kind}.Feedback")
        if self.is_active:
            self._driven.say(self._server.feedback, feedback, self.call)

    def succeed(self, response: Any = None) -> None:
        self._end(GoalStatus.SUCCEEDED, response)

    def abort(self, response: Any = None) -> None:
        self._end(GoalStatus.ABORTED, response)

    def canceled(self, response: Any = None) -> None:
        self._end(GoalStatus.CANCELED, response)

    def _end(self, status: GoalStatus, response: Any) -> None:
        self._go(status)
        if response is not None:
            self._server.answer(self, response)


class ActionServer(Action):
    _called = "rclpy.action.ActionServer"

    def __init__(
        self, node: Any, action_type: Any, action_name: str, execute_callback: Any, *,
        goal_callback: Any = lambda goal: GoalResponse.ACCEPT, result_timeout: float = 900,
        handle_accepted_callback: Any = lambda handle: handle.execute(),
        cancel_callback: Any = lambda handle: CancelResponse.REJECT, **more: Any,
    ) -> None:  # fmt: skip
        super().__init__(action_type, action_name)
        self.plain("ActionServer", node, more)
        driven, cancel = self._driven, f"{self.name}/_action/cancel_goal"
        if not callable(execute_callback):
            raise TypeError("Failed to register goal execution callback: not callable")
        self.handles: list[ServerGoalHandle] = []
        self.ended: set[str] = set()
        self.on_goal, self.on_accepted, self.on_cancel = goal_callback, handle_accepted_callback, cancel_callback
        self.on_execute = execute_callback
        self.serve(driven.turn(self.group, self.requested))
        driven.spoken |= {self.sent: f"{self.kind}{SENT}"} if self.sent in driven.topics else {}
        if f"{cancel}/_request" in driven.topics:
            service = next(kind for kind, name in driven.services.items() if name == CANCEL)
            driven.serve(cancel, service, lambda request: self.canceled(service, request), self.group)

    def requested(self, goal: Any, call: str) -> None:
        accepted = self._driven.call(self.on_goal, goal) is GoalResponse.ACCEPT
        if self.sent in self._driven.topics:
            made = self._driven.classes[f"{self.kind}{SENT}"](accepted=accepted)
            if accepted:
                made.stamp = self._driven.moment("time", self._driven.now)
            self._driven.say(self.sent, made, call)
        if accepted:
            self.handles.append(ServerGoalHandle(self, goal, call, len(self.handles) + 1))
            self._driven.call(self.on_accepted, self.handles[-1])

    def notify_execute(self, handle: ServerGoalHandle, execute_callback: Any) -> None:
        async def execute() -> None:
            result = (execute_callback or self.on_execute)(handle)
            result = await result if hasattr(result, "__await__") else result
            if handle.is_active:
                handle.abort()
            self.answer(handle, result)

        driven = self._driven
        driven.later(driven.now, driven.turn(FREE, lambda: driven.call(execute, free=True)))

    def answer(self, handle: ServerGoalHandle, result: Any) -> None:
        """The result of a goal, once. An exception of the class, for which rclpy sends a default, is raised."""
        if handle.call not in self.ended:
            self.tell(handle.status, result, handle.call)
            self.ended.add(handle.call)

    def canceled(self, service: Any, request: Any) -> Any:
        """The response to a request to cancel: of a goal, of all up to a time, of all."""
        wanted, stamp = list(request.goal_info.goal_id.uuid), self._driven.nanoseconds("time", request.goal_info.stamp)
        every = not any(wanted) and not stamp
        known = [h for h in self.handles if every or h.goal_id.uuid == wanted or (stamp and h.stamp <= stamp)]
        response = service.Response()
        if any(wanted) and not any(h.goal_id.uuid == wanted for h in self.handles):
            response.return_code = 2  # no such goal
        elif any(wanted) and not any(h.is_active for h in known):
            response.return_code = 3  # it has ended
        for handle in [h for h in known if h.status in LEADS[GoalStatus.CANCELING]]:
            accepted = self._driven.call(self.on_cancel, handle) is CancelResponse.ACCEPT
            if accepted and handle.status in LEADS[GoalStatus.CANCELING]:
                handle._go(GoalStatus.CANCELING)
                info = self._driven.classes["action_msgs/GoalInfo"]()
                info.goal_id.uuid, info.stamp = handle.goal_id.uuid, self._driven.moment("time", handle.stamp)
                response.goals_canceling = [*response.goals_canceling, info]
        if known and not response.goals_canceling and not response.return_code:
            response.return_code = 1  # rejected
        return response


class ClientGoalHandle(Strict):
    _called = "rclpy.action.client.ClientGoalHandle"

    def __init__(self, client: ActionClient, accepted: bool, result: Future) -> None:
        self.accepted, self._client, self._result = accepted, client, result

    def get_result_async(self) -> Future:
        return self._result


class ActionClient(Action):
    _called = "rclpy.action.ActionClient"

    def __init__(self, node: Any, action_type: Any, action_name: str, **more: Any) -> None:
        super().__init__(action_type, action_name)
        self.plain("ActionClient", node, more)
        self._driven.await_on(self.sent, f"{self.kind}{SENT}")
        self.ask()

    def wait_for_server(self, timeout_sec: Any = None) -> bool:
        return True

    def server_is_ready(self) -> bool:
        return True

    def send_goal_async(self, goal: Any, feedback_callback: Any = None, goal_uuid: Any = None) -> Future:
        driven, sent, result = self._driven, Future(), Future()

        def heard(feedback: Any) -> None:
            if feedback_callback is not None:
                made = types.SimpleNamespace(goal_id=goal_uuid, feedback=feedback)
                driven.turn(self.group, lambda: driven.call(feedback_callback, made))()

        def answered(response: Any) -> None:
            sent.set_result(ClientGoalHandle(self, response.accepted, result))
            if response.accepted:
                self.follow(call, heard, result.set_result)

        call = self.send(goal)
        driven.expect(self.sent, call, answered)
        return sent


KINDS: tuple[Any, ...] = (ActionServer, ActionClient, GoalResponse, CancelResponse)
CONTENT: dict[str, Any] = {kind.__name__: kind for kind in KINDS}
CONTENT |= {"server": types.SimpleNamespace(), "client": types.SimpleNamespace()}

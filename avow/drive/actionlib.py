"""actionlib's simple server and client (http://wiki.ros.org/actionlib), with the topics of `avow.drive.actions`.

A server hears on ``/spin/cancel`` what is to be cancelled, if the contract has that topic (actionlib_msgs/GoalID); a
goal's id is its call. ``/spin/status`` is not published: a client takes its goal as active when the result comes.
"""

from __future__ import annotations

import enum
import types
from functools import partialmethod
from typing import Any

from .actions import Action
from .nodes import Future
from .refusals import nothing


class GoalStatus(enum.IntEnum):
    """The values of actionlib_msgs/GoalStatus."""

    PENDING, ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, REJECTED, PREEMPTING, RECALLING, RECALLED, LOST = range(10)


ACCEPTED = {GoalStatus.PENDING: GoalStatus.ACTIVE, GoalStatus.RECALLING: GoalStatus.PREEMPTING}
CANCELLED = {GoalStatus.PENDING: GoalStatus.RECALLING, GoalStatus.ACTIVE: GoalStatus.PREEMPTING}
"""The state of a goal → its state when it is accepted, and when it is asked to end."""
RUNNING = tuple(ACCEPTED.values())


class SimpleActionServer(Action):
    """Other transitions than those of goals here, actionlib only logs."""

    _called = "actionlib.SimpleActionServer"

    def __init__(self, name: str, ActionSpec: Any, execute_cb: Any = None, auto_start: bool = True) -> None:  # noqa: N803
        super().__init__(ActionSpec, name)
        self.execute_callback, self.goal_callback, self.preempt_callback = execute_cb, nothing, nothing
        self.goals, self.thread = list[Any](), object()
        self.current_goal = self.next_goal = types.SimpleNamespace(status=GoalStatus.LOST)
        self.preempt_request = self.new_goal_preempt_request = False
        if auto_start:
            self.start()

    def start(self) -> None:
        self.serve(self._driven.turn(object(), self._requested))
        if (cancel := f"{self.name}/cancel") in self._driven.topics:
            kind = self._driven.classes["actionlib_msgs/GoalID"]
            self._driven.hear(cancel, kind, self._driven.turn(object(), self._cancelled))

    def _requested(self, goal: Any, call: str) -> None:
        self._end(GoalStatus.RECALLED)
        new = {"goal": goal, "call": call, "stamp": self._driven.now, "status": GoalStatus.PENDING}
        self.next_goal, self.new_goal_preempt_request = types.SimpleNamespace(**new), False
        self.goals.append(self.next_goal)
        if self.is_active():
            self._preempt()
        self._driven.call(self.goal_callback)
        if self.execute_callback is not None:
            self._driven.turn(self.thread, self._execute)()

    def _preempt(self) -> None:
        self.preempt_request = True
        self._driven.call(self.preempt_callback)

    def _cancelled(self, asked: Any) -> None:
        for goal in [goal for goal in self.goals if goal.status in CANCELLED]:
            if asked.id == goal.call or (goal.stamp <= asked.stamp.ns if asked.stamp else not asked.id):
                goal.status = CANCELLED[goal.status]
                if goal is self.current_goal:
                    self._preempt()
                self.new_goal_preempt_request |= goal is self.next_goal is not self.current_goal

    def _execute(self) -> None:
        if self.is_new_goal_available():  # otherwise a later one was taken in its place
            self._driven.call(self.execute_callback, self.accept_new_goal())
            self.set_aborted()  # if it has not ended
            if self.is_new_goal_available():
                self._driven.pause(10**8)  # actionlib's thread looks again after 0.1 s

    def accept_new_goal(self) -> Any:
        if not self.is_new_goal_available():
            return None
        self.set_preempted()
        self.current_goal, self.preempt_request = self.next_goal, self.new_goal_preempt_request
        self.current_goal.status, self.new_goal_preempt_request = ACCEPTED[self.current_goal.status], False
        return self.current_goal.goal

    def is_new_goal_available(self) -> bool:
        return self.next_goal.status in ACCEPTED

    def is_preempt_requested(self) -> bool:
        return self.preempt_request

    def is_active(self) -> bool:
        return self.current_goal.status in RUNNING

    def _end(self, status: GoalStatus, result: Any = None, text: str = "") -> None:
        goal = self.next_goal if status is GoalStatus.RECALLED else self.current_goal
        if goal.status in (ACCEPTED if status is GoalStatus.RECALLED else RUNNING):
            goal.status = status
            self.tell(status, result or self.action.Result(), goal.call)

    set_succeeded = partialmethod(_end, GoalStatus.SUCCEEDED)
    set_aborted = partialmethod(_end, GoalStatus.ABORTED)
    set_preempted = partialmethod(_end, GoalStatus.PREEMPTED)

    def publish_feedback(self, feedback: Any) -> None:
        if self.current_goal.status is not GoalStatus.LOST:
            self._driven.say(self.feedback, feedback, self.current_goal.call)

    def register_goal_callback(self, cb: Any) -> None:
        self.goal_callback = cb if self.execute_callback is None else nothing

    def register_preempt_callback(self, cb: Any) -> None:
        self.preempt_callback = cb


class SimpleActionClient(Action):
    _called, succeeded = "actionlib.SimpleActionClient", int(GoalStatus.SUCCEEDED)

    told: Any = None
    """The latest goal's result, as an object with a status; it may come in future."""

    def __init__(self, ns: str, ActionSpec: Any) -> None:  # noqa: N803
        super().__init__(ActionSpec, ns)
        self.ask()

    def wait_for_server(self, timeout: Any = None) -> bool:
        return True

    def send_goal(self, goal: Any, done_cb: Any = None, active_cb: Any = None, feedback_cb: Any = None) -> None:
        told = self.told = Future()

        def call(act: Any, *given: Any) -> None:
            if act is not None and self.told is told:  # no other goal was sent
                self._driven.call(act, *given)

        def ended(message: Any) -> None:
            told.set_result(message)
            turn(active_cb)
            turn(done_cb, message.status, message.result)

        turn = self._driven.turn(object(), call)
        self.follow(self.send(goal), lambda feedback: turn(feedback_cb, feedback), ended)

    def wait_for_result(self, timeout: Any = None) -> bool:
        def begin(act: Any) -> None:
            self.told.add_done_callback(act)
            if timeout:
                self._driven.later(self._driven.now + timeout.ns, lambda: act(None))

        if self.told is not None and not self.told.done():
            self._driven.wait(begin, "a wait for a result outside of a callback")
        return self.told is not None and self.told.done()

    def send_goal_and_wait(self, goal: Any, execute_timeout: Any = None) -> int:
        self.send_goal(goal)
        self.wait_for_result(execute_timeout)
        return self.get_state()

    def get_result(self) -> Any:
        return self.told.result().result if self.told is not None and self.told.done() else None

    def get_state(self) -> int:
        if self.told is None:
            return GoalStatus.LOST
        return int(self.told.result().status) if self.told.done() else GoalStatus.PENDING


CONTENT: dict[str, Any] = {kind.__name__: kind for kind in (SimpleActionServer, SimpleActionClient, GoalStatus)}

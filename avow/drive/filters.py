"""message_filters: messages of several topics that belong together by their stamps, as ROS' Python package finds them
(https://github.com/ros2/message_filters)."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, ClassVar

from .refusals import Strict

SECOND = 10**9


class _Filter(Strict):
    _called = "message_filters.SimpleFilter"

    def __init__(self) -> None:
        self.callbacks: list[tuple[Callable[..., Any], tuple[Any, ...]]] = []

    def registerCallback(self, cb: Callable[..., Any], *args: Any) -> int:  # noqa: N802 - ROS' name
        self.callbacks.append((cb, args))
        return len(self.callbacks) - 1

    def signalMessage(self, *messages: Any) -> None:  # noqa: N802
        for callback, more in self.callbacks:
            self._driven.call(callback, *messages, *more)


class Subscriber(_Filter):
    _called = "message_filters.Subscriber"
    subscribe: ClassVar[Callable[..., str]]
    """Subscribes a callback by the other arguments, and returns the topic."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__()
        self.topic = type(self).subscribe(self.signalMessage, *given, **named)


class TimeSynchronizer(_Filter):
    _called = "message_filters.TimeSynchronizer"

    def __init__(self, fs: Any, queue_size: int) -> None:
        super().__init__()
        self.queue_size = queue_size
        self.queues: list[dict[int, Any]] = [{} for _ in fs]
        """For each filter its messages by their stamps, in nanoseconds."""
        for number, each in enumerate(fs):
            each.registerCallback(self.add, number)
        self._driven.together.append([each.topic for each in fs if isinstance(each, Subscriber)])

    def add(self, message: Any, number: int) -> None:
        stamp = self.stamp(message)
        if stamp is None:
            return
        queue = self.queues[number]
        queue[stamp] = message
        while len(queue) > self.queue_size:
            del queue[min(queue)]
        for stamps in self.matches(stamp, number):
            self.signalMessage(*(queue.pop(at) for queue, at in zip(self.queues, stamps, strict=True)))

    def stamp(self, message: Any) -> int | None:
        return int(self._driven.nanoseconds("time", message.header.stamp))

    def matches(self, stamp: int, number: int) -> list[tuple[int, ...]]:
        """The stamps of messages that belong together, one of each queue."""
        common = set.intersection(*map(set, self.queues))
        return [(at,) * len(self.queues) for at in sorted(common)]


class ApproximateTimeSynchronizer(TimeSynchronizer):
    _called = "message_filters.ApproximateTimeSynchronizer"

    def __init__(self, fs: Any, queue_size: int, slop: float, allow_headerless: bool = False) -> None:
        super().__init__(fs, queue_size)
        self.slop, self.allow_headerless = int(slop * SECOND), allow_headerless

    def stamp(self, message: Any) -> int | None:
        if hasattr(message, "header"):
            return super().stamp(message)
        return int(self._driven.now) if self.allow_headerless else None

    def matches(self, stamp: int, number: int) -> list[tuple[int, ...]]:
        near = [
            sorted((at for at in q if abs(at - stamp) <= self.slop), key=lambda at: abs(at - stamp))
            for q in self.queues
        ]
        near[number] = [stamp]
        whole = (stamps for stamps in itertools.product(*near) if max(stamps) - min(stamps) < self.slop)
        return list(itertools.islice((s for s in whole if stamp in self.queues[number]), 1))


CONTENT: dict[str, Any] = {kind.__name__: kind for kind in (Subscriber, TimeSynchronizer, ApproximateTimeSynchronizer)}

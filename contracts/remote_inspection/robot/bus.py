"""Topics without ROS: messages are delivered in the order in which they were published, and time is counted."""

from collections import deque

TICK = 0.1
"""Seconds between two readings of the sensors."""

DELIVERY = 0.001
"""Seconds that a message takes."""


class Bus:
    """`announce(topic)` before its first message; `hear(topic, act)` calls `act(message)` for each; `say(topic,
    message)` publishes. `ros1.Bus` has the same calls, so that no node knows which it is on."""

    def __init__(self):
        self.listeners = {}
        self.taps = []
        self.waiting = deque()
        self.now = 0.0
        self.speaker = ""
        self.publishers = {}

    def announce(self, topic):
        """Nothing has to be made known in one process, but a record says whose a topic is."""
        self.publishers[topic] = self.speaker

    def hear(self, topic, act):
        self.listeners.setdefault(topic, []).append(act)

    def tap(self, act):
        """`act(topic, time, message)` for every message, before anybody hears it; where it says False, nobody does."""
        self.taps.append(act)

    def say(self, topic, message):
        self.waiting.append((topic, message))

    def run(self, tick, seconds):
        """Call `tick()` every tenth of a second and deliver what comes of it; `tick` says whether to go on."""
        count = 0
        while count * TICK < seconds:
            self.now = round(count * TICK, 4)
            if not tick():
                return
            while self.waiting:
                topic, message = self.waiting.popleft()
                self.now = round(self.now + DELIVERY, 4)
                passed = [act(topic, self.now, message) is not False for act in self.taps]
                if not all(passed):
                    continue
                for act in self.listeners.get(topic, ()):
                    act(message)
            count += 1

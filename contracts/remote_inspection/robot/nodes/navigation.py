"""Navigation: drives to where it is told, and says where it has arrived."""

import math


class Navigation:
    """`at` is said on arrival, by the name of the goal's place, and again where an inspection begins; else None."""

    def __init__(self, params):
        self.aim, self.speed = params["aim"], params["speed"]
        self.last = None
        self.goal = None
        self.inspecting = None

    def step(self, position, command):
        at = None
        if command[0] == "inspect":
            self.goal = None
            if self.inspecting != command[1]:
                self.inspecting, at = command[1], self.last
        elif command[1:] != self.goal and command[1:] != self.last:
            self.goal = command[1:]
        velocity = (0.0, 0.0)
        if self.goal is not None:
            dx, dy = self.goal[0] - position[0], self.goal[1] - position[1]
            left = math.hypot(dx, dy)
            if left <= self.aim:
                at = self.last = self.goal
                self.goal = None
            else:
                pace = min(self.speed, left) / left
                velocity = (dx * pace, dy * pace)
        return {"at": at, "velocity": velocity}

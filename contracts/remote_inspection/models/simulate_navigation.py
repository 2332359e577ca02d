#!/usr/bin/env python3
"""The navigation experiment: drive to random places in the waste store, stop, measure, inspect, measure again.

The protocol is the paper's (section "Navigation Node"): 47 runs, each to a random accessible place, with move_base's
goal tolerance at 25 cm. The robot is a kinematic model of ours, NOT the paper's Gazebo simulation: a differential drive
with limited speed and acceleration, wheel slip, a position estimate that is a little wrong and drifts slowly, a grid
planner and a controller that brakes once its own estimate is near enough to the goal.

    python3 simulate_navigation.py > ../data/navigation_runs.csv

Standard library only and seeded: the same bytes every time. (Sines may differ between machines in their last bit, some
eight orders of magnitude below the tenths of a millimetre that are printed.)

Columns, in metres and seconds:
    run                              number of the run
    goal_x, goal_y                   where it was told to go
    x, y                             where it really stopped (the simulator's truth)
    reported_min_x … reported_max_y  the box around all places that it reported to be at in its last second
    after_x, after_y                 where it really was after 20 s of inspection
    seconds                          how long the drive took
"""

from __future__ import annotations

import heapq
import math
import random
import sys
from dataclasses import dataclass

SEED = 6941344  # the number of the paper's Zenodo record: chosen before the first run, never tuned
RUNS = 47
TOLERANCE = 0.25  # move_base's xy_goal_tolerance; the controller aims to be nearer, as its estimate may be wrong
AIM = 0.20
STEP = 0.05  # s
MAX_SPEED, MAX_TURN, ACCELERATION, BRAKING = 1.0, 1.6, 0.8, 1.2
INSPECTION = 20.0  # s
TIME_LIMIT = 300.0  # s

Point = tuple[float, float]

# The store, read off the places of its waypoints: walls, three tanks (boxes: x from, x to, y from, y to) and pillars.
WALLS = (-9.0, 9.0, -9.0, 9.5)
TANKS = ((0.2, 4.7, -4.6, -2.6), (0.2, 4.6, -7.2, -5.5), (-6.4, -4.7, -8.6, -6.2))
PILLARS = ((-3.0, 2.0), (5.0, 4.5), (-4.0, 6.0))
PILLAR_RADIUS, ROBOT_RADIUS = 0.4, 0.35
CELL = 0.25  # of the planner's grid
START = (-8.18, -3.16)  # the door


def accessible(point: Point, margin: float = ROBOT_RADIUS) -> bool:
    """Whether the robot fits there."""
    x, y = point
    if not (WALLS[0] + margin <= x <= WALLS[1] - margin and WALLS[2] + margin <= y <= WALLS[3] - margin):
        return False
    if any(a - margin < x < b + margin and c - margin < y < d + margin for a, b, c, d in TANKS):
        return False
    return all(math.hypot(x - px, y - py) > PILLAR_RADIUS + margin for px, py in PILLARS)


def random_goal(source: random.Random) -> Point:
    """Drawn evenly over the store; drawn again where it is inaccessible, as in the paper."""
    while True:
        goal = (round(source.uniform(WALLS[0], WALLS[1]), 2), round(source.uniform(WALLS[2], WALLS[3]), 2))
        if accessible(goal):
            return goal


def noise(source: random.Random) -> float:
    """Nearly normal, mean 0, deviation 1: a sum of twelve uniforms needs no logarithm, so no machine differs."""
    return sum(source.random() for _ in range(12)) - 6.0


def plan(start: Point, goal: Point) -> list[Point]:
    """A shortest way over the grid (A*), ending at the goal itself."""

    def cell(p: Point) -> tuple[int, int]:
        return round(p[0] / CELL), round(p[1] / CELL)

    def place(c: tuple[int, int]) -> Point:
        return c[0] * CELL, c[1] * CELL

    begin, end = cell(start), cell(goal)
    cost = {begin: 0.0}
    came: dict[tuple[int, int], tuple[int, int]] = {}
    queue = [(0.0, begin)]
    closed: set[tuple[int, int]] = set()
    while queue:
        _, here = heapq.heappop(queue)
        if here == end:
            break
        if here in closed:
            continue
        closed.add(here)
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                near = (here[0] + dx, here[1] + dy)
                if near in closed or (near != end and not accessible(place(near))):
                    continue
                way = cost[here] + (1.4142 if dx and dy else 1.0)
                if way < cost.get(near, math.inf):
                    cost[near], came[near] = way, here
                    rest = max(abs(near[0] - end[0]), abs(near[1] - end[1]))
                    heapq.heappush(queue, (way + rest, near))
    way_back = [end]
    while way_back[-1] != begin:
        way_back.append(came[way_back[-1]])
    return [*(place(c) for c in reversed(way_back[1:])), goal]


@dataclass
class Robot:
    """The true state, and the error of its estimate (which localisation never knows)."""

    x: float
    y: float
    heading: float
    speed: float = 0.0
    error_x: float = 0.0
    error_y: float = 0.0

    def estimate(self) -> Point:
        return self.x + self.error_x, self.y + self.error_y

    def step(self, wanted_speed: float, wanted_turn: float, source: random.Random) -> None:
        change = max(-BRAKING * STEP, min(ACCELERATION * STEP, wanted_speed - self.speed))
        self.speed += change
        slip = 1.0 + 0.01 * noise(source)
        turn = max(-MAX_TURN, min(MAX_TURN, wanted_turn)) * (1.0 + 0.02 * noise(source))
        self.heading += turn * STEP
        self.x += self.speed * slip * math.cos(self.heading) * STEP
        self.y += self.speed * slip * math.sin(self.heading) * STEP
        # The estimate's error wanders and is pulled back by the laser scans: some 8 mm in the long run.
        self.error_x = 0.98 * self.error_x + 0.0016 * noise(source)
        self.error_y = 0.98 * self.error_y + 0.0016 * noise(source)


def drive(robot: Robot, goal: Point, source: random.Random) -> tuple[float, list[Point]]:
    """Drive until the estimate is near enough and the robot stands; the time, and its last second of reports."""
    way = plan((robot.x, robot.y), goal)
    time = 0.0
    reports: list[Point] = []
    arrived_at: float | None = None
    while arrived_at is None or time < arrived_at + 1.0 or robot.speed > 0.0:
        if time > TIME_LIMIT:
            break
        x, y = robot.estimate()
        left = math.hypot(goal[0] - x, goal[1] - y)
        while len(way) > 1 and math.hypot(way[0][0] - x, way[0][1] - y) < 0.5:
            way.pop(0)
        if arrived_at is None and left <= AIM:
            arrived_at, reports = time, []
        if arrived_at is not None:
            robot.step(0.0, 0.0, source)
            reports.append(robot.estimate())
        else:
            bearing = math.atan2(way[0][1] - y, way[0][0] - x) - robot.heading
            bearing = math.atan2(math.sin(bearing), math.cos(bearing))
            # Turn on the spot towards what lies behind; slow down so that braking ends within the tolerance.
            speed = 0.0 if abs(bearing) > 0.6 else min(MAX_SPEED, 0.12 + 0.7 * max(0.0, left - AIM))
            robot.step(speed, 2.0 * bearing, source)
        time += STEP
    return time, reports[-round(1.0 / STEP) :]


def main() -> None:
    source = random.Random(SEED)
    columns = ("run", "goal_x", "goal_y", "x", "y", "reported_min_x", "reported_max_x", "reported_min_y",
               "reported_max_y", "after_x", "after_y", "seconds")  # fmt: skip
    sys.stdout.write(",".join(columns) + "\n")
    robot = Robot(*START, heading=0.0)
    for run in range(1, RUNS + 1):
        goal = random_goal(source)
        seconds, reports = drive(robot, goal, source)
        x, y = robot.x, robot.y
        for _ in range(round(INSPECTION / STEP)):
            robot.step(0.0, 0.0, source)
            # Standing still on smooth concrete: the wheels creep by hundredths of a millimetre.
            robot.x += 0.00002 * noise(source)
            robot.y += 0.00002 * noise(source)
        box = (min(p[0] for p in reports), max(p[0] for p in reports),
               min(p[1] for p in reports), max(p[1] for p in reports))  # fmt: skip
        numbers = (*goal, x, y, *box, robot.x, robot.y)
        cells = (f"{goal[0]:.2f}", f"{goal[1]:.2f}", *(f"{v:.4f}" for v in numbers[2:]), f"{seconds:.2f}")
        sys.stdout.write(f"{run},{','.join(cells)}\n")


if __name__ == "__main__":
    main()

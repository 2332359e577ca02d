"""A rover drives past a rock to its goal: a headless world in two dimensions, with a seed and a scenario.

`world.py TRACE --seed 1 --speed 0.8 …` writes the rover's clearance from the rock (metres) as a trace of JSON lines.
`--planted` gives the rover a fault: its controller takes the time since a rock was measured for zero.
"""

import argparse
import json
import math
import random
from pathlib import Path

STEP = 0.05  # seconds of a step of the world
BODY, ROCK, MARGIN = 0.3, 0.4, 0.5  # radii of rover and rock, and the clearance that the controller keeps, in metres
GOAL = (12.0, 0.0)
TURN = 1.2  # the greatest rate of turn, in radians a second


def drive(seed, speed, offset, slip, latency, drift, planted=False):
    """(time, clearance) at each quarter of a second: the rover drives at `speed` (m/s) towards its goal, the rock lies
    `offset` metres beside the line to it, a part `slip` of each turn is lost, the rock is seen `latency` seconds late,
    and the ground moves the rover sideways by `drift` m/s."""
    noise, x, y, heading, seen, aside = random.Random(seed), 0.0, 0.0, 0.0, [], 0.0
    rock = (6.0, offset)
    for n in range(int(60 / STEP)):
        clearance = math.dist((x, y), rock) - BODY - ROCK
        if n % round(0.25 / STEP) == 0:
            yield n * STEP, clearance
        if math.dist((x, y), GOAL) < 0.5 or x > GOAL[0]:
            return
        seen.append((x, y))
        then = seen[max(0, n - round(latency / STEP))]
        ahead, beside = rock[0] - then[0], rock[1] - then[1] + noise.gauss(0, 0.01)
        # where the rock is now, seen from the rover: the controller allows for what it drove since
        ahead -= 0.0 if planted else (x - then[0])
        beside -= 0.0 if planted else (y - then[1])
        wanted = math.atan2(GOAL[1] - y, GOAL[0] - x)
        room = BODY + ROCK + MARGIN
        if -0.2 < ahead < 3.0 and (aside or abs(beside) < room) and aside * beside > -room:
            aside = aside or (-1.0 if beside > 0 else 1.0)  # the side on which it passes is chosen once
            wanted = aside * math.atan2(room + aside * beside, max(ahead - room / 2, 0.2)) * 1.3
        turn = max(-TURN, min(TURN, 3.0 * (wanted - heading)))
        heading += turn * (1 - slip) * STEP
        x += speed * math.cos(heading) * STEP
        y += (speed * math.sin(heading) + drift) * STEP


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("trace")
    parser.add_argument("--seed", type=int, default=0)
    for name in ("speed", "offset", "slip", "latency", "drift"):
        parser.add_argument(f"--{name}", type=float, required=True)
    parser.add_argument("--planted", action="store_true")
    given = vars(parser.parse_args())
    with Path(given.pop("trace")).open("w") as trace:
        print(json.dumps({"topic": "speed", "time": 0.0, "data": given["speed"]}), file=trace)
        for time, clearance in drive(**given):
            print(json.dumps({"topic": "clearance", "time": round(time, 3), "data": round(clearance, 4)}), file=trace)


if __name__ == "__main__":
    main()

"""Long missions of the remote inspection rover that break nothing: messages of every node, as many as are wanted."""

from __future__ import annotations

import csv
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

WAYPOINTS = Path(__file__).parents[2] / "contracts/remote_inspection/models/waypoints.csv"
Event = dict[str, Any]


def places() -> list[tuple[float, float]]:
    with WAYPOINTS.open(newline="", encoding="utf-8") as file:
        return [(float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]


def mission(count: int, seed: int = 1) -> Iterator[Event]:
    """So many events: at each waypoint the robot looks around for as long as it takes, then drives on; at the end it
    leaves by the door and waits there. The radiation is dangerous at times once it leaves."""
    rng = random.Random(seed)
    known = places()
    done = 0
    clock = 0.0
    phase = "exploring"
    emitted = 0

    def event(topic: str, **fields: Any) -> Event:
        nonlocal clock, emitted
        clock = round(clock + rng.choice((0.0, 0.01, 0.02)), 3)
        emitted += 1
        return {"topic": topic, "time": clock, **fields}

    def sense(danger: bool) -> Iterator[Event]:
        reading = round(rng.uniform(3, 320 if danger else 119.9), 3)
        yield event("r", radiation=reading)
        yield event("radiationStatus", level="green" if reading < 120 else "orange" if reading < 250 else "red")

    def report(x: float, y: float) -> Iterator[Event]:
        yield event("position", posX=x, posY=y)
        yield event("at", posX=x, posY=y)

    def command(word: str, x: float, y: float, to: int) -> Iterator[Event]:
        yield event("command", command=word, posX=x, posY=y, id=to)
        yield event("phase", phase=phase)

    def drive(to: int) -> Iterator[Event]:
        """Commanded at once to have arrived: the contract's navigation has no way in between."""
        yield from command("move", *known[to], to)
        yield from report(*known[to])

    share = count // (len(known) + 1)
    yield from sense(False)
    while emitted < count:
        if phase == "leaving":
            yield from sense(True)
            yield from command("move", *known[0], 0)
            yield from report(*known[0])
            continue
        yield from drive(done)
        yield from sense(False)
        yield from command("inspect", 0.0, 0.0, done)
        yield event("inspected", id=done)
        yield from report(*known[done])
        until = share * (done + 1)
        done += 1
        following = done if done < len(known) else 0
        phase = "leaving" if done == len(known) else phase
        while emitted < until and phase == "exploring":
            yield from sense(False)
            yield from command("move", *known[following], following)
        if phase == "leaving":
            yield from command("move", *known[0], 0)

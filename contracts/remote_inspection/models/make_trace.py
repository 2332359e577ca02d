"""Writes ../traces/nominal.jsonl: a plausible run of the repaired system, in ROSMonitoring's shape.

    python make_trace.py            # writes the file
    python make_trace.py --print    # to standard output

The robot inspects waypoint after waypoint, meets dangerous radiation at the seventh, and goes back to the door. Only
the readings and the times are random; the seed is fixed, so that the file can be made again byte for byte.
"""

from __future__ import annotations

import csv
import json
import random
import sys
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path

HERE = Path(__file__).parent
DANGER_AT = 7
SEED = 2026


def waypoints() -> list[tuple[int, float, float]]:
    with (HERE / "waypoints.csv").open(newline="", encoding="utf-8") as file:
        return [(int(row["id"]), float(row["x"]), float(row["y"])) for row in csv.DictReader(file)]


def status(reading: Decimal) -> str:
    if reading < 120:
        return "green"
    return "orange" if reading < 250 else "red"


def events(seed: int = SEED) -> Iterator[dict[str, object]]:
    rng = random.Random(seed)
    places = {number: (x, y) for number, x, y in waypoints()}
    clock = Decimal("10.0")

    def event(topic: str, **fields: object) -> dict[str, object]:
        nonlocal clock
        clock += Decimal(rng.randrange(5, 40)) / 100
        return {"topic": topic, "time": float(clock), **fields}

    def reading(low: int, high: int) -> Decimal:
        return Decimal(rng.randrange(low * 10, high * 10)) / 10

    def sense(at: int, low: int = 3, high: int = 119) -> Iterator[dict[str, object]]:
        x, y = places[at]
        yield event("position", posX=x, posY=y)
        value = reading(low, high)
        yield event("r", radiation=float(value))
        yield event("radiationStatus", level=status(value))

    def move(to: int) -> Iterator[dict[str, object]]:
        x, y = places[to]
        yield event("command", command="move", posX=x, posY=y, id=to)
        yield event("at", posX=x, posY=y)
        yield event("wayPNow", posX=x, posY=y, id=to)

    yield from move(0)
    for at in range(DANGER_AT + 1):
        if at == DANGER_AT:
            yield from sense(at, 251, 320)
            break
        yield from sense(at)
        yield event("command", command="inspect", posX=0.0, posY=0.0, id=at)
        yield event("phase", phase="exploring")
        yield event("inspected", id=at)
        x, y = places[at]
        yield event("at", posX=x, posY=y)
        yield from sense(at)
        yield from move(at + 1)
        yield event("phase", phase="exploring")
    # What it carries of the seventh waypoint's dust still shows at the door, and then wears off.
    for low, high in ((121, 240), (3, 119)):
        yield from move(0)
        yield event("phase", phase="leaving")
        yield from sense(0, low, high)


def text() -> str:
    return "".join(json.dumps(event) + "\n" for event in events())


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(text())
    else:
        (HERE.parent / "traces" / "nominal.jsonl").write_text(text(), encoding="utf-8")

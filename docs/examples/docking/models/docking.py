"""The docking controller. A record comes as a tuple, its items in the order of the type."""

REACH, CREEP = 0.125, 0.25


def step(pose, dock, scan):
    nearest = min(scan)
    there = all(abs(a - b) <= REACH for a, b in zip(pose[:2], dock[:2], strict=True))
    speed = 0 if there or nearest < REACH else CREEP
    return {"nearest": nearest, "beam": scan.index(nearest), "speed": speed}

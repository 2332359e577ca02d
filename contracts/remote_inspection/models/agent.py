"""The agent node's decision, as a function of its inputs: a subject for property-based tests.

`wayP` relates places to waypoints, `at` holds of the places where the robot is, `inspected` of the waypoints done.
"""

EXIT = 0


def decide(wayP, at, radiationStatus, inspected, phase):  # noqa: N803 - the names are the contract's
    if radiationStatus in ("red", "orange") or phase == "leaving":
        return {"command": ("move", *place(wayP, EXIT)), "phase": "leaving"}
    here = next((i for x, y, i in wayP.points() if at(x, y)), None)
    if here is None:
        return {"command": ("move", *place(wayP, EXIT)), "phase": "exploring"}
    if not inspected(here):
        return {"command": ("inspect", here), "phase": "exploring"}
    following = place(wayP, here + 1)
    if following is None:
        return {"command": ("move", *place(wayP, EXIT)), "phase": "leaving"}
    return {"command": ("move", *following), "phase": "exploring"}


def place(wayP, waypoint):  # noqa: N803
    """Where a waypoint is; None where the map does not have it."""
    return next(((x, y) for x, y, i in wayP.points() if i == waypoint), None)

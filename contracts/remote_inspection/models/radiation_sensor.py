"""The radiation sensor node's decision, as a function of its inputs: a subject for property-based tests.

Inputs come by name, as plain Python: a REAL is a Fraction, a command is ("move", x, y) or ("inspect", i), and `before`
is the table of the waypoints inspected so far.
"""


def step(r, command, before):
    inspected = set(before.points())
    if command[0] == "inspect":
        inspected.add(command[1])
    if r < 120:
        status = "green"
    elif r < 250:
        status = "orange"
    else:
        status = "red"
    return {"radiationStatus": status, "inspected": inspected}

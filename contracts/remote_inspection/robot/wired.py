"""Which topics each node hears and says, and how messages become the inputs of its `step`; of all but the agent."""

import csv
import math
from pathlib import Path

from nodes.localisation import Localisation
from nodes.navigation import Navigation
from nodes.radiation_sensor import RadiationSensor

HERE = Path(__file__).parent
TYPE = "gazebo_radiation_plugins/Snapshot"
"""What every topic carries, as in the paper: a topic uses the fields that it needs."""
DEFINITION = (HERE / "msg/gazebo_radiation_plugins/msg/Snapshot.msg").read_text(encoding="utf-8")

FIELDS = {
    "sensors": ("posX", "posY"),
    "position": ("posX", "posY"),
    "velocity": ("posX", "posY"),
    "at": ("posX", "posY"),
    "r": ("radiation",),
    "radiationStatus": ("level",),
    "inspected": ("id",),
    "command": ("command", "posX", "posY", "id"),
    "phase": ("phase",),
}


def waypoints():
    with (HERE / "models/waypoints.csv").open(newline="", encoding="utf-8") as file:
        return {int(row["id"]): (float(row["x"]), float(row["y"])) for row in csv.DictReader(file)}


PLACES = waypoints()
DOOR = PLACES[0]


def decoded(topic, message):
    """A message as the value of a port."""
    values = tuple(message[field] for field in FIELDS[topic])
    if topic == "command":
        word, x, y, number = values
        return ("inspect", number) if word == "inspect" else ("move", x, y)
    return values[0] if len(values) == 1 else values


def encoded(topic, value):
    """A port's value as a message."""
    if topic == "command":
        if value[0] == "inspect":
            return {"command": "inspect", "posX": 0.0, "posY": 0.0, "id": value[1]}
        near = min(PLACES, key=lambda number: math.dist(PLACES[number], value[1:]))
        return {"command": "move", "posX": value[1], "posY": value[2], "id": near}
    values = value if isinstance(value, tuple) else (value,)
    return dict(zip(FIELDS[topic], values, strict=True))


class Wired:
    """A node on a bus: it steps at messages of `wakes`, with the latest of all that it hears, once it has heard all
    that it `needs`; what its step gives is said, unless it is None."""

    def __init__(self, bus, node, hears, wakes, says, needs=(), first=()):
        self.bus, self.node, self.says, self.needs = bus, node, says, needs
        self.latest = dict.fromkeys(hears) | dict(first)
        for topic in says:
            bus.announce(topic)
        for topic in hears:
            bus.hear(topic, lambda message, topic=topic: self.heard(topic, message, topic in wakes))

    def heard(self, topic, message, wakes):
        self.latest[topic] = decoded(topic, message)
        if wakes and all(self.latest[need] is not None for need in self.needs):
            outputs = self.node.step(**self.latest)
            for port in self.says:
                if outputs.get(port) is not None:
                    self.bus.say(port, encoded(port, outputs[port]))


def localisation(bus, params):
    return Wired(bus, Localisation(params), ["sensors"], ["sensors"], ["position"])


def navigation(bus, params):
    node = Navigation(params)
    return Wired(bus, node, ["position", "command"], ["position"], ["at", "velocity"], ["command"])


def radiation_sensor(bus, params):
    node = RadiationSensor(params)
    first = {"command": ("move", *DOOR)}  # as the plan says: what stands before the agent's first command
    return Wired(bus, node, ["r", "command"], ["r"], ["inspected", "radiationStatus"], ["r"], first)

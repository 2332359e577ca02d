"""The robot: what each node is made with, the agent among them, and the world on the same bus."""

from nodes.agent import Agent
from wired import (
    DEFINITION,
    DOOR,
    FIELDS,
    HERE,
    PLACES,
    TYPE,
    Wired,
    decoded,
    encoded,
    localisation,
    navigation,
    radiation_sensor,
)
from world import World

__all__ = ["DEFINITION", "FIELDS", "NODES", "PARAMETERS", "PLACES", "TYPE", "Simulation"]

PARAMETERS = {
    "world": {
        "start": DOOR,
        "sources": [(*PLACES[7], 400.0)],
        "estimate_noise": 0.01,
        "seed": 7,
    },
    "localisation": {"noise": 0.05},
    "navigation": {"aim": 0.1, "speed": 1.0},
    "radiationSensor": {"orange": 120, "red": 250, "dwell": 5},
    "agent": {"program": str(HERE.parent / "models/agent.gwen")},
}


def agent(bus, params):
    node = Agent(params)
    wakes = ["at", "radiationStatus", "inspected"]
    return Wired(bus, node, wakes, wakes, ["command", "phase"])


NODES = {
    "localisation": localisation,
    "navigation": navigation,
    "radiationSensor": radiation_sensor,
    "agent": agent,
}


class Simulation:
    """The world on a bus: moves by the velocity that it hears, and says what the sensors would."""

    def __init__(self, bus, dt, params=PARAMETERS):
        self.bus, self.dt = bus, dt
        self.world = World(params["world"])
        self.velocity = (0.0, 0.0)
        for topic in ("sensors", "r"):
            bus.announce(topic)
        bus.hear("velocity", self.heard)

    def heard(self, message):
        self.velocity = decoded("velocity", message)

    def tick(self):
        for port, value in self.world.step(self.velocity, self.dt).items():
            self.bus.say(port, encoded(port, value))

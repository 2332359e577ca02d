"""Localisation: where the robot is, from an estimate that trembles."""

import math


class Localisation:
    """Holds its position while the robot stands and the estimate moves by no more than noise can."""

    def __init__(self, params):
        self.noise = params["noise"]
        self.held = None

    def step(self, sensors):
        x, y = sensors
        if not (math.isfinite(x) and math.isfinite(y)):
            return {
                "position": self.held
            }  # what is no number is no estimate; before the first one there is no position
        if self.held is None or math.hypot(x - self.held[0], y - self.held[1]) > self.noise:
            self.held = (x, y)
        return {"position": self.held}

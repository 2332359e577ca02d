"""The simulated world: where the rover truly is, and how strong the radiation is there."""

import math
import random


class World:
    """`params`: start, sources of radiation (x, y, strength), noise of the estimate, seed."""

    def __init__(self, params):
        self.x, self.y = params["start"]
        self.sources = params["sources"]
        self.noise = params["estimate_noise"]
        self.rng = random.Random(params["seed"])

    def step(self, velocity, dt):
        self.x += velocity[0] * dt
        self.y += velocity[1] * dt
        estimate = tuple(round(v + self.rng.uniform(-self.noise, self.noise), 4) for v in (self.x, self.y))
        return {"sensors": estimate, "r": round(self.radiation(), 3)}

    def radiation(self):
        """Falls off with the square of the distance, above a background of 8 with noise."""
        level = 8.0 + self.rng.uniform(0.0, 4.0)
        for x, y, strength in self.sources:
            level += strength / (1.0 + 4.0 * math.dist((x, y), (self.x, self.y)) ** 2)
        return level

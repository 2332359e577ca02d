"""The speed governor, as the robot runs it."""


class Governor:
    """How fast the robot may drive, from the nearest thing that the scan shows and the speed that is wanted."""

    def __init__(self, params):
        self.stop = params["stop_distance"]
        self.slow = params["slow_distance"]
        self.creep = params["creep_speed"]

    def step(self, nearest, wanted):
        if nearest < self.stop:
            return 0.0
        if nearest < self.slow:
            return min(wanted, self.creep)
        return wanted

"""The radiation sensor: what a reading means, and which waypoints have been inspected."""


class RadiationSensor:
    """An inspection takes some readings; `inspected` is the waypoint of one that has just ended, or None."""

    def __init__(self, params):
        self.orange, self.red, self.dwell = params["orange"], params["red"], params["dwell"]
        self.done = set()
        self.readings = 0

    def step(self, r, command):
        inspected = None
        self.readings = self.readings + 1 if command[0] == "inspect" else 0
        if self.readings >= self.dwell and command[1] not in self.done:
            inspected = command[1]
            self.done.add(inspected)
        if r < self.orange:
            status = "green"
        elif r < self.red:
            status = "orange"
        else:
            status = "red"
        return {"radiationStatus": status, "inspected": inspected}

class Guard:
    def step(self, contrast: float) -> dict[str, object]:
        return {"outside": contrast < 25}


class Planner:
    def __init__(self) -> None:
        self.cruising = 150.0

    def step(self, near: bool, outside: bool) -> dict[str, object]:
        stop = near or outside
        return {"stop": stop, "speed": 0.0 if stop else self.cruising}

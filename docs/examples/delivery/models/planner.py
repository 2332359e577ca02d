class Guard:
    def step(self, contrast: float) -> dict[str, object]:
        return {"outside": contrast < 0.25}


class Planner:
    def step(self, seen: bool, outside: bool) -> dict[str, object]:
        return {"stop": seen or outside}

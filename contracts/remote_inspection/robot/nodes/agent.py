"""The agent: a Gwendolen program, interpreted. It is told what is perceived, and says what it does next.

An action of the program ends when the world shows that it has: a move by `at`, an inspection by `inspected`. Until then
the program waits; danger is perceived at once.
"""

from avow.backends.ajpf.live import Running


class Agent:
    """`command` and `phase` are said when the program acts; else they are None."""

    def __init__(self, params):
        self.mind = Running(params["program"])
        self.blind = params.get("blind", ())  # levels that it does not perceive
        self.goal = None
        self.inspecting = None

    def step(self, at, radiationStatus, inspected):  # noqa: N803 - the contract's names
        percepts = []
        if radiationStatus in ("orange", "red") and radiationStatus not in self.blind:
            percepts.append(f"danger_{radiationStatus}")
        if at is not None and at == self.goal:
            percepts.append("movebase_result(0, 3)")
        if self.inspecting is not None and inspected != self.inspecting:
            return {"command": None, "phase": None}  # the inspection is not over
        self.inspecting = None
        action = self.mind.perceive(percepts)
        if action is None:
            return {"command": None, "phase": None}
        name, arguments = action
        if name == "inspect":
            self.inspecting = int(arguments[0])
            command = ("inspect", self.inspecting)
        else:
            self.goal = (float(arguments[1]), float(arguments[2]))
            command = ("move", *self.goal)
        leaving = self.mind.believes("going(0)")
        return {"command": command, "phase": "leaving" if leaving else "exploring"}

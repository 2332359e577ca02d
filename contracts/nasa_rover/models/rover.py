"""The rover's components as they run: inputs by name, outputs as a dictionary. The map comes as tables over cells."""

from collections import deque
from fractions import Fraction

USE = Fraction(3, 100)
PACE = Fraction(36, 10)
MARGIN = Fraction(95, 100)


def goal_reasoning(position, charger, points, count, recharge, atGoal, last, visited):  # noqa: N803 - ports' names
    """The next heat point, or the charging station."""
    reached = atGoal and visited < count and last == points(visited)
    done = visited + 1 if reached else visited
    goal = charger if recharge or done >= count else points(done)
    return {"start": position, "goal": goal, "done": done}


def plan_to_charging(start, charger, free, step):
    """A shortest way to the charging station."""
    plan = shortest_plan(start, charger, free, step)
    return {"planC": table(plan), "lengthC": len(plan) - 1}


def plan_to_destination(start, goal, free, step):
    """A shortest way to the destination."""
    plan = shortest_plan(start, goal, free, step)
    return {"planD": table(plan), "lengthD": len(plan) - 1}


def battery_monitor(charge):
    return MARGIN * charge


def interface(planC, lengthC, planD, lengthD, battery):  # noqa: N803 - ports' names
    """When to recharge, and where to move."""
    recharge = battery <= (lengthC + 2) * USE or (lengthC == 0 and battery < MARGIN)
    plan, length = (planC, lengthC) if recharge else (planD, lengthD)
    return {"movement": plan(1 if length > 0 else 0), "recharge": recharge, "atGoal": lengthD == 0}


def hardware(movement, place, energy, charger):
    """The worst that the contract allows: every step costs all that it may."""
    position = movement if energy >= USE else place
    charge = Fraction(1) if position == charger else max(energy - USE, Fraction(0))
    return {"position": position, "charge": charge, "speed": Fraction(0) if position == place else PACE}


def shortest_plan(start, goal, free, step):
    """Breadth-first search: the cells from start to goal, both included; start alone where there is no way."""
    following = {}
    for a, b in sorted(step.points()):
        if free(b):
            following.setdefault(a, []).append(b)
    before = {start: None}
    queue = deque([start])
    while queue:
        cell = queue.popleft()
        if cell == goal:
            plan = [cell]
            while before[plan[-1]] is not None:
                plan.append(before[plan[-1]])
            return plan[::-1]
        for other in following.get(cell, ()):
            if other not in before:
                before[other] = cell
                queue.append(other)
    return [start]


def table(plan):
    """A plan as the function that the contract speaks of."""
    return {**dict(enumerate(plan)), ...: plan[-1]}

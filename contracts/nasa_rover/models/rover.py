"""The rover's components as they run: inputs by name, outputs as a dictionary. Maps come as functions of cells."""

from collections import deque
from fractions import Fraction

USE = Fraction(3, 100)
MARGIN = Fraction(95, 100)


def goal_reasoning(position, charger, free, heat, recharge, atGoal, goals, last):
    remaining = [c for c in goals.points() if goals(c) and not (atGoal and c == last)]
    goal = charger if recharge or not remaining else max(remaining, key=heat)
    return {"start": position, "goal": goal, "remaining": lambda c: c in remaining}


def battery_monitor(charge):
    return MARGIN * charge


def interface(planC, lengthC, planD, lengthD, battery, position, charger):
    recharge = battery <= (lengthC + 2) * USE or (position == charger and battery < MARGIN)
    plan, length = (planC, lengthC) if recharge else (planD, lengthD)
    return {
        "movement": plan(1) if length > 0 else position,
        "recharge": recharge,
        "atGoal": lengthD == 0,
    }


def hardware(movement, place, energy, charger, free, step):
    return {"position": movement, "charge": 1 if movement == charger else energy - USE}


def shortest_plan(start, goal, step, cells):
    """Breadth-first search: the cells from start to goal, both included; None where there is no way."""
    before = {start: None}
    queue = deque([start])
    while queue:
        cell = queue.popleft()
        if cell == goal:
            plan = [cell]
            while before[plan[-1]] is not None:
                plan.append(before[plan[-1]])
            return plan[::-1]
        for other in cells:
            if step(cell, other) and other not in before:
                before[other] = cell
                queue.append(other)
    return None

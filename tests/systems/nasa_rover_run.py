"""The NASA rover's components run together on its 4 × 4 grid, wired as the plan says."""

from __future__ import annotations

import csv
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.formulas.values import FunctionValue

FOLDER = Path(__file__).parents[2] / "contracts" / "nasa_rover"
CHARGER = 0
USE = Fraction(3, 100)


def rows(name: str) -> list[tuple[int, ...]]:
    with (FOLDER / "models" / f"{name}.csv").open(encoding="utf-8") as file:
        return [tuple(int(cell) for cell in row.values()) for row in csv.DictReader(file)]


FREE = [row[0] for row in rows("free")]
STEPS = rows("steps")
AWAY = {(a, b): moves for a, b, moves in rows("away")}
WAYS = {(a, b, k): cell for a, b, k, cell in rows("ways")}


def rover() -> Any:
    spec = importlib.util.spec_from_file_location("nasa_rover_models", FOLDER / "models" / "rover.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


FREE_TABLE = FunctionValue(dict.fromkeys(((c,) for c in FREE), True), False)
STEP_TABLE = FunctionValue(dict.fromkeys(STEPS, True), False)

Interface = Callable[..., dict[str, Any]]


def published(planC: Any, lengthC: int, planD: Any, lengthD: int, battery: Fraction) -> dict[str, Any]:  # noqa: N803
    """The interface with R1.4 as published."""
    recharge = Fraction(95, 100) * battery <= lengthC * USE or (lengthC == 0 and battery < Fraction(95, 100))
    plan, length = (planC, lengthC) if recharge else (planD, lengthD)
    return {"movement": plan(1 if length > 0 else 0), "recharge": recharge, "atGoal": lengthD == 0}


def run(mission: Sequence[int], interface: Interface, length: int) -> list[dict[str, dict[str, Any]]]:
    """Each step's inputs and outputs, by node; up to a step after which the battery is empty."""
    models = rover()
    free, step = function(FREE_TABLE), function(STEP_TABLE)
    points = _function(dict(enumerate(mission)), CHARGER)
    position, charge, recharge, at_goal, last, visited = CHARGER, Fraction(1), False, False, CHARGER, 0
    found: list[dict[str, dict[str, Any]]] = []
    for _ in range(length):
        gra_in = {"position": position, "charger": CHARGER, "points": points, "count": len(mission)}
        gra_in |= {"recharge": recharge, "atGoal": at_goal, "last": last, "visited": visited}
        gra = models.goal_reasoning(**gra_in)
        charging = models.plan_to_charging(gra["start"], CHARGER, free, step)
        destination = models.plan_to_destination(gra["start"], gra["goal"], free, step)
        battery = models.battery_monitor(charge)
        plan_c, plan_d = planned(charging["planC"]), planned(destination["planD"])
        told = interface(plan_c, charging["lengthC"], plan_d, destination["lengthD"], battery)
        hardware_in = {"movement": told["movement"], "place": position, "energy": charge, "charger": CHARGER}
        moved = models.hardware(**hardware_in)
        found.append(
            {
                "GRA": gra_in | gra,
                "ComputePlan2Charging": {"start": gra["start"], "charger": CHARGER, **charging, "planC": plan_c},
                "ComputePlan2Destination": {"start": gra["start"], "goal": gra["goal"], **destination, "planD": plan_d},
                "BatteryMonitor": {"charge": charge, "battery": battery},
                "Interface": {"planC": plan_c, "lengthC": charging["lengthC"], "planD": plan_d}
                | {"lengthD": destination["lengthD"], "battery": battery}
                | told,
                "Hardware": hardware_in | moved,
            }
        )
        position, charge = moved["position"], moved["charge"]
        recharge, at_goal, last, visited = told["recharge"], told["atGoal"], gra["goal"], gra["done"]
        if charge <= 0:
            break
    return found


class _Function:
    def __init__(self, table: Mapping[tuple[int, ...], Any], default: Any) -> None:
        self.value = FunctionValue(dict(table), default)

    def __call__(self, *point: int) -> Any:
        return self.value.table.get(point, self.value.default)

    def points(self) -> list[tuple[int, ...]]:
        return list(self.value.table)


def function(value: FunctionValue) -> _Function:
    return _Function(value.table, value.default)


def _function(table: Mapping[int, Any], default: Any) -> _Function:
    return _Function({(k,): v for k, v in table.items()}, default)


def planned(answer: Mapping[Any, Any]) -> _Function:
    return _function({k: v for k, v in answer.items() if k is not ...}, answer[...])


def as_value(value: Any) -> Any:
    """A port's value as the evaluator wants it."""
    return value.value if isinstance(value, _Function) else value

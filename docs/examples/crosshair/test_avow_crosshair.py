"""The suite that every backend has to pass, on this one: ``pytest test_avow_crosshair.py``."""

import pytest

pytest.importorskip("crosshair", reason="crosshair is not here: pip install crosshair-tool")

from avow_crosshair import BACKEND

from avow.base.verdict import Verdict
from avow.conformance import Conformance, Seeded

CONTRACT = """
node sensor {
  inputs( r : REAL ) outputs( high : BOOL ) topics()
  guarantee warns ( in.r > 120 -> out.high )
  guarantee calm ( in.r < 10 -> not out.high )
}
"""
STEP = """
class Sensor:
    def __init__(self, params):
        self.limit = params["limit"]

    def step(self, r):
        return r > self.limit
"""
DECLARED = {"source": {"python": "sensor.py", "class": "Sensor", "parameters": "sensor.yaml"}}


class TestCrossHair(Conformance):
    backend = BACKEND
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"iterations": 20},
            {"warns": Verdict.CHECKED, "calm": Verdict.CHECKED},
            {"sensor.py": STEP, "sensor.yaml": "limit: 100.0\n"},
            declared=DECLARED,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"iterations": 20},
            {"warns": Verdict.REFUTED, "calm": Verdict.CHECKED},
            {"sensor.py": STEP, "sensor.yaml": "limit: 130.0\n"},
            declared=DECLARED,
        ),
    )

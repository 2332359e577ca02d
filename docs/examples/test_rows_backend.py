"""The suite that every backend has to pass, on this one: ``pytest test_rows_backend.py``."""

from rows_backend import BACKEND

from avow.base.verdict import Verdict
from avow.conformance import Conformance, Seeded

CONTRACT = """
node sensor {
  inputs( r : REAL ) outputs( high : BOOL ) topics()
  guarantee warns ( in.r > 120 -> out.high )
  guarantee calm ( in.r < 10 -> not out.high )
}
"""
HEAD = "in.r,out.high\n"


class TestRows(Conformance):
    backend = BACKEND
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"answers": "answers.csv"},
            {"warns": Verdict.TESTED, "calm": Verdict.TESTED},
            {"answers.csv": HEAD + "5,false\n60,true\n125.5,true\n"},
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"answers": "answers.csv"},
            {"warns": Verdict.REFUTED, "calm": Verdict.TESTED},
            {"answers.csv": HEAD + "5,false\n125.5,false\n"},
        ),
    )

"""Faults at thresholds that are calculated, or that lie in functions, sequences and beside relations: each is found."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import some
from hoare.systems import make_job

from avow.backend_kit.programs.samples import written
from avow.backend_kit.protocol import Limits
from avow.backends.hypothesis import BACKEND
from avow.backends.hypothesis.thresholds import thresholds
from avow.base.verdict import Verdict
from avow.conformance.seeded import settle

CONTRACT = """
context {{ Joint = {{shoulder, elbow, wrist}}; Force : Joint --> REAL; Order : {{ spray(NATURAL), rest }};
          Flow = 0.5; Limit = 500.4; Rows : <NATURAL>; Loads : <REAL>; }}
node n {{
  inputs( force : Force, before : REAL, loads : Loads, row : NATURAL, todo : Rows, safe : BOOL )
  outputs( y : BOOL, z : REAL )
  topics()
  {assume}
  guarantee g ( {formula} )
}}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("formula", "assume", "subject"),
    some(
        [
            ("y <=> before < 4 * Flow", "", "before <= 2"),
            ("y <=> (forall(j in Joint | force(j) <= 8))", "", "max(force(j) for j in J) < 8"),
            ("y <=> loads(0) + loads(1) > Limit", "length(loads) == 2", "sum(loads) > 500.5"),
            ("not safe -> y", "row in todo", "not safe and row != 2"),
            ("y <=> length(loads) < 3", "", "len(loads) < 4"),
            ("before - Flow >= 10 -> y", "", "before > 10.5"),
            ("y <=> before * 7 / 3 < Limit", "", "before * 7 / 3 < 501"),
            ("y <=> 30 - 4 * before <= before - 100", "", "before >= 26.1"),
            ("y <=> 3 * row >= 1000", "", "row > 334"),
            ("length(loads) >= 10 <=> y", "", "False"),  # it always says no, and no short sequence shows it
            ("y <=> length(loads) <= 120", "", "len(loads) <= 121"),
            ("length(todo) >= 17 -> y", "", "len(todo) != 34"),
            ("y <=> before >= 0.5", "", "before > 0.5 or before == 0.5 - 2**-54"),  # one unit in the last place
            ("y", "", "before != 31337"),  # of which only the subject speaks
            ("y", "", "row != 4711"),
            ("y", "", "not (len(loads) == 43)"),
            ("y", "", "len(todo) < 40"),  # a long one
            ("y <=> (forall(i in indices(loads) | loads(i) > 0))", "", "all(x > 0 for x in loads[:1081])"),
            ("y <=> (forall(i in indices(loads) | loads(i) > 0))", "", "all(x > 0 for x in loads[-1081:])"),
            ("y", "", "row != 3 * 2**30 + 1"),  # which stands in the program as it is compiled
            ("y", "", "before != 2**53 + 1"),
        ],
        5,
    ),
)
def test_is_refuted(tmp_path: Path, formula: str, assume: str, subject: str) -> None:
    program = (
        "J = ('shoulder', 'elbow', 'wrist')\n"
        f"def f(force, before, loads, row, todo, safe):\n    return {{'y': bool({subject}), 'z': 0}}\n"
    )
    contract = CONTRACT.format(formula=formula, assume=f"assume( {assume} )" if assume else "")
    job = make_job(tmp_path, contract, "n", {"subject": "n.py:f", "cases": 300}, {"n.py": program}, "hypothesis")
    assert not [d for d in BACKEND.check(job) if d.is_error], BACKEND.check(job)

    def refutes(seed: int) -> bool:
        (found,) = settle(BACKEND, job, tmp_path / f"made{seed}", Limits(seconds=60, seed=seed)).outcomes
        return found.verdict is Verdict.REFUTED

    assert any(map(refutes, range(3)))  # each seed draws only some of the numbers at which something may change


def test_a_constant_that_can_also_be_calculated_keeps_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "n.py").write_text("DEFAULT = 10\nSCALE = 1\n")
    found = {float(number) for number in thresholds([], [tmp_path / "n.py"], []).numbers}
    assert {9, 9.999, 10.001, 11, -9, -9.999, -10.001, -11} <= found


def test_calculated_numbers_are_numbers_of_a_program() -> None:
    """Also where classes with callbacks, and translations, are held against their sources."""
    text = "LIM = 5\nclass A:\n    most = 2**10 + 1\ndef f(a=3 * 9):\n    return a > 7 * 6"
    assert {5, 1025, 27, 42} <= {*written(text)}

"""What the plan or the program reads an input as: where that leaves out values of it, the proof says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND
from avow.base.verdict import Verdict
from hoare.systems import make_job

WHOLE = "node n { inputs( k : INTEGER ) outputs( x : INTEGER ) topics() guarantee g ( out.x >= 0 ) }"
PAIR = """
node n { inputs( p : (REAL, REAL) ) outputs( x : REAL ) topics()
  guarantee g ( forall(a, b in REAL | in.p == (a, b) -> out.x == a + b) ) }
"""


@pytest.mark.parametrize(
    ("contract", "program", "variables", "left_out"),
    [
        (WHOLE, "GIVEN k : NATURAL;\nx := k\n", {}, "in.k is k, NATURAL"),
        (WHOLE, "GIVEN m : NATURAL;\nx := m\n", {"in.k": "m"}, "in.k is m, NATURAL"),
        (WHOLE, "GIVEN f : INTEGER --> NATURAL;\nx := f(3)\n", {"in.k": "f(3)"}, "in.k is f(3), NATURAL"),
        (WHOLE, "x := 4\n", {"in.k": "2 * h + 1"}, "in.k is 2 · h + 1"),
        (PAIR, "x := a + b\n", {"in.p": "(a, b)"}, ""),
        (PAIR, "x := a + a\n", {"in.p": "(a, a)"}, "in.p is (a, a)"),
        (PAIR, "GIVEN a, b : INTEGER;\nx := a + b\n", {"in.p": "(a, b)"}, "in.p is (a, b)"),
    ],
)
def test_values_that_a_reading_leaves_out_are_a_hypothesis(
    tmp_path: Path, contract: str, program: str, variables: dict[str, str], left_out: str
) -> None:
    if "h + 1" in str(variables):
        program = "GIVEN h : INTEGER;\n" + program
    options = {"program": "n.imp", **({"variables": variables} if variables else {})}
    job = make_job(tmp_path, contract, "n", options, {"n.imp": program}, "hoare")
    assert not [d for d in BACKEND.check(job) if d.is_error]
    outcome = BACKEND.discharge(job, tmp_path, Limits(seconds=20)).outcomes[0]
    assert outcome.verdict is Verdict.PROVED
    assert [h.split(":")[0] for h in outcome.hypotheses] == ([left_out] if left_out else [])


def test_a_name_in_the_table_is_missed_where_the_table_stands(tmp_path: Path) -> None:
    options = {"program": "n.imp", "variables": {"out.x": "zz + 1"}}
    job = make_job(tmp_path, WHOLE, "n", options, {"n.imp": "y := k\n"}, "hoare")
    (fault,) = BACKEND.check(job)
    assert "`zz`" in fault.message
    assert fault.span is not None
    line = (tmp_path / "plan.yaml").read_text().splitlines()[fault.span.line - 1]
    assert line[fault.span.column - 1 :].startswith('"zz + 1"')

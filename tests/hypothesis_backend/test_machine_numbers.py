"""What rounds, and what is no number, in nodes whose arithmetic is right."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from helpers import some
from hoare.systems import make_job

from avow.backend_kit.protocol import Limits
from avow.backends.hypothesis import BACKEND
from avow.base.verdict import Outcome, Verdict

CONTRACTS = {
    "watchdog": """node n { inputs( now : REAL, last : REAL ) outputs( stop : BOOL ) topics()
      assume ( 0 <= in.last <= in.now )
      guarantee g ( out.stop <=> in.now - in.last > 0.5 ) }""",
    "median": """node n { inputs( a : REAL, b : REAL, c : REAL ) outputs( m : REAL ) topics()
      guarantee g ( (out.m == in.a or out.m == in.b or out.m == in.c)
        and ((in.a <= in.b and in.b <= in.c) -> out.m == in.b) and ((in.b <= in.a and in.a <= in.c) -> out.m == in.a)
        and ((in.c <= in.b and in.b <= in.a) -> out.m == in.b) ) }""",
}
RIGHT = {
    "watchdog": "def f(now, last):\n    return now - last > 0.5\n",
    "median": "def f(a, b, c):\n    return sorted([a, b, c])[1]\n",
}


def settle(folder: Path, node: str, program: str, **options: Any) -> Outcome:
    given = {"subject": "n.py:f", "cases": 300, **options}
    job = make_job(folder, CONTRACTS[node], "n", given, {"n.py": program}, "hypothesis")
    assert not BACKEND.check(job)
    (outcome,) = BACKEND.discharge(job, folder, Limits(seconds=60)).outcomes
    return outcome


SPECIALS = [
    # what rounds: 1 - 0.49999999999999994 is 0.5 in doubles, and more than that in the contract's numbers
    ("watchdog", RIGHT["watchdog"], "float64", Verdict.REFUTED),
    ("watchdog", RIGHT["watchdog"], "exact", Verdict.TESTED),
    ("median", RIGHT["median"], "float64", Verdict.TESTED),
    ("median", "def f(a, b, c):\n    return sorted([int(a) * 0 + a, b, c])[1]\n", "float64", Verdict.TESTED),
    ("median", "def f(a, b, c):\n    return sorted([int(a) * 0 + a, b, c])[1]\n", "float64-with-nan", Verdict.REFUTED),
    (
        "median",
        "import math\ndef f(a, b, c):\n    return 7 if math.copysign(1, a) < 0 and a == 0 else sorted([a, b, c])[1]\n",
        "float64-with-nan",
        Verdict.REFUTED,
    ),
]


@pytest.mark.parametrize(("node", "program", "numbers", "verdict"), some(SPECIALS, 0, slow=2))
def test_machine_numbers(tmp_path: Path, node: str, program: str, numbers: str, verdict: Verdict) -> None:
    outcome = settle(tmp_path, node, program, numbers=numbers)
    assert outcome.verdict is verdict, outcome.summary
    assert "no numbers" in outcome.details or numbers == "exact" or verdict is Verdict.REFUTED  # NaN comes through

"""Right nodes and near misses of them: every near miss is refuted, none of the right ones is."""

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
    "limiter": """node n { inputs( wish : REAL, last : REAL ) outputs( v : REAL ) topics()
      assume ( -2 <= in.last <= 2 )
      guarantee g ( -2 <= out.v <= 2 and out.v - in.last <= 0.25 and in.last - out.v <= 0.25
                    and (-2 <= in.wish <= 2 and -0.25 <= in.wish - in.last <= 0.25 -> out.v == in.wish) ) }""",
    "watchdog": """node n { inputs( now : REAL, last : REAL ) outputs( stop : BOOL ) topics()
      assume ( 0 <= in.last <= in.now )
      guarantee g ( out.stop <=> in.now - in.last > 0.5 ) }""",
    "median": """node n { inputs( a : REAL, b : REAL, c : REAL ) outputs( m : REAL ) topics()
      guarantee g ( (out.m == in.a or out.m == in.b or out.m == in.c)
        and ((in.a <= in.b and in.b <= in.c) -> out.m == in.b) and ((in.b <= in.a and in.a <= in.c) -> out.m == in.a)
        and ((in.c <= in.b and in.b <= in.a) -> out.m == in.b) ) }""",
    "scan": """context { Scan : <REAL>; } node n { inputs( s : Scan ) outputs( near : BOOL, many : BOOL ) topics()
      guarantee g ( (out.near <=> exists(i in NATURAL | i < length(in.s) and in.s(i) < 0.35))
                    and (out.many <=> length(in.s) >= 64) ) }""",
    "count": """node n { inputs( pressed : BOOL, count : NATURAL ) outputs( count : NATURAL, on : BOOL ) topics()
      assume ( in.count <= 5 )
      guarantee g ( (in.pressed and in.count < 5 -> out.count == in.count + 1) and (not in.pressed -> out.count == 0)
                    and out.count <= 5 and (out.on <=> out.count >= 3) ) }""",
}
RIGHT = {
    "limiter": "def f(wish, last):\n    return max(last - D, -2, min(last + D, 2, wish))\n"
    "from fractions import Fraction\nD = Fraction(1, 4)\n",
    "watchdog": "def f(now, last):\n    return now - last > 0.5\n",
    "median": "def f(a, b, c):\n    return sorted([a, b, c])[1]\n",
    "scan": "from fractions import Fraction\nN = Fraction(35, 100)\n"
    "def f(s):\n    return {'near': any(x < N for x in s), 'many': len(s) >= 64}\n",
    "count": "def f(pressed, count):\n    n = min(count + 1, 5) if pressed else 0\n"
    "    return {'count': n, 'on': n >= 3}\n",
}
MUTANTS = [
    ("limiter", "last + D", "last + D + Fraction(1, 10**6)"),
    ("limiter", "last - D", "last - 2 * D"),
    ("limiter", "-2, min", "-3, min"),
    ("limiter", "2, wish", "3, wish"),
    ("limiter", "2, wish", "2, abs(wish)"),
    ("limiter", "2, wish)", "2, wish) if wish != 2 else 1"),
    ("limiter", "2, wish)", "2, wish) if wish < 1000 else last + 1"),
    ("limiter", "2, wish)", "2, wish) if wish != 777 else 777"),
    ("watchdog", "> 0.5", ">= 0.5"),
    ("watchdog", "> 0.5", "> 0.5000001"),
    ("watchdog", "now - last", "now - last * 2"),
    ("watchdog", "now - last > 0.5", "now - last > 0.5 and now < 100000"),
    ("watchdog", "now - last > 0.5", "now - last > 0.5 and last != 0"),
    ("watchdog", "now - last > 0.5", "False"),
    ("watchdog", "now - last > 0.5", "True"),
    ("median", "[1]", "[0]"),
    ("median", "[1]", "[2]"),
    ("median", "sorted([a, b, c])[1]", "b"),
    ("median", "sorted([a, b, c])[1]", "sum([a, b, c]) / 3"),
    ("median", "sorted([a, b, c])[1]", "sorted([a, b, c])[1] if a != b else c"),
    ("scan", "x < N", "x <= N"),
    ("scan", "for x in s", "for x in s[1:]"),
    ("scan", "for x in s", "for x in s[:-1]"),
    ("scan", "for x in s", "for x in s[:20]"),
    ("scan", ">= 64", "> 64"),
    ("scan", ">= 64", ">= 63"),
    ("scan", "len(s) >= 64", "False"),
    ("scan", "len(s) >= 64", "64 <= len(s) < 128"),
    ("count", "count + 1, 5", "count + 1, 6"),
    ("count", "count + 1", "count + 2"),
    ("count", "else 0", "else count"),
    ("count", "n >= 3", "n > 3"),
    ("count", "n >= 3", "n >= 3 and not pressed or n >= 3 and count != 4"),
]


def settle(folder: Path, node: str, program: str, **options: Any) -> Outcome:
    given = {"subject": "n.py:f", "cases": 300, **options}
    job = make_job(folder, CONTRACTS[node], "n", given, {"n.py": program}, "hypothesis")
    assert not BACKEND.check(job)
    (outcome,) = BACKEND.discharge(job, folder, Limits(seconds=60)).outcomes
    return outcome


@pytest.mark.slow
@pytest.mark.parametrize("node", some(RIGHT, 1))
def test_the_right_ones_stand(tmp_path: Path, node: str) -> None:
    outcome = settle(tmp_path, node, RIGHT[node])
    assert outcome.verdict is Verdict.TESTED, outcome.summary


@pytest.mark.slow
@pytest.mark.parametrize(("node", "old", "new"), some(MUTANTS, 4))
def test_every_near_miss_is_refuted(tmp_path: Path, node: str, old: str, new: str) -> None:
    assert old in RIGHT[node]
    outcome = settle(tmp_path, node, RIGHT[node].replace(old, new, 1))
    assert outcome.verdict is Verdict.REFUTED, outcome.summary


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

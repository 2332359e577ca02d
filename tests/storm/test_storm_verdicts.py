"""Verdicts of probabilistic models against enumeration in fractions, and what is refused."""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Limits, Tool
from avow.backends.storm import BACKEND
from avow.base.verdict import Outcome, Verdict
from avow.conformance.seeded import Seeded, settle

pytestmark = pytest.mark.needs_chance

NODE = """context {{ Mode : {{idle, go}}; }}
node n {{
  inputs( p : BOOL, k : NATURAL, m : Mode ) outputs( d : BOOL ) topics()
  {assume}
  guarantee g {clause}
}}
"""
PORTS = {"in.p": "p", "out.d": "d", "in.k": "s", "in.m": {"name": "m", "values": {"idle": 7, "go": 3}}}
Chain = list[list[dict[int, Fraction]]]
"""For each state its choices, each a distribution over states."""


def judged(folder: Path, clause: str, model: str, assume: str = "", **options: Any) -> Outcome:
    text = NODE.format(assume=assume, clause=clause)
    case = Seeded(
        "s", text, {"model": "m.prism", "ports": PORTS, **options}, {"g": Verdict.CHECKED}, {"m.prism": model}
    )
    (outcome,) = settle(BACKEND, case.written(BACKEND, folder), folder / "out", Limits()).outcomes
    return outcome


def prism(chain: Chain, given: list[bool], kept: list[bool]) -> str:
    lines = [
        "mdp" if any(len(choices) > 1 for choices in chain) else "dtmc",
        "module n",
        f"  s : [0..{len(chain)}] init 0;",
    ]
    for state, choices in enumerate(chain):
        for choice in choices:
            next_states = " + ".join(f"{p} : (s'={to})" for to, p in choice.items())
            lines.append(f"  [] s={state} -> {next_states};")
    lines.append("endmodule")
    for name, which in (("p", given), ("d", kept)):
        lines.append(
            f"formula {name} = " + (" | ".join(f"s={k}" for k, yes in enumerate(which) if yes) or "false") + ";"
        )
    return "\n".join([*lines, "formula m = 7;"]) + "\n"


def drawn(draw: random.Random, size: int) -> tuple[Chain, list[bool], list[bool]]:
    def choice() -> dict[int, Fraction]:
        weights = {to: draw.randint(1, 4) for to in draw.sample(range(size), draw.randint(1, min(3, size)))}
        return {to: Fraction(weight, sum(weights.values())) for to, weight in weights.items()}

    most = draw.choice((1, 2))
    chain = [[choice() for _ in range(draw.randint(1, most))] for _ in range(size)]
    return chain, [draw.random() < 0.7 for _ in range(size)], [draw.random() < 0.7 for _ in range(size)]


def reached(chain: Chain) -> set[int]:
    found, waiting = {0}, [0]
    while waiting:
        for to in {to for choice in chain[waiting.pop()] for to in choice} - found:
            found.add(to)
            waiting.append(to)
    return found


def least_of_a_step(chain: Chain, given: list[bool], kept: list[bool]) -> Fraction:
    """By enumeration of all states, also the first, and choices."""
    worst = Fraction(0) if given[0] and not kept[0] else Fraction(1)
    for choice in (choice for state in reached(chain) for choice in chain[state]):
        among = sum(p for to, p in choice.items() if given[to])
        if among:
            worst = min(worst, sum(p for to, p in choice.items() if given[to] and kept[to]) / among)
    return worst


def least_of_a_run(chain: Chain, good: list[bool]) -> Fraction:
    """The least probability that a run stays in good states, by enumeration of the choice for each state: for each, the
    probability is 1 minus the solution of the linear equations for reaching a bad one (Gauss)."""
    worst = Fraction(1)
    for picked in itertools.product(*(range(len(choices)) for choices in chain)):
        own = [choices[k] for choices, k in zip(chain, picked, strict=True)]
        can = {s for s, yes in enumerate(good) if not yes}
        while more := {s for s in range(len(own)) if s not in can and set(own[s]) & can}:
            can |= more
        unknown = sorted(s for s in can if good[s])
        rows = [
            [Fraction(s == t) - (own[s].get(t, Fraction(0))) for t in unknown]
            + [sum((p for t, p in own[s].items() if not good[t]), Fraction(0))]
            for s in unknown
        ]
        for k in range(len(unknown)):
            pivot = next(r for r in range(k, len(rows)) if rows[r][k])
            rows[k], rows[pivot] = rows[pivot], rows[k]
            rows[k] = [x / rows[k][k] for x in rows[k]]
            for r in range(len(rows)):
                if r != k:
                    rows[r] = [x - rows[r][k] * y for x, y in zip(rows[r], rows[k], strict=True)]
        bad = Fraction(1) if not good[0] else rows[unknown.index(0)][-1] if 0 in unknown else Fraction(0)
        worst = min(worst, 1 - bad)
    return worst


@pytest.mark.parametrize("seed", [pytest.param(n, marks=[pytest.mark.slow] * (n > 2)) for n in range(24)])
def test_random_models_against_enumeration(tmp_path: Path, seed: int) -> None:
    """The verdict and the number, with a bound at, or just above, the least probability."""
    draw = random.Random(seed)
    chain, given, kept = drawn(draw, draw.randint(2, 5))
    model = prism(chain, given, kept)
    good = [not g or k for g, k in zip(given, kept, strict=True)]
    for what, least in (
        ("given ( in.p ) ( out.d )", least_of_a_step(chain, given, kept)),
        ("per run ( in.p -> out.d )", least_of_a_run(chain, good)),
    ):
        for bound in {Fraction(least * 1000 // 1, 1000), Fraction(least * 1000 // 1 + 1, 1000)}:
            if 0 < bound < 1:
                outcome = judged(
                    tmp_path / f"{what[:3]}{bound.numerator}", f"with probability >= {float(bound)} {what}", model
                )
                assert outcome.verdict is (Verdict.CHECKED if least >= bound else Verdict.REFUTED), (model, what, least)
                assert Fraction(str(outcome.bound["probability"])) == least
    always = judged(tmp_path / "always", "( in.p -> out.d )", model)
    assert always.verdict is (Verdict.CHECKED if all(good[s] for s in reached(chain)) else Verdict.REFUTED)


ONE = """dtmc
module n
  s : [-1..2] init 0;
  m : [3..7] init 7;
  p : bool init false;
  d : bool init false;
  [] true -> 1/2 : (p'=true) & (d'=true) + 1/2 : (p'=true) & (d'=false);
endmodule
"""
HALF = "with probability >= 0.5 given ( in.p ) ( out.d )"
HALF_BACK = "with probability >= 0.5 given ( out.d ) ( in.p )"


@pytest.mark.parametrize(
    ("clause", "change", "assume", "verdict", "says"),
    [
        (HALF, {}, "", Verdict.CHECKED, "least probability of a step is 0.5"),
        (HALF, {"1/2 :": "1/3 :"}, "", Verdict.ERROR, "do not add up to 1"),
        (HALF, {"init 7": "init 5"}, "", Verdict.ERROR, "no value of its type"),
        (HALF, {"init 0": "init -1"}, "", Verdict.ERROR, "no value of its type"),
        (HALF, {}, "assume a ( not in.p )", Verdict.UNKNOWN, "an assumption is broken"),
        (HALF, {}, "assume a ( in.k == 0 and in.m == idle )", Verdict.CHECKED, ""),
        ("with probability >= 0.5 given ( in.m == go ) ( out.d )", {}, "", Verdict.CHECKED, "no state meets"),
        (HALF_BACK, {"(d'=true)": "(d'=false)"}, "", Verdict.CHECKED, "no state meets"),
        ("with probability >= 0.5 ( in.m == go -> out.d )", {}, "", Verdict.CHECKED, "no state meets"),
        ("with probability >= 0.5 given ( in.p ) ( in.m == go -> out.d )", {}, "", Verdict.CHECKED, "no state meets"),
        ("with probability >= 0.5 per run ( in.m == go -> out.d )", {}, "", Verdict.CHECKED, "no state meets"),
        ("( in.m == go -> out.d )", {}, "", Verdict.CHECKED, "no state meets"),
        ("( forall(x in INTEGER | x * x >= 0) or out.d )", {}, "", Verdict.UNKNOWN, "PRISM has no counterpart"),
        ("( max(in.k, 1) == 1 and in.k + 1 > 0 and in.m in {idle} )", {}, "", Verdict.CHECKED, "with probability 1"),
        ("( once(in.p) )", {}, "", Verdict.UNKNOWN, "single steps"),
    ],
)  # fmt: skip
def test_verdicts(
    tmp_path: Path, clause: str, change: Mapping[str, str], assume: str, verdict: Verdict, says: str
) -> None:
    model = ONE
    for old, new in change.items():
        model = model.replace(old, new)
    outcome = judged(tmp_path, clause, model, assume)
    assert (outcome.verdict, outcome.vacuous) == (verdict, "no state meets" in says), outcome.summary
    assert says in outcome.summary


def test_faults_of_the_plan(tmp_path: Path) -> None:
    for wrong, code in (
        ({"ports": {"in.x": "p"}}, "STORM103"),
        ({"ports": {"in.p": "q"}}, "STORM103"),
        ({"ports": {"in.m": "m"}}, "STORM103"),
        ({"model": "no.prism"}, "STORM102"),
        ({"model": "../m.prism"}, "STORM101"),
    ):
        text = NODE.format(assume="", clause=HALF)
        options = {"model": "m.prism", "ports": PORTS, **wrong}
        case = Seeded("s", text, options, {"g": Verdict.ERROR}, {"m.prism": ONE})
        (found,) = BACKEND.check(case.written(BACKEND, tmp_path))
        assert (found.code, found.span is not None) == (code, True)
    for text in ("ctmc\n" + ONE[5:], ONE + "formula avow_x = p;\n"):
        case = Seeded(
            "s",
            NODE.format(assume="", clause=HALF),
            {"model": "m.prism", "ports": PORTS},
            {"g": Verdict.ERROR},
            {"m.prism": text},
        )
        assert [d.code for d in BACKEND.check(case.written(BACKEND, tmp_path))] == ["STORM111"]


def test_disagreeing_answers_are_no_verdict(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A reward that is wrong, as by a fault of the translation: the least probability contradicts Storm's answer."""
    monkeypatch.setattr("avow.backends.storm.writing._number", lambda value: "1")
    assert judged(tmp_path, HALF.replace("0.5", "0.6"), ONE).verdict is Verdict.ERROR


def test_without_storm_it_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    missing = Tool("stormpy", None, None, "pip install 'avow[chance]'")
    monkeypatch.setattr("avow.backends.storm.backend.package_tool", lambda *_: missing)
    outcome = judged(tmp_path, HALF, ONE)
    assert (outcome.verdict, "pip install 'avow[chance]'" in outcome.summary) == (Verdict.NOT_RUN, True)


def test_a_model_that_takes_too_long_is_unknown(tmp_path: Path) -> None:
    text, model = NODE.format(assume="", clause=HALF), ONE.replace("[-1..2]", "[0..90000000]")
    model = model.replace("  [] true", "  [] s<90000000 -> (s'=s+1);\n  [] true")
    case = Seeded("s", text, {"model": "m.prism", "ports": PORTS}, {"g": Verdict.UNKNOWN}, {"m.prism": model})
    (outcome,) = settle(BACKEND, case.written(BACKEND, tmp_path), tmp_path / "out", Limits(seconds=3)).outcomes
    assert outcome.verdict is Verdict.UNKNOWN

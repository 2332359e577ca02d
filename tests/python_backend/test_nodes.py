"""Real nodes: the right ones are proved from their source, every mutant is refuted by what CPython answers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from source_nodes import LIMITER, LIMITER_RCL, NODES, TRICKS, WATCHDOG_RCL, Example, mutants

from avow.backend_kit.protocol import Limits
from avow.backends.python import BACKEND
from avow.base.verdict import Object, Verdict


@pytest.mark.slow
@pytest.mark.parametrize("name", NODES)
def test_right_nodes_are_proved_from_their_source(name: str, tmp_path: Path) -> None:
    example = NODES[name]
    for clause, found in example.settled(tmp_path).items():
        wanted = Verdict.REFUTED if clause in example.false else Verdict.PROVED
        assert found.verdict is wanted, found.summary
        assert (found.of, found.numbers) == (Object.SOURCE, "float64")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "mutant"), list(mutants()), ids=[name for name, _ in mutants()])
def test_every_mutant_is_refuted(name: str, mutant: Example, tmp_path: Path) -> None:
    found = mutant.settled(tmp_path)
    refuted = {clause for clause, o in found.items() if o.verdict is Verdict.REFUTED}
    assert refuted, {c: (o.verdict, o.summary) for c, o in found.items()}
    assert name != "scanmin-2" or "below" in refuted
    assert all(found[clause].counterexample is not None for clause in refuted)


@pytest.mark.slow
@pytest.mark.parametrize("name", TRICKS)
def test_no_trick_is_proved(name: str, tmp_path: Path) -> None:
    """Not even what holds of any number."""
    for clause, found in TRICKS[name].settled(tmp_path).items():
        assert found.verdict in (Verdict.UNKNOWN, Verdict.REFUTED, Verdict.ERROR), (clause, found.summary)
        assert not found.verdict.supports


@pytest.mark.slow
@pytest.mark.parametrize(
    ("timeout", "numbers", "late", "calm"),
    [
        ("0.5", "float64", Verdict.REFUTED, Verdict.PROVED),
        ("0.5", "exact", Verdict.PROVED, Verdict.PROVED),
        ("0.3", "float64", Verdict.REFUTED, Verdict.PROVED),
        ("0.3", "exact", Verdict.PROVED, Verdict.REFUTED),
    ],
)
def test_reals_err_both_ways(timeout: str, numbers: str, late: Verdict, calm: Verdict, tmp_path: Path) -> None:
    """A difference of doubles may round to the threshold; and the double 0.3 is below 3/10."""
    rcl = WATCHDOG_RCL.replace("Timeout = 0.3", f"Timeout = {timeout}")
    example = replace(NODES["watchdog"], rcl=rcl, params={"timeout": float(timeout)}, numbers=numbers)
    found = example.settled(tmp_path)
    assert (found["late"].verdict, found["calm"].verdict) == (late, calm), found
    assert found["late"].numbers == numbers
    supposed = [h for h in found["fresh"].hypotheses if "nothing is rounded" in h]
    assert bool(supposed) is (numbers == "exact")  # no answer about exact numbers is unconditional where floats round
    assert all("line 9" in h for h in supposed)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["limiter", "median", "scanmin"])
def test_finite_inputs_are_a_hypothesis(name: str, tmp_path: Path) -> None:
    for found in NODES[name].settled(tmp_path).values():
        assert any(h.startswith("inputs are finite") for h in found.hypotheses)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["limiter", "median", "scanmin"])
def test_nan_passes_through_where_it_is_possible(name: str, tmp_path: Path) -> None:
    found = replace(NODES[name], options={"nan": "possible"}).settled(tmp_path)
    assert {o.verdict for o in found.values()} == {Verdict.REFUTED}
    assert any("nan" in o.summary for o in found.values())


def test_memory_starts_with_a_value_of_its_type(tmp_path: Path) -> None:
    source = NODES["debouncer"].source.replace("self.count = 0\n    def", "self.count = -1\n    def")
    for found in replace(NODES["debouncer"], source=source).settled(tmp_path).values():
        assert found.verdict is Verdict.REFUTED


def test_what_init_makes_has_to_meet_what_is_assumed_of_memory(tmp_path: Path) -> None:
    source = NODES["debouncer"].source.replace("self.count = 0\n    def", "self.count = 5\n    def")
    for found in replace(NODES["debouncer"], source=source).settled(tmp_path).values():
        assert found.verdict is Verdict.REFUTED
        assert "in.count = 5" in found.summary


@pytest.mark.slow
def test_what_a_step_leaves_in_memory_is_a_hypothesis_unless_it_is_kept(tmp_path: Path) -> None:
    kept = NODES["debouncer"].settled(tmp_path / "kept")["says"]
    assert not any("memory" in h for h in kept.hypotheses)
    source = NODES["debouncer"].source.replace("min(self.count + 1, self.need)", "self.count + 1")
    lost = replace(NODES["debouncer"], source=source).settled(tmp_path / "lost")["reset"]
    assert lost.verdict is Verdict.PROVED
    assert any("memory: range" in h for h in lost.hypotheses)


def test_a_hidden_state_is_told_with_its_line(tmp_path: Path) -> None:
    source = LIMITER.replace("        return v\n", "        self.n = self.n + 1\n        return v\n").replace(
        '["vmax"]\n', '["vmax"]\n        self.n = 0\n'
    )
    found = Example(source, LIMITER_RCL, "Limiter", {"vmax": 1.5}).settled(tmp_path)
    assert {o.verdict for o in found.values()} == {Verdict.UNKNOWN}
    assert "node.py:11: self.n is changed by a step" in found["same"].summary
    unmade = source.replace('params["vmax"]', 'params["vmaxx"]')
    found = Example(unmade, LIMITER_RCL, "Limiter", {"vmax": 1.5}).settled(tmp_path / "unmade")
    assert {o.verdict for o in found.values()} == {Verdict.ERROR}


UNROLLED = """class Limiter:
    def __init__(self, params):
        self.vmax = params["vmax"]

    def step(self, v):
        total = 0.0
        for i in range(4):
            if i == 3:
                break
            if v > 100.0:
                continue
            total = total + 0.5
        return min(total, self.vmax)
"""


@pytest.mark.slow
def test_a_counted_loop_needs_no_invariant(tmp_path: Path) -> None:
    ports = "node limiter { inputs( v : REAL ) outputs( u : REAL ) topics()"
    rcl = f"{ports} guarantee g ( out.u == (if in.v > 100 then 0 else 1.5) ) }}"
    job = Example(UNROLLED, rcl, "Limiter", {"vmax": 1.5}).job(tmp_path)
    report = BACKEND.discharge(job, tmp_path, Limits())
    assert [o.verdict for o in report.outcomes] == [Verdict.PROVED], report.outcomes[0].summary
    scripts = [text for name, text in report.logs.items() if name.endswith(".smt2")]
    assert scripts
    assert all("(check-sat)" in text for text in scripts)


MODES = """\
import enum
from typing import Dict


class Mode(enum.Enum):
    off = 0
    on = 1


class Latch:
    def __init__(self, params: Dict[str, float]) -> None:
        self.mode = Mode.off

    def step(self, x: float) -> Dict[str, bool]:
        if x > 1.0:
            self.mode = Mode.on
        return {"lit": self.mode == Mode.on}
"""
LATCH = """\
context { Mode : {off, on}; }
node latch { inputs( x : REAL, mode : Mode ) outputs( lit : BOOL, mode : Mode ) topics()
 guarantee stays ( in.mode == on -> out.lit )
 guarantee off ( out.mode == off -> not out.lit ) }"""


@pytest.mark.slow
def test_memory_that_is_a_member_of_an_enumeration_is_given_as_one(tmp_path: Path) -> None:
    """A class that is not understood is run all the same: of a right one nothing is refuted, of a wrong one it is."""
    right = Example(MODES, LATCH, "Latch", {}, {"mode": "mode"})
    found = right.settled(tmp_path / "right")
    assert {o.verdict for o in found.values()} == {Verdict.UNKNOWN}, found
    assert "node.py:5: the class Mode" in found["stays"].summary
    wrong = replace(right, source=MODES.replace("self.mode == Mode.on}", "x > 1.0}")).settled(tmp_path / "wrong")
    assert wrong["stays"].verdict is Verdict.REFUTED


HELD = """\
class Held:
    def __init__(self):
        self.top = 0.0

    def step(self, x):
        self.top = max(self.top, x)
        return {}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("returned", "verdict", "why"),
    [
        ("{}", Verdict.PROVED, ""),
        ("None", Verdict.REFUTED, "the step returns None; it has to return {}, since all outputs are held in memory"),
        ('{"top": 1.0}', Verdict.REFUTED, "it has to return {}, since all outputs are held in memory"),
    ],
)
def test_a_step_whose_outputs_are_all_memory_returns_an_empty_dict(
    returned: str, verdict: Verdict, why: str, tmp_path: Path
) -> None:
    rcl = "node held { inputs( x : REAL, top : REAL ) outputs( top : REAL ) topics() guarantee at ( out.top >= in.x ) }"
    found = Example(HELD.replace("{}", returned), rcl, "Held", {}, {"top": "top"}).settled(tmp_path)["at"]
    assert found.verdict is verdict, found
    assert why in found.summary

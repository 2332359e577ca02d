"""Contracts that speak of other steps: an implementation that keeps something from step to step, with its invariant;
what does not hold of every run is not proved, however it is put."""

from __future__ import annotations

from pathlib import Path

import pytest
from hoare.systems import gate, make_job

from avow.backend_kit import one_step
from avow.backend_kit.protocol import Job, Limits
from avow.backends.dafny import BACKEND
from avow.backends.dafny.dafny_tool import dafny
from avow.base.verdict import Outcome, Verdict

needs_dafny = pytest.mark.skipif(not dafny().present, reason="dafny is not on this machine")

GATE = gate("guarantee soon ( request -> within[200 ms](open) )")

IMPLEMENTATION = """
include "gate_spec.dfy"
module {:options "--function-syntax:3"} GateImpl refines GateSpec {
  datatype Memory = Memory(high: nat)
  function method Begin(): Memory { Memory(0) }
  predicate Linked(h: Contract.History, m: Memory) {
    m.high == h.counted5 && (if m.high >= 4 then h.held4 == 3 else h.held4 == m.high - 1)
  }
  lemma Established(h: Contract.History) { }
  predicate Env(in_request: bool, in_reading: real) { true }
  lemma EnvNotEmpty(h: Contract.History) returns (in_request: bool, in_reading: real)
  { in_request, in_reading := false, 0.0; }
  method Step(ghost h: Contract.History, m: Memory, in_request: bool, in_reading: real)
    returns (n: Memory, out_open: bool, out_alarm: bool, out_n: nat)
  {
    var high := if in_reading > 10.0 then m.high + 1 else 0;
    n := Memory(high);
    out_open := in_request;
    out_alarm := high >= 3;
    out_n := high;
  }
}
"""
ASKED = {"still", "alarm", "count"}


def job(folder: Path, text: str = IMPLEMENTATION) -> Job:
    return make_job(folder, GATE, "gate", {"implementation": "p.dfy"}, {"p.dfy": text}, "dafny")


def settle(wanted: Job) -> dict[str, Outcome]:
    report = one_step.discharge(BACKEND, wanted, wanted.root, Limits())
    return {o.obligation.rpartition("/")[2]: o for o in report.outcomes}


def test_the_generated_files(tmp_path: Path) -> None:
    """The history, with what each part of it is kept for; a limit in seconds is refused by name."""
    made = one_step.export(BACKEND, job(tmp_path))
    contract = made["gate_contract.dfy"]
    assert (
        "datatype History = History(previous1: real, first_step2: bool, since3: bool, held4: int, counted5: nat)"
        in contract
    )
    assert "//   held4: held[2 steps](in.reading > 10)" in contract
    assert (
        "ensures Linked(Contract.Advance(h, in_request, in_reading, out_open, out_alarm, out_n), n)"
        in made["gate_spec.dfy"]
    )
    assert [d.code for d in one_step.check(BACKEND, job(tmp_path))] == ["BACKEND006"]
    told = one_step.translate(BACKEND, "dafny", job(tmp_path).system, job(tmp_path).node)
    assert "gate_impl.dfy" in told.files
    assert ["`within` with a limit in seconds" in d.message for d in told.missing] == [True]


def test_names_of_the_history_are_kept_from_clauses(tmp_path: Path) -> None:
    clauses = "guarantee begins ( once(a) ) guarantee Advance ( b )"
    rcl = f"node n {{ inputs( a : BOOL ) outputs( b : BOOL ) topics() {clauses} }}"
    work = make_job(tmp_path, rcl, "n", {"implementation": "p.dfy"}, {"p.dfy": ""}, "dafny")
    contract = BACKEND.export(work)["n_contract.dfy"]
    declared = [
        line.split("(")[0].split()[1] for line in contract.splitlines() if line.startswith(("  pred", "  func"))
    ]
    assert len(declared) == len(set(declared)), declared


@needs_dafny
@pytest.mark.slow
def test_a_right_implementation_is_proved(tmp_path: Path) -> None:
    found = settle(job(tmp_path))
    assert {n for n, o in found.items() if o.verdict is Verdict.PROVED} == ASKED, {
        n: o.summary for n, o in found.items()
    }
    assert found["soon"].verdict is Verdict.UNKNOWN


@needs_dafny
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("old", "new", "left"),
    [
        ("high >= 3", "high >= 2", {"still", "count"}),
        ("Memory(0) }", "Memory(1) }", set()),
        ("n := Memory(high);", "n := m;", set()),
        ("lemma Established(h: Contract.History) { }", "lemma Established(h: Contract.History)", set()),
        ("lemma Established(h: Contract.History) { }", "", set()),
        ("function method Begin(): Memory { Memory(0) }", "", set()),
        ("m.high == h.counted5 &&", "false &&", set()),
        ("m.high == h.counted5 &&", "", {"still", "alarm"}),
        ("{ Memory(0) }", "{ Memory(0) } class C { predicate Linked(h: Contract.History, m: Memory) { true } }", ASKED),
        ("Established(h: Contract.History) { }", "Established(h: Contract.History) requires false { }", set()),
        ("lemma Established(h: Contract.History) { }", "lemma {:axiom} Established(h: Contract.History) { }", set()),
        ("out_alarm := high >= 3;", "assume m.high == 0; out_alarm := high >= 3;", set()),
    ],
)  # fmt: skip
def test_what_does_not_hold_of_every_run_is_not_proved(old: str, new: str, left: set[str], tmp_path: Path) -> None:
    assert old in IMPLEMENTATION
    found = settle(job(tmp_path, IMPLEMENTATION.replace(old, new)))
    proved = {n for n, o in found.items() if o.verdict is Verdict.PROVED}
    assert proved == left, {n: o.summary for n, o in found.items()}

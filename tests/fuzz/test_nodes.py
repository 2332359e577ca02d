"""Five C++ nodes through the backend: the right ones are tested, every mutant is refuted; the same each time."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import some

from avow.backends.fuzz.clang_tool import clang
from avow.base.verdict import Object, Verdict
from avow.isolation.observed import look
from avow.isolation.tracing import traces
from fuzz.cpp_nodes import DEBOUNCER, FIVE, LIMITER, WATCHDOG, Cpp, adapter

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not clang().present, reason="clang++ is not here"),
    pytest.mark.skipif(not traces(), reason="strace is not here: what a compiled program reads is told by nothing"),
]

MUTANTS = [(cpp, k) for cpp in FIVE for k in range(1, 5)]


@pytest.mark.nightly
@pytest.mark.parametrize("cpp", FIVE, ids=lambda cpp: cpp.node)
def test_the_right_ones_are_tested(cpp: Cpp, tmp_path: Path) -> None:
    report = cpp.report(tmp_path)
    assert {o.verdict for o in report.outcomes} == {Verdict.TESTED}, [o.summary for o in report.outcomes]
    assert {(o.of, o.numbers) for o in report.outcomes} == {(Object.BINARY, "float64")}


@pytest.mark.nightly
@pytest.mark.parametrize(("cpp", "mutant"), MUTANTS, ids=lambda x: x.node if isinstance(x, Cpp) else str(x))
def test_every_mutant_is_refuted(cpp: Cpp, mutant: int, tmp_path: Path) -> None:
    found = cpp.mutant(mutant).verdicts(tmp_path)
    assert Verdict.REFUTED in found.values(), found
    assert set(found.values()) <= {Verdict.REFUTED, Verdict.TESTED}
    assert found["runs-without-fault"] is Verdict.TESTED


def test_a_right_one_and_a_mutant(tmp_path: Path) -> None:
    """Of those above, each time: with memory, through several steps."""
    right = WATCHDOG.outcomes(tmp_path / "right")
    assert {o.verdict for o in right.values()} == {Verdict.TESTED}, [o.summary for o in right.values()]
    assert right["late"].bound["fuzzed_runs"] >= 500
    wrong = DEBOUNCER.mutant(2).outcomes(tmp_path / "wrong")
    assert wrong["reset"].verdict is Verdict.REFUTED
    shown = wrong["reset"].counterexample
    assert shown is not None
    assert len(shown.trace) == 3, "two steps count, the third breaks it"
    assert wrong["inv"].verdict is Verdict.TESTED


FAULTY = LIMITER.adapter.replace("{ out.real", '{ double room[8] = {}; room[int(in.real("v")) & 15] = 1; out.real')


def test_a_fault_is_a_claim_of_its_own(tmp_path: Path) -> None:
    """Index 8 of eight: the line is told, the guarantees are judged by themselves, and rest on it."""
    report = replace(LIMITER, adapter=FAULTY).report(tmp_path)
    found = {o.obligation.rpartition("/")[2]: o for o in report.outcomes}
    fault = found["runs-without-fault"]
    assert fault.verdict is Verdict.REFUTED
    assert "src/adapter.hpp:" in fault.summary
    assert "out of bounds" in fault.summary or "overflow" in fault.summary
    assert all("runs-without-fault" in str(o.rests_on) for o in found.values() if o.verdict is Verdict.TESTED)


ENDINGS = {
    "abort": ("#include <cstdlib>\n", 'if (in.real("v") > 1e3) std::abort();'),
    "throw": ("#include <stdexcept>\n", 'if (in.real("v") > 1e3) throw std::runtime_error("far");'),
}


@pytest.mark.nightly
@pytest.mark.parametrize("name", ENDINGS)
def test_no_output_refutes(name: str, tmp_path: Path) -> None:
    head, body = ENDINGS[name]
    text = head + LIMITER.adapter.replace("{ out.real", f"{{ {body} out.real")
    found = replace(LIMITER, adapter=text).verdicts(tmp_path)
    assert found["runs-without-fault"] is Verdict.REFUTED
    assert found["upper"] is Verdict.REFUTED


HOSTILE = {
    "exit": 'if (in.real("v") > 2) exit(0);',
    "_exit": 'if (in.real("v") > 2) _exit(0);',
    "channel": (
        'for (int fd = 3; fd < 40; ++fd) if (write(fd, "{\\"turn\\": \\"\\", \\"replies\\": []}\\n", 29) < 0) continue;'
    ),
    "prints": 'if (in.real("v") > 2) { puts("Done 500 runs in 0 second(s)"); fflush(stdout); _exit(0); }',
}


@pytest.mark.parametrize("name", some(HOSTILE, 1))
def test_a_hostile_subject_is_an_error(name: str, tmp_path: Path) -> None:
    text = LIMITER.adapter.replace("{ out.real", f"{{ {HOSTILE[name]} out.real")
    head = "#include <cstdio>\n#include <cstdlib>\n#include <unistd.h>\n"
    found = replace(LIMITER, adapter=head + text).verdicts(tmp_path)
    assert set(found.values()) == {Verdict.ERROR}, found


def test_what_cannot_be_built_is_asked_again_once_it_may_be(tmp_path: Path) -> None:
    report = replace(LIMITER, adapter='#include "later.hpp"\n' + LIMITER.adapter).report(tmp_path)
    assert {o.verdict for o in report.outcomes} == {Verdict.ERROR}
    assert all(look(o.kind, o.path) == o.digest for o in report.observed)
    for later in tmp_path.rglob("*.hpp"):
        later.with_name("later.hpp").touch()
    assert any(look(o.kind, o.path) != o.digest for o in report.observed)


@pytest.mark.nightly
def test_what_is_read_at_run_time_is_recorded(tmp_path: Path) -> None:
    text = LIMITER.adapter.replace("{ node.vmax = given", '{ std::ifstream("limit.txt") >> node.vmax; (void)given')
    text = text.replace('.real("vmax");', ";", 1)
    (tmp_path / "limit.txt").write_text("1.5\n")
    report = replace(LIMITER, adapter="#include <fstream>\n" + text).report(tmp_path)
    assert {o.verdict for o in report.outcomes} == {Verdict.TESTED}, [o.summary for o in report.outcomes]
    assert str(tmp_path / "limit.txt") in {o.path for o in report.observed}
    assert str(tmp_path / "src" / "nodes.hpp") in {o.path for o in report.observed}


@pytest.mark.nightly
def test_chance_is_no_answer(tmp_path: Path) -> None:
    text = "static int calls = 0;\n" + LIMITER.adapter.replace(
        "{ out.real", '{ if (++calls == 700) return out.real("u", 0); out.real'
    )
    found = replace(LIMITER, adapter=text).outcomes(tmp_path)
    assert not any(o.verdict.supports for o in found.values()), [o.summary for o in found.values()]


@pytest.mark.nightly
def test_integers_wrap_and_singles_round(tmp_path: Path) -> None:
    """What a machine's numbers do to a contract over all of them."""
    rcl = "node n { inputs( k : INTEGER, x : REAL ) outputs( m : INTEGER, y : REAL ) topics()\n"
    rcl += " guarantee more ( out.m > in.k ) guarantee tenth ( out.y == in.x ) }"
    text = adapter("Limiter", "", 'out.integer("m", int(in.integer("k")) + 1LL); out.real("y", float(in.real("x")));')
    cpp = Cpp("n", rcl, text, numbers="float32")
    found = cpp.outcomes(tmp_path / "single")
    assert found["more"].verdict is Verdict.REFUTED
    assert found["tenth"].verdict is Verdict.TESTED
    assert found["tenth"].numbers == "float32"
    assert replace(cpp, numbers="float64").verdicts(tmp_path / "double")["tenth"] is Verdict.REFUTED


@pytest.mark.nightly
def test_no_numbers_refute_where_they_are_possible(tmp_path: Path) -> None:
    """NaN passes through the right limiter: told beside, and a refutation where the plan says that it may come."""
    told = LIMITER.outcomes(tmp_path / "beside")["bounded"]
    assert told.verdict is Verdict.TESTED
    assert "no numbers" in told.details
    possible = replace(LIMITER, options={"nan": "possible"}).verdicts(tmp_path / "possible")
    assert possible["bounded"] is Verdict.REFUTED


MISFITS = {
    'out.element("light", "red"); out.truth("speed", true);': "it gives `speed` as another type",
    'out.element("light", "red");': "what it gives lacks speed",
    'out.real("speed", in.real("neares")); out.element("light", "red");': "`neares`: did you mean `nearest`?",
    'out.real("speed", double(in.integer("nearest")));': "`nearest` is read by real(), not by integer()",
    'out.real("speed", in.reals("nearest")[0]);': "`nearest` is read by real(), not by reals()",
    'out.real("sped", 1); out.element("light", "red");': "`sped`, which is no output and lacks speed: did you mean",
    'out.real("speed", 1); out.real("speed", 1);': "`speed` is given twice",
    'out.real("speed", 1); out.element("light", "reed");': "`reed` for light, whose type has no such element: did you",
    'out.real("speed", 1); out.element("light", in.real("nearest") < 7 ? "green" : "gren");': "did you mean `green`?",
}


@pytest.mark.parametrize("step", some(MISFITS, 0, 1))
def test_an_adapter_that_does_not_fit(step: str, tmp_path: Path) -> None:
    """An unknown name or a wrong type is the adapter's error, at its line: it refutes nothing, and nothing is left."""
    rcl = "context { Light : {red, green}; }\nnode n { inputs( nearest : REAL ) outputs( speed : REAL, light : Light )"
    rcl += " topics()\n guarantee stops ( in.nearest < 1 -> out.speed == 0 ) guarantee lit ( out.light == red ) }"
    text = adapter("Limiter", "", f"(void)in; (void)out; {step}")
    found = Cpp("n", rcl, text).outcomes(tmp_path)
    assert {o.verdict for o in found.values()} == {Verdict.ERROR}, {o.verdict: o.summary for o in found.values()}
    (said,) = {o.summary for o in found.values()}
    assert MISFITS[step] in said
    assert re.match(r"src/adapter\.hpp(:\d+)?: the adapter does not fit the contract: ", said), said


@pytest.mark.nightly
def test_what_no_clause_speaks_of_is_left_out_and_said(tmp_path: Path) -> None:
    rcl = LIMITER.rcl.replace("inputs( v : REAL )", "inputs( v : REAL, at : REAL --> BOOL )")
    found = replace(LIMITER, rcl=rcl).outcomes(tmp_path / "left")
    assert {o.verdict for o in found.values()} == {Verdict.TESTED}
    assert all("in.at" in o.hypotheses[0] for o in found.values())
    spoken = rcl.rstrip("} ") + " guarantee there ( in.at(0) -> out.u == 0 ) }"
    assert replace(LIMITER, rcl=spoken).outcomes(tmp_path / "spoken")["there"].verdict is Verdict.ERROR


def test_it_does_not_compile(tmp_path: Path) -> None:
    found = replace(LIMITER, adapter="struct AvowNode { int x = ; };\n").outcomes(tmp_path)
    assert {o.verdict for o in found.values()} == {Verdict.ERROR}
    assert "src/adapter.hpp:1" in found["same"].summary
    found = replace(LIMITER, adapter="struct Node {};\n").outcomes(tmp_path / "unnamed")
    assert "adapter.hpp defines no `struct AvowNode` (`cpp` names the adapter" in found["same"].summary
    assert "has no `void step" not in found["same"].summary

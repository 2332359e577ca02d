"""The node's own class under the driver: what only a sequence of steps, or a machine's number, shows."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from avow.backend_kit.protocol import Job, Limits
from avow.backends.hypothesis import BACKEND
from avow.base.verdict import Object, Outcome, Verdict
from avow.conformance.seeded import settle
from avow.evidence.record import RETRY
from avow.pipeline.methods import method_job
from avow.system.load import load_system

HEAD = "class Node:\n    def __init__(self, params):\n        self.n = 0\n        self.limit = params['limit']\n"


def job(folder: Path, ports: str, clauses: str, step: str, **memory: str) -> Job:
    (folder / "node.py").write_text(f"{HEAD}    def step(self, {step}")
    (folder / "system.rcl").write_text(f"node made {{ {ports} topics() {clauses} }}")
    (folder / "p.yaml").write_text("limit: 250.0\n")
    node = {
        "source": {"python": "node.py", "class": "Node", "parameters": "p.yaml"},
        "methods": [{"hypothesis": {"cases": 400}}],
    }
    if memory:
        node["memory"] = {port: f"self.{name}" for port, name in memory.items()}
    (folder / "plan.yaml").write_text(yaml.safe_dump({"nodes": {"made": node}}))
    system = load_system(folder)
    (method,) = system.plan.node("made").methods
    return method_job(system, system.contract.node("made"), method)


def outcome(folder: Path, *parts: str, **memory: str) -> Outcome:
    work = job(folder, *parts, **memory)
    (found,) = settle(BACKEND, work, folder / "made", Limits()).outcomes
    return found


SAME = "guarantee g ( out.u == in.r )"
REAL = "inputs( r : REAL ) outputs( u : REAL )"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ports", "clauses", "step"),
    [
        (REAL, SAME, "r):\n        return 0.0 if r == 777.0 else r\n"),
        (
            REAL,
            "guarantee g ( out.u == in.r )",
            "r):\n        self.n += 1\n        return 0.0 if self.n == 11 else r\n",
        ),
        (
            "inputs( r : REAL ) outputs( red : BOOL )",
            "guarantee g ( in.r >= 250 <=> out.red )",
            "r):\n        return r >= 249.99999999999\n",
        ),
        (
            "inputs( s : <REAL> ) outputs( n : NATURAL )",
            "guarantee g ( out.n == length(in.s) )",
            "s):\n        return 9 if len(s) >= 10 else len(s)\n",
        ),
        (
            "inputs( i : INTEGER ) outputs( j : INTEGER )",
            "guarantee g ( out.j == in.i + 1 )",
            "i):\n        return (i + 1 + 2**31) % 2**32 - 2**31\n",
        ),
        (REAL, SAME, "r):\n        return r / r * r\n"),
        (REAL, "guarantee g ( out.u + 1/10 == in.r )", "r):\n        return r - 0.1\n"),
    ],
    ids=["a number of its own", "the 11th call", "nearly 250", "ten elements", "32 bits", "raises", "rounds"],
)
def test_what_a_class_does_wrong_is_found(ports: str, clauses: str, step: str, tmp_path: Path) -> None:
    found = outcome(tmp_path, ports, clauses, step)
    assert found.verdict is Verdict.REFUTED, found.summary
    assert found.counterexample is not None
    assert (found.of, found.numbers) == (Object.SOURCE, "float64")


@pytest.mark.slow
def test_a_right_class_is_tested(tmp_path: Path) -> None:
    found = outcome(tmp_path, REAL, "guarantee g ( out.u <= 250 )", "r):\n        return min(r, self.limit)\n")
    assert found.verdict is Verdict.TESTED, found.summary
    assert found.bound["cases"] == 400


COUNT = "inputs( go : BOOL, n : NATURAL ) outputs( u : BOOL, n : NATURAL )"
COUNTS = "go):\n        self.n = self.n + 1 if go else 0\n        return self.n > 4\n"


@pytest.mark.slow
def test_memory_is_what_the_class_had(tmp_path: Path) -> None:
    """A fault that shows only after five steps in a row; the counterexample has these and no more."""
    clauses = "guarantee g ( in.go -> out.n == in.n + 1 and not out.u )"
    found = outcome(tmp_path, COUNT, clauses, COUNTS, n="n")
    assert found.verdict is Verdict.REFUTED
    assert found.counterexample is not None
    assert len(found.counterexample.trace) == 5
    assert dict(found.counterexample.values)["in.n"] == "4"


@pytest.mark.slow
def test_a_case_is_tried_again_first(tmp_path: Path) -> None:
    clauses = "guarantee g ( in.go -> out.n == in.n + 1 and not out.u )"
    work = job(tmp_path, COUNT, clauses, COUNTS, n="n")
    (first,) = settle(BACKEND, work, tmp_path / "made", Limits()).outcomes
    again = Job(work.system, work.node, work.method, work.obligations, kept={first.obligation: [first.details["case"]]})
    (second,) = settle(BACKEND, again, tmp_path / "again", Limits()).outcomes
    assert second.verdict is Verdict.REFUTED


@pytest.mark.slow
def test_what_another_process_answers_otherwise_is_no_function(tmp_path: Path) -> None:
    step = "r):\n        return float(id(object()) % 1000)\n"
    found = outcome(tmp_path, REAL, "guarantee g ( out.u >= 0 )", step)
    assert not found.verdict.supports


def test_no_class_of_that_name(tmp_path: Path) -> None:
    work = job(tmp_path, REAL, "guarantee g ( out.u == in.r )", "r):\n        return r\n")
    (tmp_path / "node.py").write_text("class Other: pass\n")
    assert [d.code for d in BACKEND.check(work)] == ["DRIVE108"]
    assert {tmp_path / "node.py", tmp_path / "p.yaml"} <= set(BACKEND.files(work))


@pytest.mark.slow
@pytest.mark.parametrize(
    "step",
    [
        "r):\n        import time\n        while r > 250:\n            time.sleep(0.05)\n        return r\n",
        pytest.param(
            "r):\n        import time\n        while r != r:\n            time.sleep(0.05)\n        return r\n",
            marks=pytest.mark.nightly,
        ),
    ],
    ids=["a reading", "no number"],
)
def test_a_class_that_takes_its_time_is_not_refuted_for_it_and_asked_again(step: str, tmp_path: Path) -> None:
    """On a slow machine any class might: what the wall's clock says is kept neither for it nor against it."""
    work = job(tmp_path, REAL, SAME, step)
    (found,) = settle(BACKEND, work, tmp_path / "made", Limits(seconds=16)).outcomes
    assert found.verdict is Verdict.ERROR, found.summary
    assert "does not answer within" in found.summary
    assert "asks again" in found.summary
    assert found.details[RETRY] is True
    assert found.counterexample is None


WIDE = "context { Command : { go(REAL, INTEGER), stop }; Marks : NATURAL --> BOOL; }"
WIDE_PORTS = "inputs( c : Command, before : Marks ) outputs( u : REAL, marks : Marks )"
TAKES = "c):\n        return {'u': c[1] if c[0] == 'go' else %s, 'marks': set()}\n"


def wide(folder: Path, clause: str, step: str) -> Job:
    work = job(folder, REAL, SAME, "r):\n        return r\n")
    (folder / "node.py").write_text(f"{HEAD}    def step(self, {step}")
    (folder / "system.rcl").write_text(f"{WIDE} node made {{ {WIDE_PORTS} topics() guarantee g ( {clause} ) }}")
    system = load_system(folder)
    return method_job(system, system.contract.node("made"), work.method)


@pytest.mark.slow
def test_commands_are_tuples_and_ports_that_no_clause_speaks_of_are_left_out(tmp_path: Path) -> None:
    clause = "in.c == stop -> out.u == 5"
    # `stop` has no arguments, and comes as a tuple of its name
    (right,) = settle(BACKEND, wide(tmp_path, clause, TAKES % "5.0"), tmp_path / "made", Limits()).outcomes
    assert (right.verdict, right.of) == (Verdict.TESTED, Object.SOURCE), right.summary
    assert right.details["left out"] == ["in.before", "out.marks"]
    (wrong,) = settle(BACKEND, wide(tmp_path, clause, TAKES % "6.0"), tmp_path / "made", Limits()).outcomes
    assert wrong.verdict is Verdict.REFUTED
    assert wrong.counterexample is not None
    assert ("in.c", "stop") in wrong.counterexample.values


@pytest.mark.parametrize(
    ("clause", "step"),
    [
        ("forall(i in NATURAL | in.before(i) -> out.marks(i))", TAKES % "5.0"),  # a clause speaks of them
        ("out.u == 5", "c, before):\n        return {'u': 5.0, 'marks': before}\n"),  # the class is to be given one
        ("out.u == 5", "**given):\n        return {'u': 5.0, 'marks': set()}\n"),
    ],
)
def test_a_port_that_matters_is_not_left_out(clause: str, step: str, tmp_path: Path) -> None:
    (told,) = BACKEND.check(wide(tmp_path, clause, step))
    assert told.code == "HYPO106"

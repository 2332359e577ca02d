"""The `initial` of what a program keeps is held against what its constructor makes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from fuzz.cpp_nodes import adapter

from avow.backend_kit.protocol import Limits, Report
from avow.backend_kit.registry import backend
from avow.backends.fuzz.clang_tool import clang
from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.conformance.seeded import settle
from avow.isolation.tracing import traces
from avow.pipeline.evidence_keys import method_options, surroundings
from avow.pipeline.methods import method_job
from avow.pipeline.slices import method_slice
from avow.system.load import load_system

CONTRACT = """context {{ Start = {start}; Mode : {{idle, busy}}; }}
node n {{ inputs( up : BOOL, last : INTEGER, mode : Mode ) outputs( last : INTEGER, mode : Mode ) topics()
  guarantee counts ( out.last == in.last + (if up then 1 else 0) )
  guarantee works ( up -> out.mode == busy ) }}
node other {{ inputs() outputs( v : INTEGER ) topics() guarantee( v > 0 ) }}
"""
CLASS = """class Node:
    def __init__(self):
        self.last = 2
        self.mode = "idle"

    def step(self, up):
        if up:
            self.last = self.last + 1
            self.mode = "busy"
        return {}
"""
CPP = adapter(
    "Node",
    "",
    'if (in.truth("up")) { node.last += 1; node.busy = true; }',
    'out.integer("last", node.last); out.element("mode", node.busy ? "busy" : "idle");',
)
CLANG = [
    pytest.mark.slow,
    pytest.mark.skipif(not (clang().present and traces()), reason="clang++ or strace is not here"),
]
_MARKS: Mapping[str, list[pytest.MarkDecorator]] = {"fuzz": CLANG, "hypothesis": [pytest.mark.slow]}
METHODS: Mapping[str, Mapping[str, int]] = {"python": {}, "hypothesis": {"cases": 60}, "fuzz": {"runs": 200}}
FITS: dict[str, tuple[str, str, int]] = {
    "a number": ("2", "idle", 2),
    "a constant of the contract": ("Start", "idle", 2),
    "a formula": ("0 <= out.last and out.last < Start", "idle", 3),
    "nothing": ("", "", 2),
}
DIFFERS = {
    "a number": ("0", "idle", 2),
    "a constant of the contract": ("Start", "idle", 3),
    "a formula": ("out.last < Start", "idle", 2),
    "an element": ("2", "busy", 2),
}


def written(folder: Path, method: str, last: str, mode: str, start: int, source: str = "n.last") -> Path:
    (folder / "node.py").write_text(CLASS)
    (folder / "adapter.hpp").write_text(CPP)
    (folder / "nodes.hpp").write_text("struct Node { long last = 2; bool busy = false; };")
    (folder / "system.rcl").write_text(CONTRACT.format(start=start))
    declared = {"cpp": "adapter.hpp"} if method == "fuzz" else {"python": "node.py", "class": "Node"}
    edges = [
        {"from": origin, "to": to, "delayed": True} | ({"initial": initial} if initial else {})
        for origin, to, initial in ((source, "n.last", last), ("n.mode", "n.mode", mode))
    ]
    memory = {"last": "self.last", "mode": "self.mode"}
    node = {"source": declared, "memory": memory, "methods": [{method: dict(METHODS[method])}]}
    (folder / "plan.yaml").write_text(yaml.safe_dump({"connections": edges, "nodes": {"n": node}}))
    return folder


def asked(folder: Path, method: str) -> Report:
    """As a worker does, of the slice alone."""
    system = load_system(folder)
    tool, node = backend(method), system.contract.node("n")
    (declared,) = system.plan.node("n").methods
    job = method_job(system, node, declared)
    cut = method_slice(tool, job)
    (there,) = cut.system.plan.node("n").methods
    sliced = method_job(cut.system, cut.system.contract.node("n"), there)
    assert surroundings(tool, job, method_options(declared)) == surroundings(tool, sliced, method_options(there))
    return settle(tool, sliced, folder / "made", Limits(seconds=120))


def with_each(cases: Iterable[str]) -> list[Any]:
    """C++ is compiled for one of them; a few seconds of tests in Python are enough for every run."""
    pairs = [(method, name) for name in cases for method in METHODS if method != "fuzz" or name == "a number"]
    return [
        pytest.param(*pair, marks=_MARKS.get(pair[0], []) if pair != ("hypothesis", "a number") else [])
        for pair in pairs
    ]


@pytest.mark.parametrize(("method", "name"), with_each(DIFFERS))
def test_another_first_value_than_the_plans_supports_nothing(method: str, name: str, tmp_path: Path) -> None:
    report = asked(written(tmp_path, method, *DIFFERS[name]), method)
    verdicts = {o.verdict for o in report.outcomes if "/guarantee/" in o.obligation}
    assert verdicts <= {Verdict.REFUTED, Verdict.ERROR}, [o.summary for o in report.outcomes]
    assert all("initial" in o.summary for o in report.outcomes if "/guarantee/" in o.obligation)


@pytest.mark.parametrize(("method", "name"), with_each(FITS))
def test_the_same_first_value_changes_nothing(method: str, name: str, tmp_path: Path) -> None:
    report = asked(written(tmp_path, method, *FITS[name]), method)
    told = [o for o in report.outcomes if "/guarantee/" in o.obligation]
    assert all(o.verdict.supports for o in told), [o.summary for o in told]


def test_another_first_value_asks_again(tmp_path: Path) -> None:
    found = set()
    for last, start in (("2", 2), ("3", 2), ("Start", 2), ("Start", 3)):
        system = load_system(written(tmp_path, "python", last, "idle", start))
        (declared,) = system.plan.node("n").methods
        job = method_job(system, system.contract.node("n"), declared)
        found.add(surroundings(backend("python"), job, method_options(declared)))
    assert len(found) == 4


def test_what_a_program_keeps_comes_from_nowhere_else(tmp_path: Path) -> None:
    with pytest.raises(Rejected) as caught:
        load_system(written(tmp_path, "python", "2", "idle", 2, "other.v"))
    assert [d.code for d in caught.value.diagnostics] == ["PLAN110"]

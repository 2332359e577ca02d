"""The page for a tool qualification: its data name tests that exist, and its figures are counted again."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from assurance.sample import case as make_case
from assurance.sample import evidence, guarantee, node_plan, system
from conformance import test_shipped_backends
from hypothesis_backend.faults import FAULTS
from hypothesis_backend.test_faults import UNSEEN

from avow.base.packaged import packaged
from avow.base.verdict import Link, Object, Verdict
from avow.conformance.suite import Conformance
from avow.evidence.record import Evidence
from avow.report.qualification import DATA, independence, render_qualification

KEPT = packaged("avow.report", DATA)
ROOT = Path(__file__).parents[2]


def test_each_test_that_it_names_is_there() -> None:
    named = [test for item in (*KEPT["functions"], *KEPT["mended"]) for test in item["tests"]]
    for test in named:
        path, _, function = test.partition("::")
        assert (ROOT / path).exists(), test
        assert not function or re.search(rf"^def {function}\(", (ROOT / path).read_text("utf-8"), re.M), test
    ids = [item["id"] for item in (*KEPT["functions"], *KEPT["problems"])]
    assert len(set(ids)) == len(ids)


def test_the_figures_of_seeded_faults_are_those_of_the_tests() -> None:
    assert test_shipped_backends
    found = {}
    for suite in Conformance.__subclasses__():
        if suite.__module__.endswith("test_shipped_backends"):
            verdicts = [verdict for seeded in suite.seeded for verdict in seeded.verdicts.values()]
            found[suite.backend.name] = [len(verdicts), sum(not verdict.supports for verdict in verdicts)]
    assert KEPT["seeded"] == found
    (said,) = [item["text"] for item in KEPT["problems"] if item["of"] == ["hypothesis"]]
    kinds, chance = len(FAULTS), len(UNSEEN)
    assert f"of {kinds} kinds of seeded faults, {kinds - chance} are found in each run, and {chance} only by" in said


TWICE = {"reviewers": ["A. Person", "Anna Person"]}
"""Two names of one person."""
G = guarantee("n", "g")
PROOF = evidence(G, Verdict.PROVED, "hoare", tool="z3")


@pytest.mark.parametrize(
    ("records", "counts"),
    [
        ((), (0, 0, 0, 0)),
        ((PROOF,), (1, 1, 1, 0)),
        ((PROOF, evidence(G, Verdict.PROVED, "dafny", tool="z3")), (1, 1, 1, 0)),  # one solver behind both
        ((PROOF, evidence(G, Verdict.TESTED, "hypothesis", tool="hypothesis", of=Object.SOURCE)), (2, 1, 2, 0)),
        ((PROOF, evidence(G, Verdict.UNKNOWN, "hypothesis", tool="hypothesis")), (1, 1, 1, 0)),
        (
            (
                PROOF,
                evidence(
                    G,
                    Verdict.REVIEWED,
                    "review",
                    tool="x",
                    link=Link.GUIDED,
                    details=TWICE,
                ),
            ),
            (2, 2, 1, 1),
        ),
    ],
)
def test_independence_by_tool_front_end_object_and_person(
    records: tuple[Evidence, ...], counts: tuple[int, ...]
) -> None:
    plans = [node_plan("n", "high", "hoare", "dafny", "hypothesis", "review")]
    found = make_case(system({"n": ["g"]}, plans=plans), [G], list(records))
    row = independence(found.guarantees[0])
    assert (row.tools, len(row.ends), len(row.objects), len(row.persons)) == counts
    page = render_qualification(found)
    assert all(word in page for word in ("Avow is not qualified", "TOR-1", "KP-1", "Independence"))

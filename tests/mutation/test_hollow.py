"""Evidence that would say the same of anything supports nothing: seeded, hunted, and not believed again."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from assurance.sample import RUN, case, evidence, guarantee, node_plan, system

from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import Ledger
from avow.evidence.record import Evidence
from avow.evidence.status import Status
from avow.pipeline.discharge import discharge
from avow.pipeline.mutation import Score, _noticed, hunt
from avow.pipeline.run_info import Run
from avow.pipeline.workload import Survey, survey

BACKEND = """
from avow.backend_kit.protocol import Backend, Report
from avow.base.verdict import Link, Outcome, Verdict

class Any(Backend):
    name, title, version, green_means = "any", "judges as it is told", "1", ""
    strength, link = Verdict.TESTED, Link.GENERATED
    options_schema = {"type": "object"}
    def discharge(self, job, folder, limits):
        said = {
            "yes": lambda text: Verdict.TESTED,
            "seldom": lambda text: Verdict.REFUTED if "19" in text else Verdict.TESTED,
            "lost": lambda text: Verdict.TESTED if text == job.options["known"] else Verdict.UNKNOWN,
        }
        judge = said[job.options["says"]]
        return Report(tuple(Outcome(o.id, judge(o.formula), "so it is") for o in job.obligations), "any", "1")

BACKEND = Any()
"""
KNOWN = "in.r < 18 → out.hot"


@pytest.fixture
def place(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    (workspace / "any_backend_of_test_hollow.py").write_text(BACKEND)
    folder = workspace / "contracts" / "s"
    folder.mkdir()
    (folder / "system.rcl").write_text(
        "node n { inputs(r : REAL) outputs(hot : BOOL) topics(float64 r matches(in.r), bool hot matches(out.hot))\n"
        "  guarantee g (in.r < 18 -> out.hot) }"
    )
    methods = "".join(
        f"\n      - any: {{id: {says}, says: {says}, known: '{KNOWN}'}}" for says in ("yes", "seldom", "lost")
    )
    plan = f"plugins: [any_backend_of_test_hollow]\nnodes:\n  n:\n    methods:{methods}\n"
    (folder / "plan.yaml").write_text(plan)
    monkeypatch.syspath_prepend(str(workspace))
    monkeypatch.setenv("PYTHONPATH", str(workspace))  # where a worker stands is not where it looks for modules
    monkeypatch.delenv("PYTEST_CURRENT_TEST", raising=False)
    return Workspace(workspace)


@pytest.mark.slow
def test_a_method_that_supports_everything_is_found_out(place: Workspace) -> None:
    surveyed = survey(place.contracts / "s")
    assert isinstance(surveyed, Survey), surveyed
    works = [w for w in surveyed.catalogue.works if not w.is_engine]
    os.environ.pop("PYTEST_CURRENT_TEST", None)
    for work in works:
        discharge(place, work, Run("first", False))
    scores = {s.method: s for s in hunt(place, tuple(works), Run("first", False), 9, 1)}
    assert scores["yes"].hollow
    every = scores["yes"].mutants
    assert (scores["yes"].killed, len(scores["yes"].survivors)) == (0, every)
    assert every > 2
    assert not scores["seldom"].hollow
    assert 0 < scores["seldom"].killed < every
    # what does not understand the question has not seen through it
    assert (scores["lost"].mutants, len(scores["lost"].unjudged), scores["lost"].hollow) == (0, every, False)
    newest = {e.evidence.method: e.evidence for e in Ledger(place.ledger("s")).records()}
    assert newest["yes"].vacuous
    assert "accepts every mutant" in newest["yes"].summary
    assert newest["lost"].details["mutation"]["unjudged"]
    assert set(newest["lost"].details["mutation"]["unjudged_because"]) == {"so it is"}
    # of each mutant that it let pass, where it differs, and whether the method should have seen it
    told = newest["yes"].details["mutation"]["differences"]
    assert [d["change"] for d in told] == list(scores["yes"].survivors)
    negated = next(d for d in told if d["change"] == "the whole is negated")
    assert negated["forced"]
    assert negated["mutant"] == "in.r < 18 → ¬out.hot"
    assert "`yes` has not looked there" in negated["why"]
    shifted = next(d for d in told if d["change"] == "18 becomes 19")
    assert not shifted["forced"]
    assert ["out.hot", "FALSE"] in shifted["answer"]
    assert json.loads(json.dumps(newest["seldom"].details["mutation"]))["killed"] == scores["seldom"].killed


@pytest.mark.parametrize(
    ("outcome", "record", "noticed"),
    [
        (Verdict.REFUTED, Verdict.TESTED, True),
        (Verdict.TESTED, Verdict.TESTED, False),
        (Verdict.UNKNOWN, Verdict.PROVED, True),
        (Verdict.UNKNOWN, Verdict.CHECKED, None),
        (Verdict.UNKNOWN, Verdict.TESTED, None),
        (Verdict.ERROR, Verdict.PROVED, None),
        (Verdict.NOT_RUN, Verdict.PROVED, None),
    ],
)
def test_what_counts_as_noticed(outcome: Verdict, record: Verdict, noticed: bool | None) -> None:
    about = evidence("n.g", record, strength=record)
    assert _noticed(Outcome("o", outcome, ""), about) is noticed
    assert _noticed(Outcome("o", Verdict.UNKNOWN, "", details={"retry": True}), about) is None
    assert _noticed(Outcome("o", Verdict.TESTED, "", vacuous=True), about) is None


def scored(killed: int, survivors: int, run: str = RUN.id) -> Evidence:
    score = Score("o", "hoare", killed, ("x",) * survivors, ())
    mutation = {"killed": score.killed, "mutants": score.mutants, "survivors": list(score.survivors)}
    return evidence(
        "n.g", vacuous=score.hollow, details={"mutation": mutation}, run=run, started="2026-11-21T11:00:00Z"
    )


PROOF = evidence("n.g")
LATER = evidence("n.g", run="later", started="2026-11-21T12:00:00Z")


@pytest.mark.parametrize(
    ("records", "fresh", "status"),
    [
        ([PROOF], False, Status.PROVED),
        ([PROOF, scored(3, 1)], False, Status.PROVED),
        ([PROOF, scored(0, 4)], False, Status.VACUOUS),
        ([PROOF, scored(0, 4), LATER], False, Status.VACUOUS),
        ([PROOF, scored(0, 4), LATER], True, Status.VACUOUS),
        ([PROOF, scored(0, 4), scored(3, 1)], False, Status.PROVED),
        ([PROOF, scored(3, 1), scored(0, 4)], False, Status.VACUOUS),
        ([PROOF, scored(0, 4), evidence("n.g", Verdict.REFUTED)], False, Status.REFUTED),
    ],
)
def test_hollow_evidence_is_not_believed(records: list[Evidence], fresh: bool, status: Status) -> None:
    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "hoare")])
    run = replace(RUN, id="later", fresh=True) if fresh else RUN
    found = case(subject, [guarantee("n", "g")], records, run=run)
    assert found.obligations[0].status is status


def test_another_method_still_counts() -> None:
    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "hoare", "hypothesis")])
    tested = evidence("n.g", Verdict.TESTED, "hypothesis")
    found = case(subject, [guarantee("n", "g")], [PROOF, scored(0, 4), tested])
    assert found.obligations[0].status is Status.TESTED


def test_scores_are_in_the_report(tmp_path: Path) -> None:
    from avow.report import render_all

    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "hoare")])
    mutation = {"killed": 3, "mutants": 4, "survivors": ["18 becomes 19"], "unjudged": ["low becomes mid"]}
    found = case(subject, [guarantee("n", "g")], [evidence("n.g", details={"mutation": mutation})])
    render_all(found, tmp_path)
    score = "3 of 4 mutants killed; not noticed: 18 becomes 19; not judged: low becomes mid"
    for name in ("node-n.html", "report.md"):
        assert score in (tmp_path / name).read_text(), name
    listed = json.loads((tmp_path / "report.json").read_text())["obligations"][0]["evidence"][0]["entry"]["evidence"]
    assert listed["details"]["mutation"] == mutation

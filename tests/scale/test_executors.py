"""However jobs are executed: the same records, and nothing recorded that is no answer."""

from __future__ import annotations

import dataclasses
import json
import pickle
from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import ledger_of
from avow.pipeline import dispatch, processes
from avow.pipeline.discharge import discharge
from avow.pipeline.remote import remote
from avow.pipeline.requests import Response, read_response, request_bytes, request_digest, response_bytes
from avow.pipeline.run_info import Run
from avow.pipeline.worker import answer

from .machines import Answering, one, recorded, settle, works


@pytest.mark.nightly
def test_the_same_is_recorded_however_jobs_are_executed(place: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    forked = settle(place)
    assert {record["verdict"] for record in forked} >= {"proved"}  # type: ignore[index]
    monkeypatch.setenv(processes.PLAIN, "1")
    few = works(place)[:2]
    place.ledger("made").unlink()
    ledger_of.cache_clear()
    run = Run("b", False)
    for work in few:
        discharge(place, work, run)
    anew = recorded(place)
    assert anew == [record for record in forked if record in anew]
    assert len(anew) == sum(len(work.obligations) for work in few)
    monkeypatch.delenv(processes.PLAIN)
    assert settle(place, remote(Answering())) == forked


def test_no_answer_but_a_whole_one_to_the_request_is_taken(place: Workspace) -> None:
    work, request = one(place)
    data = request_bytes(request)
    digest, good = request_digest(data), answer(data)
    whole = read_response(good, digest)
    assert whole.report is not None
    first, *rest = whole.report.outcomes
    assert {o.verdict for o in dispatch.judged(work, work.obligations, whole).outcomes} == {Verdict.PROVED}

    def with_outcomes(*outcomes: object) -> bytes:
        report = dataclasses.replace(whole.report, outcomes=outcomes)  # type: ignore[type-var]
        return response_bytes(dataclasses.replace(whole, report=report))

    wrong: list[object] = [
        *(pickle.dumps(print), b"", good[:-9], "text", None, 3, b"{}", b"null", b"[" * 10**5),
        answer(request_bytes(one(place, "sanity")[1])),
        json.dumps({**json.loads(good), "failure": "and a reason"}).encode(),
        response_bytes(Response(digest)),
        with_outcomes(first) if rest else with_outcomes(),
        with_outcomes(first, *rest, first),
    ]
    for said in wrong:
        report = dispatch.judged(work, work.obligations, read_response(said, digest))
        assert Verdict.ERROR in {o.verdict for o in report.outcomes}


def test_a_worker_with_other_tools_refuses_and_says_which(place: Workspace) -> None:
    data = request_bytes(dataclasses.replace(one(place)[1], tools=(("dafny", "9.9", "x"),)))
    said = read_response(answer(data), request_digest(data))
    assert said.report is None
    assert "dafny 9.9 wanted" in said.failure


def test_a_tool_that_no_worker_offers_is_not_waited_for(tmp_path: Path, place: Workspace) -> None:
    folder = place.contracts / "made"
    (folder / "plan.yaml").write_text(
        (folder / "plan.yaml").read_text().replace("[hoare: {program", "[dafny: {implementation")
    )
    run = Run("a", False, remote=remote(Answering()))
    work = next(w for w in works(place, run.remote) if w.engine == "dafny")
    report = dispatch.settle(place, work, work.obligations, tmp_path, run)
    assert {o.verdict for o in report.outcomes} == {Verdict.NOT_RUN}, report.outcomes[0].summary
    assert "no worker of the cluster offers dafny" in report.outcomes[0].summary

"""Whatever carries works about: the same records, and nothing recorded that is no answer."""

from __future__ import annotations

import dataclasses
import json
import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import wait_for

from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import ledger_of
from avow.pipeline import asking, forks
from avow.pipeline.discharge import discharge
from avow.pipeline.executors import Asked, Came, Desk
from avow.pipeline.requests import Response, Unanswered, read_response, response_bytes
from avow.pipeline.run_info import Run
from avow.pipeline.worker import answer

from .machines import Odd, one, recorded, settle, works


@pytest.mark.nightly
def test_the_same_is_recorded_however_works_are_carried_about(
    place: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    forked = settle(place)
    assert {record["verdict"] for record in forked} >= {"proved"}  # type: ignore[index]
    monkeypatch.setenv(forks.PLAIN, "1")
    few = works(place)[:2]
    place.ledger("made").unlink()
    ledger_of.cache_clear()
    run = Run("b", False)
    for work in few:
        discharge(place, work, run)
    anew = recorded(place)
    assert anew == [record for record in forked if record in anew]
    assert len(anew) == sum(len(work.obligations) for work in few)
    monkeypatch.delenv(forks.PLAIN)
    assert settle(place, asking.elsewhere(Odd())) == forked


def test_no_answer_but_a_whole_one_to_what_was_asked_is_taken(place: Workspace) -> None:
    work, asked = one(place)
    good = answer(asked.data)
    other = answer(one(place, "sanity")[1].data)
    outer = json.loads(good)
    lying = json.dumps({**outer, "body": outer["body"].replace("proved", "tested")}).encode()
    wrong: list[object] = [
        pickle.dumps(print),
        b"",
        good[:-9],
        lying,
        other,
        "text",
        None,
        3,
        b"{}",
        b"null",
        b"[" * 10**5,
    ]
    for said in wrong:
        with pytest.raises(Unanswered):
            read_response(said, asked.data)
        report = asking.judged(work, work.obligations, asked.data, said, {})
        assert {o.verdict for o in report.outcomes} == {Verdict.ERROR}
    assert {o.verdict for o in asking.judged(work, work.obligations, asked.data, good, {}).outcomes} == {Verdict.PROVED}


def test_an_answer_with_too_little_or_too_much_is_none(place: Workspace) -> None:
    work, asked = one(place)
    whole = read_response(answer(asked.data), asked.data)
    assert whole.report is not None
    first = whole.report.outcomes[0]
    for outcomes in ((first,), (*whole.report.outcomes, first)):
        told = dataclasses.replace(whole, report=dataclasses.replace(whole.report, outcomes=outcomes))
        report = asking.judged(work, work.obligations, asked.data, response_bytes(told), {})
        assert Verdict.ERROR in {o.verdict for o in report.outcomes}
    neither = response_bytes(Response(asked.key, None))
    assert asking.judged(work, work.obligations, asked.data, neither, {}).outcomes[0].verdict is Verdict.ERROR


def test_a_worker_with_other_tools_refuses_and_says_which(place: Workspace) -> None:
    _, asked = one(place)
    other = Asked.of(dataclasses.replace(asked.request, tools=(("dafny", "9.9", "x"),)))
    said = read_response(answer(other.data), other.data)
    assert said.report is None
    assert "dafny 9.9 wanted" in said.refused


def test_an_answer_that_differs_from_the_first_is_an_alarm(
    place: Workspace, capsys: pytest.CaptureFixture[str]
) -> None:
    _, asked = one(place)
    good = read_response(answer(asked.data), asked.data)
    assert good.report is not None
    worse = tuple(dataclasses.replace(o, verdict=Verdict.REFUTED) for o in good.report.outcomes)
    bad = dataclasses.replace(good, report=dataclasses.replace(good.report, outcomes=worse))

    class Two(Odd):
        def submit(self, asked: Asked) -> None:
            self.came.put(Came(asked.key, response_bytes(good)))

        def results(self) -> Iterator[Came]:
            yield self.came.get()
            yield Came(asked.key, response_bytes(good))
            yield Came(asked.key, response_bytes(bad))
            yield Came("nobody's", response_bytes(bad))

    desk = Desk(Two(), asking._said)
    _, came = desk.ask(asked.request)
    assert came.data == response_bytes(good)
    wait_for(lambda: len(desk.alarms) == 2)
    assert "differently" in capsys.readouterr().err


def test_a_tool_that_no_worker_offers_is_not_waited_for(tmp_path: Path, place: Workspace) -> None:
    folder = place.contracts / "made"
    (folder / "plan.yaml").write_text(
        (folder / "plan.yaml").read_text().replace("[hoare: {program", "[dafny: {implementation")
    )
    run = Run("a", False, elsewhere=asking.elsewhere(Odd()))
    work = next(w for w in works(place, run.elsewhere) if w.engine == "dafny")
    report = asking.settle(place, work, work.obligations, tmp_path, run)
    assert {o.verdict for o in report.outcomes} == {Verdict.NOT_RUN}, report.outcomes[0].summary
    assert "no worker of the cluster offers dafny" in report.outcomes[0].summary

"""After an edit only questions that are others now are put to the solver; what was kept decides nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from calculus.make import all_obligations, settle_all
from helpers import some

from avow.backend_kit.protocol import Limits
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.calculus import entailment
from avow.calculus.composition import Composition, compose
from avow.calculus.entailment import KeptAnswers, keeping
from avow.calculus.obligations import reestablished
from avow.evidence.ledger import ledger_of
from avow.kernel.solvers import Reply
from avow.pipeline.discharge import discharge
from avow.pipeline.dispatch import _earlier, read_answers
from avow.pipeline.recheck import still_counts
from avow.pipeline.run_info import Run
from avow.pipeline.work import COMPOSE, catalogue
from avow.solving.questions import Entailment
from avow.system.load import load_path, load_system

from .made import chain, fan


def settle(folder: Path, text: str, answers: KeptAnswers, known: frozenset[str] = frozenset()) -> dict[str, Verdict]:
    """Obligation → verdict, of those whose digests are not `known`."""
    composition = made(folder, text)
    obligations = [o for o in all_obligations(composition) if o.digest not in known]
    with keeping(answers):
        outcomes = settle_all(composition, obligations, Limits(seconds=20))
    return {o.obligation.rpartition("/")[2]: o.verdict for o in outcomes}


def made(folder: Path, text: str) -> Composition:
    path = folder / "system.rcl"
    path.write_text(text)
    return compose(load_path(path))


def again(answers: KeptAnswers) -> KeptAnswers:
    return KeptAnswers.read(answers.written())


EDITS = {
    "nothing": ("x", "x", 0),
    "a guarantee far upstream": ("out.x0 >= 0", "out.x0 >= 3", 3),  # of one consumer: the engine's, the kernel's two
    "a name": ("guarantee g0 ( out.x0", "guarantee first ( out.x0", 3),
    "the last one": ("out.x9 >= in.x8", "out.x9 >= in.x8 + 1", 0),  # nobody reads it
}


@pytest.mark.parametrize("name", some(EDITS, 2, slow=2))
def test_an_edit_asks_only_what_is_another_question_now(tmp_path: Path, name: str) -> None:
    old, new, most = EDITS[name]
    text, first = chain(10), KeptAnswers()
    before = settle(tmp_path, text, first)
    assert first.asked >= 9
    later = again(first)
    after = settle(tmp_path, text.replace(old, new), later)
    assert later.asked <= most
    assert set(before.values()) == set(after.values()) == {Verdict.PROVED}


def test_one_consumer_of_many(tmp_path: Path) -> None:
    first = KeptAnswers()
    settle(tmp_path, fan(12), first)
    later = again(first)
    settle(tmp_path, fan(12).replace("out.y7 >= in.x", "out.y7 >= in.x + 1"), later)
    assert 0 < later.asked <= 3 < first.asked


def test_what_does_not_hold_is_asked_again_and_never_kept(tmp_path: Path) -> None:
    wrong, first = chain(5).replace("out.x0 >= 0", "out.x0 >= -1"), KeptAnswers()
    before = settle(tmp_path, wrong, first)
    assert before["whole.n1.a0"] is Verdict.REFUTED
    later = again(first)
    assert settle(tmp_path, wrong, later) == before
    assert later.asked > 0


# n3 assumes more than n0 to n2 give; n6 assumes what only n3, three nodes before it, carries
OPEN = chain(9).replace("in.x2 >= 0", "in.x2 >= 1").replace("in.x5 >= 0", "in.x5 >= 1")


@pytest.mark.slow
def test_what_is_not_asked_for_is_not_asked_again_because_it_does_not_hold(tmp_path: Path) -> None:
    first = KeptAnswers()
    before = settle(tmp_path, OPEN, first)
    assert before["whole.n3.a0"] is Verdict.REFUTED
    known = frozenset(o.digest for o in all_obligations(made(tmp_path, OPEN)))
    edited = OPEN.replace("out.x7 >= in.x6", "out.x7 >= in.x6 + 1")
    later = again(first)
    now = settle(tmp_path, edited, later, known)
    assert sorted(now) == ["whole.n7.a0", "whole.n8.a0"]
    assert later.asked == 1  # the engine's, of n8; the kernel has nothing to establish behind what is refuted
    assert now.items() <= settle(tmp_path, edited, KeptAnswers()).items()
    # the one that did not hold stands now, and whoever rests on it
    mended, later = OPEN.replace("out.x0 >= 0", "out.x0 >= 1"), again(later)
    whole = settle(tmp_path, mended, later, known)
    assert whole == settle(tmp_path, mended, KeptAnswers())
    assert set(whole.values()) == {Verdict.PROVED}


def test_what_cannot_be_read_is_nothing() -> None:
    for text in ("", "[]", "{", '{"a": 1}', '{"a": [1]}', '{"a": ["b", 2, 3]}', '{"a": "yes"}', "null"):
        assert not KeptAnswers.read(text).before
        assert not read_answers(text).before
    assert not read_answers('{"engine": "another", "answers": "{}"}').before


def test_a_lie_that_was_kept_proves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel asks by itself, in every run."""
    path = tmp_path / "system.rcl"
    path.write_text(chain(3).replace("out.x0 >= 0", "out.x0 >= -1"))
    system = load_path(path)
    composition = compose(system)
    with monkeypatch.context() as patch:
        patch.setattr(entailment, "_implied", lambda *_: Entailment(Verdict.PROVED, needed=("n0.g0",)))
        patch.setattr(KeptAnswers, "find", lambda *_: Reply.UNSAT)
        with keeping(KeptAnswers()):
            outcomes = settle_all(composition, all_obligations(composition), Limits(seconds=20))
    lied = next(o for o in outcomes if o.obligation.endswith("whole.n1.a0"))
    assert lied.verdict is Verdict.PROVED
    from avow.calculus.certificates import Certificates

    assert reestablished(Certificates(compose(system), composition.certificates.made), lied.obligation) is None


@pytest.mark.slow
def test_answers_are_kept_beside_the_evidence_and_bound_to_it(tmp_path: Path) -> None:
    workspace, folder = Workspace(tmp_path), tmp_path / "contracts" / "made"
    folder.mkdir(parents=True)
    (folder / "system.rcl").write_text(chain(3))
    (folder / "plan.yaml").write_text("system: made\ncontract: system.rcl\n")
    work = next(w for w in catalogue(load_system(folder)).works if w.engine == COMPOSE)
    assert _earlier(workspace, work, Run("first", False)) == ""
    discharge(workspace, work, Run("first", False))
    kept = _earlier(workspace, work, Run("second", False))
    assert read_answers(kept).before
    assert _earlier(workspace, work, Run("second", True)) == ""  # a fresh run believes no earlier one
    record = ledger_of(workspace.ledger("made")).records()[-1].evidence
    assert still_counts(record, tmp_path, work.system, Run("third", False))
    path = tmp_path / next(p for p in record.outputs if p.endswith("/answers.json"))
    path.write_text(kept.replace("unsat", "sat"))
    assert _earlier(workspace, work, Run("third", False)) == ""

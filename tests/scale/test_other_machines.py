"""What is looked at on a cluster's worker: it counts where it is as on this machine, or not at all."""

from __future__ import annotations

import dataclasses
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from helpers import some, wait_for

from avow.backend_kit.protocol import Report
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.record import RETRY
from avow.isolation import tracing
from avow.isolation.observed import Observed, Seen, look
from avow.pipeline import dispatch, worker
from avow.pipeline import work as work_module
from avow.pipeline.discharge import discharge, open_obligations
from avow.pipeline.remote import remote
from avow.pipeline.requests import Request, Response
from avow.pipeline.run_info import Run
from avow.pipeline.work import Work

from .machines import HANGS, Answering, Machines, one, with_dafny, works


class Seeing(Answering):
    """A worker on another machine, whose answers report what was observed there."""

    def __init__(self, observed: Sequence[Observed]) -> None:
        self.observed = tuple(observed)

    def run(self, request: Request) -> Response:
        with pytest.MonkeyPatch.context() as there:
            for module in (work_module, worker):
                there.setattr(module, "tool_identities", lambda tool, offered=None: request.tools)
            good = super().run(request)
        assert good.report is not None
        seen = dataclasses.replace(good.report, observed=self.observed)
        return dataclasses.replace(good, report=seen, worker="wk\x1b1")


def as_it_is(kind: Seen, path: Path) -> Observed:
    return Observed(kind, str(path), "" if kind is Seen.MISSING else look(kind, str(path)))


def test_what_a_worker_saw_is_held_against_this_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rule alone, for every kind of row: as it is, and as it is not."""
    (tmp_path / "folder").mkdir()
    file = tmp_path / "folder" / "file"
    file.write_text("1")
    gone = tmp_path / "gone"
    monkeypatch.setattr(tracing, "traces", lambda: True)
    rows = {
        Seen.READ: file,
        Seen.MISSING: gone,
        Seen.LISTING: file.parent,
        Seen.FOLDER: file.parent,
        Seen.STATE: file,
        Seen.KIND: file,
        Seen.MODULES: Path("module path"),
    }
    for kind, path in rows.items():
        row = as_it_is(kind, path)
        assert not dispatch.unlike_here([row], tmp_path), kind
        other = row._replace(digest="0" * 64) if kind is not Seen.MISSING else as_it_is(kind, file)
        assert dispatch.unlike_here([row, other], tmp_path) == (other,)
    outside = Observed(Seen.OUTSIDE, "the network")
    assert dispatch.unlike_here([outside], tmp_path) == (outside,)
    assert {*rows, Seen.OUTSIDE} == set(Seen)
    relative = as_it_is(Seen.READ, file)._replace(path="folder/file")  # of the workspace
    assert not dispatch.unlike_here([relative], tmp_path)
    assert dispatch.unlike_here([relative], tmp_path / "other") == (relative,)


def first_of(place: Workspace, run: Run) -> tuple[Work, Report]:
    work = next(w for w in works(place, run.remote) if w.engine == "hoare")
    return work, dispatch.settle(place, work, work.obligations, place.root, run)


def test_what_holds_here_too_stays_on_record_and_goes_stale_here(place: Workspace, tmp_path: Path) -> None:
    header = tmp_path / "header"
    header.write_text("1")
    rows = (as_it_is(Seen.READ, header), as_it_is(Seen.MISSING, tmp_path / "settings"))
    run = Run("a", False, remote=remote(Seeing(rows)))
    work, report = first_of(place, run)
    assert report.observed == rows
    assert {o.verdict for o in report.outcomes} == {Verdict.PROVED}, [o.summary for o in report.outcomes]
    discharge(place, work, run)
    assert not open_obligations(place, work, Run("b", False))
    header.write_text("2")
    assert open_obligations(place, work, Run("b", False))
    header.write_text("1")
    assert not open_obligations(place, work, Run("b", False))
    (tmp_path / "settings").touch()
    assert open_obligations(place, work, Run("b", False))


@pytest.mark.parametrize("kind", some([Seen.READ, Seen.MISSING, Seen.OUTSIDE], 1, slow=2))
def test_what_is_otherwise_on_a_worker_never_counts_unseen(
    place: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kind: Seen
) -> None:
    """It is run again where its tools are here; else its answer is never reused."""
    header = tmp_path / "header"
    header.write_text("1")
    same, other = as_it_is(Seen.READ, place.contracts / "made" / "system.rcl"), Observed(kind, str(header), "")
    seeing = Seeing([same, other])
    _, report = first_of(place, Run("a", False, remote=remote(seeing)))
    assert not report.observed, "it was done here, where nothing was looked at"
    assert {o.verdict for o in report.outcomes} == {Verdict.PROVED}, [o.summary for o in report.outcomes]
    said = capsys.readouterr().err
    assert f"{header} (on wk 1)" in said
    assert "done again here" in said
    # a tool that only the workers have
    theirs = ("z3", "9.9", "x")
    monkeypatch.setattr(Seeing, "offers", lambda self: {"wk1": frozenset([theirs])})
    seeing = Seeing([same, other])
    run = Run("b", False, remote=remote(seeing))
    work, report = first_of(place, run)
    for outcome in report.outcomes:
        assert outcome.verdict is Verdict.PROVED
        assert outcome.details[RETRY]
        assert "re-run in every run" in outcome.summary
        assert f"{header} (on wk 1)" in outcome.summary
    assert same in report.observed
    assert not {o.digest for o in report.observed if o.kind is Seen.OUTSIDE} - {""}
    discharge(place, work, run)
    assert open_obligations(place, work, Run("c", False, remote=run.remote)), "the next run asks again"
    seeing.observed = (same,)
    run = Run("c", False, remote=run.remote)
    assert {o.verdict for o in discharge(place, work, run)} == {Verdict.PROVED}
    assert not open_obligations(place, work, Run("d", False, remote=run.remote))


def test_a_refutation_stays_one_whatever_the_worker_saw(place: Workspace) -> None:
    good = Answering().run(one(place)[1]).report
    assert good is not None
    bad = tuple(dataclasses.replace(o, verdict=Verdict.REFUTED) for o in good.outcomes)
    row = Observed(Seen.READ, "/etc/other", "0")
    report = dispatch._undeclared(dataclasses.replace(good, outcomes=bad, observed=(row,)), [row], "wk1")
    assert {o.verdict for o in report.outcomes} == {Verdict.REFUTED}
    assert all(o.details[RETRY] for o in report.outcomes)


READS = """#!/bin/sh
folder={folder}
case "$*" in *version*) echo 4.9.1;; *) cat $folder/conf; exit 4;; esac
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bwrap") is None or not tracing.traces(), reason="needs bubblewrap and strace")
def test_of_two_machines_only_what_is_as_here_is_on_record(
    place: Workspace,
    machines: Machines,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """For real: one worker sees another file at the place of the tool's settings."""
    conf, theirs = tmp_path / "conf", tmp_path / "theirs"
    conf.write_text("ours")
    theirs.write_text("theirs")
    with_dafny(place, tmp_path, monkeypatch, READS.format(folder=tmp_path))
    other = ("bwrap", "--dev-bind", "/", "/", "--unshare-uts", "--hostname", "wk2", "--die-with-parent")
    for around, told in (((), ""), ((*other, "--bind", str(theirs), str(conf)), f"{conf} (on wk2)")):
        only = machines.worker(*around)
        try:
            with machines.cluster() as cluster:
                there = remote(cluster)
                work = next(w for w in works(place, there) if w.engine == "dafny")
                report = dispatch.settle(place, work, work.obligations, tmp_path, Run("a", False, remote=there))
                (row,) = [o for o in report.observed if o.path == str(conf)]
                assert row == as_it_is(Seen.READ, conf)
                assert not dispatch.unlike_here(report.observed, place.root)
                assert told in capsys.readouterr().err
        finally:
            only.kill()
            only.wait()


@pytest.mark.slow
@pytest.mark.parametrize("signal_sent", some([signal.SIGKILL, signal.SIGINT], 1))
def test_a_run_that_ends_leaves_no_tool_on_a_worker(
    place: Workspace, machines: Machines, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, signal_sent: signal.Signals
) -> None:
    with_dafny(place, tmp_path, monkeypatch, HANGS.format(seconds=machines.seconds))
    machines.worker()
    with machines.cluster():
        pass
    words = [sys.executable, "-m", "avow", "verify", "--on", machines.url]
    run = subprocess.Popen(words, cwd=place.root, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for(machines.hanging)
        run.send_signal(signal_sent)
        run.wait(60)
        wait_for(lambda: not machines.hanging())
    finally:
        run.kill()
        run.wait()

"""Works on a cluster of Dask: the same records, whoever of it is killed or lies."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from helpers import edit, some, wait_for

from avow.base.tools import find_tool
from avow.base.workspace import Workspace
from avow.evidence.ledger import Ledger, ledger_of
from avow.pipeline import dispatch
from avow.pipeline.discharge import discharge
from avow.pipeline.processes import Processes
from avow.pipeline.remote import remote
from avow.pipeline.requests import Response, request_bytes, request_digest
from avow.pipeline.run_info import Run

from .machines import HANGS, Machines, one, recorded, settle, with_dafny, works
from .test_certificates import Authority


def verdicts(records: list[Any]) -> dict[str, str]:
    """Of the newest record of each obligation."""
    return {record["obligation"]: record["verdict"] for record in records}


@pytest.mark.slow
def test_a_cluster_records_the_same_also_where_a_worker_is_killed(place: Workspace, machines: Machines) -> None:
    here = settle(place)
    first, _ = machines.worker(), machines.worker()
    with machines.cluster(2) as cluster:
        there = remote(cluster)
        assert settle(place, there) == here
        place.ledger("made").unlink()
        ledger_of.cache_clear()
        run = Run("a", False, remote=there)
        for number, work in enumerate(works(place, there)):
            if number == 1:
                first.send_signal(signal.SIGKILL)
            discharge(place, work, run)
        assert recorded(place) == here


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_workers_killed_at_any_time_lose_nothing_and_leave_nothing(
    place: Workspace, machines: Machines, seed: int
) -> None:
    rng = random.Random(seed)
    here = settle(place)
    workers = [machines.worker(), machines.worker()]
    over = threading.Event()

    def trouble() -> None:
        while not over.wait(0.5 + 2 * rng.random()):
            if len(cluster.offers()) == 2:  # a work that loses three workers is an error that the next run asks again
                workers.pop(rng.randrange(2)).send_signal(signal.SIGKILL)
                workers.append(machines.worker())

    try:
        with machines.cluster(2) as cluster:
            there = remote(cluster)
            place.ledger("made").unlink()
            ledger_of.cache_clear()
            threading.Thread(target=trouble, daemon=True).start()
            for run in "abcd":  # what was lost three times is asked again
                for work in works(place, there):
                    discharge(place, work, Run(run, False, remote=there))
            assert verdicts(recorded(place)) == verdicts(here)
    finally:
        over.set()
    for worker in workers:
        worker.send_signal(signal.SIGKILL)
    for process in machines.processes:
        process.kill()
        process.wait()
    wait_for(lambda: not machines.left(), 5)


@pytest.mark.slow
@pytest.mark.parametrize("how", some(["cancelled", "its worker is killed", "out of time"], 2))
def test_a_tool_that_hangs_ends_when_nobody_waits_for_it_any_more(
    place: Workspace, machines: Machines, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    with_dafny(place, tmp_path, monkeypatch, HANGS.format(seconds=machines.seconds))
    if how == "out of time":
        edit(place.contracts / "made" / "plan.yaml", ("n0.dfy", "n0.dfy, seconds: 3"))
    worker = machines.worker()
    try:
        with machines.cluster() as cluster:
            there = remote(cluster)
            work = next(w for w in works(place, there) if w.engine == "dafny")
            request = dispatch.request_of(place, work, work.obligations, place.root / "artifacts")
            assert request.wanted
            responses: list[Response] = []
            thread = threading.Thread(target=lambda: responses.append(cluster.run(request)), daemon=True)
            thread.start()
            wait_for(machines.hanging)
            match how:
                case "cancelled":
                    cluster.close()
                case "out of time":
                    thread.join(120)
                    verdicts = dispatch.judged(work, work.obligations, responses[0]).outcomes
                    assert not any(o.verdict.supports for o in verdicts)
                case _:  # the worker is killed
                    worker.send_signal(signal.SIGKILL)
            wait_for(lambda: not machines.hanging())
    finally:
        find_tool.cache_clear()


@pytest.mark.slow
def test_verify_on_a_cluster_says_what_verify_says(place: Workspace, machines: Machines, tmp_path: Path) -> None:
    """The command itself, anew and after an edit: then it reads what it kept of the nodes' texts."""
    avow = str(Path(sys.executable).with_name("avow"))
    machines.worker()
    with machines.cluster():
        pass
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")}
    contract = place.contracts / "made" / "system.rcl"

    def said(*options: str) -> tuple[int, list[tuple[str, str]], str]:
        done = subprocess.run(
            [avow, "verify", *options], cwd=place.root, env=environment, capture_output=True, text=True, check=False
        )
        assert "Traceback" not in done.stderr + done.stdout, done.stderr
        case = json.loads((place.root / "reports/made/report.json").read_text())
        found = [(o["obligation"]["node"] + o["obligation"]["name"], o["standing"]) for o in case["obligations"]]
        return done.returncode, sorted(found), done.stdout

    said("--on", machines.url)
    contract.write_text(contract.read_text().replace("in.x1 >= -1000", "in.x1 >= -900"))
    code, there, text = said("--on", machines.url)
    assert "discharge" in text
    assert said()[:2] == (code, there)


@pytest.mark.nightly
def test_what_nobody_can_do_any_more_is_not_waited_for(
    place: Workspace, machines: Machines, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """All workers go, or the scheduler itself: each work is an error that the next run asks again, and nothing hangs.
    To a worker that comes back in time the works go."""
    from avow.pipeline import cluster as there

    monkeypatch.setattr(there, "CLUSTER_LOOK", 0.1)
    worker = machines.worker()
    with machines.cluster() as cluster, ThreadPoolExecutor() as pool:
        _, request = one(place, "sanity")
        worker.send_signal(signal.SIGKILL)
        worker.wait()
        response = pool.submit(cluster.run, request)
        wait_for(lambda: "no worker of the cluster is left" in capfd.readouterr().err)
        machines.worker()
        assert response.result().report is not None
        monkeypatch.setattr(there, "CLUSTER_PATIENCE", 0.5)
        for gone in (machines.processes[-1], machines.processes[0]):
            gone.send_signal(signal.SIGKILL)
            gone.wait()
            failure = cluster.run(request).failure
            assert ("no worker" if gone is not machines.processes[0] else "scheduler") in failure
    assert "Traceback" not in capfd.readouterr().err


def test_only_a_worker_of_the_same_code_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    from avow.base.diagnostics import Rejected
    from avow.pipeline.cluster import Cluster
    from avow.pipeline.cluster_worker import offered, own_code, tools_of

    def workers(*offers: tuple[str, ...]) -> Cluster:
        found = object.__new__(Cluster)
        resources = {f"w{k}": dict.fromkeys(names, 1) for k, names in enumerate(offers)}
        monkeypatch.setattr(Cluster, "_workers", lambda self: resources)
        return found

    here = offered()
    assert own_code() in here
    other = ("avow:9.9 (0123) with Z3 1.0", *here[1:])
    assert list(workers(other, here).offers()) == ["w1"]
    assert workers(other, here).slots == 1
    with pytest.raises(Rejected, match=r"9\.9 \(0123\).*CLUSTER004"):
        workers(other).offers()
    odd = ('tool:["dafny"]', "tool:{", 'tool:["a", "b", 3]', "tool:" + "[" * 10**5, 'tool:["a", "b", "c"]', "GPU")
    assert tools_of(odd) == {("a", "b", "c")}


@pytest.mark.parametrize("why", ["its code was exchanged", "its disk is full"])
def test_a_worker_that_can_do_no_works_leaves_and_takes_none_with_it(
    place: Workspace, monkeypatch: pytest.MonkeyPatch, why: str
) -> None:
    distributed = pytest.importorskip("distributed")
    from avow.pipeline import cluster_worker, engine_code

    package = place.root / "package"
    (package / "base").mkdir(parents=True)
    (package / "base/some.py").write_text("A = 1")
    monkeypatch.setattr(engine_code, "_PACKAGE", package)
    own, left = cluster_worker.Own(engine_code.code_mark()), list[object]()
    worker = SimpleNamespace(extensions={"avow": own}, close="close", loop=SimpleNamespace(add_callback=left.append))
    monkeypatch.setattr(distributed, "get_worker", lambda: worker)
    monkeypatch.setattr(cluster_worker, "_cancelled", lambda worker: None)
    data = request_bytes(one(place)[1])
    monkeypatch.setattr(Processes, "run", lambda self, request, *more: Response(request_digest(data), failure="it"))
    assert b"it (on " in cluster_worker.perform(data)

    def full(*asked: object) -> Response:
        raise OSError(28, "No space left on device")

    if why == "its disk is full":
        monkeypatch.setattr(Processes, "run", full)
    else:
        (package / "base/some.py").write_text("A = 10")
    with pytest.raises(distributed.Reschedule):
        cluster_worker.perform(data)
    assert left == ["close"]
    assert ("No space" if "full" in why else "since this worker began") in own.unfit


@pytest.mark.parametrize(
    "text",
    some(
        [
            "",
            "dask",
            "http://a:1",
            "dask+tcp://a.example:1",
            "dask+tcp://10.0.0.1:8786",
            "dask+tls://:1",
            "dask+tls://a",
        ],
        3,
    ),
)
def test_addresses_that_are_refused(text: str) -> None:
    from avow.base.diagnostics import Rejected
    from avow.pipeline.cluster import Address

    with pytest.raises(Rejected, match="CLUSTER001"):
        Address.read(text)


def test_without_certificates_there_is_no_tls(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    from avow.base.diagnostics import Rejected
    from avow.pipeline.cluster import Address

    monkeypatch.delenv("AVOW_TLS_CA", raising=False)
    with pytest.raises(Rejected, match="CLUSTER002"):
        Address.read("dask+tls://a.example:8786").security()


@pytest.mark.nightly
def test_by_tls_the_same_and_no_word_with_whom_the_authority_does_not_know(
    place: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    from avow.base.diagnostics import Rejected
    from avow.pipeline.cluster import Address, Cluster

    ours = Authority(tmp_path, "ours")
    cert, key = ours.issue("all")
    for name, value in (("CA", str(ours.file)), ("CERT", cert), ("KEY", key)):
        monkeypatch.setenv(f"AVOW_TLS_{name}", value)
    here = settle(place)
    machines = Machines("--tls-ca-file", str(ours.file), "--tls-cert", cert, "--tls-key", key)
    try:
        machines.worker()
        with machines.cluster() as cluster:
            assert settle(place, remote(cluster)) == here
        before = Ledger(place.ledger("made")).head
        for name, (cert, key) in {
            "expired": ours.issue("late", expired=True),
            "": Authority(tmp_path, "other").issue("stranger"),
        }.items():
            monkeypatch.setenv("AVOW_TLS_CERT", cert)
            monkeypatch.setenv("AVOW_TLS_KEY", key)
            with pytest.raises(Rejected, match=f"certificate is not accepted.*{name}"):
                Cluster(Address.read(machines.url))
        assert Ledger(place.ledger("made")).head == before
    finally:
        machines.close()

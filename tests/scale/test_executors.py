"""Whatever carries works about: the same records, and nothing recorded that is no answer."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import pickle
import queue
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from helpers import edit, some

from avow.backend_kit.protocol import Limits
from avow.backend_kit.registry import backend
from avow.base.tools import find_tool
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import Ledger, ledger_of
from avow.pipeline import asking, forks
from avow.pipeline.discharge import discharge
from avow.pipeline.executors import Asked, Came, Desk, Elsewhere
from avow.pipeline.requests import Request, Response, Unanswered, read_response, response_bytes
from avow.pipeline.run_info import Run
from avow.pipeline.work import Work, catalogue, tool_identities
from avow.pipeline.worker import answer
from avow.system.load import load_system

from .made import programs
from .test_certificates import Authority


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workspace]:
    programs(tmp_path / "contracts" / "made", 3, 2)
    (tmp_path / "dodo.py").touch()
    monkeypatch.delenv("PYTEST_CURRENT_TEST", raising=False)  # with another environment it is another fork server
    yield Workspace(tmp_path)
    ledger_of.cache_clear()


def works(place: Workspace, there: Elsewhere | None = None) -> list[Work]:
    found = catalogue(load_system(place.contracts / "made"), there.tools if there else None).works
    return [work for work in found if work.cut is not None]


def recorded(place: Workspace) -> list[object]:
    """The ledger, without what differs from run to run."""
    records = [dataclasses.asdict(e.evidence) for e in Ledger(place.ledger("made")).records()]
    for record in records:
        for name in ("started", "seconds", "run"):
            del record[name]
    return sorted(json.loads(json.dumps(records, default=str)), key=lambda r: (r["obligation"], r["method"]))


def verdicts(records: list[Any]) -> dict[str, str]:
    """Of the newest record of each obligation."""
    return {record["obligation"]: record["verdict"] for record in records}


def settle(place: Workspace, there: Elsewhere | None = None) -> list[object]:
    place.ledger("made").unlink(missing_ok=True)
    ledger_of.cache_clear()
    run = Run("a", False, elsewhere=there)
    for work in works(place, there):
        discharge(place, work, run)
    return recorded(place)


class Odd:
    """Here, but answers come late, in another order, and twice."""

    def __init__(self) -> None:
        self.came: queue.SimpleQueue[Came] = queue.SimpleQueue()
        self.chance = random.Random(7)

    def offers(self) -> Mapping[str, frozenset[tuple[str, ...]]]:
        return {"odd": frozenset(tool_identities(backend("hoare")))}

    def submit(self, asked: Asked) -> None:
        came = Came(asked.key, answer(asked.data))
        for _ in range(self.chance.choice((1, 2, 3))):
            self.came.put(came)

    def results(self) -> Iterator[Came]:
        while True:
            held = [self.came.get()]
            while not self.came.empty():
                held.append(self.came.get())
            self.chance.shuffle(held)
            yield from held

    def cancel(self, keys: Collection[str]) -> None: ...
    def close(self) -> None: ...


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


def one(place: Workspace, engine: str = "hoare") -> tuple[Work, Asked]:
    work = next(w for w in works(place) if w.engine == engine)
    return work, Asked.of(asking.request_of(place, work, work.obligations, place.root / "artifacts"))


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
    until(lambda: len(desk.alarms) == 2)
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


def until(happens: object, seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not happens():  # type: ignore[operator]
        assert time.monotonic() < deadline
        time.sleep(0.02)


# -- Dask --------------------------------------------------------------------------------------------------------------


class Machines:
    """A scheduler and some workers, each a process."""

    def __init__(self, *words: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.url = f"dask+{'tls' if words else 'tcp'}://127.0.0.1:{self.port}"
        dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--host", "127.0.0.1"]
        self.processes = [subprocess.Popen([*dask, "--port", str(self.port), *words], stderr=subprocess.DEVNULL)]

    def worker(self, *around: str) -> subprocess.Popen[bytes]:
        """`around`: a command that runs it."""
        command = [*around, sys.executable, "-m", "avow", "worker", "--on", self.url, "--slots", "1"]
        marked = {**os.environ, "AVOW_TEST_CLUSTER": self.url}
        self.processes.append(
            subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=marked)
        )
        return self.processes[-1]

    @property
    def seconds(self) -> str:
        """For which a tool of this cluster hangs: an argument that no other process has. Its environment tells nothing:
        tools get none of a worker's."""
        return f"1000.{self.url.rpartition(':')[2]}"

    def left(self) -> list[str]:
        """What runs of all that the workers started, and they themselves."""
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                mark = f"AVOW_TEST_CLUSTER={self.url}".encode()
                marked = mark in (entry / "environ").read_bytes().split(b"\0")
                if marked or self.seconds.encode() in (entry / "cmdline").read_bytes().split(b"\0"):
                    found.append(entry.name)
        return found

    def close(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()


@pytest.fixture
def machines() -> Iterator[Machines]:
    pytest.importorskip("distributed")
    found = Machines()
    yield found
    found.close()


@pytest.mark.slow
def test_a_cluster_records_the_same_also_where_a_worker_is_killed(place: Workspace, machines: Machines) -> None:
    from avow.pipeline.cluster import Address, Cluster

    here = settle(place)
    first, _ = machines.worker(), machines.worker()
    cluster = Cluster(Address.read(machines.url))
    try:
        until(lambda: len(cluster.offers()) == 2)
        there = asking.elsewhere(cluster)
        assert settle(place, there) == here
        place.ledger("made").unlink()
        ledger_of.cache_clear()
        run = Run("a", False, elsewhere=there)
        for number, work in enumerate(works(place, there)):
            if number == 1:
                first.send_signal(signal.SIGKILL)
            discharge(place, work, run)
        assert recorded(place) == here
    finally:
        cluster.close()


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(3))
def test_workers_killed_at_any_time_lose_nothing_and_leave_nothing(
    place: Workspace, machines: Machines, seed: int
) -> None:
    from avow.pipeline.cluster import Address, Cluster

    rng = random.Random(seed)
    here = settle(place)
    workers = [machines.worker(), machines.worker()]
    cluster = Cluster(Address.read(machines.url))
    over = threading.Event()

    def trouble() -> None:
        while not over.wait(0.5 + 2 * rng.random()):
            if len(cluster.offers()) == 2:  # a work that loses three workers is an error that the next run asks again
                workers.pop(rng.randrange(2)).send_signal(signal.SIGKILL)
                workers.append(machines.worker())

    try:
        until(lambda: len(cluster.offers()) == 2)
        there = asking.elsewhere(cluster)
        place.ledger("made").unlink()
        ledger_of.cache_clear()
        threading.Thread(target=trouble, daemon=True).start()
        for run in "abcd":  # what was lost three times is asked again
            for work in works(place, there):
                discharge(place, work, Run(run, False, elsewhere=there))
        assert verdicts(recorded(place)) == verdicts(here)
    finally:
        over.set()
        cluster.close()
    for worker in workers:
        worker.send_signal(signal.SIGKILL)
    for process in machines.processes:
        process.kill()
        process.wait()
    until(lambda: not machines.left(), 5)


def with_dafny(place: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Let the first node have a method by Dafny, for which this stands in."""
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "dafny").write_text(script)
    (tools / "dafny").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    find_tool.cache_clear()
    folder = place.contracts / "made"
    (folder / "models" / "n0.dfy").write_text("method step(x0: int) returns (y0: int) { y0 := x0; }\n")
    edit(folder / "plan.yaml", ("hoare: {program: models/n0.imp}", "dafny: {implementation: models/n0.dfy}"))


HANGS = """#!/bin/sh
case "$*" in *version*) echo 4.9.1;; *) exec sleep {seconds};; esac
"""


@pytest.mark.slow
@pytest.mark.parametrize("how", some(["cancelled", "its worker is killed", "out of time"], 2))
def test_a_tool_that_hangs_ends_when_nobody_waits_for_it_any_more(
    place: Workspace, machines: Machines, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    from avow.pipeline.cluster import Address, Cluster

    with_dafny(place, tmp_path, monkeypatch, HANGS.format(seconds=machines.seconds))
    if how == "out of time":
        edit(place.contracts / "made" / "plan.yaml", ("n0.dfy", "n0.dfy, seconds: 3"))
    worker = machines.worker()
    cluster = Cluster(Address.read(machines.url))

    def hanging() -> bool:
        return any(b"sleep" in command(pid) for pid in machines.left())

    try:
        until(cluster.offers)
        there = asking.elsewhere(cluster)
        work = next(w for w in works(place, there) if w.engine == "dafny")
        request = asking.request_of(place, work, work.obligations, place.root / "artifacts")
        assert request.wanted
        asked = Asked.of(request)
        cluster.submit(asked)
        until(hanging)
        match how:
            case "cancelled":
                cluster.cancel([asked.key])
            case "out of time":
                came = next(cluster.results())
                verdicts = asking.judged(work, work.obligations, asked.data, came.data, {}).outcomes
                assert not any(o.verdict.supports for o in verdicts)
            case _:  # the worker is killed
                worker.send_signal(signal.SIGKILL)
        until(lambda: not hanging())
    finally:
        cluster.close()
        find_tool.cache_clear()


def command(pid: str) -> bytes:
    try:
        return (Path("/proc") / pid / "cmdline").read_bytes()
    except OSError:
        return b""


@pytest.mark.slow
def test_verify_on_a_cluster_says_what_verify_says(place: Workspace, machines: Machines, tmp_path: Path) -> None:
    """The command itself, anew and after an edit: then it reads what it kept of the nodes' texts."""
    from avow.pipeline.cluster import Address, Cluster

    avow = str(Path(sys.executable).with_name("avow"))
    machines.worker()
    cluster = Cluster(Address.read(machines.url))
    until(cluster.offers)
    cluster.close()
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


@pytest.mark.slow
def test_what_a_worker_pickles_is_not_read(
    machines: Machines, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Neither as an answer nor as an error, and what it says is not shown."""
    from avow.pipeline.cluster import Address, Cluster, _fetched

    machines.worker()
    cluster = Cluster(Address.read(machines.url))
    here = os.getpid()

    def evil(raised: bool) -> object:
        import cloudpickle
        import distributed

        class EvilError(Exception):  # made there, so that it travels by value
            def __reduce__(self) -> object:
                code = f"import os\nif os.getpid() == {here}: os.mkdir({str(tmp_path / 'ran')!r})"
                return exec, (code,)

        distributed.print("all is proved")
        distributed.get_worker().log_event("warn", {"message": cloudpickle.dumps(EvilError())})
        if raised:
            raise EvilError
        return EvilError()

    try:
        until(cluster.offers)
        request = Request("", "", "", "sanity", {}, Limits(), b"", "")
        for raised, status in ((False, "finished"), (True, "error")):
            future = cluster._client.submit(evil, raised, pure=False)
            until(lambda: future.status in ("finished", "error"))  # noqa: B023
            assert future.status == status
            came = _fetched(Asked.of(request), future)
            assert came is not None
            assert came.data is None
            assert came.failure
        assert not (tmp_path / "ran").exists()
        assert cluster.offers(), "it still hears what is said"
    finally:
        cluster.close()
    assert "proved" not in "".join(capfd.readouterr())


@pytest.mark.slow
def test_what_nobody_can_do_any_more_is_not_waited_for(
    place: Workspace, machines: Machines, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """All workers go, or the scheduler itself: each work is an error that the next run asks again, and nothing hangs.
    To a worker that comes back in time the works go."""
    from avow.pipeline import cluster as there
    from avow.pipeline.cluster import Address, Cluster

    monkeypatch.setattr(there, "CLUSTER_LOOK", 0.1)
    worker = machines.worker()
    cluster = Cluster(Address.read(machines.url))
    found = cluster.results()
    try:
        until(cluster.offers)
        _, asked = one(place, "sanity")
        worker.send_signal(signal.SIGKILL)
        worker.wait()
        cluster.submit(asked)
        until(lambda: "no worker of the cluster is left" in capfd.readouterr().err)
        machines.worker()
        assert next(found).data is not None
        monkeypatch.setattr(there, "CLUSTER_PATIENCE", 0.5)
        for gone in (machines.processes[-1], machines.processes[0]):
            gone.send_signal(signal.SIGKILL)
            gone.wait()
            cluster.submit(asked)
            came = next(found)
            assert came.data is None
            assert ("no worker" if gone is not machines.processes[0] else "scheduler") in came.failure
    finally:
        cluster.close()
    assert "Traceback" not in capfd.readouterr().err


def test_works_may_be_submitted_while_it_is_looked_for_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else ends the wait for a cluster that is lost: whoever looks must not fail."""
    pytest.importorskip("distributed")
    from avow.pipeline import cluster as there

    cluster = object.__new__(there.Cluster)
    cluster._lock, cluster._closed, cluster._under_way = threading.Lock(), threading.Event(), {}
    cluster._wanted = {frozenset({"a"}), frozenset({"b"})}

    class Offered(dict[str, int]):
        def keys(self) -> Any:
            cluster._wanted.add(frozenset({f"another {len(cluster._wanted)}"}))
            cluster._closed.set()  # this look is the last
            return super().keys()

    monkeypatch.setattr(there, "CLUSTER_LOOK", 0)
    monkeypatch.setattr(there.Cluster, "_workers", lambda self, seconds: {"w": Offered()})
    cluster._watch()
    assert len(cluster._wanted) == 4


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
    own, left = cluster_worker._Own(engine_code.code_mark()), list[object]()
    worker = SimpleNamespace(extensions={"avow": own}, close="close", loop=SimpleNamespace(add_callback=left.append))
    monkeypatch.setattr(distributed, "get_worker", lambda: worker)
    monkeypatch.setattr(cluster_worker, "_cancelled", lambda worker: None)
    monkeypatch.setattr(cluster_worker, "answered", lambda forks, data, key, *more: Came(key, b"it"))
    assert cluster_worker.perform(b"", "k", 1) == b"+it"

    def full(*asked: object) -> Came:
        raise OSError(28, "No space left on device")

    if why == "its disk is full":
        monkeypatch.setattr(cluster_worker, "answered", full)
    else:
        (package / "base/some.py").write_text("A = 10")
    with pytest.raises(distributed.Reschedule):
        cluster_worker.perform(b"", "k", 1)
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
        cluster = Cluster(Address.read(machines.url))
        try:
            until(cluster.offers)
            assert settle(place, asking.elsewhere(cluster)) == here
        finally:
            cluster.close()
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

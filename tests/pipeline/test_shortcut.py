"""A run with nothing to do is recognised by the identity of files, and nothing less."""

from __future__ import annotations

import importlib
import mmap
import os
import sys
import tempfile
import time
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from assurance.sample import evidence, guarantee

from avow.base import files
from avow.base.codec import to_json
from avow.base.files import sha256
from avow.base.tools import package_digest
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import Ledger
from avow.evidence.record import OBSERVED
from avow.isolation.observed import Observed, Seen, look
from avow.pipeline import shortcut as shortcut_module
from avow.pipeline.results import Result
from avow.pipeline.shortcut import Shortcut
from avow.pipeline.tasks import wanted as read_wanted

RESULT = Result("crane", 0, {"proved": 3}, "reports/crane/index.html", (("all", True, "fine"),))


def run(workspace: Workspace) -> None:
    """As a whole run does: look first, and note at the end that everything is settled."""
    shortcut = Shortcut(workspace)
    assert shortcut.nothing_to_do(("verify",)) is None
    shortcut.keep([RESULT])


@pytest.fixture(autouse=True)
def _no_digest_stays() -> Iterator[None]:
    """A test here stands another package in the place of Z3; the process knows its digest from then on."""
    yield
    package_digest.cache_clear()


@pytest.fixture
def settled(tmp_path: Path) -> Workspace:
    workspace = Workspace(tmp_path)
    for name in ("contracts/crane/plan.yaml", "artifacts/ledger/crane.jsonl", "reports/index.html"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("text")
    run(workspace)
    assert Shortcut(workspace).nothing_to_do(("verify",)) == (RESULT,)
    return workspace


def test_nothing_changed(settled: Workspace) -> None:
    assert Shortcut(settled).nothing_to_do(("verify",)) == (RESULT,)
    assert Shortcut(settled).nothing_to_do(("verify:crane",)) == (RESULT,)


@pytest.mark.parametrize("wanted", [(), ("report",), ("verify", "check"), ("verify:other",), ("obligations",)])
def test_only_verification_of_known_systems_is_short(settled: Workspace, wanted: tuple[str, ...]) -> None:
    assert Shortcut(settled).nothing_to_do(wanted) is None


@pytest.mark.parametrize("name", ["contracts/crane/plan.yaml", "artifacts/ledger/crane.jsonl", "reports/index.html"])
def test_an_edit_of_the_same_length_under_an_old_time_is_seen(settled: Workspace, name: str) -> None:
    path = settled.root / name
    before = path.stat()
    path.write_text("tExt")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_mtime_ns == before.st_mtime_ns
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


TIMES = [name for name in dir(os.stat_result) if name.startswith("st_") and name.endswith("_ns")]


class Restoring:
    """Stands for a file system on which the time of change can be set back: `os.stat` as it was of each file."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, times: str) -> None:
        self.known: dict[tuple[int, int], os.stat_result] = {}
        real, fstat = os.stat, os.fstat

        def restored(info: os.stat_result) -> os.stat_result:
            first = self.known.setdefault((info.st_dev, info.st_ino), info)
            named = {name: getattr(info, name) for name in TIMES}
            named |= {name: getattr(first, name) for name in ("st_mtime_ns", "st_ctime_ns")}
            if times == "whole seconds":
                named |= {name: value // 10**9 * 10**9 for name, value in named.items()}
            return os.stat_result(tuple(info), named)

        monkeypatch.setattr(os, "stat", lambda *a, **k: restored(real(*a, **k)))
        monkeypatch.setattr(os, "fstat", lambda *a: restored(fstat(*a)))


@pytest.mark.parametrize("times", ["set back", pytest.param("whole seconds", marks=pytest.mark.slow)])
@pytest.mark.parametrize("what", ["contract", "ledger", "report", "observed", "tool", "package", "code"])
def test_where_times_of_change_can_be_set_back_the_bytes_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str, times: str
) -> None:
    """FAT, some of the network; a second in which a file was written twice. For all that the shortcut looks at."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    if times == "set back":
        monkeypatch.setattr(files, "_mounts", lambda: (("/", "vfat"),))
    monkeypatch.setattr(files, "_known", {})
    monkeypatch.setattr(files, "SETTLED_NS", 10**12)  # however long this test takes, it is the same moment
    Restoring(monkeypatch, times)
    workspace = Workspace(tmp_path / "w")
    package = tmp_path / "lib" / "z3"
    places = {
        "contract": workspace.contracts / "crane" / "plan.yaml",
        "ledger": workspace.artifacts / "crane" / "log.txt",
        "report": workspace.reports / "index.html",
        "observed": tmp_path / "elsewhere" / "gain.txt",
        "tool": tmp_path / "bin" / "prover",
        "package": package / "__init__.py",
        "code": tmp_path / "code" / "module.py",
    }
    assert Path(files.__file__).parents[1] in shortcut_module._CODE
    monkeypatch.setattr(shortcut_module, "_CODE", (tmp_path / "code",))  # all of Avow's would be read four times a case
    for path in places.values():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("text")
    told = Observed(Seen.READ, str(places["observed"]), look(Seen.READ, str(places["observed"])))
    record = evidence(guarantee("crane", "lifts"), Verdict.TESTED, "hypothesis")
    workspace.ledger("crane").parent.mkdir(parents=True, exist_ok=True)
    Ledger(workspace.ledger("crane")).append(replace(record, details={OBSERVED: to_json((told,))}))
    monkeypatch.syspath_prepend(str(package.parent))
    monkeypatch.delitem(sys.modules, "z3", raising=False)
    importlib.invalidate_caches()

    def settled() -> object:
        package_digest.cache_clear()
        return Shortcut(workspace).nothing_to_do(("verify",))

    package_digest.cache_clear()
    shortcut = Shortcut(workspace)
    assert shortcut.nothing_to_do(("verify",)) is None
    shortcut.keep([RESULT], [str(places["tool"])])
    assert settled() == (RESULT,)
    places[what].write_text("tExt")
    assert settled() is None


def test_a_whole_second_that_is_over_tells_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of all that an image of a machine brought along: of a tool's libraries there are a hundred megabytes."""
    path = tmp_path / "library"
    path.write_text("text")

    def looked_at(seconds_ago: int) -> bool:
        when = (time.time_ns() // 10**9 - seconds_ago) * 10**9
        info = os.stat_result(tuple(path.stat()), {"st_mtime_ns": when, "st_ctime_ns": when})
        return sha256("text") in files.identity(info, path)

    assert looked_at(0)
    assert looked_at(-100), "from the future: the clock was set back"
    assert not looked_at(100)
    monkeypatch.setattr(files, "_mounts", lambda: (("/", "vfat"),))
    monkeypatch.setattr(files, "_known", {})
    assert looked_at(100)


@pytest.mark.skipif(files._kind("/dev/shm") != "tmpfs", reason="no file system in memory here")
def test_what_is_written_through_a_mapping_in_memory_is_seen() -> None:
    """The first change moves the file's times, the next does not."""
    with tempfile.NamedTemporaryFile(dir="/dev/shm") as file:
        path = Path(file.name)
        path.write_text("text")
        with path.open("r+b") as opened, mmap.mmap(opened.fileno(), 0) as mapped:
            mapped[:1] = b"n"
            first = files.identity(path.stat(), path)
            mapped[:1] = b"w"
            assert files.identity(path.stat(), path) != first


def test_kinds_of_file_systems_are_told_by_the_innermost_mount(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = [
        "22 1 0:1 / / rw - rootfs none rw",
        "23 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw",
        "24 23 8:2 / /media/my\\040stick rw master:1 propagate_from:2 - vfat /dev/sdb1 rw",
        "25 23 0:9 / /media rw - tmpfs none rw",
        "26 24 8:3 /deep /media/my\\040stick/data rw - ext4 /dev/sdc1 rw",
    ]
    mounts = tmp_path / "mountinfo"
    mounts.write_text("\n".join(lines) + "\n")
    monkeypatch.setattr(files, "_MOUNTS", mounts)
    kinds = {p: files._kind(p) for p in ("/", "/home/a", "/media/x", "/media/my stick/a", "/mediax")}
    assert kinds == {
        "/": "ext4",
        "/home/a": "ext4",
        "/media/x": "tmpfs",
        "/media/my stick/a": "vfat",
        "/mediax": "ext4",
    }
    assert files._kind("/media/my stick/data/a") == "ext4"
    mounts.unlink()
    assert files._kind("/home/a") == ""  # no Linux: nobody says, and the bytes count


def test_what_is_mounted_later_is_told_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An editor's server runs for days; a stick that is put in meanwhile has a device that nobody saw."""
    mounts, root = tmp_path / "mountinfo", "23 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw\n"
    mounts.write_text(root)
    monkeypatch.setattr(files, "_MOUNTS", mounts)
    monkeypatch.setattr(files, "_known", {})
    assert files.keeps_changes("/home/a", 1)
    mounts.write_text(f"{root}24 23 8:2 / /media/stick rw - vfat /dev/sdb1 rw\n")
    assert not files.keeps_changes("/media/stick/a", 2)


def test_where_a_contract_was_edited_what_earlier_runs_wrote_is_not_looked_at(
    settled: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[Path] = []
    walk = shortcut_module._files

    def files(folder: Path, without: Collection[str]) -> Iterator[str]:
        looked.append(folder)
        return walk(folder, without)

    monkeypatch.setattr(shortcut_module, "_files", files)
    assert Shortcut(settled).nothing_to_do(("verify",)) == (RESULT,)
    assert settled.artifacts in looked
    looked.clear()
    (settled.contracts / "crane" / "plan.yaml").write_text("other")
    assert Shortcut(settled).nothing_to_do(("verify",)) is None
    assert settled.contracts in looked
    assert settled.artifacts not in looked


def test_new_and_deleted_files_are_seen(settled: Workspace) -> None:
    extra = settled.contracts / "crane" / "new.rcl"
    extra.write_text("")
    assert Shortcut(settled).nothing_to_do(("verify",)) is None
    extra.unlink()
    (settled.root / "reports" / "index.html").unlink()
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


@pytest.mark.parametrize("name", ["models/__pycache__/node.py", "data/.lock", ".doit.json", ".settled.json"])
def test_an_edit_of_a_systems_file_is_seen_whatever_it_is_called(settled: Workspace, name: str) -> None:
    path = settled.contracts / "crane" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("text")
    run(settled)
    assert Shortcut(settled).nothing_to_do(("verify",)) == (RESULT,)
    path.write_text("tExt")
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


@pytest.mark.parametrize("name", ["src/gain.txt", "contracts/../gain.txt", "../gain.txt"])
@pytest.mark.parametrize("absolute", [True, False])
def test_an_edit_of_what_a_subject_read_is_seen_wherever_it_lies(settled: Workspace, name: str, absolute: bool) -> None:
    path = settled.root / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("1")
    told = Observed(Seen.READ, str(path) if absolute else name, look(Seen.READ, str(path)))
    record = evidence(guarantee("crane", "lifts"), Verdict.TESTED, "hypothesis")
    ledger = settled.ledger("crane")
    ledger.write_text("")
    Ledger(ledger).append(replace(record, details={OBSERVED: to_json((told,))}))
    run(settled)
    assert Shortcut(settled).nothing_to_do(("verify",)) == (RESULT,)
    path.write_text("2")
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


def test_what_was_edited_during_the_run_is_not_settled(settled: Workspace) -> None:
    plan = settled.contracts / "crane" / "plan.yaml"
    plan.write_text("changed before")
    shortcut = Shortcut(settled)
    assert shortcut.nothing_to_do(("verify",)) is None
    plan.write_text("changed under way")
    shortcut.keep([RESULT])
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


def test_a_tool_that_appears_on_the_path_is_seen(
    tmp_path: Path, settled: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    tools = tmp_path.parent / f"{tmp_path.name}-tools"
    tools.mkdir()
    monkeypatch.setenv("PATH", f"{tools}:{os.environ['PATH']}")
    run(settled)
    assert Shortcut(settled).nothing_to_do(("verify",)) == (RESULT,)
    (tools / "dafny").write_text("#!/bin/sh\n")
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


def test_what_a_run_leaves_in_a_workspace_that_modules_are_looked_for_in_does_not_disturb_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "contracts").mkdir()
    shortcut = Shortcut(workspace)
    assert shortcut.nothing_to_do(("verify",)) is None
    for name in (".hypothesis", "__pycache__", "artifacts", "reports"):
        (tmp_path / name).mkdir()
    shortcut.keep([RESULT])
    assert Shortcut(workspace).nothing_to_do(("verify",)) == (RESULT,)
    (tmp_path / "z3.py").write_text("")
    assert Shortcut(workspace).nothing_to_do(("verify",)) is None


def test_a_link_that_leads_elsewhere_is_never_short(tmp_path: Path, settled: Workspace) -> None:
    elsewhere = tmp_path.parent / f"{tmp_path.name}-elsewhere"
    elsewhere.mkdir()
    (settled.contracts / "crane" / "models").symlink_to(elsewhere)
    run(settled)
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


def test_fresh_runs_and_damaged_notes_go_the_long_way(settled: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AVOW_FRESH", "1")
    assert Shortcut(settled).nothing_to_do(("verify",)) is None
    monkeypatch.delenv("AVOW_FRESH")
    (settled.artifacts / ".settled.json").write_text('{"identity": 7}')
    assert Shortcut(settled).nothing_to_do(("verify",)) is None


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("", ("verify",)),
        ("verify", ("verify",)),
        ("-n 2 verify", ("verify",)),
        ("-n2 verify:crane", ("verify:crane",)),
        ("run verify -n 4 -P thread", ("verify",)),
        ("list --all", ()),
        ("-a verify", ()),
        ("-f other.py verify", ()),
        ("x=1 verify", ()),
    ],
)
def test_what_doit_was_asked_for(line: str, names: tuple[str, ...]) -> None:
    assert read_wanted(line.split()) == names


@pytest.mark.parametrize(
    ("text", "noted"),
    [
        ('"ros": {launch: [../../bringup.launch]}', False),
        ('"ros": {"l\\x61unch": [../../bringup.launch]}', False),
        ("# as is\u0085ros: {launch: [../../bringup.launch]}", False),
        ("# the launch file remaps it\nsystem: crane\n", True),
    ],
)
def test_where_a_plan_reads_launch_files_nothing_is_noted(settled: Workspace, text: str, noted: bool) -> None:
    """They stand outside contracts/, and say what else is read."""
    (settled.contracts / "crane/plan.yaml").write_text(text, encoding="utf-8")
    run(settled)
    assert (Shortcut(settled).nothing_to_do(("verify",)) is not None) == noted

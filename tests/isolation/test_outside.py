"""What an outside tool looks at by itself is controlled, or recorded."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from helpers import some

from avow.base import tools
from avow.base.process import ToolMissing
from avow.base.tools import Tool
from avow.isolation import outside, tracing
from avow.isolation.observed import Observed, Seen, folded, look
from avow.isolation.outside import Outside
from avow.isolation.tracing import Trace, traces

needs_strace = pytest.mark.skipif(not traces(), reason="strace does not run here")

TOOL = """#!/bin/sh
HERE="${0%/*}/.."
cat "$HERE/settings"
if [ -e "$HERE/plugin" ]; then echo plugin; fi
cat "$HERE"/include/*.h
cat "$HERE/current/../version"
helper
echo mine > "$HERE/cache"; cat "$HERE/cache"
cat input
env
"""


@pytest.fixture
def there(tmp_path: Path) -> Path:
    place = tmp_path / "installed"
    (place / "bin").mkdir(parents=True)
    (place / "include").mkdir()
    for k in range(6):
        (place / "include" / f"{k}.h").write_text(f"{k}\n")
    (place / "settings").write_text("lenient\n")
    for version in ("1", "2"):
        (place / version / "lib").mkdir(parents=True)
        (place / version / "version").write_text(version)
    (place / "latest").symlink_to("1")
    (place / "current").symlink_to("latest/lib")
    for name, text in (("tool", TOOL), ("helper", "#!/bin/sh\necho helped\n")):
        (place / "bin" / name).write_text(text)
        (place / "bin" / name).chmod(0o755)
    return place


def ran(there: Path, tmp_path: Path) -> tuple[str, tuple[Observed, ...]]:
    tools.program_files.cache_clear()
    run = Outside((Tool("tool", "1", str(there / "bin" / "tool"), ""),))
    folder = tmp_path / "made"
    folder.mkdir(exist_ok=True)
    (folder / "input").write_text("ours\n")
    done = run.run([str(there / "bin" / "tool")], cwd=folder, seconds=60)
    assert done.code == 0, done.stderr
    return done.stdout, run.observed()


def changed(observed: tuple[Observed, ...]) -> list[str]:
    return [o.path for o in observed if look(o.kind, o.path) != o.digest]


def linked(place: Path, target: str) -> None:
    place.unlink()
    place.symlink_to(target)


CHANGES: dict[str, Callable[[Path], object]] = {
    "a file that it read": lambda there: (there / "settings").write_text("strict\n"),
    "a file that it looked for": lambda there: (there / "plugin").write_text(""),
    "one of many files": lambda there: (there / "include" / "3.h").write_text("4\n"),
    "one more in a folder that it lists": lambda there: (there / "include" / "9.h").write_text("9\n"),
    "a program that it starts": lambda there: (there / "bin" / "helper").write_text("#!/bin/sh\necho other\n"),
    "a link that it goes back from": lambda there: linked(there / "current", "2/lib"),
    "a link on the way of one that it goes back from": lambda there: linked(there / "latest", "2"),
    "a folder is another's": lambda there: (there / "include").rename(there / "old"),
}


@needs_strace
def test_a_change_of_what_it_looked_at_is_seen(there: Path, tmp_path: Path) -> None:
    said, observed = ran(there, tmp_path)
    assert "lenient" in said
    assert "helped" in said
    before = shutil.copytree(there, tmp_path / "before", symlinks=True)
    for what, change in CHANGES.items():
        assert not changed(observed), what
        change(there)
        assert changed(observed), what
        shutil.rmtree(there)
        shutil.copytree(before, there, symlinks=True)


@needs_strace
def test_what_it_made_and_what_it_was_given_are_no_inputs(there: Path, tmp_path: Path) -> None:
    _, observed = ran(there, tmp_path)
    paths = [Path(o.path) for o in observed]
    assert not [p for p in paths if p.name == "cache" or p.is_relative_to(tmp_path / "made")]
    assert not [p for p in paths if p.is_relative_to("/proc") or p.is_relative_to("/dev")]
    assert not [o for o in observed if o.kind is Seen.OUTSIDE]
    assert there / "bin" / "tool" not in paths  # in the key
    assert [o.kind for o in observed if o.path == str(there / "include")] == [Seen.FOLDER]
    again = ran(there, tmp_path)[1]
    assert again == observed


def test_nothing_of_our_environment_enters(there: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before, _ = ran(there, tmp_path)
    evil = tmp_path / "evil"
    evil.mkdir()
    shutil.copy(there / "bin" / "helper", evil / "helper")
    (evil / "helper").write_text("#!/bin/sh\necho evil\n")
    monkeypatch.setenv("PATH", f"{evil}{os.pathsep}{os.environ['PATH']}")
    for name in ("JAVA_TOOL_OPTIONS", "DAFNY_HOME", "CPATH", "LD_LIBRARY_PATH", "MONO_PATH", "HOME", "XDG_CONFIG_HOME"):
        monkeypatch.setenv(name, str(evil))
    after, _ = ran(there, tmp_path)
    assert str(evil) not in after
    assert "evil" not in after

    def lasting(said: str) -> list[str]:
        return [line for line in said.splitlines() if not line.startswith(("HOME=", "TMPDIR="))]

    assert lasting(after) == lasting(before)


def test_without_strace_what_it_reads_is_not_known(
    there: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The row says so, and names the remedy: the core re-runs what has one."""
    for module in (outside, tracing):
        monkeypatch.setattr(module, "traces", lambda: False)
    said, observed = ran(there, tmp_path)
    assert "lenient" in said
    assert [o.kind for o in observed] == [Seen.OUTSIDE]
    assert "tool" in observed[0].path
    assert tracing.remedy() in observed[0].path


@pytest.mark.parametrize("command", ["no-such-tool", "./no-such-tool"])
def test_a_tool_that_is_not_here(tmp_path: Path, command: str) -> None:
    with pytest.raises(ToolMissing):
        Outside(()).run([command], cwd=tmp_path, seconds=5)


def test_rows_are_folded_without_loss(tmp_path: Path) -> None:
    """A folder stands for what lies in it; a folder that is not there, for all below; folders of many programs stay
    apart."""
    names = [f"f{k}" for k in range(5)]
    for folder in ("own", "bin"):
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / name).write_text(name)

    def row(kind: Seen, *parts: str) -> Observed:
        path = str(tmp_path.joinpath(*parts))
        return Observed(kind, path, look(kind, path))

    rows = [row(Seen.READ, folder, name) for folder in ("own", "bin") for name in names]
    rows += [row(Seen.MISSING, "gone", name, "x") for name in names]
    found = folded(rows)
    assert {(o.kind, Path(o.path).name) for o in found} == {
        (Seen.FOLDER, "own"),
        (Seen.MISSING, "gone"),
        *((Seen.READ, name) for name in names),
    }
    assert not changed(found)


UNSEEN = {
    "a program that a started one is started from, by a path from the folder that it went to": "(cd $D; ./prog; true)",
    "the same, of a folder that it came to by a handle": "perl -e 'opendir(D, shift); chdir(D); exec(\"./prog\")' $D",
    "a folder that it did not come to": "cd $D; cd /no-such-folder; (./prog)",
    "a file behind a link that it makes": "ln -s $D d; cat d/prog",
    "behind one that is gone when it ends": "ln -s $D d; cat d/prog; rm d",
    "a file to which it makes a link before it is read": "ln -s $D/prog d; cat $D/prog",
    "what it gives a second name, and reads by that": "ln $D/prog d; cat d",
}


@needs_strace
@pytest.mark.parametrize("way", some(UNSEEN, 3, slow=len(UNSEEN) - 3))
def test_what_it_reaches_by_another_way_is_seen(tmp_path: Path, way: str) -> None:
    data = tmp_path / "data"
    data.mkdir()
    shutil.copy("/bin/true", data / "prog")
    place = tmp_path / "bin" / "tool"
    place.parent.mkdir()
    place.write_text(f'#!/bin/sh\nT={tmp_path}; D="$T/data"\n{UNSEEN[way]}\n')
    place.chmod(0o755)
    folder = tmp_path / "made"
    folder.mkdir()
    run = Outside((Tool("tool", "1", str(place), ""),))
    done = run.run([str(place)], cwd=folder, seconds=60)
    assert done.code == 0, done.stderr
    observed = run.observed()
    assert not changed(observed)
    (data / "prog").write_text("#!/bin/sh\nexit 0\n")
    assert str(data / "prog") in changed(observed)


@needs_strace
def test_a_trace_that_ends_before_its_program_tells_nothing(tmp_path: Path) -> None:
    """As a full disk cuts it: what the program started has ended there, not the program."""
    trace = Trace()
    command = ["/bin/sh", "-c", "/bin/true; /bin/cat /etc/passwd"]
    subprocess.run(trace.around(command), cwd=tmp_path, check=True, capture_output=True)
    whole = Path(trace._place).read_bytes()
    child = next(line for line in whole.splitlines(keepends=True) if b"+++ exited" in line)
    os.truncate(trace._place, whole.index(child) + len(child))
    assert trace.read_all("/bin/sh", tmp_path) is None

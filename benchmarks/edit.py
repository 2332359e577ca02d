"""What an edit of one clause costs beside a run with nothing to do.

    python benchmarks/edit.py [NODES [GUARANTEES]]        # default: 10 nodes with 10 each, and then 50 with 10

Processor seconds through the real pipeline, the least of three rounds that take turns. What an edit costs is told
apart: Avow's own work up to the gates, the report's formats (with the threads in which they are set), and the tools
with the processes that they run in; among these is the one that generates the methods' files. A run with nothing to do
is held against the same in a workspace of one claim. The exit code is 1 where an edit of one clause runs more than one
export, one sanity and one method, where nothing to do costs more than twice as much, or where an edit's own work costs
more than `MOST` times a run with nothing to do: of some 500 claims. That of larger ones is told.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

MOST = 4
"""How many times a run with nothing to do an edit of one clause may cost, without formats and tools."""

UP_TO = 100
"""Guarantees: in systems of more, that is told only."""

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from scale.made import programs  # noqa: E402

_CHILD = """
import json, os, sys, time
from pathlib import Path
import avow.pipeline.tasks as tasks
formats = 0.0
if sys.argv[2] == "told":
    import avow.report
    whole = avow.report.render_all
    def timed(*given):
        global formats
        start = time.process_time()
        try:
            return whole(*given)
        finally:
            formats += time.process_time() - start
    avow.report.render_all = timed
try:
    tasks.execute(Path(sys.argv[1]), ["verify"])
except SystemExit:
    pass
print("spent", json.dumps([time.process_time() - formats, formats]))
"""


def run(root: Path, kind: str) -> tuple[list[float], list[str]]:
    """Processor seconds (own, formats, tools), and the stages that were run."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-P", "-c", _CHILD, str(root), kind],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": ""},
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    own, formats = json.loads(done.stdout.rpartition("spent")[2])
    whole = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [own, formats, whole - own - formats], sorted(
        re.findall(r"^  (export|sanity|discharge|compose)\s", done.stdout, re.MULTILINE)
    )


def made(root: Path, nodes: int, guarantees: int) -> Path:
    """The contract of a workspace that is settled."""
    contract = programs(root / "contracts" / "made", nodes, guarantees) / "system.rcl"
    shutil.copy(ROOT / "dodo.py", root)
    (own, formats, tools), _ = run(root, "told")
    print(f"first run   {own:6.2f} s own, {formats:5.2f} s formats, {tools:6.2f} s tools ({nodes} nodes)", flush=True)
    return contract


def main(nodes: int = 10, guarantees: int = 10) -> int:
    idle: list[float] = []
    least: list[float] = []
    edits: list[list[float]] = []
    several = False
    with tempfile.TemporaryDirectory() as name:
        root, small = Path(name) / "large", Path(name) / "small"
        contract = made(root, nodes, guarantees)
        made(small, 1, 1)
        before = contract.read_text()
        for k in range(3):
            least.append(sum(run(small, "idle")[0]))
            idle.append(sum(run(root, "idle")[0]))
            contract.write_text(before.replace("in.x1 > 1 ->", f"in.x1 > {k + 2} ->"))
            spent, stages = run(root, "told")
            several |= stages != ["discharge", "export", "sanity"]
            edits.append(spent)
    own, formats, tools = min(edits)
    print(f"nothing     {min(idle):6.2f} s, {min(idle) / min(least):.1f} x that of one claim")
    times = own / min(idle)
    print(f"one edit    {own:6.2f} s own, {formats:5.2f} s formats, {tools:6.2f} s tools; own {times:.1f} x nothing")
    return int(several or min(idle) > 2 * min(least) or (nodes * guarantees <= UP_TO and times > MOST))


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])) if sys.argv[1:] else max(main(), main(50)))

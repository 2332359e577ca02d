"""What grows how: listing, composing and proving, each against something else in the same run.

    python benchmarks/scale.py [NODES]        # default: 250

Processor seconds of this process, the best of three rounds that take turns. The exit code is 1 where a bound is not
kept: four times the nodes may cost five times as much; a Hoare condition six times what Z3 alone takes for it; the
preparation of works a tenth of all that they take.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

import z3  # noqa: E402
from calculus.make import discharge  # noqa: E402
from scale.made import chain, fan, programs, seconds  # noqa: E402

from avow.backend_kit.protocol import Limits  # noqa: E402
from avow.base.workspace import Workspace  # noqa: E402
from avow.calculus.obligations import composition_obligations  # noqa: E402
from avow.pipeline.blobs import decode  # noqa: E402
from avow.pipeline.dispatch import request_of  # noqa: E402
from avow.pipeline.methods import method_backend, method_job  # noqa: E402
from avow.pipeline.requests import read_request, request_bytes  # noqa: E402
from avow.pipeline.work import Work, catalogue, planned_method  # noqa: E402
from avow.pipeline.worker import answer, keys_of  # noqa: E402
from avow.system.load import load_path, load_system  # noqa: E402
from avow.system.plan import System  # noqa: E402


def compose(system: System) -> None:
    discharge(system, composition_obligations(system), Limits(seconds=20))


def growth(folder: Path, count: int) -> list[float]:
    ratios = []
    for shape in (chain, fan):
        found = []
        for size in (count, 4 * count):
            path = folder / f"{shape.__name__}{size}.rcl"
            path.write_text(shape(size))
            found.append(load_path(path))
        small, large = found
        for work in (catalogue, compose):
            work(small)
            less, more = seconds(lambda: work(small), lambda: work(large))  # noqa: B023
            print(
                f"{work.__name__} {shape.__name__} {4 * count:6}  {more:7.2f} s  {more / less:4.1f} x {count}",
                flush=True,
            )
            ratios.append(more / less)
    return ratios


def hoare(folder: Path) -> float:
    system = load_system(programs(folder / "made", 25, 20))
    works = [work for work in catalogue(system).works if work.engine == "hoare"]
    jobs = [method_job(system, system.contract.node(w.node), planned_method(w)) for w in works]
    backend = method_backend(system, jobs[0].method)
    scripts = [text for job in jobs for name, text in backend.export(job).items() if name.endswith(".smt2")]

    def ours() -> None:
        for job in jobs:
            backend.discharge(job, folder, Limits())

    def alone() -> None:
        for script in scripts:
            solver = z3.Solver()
            solver.from_string(script)
            assert solver.check() == z3.unsat

    ours()
    mine, z3s = seconds(ours, alone)
    print(f"hoare, {len(scripts)} conditions   {mine:7.2f} s  {mine / z3s:4.1f} x Z3 alone", flush=True)
    return mine / z3s


def preparation(folder: Path) -> float:
    """Of all that works cost, what is not their questions: to write requests, to read them, to compute keys again."""
    place = folder / "contracts" / "made"
    works = [w for w in catalogue(load_system(programs(place, 5, 10))).works if w.cut is not None]

    def ask(work: Work) -> bytes:
        return request_bytes(request_of(Workspace(folder), work, work.obligations, folder))

    def prepare() -> None:
        for work in works:
            keys_of(decode(read_request(ask(work)).cut, place))

    def whole() -> None:
        for work in works:
            answer(ask(work))

    whole()
    before, all_of_it = seconds(prepare, whole, rounds=1)
    print(f"{len(works)} works prepared    {before:7.2f} s  {before / all_of_it:4.0%} of all", flush=True)
    return before / all_of_it


def main(count: int) -> int:
    with tempfile.TemporaryDirectory() as name:
        prepared = preparation(Path(name) / "prepared")
        grown, proved = growth(Path(name), count), hoare(Path(name))
    return int(max(grown) > 5 or proved > 6 or prepared > 0.1)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 250))

"""The figures that Avow is to keep, each beside another program that does the same or less, in one run.

    python benchmarks/table.py [ROW ...]        # default: all rows but `many`, some ten minutes; Linux only

Processor seconds of all processes that a command starts, whoever waits for them, and the peak of their memory together
(`measured.py`). A peer that is not installed is left out: `apt install why3 z3`. `many` is an edit among 5,000
obligations, and takes ten minutes more. Caches of the user are not used: other runs on the machine fill them.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from graph import graph  # noqa: E402
from measured import Cost, cost  # noqa: E402
from scale.made import chain, fan, node, programs  # noqa: E402

AVOW = [str(Path(sys.executable).with_name("avow"))]
"""The installed command: `python -m avow` starts each job in a Python of its own, which costs twice as much."""
HERE = {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": ""}
Z3 = """
import sys, z3
for name in sys.argv[1:]:
    solver = z3.Solver()
    solver.from_file(name)
    solver.check()
"""


def avow(folder: Path, *words: str | Path) -> Cost:
    return cost([*AVOW, *words], folder, HERE)


def line(what: str, found: Cost, aim: str, peers: dict[str, Cost | None]) -> None:
    print(f"{what:44} {found}   {aim}", flush=True)
    for name, peer in peers.items():
        if peer is not None:
            print(f"    {name:40} {peer}   ratio {found.seconds / max(peer.seconds, 0.01):.1f}", flush=True)


def workspace(folder: Path, nodes: int, guarantees: int) -> Path:
    programs(folder / "contracts" / "made", nodes, guarantees)
    shutil.copy(ROOT / "dodo.py", folder)
    return folder


def raw_z3(files: list[Path]) -> Cost:
    return cost([sys.executable, "-c", Z3, *files], ROOT)


def why3(folder: Path, nodes: int, guarantees: int) -> Cost | None:
    """The same verification conditions as goals of Why3, one theory for each node."""
    if not (shutil.which("why3") and shutil.which("z3")):
        return None
    theories = []
    for k in range(nodes):
        goals = "".join(f"  goal g{i} : x > {i} -> y >= x + {i} - {guarantees}\n" for i in range(guarantees))
        program = "  axiom P : (x > 10 -> y = x + 1) /\\ (x <= 10 -> y = x)\n"
        theories.append(
            f"theory N{k}\n  use int.Int\n  constant x : int\n  constant y : int\n"
            f"  axiom A : x >= -1000\n{program}{goals}end\n"
        )
    (folder / "made.why").write_text("".join(theories))
    own = ["why3", "-C", folder / "why3.conf"]
    cost([*own, "config", "detect"], folder)
    return cost([*own, "prove", "-P", "z3", folder / "made.why"], folder)


def verification(folder: Path, nodes: int = 50) -> None:
    """A first run, a run with nothing to do, and the edit of one clause."""
    place = workspace(folder, nodes, 10)
    first = avow(place, "verify", "-n", "2")
    scripts = sorted((place / "artifacts" / "made").rglob("*.smt2"))
    peers = {"Why3 with Z3": why3(folder, nodes, 10), f"Z3 alone, {len(scripts)} scripts": raw_z3(scripts)}
    line(f"verify {nodes * 10} obligations", first, "aim: 25 s" if nodes == 50 else "", peers)
    avow(place, "verify", "-n", "2")
    nothing = avow(place, "verify")
    imports = cost([sys.executable, "-c", "import click, doit.doit_cmd"], ROOT)
    line("nothing to do", nothing, "aim: 0.3 s", {"import of click and doit": imports})
    contract = place / "contracts" / "made" / "system.rcl"
    before, found = contract.read_text(), list[Cost]()
    for k in range(3):
        contract.write_text(before.replace("in.x1 > 1 ->", f"in.x1 > {k + 2} ->"))
        found.append(avow(place, "verify", "-n", "2"))
    one = [path for path in scripts if "/n1/" in str(path)]
    best = min(found, key=lambda each: each.seconds)
    peers = {"Z3 alone, that node": raw_z3(one), **floor(place)}
    line(f"an edit of one clause of {nodes * 10}", best, "aim: 1.0 s", peers)


def floor(place: Path) -> dict[str, Cost | None]:
    """What every run that changes something costs: the imports, the ledger's lines, and a report of unchanged nodes."""
    (place / "artifacts" / "made" / "report.json").unlink()
    modules = "avow.cli, avow.pipeline.stages, avow.pipeline.summary, lark, z3"
    parse = f"import json; [*map(json.loads, open({str(place / 'artifacts' / 'ledger' / 'made.jsonl')!r}))]"
    return {
        "import of what it runs": cost([sys.executable, "-c", f"import {modules}"], ROOT, HERE),
        "the ledger, parsed as JSON": cost([sys.executable, "-c", parse], ROOT),
        "avow report, which runs no tool": avow(place, "report", "made"),
    }


def many(folder: Path) -> None:
    """An edit among 5,000 obligations."""
    verification(folder, 500)


def sanity(folder: Path) -> None:
    for nodes, guarantees in ((2, 10), (1, 20)):
        place = workspace(folder / str(nodes), nodes, guarantees)
        found = avow(place, "sanity", place / "contracts" / "made")
        start = cost([*AVOW, "--version"], place, HERE)
        line(
            f"sanity: nodes with {guarantees} guarantees: {nodes}",
            found,
            "aim: 0.5 s, 150 MB",
            {"avow --version": start},
        )


def join(count: int) -> str:
    """Node k reads the outputs of k - 1 and of k // 2."""
    read = ({f"x{k - 1}", f"x{k // 2}"} for k in range(1, count))
    rest = (
        node(f"n{k}", sorted(names), [f"x{k}"], [f"in.{x} >= 0" for x in sorted(names)], [f"out.x{k} >= in.x{k - 1}"])
        for k, names in enumerate(read, 1)
    )
    return node("n0", [], ["x0"], [], ["out.x0 >= 0"]) + "".join(rest)


def ring(count: int) -> str:
    back = [(k - 1) % count for k in range(count)]
    return "".join(
        node(f"n{k}", [f"x{b}"], [f"x{k}"], [f"in.x{b} >= 0"], [f"out.x{k} >= 0"]) for k, b in enumerate(back)
    )


def composition(folder: Path) -> None:
    for shape in (chain, fan, join, ring):
        path = folder / f"{shape.__name__}.rcl"
        path.write_text(shape(1000))
        line(f"compose 1,000 nodes: {shape.__name__}", avow(folder, "compose", path), "aim: 10 s", {})
    elsewhere("compose.py", "1000")(folder)


def reading(folder: Path) -> None:
    text = (ROOT / "contracts" / "remote_inspection_published" / "system.rcl").read_text("utf-8")
    at = text.index("node ")
    copies = 1_000_000 // (len(text) - at) + 1
    path = folder / "large.rcl"
    path.write_text(text[:at] + "".join(text[at:].replace("node ", f"node copy{i}_") for i in range(copies)))
    line(f"check {path.stat().st_size / 1e6:.1f} MB of contracts", avow(folder, "check", path), "aim: 3 s for 1 MB", {})
    elsewhere("parse.py")(folder)


def robot(folder: Path) -> None:
    """A first run of 200 nodes in ten namespaces and subsystems, with a launch file; and an edit of one clause."""
    place = graph(folder / "contracts" / "made")
    shutil.copy(ROOT / "dodo.py", folder)
    first = avow(folder, "verify", "-n", "2")
    scripts = sorted((folder / "artifacts" / "made").rglob("*.smt2"))
    line("verify 200 nodes with 800 guarantees", first, "", {f"Z3 alone, {len(scripts)} scripts": raw_z3(scripts)})
    contract = place / "system.rcl"
    contract.write_text(contract.read_text().replace("-1000 <=", "-999 <=", 1))
    line("an edit of one clause among 200 nodes", avow(folder, "verify", "-n", "2"), "", {})


def elsewhere(name: str, *words: str) -> Callable[[Path], None]:
    """A program of this folder that prints its own rows, with their peers."""

    def run(_: Path) -> None:
        print(cost([sys.executable, ROOT / "benchmarks" / name, *words], ROOT, HERE).output, end="", flush=True)

    return run


ROWS: dict[str, Callable[[Path], None]] = {
    "verify": verification,
    "many": many,
    "sanity": sanity,
    "compose": composition,
    "read": reading,
    "monitor": elsewhere("monitor.py"),
    "agents": elsewhere("agents.py"),
    "cluster": elsewhere("cluster.py"),
    "graph": robot,
}


def chosen(names: list[str]) -> Iterator[str]:
    for name in names or [row for row in ROWS if row != "many"]:
        if name not in ROWS:
            raise SystemExit(f"no row {name!r}: {', '.join(ROWS)}")
        yield name


def main(names: list[str]) -> None:
    with tempfile.TemporaryDirectory() as caches:
        HERE["XDG_CACHE_HOME"] = caches
        for name in chosen(names):
            with tempfile.TemporaryDirectory() as folder:
                avow(workspace(Path(folder) / "first", 1, 1), "verify")  # a user's first run makes tables and templates
                ROWS[name](Path(folder))


if __name__ == "__main__":
    main(sys.argv[1:])

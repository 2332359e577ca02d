"""How long the calculus takes, against a naive composition of the same system: all contracts in one question to Z3.

    python benchmarks/compose.py [NODES ...]        # default: 20 200 1000

A chain of 20 nodes, and synthetic systems (chains, fans and joins: node k reads the outputs of k - 1 and of k // 2)
are composed as `avow compose` does it: graph, derivation, obligations, every side condition with the hypotheses that
carry it. The naive question says only whether *all* assumptions follow, from all contracts at once: neither which
fails, nor what carries which, and it would accept a circle. CPU seconds of this process; imports, the reading of the
contract and Z3's own start are not counted. Memory is the process' peak, everything included.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from avow.base.verdict import Verdict  # noqa: E402
from avow.calculus.composition import compose  # noqa: E402
from avow.calculus.discharge import Bounds  # noqa: E402
from avow.calculus.obligations import composition_obligations, settle_each  # noqa: E402
from avow.calculus.variables import frame  # noqa: E402
from avow.formulas.formula import conjunction, negation  # noqa: E402
from avow.language.terms import Term  # noqa: E402
from avow.solving.translation import Translator  # noqa: E402
from avow.solving.z3_module import z3  # noqa: E402
from avow.system.load import load_path  # noqa: E402
from avow.system.plan import System  # noqa: E402


def node(name: str, reads: list[str], writes: str, assumed: str, guaranteed: str) -> str:
    inputs = ", ".join(f"{port} : INTEGER" for port in reads)
    clauses = f"  assume ( {assumed} )\n" if assumed else ""
    return (
        f"node {name} {{\n  inputs( {inputs} )\n  outputs( {writes} : INTEGER )\n  topics()\n"
        f"{clauses}  guarantee ( {guaranteed} )\n}}\n"
    )


def chain(count: int) -> str:
    parts = [node("n0", [], "x0", "", "out.x0 >= 0")]
    for k in range(1, count):
        parts.append(node(f"n{k}", [f"x{k - 1}"], f"x{k}", f"in.x{k - 1} >= 0", f"out.x{k} >= in.x{k - 1}"))
    return "".join(parts)


def synthetic(count: int) -> str:
    parts = [node("n0", [], "x0", "", "out.x0 >= 0")]
    for k in range(1, count):
        reads = [f"x{r}" for r in sorted({k - 1, k // 2})]
        assumed = " and ".join(f"in.{port} >= 0" for port in reads)
        parts.append(node(f"n{k}", reads, f"x{k}", assumed, f"out.x{k} >= in.x{k - 1}"))
    return "".join(parts)


def calculus(system: System) -> None:
    outcomes = tuple(settle_each(compose(system), composition_obligations(system), Bounds(20_000)))
    composed = compose(system)
    assert len(composed.whole.conditions) == len(system.contract.nodes) - 1
    wrong = [o for o in outcomes if o.verdict is not Verdict.PROVED and ".persistence" not in o.obligation]
    assert all(o.obligation.endswith(("persistence", "one-output")) for o in wrong), wrong


def naive(system: System) -> None:
    whole = frame(system)
    translator = Translator()
    solver = z3.Solver(ctx=translator.context)
    assumed: list[Term] = []
    met: list[Term] = []
    for part in system.contract.nodes:
        for clause in part.clauses:
            (assumed if clause in part.assumptions else met).append(whole.clause(part.name, clause.name))
    for term in (*met, negation(conjunction(assumed))):
        solver.add(translator.term(term))
    assert solver.check() == z3.unsat


def measured(work: Callable[[System], None], system: System) -> float:
    start = time.process_time()
    work(system)
    return time.process_time() - start


def main(sizes: list[int]) -> None:
    with tempfile.TemporaryDirectory() as folder:

        def load(text: str) -> System:
            path = Path(folder) / "system.rcl"
            path.write_text(text)
            return load_path(path)

        for work in (calculus, naive):
            measured(work, load(chain(2)))
        print(f"{'system':16} {'calculus':>10} {'a node':>9} {'naive':>10} {'ratio':>7} {'peak':>9}")
        for name, text, count in [("chain", chain(20), 20), *(("synthetic", synthetic(n), n) for n in sizes)]:
            system = load(text)
            rounds = 3 if count <= 50 else 1
            ours = min(measured(calculus, system) for _ in range(rounds))
            plain = min(measured(naive, system) for _ in range(rounds))
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            times = f"{ours:8.2f} s {1000 * ours / count:6.1f} ms {plain:8.3f} s {ours / plain:7.1f}"
            print(f"{f'{name} {count}':16} {times} {peak:6.0f} MB", flush=True)


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [20, 200, 1000])

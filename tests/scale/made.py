"""Systems of any size, and the processor time that something takes."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from pathlib import Path


def node(
    name: str, inputs: Sequence[str], outputs: Sequence[str], assumed: Sequence[str], promised: Sequence[str]
) -> str:
    """A node of RCL with integer ports."""
    ports = (", ".join(f"{port} : INTEGER" for port in ports) for ports in (inputs, outputs))
    clauses = [f"  assume a{k} ( {a} )\n" for k, a in enumerate(assumed)]
    clauses += [f"  guarantee g{k} ( {g} )\n" for k, g in enumerate(promised)]
    return "node {} {{\n  inputs( {} )\n  outputs( {} )\n  topics()\n{}}}\n".format(name, *ports, "".join(clauses))


def chain(count: int) -> str:
    """Each node reads the one before it."""
    first = node("n0", [], ["x0"], [], ["out.x0 >= 0"])
    rest = (
        node(f"n{k}", [f"x{k - 1}"], [f"x{k}"], [f"in.x{k - 1} >= 0"], [f"out.x{k} >= in.x{k - 1}"])
        for k in range(1, count)
    )
    return first + "".join(rest)


def fan(count: int) -> str:
    """All nodes read one."""
    several = range(count)
    root = node("root", ["x"], [f"y{k}" for k in several], ["0 <= in.x"], [f"out.y{k} >= in.x" for k in several])
    leaves = (node(f"leaf{k}", [f"y{k}"], [f"z{k}"], [f"in.y{k} >= 0"], [f"out.z{k} == in.y{k}"]) for k in several)
    return root + "".join(leaves)


def seconds(*works: Callable[[], object], rounds: int = 3) -> list[float]:
    """Processor time of this thread for each: the least of several rounds, in which they take turns."""
    times: list[list[float]] = [[] for _ in works]
    for _ in range(rounds):
        for work, found in zip(works, times, strict=True):
            gc.collect()
            start = time.thread_time()
            work()
            found.append(time.thread_time() - start)
    return [min(found) for found in times]


def programs(folder: Path, nodes: int, guarantees: int) -> Path:
    """A system whose nodes each have a program, and so many guarantees of it."""
    (folder / "models").mkdir(parents=True, exist_ok=True)
    contract, plan = "", "system: made\ncontract: system.rcl\nnodes:\n"
    for k in range(nodes):
        promised = [f"in.x{k} > {i} -> out.y{k} >= in.x{k} + {i} - {guarantees}" for i in range(guarantees)]
        contract += node(f"n{k}", [f"x{k}"], [f"y{k}"], [f"in.x{k} >= -1000"], promised)
        plan += f"  n{k}: {{criticality: high, methods: [hoare: {{program: models/n{k}.imp}}]}}\n"
        program = f"IF (x{k} > 10) THEN\n   y{k} := x{k} + 1\nELSE\n   y{k} := x{k}\n"
        (folder / "models" / f"n{k}.imp").write_text(program)
    (folder / "system.rcl").write_text(contract)
    (folder / "plan.yaml").write_text(plan)
    return folder

"""A second opinion from Spin, in its own LTL: of the agents' programs, run by a runner in C that shares nothing with
our interpreter (`promela`)."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from avow.base.files import write
from avow.base.process import ToolMissing
from avow.isolation.outside import Outside

from . import promela, psl, spin_tool
from .checker import Checker, Property
from .tuning import SPIN_DEPTH

_ERRORS = re.compile(r"errors: (\d+)")


class NoOpinion(Exception):  # noqa: N818 - it names a state, not a fault
    """Spin did not answer; `reason` is a clause for people."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


def opinions(
    checker: Checker, properties: Sequence[Property], folder: Path, seconds: float, outside: Outside
) -> dict[str, bool]:
    """Key → whether the property holds, says Spin. Raises NoOpinion."""
    if spin_tool.version() is None:
        raise NoOpinion("spin or gcc is not installed")
    deadline = time.monotonic() + seconds
    try:
        files = _translated(checker, properties)
    except promela.NotTranslated as error:
        raise NoOpinion(f"no translation of {error}") from None
    for name, text in files.items():
        write(folder / name, text)
    # The model's own code grows with the properties, and takes longer to optimize than it then saves.
    runner = ["gcc", "-O2", "-w", "-c", "agent.c"]
    model = ["gcc", "-O0", "-w", "-DNOREDUCE", "-o", "pan", "pan.c", "agent.o", "-lm"]
    for command in (["spin", "-a", "agent.pml"], runner, model):
        try:
            done = outside.run(command, cwd=folder, seconds=_left(deadline))
        except ToolMissing as error:
            raise NoOpinion(str(error)) from None
        if done.code != 0:
            raise NoOpinion(f"{command[0]} failed: {(done.stdout + done.stderr).strip()[:300]}")
    depth = 20 * len(checker.graph) + SPIN_DEPTH

    def one(number: int) -> bool:
        return _verdict(folder, f"c{number}", depth, deadline, outside)

    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return dict(zip([p.key for p in properties], pool.map(one, range(len(properties))), strict=True))


def _translated(checker: Checker, properties: Sequence[Property]) -> dict[str, str]:
    system = checker.graph.system
    atoms, fair = len(checker.atoms), len(system.environment.fair)
    tables = promela.header(system, checker.atoms)
    lines = ['c_decl {\n\\#include "agent.h"\n}', 'c_state "S s" "Global"', ""]
    lines += [f"#define a{at} (c_expr {{ SAYS_{at} }})" for at in range(atoms + 2 * fair)]
    lines += ["", "active proctype agent() {", "end: do"]
    for way in range(promela.most_ways(system)):
        lines.append(f"  :: atomic {{ c_expr {{ MORE_{way} }} -> c_code {{ go(HERE, {way}); }} }}")
    lines += ["  od", "}", ""]
    premise = [f"((<> ([] (!a{atoms + 2 * at}))) || ([] (<> a{atoms + 2 * at + 1})))" for at in range(fair)]
    notation = psl.Notation(lambda atom: f"a{checker.places[atom]}", ("false", "true"), "!", "&&", "V")
    for number, p in enumerate(properties):
        formula = psl.show(p.formula, notation)
        whole = f"(!({' && '.join(premise)})) || ({formula})" if premise else formula
        lines.append(f"ltl c{number} {{ {whole} }}")
    runner = {path.name: path.read_text(encoding="utf-8") for path in promela.RUNNER}
    return {"agent.h": tables, **runner, "agent.pml": "\n".join(lines) + "\n"}


def _left(deadline: float) -> float:
    left = deadline - time.monotonic()
    if left <= 0:
        raise NoOpinion("no time left")
    return left


def _verdict(folder: Path, claim: str, deepest: int, deadline: float, outside: Outside) -> bool:
    for depth in (SPIN_DEPTH, deepest):  # a deep stack costs more than most searches
        command = ["./pan", "-a", "-n", f"-m{depth}", "-w18", "-N", claim]
        done = outside.run(command, cwd=folder, seconds=_left(deadline))
        if done.timed_out:
            raise NoOpinion(f"pan gave no answer in {done.seconds:.0f} s")
        text = done.stdout + done.stderr
        if "too small" not in text:
            break
    found = _ERRORS.search(text)
    if found is None or "too small" in text or ("Search not completed" in text and found[1] == "0"):
        raise NoOpinion(f"pan gave no answer: {text.strip()[:200]}")
    return found[1] == "0"

"""The trusted base that a report lists is all of Avow that the kernel is told by, and all that it runs."""

from __future__ import annotations

import ast
from pathlib import Path

from helpers import nodes, parsed

import avow
from avow.pipeline.engine_code import TRUSTED, trusted_parts

PACKAGE = Path(avow.__file__).parent


def imported(file: Path) -> set[Path]:
    found = set[str]()
    for part in nodes(parsed(file.read_text("utf-8"))):
        match part:
            case ast.ImportFrom(module=str(module), names=names):
                found |= {module, *(f"{module}.{one.name}" for one in names)}
            case ast.Import(names=names):
                found |= {one.name for one in names}
            case _:  # no import
                pass
    paths = (PACKAGE.parent / f"{name.replace('.', '/')}.py" for name in found if name.startswith("avow."))
    return {path for path in paths if path.is_file()}


def test_all_that_the_kernel_is_told_by_is_listed() -> None:
    waiting = [PACKAGE / "calculus/wiring.py", PACKAGE / "solving/apart.py", *(PACKAGE / "kernel").glob("*.py")]
    reached = set[Path]()
    while waiting:
        file = waiting.pop()
        if file not in reached:
            reached.add(file)
            waiting += imported(file)
    assert PACKAGE / "formulas/formula.py" in reached
    listed = [PACKAGE / place for places in TRUSTED.values() for place in places]
    missing = {file for file in reached if not any(file == place or place in file.parents for place in listed)}
    assert not missing


def test_each_part_is_there() -> None:
    assert all((PACKAGE / place).exists() for places in TRUSTED.values() for place in places)
    assert len({digest for _, digest in trusted_parts()}) == len(TRUSTED)

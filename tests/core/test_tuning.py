"""Numbers by which Avow is tuned stand in one place, each with its reason, and docs/limits.md lists them."""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import parsed

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "limits.md"

ROOMS = {
    "avow/base/tuning/effort.py": "Effort",
    "avow/base/tuning/bounds.py": "Searches",
    "avow/base/tuning/sizes.py": "Inputs",
    "avow/base/tuning/running.py": "Runs",
    "avow/base/tuning/shown.py": "What is shown",
    "avow/kernel/solvers.py": "The kernel",
}

NOT_TUNED = {
    ("avow/drive/rospy.py", "SECOND"),  # in nanoseconds
    ("avow/drive/rclpy.py", "SECOND"),
    ("avow/backend_kit/programs/callbacks.py", "SECOND"),
    ("avow/base/process.py", "_PR_SET_PDEATHSIG"),  # Linux names its calls by numbers
    ("avow/base/process.py", "_PR_SET_DUMPABLE"),
    ("avow/base/process.py", "_PR_SET_CHILD_SUBREAPER"),
    ("backends/rosmonitoring/wires.py", "LARGEST_SINGLE"),  # IEEE 754
    ("avow/base/rendering.py", "_TAB"),  # columns of a drawing
    ("avow/formulas/ltl.py", "_START"),  # a node that is none
    ("avow/isolation/watching.py", "_MOST_LINKS"),  # as Linux
    ("avow/isolation/watching.py", "_OF_A_PAIR"),  # as Linux
    ("avow/isolation/tracing.py", "_SECTIONS"),  # a place in a format
    ("avow/language/format.py", "WIDTH"),  # the canonical layout
    ("avow/language/format.py", "_STEP"),
    ("avow/report/maps.py", "_SIZE"),  # measures of pictures
    ("avow/report/maps.py", "_MARGIN"),
    ("avow/solving/z3_sorts.py", "_MAX_CHARACTER"),
    ("avow/system/graph_svg.py", "_MARGIN"),
    ("avow/system/graph_svg.py", "_LANE"),
    ("backends/ajpf/asking.py", "_FORM"),  # of a file
    ("backends/ajpf/mind.py", "NONE"),
    ("backends/review/record.py", "FORMAT"),  # of a file
    ("backends/rosmonitoring/judged.py", "_LAST"),  # the last time that the format has
}


def files() -> list[Path]:
    return sorted(p for room in ("avow", "backends") for p in (ROOT / room).rglob("*.py") if "template" not in p.parts)


def numeric(node: ast.expr | None) -> bool:
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.BinOp(left=left, right=right):
            return numeric(left) and numeric(right)
        case ast.UnaryOp(operand=operand):
            return numeric(operand)
        case ast.Tuple(elts=items):
            return bool(items) and all(map(numeric, items))
    return False


def numbers(source: str) -> Iterator[tuple[str, str, str]]:
    """Name, value and reason of each constant of a module that is a number."""
    body = parsed(source).body
    for at, node in enumerate(body):
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                pass
            case ast.AnnAssign(target=ast.Name(id=name), value=value):
                pass
            case _:
                continue
        if value is not None and numeric(value):
            below = body[at + 1] if at + 1 < len(body) else None
            told = below.value if isinstance(below, ast.Expr) else None
            why = told.value if isinstance(told, ast.Constant) and isinstance(told.value, str) else ""
            yield name, ast.get_source_segment(source, value) or "", " ".join(why.split())


def pages() -> dict[Path, str]:
    """Each module of numbers, and its heading."""
    own = sorted((ROOT / "backends").glob("*/tuning.py"))
    return {**{ROOT / name: title for name, title in ROOMS.items()}, **{p: f"Backend `{p.parent.name}`" for p in own}}


HEAD = """# Limits

Every number by which Avow is tuned, and why it is what it is. This page is written from the code
(`avow/base/tuning/`, and each backend's `tuning.py`), where they are changed. A limit that is met is said: in a
verdict's reason, in a diagnostic, or on the page. The options of a plan's methods (`timeout`, `states`, …) are in
[plan.md](plan.md) and on the backends' pages.
"""


def page() -> str:
    parts = [HEAD]
    for path, title in pages().items():
        source = path.read_text("utf-8")
        about = " ".join((ast.get_docstring(parsed(source)) or "").split("\n\n")[0].split())
        rows = "".join(f"| `{name}` | {value} | {why} |\n" for name, value, why in numbers(source))
        intro = "" if title.startswith("Backend") else f"{about}\n\n"
        parts.append(f"## {title}\n\n{intro}| number | value | reason |\n|---|---|---|\n{rows}")
    return "\n".join(parts)


def test_every_number_stands_there() -> None:
    found = {
        (path.relative_to(ROOT).as_posix(), name)
        for path in set(files()) - set(pages())
        for name, _, _ in numbers(path.read_text("utf-8"))
    }
    assert found == NOT_TUNED, "in avow/base/tuning/ or in the backend's tuning.py, with its reason"


@pytest.mark.parametrize("path", pages(), ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_number_has_its_reason(path: Path) -> None:
    found = list(numbers(path.read_text("utf-8")))
    assert found
    assert [name for name, _, why in found if len(why) < 20] == []


def test_the_page_lists_them() -> None:
    if os.environ.get("AVOW_REFRESH"):
        PAGE.write_text(page(), encoding="utf-8")
    assert PAGE.read_text("utf-8") == page(), "AVOW_REFRESH=1 .venv/bin/pytest tests/core/test_tuning.py"


def test_no_limit_of_a_question_is_written_where_it_is_asked() -> None:
    found = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in files()
        for line in path.read_text("utf-8").splitlines()
        if re.search(r"effort=[0-9_]+\b(?! \*)", line)
    ]
    assert found == []

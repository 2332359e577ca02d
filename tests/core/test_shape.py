"""A file is read at one sitting, and what a run knows stands in its object."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINES = 500
PIPELINE = ROOT / "avow" / "pipeline"

STAYS = {
    "work.engine_identity": "of the code that runs in this process",
    "engine_code.engine_digest": "of the code that runs in this process",
    "engine_code.trusted_parts": "of the code that runs in this process",
    "blobs._classes": "of the code that runs in this process",
    "tasks.sys.dont_write_bytecode": "what the interpreter does, whoever asks",
    "fork_server.sys.argv": "a fork takes its own arguments; it is a process of one work",
}
"""What outlives a run in `avow.pipeline`, and why it may. A function that keeps answers is pure, and its answers are of
its arguments; one without arguments is listed."""

CHANGES = {"add", "append", "clear", "discard", "extend", "insert", "pop", "popitem", "remove", "setdefault", "update"}
HOLDERS = {"ContextVar", "Lock", "RLock", "defaultdict", "deque", "dict", "list", "local", "set"}
CACHES = {"by_identity", "cache", "lru_cache"}


def test_no_file_is_longer_than_one_can_read() -> None:
    files = [p for room in ("avow", "backends") for p in (ROOT / room).rglob("*.py")]
    long = {str(p.relative_to(ROOT)): n for p in files if (n := len(p.read_text("utf-8").splitlines())) > LINES}
    assert not long, f"part what is longer than {LINES} lines by what it is about"


def state(source: str) -> set[str]:
    """The names at the top of a module whose value can change while it runs: variables and containers that are not
    written as constants, constants that something changes, functions without arguments that keep what they
    answer, names of other modules."""
    tree = ast.parse(source)
    values = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        if isinstance(target, ast.Name)
    }
    modules = {
        (a.asname or a.name).partition(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for a in node.names
        if isinstance(node, ast.Import) or a.name.islower()
    }
    holders = {name for name, value in values.items() if _holds(name, value)}
    return holders | (set(_changed(tree)) & set(values)) | set(_of_others(tree, modules)) | set(_keeping(tree))


def _holds(name: str, value: ast.expr | None) -> bool:
    if name.startswith("__") or name.strip("_").isupper() or name.strip("_")[:1].isupper():
        return isinstance(value, ast.Call) and _called(value) in HOLDERS - {"dict", "list", "set"}
    return True


def _changed(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Global):
            yield from node.names
        elif (
            isinstance(node, ast.Subscript) and not isinstance(node.ctx, ast.Load) and isinstance(node.value, ast.Name)
        ):
            yield node.value.id
        elif (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr in CHANGES
            and isinstance(node.func.value, ast.Name)
        ):
            yield node.func.value.id


def _of_others(tree: ast.Module, modules: set[str]) -> Iterator[str]:
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)):
            continue
        if isinstance(node.value, ast.Name) and node.value.id in modules:
            yield f"{node.value.id}.{node.attr}"


def _keeping(tree: ast.Module) -> Iterator[str]:
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef) or node.args.args or node.args.kwonlyargs or node.args.vararg:
            continue
        if any(_called(d) in CACHES for d in node.decorator_list):
            yield node.name


def _called(node: ast.expr) -> str:
    match node:
        case ast.Call(func=function):
            return _called(function)
        case ast.Attribute(attr=name) | ast.Name(id=name):
            return name
        case _:  # no name
            return ""


def test_what_a_run_knows_stands_in_its_object() -> None:
    found = {f"{p.stem}.{name}" for p in sorted(PIPELINE.glob("*.py")) for name in state(p.read_text("utf-8"))}
    assert found == set(STAYS), "put it into `State` or `Run`; what is of the process, and not of a run, has its reason"


@pytest.mark.parametrize(
    "source",
    [
        "_known = {}",
        "_known: dict[str, int] = dict()",
        "_lock = threading.Lock()",
        "TABLE = {}\ndef f():\n    TABLE[1] = 2",
        "TABLE = []\ndef f():\n    TABLE.append(2)",
        "N = 0\ndef f():\n    global N\n    N = 1",
        "offered = None",
        "KEPT = ContextVar('kept')",
        "import os\ndef f():\n    os.name = 'x'",
        "@functools.cache\ndef f(): return []",
        "@lru_cache(maxsize=9)\ndef f(): return []",
    ],
)
def test_state_is_found(source: str) -> None:
    assert state(source)


def test_a_constant_is_none() -> None:
    assert not state(
        "TABLE = {1: 2}\n_NAMES = ('a',)\nPair = tuple[int, str]\ndef f():\n    found = []\n    found.append(1)"
    )

"""A file is read at one sitting, and what a run knows stands in its object."""

from __future__ import annotations

import ast
import functools
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from helpers import nodes, parsed

ROOT = Path(__file__).parents[2]
LINES = 500
PIPELINE = ROOT / "avow" / "pipeline"

STAYS = {
    "work.engine_identity": "of the code that runs in this process",
    "engine_code.engine_digest": "of the code that runs in this process",
    "work._no_values": "of the code that runs in this process",
    "engine_code.reading_digest": "of the code that runs in this process",
    "engine_code.trusted_parts": "of the code that runs in this process",
    "blobs._classes": "of the code that runs in this process",
    "cluster_worker.own_code": "of the code that runs in this process",
    "tasks.sys.dont_write_bytecode": "what the interpreter does, whoever asks",
    "processes.sys.argv": "a fork has its own; it is a process of one job",
    "processes.sys.stdin": "a fork has its own; it is a process of one job",
    "processes.sys.stdout": "a fork has its own; it is a process of one job",
    "processes.sys.stderr": "a fork has its own; it is a process of one job",
}
"""What outlives a run in `avow.pipeline`, and why it may. A function that keeps answers is pure, and its answers are of
its arguments; one without arguments is listed."""

PROCESS = "a process has one: what it may do, what it started, what it has to end, what it spent"
ONCE = (
    "a file of the package, a grammar, a library or a tool: read, loaded or asked when first needed, and the same after"
)
KEPT = "what was computed of the same arguments: faster, and never another answer"
ELSEWHERE = {
    "avow/assurance/policy._data": ONCE,
    "avow/assurance/standards.standards": ONCE,
    "avow/backend_kit/protocol._required": KEPT,
    "avow/backend_kit/registry.every_code": ONCE,
    "avow/backend_kit/registry.installed": ONCE,
    "avow/base/codes._LOADED": "the codes of the backends that are loaded, which do not change",
    "avow/base/codes.core_codes": ONCE,
    "avow/base/codes.sections": ONCE,
    "avow/base/files._known": ONCE,
    "avow/base/process.here": PROCESS,
    "avow/base/tools.libraries": ONCE,
    "avow/calculus/entailment._kept": "where a work's answers are kept, for the time of that work",
    "avow/calculus/scenario._KEYS": KEPT,
    "avow/evidence/ledger._code": ONCE,
    "avow/isolation/level.seals": ONCE,
    "avow/isolation/tracing.traces": ONCE,
    "avow/language/facts.facts": ONCE,
    "avow/language/load._lately": KEPT,
    "avow/language/load._under": KEPT,
    "avow/report/page.environment": ONCE,
    "avow/solving/limits._spent": PROCESS,
    "avow/solving/z3_module.z3": ONCE,
    "avow/solving/z3_sorts._kept": "a Z3 context for questions of evaluation, each of which has one answer",
    "avow/solving/z3_sorts._session": "the Z3 context of a node's questions, for the time of its claims",
    "avow/system/schema._validator": ONCE,
    "backends/dafny/modules._templates": ONCE,
}
"""What outlives a call in the other rooms, and why it may."""
FUNCTIONS = {"attrgetter", "itemgetter"}

CHANGES = {"add", "append", "clear", "discard", "extend", "insert", "pop", "popitem", "remove", "setdefault", "update"}
HOLDERS = {"ContextVar", "Lock", "RLock", "defaultdict", "deque", "dict", "list", "local", "set"}
CACHES = {"by_identity", "cache", "lru_cache"}


@functools.cache
def product() -> dict[Path, ast.Module]:
    return {p: parsed(p.read_text("utf-8")) for room in ("avow", "backends") for p in (ROOT / room).rglob("*.py")}


def test_the_map_shows_the_floors() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = [layer.split(" | ") for layer in next(c["layers"] for c in contracts if c["type"] == "layers")]
    held = {room.removeprefix("avow."): len(layers) - at for at, rooms in enumerate(layers) for room in rooms}
    floor, shown = 0, dict[str, int]()
    for number, room in re.findall(
        r"^\| (?:(\d+) )?\| `([\w/*]+)` \|", (ROOT / "docs" / "developers" / "architecture.md").read_text(), re.M
    ):
        floor = int(number or floor)
        shown[room.removesuffix("/*")] = floor
    assert shown == held


def test_a_room_says_what_it_is_for() -> None:
    doors = [path for name in ("avow", "backends") for path in (ROOT / name).glob("*/__init__.py")]
    assert len(doors) > 30
    said = {path: ast.get_docstring(parsed(path.read_text())) or "" for path in doors}
    rooms = {path: text for path, text in said.items() if path.parent.parent.name == "avow"}
    assert [path for path, text in said.items() if not text] == []
    assert [path for path, text in rooms.items() if len(text.splitlines()) < 3] == []


def test_what_only_its_module_uses_is_private() -> None:
    """Functions whose name stands nowhere else, and those whose name stands nowhere at all. (What a framework calls
    has a decorator, or a prefix of the framework's.)"""
    files = (*product(), *(ROOT / "tests").rglob("*.py"))
    uses = Counter(word for path in files for word in set(re.findall(r"\w+", path.read_text("utf-8"))))
    assert [
        f"{path.relative_to(ROOT)}: {node.name}"
        for path, tree in product().items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith(("_", "pytest_")) and not node.decorator_list
        if uses[node.name] < 2
    ] == []


def test_no_class_is_imported_by_another_name() -> None:
    """Two of one name are met together, then: one of them is to be called what it is."""
    assert [
        f"{path.relative_to(ROOT)}: {name.name} as {name.asname}"
        for path, tree in product().items()
        for node in nodes(tree)
        if isinstance(node, ast.ImportFrom) and (node.level or (node.module or "").startswith("avow"))
        for name in node.names
        if name.asname not in (None, name.name) and name.name.lstrip("_")[0].isupper()
    ] == []


def test_no_file_is_longer_than_one_can_read() -> None:
    files = [p for room in ("avow", "backends") for p in (ROOT / room).rglob("*.py")]
    long = {str(p.relative_to(ROOT)): n for p in files if (n := len(p.read_text("utf-8").splitlines())) > LINES}
    assert not long, f"part what is longer than {LINES} lines by what it is about"


def state(tree: ast.Module) -> set[str]:
    """The names at the top of a module whose value can change while it runs: variables and containers that are not
    written as constants, constants that something changes, functions without arguments that keep what they
    answer, names of other modules."""
    found = nodes(tree)
    values = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
        if isinstance(target, ast.Name)
    }
    modules = {
        (a.asname or a.name).partition(".")[0]
        for node in found
        if isinstance(node, ast.Import | ast.ImportFrom)
        for a in node.names
        if isinstance(node, ast.Import) or a.name.islower()
    }
    holders = {name for name, value in values.items() if _holds(name, value)}
    return holders | (set(_changed(found)) & set(values)) | set(_of_others(found, modules)) | set(_keeping(tree))


def _holds(name: str, value: ast.expr | None) -> bool:
    if name.startswith("__") or name.strip("_").isupper() or name.strip("_")[:1].isupper():
        return isinstance(value, ast.Call) and _called(value) in HOLDERS - {"dict", "list", "set"}
    return not (isinstance(value, ast.Call) and _called(value) in FUNCTIONS)


def _changed(found: Iterable[ast.AST]) -> Iterator[str]:
    for node in found:
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


def _of_others(found: Iterable[ast.AST], modules: set[str]) -> Iterator[str]:
    for node in found:
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
    found = {f"{p.stem}.{name}" for p, tree in product().items() if p.parent == PIPELINE for name in state(tree)}
    assert found == set(STAYS), "put it into `State` or `Run`; what is of the process, and not of a run, has its reason"


def test_what_outlives_a_call_has_its_reason() -> None:
    files = {p.relative_to(ROOT).with_suffix(""): tree for p, tree in product().items() if PIPELINE not in p.parents}
    found = {f"{p}.{name}" for p, tree in files.items() for name in state(tree)}
    assert found == set(ELSEWHERE), "put it into an object that whoever needs it is handed"


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
    assert state(ast.parse(source))


def test_a_constant_is_none() -> None:
    assert not state(
        ast.parse(
            "TABLE = {1: 2}\n_NAMES = ('a',)\nPair = tuple[int, str]\ndef f():\n    found = []\n    found.append(1)"
        )
    )


GIVEN = {
    "avow/base/files.py",  # /proc/self/mountinfo
    "avow/cli/from_ros.py",  # a listing may come through a pipe, as what the next three read
    "avow/assurance/requirements_import.py",
    "avow/evidence/signing.py",
    "avow/fretish/project.py",
    "avow/recount/__init__.py",  # a report; it imports nothing of Avow
}
"""Files that may be read with what could be a pipe: of the system, or given by the user on the command line."""
OWN = {
    "avow/cli/init.py",
    "avow/pipeline/engine_code.py",
    "avow/pipeline/processes.py",
    "avow/pipeline/worker.py",
    "avow/backend_kit/programs/cpython.py",
    "avow/conformance/suite.py",
    "avow/language/facts.py",
    "backends/fuzz/runner.py",
    "backends/fuzz/tables.py",
    "backends/hypothesis/export.py",
    "backends/hypothesis/running.py",
}
"""These read what Avow brought, or wrote a moment ago in a folder that nobody else knows."""


def test_files_of_a_workspace_are_read_so_that_nobody_waits_for_a_pipe() -> None:
    """`read_regular` and `read_text` refuse what is no file; `Path.read_bytes` waits for its end."""
    found = {
        path.relative_to(ROOT).as_posix()
        for folder in ("avow", "backends")
        for path in (ROOT / folder).rglob("*.py")
        for call in nodes(parsed(path.read_text()))
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr in ("read_bytes", "read_text")
        and "resources" not in ast.unparse(call)
    }
    assert found - {"avow/base/grammars.py"} == GIVEN | OWN


def test_no_console_turns_names_into_pictures() -> None:
    """Rich shows ``:boat:`` as an emoji, and a task is called ``discharge:boat:helm``."""
    calls = [call for tree in product().values() for call in nodes(tree) if isinstance(call, ast.Call)]
    made = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "Console"]
    assert len(made) > 4
    assert [ast.unparse(call) for call in made if "emoji=False" not in ast.unparse(call)] == []

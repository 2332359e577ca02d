"""Commands that read, and the language server, execute nothing of a workspace, whatever lies in it."""

from __future__ import annotations

import _ctypes
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import z3
from helpers import avow, some

AVOW = str(Path(sys.executable).with_name("avow"))
RCL = "node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee g ( out.y <= 1 ) }\n"
PLAN = """system: s
plugins: [evil]
model: {graph: graph.dot}
requirements: {R: {text: It is small., supported_by: [n]}}
nodes: {n: {criticality: low, methods: [{hypothesis: {subject: 'm.py:step', cases: 5}}, evil]}}
"""
EVIL = """
import os, pathlib
pathlib.Path({root!r}, "executed").open("a").write(__file__ + os.linesep)
def step(x):
    return 0
"""
NAMES = [
    *("evil", "sitecustomize", "usercustomize", "conftest", "dodo", "setup", "z3", "lark", "yaml", "json", "click"),
    *("hypothesis", "pygls", "doit", "jinja2", "rich", "avow/__init__", "avow/cli", "backends/__init__", "typing"),
    *("encodings/__init__", "cryptography/__init__", "jsonschema", "_avow", "antigravity"),
]
SONAMES = {path.name.removeprefix("libz3.so.") for path in Path(z3.__file__).parent.glob("lib/libz3.so.*")}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("theirs")
    folder = root / "contracts" / "s"
    folder.mkdir(parents=True)
    (folder / "s.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN)
    (folder / "graph.dot").write_text("digraph { a -> b }\n")
    text = EVIL.format(root=str(root))
    for where in (root, folder, root / "contracts", root / "artifacts", root / ".venv"):
        for name in NAMES:
            (where / name).parent.mkdir(parents=True, exist_ok=True)
            (where / f"{name}.py").write_text(text)
        for library in ("libz3.so", *(f"libz3.so.{version}" for version in SONAMES)):
            shutil.copy(_ctypes.__file__, where / library)  # any library: Z3's module fails in it, where it is loaded
        (where / "evil.pth").write_text("import evil\n")
        (where / "pyvenv.cfg").write_text("home = .\n")
        (where / "pyproject.toml").write_text("[tool.avow]\nplugins = ['evil']\n[tool.doit]\n")
    (folder / "m.py").write_text(text)
    return root


def run(root: Path, *words: str, stdin: bytes = b"") -> str:
    done = subprocess.run([AVOW, *words], cwd=root, capture_output=True, timeout=120, check=False, input=stdin)
    said = (done.stdout + done.stderr).decode(errors="replace")
    assert "Traceback" not in said, said
    left = root / "executed"
    assert not left.exists(), (words, left.read_text())
    return said


@pytest.mark.nightly
@pytest.mark.parametrize("words", [["check"], ["verify"], ["audit"], ["doctor"], ["report"]], ids=" ".join)
def test_a_module_path_that_means_here_is_left(
    tmp_path: Path, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of what Avow imports; what Python looks for before, nobody can keep from being found."""
    folder = tmp_path / "contracts" / "s"
    folder.mkdir(parents=True)
    (folder / "s.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN.replace("plugins: [evil]\n", "").replace(", evil]", "]"))
    (folder / "graph.dot").write_text("digraph { a -> b }\n")
    (folder / "m.py").write_text("def step(x):\n    return 0\n")
    for name in ("z3", "click", "yaml", "lark", "hypothesis", "rich", "cryptography", "doit", "jinja2"):
        (tmp_path / f"{name}.py").write_text(EVIL.format(root=str(tmp_path)))
    monkeypatch.setenv("PYTHONPATH", ".")
    run(tmp_path, *words)


READERS = [
    ["check"],
    ["check", "contracts/s"],
    ["audit"],
    ["report"],
    ["fmt", "--check", "contracts/s/s.rcl"],
    ["explain", "s/n/guarantee/g"],
    ["sanity", "contracts/s"],
    ["compose", "contracts/s"],
    ["refines", "contracts/s/s.rcl", "contracts/s/s.rcl"],
    ["diff", "contracts/s", "contracts/s"],
    ["recheck"],
    ["requirements", "contracts/s"],
    ["doctor"],
    ["review", "stamp", "contracts/s", "n"],
    ["--help"],
]


@pytest.mark.parametrize("words", some(READERS, 1, slow=1), ids=" ".join)
def test_a_command_that_reads(place: Path, words: list[str]) -> None:
    run(place, *words)


def message(**body: object) -> bytes:
    text = json.dumps({"jsonrpc": "2.0", **body}).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(text), text)


@pytest.mark.slow
def test_the_language_server(place: Path) -> None:
    asked = [
        message(id=0, method="initialize", params={"processId": None, "rootUri": place.as_uri(), "capabilities": {}})
    ]
    asked.append(message(method="initialized", params={}))
    for name in ("s.rcl", "plan.yaml"):
        path = place / "contracts" / "s" / name
        document = {"uri": path.as_uri(), "languageId": "rcl", "version": 1, "text": path.read_text()}
        asked.append(message(method="textDocument/didOpen", params={"textDocument": document}))
        for number, question in enumerate(("hover", "definition", "documentSymbol", "completion"), 1):
            about = {"textDocument": {"uri": path.as_uri()}, "position": {"line": 0, "character": 80}}
            asked.append(message(id=number, method=f"textDocument/{question}", params=about))
        asked.append(message(method="textDocument/didSave", params={"textDocument": {"uri": path.as_uri()}}))
    asked += [message(id=99, method="shutdown"), message(method="exit")]
    said = run(place, "lsp", stdin=b"".join(asked))
    assert '"id":99' in said.replace(" ", ""), said[-2000:]


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not on the PATH")
def test_a_repository_with_programs_among_its_settings(tmp_path: Path) -> None:
    """Pagers, hooks, what tells of changed files: none is executed. A filter is the user's own setting: no clone has
    it."""
    root = tmp_path / "theirs"
    folder = root / "contracts" / "s"
    folder.mkdir(parents=True)
    (root / "dodo.py").touch()
    (folder / "s.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text("system: s\nrequirements: {}\nnodes: {n: {criticality: low, methods: []}}\n")

    def git(*words: str) -> bytes:
        person = ("-c", "user.name=n", "-c", "user.email=e")
        return subprocess.run(["git", "-C", str(root), *person, *words], check=True, capture_output=True).stdout

    git("init", "-q")
    git("add", "-A")
    git("commit", "-qm", "first")
    program = f"sh -c 'echo $0 >> {root / 'executed'}; cat'"
    settings = {
        "core": ("fsmonitor", "pager", "sshCommand", "editor"),
        'diff "evil"': ("textconv",),
    }
    with (root / ".git" / "config").open("a") as file:
        for part, names in settings.items():
            file.write("\n".join([f"[{part}]", *(f'{name} = "{program}"' for name in names), ""]))
    assert git("config", "diff.evil.textconv") == f"{program}\n".encode()
    (root / ".git" / "info" / "attributes").write_text("* diff=evil\n")
    (folder / "s.rcl").write_text(RCL.replace("<= 1", "<= 2"))
    told = [avow(*words, cwd=root).stdout for words in (("diff", "HEAD"), ("report",))]
    assert "contracts/s/s.rcl:1" in told[0], told
    assert not (root / "executed").exists()

"""The backend on the page works when a plan names it as a plugin."""

from __future__ import annotations

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from helpers import avow

from avow.backend_kit import one_step, registry
from avow.backend_kit.protocol import Backend, Limits, Report
from avow.base import process
from avow.base.codec import Unreadable
from avow.base.diagnostics import Rejected
from avow.conformance.seeded import settle
from avow.pipeline.evidence_keys import surroundings
from avow.pipeline.export import generated
from avow.pipeline.methods import method_job
from avow.pipeline.plan_check import of_plan
from avow.pipeline.workload import survey
from avow.system.load import load_system

PAGE = Path(__file__).parent.parent.parent / "docs" / "developers" / "adding-a-backend.md"


@pytest.mark.slow
def test_the_example_works_as_a_plugin(workspace: Path) -> None:
    code = re.search(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert code is not None
    (workspace / "coin_backend.py").write_text(code[1])
    folder = workspace / "contracts" / "toss"
    folder.mkdir()
    (folder / "system.rcl").write_text(
        "node n { inputs(a : BOOL) outputs(b : BOOL) topics() guarantee same (out.b <=> in.a) }\n"
    )
    (folder / "plan.yaml").write_text(
        "plugins: [coin_backend]\nnodes: {n: {criticality: low, methods: [{coin: {heads: true}}]}}\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "doit", "verify"],
        cwd=workspace,
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(workspace)},
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    lines = (workspace / "artifacts" / "ledger" / "toss.jsonl").read_text().splitlines()
    verdicts = {e["obligation"]: e for e in (json.loads(line)["evidence"] for line in lines)}
    record = verdicts["toss/n/guarantee/same"]
    assert (record["verdict"], record["tool"], record["method"]) == ("tested", "coin", "coin")
    assert (workspace / "artifacts" / "toss" / "n" / "coin" / "coin.txt").is_file()
    shutil.rmtree(workspace / "artifacts")


def test_the_optional_members_are_read(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page's codes, and its claims of what is not looked at, on the page's backend."""
    backend, codes = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    for stem, members in (
        ("plain", ""),
        ("full", "    codes = CODES\n    uses_scenario = False\n    uses_wiring = False\n"),
    ):
        text = codes + backend.replace('    name = "coin"\n', f'    name = "coin"\n{members}')
        (workspace / f"coin_{stem}.py").write_text(text)
    monkeypatch.syspath_prepend(str(workspace))
    folder = workspace / "contracts" / "toss"
    folder.mkdir()
    (folder / "system.rcl").write_text(
        "node n { inputs(a : NATURAL) outputs(b : BOOL) topics() guarantee same (out.b <=> in.a > 0) }\n"
    )
    seen = {}
    for stem in ("plain", "full"):
        for domain in ("0..3", "0..4"):
            scenario = f"scenario: {{domains: {{NATURAL: {domain}}}}}"
            plan = f"plugins: [coin_{stem}]\n{scenario}\nnodes: {{n: {{methods: [coin]}}}}\n"
            (folder / "plan.yaml").write_text(plan)
            system = load_system(folder)
            method = system.plan.node("n").methods[0]
            seen[stem, domain] = surroundings(
                registry.backend("coin", (f"coin_{stem}",)), method_job(system, system.contract.node("n"), method), ""
            )
    assert seen["plain", "0..3"] != seen["plain", "0..4"]
    assert seen["full", "0..3"] == seen["full", "0..4"]
    assert list(registry.backend("coin", ("coin_full",)).codes) == ["COIN101"]
    assert registry.backend("coin", ("coin_plain",)).codes == {}


def refused(folder: Path) -> Rejected:
    """What the stages before a tool runs are refused with."""
    surveyed = survey(folder)
    if isinstance(surveyed, Rejected):
        return surveyed
    try:
        of_plan(surveyed.system)
        generated(surveyed.work("coin"))
    except Rejected as rejected:
        return rejected
    raise AssertionError("nothing is wrong with it")


ODD = "        raise KeyError('odd')\n"
BROKEN = {
    "tools": ("    def tools(self):\n", ODD),
    "files": ('    name = "coin"\n', "    def files(self, job):\n" + ODD),
    "check": ('    name = "coin"\n', "    def check(self, job):\n" + ODD + "        yield\n"),
    "options_schema": ('    name = "coin"\n', ""),
    "export": ("    def export(self, job: Job):\n", ODD),
    "unsaid": ('    name = "coin"\n', "    remembers = True\n    def unsaid(self, node, clause):\n" + ODD),
    "answers_itself": ('    name = "coin"\n', "    remembers = True\n    def answers_itself(self, job):\n" + ODD),
    "translate": ('    name = "coin"\n', "    translations = {'odd': ''}\n    def translate(self, *all):\n" + ODD),
    "suits": ('    name = "coin"\n', "    def suits(self, node):\n" + ODD),
}
ASKED = [name for name, kind in vars(Backend).items() if inspect.isfunction(kind) and not name.startswith("_")]
TOLD_BY_WORKERS = {"discharge", "model", "steps"}  # a crash there is a verdict: tests/pipeline/test_forks.py


@pytest.fixture
def broken(request: pytest.FixtureRequest, workspace: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A system whose plug-in fails in one part."""
    code = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)[0]
    before, added = BROKEN[request.param]
    assert before in code
    text = code.replace(before, before + added)
    if request.param == "options_schema":
        text = text.replace('{"type": "boolean"}', '{"type": "truth"}')
    (workspace / f"coin_{request.param}.py").write_text(text)
    monkeypatch.syspath_prepend(str(workspace))
    monkeypatch.setattr(process.here, "trusts_plugins", True)
    folder = workspace / "contracts" / "toss"
    folder.mkdir()
    (folder / "system.rcl").write_text("node n { inputs() outputs(b : BOOL) topics() guarantee same (out.b) }\n")
    (folder / "plan.yaml").write_text(
        f"plugins: [coin_{request.param}]\nnodes: {{n: {{methods: [{{coin: {{heads: true}}}}]}}}}\n"
    )
    return folder


@pytest.mark.parametrize(
    ("broken", "part"), [(part, part) for part in BROKEN if part not in ("translate", "suits")], indirect=["broken"]
)
def test_what_a_backend_raises_is_told_as_its_defect(part: str, broken: Path) -> None:
    """Wherever Avow asks it in its own process: by its name and the place, and never as a traceback."""
    (told,) = refused(broken).diagnostics
    assert told.code == "BACKEND008"
    assert f"'coin' failed in {part}: " in told.message
    assert ".py:" in told.message


@pytest.mark.parametrize(
    ("broken", "part", "command"),
    [
        ("tools", "tools", "doctor"),
        ("translate", "translate", "translate --to odd contracts/toss"),
        ("suits", "suits", "report contracts/toss"),
    ],
    indirect=["broken"],
)
def test_what_an_installed_backend_raises_ends_a_command_with_a_message(
    broken: Path, part: str, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is no plug-in is asked by commands that need no plan of it, too."""
    (broken / "plan.yaml").write_text("nodes: {n: {methods: []}}\n")
    everyone = {**registry.installed(), "coin": EntryPoint("coin", f"coin_{part}:BACKEND", registry.GROUP)}
    monkeypatch.setattr(registry, "installed", lambda: everyone)
    registry.backend.cache_clear()
    done = avow(*command.split(), cwd=broken.parent.parent)
    registry.backend.cache_clear()
    assert (done.returncode, "Traceback" in done.stderr) == (2, False), done.stderr
    assert f"error[BACKEND008]: the backend 'coin' failed in {part}: KeyError: 'odd', at " in done.stderr


@pytest.mark.parametrize(
    ("part", "made", "told"),
    [
        ("tools", ["dot"], "'dot' is no Tool"),
        ("check", ["wrong"], "'wrong' is no Diagnostic"),
        ("files", ["e.txt"], "'e.txt' is no Path"),
        ("files", None, "'NoneType' object is not iterable"),
        ("export", {"a": b"x"}, "b'x' is no str"),
    ],
)
def test_an_answer_of_another_type_is_told_as_the_backends_defect(part: str, made: object, told: str) -> None:
    """Names in the place of paths ended a run with a traceback."""
    odd: Any = type("Odd", (Backend,), {"name": "odd", "discharge": None, part: lambda self: made})()
    with pytest.raises(Rejected, match=f"the backend 'odd' failed in {part}: TypeError: {told}"):
        getattr(odd, part)()


def test_a_backend_that_ends_the_program_is_told_as_its_defect() -> None:
    """`sys.exit` in `check` ended the run without a word on what had happened."""

    def check(self: object) -> object:
        raise SystemExit(0)

    odd: Any = type("Odd", (Backend,), {"name": "odd", "discharge": None, "check": check})()
    with pytest.raises(Rejected, match="the backend 'odd' failed in check: SystemExit: 0"):
        odd.check()


@pytest.mark.parametrize("part", ASKED)
def test_every_method_of_a_backend_tells_its_defects(part: str) -> None:
    """Also one that is added to `Backend` tomorrow, whoever calls it."""

    def method(self: object) -> object:
        raise KeyError("odd")

    named = {"name": "odd", "discharge": method}
    inherited = type("Some", (), {part: method})
    for made in (type("Odd", (Backend,), {**named, part: method}), type("Odd", (inherited, Backend), named)):
        with pytest.raises(KeyError if part in TOLD_BY_WORKERS else Rejected, match="odd"):
            getattr(made(), part)()


def test_the_suite_reads_a_report_as_the_pipeline_does(tmp_path: Path) -> None:
    """From another process: what cannot be said there is a fault in the suite already."""
    report = Report((), "coin", "1 euro", "toss")  # type: ignore[arg-type]
    asked = mock.patch.multiple(one_step, export=mock.Mock(return_value={}), discharge=mock.Mock(return_value=report))
    with asked, pytest.raises(Unreadable, match="command: not a list"):
        settle(mock.Mock(), mock.Mock(), tmp_path, Limits(10))

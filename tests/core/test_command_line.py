"""Every command takes the same flags in the same way, and the table in docs/adoption.md says which takes which."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from avow.base.diagnostics import Rejected
from avow.base.workspace import Workspace, require_systems
from avow.cli import COMMANDS, command, main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/adoption.md").read_text()

SERVERS = {"lsp", "worker"}
"""They talk with another program until they are stopped: there is no answer that could be JSON."""

NO_QUESTIONS = {
    *SERVERS,
    *(
        "audit",
        "campaign",
        "check",
        "diff",
        "doctor",
        "drive",
        "explain",
        "fretish",
        "fmt",
        "graph",
        "init",
        "monitor",
        "obligations",
        "recheck",
        "report",
        "validate",
    ),
    *("requirements", "review sign", "review stamp", "sign", "translate"),
}
"""They ask no solver and run no tool that a time would bound (`recheck`: the kernel counts steps, not seconds)."""


def _leaves() -> Iterator[tuple[str, click.Command]]:
    for name in COMMANDS:
        found = command(name)
        if isinstance(found, click.Group):
            yield from ((f"{name} {inner}", part) for inner, part in found.commands.items())
        else:
            yield name, found


LEAVES = dict(_leaves())


def options(found: click.Command) -> dict[str, click.Option]:
    return {flag: p for p in found.params if isinstance(p, click.Option) for flag in (*p.opts, *p.secondary_opts)}


def test_json_is_there_wherever_there_is_an_answer() -> None:
    lacking = {name for name, found in LEAVES.items() if "--json" not in options(found)}
    assert lacking == SERVERS
    for name in LEAVES.keys() - SERVERS:
        flag = options(LEAVES[name])["--json"]
        assert flag.is_flag, name
        assert (flag.help or "").startswith("For machines"), name


def test_seconds_are_there_wherever_a_question_is_asked() -> None:
    lacking = {name for name, found in LEAVES.items() if "--seconds" not in options(found)}
    assert lacking == NO_QUESTIONS
    for name in LEAVES.keys() - NO_QUESTIONS:
        flag = options(LEAVES[name])["--seconds"]
        assert (flag.help or "").startswith("Effort for one question to the solver"), name
        assert type(flag.type).__name__ == "_Seconds", name


@pytest.mark.parametrize("flag", ["--seed", "--node", "--json", "--seconds", "-n"])
def test_one_flag_is_of_one_kind_in_every_command(flag: str) -> None:
    kinds = {
        (type(found[flag].type).__name__, found[flag].is_flag, found[flag].multiple)
        for name, leaf in LEAVES.items()
        if flag in (found := options(leaf)) and (flag, name) != ("--node", "refines")  # there it is NAME or NEW=OLD
    }
    assert len(kinds) == 1
    if flag == "--seed":
        helps = {options(leaf)[flag].help for leaf in LEAVES.values() if flag in options(leaf)}
        assert len(helps) == 1


def test_the_table_of_flags_is_that_of_the_commands() -> None:
    rows = re.findall(r"^\| (yes)? *\| (yes)? *\| (`.*) \|$", PAGE, re.MULTILINE)
    named = [(name, system, seconds) for system, seconds, cell in rows for name in re.findall("`([^`]+)`", cell)]
    assert sorted(name for name, *_ in named) == sorted(LEAVES)
    for name, system, seconds in named:
        assert bool(seconds) is ("--seconds" in options(LEAVES[name])), name
        takes = any("SYSTEM" in (p.human_readable_name + (p.metavar or "")).upper() for p in LEAVES[name].params)
        assert bool(system) is (takes or name in ("refines", "sign")), name


SYSTEM = {"plan.yaml": "system: n\n", "n.rcl": "node n {\n  inputs( r : REAL )\n  outputs( x : REAL )\n"
          "  topics( a/B r matches(in.r), a/B x matches(out.x) )\n  assume( in.r >= 0 )\n"
          "  guarantee g( out.x == in.r )\n}\n"}  # fmt: skip


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "dodo.py").touch()
    folder = tmp_path / "contracts" / "n"
    folder.mkdir(parents=True)
    for name, text in SYSTEM.items():
        (folder / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("named", ["n", "contracts/n", "contracts/n/", "contracts/n/plan.yaml", "absolute"])
@pytest.mark.parametrize("name", ["check", "compose", "fmt", "sanity", "translate", "refines", "simulate", "monitor"])
def test_a_system_is_given_by_its_name_or_its_folder_or_its_plan(name: str, named: str, place: Path) -> None:
    given = str(place / "contracts/n") if named == "absolute" else named
    if named == "n":
        (place / "n").mkdir()  # an empty folder of its name does not hide it
    rest = {"translate": ["--to", "rcl"], "refines": [given], "fmt": ["--check"], "monitor": ["no.jsonl"]}
    done = CliRunner().invoke(LEAVES[name], [given, *rest.get(name, [])], standalone_mode=False)
    if name in ("simulate", "monitor"):  # neither a scenario nor a trace: but the system was found
        assert "there is no system" not in str(done.exception)
        assert "RCL002" not in str(getattr(done.exception, "diagnostics", ""))
    else:
        assert done.exception is None, done.output
        assert done.return_value in (0, 1), done.output


@pytest.mark.parametrize("name", ["check", "compose", "fmt", "sanity", "translate"])
def test_the_answer_as_json_is_one_document(name: str, place: Path) -> None:
    rest = {"translate": ["--to", "rcl"], "fmt": ["--check"]}
    done = CliRunner().invoke(LEAVES[name], ["n", "--json", *rest.get(name, [])], standalone_mode=False)
    assert isinstance(json.loads(done.stdout), dict)


@pytest.mark.parametrize(
    "arguments",
    [
        *(["no-such"], ["check"], ["sanity", "no-such-system"], ["report", "no-such-system"]),
        *(["verify", "no-such-system"], ["verify", "--seconds=0"], ["verify", "-n", "-3"], ["init", "/proc/nowhere"]),
    ],
)
def test_usage_and_input_that_are_wrong_end_with_2(
    arguments: list[str], place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert "Traceback" not in capsys.readouterr().err


def test_check_says_which_systems_there_are(place: Path) -> None:
    done = CliRunner().invoke(LEAVES["check"], ["m"], standalone_mode=False)
    assert done.return_value == 2
    assert "there is no system 'm'" in done.output
    assert "known: n" in done.output
    done = CliRunner().invoke(LEAVES["check"], ["contracts/N"], standalone_mode=False)
    assert "did you mean `contracts/n`?" in done.output
    with pytest.raises(Rejected) as refused:
        require_systems(Workspace(place), ["contracts/n/n.rcl"])
    assert refused.value.diagnostics[0].hint == "known: contracts/n"


def test_the_table_of_exit_codes_is_in_one_place() -> None:
    """Other pages may speak of a code; a table of them stands once."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    tables = [p.name for p in pages if re.search(r"^\| *exit code", p.read_text(), re.MULTILINE | re.IGNORECASE)]
    assert tables == ["adoption.md"]

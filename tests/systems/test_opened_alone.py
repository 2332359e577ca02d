"""Each generated file of the shipped systems, opened by its own tool alone: no Avow, in an otherwise empty folder.

The commands are those of each node's `index.md`. An artifact of a run with another version of Avow is no evidence here:
`doit verify` first, as CI does.
"""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from oracle.rml import Interpreter
from oracle.rml_reader import read

from avow.backends.ajpf.parser import read_system
from avow.backends.ajpf.psl_parser import parse_psl
from avow.backends.rosmonitoring.traces import read_trace

ROOT = Path(__file__).parents[2]
INDEXES = sorted((ROOT / "artifacts").glob("*/*/index.md"))
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not INDEXES, reason="no system has been verified here: `doit verify`"),
]
GOOD = {"proved", "checked", "tested", "monitored"}
"""What a verdict says of the claim; "(vacuous)" behind one says that the file holds of every program."""


class Row(NamedTuple):
    claim: str
    method: str
    verdict: str
    file: str
    command: str
    passes: str


def rows(index: Path) -> list[Row]:
    found, claim = [], ""
    for line in index.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            claim = line[3:].rpartition(":")[0]
        elif line.startswith("| ") and not line.startswith(("| method", "| ---")):
            method, verdict, _, file, command, passes = re.split(r"(?<!\\) \| ", line[2:-2], maxsplit=5)
            found.append(Row(claim, method, verdict, file, command.strip("`").replace("\\|", "|"), passes))
    return found


def commands() -> dict[str, list[tuple[Path, Row]]]:
    """Each command once, with all rows that it decides."""
    found: dict[str, list[tuple[Path, Row]]] = {}
    for index in INDEXES:
        for row in rows(index):
            if not row.command.startswith("none"):
                found.setdefault(row.command, []).append((index, row))
    return found


COMMANDS = commands()
TOOLS, EXTRAS = ("RunJPF", "rml-compiler", "dafny", "pytest", "z3"), ("Marabou", "storm")


def tool_of(command: str) -> str:
    return next(word for word in (*TOOLS, *EXTRAS) if word in command)


@pytest.fixture
def alone(tmp_path: Path) -> Path:
    """A folder with what was generated and what the plans name, and nothing else."""
    for name in ("contracts", "artifacts"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("ledger", "logs", "__pycache__"))
    return tmp_path


def passes(command: str, row: Row, alone: Path) -> bool:
    """Whether the check passes by the column of that name."""
    match tool_of(command):
        case "RunJPF":
            pytest.skip("AJPF is not installed; test_every_agent_parses reads its files")
        case "rml-compiler":
            return accepted(*(alone / path for path in re.findall(r"\S+\.(?:rml|jsonl)", command)))
        case "dafny" | "z3" | "Marabou" | "storm" as tool:
            if shutil.which(tool) is None:
                pytest.skip(f"{tool} is not installed")
        case "pytest":
            if importlib.util.find_spec("hypothesis") is None:
                pytest.skip("hypothesis is not installed")
            command = f"{sys.executable} -m {command}"
    done = subprocess.run(["/bin/sh", "-c", command], cwd=alone, capture_output=True, text=True, check=False)
    prints = re.fullmatch(r"it prints `(.+)`", row.passes.strip())
    return prints[1] in done.stdout.splitlines() if prints else done.returncode == 0


def accepted(specification: Path, trace: Path) -> bool:
    """What RML's monitor would say, by the tests' own interpreter."""
    monitor = Interpreter(specification.read_text(encoding="utf-8"))
    return all(monitor.step(recorded.event) != "false" for recorded in read_trace(trace))


@pytest.mark.parametrize(
    "command", COMMANDS, ids=lambda command: re.sub(r".*artifacts/|.*contracts/", "", command)[:80]
)
def test_a_command_agrees_with_the_verdicts_that_it_is_listed_for(command: str, alone: Path) -> None:
    """A claim holds exactly if all its checks pass, so that one that holds has no failing check."""
    decided = COMMANDS[command]
    found = passes(command, decided[0][1], alone)
    for index, row in decided:
        good = row.verdict.partition(" ")[0] in GOOD
        others = [r for r in rows(index) if (r.claim, r.method) == (row.claim, row.method)]
        if good or len(others) == 1:
            assert found is good, (index, row)


def files(suffix: str) -> list[Path]:
    return sorted((ROOT / "artifacts").glob(f"*/*/*/*{suffix}"))


def test_every_kind_of_file_is_there() -> None:
    assert {tool_of(command) for command in COMMANDS} - {*EXTRAS} == {*TOOLS}


@pytest.mark.needs_dafny
@pytest.mark.parametrize("path", files(".dfy"), ids=lambda path: "/".join(path.parts[-4:]))
def test_dafny_accepts_every_file_where_it_is(path: Path, alone: Path) -> None:
    copied = alone / path.relative_to(ROOT)
    done = subprocess.run(["dafny", "/compile:0", copied], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("path", files(".rml"), ids=lambda path: path.name)
def test_every_monitor_is_rml(path: Path) -> None:
    read(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", files(".gwen"), ids=lambda path: "/".join(path.parts[-4:]))
def test_every_agent_parses(path: Path) -> None:
    read_system(path)
    for line in path.with_suffix(".psl").read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            parse_psl(line.partition(": ")[2])

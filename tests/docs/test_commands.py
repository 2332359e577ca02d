"""Every command that a page shows is one that Avow takes, and it runs.

A page shows commands in blocks of shell lines, in indented lines, and in its text. What a page leaves to the reader is
filled in (`GIVEN`, `INSTEAD`); each command then runs in a workspace of its own, with a verified system in it. Commands
that another test runs, or that cannot run here, stand with the reason in `ELSEWHERE`; a new one runs as it stands.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from helpers import avow

from avow.cli import COMMANDS, command

ROOT = Path(__file__).parents[2]
ELSEWHERE_WHOLE = ("docs/tutorial.md", "docs/own-ros2-robot.md", "docs/developers/architecture.md")
"""Two pages that `test_tutorial.py` runs in their order; the page for developers of Avow."""
PAGES = [
    page for page in sorted((ROOT / "docs").rglob("*.md")) if page.relative_to(ROOT).as_posix() not in ELSEWHERE_WHOLE
]
PROGRAMS = r"(?:avow|colcon|dask|doit|eval|export|npm|pip|pytest|python3?)"
FENCED = re.compile(r"^( *)```(\S*)[^\n]*\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(rf"^ {{4,}}({PROGRAMS} \S.*)$", re.MULTILINE)
CODE = re.compile(r"`([^`]+)`")
HERE = re.compile(r"(?:(?:avow (?!lsp|monitor|mutate|report|verify)|cd )[^&|<>$*`]*(?: && |$))+")

GIVEN = {
    "SYSTEM": "thermostat",
    "[SYSTEM]...": "thermostat",
    "SYSTEM...": "thermostat",
    "[SYSTEM[/NODE]]": "thermostat/thermometer",
    "[REQUIREMENT]...": "REQ1",
    "FOLDER": "contracts/thermostat",
    "PATH": "thermostat",
    "NODE": "thermometer",
    "TRACE": "contracts/thermostat/traces/morning.jsonl",
    "ID": "REQ1",
    "METHOD": "review",
    "NOTATION": "unicode",
    "DIRECTORY": "another",
    "DIR": "another",
    "DATE": "2030-12-31",
    "KEY": "my.key",
    "FILE": "contracts/thermostat/system.rcl",
    "FILE.csv": "requirements.csv",
    "REPORT": "reports/thermostat",
    "OLD": "reports/thermostat",
    "NEW": "reports/thermostat",
    "A": "contracts/thermostat/system.rcl",
    "B": "contracts/thermostat/system.rcl",
    "NEW.rcl": "contracts/thermostat/system.rcl",
    "OLD.rcl": "contracts/thermostat/system.rcl",
    "D1": "reading_to_mode",
    "agent.next_waypoint": "thermostat.warms",
    "report.json": "reports/thermostat/report.json",
    "CERTIFICATES": "reports/thermostat/report.json",
    "reports/SYSTEM/report.json": "reports/thermostat/report.json",
    "artifacts/SYSTEM/…/certificates.json": "reports/thermostat/report.json",
    "contracts/SYSTEM": "contracts/thermostat",
    "contracts/sensor": "contracts/thermostat",
    "contracts/robot/sensor.rcl": "sensor.rcl",
}
"""What a page leaves to the reader, word by word."""

KEYED = "avow audit --new-key my.key"
STAMPED = "avow review stamp thermostat thermometer"
SIGNED = 'avow sign --report thermostat --as "A. Person, safety engineer" --until 2030-11-22'
COMPOSED = "avow compose thermostat"
MONITORED = "avow monitor thermostat contracts/thermostat/traces/morning.jsonl"
FRETISH = "avow fretish requirements.json -o contracts/tank/system.rcl"
INSTEAD = {
    "avow translate --to fretish contracts/tank/system.rcl": f"{FRETISH}"
    " && avow translate --to fretish contracts/tank/system.rcl",
    "avow audit --new-key": KEYED,
    "avow audit --sign release.key": f"{KEYED} && avow audit --sign my.key",
    "avow audit --key release.key.pub": f"{KEYED} && avow audit --sign my.key && avow audit --key my.key.pub",
    "avow check --explain": "avow check thermostat --explain",
    "avow compose PATH --json | --rcl": " && ".join(f"{COMPOSED} {flag}" for flag in ("--json", "--rcl")),
    "avow explain HASH": """kept=$(tail -1 artifacts/ledger/thermostat.jsonl | grep -o '"hash":"[0-9a-f]*')"""
    " && avow explain ${kept#*:?}",
    "avow diff v1.2": "avow diff reports/thermostat",
    "avow diff signed --html FILE": f"{SIGNED} && avow diff signed --html changes.html",
    "avow diff OLD [NEW]": "avow diff reports/thermostat reports/thermostat",
    "avow monitor SYSTEM - --node agent": "avow monitor thermostat - --node thermostat <contracts/thermostat/traces/*",
    "avow refines A B [--node n] [--rename new=old]": "avow refines thermostat thermostat"
    " && avow refines thermostat thermostat --node thermostat --rename mode=mode",
    "avow report --check": "avow report --check thermostat",
    "avow report SYSTEM --format NAME": "avow report thermostat --format gsn",
    "avow review sign SYSTEM NODE --key KEY [--method ID]": f"{KEYED} && {STAMPED}"
    " && avow review sign contracts/thermostat thermometer --key my.key --method review",
    "avow review stamp SYSTEM NODE [--method ID] [--renewed DATE]": f"{STAMPED}"
    " && avow review stamp contracts/thermostat thermometer --method review --renewed 2026-11-22",
    "avow mutate SYSTEM": "avow mutate thermostat --node thermometer --limit 1",
    "avow sanity --json": "avow sanity thermostat --json",
    'avow sign --report SYSTEM --as "A. Person, safety engineer" --until 2027-11-22 [--key FILE]': f"{SIGNED}"
    f" && {KEYED} && {SIGNED} --key my.key",
    "avow verify --key FILE": f"{KEYED} && avow verify --key my.key",
    "avow check FILE.rcl …": "avow check contracts/thermostat/system.rcl",
    "avow review sign": f"{KEYED} && {STAMPED} && avow review sign thermostat thermometer --key my.key",
    "avow audit --new-key FILE": KEYED,
    "avow translate --to dafny PATH [--node NAME] [-o FOLDER]": "avow translate --to dafny thermostat -o made"
    " && avow translate --to dafny thermostat --node thermostat",
    "avow translate --to rml SYSTEM [--node NAME] [-o FOLDER]": "avow translate"
    " --to rml thermostat --node thermostat -o made"
    " && avow translate --to rml thermostat --node thermostat",
    "avow translate --to …": "avow translate --to unicode thermostat",
    "python -m avow": "python -m avow --version",
}
"""Where filling in is not enough."""

ROOTED = ("contracts/remote_inspection", "contracts/nasa_rover", "docs/examples")
"""Commands about what is shipped run where it is; they write nothing."""

CODES = {"avow sanity docs/examples/ventilator/conflict.rcl": 1}
"""Other exit codes than 0."""

ELSEWHERE = {
    "avow campaign": "tests/experiment/test_campaign.py",
    "avow drive": "tests/drive/test_callbacks.py",
    "avow init robot --from-": "tests/ros/test_drafts.py",
    "avow monitor SYSTEM --serve": "tests/rosmonitoring/test_monitor_command.py talks with it",
    "avow monitor SYSTEM --live": "tests/rosmonitoring/test_live.py",
    "avow verify --on": "tests/scale/test_cluster.py",
    "avow verify --sandbox": "it needs a tool: tests/isolation",
    "avow worker": "tests/scale/test_cluster.py",
    "colcon ": "tests/docs/test_adoption_kit.py builds the package and runs its test",
    "dask ": "tests/scale/test_cluster.py starts one",
    "doit verify:delivery_robot": "tests/systems/test_delivery_robot.py",
    "doit verify:nasa_rover": "tests/systems/test_nasa_rover.py",
    "eval ": "test_the_shell_completes_commands",
    "export ": "tests/scale/test_cluster.py sets them",
    "pip ": "it installs; test_what_pip_is_told_to_install_exists",
    "pytest ": "a run of tests, and of a backend's: tests/docs/test_adding_a_backend.py",
    "python benchmarks/": "a measurement of some minutes",
    "python docs/adoption/vscode/": "it asks npm; tests/docs/test_adoption_kit.py builds without",
}


def shown() -> dict[str, set[str]]:
    """Every command, on which pages; one that is only the name of a command of Avow is no run of it."""
    found: dict[str, set[str]] = {}
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        lines = [
            line.strip().removeprefix("$ ")
            for kind, body in ((m[2], m[3]) for m in FENCED.finditer(text))
            if kind in ("sh", "console", "bash")
            for line in body.splitlines()
        ]
        plain = FENCED.sub("", text)
        lines += INDENTED.findall(plain)
        lines += [told for code in CODE.findall(plain) if re.match(PROGRAMS + " ", told := " ".join(code.split()))]
        for line in lines:
            told = re.split(r"\s{2,}|\s#", line)[0].strip()
            if told and told.partition(" ")[2] not in COMMANDS:
                found.setdefault(told, set()).add(page.name)
    return found


SHOWN = shown()
TO_RUN = sorted(told for told in SHOWN if not any(told.startswith(start) for start in ELSEWHERE))


def filled(told: str) -> str:
    """The command as a reader would type it."""
    if told in INSTEAD:
        return INSTEAD[told]
    words = re.findall(r"""(?:"[^"]*"|\S)+""", told)
    return " ".join(GIVEN.get(word, word) for word in words)


@pytest.mark.parametrize("told", TO_RUN)
def test_it_is_a_command_of_avow(told: str) -> None:
    """Its options and arguments are those of the command's own parser."""
    for part in re.split(r" && | [<>]", filled(told)):
        words = shlex.split(part)
        if words[0] != "avow":
            continue
        found, rest = command(words[1]), words[2:]
        while isinstance(found, click.Group):
            found, rest = found.commands[rest[0]], rest[1:]
        context = click.Context(found, resilient_parsing=True)
        _, left, _ = found.make_parser(context).parse_args(list(rest))
        assert left == [], told


def test_nothing_is_left_of_what_pages_no_longer_show() -> None:
    assert INSTEAD.keys() | CODES.keys() <= SHOWN.keys()
    assert [start for start in ELSEWHERE if not any(told.startswith(start) for told in SHOWN)] == []


def test_what_pip_is_told_to_install_exists() -> None:
    import tomllib

    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    groups = [group for told in SHOWN for group in re.findall(r"(?:avow|\.)\[([\w,]+)\]", told)]
    named = {extra for group in groups for extra in group.split(",")}
    assert named
    assert named <= extras.keys()


def test_the_shell_completes_commands() -> None:
    done = bash('eval "$(_AVOW_COMPLETE=bash_source avow)" && complete -p avow', ROOT)
    assert done.returncode == 0, done.stderr
    completing = {"COMP_WORDS": "avow re", "COMP_CWORD": "1", "_AVOW_COMPLETE": "bash_complete"}
    offered = bash("avow", ROOT, **completing).stdout.split()
    assert {"plain,report", "plain,requirements", "plain,review", "plain,refines", "plain,recheck"} == set(offered)


def bash(script: str, folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-eo", "pipefail", "-c", script],
        cwd=folder,
        env={**os.environ, "PATH": path, **more},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )


def run(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Commands of Avow's in this process if the line asks a shell for nothing else, and they start no run of jobs."""
    done = subprocess.CompletedProcess[str]([], 0, "", "")
    for part in line.split(" && ") if HERE.fullmatch(line) else ():
        program, *words = shlex.split(part)
        if program == "cd":
            folder /= words[0]
        elif (done := avow(*words, cwd=folder)).returncode:
            break
    return done if done.args else bash(line, folder)


LAMP = """\
GWENDOLEN
:name: lamp
:Initial Beliefs:
:Initial Goals:
light [perform]
:Plans:
+!light [perform] : { True } <- on;
"""

REVIEW = """\
format: 1
system: thermostat
node: thermometer
reviewer: A. Person
role: engineer
date: 2026-11-20
read:
  - {file: models/thermostat.py}
checklist:
  - {question: "Is half a degree taken off?", answer: yes}
conclusion: accepted
"""


@pytest.fixture(scope="module")
def verified(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("commands") / "robot"
    made = bash("avow init robot --template ros2", place.parent)
    assert made.returncode == 0, made.stderr
    folder = place / "contracts/thermostat"
    (folder / "reviews").mkdir()
    (folder / "reviews/thermometer.yaml").write_text(REVIEW)
    plan = folder / "plan.yaml"
    tests = '      - hypothesis: {subject: "models/thermostat.py:read", cases: 500}\n'
    assert tests in plan.read_text()
    plan.write_text(plan.read_text().replace(tests, f"{tests}      - review: {{record: reviews/thermometer.yaml}}\n"))
    (place / "requirements.csv").write_text("id,text,supported_by\nREQ9,It rests.,thermostat.rests\n")
    (place / "requirements.json").write_text("T-1: the tank shall always satisfy level < 10\n")
    (place / "lamp.gwen").write_text(LAMP)
    done = bash("avow verify", place)
    assert done.returncode == 0, done.stdout + done.stderr
    return place


@pytest.mark.slow
@pytest.mark.parametrize("told", TO_RUN)
def test_it_runs(told: str, verified: Path, tmp_path: Path) -> None:
    place = ROOT
    if not any(name in filled(told) for name in ROOTED):
        place = tmp_path / "robot"
        shutil.copytree(verified, place)
    done = run(filled(told), place)
    assert done.returncode == CODES.get(told, 0), f"{filled(told)}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    assert "Traceback" not in done.stdout + done.stderr

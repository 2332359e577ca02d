"""Dafny's answer, read from its XML; exit code and last line are not trusted, only compared with it.

``errors`` means not proved, never refuted; ``errors`` without an error inside is a failure of the prover.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

from avow.base.records import dataclass

_NOISE = re.compile(r"Prover error: line \d+ column \d+: unknown parameter|Legal parameters are:|  \w+ \([\w ]+\)")
_SAID = re.compile(
    r"^ *(?P<file>[^\s(][^(\n]*)\((?P<line>\d+),(?P<column>\d+)\): (?P<what>Error[^\n]*|Warning[^\n]*no body[^\n]*)",
    re.MULTILINE,  # from a line's start only: a tool that prints no line ends would take minutes to read
)
_COUNT = re.compile(r"(\d+) (?:resolution/type|parse) errors? detected in ")


@dataclass(frozen=True, slots=True)
class Failure:
    """A condition that was not proved; `related` are places such as the postcondition's (file, line)."""

    message: str
    file: str
    line: int
    related: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Member:
    """One member that Dafny verified, or did not: kind ``Impl``, ``CheckWellformed``…"""

    kind: str
    module: str
    scope: str
    """The class within the module; ``_default`` for members of the module itself."""
    name: str
    outcome: str
    failures: tuple[Failure, ...]


@dataclass(frozen=True, slots=True)
class Complaint:
    """An error in Dafny's printed output."""

    file: str
    line: int
    message: str


def read_members(xml: str) -> tuple[Member, ...] | None:
    """None if it is not the XML of a finished run."""
    text = xml.lstrip("\ufeff")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        return None
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError):
        return None
    if root.tag != "boogie":
        return None
    return tuple(_member(element) for element in root.iter("method"))


def complaints(output: str) -> tuple[Complaint, ...]:
    """Every error that Dafny prints with a place, and every warning of a missing body."""
    return tuple(Complaint(_file(m["file"]), int(m["line"]), m["what"].strip()) for m in _SAID.finditer(output))


def counted(output: str) -> int | None:
    """The number of errors that Dafny reports from parsing and resolution."""
    match = _COUNT.search(output)
    return int(match.group(1)) if match else None


def quiet(output: str) -> str:
    """The output without the list of legal parameters that newer Z3s print at each query of an older Dafny."""
    return "\n".join(line for line in output.splitlines() if not _NOISE.match(line)) + "\n"


def _member(element: ElementTree.Element) -> Member:
    kind, _, rest = element.get("name", "").partition("$$")
    # 2.3 numbers its modules (_6_AgentImpl) and doubles every underscore of a name.
    path = re.sub(r"^_\d+_", "", rest.split(" ")[0]).split(".")
    conclusion = element.find("conclusion")
    outcome = conclusion.get("outcome", "") if conclusion is not None else ""
    failures = tuple(_failure(error) for error in element.iter("error"))
    module, *between, name = [part.replace("__", "_") for part in path] if len(path) > 1 else ["", *path]
    return Member(kind, module, between[-1] if between else "", name, outcome, failures)


def _failure(error: ElementTree.Element) -> Failure:
    related = tuple((_file(r.get("file", "")), _number(r.get("line"))) for r in error.iter("related"))
    return Failure(error.get("message", ""), _file(error.get("file", "")), _number(error.get("line")), related)


def _file(name: str) -> str:
    """The name without the module by which a refinement inherits the place: ``lamp_spec.dfy[LampImpl]``."""
    return re.sub(r"\[\w+\]$", "", name.strip())


def _number(text: str | None) -> int:
    return int(text) if text is not None and text.isdigit() else 0

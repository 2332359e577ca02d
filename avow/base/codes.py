"""The diagnostic codes: their meaning, and a text that triggers each. They are data, in ``codes.yaml``.

A backend declares the codes of its own in its folder, and shows them as an attribute `codes`: a `Catalogue`, or, for a
backend that is a single file, what `register` returns. The tests check every example; docs/diagnostics.md lists all
codes.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterator, Mapping
from functools import cache, cached_property
from typing import Any

from avow.base.diagnostics import Diagnostic, Severity
from avow.base.packaged import packaged
from avow.base.records import dataclass

FRAME = """\
context {{
  Status  : {{low, high}};
  Command : {{ go(REAL, REAL), stop }};
  Marked  : NATURAL --> BOOL;
}}
node monitor {{
  inputs( level : REAL, count : NATURAL, marked : Marked )
  outputs( status : Status, command : Command )
  topics( float64 level matches(in.level), int32 count matches(in.count), string marked matches(in.marked),
          string status matches(out.status), string command matches(out.command) )
  {clause}
}}
"""
"""The file around an example that is only a clause."""


@dataclass(frozen=True, slots=True)
class Code:
    """A kind of fault. `example` is a file, or the clauses of `FRAME`'s node; empty if no text can show it (an
    unreadable file)."""

    code: str
    title: str
    explanation: str
    """What is wrong; empty if the title says it."""
    example: str = ""
    severity: Severity = Severity.ERROR
    remedy: str = ""
    """The remedy; empty if the example or the message gives it."""

    @property
    def text(self) -> str:
        """The example as a whole file."""
        if self.example.lstrip().startswith(("assume", "guarantee", "A(", "G(", "// avow")):
            return FRAME.format(clause=self.example)
        return self.example

    @property
    def is_lint(self) -> bool:
        """Whether a plan's `lints_off` or a comment ``// avow: allow CODE`` can switch it off."""
        return self.severity is Severity.WARNING


def declare(code: str, title: str, explanation: str, remedy: str, *, warning: bool = False) -> Code:
    """A code whose example is no text of RCL."""
    return Code(code, title, explanation, "", Severity.WARNING if warning else Severity.ERROR, remedy)


_LOADED: list[Mapping[str, Code]] = []
"""The codes of the core and of the backends that are loaded."""


def register(*codes: Code) -> dict[str, Code]:
    """Codes by name, in order. Raises ValueError if one is declared twice."""
    found: dict[str, Code] = {}
    for code in codes:
        if code.code in found:
            raise ValueError(f"{code.code} is declared twice")
        found[code.code] = code
    _LOADED.append(found)
    return found


LANGUAGE = "The language"
"""The section with the codes of contracts."""


class Catalogue(Mapping[str, Code]):
    """The codes that the ``codes.yaml`` of a package declares, read when first needed."""

    def __init__(self, package: str) -> None:
        self._package = package
        _LOADED.append(self)

    @cached_property
    def _codes(self) -> Mapping[str, Code]:
        return _read(packaged(self._package, "codes.yaml"))

    def __getitem__(self, code: str) -> Code:
        return self._codes[code]

    def __iter__(self) -> Iterator[str]:
        return iter(self._codes)

    def __len__(self) -> int:
        return len(self._codes)


def _read(codes: Mapping[str, Mapping[str, Any]]) -> dict[str, Code]:
    return {
        code: Code(
            code,
            said["title"],
            said.get("means", ""),
            said.get("example", ""),
            Severity.WARNING if said.get("warning") else Severity.ERROR,
            said.get("remedy", ""),
        )
        for code, said in codes.items()
    }


@cache
def sections() -> Mapping[str, Mapping[str, Code]]:
    """The codes of the core, by the sections of docs/diagnostics.md."""
    return {title: _read(codes) for title, codes in packaged("avow.base", "codes.yaml").items()}


@cache
def core_codes() -> Mapping[str, Code]:
    """The codes of the core; a backend's own are in its attribute `codes`."""
    return register(*(code for codes in sections().values() for code in codes.values()))


def known() -> Mapping[str, Code]:
    """The codes of the core and of the backends that are loaded, as the backend of every diagnostic is."""
    core_codes()
    return ChainMap(*_LOADED)  # type: ignore[arg-type]


def advice(found: Diagnostic) -> str:
    """What to do about a finding: its hint, otherwise the remedy of its code. Empty for a note without a hint."""
    if found.hint or found.severity is Severity.NOTE:
        return found.hint or ""
    text = known()[found.code].remedy if found.code in known() else ""
    return (text[:1].lower() if text[1:2].islower() else text[:1]) + text[1:].removesuffix(".")


def is_lint(code: str) -> bool:
    """Whether it is a warning of the language, which can be switched off."""
    found = sections()[LANGUAGE].get(code)
    return found is not None and found.is_lint

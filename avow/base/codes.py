"""The diagnostic codes: their meaning, and a text that triggers each. Those of the core are data, in ``codes.yaml``.

A backend declares the codes of its own in its folder (`codes.py`), with `declare` and `register`, and shows them as an
attribute `codes`. The tests check every example; docs/diagnostics.md lists all codes.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from avow.base.diagnostics import Severity
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


def register(*codes: Code) -> dict[str, Code]:
    """Codes by name, in order. Raises ValueError if one is declared twice."""
    found: dict[str, Code] = {}
    for code in codes:
        if code.code in found:
            raise ValueError(f"{code.code} is declared twice")
        found[code.code] = code
    return found


LANGUAGE = "The language"
"""The section with the codes of contracts."""


@cache
def sections() -> Mapping[str, Mapping[str, Code]]:
    """The codes of the core, by the sections of docs/diagnostics.md."""
    return {
        title: register(
            *(
                Code(
                    code,
                    said["title"],
                    said["means"],
                    said.get("example", ""),
                    Severity.WARNING if said.get("warning") else Severity.ERROR,
                    said.get("remedy", ""),
                )
                for code, said in codes.items()
            )
        )
        for title, codes in packaged("avow.base", "codes.yaml").items()
    }


@cache
def core_codes() -> Mapping[str, Code]:
    """The codes of the core; a backend's own are in its attribute `codes`."""
    return register(*(code for codes in sections().values() for code in codes.values()))


def is_lint(code: str) -> bool:
    """Whether it is a warning of the language, which can be switched off."""
    found = sections()[LANGUAGE].get(code)
    return found is not None and found.is_lint

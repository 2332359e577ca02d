"""The result of each system in this run, and the exit code that follows. Light: an idle run needs it too."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from avow.base.records import dataclass


@dataclass(frozen=True, slots=True)
class Result:
    """What the terminal shows of one assessed system."""

    system: str
    exit_code: int
    counts: Mapping[str, int]
    """Status → how many obligations have it."""
    report: str
    gates: tuple[tuple[str, bool, str], ...]
    """(title, passed, reason and what would close it)."""
    left_out: tuple[tuple[str, str], ...] = ()
    """(file, why): plans that no run verifies."""
    verdict: str = ""
    """The case's verdict in words."""
    tone: str = ""
    """The verdict's colour: a known failure is amber, and a system without required gates is grey."""
    lines: tuple[str, ...] = ()
    """The five answers, for a terminal."""
    failed: tuple[str, ...] = ()
    """The methods that ended with an error: the claim, the method and its reason."""


@dataclass(slots=True)
class Results:
    """The results of a run so far."""

    finished: dict[str, Result] = field(default_factory=dict)
    """System → its result."""
    gated: set[str] = field(default_factory=set)
    """The systems that were to be verified, not only reported."""

    def note(self, result: Result, *, gated: bool) -> bool:
        """Remember a result. True: an action's answer."""
        self.finished[result.system] = result
        if gated:
            self.gated.add(result.system)
        return True

    @property
    def all(self) -> tuple[Result, ...]:
        """The systems assessed so far, by name: the order of completion is arbitrary."""
        return tuple(self.finished[name] for name in sorted(self.finished))

    @property
    def exit_code(self) -> int:
        """0: every gate passes; 1: one fails; 3: a gate fails for a missing tool, and no other fails. Only systems that
        were to
        be verified count: `doit report` shows failing gates and ends with 0."""
        codes = {self.finished[name].exit_code for name in self.gated}
        return 1 if 1 in codes else max(codes, default=0)

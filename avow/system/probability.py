"""The probability that a plan asks of a requirement."""

from __future__ import annotations

from dataclasses import field

from avow.base.diagnostics import Span
from avow.base.records import dataclass


@dataclass(frozen=True, slots=True)
class Probability:
    """The probability with which a requirement's formula has to hold: at each step that meets `given`, whatever
    happened before; with `steps`, at all of the first steps of a run; with `per_run`, at all steps of a run."""

    at_least: str
    """An exact decimal between 0 and 1."""
    given: str = ""
    steps: int = 1
    per_run: bool = False
    independent: str = ""
    """Why its guarantees fail independently of each other; empty if that is not assumed."""
    given_span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def words(self) -> str:
        """``with probability at least 0.999 at each step that meets in.person``."""
        each = "at each step" + (f" that meets {self.given}" if self.given else "")
        over = "in a whole run" if self.per_run else f"over the first {self.steps} steps"
        return f"with probability at least {self.at_least} {over if self.per_run or self.steps > 1 else each}"

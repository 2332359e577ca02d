"""The part of a compiled monitor's code (`monitors`) that looks at times: unless all is plain, the engine judges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..options import same_topic
from ..pace import SEQUENCE, Passage, Timing
from ..tuning import TIMES_APART
from .shapes import Shape


@dataclass(slots=True)
class Timed:
    """Lines of code, each for one monitor's variables that a shape of line carries. `a3` is the text of the third
    group, `t` the time."""

    checks: list[str] = field(default_factory=list)
    acts: list[str] = field(default_factory=list)
    used: set[int] = field(default_factory=set)

    def add(
        self, timing: Timing, names: Sequence[str], ages: tuple[Sequence[str], dict[str, float]], made: Shape, at: str,
        scope: dict[str, Any],
    ) -> None:  # fmt: skip
        """`names`: what the line carries; `ages`: the inputs of what is judged then, and their greatest ages so far;
        `at`: makes names in the code unique."""
        scope[f"h{at}"] = timing.heard
        for k, name in enumerate(names):
            scope[f"n{at}_{k}"] = name
            self.acts.append(f"h{at}[n{at}_{k}] = t")
            if name in timing.fresh:
                self._deadline("t", float(timing.fresh[name]))
            if name in timing.paces:
                self._rate(timing, name, made, f"{at}_{k}", scope)
        inputs, scope[f"g{at}"] = ages
        for k, name in enumerate(inputs):
            scope[f"i{at}_{k}"] = name
            self.acts += [
                f"age = t - h{at}.get(i{at}_{k}, t)",
                f"if age > g{at}.get(i{at}_{k}, -1.0): g{at}[i{at}_{k}] = age",
            ]
        self._numbers(timing, made, at, scope)

    def _deadline(self, since: str, limit: float) -> None:
        self.acts.append(f"clock[1] = min(clock[1], ({since} + {limit!r}) * {1 - 2**-50!r})")

    def _rate(self, timing: Timing, name: str, made: Shape, at: str, scope: dict[str, Any]) -> None:
        pace = timing.paces[name]
        scope |= {f"p{at}": pace, f"d{at}": pace.times}
        least, most = float(pace.rate.least) + TIMES_APART, float(pace.rate.most) - TIMES_APART
        self.checks += [
            f"if p{at}.slow or p{at}.fast or len(d{at}) < {pace.times.maxlen}: return False",
            f"if not {least!r} < t - d{at}[0][0] < {most!r}: return False",
        ]
        self.acts.append(f"d{at}.append((t, a{made.time}))")
        self._deadline(f"d{at}[0][0]", float(pace.rate.most))

    def _numbers(self, timing: Timing, made: Shape, at: str, scope: dict[str, Any]) -> None:
        """A message's number has to be the next."""
        groups = made.groups(lambda path: path == SEQUENCE)
        if not groups:
            return
        text = f"a{groups[0]}"
        self.used.update(groups)
        scope[f"s{at}"] = timing.passages.setdefault(same_topic(made.topic), Passage()).last
        self.checks += [
            f"if not {text}.isdigit() or not s{at} or int({text}) != s{at}[0] + 1: return False",
        ]
        self.acts.append(f"s{at}[0] = int({text})")

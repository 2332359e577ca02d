"""The parts of a compiled monitor's code (`monitors`) that look at times, and that note answers and their inputs.

Unless all is plain with the times, the engine judges. Where answers are paired with their inputs (`pairing`), these
and those are noted as the engine notes them, but for their values: of these it has the tokens, and the lines in which
they stand, which are read where a verdict does not follow from the tokens.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..answers import asks, judges_answers_alone, speaks, sure
from ..engine import Monitor
from ..options import same_topic
from ..pace import SEQUENCE, Passage, Timing
from ..pairing import Asked, ticks_of
from ..rules import FieldPath
from ..tuning import TICKS, TIMES_APART
from ..watched import Violation, Watched
from .plans import Plan, Watch, below, is_seen
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


_STAMPS = (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec"))


class Paired:
    """Lines of code for one monitor and one shape of line; none where answers are not paired. `at` makes the names in
    the code unique; `scope` is what the code knows."""

    def __init__(self, watch: Watch, plan: Plan, made: Shape, at: str, scope: dict[str, Any]) -> None:
        self._watch, self._plan, self._at, self._scope = watch, plan, at, scope
        self.settles: list[str] = []
        """First of all: answers are judged whose inputs are known by now."""
        self.found: list[str] = []
        """Where they leave what they find."""
        self.used: set[int] = set()
        self.possible = True
        self._on = watch.monitor.pairing is not None
        pairing = watch.monitor.pairing
        if pairing is None:
            return
        scope |= {f"src{at}": watch.sources, f"wait{at}": pairing.waiting, f"settle{at}": _settling(watch.monitor)}
        scope |= {"ticks_of": ticks_of, "Asked": Asked, "number": _number, "word": _word, "stamp": _stamp}
        scope |= {f"saw{at}": pairing.saw, f"ask{at}": pairing.ask, f"count{at}": pairing.count}
        self.settles += [f"T = ticks_of(a{made.time})", f"f{at} = settle{at}(T) if wait{at} else None"]
        self.found.append(f"f{at}")
        self._inputs = [name for name in plan.names if name in watch.monitor.paired]
        self._keys = {
            side: _key(made, path)
            for side, path, wanted in (
                ("i", pairing.answers.input, self._inputs),
                ("o", pairing.answers.output, plan.asked),
            )
            if path and wanted
        }
        self.possible = None not in self._keys.values()
        self.used.update(group for found in self._keys.values() if found for group in found[1])

    def add(self, checks: list[str], acts: list[str], fresh: dict[int, str]) -> None:
        """What is noted of a line, once it is known that it can be passed over; `fresh`: the names of new tokens."""
        if not self._on:
            return
        at, watch, monitor = self._at, self._watch, self._watch.monitor
        checks += [f"{side}{at} = {found[0]}" for side, found in self._keys.items() if found]
        checks += [f"if {side}{at} is None: return False" for side in self._keys]
        acts.append("raw = match.group(0)")
        acts += [f"src{at}[{slot}] = raw" for slot in fresh]
        for name in self._inputs:
            slot = watch.slots[name]
            if is_seen(monitor.setup.rules[name]):
                checks.append(f"if tok{at}[{slot}] is None: return False")
            key = f"i{at}" if "i" in self._keys else "None"
            self._scope[f"in{at}_{slot}"] = name
            acts.append(f"saw{at}(in{at}_{slot}, T, t, {key}, src{at}[{slot}], line, tok{at}[{slot}])")
        for k, watched in enumerate(self._plan.asked):
            self._ask(watched, f"{at}_{k}", checks, acts, fresh)
        for k, watched in enumerate(self._plan.due):
            if judges_answers_alone(monitor, watched):
                self._scope[f"W{at}_{k}"] = watched
                acts.append(f"count{at}(W{at}_{k}, T)")

    def _ask(self, watched: Watched, here: str, checks: list[str], acts: list[str], fresh: dict[int, str]) -> None:
        at, slots, monitor = self._at, self._watch.slots, self._watch.monitor
        assert monitor.pairing is not None
        own, inputs = speaks(monitor, watched), asks(monitor, watched)
        spoken = [name for name in own if name in watched.names]
        scope = self._scope
        scope |= {f"w{here}": watched, f"own{here}": own, f"inputs{here}": inputs, f"seen{at}": monitor.pairing.seen}
        checks += [f"if tok{at}[{slots[name]}] is None: return False" for name in own if slots[name] not in fresh]
        if supposed := [name for name in spoken if name in monitor.supposed]:
            scope |= {f"sup{at}": monitor.supposed, f"spoken{here}": supposed}
            checks.append(f"if not sup{at}.isdisjoint(spoken{here}): return False")
        if more := [name for name in inputs if name not in watched.paired]:
            scope[f"more{here}"] = frozenset(more)
            checks.append(f"if not more{here} <= seen{at}.keys(): return False")
        values = "".join(f"src{at}[{slots[name]}], " for name in own)
        tokens = "".join(f"tok{at}[{slots[name]}], " for name in spoken)
        key = f"o{at}" if "o" in self._keys else "None"
        places = "(line,)" if watched.outputs else "()"
        acts.append(
            f"ask{at}(Asked(w{here}, raw, line - blank[0], own{here}, ({values}), inputs{here}, T, t, {key}, None, "
            f"{places}, ({tokens})))"
        )

    def copied(self, slot: int, source: int) -> list[str]:
        """What was now is now what the step before said."""
        return [f"src{self._at}[{slot}] = src{self._at}[{source}]"] if self._on else []


def _settling(monitor: Monitor) -> Any:
    def settle(now: int) -> list[Violation] | None:
        found: list[Violation] = []
        monitor.settle(now, found)
        return sure(monitor, found) or None

    return settle


def _key(made: Shape, path: FieldPath) -> tuple[str, tuple[int, ...]] | None:
    """Code for the key of a message, as `Pairing.key` gives it, and the groups that it needs; None where the line has
    none, or not just one."""
    groups = made.groups(below([path]))
    ends = [made.paths[group - 1] for group in groups]
    if len(groups) == 1 and ends[0][-len(path) :] == path:
        return f"{'number' if groups[0] in made.numbers else 'word'}(a{groups[0]})", groups
    names = {end[-1]: group for end, group in zip(ends, groups, strict=True) if end[-len(path) - 1 : -1] == path}
    for second, rest in _STAMPS:
        if len(groups) == 2 and {second, rest} == names.keys() and made.numbers >= set(groups):
            return f"stamp(a{names[second]}, a{names[rest]})", groups
    return None


def _number(text: bytes) -> int | str:
    return int(text) if text.removeprefix(b"-").isdigit() else text.decode()


def _word(text: bytes) -> str | bool:
    return text[1:-1].decode() if text[0] == 34 else text == b"true"


def _stamp(second: bytes, rest: bytes) -> tuple[int, str] | None:
    if not (second.removeprefix(b"-").isdigit() and rest.removeprefix(b"-").isdigit()):
        return None
    return int(second) * TICKS + int(rest) * (TICKS // 10**9), "s"

"""The agent's environment as data: when percepts are drawn, from what, and the assumptions about the draws.

    draws: {at_start: true, at_quiescence: once, quiet: [beep]}      # every action but print and the quiet ones draws
    percepts:                                                        # one alternative of each group is drawn
      result: ["arrived(0, 3)", nothing]
      light: [red, amber, nothing]
    start: {light: [nothing]}                                        # narrower alternatives for the first draw
    after: {look: {result: [keep]}}                                  # and for the draw after an action
    fair: [{percept: "arrived(0, 3)", because: "the motion planner always ends"}]

`nothing` is no percept of the group; `keep` leaves the group as it is. A fairness assumption says: if percepts are
drawn infinitely often, then so are draws that contain the percept. No other fairness is assumed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from avow.backend_kit.given import file_bytes
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.packaged import packaged
from avow.system.plan import Located
from avow.system.schema import violations
from avow.system.strict_yaml import read_yaml

from .parser import parse_fact
from .terms import Struct, show
from .tuning import DRAWS

NOTHING = "nothing"
KEEP = "keep"


def _listed(names: Sequence[str], last: str = "and") -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"


@dataclass(frozen=True, slots=True)
class Fairness:
    percept: Struct
    because: str


Choice = tuple[int, ...]
"""The index of the alternative drawn last from each group; -1 before the first draw."""


@dataclass(frozen=True, slots=True)
class Environment:
    groups: tuple[tuple[str, tuple[Struct | None, ...]], ...]
    start: Mapping[str, tuple[int, ...]]
    after: Mapping[str, Mapping[str, tuple[int, ...]]]
    """Action's name → group → indices of the alternatives; KEEP is -1."""
    quiet: frozenset[str]
    at_start: bool
    at_quiescence: str
    fair: tuple[Fairness, ...]

    @property
    def before(self) -> Choice:
        return (-1,) * len(self.groups)

    def percepts(self, choice: Choice) -> tuple[Struct, ...]:
        """The percepts, in the order of the groups."""
        found = (group[at] for (_, group), at in zip(self.groups, choice, strict=True) if at >= 0)
        return tuple(p for p in found if p is not None)

    def draws(self, choice: Choice, narrowed: Mapping[str, tuple[int, ...]]) -> tuple[Choice, ...]:
        """Every possible draw after `choice`."""
        options = [
            tuple(dict.fromkeys(now if at < 0 else at for at in narrowed.get(name, range(len(group)))))
            for (name, group), now in zip(self.groups, choice, strict=True)
        ]
        return tuple(product(*options))

    def _narrowings(self) -> Iterator[str]:
        """The draws after single actions, and at the start: in one sentence if they are the same."""
        alike: dict[tuple[str, ...], list[str]] = {}
        for action, narrowed in (*self.after.items(), *([("the start", self.start)] if self.start else [])):
            drawn: dict[str, list[str]] = {}
            for name, places in narrowed.items():
                what = " or ".join("as before" if i < 0 else self._said(name, i) for i in places)
                drawn.setdefault(what, []).append(name)
            texts = tuple(
                f"{_listed(names)} {'is' if len(names) == 1 else 'are'} {what}" for what, names in drawn.items()
            )
            alike.setdefault(texts, []).append(action)
        for texts, actions in alike.items():
            if texts:
                yield f"after {_listed(actions, 'or')}, {', '.join(texts)}"

    def describe(self) -> tuple[str, ...]:
        """What the environment may do, in sentences."""
        groups = "; ".join(
            f"{name}: {' or '.join(NOTHING if p is None else show(p) for p in group)}" for name, group in self.groups
        )
        when = ["at the start"] if self.at_start else []
        when.append(f"at every action except {', '.join(sorted({*self.quiet, 'print'}))}")
        if self.at_quiescence != "never":
            often = "once" if self.at_quiescence == "once" else "again and again"
            when.append(f"{often} when the agent has nothing to do")
        texts = [f"percepts are drawn {', '.join(when)}, one of each group: {groups}"]
        texts += self._narrowings()
        texts += [f"fairness: draws with {show(f.percept)} never cease ({f.because})" for f in self.fair]
        return tuple(texts)

    def _said(self, name: str, place: int) -> str:
        percept = dict(self.groups)[name][place]
        return NOTHING if percept is None else show(percept)


def read_environment(path: Path) -> Environment:
    """Raises Rejected with every problem, located."""
    piece, problems = read_yaml(file_bytes(path, "AJPF110"), str(path))
    if problems:
        raise Rejected(*problems)
    located = piece.located()
    faults = [
        replace(fault, code="AJPF110")
        for fault in violations(located, packaged("avow.backends.ajpf", "environment.schema.json"), "environment")
    ]
    if faults:
        raise Rejected(*faults)
    return _read(located)


def _read(located: Located) -> Environment:
    data = located.data
    faults: list[Diagnostic] = []
    groups: dict[str, tuple[Struct | None, ...]] = {}
    for name, words in data["percepts"].items():
        alternatives: list[Struct | None] = []
        for at, word in enumerate(words):
            percept = None if word == NOTHING else parse_fact(word)
            if percept is None and word != NOTHING:
                message = f"{word!r} is no percept such as 'danger' or 'result(0, 3)'"
                faults.append(Diagnostic("AJPF110", message, located.at("percepts", name, at)))
            alternatives.append(percept)
        groups[name] = tuple(alternatives)
    size = 1
    for group in groups.values():
        size *= len(group)
    if size > DRAWS:
        faults.append(Diagnostic("AJPF110", f"{size} possible draws; at most {DRAWS}", located.at("percepts")))

    def narrow(given: Mapping[str, list[str]], *path: str) -> dict[str, tuple[int, ...]]:
        result = {}
        for name, words in given.items():
            places = []
            for at, word in enumerate(words):
                if name not in groups:
                    faults.append(Diagnostic("AJPF110", f"there is no group '{name}'", located.at(*path, name)))
                    break
                percept = None if word == NOTHING else parse_fact(word)
                if word == KEEP and path[0] == "after":
                    places.append(-1)
                elif percept in groups[name] and (percept is not None or word == NOTHING):
                    places.append(groups[name].index(percept))
                else:
                    message = f"{word!r} is no alternative of '{name}'"
                    faults.append(Diagnostic("AJPF110", message, located.at(*path, name, at)))
            result[name] = tuple(places)
        return result

    start = narrow(data.get("start", {}), "start")
    after = {action: narrow(given, "after", action) for action, given in data.get("after", {}).items()}
    fair: list[Fairness] = []
    known = {p for group in groups.values() for p in group if p is not None}
    for at, entry in enumerate(data.get("fair", ())):
        percept = parse_fact(entry["percept"])
        if percept is None or percept not in known:
            message = f"{entry['percept']!r} is in no group, so that no draw has it"
            faults.append(Diagnostic("AJPF110", message, located.at("fair", at, "percept")))
        else:
            fair.append(Fairness(percept, entry["because"]))
    if faults:
        raise Rejected(*faults)
    draws = data.get("draws", {})
    return Environment(
        tuple(groups.items()),
        start,
        after,
        frozenset(draws.get("quiet", ())),
        draws.get("at_start", True),
        draws.get("at_quiescence", "once"),
        tuple(fair),
    )

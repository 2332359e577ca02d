"""Answers whose outputs come on several topics: which messages are parts of one answer.

By stamp, key and call those that have it in common; by order the k-th of each output; by latency those that came within
it. By arrival an answer is whole when each output has come since the last one. One that cannot be read takes its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from avow.formulas.values import Value
from avow.language.contract import ClauseKind

from .pairing import ticks, time_of
from .reading import Reader
from .tuning import KEYS_KEPT
from .watched import Answer, Fault, Part, Violation, Watched, open_verdict

if TYPE_CHECKING:
    from .engine import Monitor


def came(
    monitor: Monitor, watched: Watched, names: Mapping[str, bool], event: Mapping[str, Any], found: list[Violation]
) -> Iterator[Answer | None]:
    """The answers of a clause that are whole now that some of its outputs have come (whether each could be read): of
    one whose parts may have come apart, they; else None."""
    tally = watched.tally
    if len(watched.outputs) == 1:
        tally.published += 1
        if all(names.values()):
            yield None
        else:
            tally.unreadable += 1
            _count(monitor, watched, time_of(event))
        return
    touched: dict[object, None] = {}
    for name, readable in names.items():
        key = _key(monitor, watched, name, event)
        if key is None:
            _leave(monitor, watched, event, found)
        parts = watched.fresh.setdefault(key, {})
        touched[key] = None
        tally.published += not parts
        if name in parts:
            tally.published += 1
            monitor.judge_part(watched, {name: parts[name]}, event, found)
        values = _known(monitor, watched, name) if readable else None
        parts[name] = Part(values, monitor.heard_of((name,)), time_of(event))
    for key in touched:
        parts = watched.fresh[key]
        if watched.outputs <= parts.keys():
            del watched.fresh[key]
            if watched.scattered or any(part.values is None for part in parts.values()):
                monitor.judge_part(watched, parts, event, found)
            elif key is None:
                yield None
            else:
                values = {n: part.values[n] for n, part in parts.items() if part.values is not None}
                yield Answer(key, values, {n: at for part in parts.values() for n, at in part.heard.items()})
    while len(watched.fresh) > KEYS_KEPT:
        monitor.judge_part(watched, watched.fresh.pop(next(iter(watched.fresh))), event, found)


def scatter(clauses: Iterable[Watched]) -> None:
    """Messages of some outputs were lost."""
    for watched in clauses:
        watched.scattered = watched.scattered or len(watched.outputs) > 1


def finish(monitor: Monitor, watched: Watched, found: list[Violation]) -> str:
    """The run is over: what never was whole is judged. Why the parts need not have been told rightly, if so."""
    while watched.fresh:
        monitor.judge_part(watched, watched.fresh.pop(next(iter(watched.fresh))), {}, found)
    if len(set(watched.counted.values())) < 2 and watched.counted.keys() in (set(), watched.outputs):
        return ""
    counts = " and ".join(f"{watched.counted.get(name, 0)} of {name}" for name in sorted(watched.outputs))
    return f"messages: {counts}: which are parts of one answer is not told by their order (`answers: {{by: order}}`)"


def judge_part(
    monitor: Monitor, watched: Watched, parts: Mapping[str, Part], event: Mapping[str, Any], found: list[Violation]
) -> None:
    """Judge what is known of an answer that never was whole: it is decided where the rest does not matter."""
    tally = watched.tally
    monitor.lose(watched)
    _count(monitor, watched, max(part.time for part in parts.values()))
    if any(part.values is None for part in parts.values()):
        tally.unreadable += 1
        return
    values: dict[str, Value] = {n: v for part in parts.values() for n, v in (part.values or {}).items()}
    truth = None if watched.scattered or monitor.so_far is not None else _open(monitor, watched, values)
    if truth is None:
        tally.partial += 1
        tally.reason = tally.reason or (SCATTERED if watched.scattered else "")
        return
    tally.judged += 1
    if not truth:
        tally.broken += 1
        said = f"{watched.said}, whatever the rest of the answer was"
        wrong = monitor.violation(Fault.GUARANTEE, watched.clause.name, event, said, watched, values)
        found.append(replace(wrong, heard={n: at for part in parts.values() for n, at in part.heard.items()}))


def _count(monitor: Monitor, watched: Watched, time: Fraction) -> None:
    """An answer that is not held against inputs counts among the answers."""
    if monitor.pairing is not None:
        monitor.pairing.count(watched, ticks(time))


SCATTERED = "a message of one of several outputs was lost: which parts are of one answer is not told by their order"


def _key(monitor: Monitor, watched: Watched, name: str, event: Mapping[str, Any]) -> object:
    pairing = monitor.pairing
    if pairing is None or pairing.answers.by == "latency":
        return None
    if pairing.answers.by == "order":
        watched.counted[name] = watched.counted.get(name, 0) + 1
        return watched.counted[name]
    return pairing.key(event, pairing.answers.output)


def _leave(monitor: Monitor, watched: Watched, event: Mapping[str, Any], found: list[Violation]) -> None:
    """By latency, parts that are too old to be of the answer that comes."""
    parts, pairing = watched.fresh.get(None), monitor.pairing
    if not parts or pairing is None or pairing.answers.by != "latency":
        return
    since = time_of(event) - pairing.answers.latency - 2 * pairing.answers.jitter
    if any(part.time < since for part in parts.values()):
        monitor.judge_part(watched, watched.fresh.pop(None), event, found)


def _known(monitor: Monitor, watched: Watched, name: str) -> dict[str, Value]:
    """One output, and all that is known but the other outputs of the answer."""
    values = {**monitor.values, **watched.memory}
    held = {n for n, _ in watched.held}
    paired = monitor.paired if monitor.pairing is not None else frozenset()
    return {
        n: values[n]
        for n in monitor.spoken(watched)
        if n in values
        and (n == name or n not in watched.outputs)
        and (n not in held or n in watched.memory)
        and n not in paired
        and n not in monitor.supposed
    }


def _open(monitor: Monitor, watched: Watched, values: Mapping[str, Value]) -> bool | None:
    if not monitor.solver or not monitor.questions or watched.clause.kind is ClauseKind.ASSUMPTION:
        return None
    monitor.questions -= 1
    return open_verdict(watched, monitor.assumptions, values, monitor.solver)


def own(monitor: Monitor, readers: list[tuple[str, Reader]], event: Mapping[str, Any]) -> list[tuple[str, Reader]]:
    """Those of variables that a message carries, whoever else publishes its topic."""
    unknown = [name for name, _ in readers if monitor.setup.whose(name, event) is None]
    for watched in monitor.about(unknown):
        watched.tally.unnamed(str(event["topic"]))
        monitor.lose(watched)
    return [(name, read) for name, read in readers if monitor.setup.whose(name, event)]

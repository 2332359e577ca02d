"""How a monitor handles answers: which messages are parts of one, and those that wait for their inputs (`pairing`).

The outputs of an answer on several topics are its parts: by stamp, key and call those that share it; by order the k-th
of each output; by latency those that came within it. By arrival an answer is complete when each output has come since
the last one. An unreadable answer keeps its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from operator import and_
from typing import TYPE_CHECKING, Any

from avow.formulas.formula import free_variables
from avow.formulas.values import Value
from avow.language.contract import ClauseKind
from avow.ros.bags import publisher

from .guarding import FALLBACK
from .options import same_topic
from .pace import Passage
from .pairing import EARLY, Asked, Choices, ticks, time_of
from .reading import Reader
from .rules import of_latest
from .tuning import BREACHES_IN_DOUBT, KEYS_KEPT
from .watched import DEPENDS, Answer, Fault, Part, Violation, Watched, open_verdict
from .word import topics_of

if TYPE_CHECKING:
    from .engine import Monitor


def came(
    monitor: Monitor, watched: Watched, names: Mapping[str, bool], event: Mapping[str, Any], found: list[Violation]
) -> Iterator[Answer | None]:
    """The answers of a clause that are complete now that some of its outputs have come (whether each could be read): an
    Answer if its parts may have come apart, otherwise None."""
    tally = watched.tally
    if len(watched.outputs) == 1:
        tally.published += 1
        if all(names.values()):
            yield None
        else:
            tally.unreadable += 1
        return
    touched: dict[object, None] = {}
    for name, readable in names.items():
        key = _key(monitor, event)
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


def finish(monitor: Monitor, watched: Watched, found: list[Violation]) -> None:
    """The run is over: judge incomplete answers."""
    while watched.fresh:
        monitor.judge_part(watched, watched.fresh.pop(next(iter(watched.fresh))), {}, found)


def judge_part(
    monitor: Monitor, watched: Watched, parts: Mapping[str, Part], event: Mapping[str, Any], found: list[Violation]
) -> None:
    """Judge the known part of an answer that was never complete: it is decided if the rest does not matter."""
    tally = watched.tally
    monitor.lose(watched)
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
        said = f"{watched.statement}, whatever the rest of the answer was"
        wrong = monitor.violation(Fault.GUARANTEE, watched.clause.name, event, said, watched, values)
        found.append(replace(wrong, heard={n: at for part in parts.values() for n, at in part.heard.items()}))


SCATTERED = "a message of one of several outputs was lost: the order does not show which parts are of one answer"


def _key(monitor: Monitor, event: Mapping[str, Any]) -> object:
    pairing = monitor.pairing
    if pairing is None or pairing.answers.by == "latency":
        return None
    return pairing.key(event, pairing.answers.output)


def _leave(monitor: Monitor, watched: Watched, event: Mapping[str, Any], found: list[Violation]) -> None:
    """By latency, judge parts that are too old to be of the answer that comes."""
    parts, pairing = watched.fresh.get(None), monitor.pairing
    if not parts or pairing is None or pairing.answers.by != "latency":
        return
    since = time_of(event) - pairing.answers.latency - 2 * pairing.answers.jitter
    if any(part.time < since for part in parts.values()):
        monitor.judge_part(watched, watched.fresh.pop(None), event, found)


def _known(monitor: Monitor, watched: Watched, name: str) -> dict[str, Value]:
    """One output, and all known values except the other outputs of the answer."""
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
    if not monitor.questions or watched.clause.kind is ClauseKind.ASSUMPTION:
        return None
    monitor.questions -= 1
    return open_verdict(watched, monitor.assumptions, values)


def own(monitor: Monitor, readers: list[tuple[str, Reader]], event: Mapping[str, Any]) -> list[tuple[str, Reader]]:
    """The readers of variables whose message is the node's own, if other nodes publish its topic too."""
    unknown = [name for name, _ in readers if monitor.setup.whose(name, event) is None]
    for watched in monitor.about(unknown):
        watched.tally.unnamed(str(event["topic"]))
        monitor.lose(watched)
    topic = same_topic(str(event["topic"]))
    if publisher(event) == FALLBACK and topic in monitor.setup.filtered:
        monitor.timing.passages.setdefault(topic, Passage()).replaced += 1
    return [(name, read) for name, read in readers if monitor.setup.whose(name, event)]


def speaks(monitor: Monitor, watched: Watched) -> tuple[str, ...]:
    """The variables that the verdict on an answer depends on, except the inputs that it is paired with: first those of
    the clause, then those of the assumptions."""
    return tuple(dict.fromkeys(n for n in (*watched.names, *monitor.assumed) if n not in monitor.paired))


def asks(monitor: Monitor, watched: Watched) -> tuple[str, ...]:
    """The inputs that an answer is paired with."""
    return tuple(dict.fromkeys((*watched.paired, *(n for n in monitor.assumed if n in monitor.paired))))


def saw(monitor: Monitor, name: str, event: Mapping[str, Any], value: Value | None) -> None:
    """A message of a variable has come (None: it could not be read), which answers may be paired with."""
    pairing = monitor.kept
    if pairing is not None and (monitor.pairing is None or name in monitor.paired):
        now, key = time_of(event), pairing.key(event, pairing.answers.input)
        pairing.saw(name, ticks(now), float(now), key, value, monitor.at.get(name, (monitor.events, ""))[0])


def unknown(monitor: Monitor, name: str, event: Mapping[str, Any]) -> None:
    """A variable's value is now unknown: clauses that need it wait for the next good message."""
    monitor.miss({name})
    if of_latest(monitor.setup.rules[name]):
        monitor.forget(name)
    saw(monitor, name, event, None)


def passages(monitor: Monitor, names: Set[str]) -> list[tuple[str, Passage]]:
    """The losses on the topics that carry some variables, and of transforms and the clock."""
    every = monitor.timing.passages.items()
    return [(t, passage) for t, passage in every if not (own := monitor.carried(t)) or not names.isdisjoint(own)]


def unheard(monitor: Monitor, clause: str) -> str:
    """Why messages that a clause speaks of were not heard, according to the record; empty if they were."""
    names = {v.qualified for v in free_variables(monitor.setup.node.clause(clause).formula)}
    return next((f"not all was heard: {p.unheard}" for _, p in passages(monitor, names) if p.unheard), "")


def accused(monitor: Monitor, watched: Watched, values: Mapping[str, Value]) -> bool:
    """Whether a clause about outputs alone is broken, of a node with assumptions on its inputs: the node at fault
    depends on what the answer answered."""
    alone = monitor.pairing is not None and watched.outputs and not watched.paired
    if not alone or monitor.paired.isdisjoint(monitor.assumed):
        return False
    known = all(name in values and name not in monitor.supposed for name in watched.names)
    return known and watched.truth_of(values) is False


def ask(
    monitor: Monitor, watched: Watched, values: Mapping[str, Value], answer: Answer | None, event: Mapping[str, Any]
) -> None:
    """An answer, which is judged once the inputs that it may have answered are known."""
    assert monitor.pairing is not None
    pairing, now = monitor.pairing, time_of(event)
    key = pairing.key(event, pairing.answers.output) if answer is None else answer.key
    pairing.replied(watched, (key,))
    missing = [n for n in watched.names if n not in monitor.paired and (n not in values or n in monitor.supposed)]
    if missing:
        watched.tally.too_early(n for n in missing if n not in monitor.supposed)
        return
    own = tuple(n for n in speaks(monitor, watched) if n in values)
    inputs = tuple(n for n in asks(monitor, watched) if n in watched.paired or n in pairing.seen or n in pairing.times)
    heard = monitor.heard_of(watched.outputs) if answer is None else answer.heard
    known, places = {n: values[n] for n in own}, tuple({place for place, _ in heard.values()})
    watched.asked = inputs
    pairing.ask(Asked(watched, event, monitor.events, known, inputs, ticks(now), float(now), key, heard, places))


def judge_answer(monitor: Monitor, asked: Asked, choices: Choices, found: list[Violation]) -> None:
    """Judge an answer whose inputs are known, or cannot be."""
    pairing = monitor.kept
    assert pairing is not None
    watched, tally = asked.watched, asked.watched.tally
    cases = choices if isinstance(choices, str) else pairing.cases(asked, choices)
    if cases == EARLY:
        tally.too_early(name for name in asked.timed if pairing.current(name, asked) == EARLY)
        return
    if isinstance(cases, str):
        tally.unsure(cases)
        return
    verdicts = {monitor.verdict(watched, values) for values in cases}
    if len(verdicts) > 1:
        tally.unsure(DEPENDS)
        return
    initial = (of_latest(monitor.setup.rules[name]) for name, places in asked.messages.items() if 0 in places)
    if verdicts == {"held"} and monitor.doubts is None and any(initial):
        tally.supposed += 1
        return
    tally.aged(asked.seconds, asked.since, watched.paired)
    tally.judged += 1
    tally.met |= reduce(and_, (watched.met(values) for values in cases))
    (verdict,) = verdicts
    if verdict is None:
        tally.undecided += 1
    elif isinstance(verdict, Fault):
        tally.broken += 1
        tally.excused += verdict is Fault.EXCUSED
        said = watched.statement
        if verdict is Fault.EXCUSED:
            said += "; but an assumption does not hold"
        wrong = monitor.violation(verdict, watched.clause.name, asked.event, said, watched, cases[0])
        found.append(replace(wrong, index=asked.index, heard=asked.heard))


def doubtful(monitor: Monitor, watched: Watched) -> bool:
    """By order: whether a verdict on a clause may be about messages that do not belong together, which is known only at
    the end of the run, if their numbers differ."""
    setup, spoken = monitor.setup, {*watched.names}
    if setup.answers is None or setup.answers.by != "order":
        return False
    if watched.clause.kind is ClauseKind.GUARANTEE:
        return bool(setup.heard & {*spoken, *monitor.assumed}) or len(topics_of(setup, spoken)) > 1
    return monitor.word is not None and len(topics_of(setup, spoken)) > 1


def sure(monitor: Monitor, found: list[Violation], *, over: bool = False) -> list[Violation]:
    """The violations that may be reported now; breaches in doubt wait for the end of the run."""
    if not found or not monitor.by_order or (monitor.prompt and not over):
        return found
    told: list[Violation] = []
    for violation in found:
        if violation.fault is Fault.MAPPING or violation.clause not in monitor.by_order:
            told.append(violation)
        elif len(monitor.in_doubt) < BREACHES_IN_DOUBT:
            monitor.in_doubt.append(violation)
        else:
            tally = monitor.by_order[violation.clause].tally
            tally.reason = tally.reason or f"{BREACHES_IN_DOUBT} breaches are reported, the others counted"
    return told


def withdraw(monitor: Monitor, found: list[Violation]) -> list[Violation]:
    """The numbers of messages differ: verdicts on messages paired by order are undecided, unless the messages' numbers
    show which were lost: since then, nothing was judged."""
    if monitor.unnumbered and len(_sent(monitor)) == 1:
        return found
    for watched in monitor.by_order.values():
        tally = watched.tally
        tally.order += tally.judged
        tally.judged = tally.broken = tally.excused = tally.undecided = 0
        tally.met = 0
        tally.reason = tally.reason or monitor.backwards
    return [v for v in found if v.fault is Fault.MAPPING or v.clause not in monitor.by_order]


def _sent(monitor: Monitor) -> set[int]:
    """The number of messages that each topic of such clauses had, including those lost according to their numbers."""
    if monitor.word is not None:
        topics = {*monitor.word.topics}
    else:
        outputs = (name for watched in monitor.by_order.values() for name in watched.outputs)
        seen = monitor.pairing.seen if monitor.pairing is not None else ()
        topics = {*topics_of(monitor.setup, (*seen, *outputs))}
    passages = monitor.timing.passages
    return {monitor.numbers.get(t, 0) + (passages[t].lost if t in passages else 0) for t in topics}


def uneven(monitor: Monitor) -> str:
    """By order: why messages may have been matched wrongly; empty if they were not. Inputs after the last answer may
    have no answer yet."""
    setup, passages, word, pairing = monitor.setup, monitor.timing.passages, monitor.word, monitor.pairing
    if setup.answers is None or setup.answers.by != "order":
        return ""

    def later(topic: str, time: Fraction) -> int:
        """The number of messages after the last answer."""
        if word is not None:
            return word.later(topic, time)
        return max(pairing.later(n, time) for n in monitor.carried(topic) if n in pairing.seen) if pairing else 0

    several = [topics_of(setup, (*w.outputs, *w.asked)) for w in monitor.about(monitor.clauses) if w.outputs]
    for topics in several if word is None else [word.topics]:
        counts = {topic: monitor.numbers.get(topic, 0) for topic in topics}
        answers = {counts[topic] for topic, output in topics.items() if output}
        ends = (passages[t].latest for t, output in topics.items() if output and t in passages)
        last = max(filter(None, ends), default=Fraction(0))
        inputs = [topic for topic, output in topics.items() if not output] if answers - {0} else []
        if len(answers) > 1 or not all(answers <= {counts[t], counts[t] - later(t, last)} for t in inputs):
            told = " and ".join(f"{count} of {topic}" for topic, count in counts.items())
            return f"messages: {told}: their order does not show which belong together (`answers: {{by: order}}`)"
    return ""

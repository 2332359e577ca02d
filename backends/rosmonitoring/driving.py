"""``avow drive``: run a node's callback class without ROS; its output as a trace, or compared with a recording."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import click

from avow.backend_kit.programs.callbacks import SECOND, Driver, Event, driver, unusable
from avow.backend_kit.programs.compared import Compared, compared
from avow.base.codec import document
from avow.base.files import write_out
from avow.base.workspace import system_folder
from avow.ros.bags import GONE, fields_of
from avow.system.load import load_system

from .traces import read_trace
from .tuning import DIFFERENCES
from .wires import exact


@click.command()
@click.argument("system")
@click.argument("node")
@click.argument("trace", required=False, type=click.Path(path_type=Path))
@click.option("--replay", is_flag=True, help="Compare what it publishes with what TRACE has on its topics.")
@click.option("--messages", type=click.IntRange(1, 100_000), default=200, show_default=True, help="Without TRACE.")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="Write inputs and publications, as a trace.")
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=click.IntRange(0, 2**31 - 1),
    help="Where random choices start: the same seed, the same answer.",
)
@click.option("--json", "as_json", is_flag=True, help="For machines: what was heard, published, raised, and differs.")
def command(
    system: str, node: str, trace: Path | None, replay: bool, messages: int, output: Path | None, seed: int,
    as_json: bool,
) -> int:  # fmt: skip
    """Run the callback class that the plan of SYSTEM (a folder, or a name under contracts/) declares as NODE, in
    virtual time and without ROS.

    It receives the messages that TRACE (JSON lines or a bag) has on its topics, or generated ones without TRACE. -o
    writes what it received and published, for `avow monitor` and as a trace of the plan. --replay compares its
    publications with those of TRACE, topic by topic, in order and bit by bit; times are not compared, nor is
    header.stamp where both are the clock's time: how many differ only in it is said.

    Code 1 if the class raises, or its publications differ from the recording; 2 if it uses a part of ROS that is not
    driven, or if what it publishes depends on a clock or on chance.
    """

    if replay and trace is None:
        raise click.UsageError("--replay compares with a TRACE")
    found = driver(load_system(system_folder(system)), node)
    recorded = tuple(_recorded(found, trace)) if trace is not None else ()
    if trace is None:
        events = tuple(found.generated(messages, seed))
        times = [event.at for event in events]
    else:
        events = tuple(event for event, _ in recorded if event.topic in found.inputs)
        times = [event.at for event, _ in recorded]
        if not events:
            topics = ", ".join(sorted(found.inputs))
            raise unusable(f"{trace} has no message on a topic that {node} subscribes to: {topics}")
    run = found.run(events, *((times[0], times[-1]) if times else (0, 0)))
    if output is not None:
        write_out(output, "".join(f"{line}\n" for line in _lines(found, run.beside(events))))
    raised = run.raised
    different: tuple[str, ...] = ()
    stamped: dict[str, int] = {}
    if replay and not raised:
        silent = not run.said and not any(event.topic in run.spoken for event, _ in recorded)
        nothing = "nothing was published, and nothing is recorded: there is nothing to compare"
        judged = tuple(compared(recorded, run))
        stamped = {each.topic: each.stamped for each in judged if each.stamped}
        different = (nothing,) if silent else tuple(_different(found, judged))
    if as_json:
        told = {
            "node": node,
            "heard": len(events),
            "published": len(run.said),
            "raised": raised,
            "different": different,
            "stamped": stamped,
        }
        click.echo(document(told))
    else:
        stamps = [f"{topic}: {n} differ only in header.stamp, the clock's time" for topic, n in stamped.items()]
        same = ("the recording has the same",) if replay and not raised and not different else ()
        begins = f", begins {run.state}" if run.state else ""
        click.echo(f"{node}: {len(events)} messages heard, {len(run.said)} published{begins}")
        for text in (*raised, *different, *stamps, *same):
            click.echo(text)
    return 1 if raised or different else 0


def _recorded(found: Driver, trace: Path) -> Iterator[tuple[Event, Any]]:
    """The trace's messages on the class's topics, in the order of the trace. Raises Rejected."""

    before = 0
    for recorded in read_trace(trace, wanted=lambda topic: _whole(topic) in found.carried):
        topic = _whole(str(recorded.event["topic"]))
        if topic not in found.carried or GONE in recorded.event:
            continue
        at = round(Fraction(exact(recorded.event["time"])) * SECOND)
        where = f"{trace}:{recorded.line}" if recorded.line else f"{trace}, message {recorded.index}"
        if at < before:
            raise unusable(f"{where}: its time lies before that of the message above")
        before = at
        yield Event(topic, at, found.coded(topic, recorded.event, where)), recorded.event


def _whole(topic: str) -> str:
    return topic if topic.startswith("/") else f"/{topic}"


def _lines(found: Driver, events: Iterable[Event]) -> Iterator[str]:
    """Events as lines of a trace."""

    for event in events:
        whole, part = divmod(event.at, SECOND)
        rest = json.dumps(found.fields(event))[1:-1]
        yield f'{{"topic": {json.dumps(event.topic)}, "time": {whole}.{part:09d}{", " if rest else ""}{rest}}}'


def _different(found: Driver, topics: Iterable[Compared]) -> Iterator[str]:
    """For each topic, the publications that differ from the recording, the first of them in full."""

    for each in topics:
        topic, wrong = each.topic, each.different
        for number, event, raw in wrong[:DIFFERENCES]:
            there = json.dumps(
                fields_of(raw), default=lambda part: part.decode() if isinstance(part, bytes) else str(part)
            )
            yield f"{topic}: publication {number} is {next(_lines(found, (event,)))}, and was recorded as {there}"
        if len(wrong) > DIFFERENCES:
            yield f"{topic}: {len(wrong)} publications differ, of {each.said}; the last is {wrong[-1][0]}"
        if each.said != each.recorded:
            yield f"{topic}: {each.said} published, {each.recorded} recorded"

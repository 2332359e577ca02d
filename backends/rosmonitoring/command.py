"""``avow monitor``: judge a recorded trace against assumptions and guarantees, or serve as ROSMonitoring's oracle."""

from __future__ import annotations

import io
import math
import os
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import click

from avow.backend_kit.further import of_plan
from avow.backend_kit.timeline import picture
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.plain import listed
from avow.base.workspace import named_folder, system_folder
from avow.evaluation.truth import TOLERANCE
from avow.ros.bags import digest_trace
from avow.system.load import PLAN_FILE, load_system
from avow.system.plan import System

from .configuration import of_system
from .engine import Monitor
from .further import Recording
from .judged import Recorder, ReportingMonitor
from .lanes import Marks, signals, timeline
from .observing import data_of, method_of, outside
from .options import origin
from .session import Session, session, violation_json
from .tuning import VIOLATIONS_SHOWN
from .watched import Violation, coverage, silent_topic


@click.command()
@click.argument("system")
@click.argument("trace", required=False)
@click.option("--node", "nodes", multiple=True, metavar="NAME", help="Only this node (may be repeated).")
@click.option("--json", "as_json", is_flag=True, help="For machines: one JSON object.")
@click.option(
    "--all",
    "show_all",
    is_flag=True,
    help=f"Show every violation, not only the first {VIOLATIONS_SHOWN} of each clause.",
)
@click.option(
    "--live",
    metavar="GRAPH",
    help="Judge a running graph: ros1[:http://host:11311], ros2[:DOMAIN] (over DDS).",
)
@click.option(
    "--for", "seconds", type=click.FloatRange(min=0), help="With --live: for so many seconds (else until Ctrl-C)."
)
@click.option("--host", default="127.0.0.1", help="With --live: where the graph's nodes find this one (127.0.0.1).")
@click.option(
    "--enforce", is_flag=True, help="With --live: what is filtered is passed on only while nothing is broken."
)
@click.option("--record", type=click.Path(path_type=Path), help="With --live: write all that is heard, as a trace.")
@click.option(
    "--verdicts", metavar="TOPIC", help="With --live: publish verdicts there, as diagnostic_msgs/DiagnosticArray."
)
@click.option(
    "--timeline", type=click.Path(path_type=Path), help="Draw signals and violations there, as SVG (live: of --record)."
)
@click.option(
    "--mcap", type=click.Path(path_type=Path), help="Write verdicts and margins there, for Foxglove and PlotJuggler."
)
@click.option(
    "--configuration", type=click.Path(path_type=Path), help="Write ROSMonitoring's configuration of all nodes there."
)
@click.option("--serve", "port", type=click.IntRange(0, 65535), help="Answer ROSMonitoring's monitors on this port.")
def command(
    system: str, trace: str | None, nodes: tuple[str, ...], as_json: bool, show_all: bool, live: str | None,
    seconds: float | None, host: str, enforce: bool, record: Path | None, verdicts: str | None, timeline: Path | None,
    mcap: Path | None, configuration: Path | None, port: int | None,
) -> int:  # fmt: skip
    """Judge TRACE against the contracts of SYSTEM (a folder, or a name under contracts/).

    TRACE is JSON lines in ROSMonitoring's format, a ROS 1 or ROS 2 bag, or - for standard input; --live judges a
    running graph. Code 1 if something was broken or nothing could be judged, 2 if an input cannot be used.
    """

    swapped = named_folder(Path(trace)) if trace is not None and not Path(trace).is_file() else None
    if swapped is not None and (swapped / PLAN_FILE).is_file():
        raise click.UsageError(f"{trace} is a system, and no TRACE: SYSTEM comes first")
    loaded = load_system(system_folder(system))
    output = _Output(as_json, show_all, timeline, mcap)
    files = [path.resolve() for path in (record, timeline, mcap, configuration) if path is not None]
    files += [Path(trace).resolve()] if trace is not None and trace != "-" else []
    if len(set(files)) < len(files):
        raise click.UsageError("two of the files are one: what it holds would be lost")
    if configuration is not None:
        _configure(loaded, nodes, configuration)
        return 0
    suffix = "" if record is None else record.suffix
    for wrong, text in (
        (
            live is None and any((enforce, seconds, record, verdicts)),
            "--enforce, --for, --record, --verdicts need --live",
        ),
        (sum(given is not None for given in (trace, live, port)) != 1, "give one: TRACE, --live GRAPH, --serve PORT"),
        (live and timeline and not record, "with --live, --timeline needs --record: it is drawn from the record"),
        (suffix in (".mcap", ".bag", ".db3"), f"--record writes JSON lines, not {suffix}; --mcap writes verdicts"),
        (timeline and not live and trace in (None, "-"), "--timeline needs a TRACE that can be read twice: a file"),
        (mcap and port is not None, "--mcap needs a TRACE or --live"),
    ):
        if wrong:
            raise click.UsageError(text)
    if live is not None:
        return _live(loaded, nodes, live, (seconds, host, enforce, record, verdicts), output)
    if port is not None:
        _serve(loaded, nodes, port)
        return 0
    return _judge(loaded, nodes, str(trace), output)


@dataclass(frozen=True, slots=True)
class _Output:
    """How the verdicts are reported."""

    as_json: bool
    show_all: bool
    timeline: Path | None
    mcap: Path | None

    @property
    def monitor(self) -> type[Monitor]:
        """The class of the monitors."""

        return Monitor if self.mcap is None else ReportingMonitor


def _configure(system: System, nodes: tuple[str, ...], path: Path) -> None:
    """Write ROSMonitoring's configuration. Raises Rejected."""

    setups = [monitor.setup for monitor in session(system, nodes).monitors]
    _write(path, of_system([(setup, data_of(method_of(system, setup.node.name))) for setup in setups]))
    click.echo(f"wrote {path}")


def _live(
    system: System, nodes: tuple[str, ...], live: str,
    how: tuple[float | None, str, bool, Path | None, str | None], output: _Output,
) -> int:  # fmt: skip
    from .live.follow import follow, graph_of

    seconds, host, enforce, record, verdicts = how
    running = session(system, nodes, make=output.monitor)
    graph = graph_of(live, running, host, enforce=enforce, warn=_warn)
    with _until(seconds) as over:
        found = ((0, violation) for violation in follow(running, graph, over, record, verdicts, _warn))
        again = (lambda: _beyond(system, nodes, record)) if record is not None else dict[str, str]
        return _report(running, found, str(record or ""), output, again)


@contextmanager
def _until(seconds: float | None) -> Iterator[Callable[[], bool]]:
    """Whether `seconds` have passed, or Ctrl-C was pressed; a second Ctrl-C interrupts at once."""

    interrupted = threading.Event()
    end = None if seconds is None else time.monotonic() + seconds

    def interrupt(*_: object) -> None:
        interrupted.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield lambda: interrupted.is_set() or (end is not None and time.monotonic() >= end)
    finally:
        signal.signal(signal.SIGINT, before)


def _warn(text: str) -> None:
    click.echo(text, err=True)


def _judge(system: System, nodes: tuple[str, ...], trace: str, output: _Output) -> int:

    path = Path(trace)
    if trace != "-" and not path.exists() and (inside := system.plan.root / path).exists():
        raise Rejected(Diagnostic("MON201", f"there is no {path}", hint=f"did you mean `{os.path.relpath(inside)}`?"))
    if path.name == "metadata.yaml":
        raise Rejected(Diagnostic("MON201", f"{path} is a part of a bag", hint=f"name the bag: `{path.parent}`"))
    running = session(system, nodes, None if trace == "-" else path, output.monitor)
    # each with the line of its event; the last line if it was found at the end of the run
    if trace != "-":
        return _report(running, running.run(path), trace, output, lambda: _beyond(system, nodes, path))
    with tempfile.NamedTemporaryFile(suffix=".jsonl") as copy:  # which is read again

        def read(size: int) -> bytes:
            data = cast(io.BufferedReader, sys.stdin.buffer).read1(size)
            copy.write(data)
            copy.flush()
            return data

        return _report(
            running, running.read(read), trace, output, lambda: _beyond(system, nodes, Path(copy.name), trace)
        )


def _beyond(system: System, nodes: tuple[str, ...], path: Path, trace: str = "") -> dict[str, str]:
    """What the plan assumes of the environment, and its requirements about one node, as far as a trace breaks them:
    claim → the breach, or why it is unknown whether it is one. As ``avow verify`` judges them."""
    further = [each for each in of_plan(system) if not nodes or each.node in nodes]
    if not further:
        return {}
    root, place = system.plan.root.resolve(), path.resolve()
    name = trace or (place.relative_to(root).as_posix() if place.is_relative_to(root) else str(path))
    options = {each.node: method_of(system, each.node) for each in further}
    given = {node: outside(own, name) for node, own in options.items()}
    recording = Recording(system, further, name, path, math.inf, options, given)
    claims = {each.claim: f"{each.node}.{each.clause.name}" for each in further}
    found = {each.obligation: each.summary for each in recording.refuted() if each.obligation in claims}
    doubts = {claim: recording.doubts[clause] for claim, clause in claims.items() if clause in recording.doubts}
    return {claim: f"unknown: {why}" for claim, why in doubts.items()} | found


def _report(
    running: Session, violations: Iterator[tuple[int, Violation]], trace: str, output: _Output,
    beyond: Callable[[], Mapping[str, str]] = dict,
) -> int:  # fmt: skip
    """Show the violations, and the results of each clause. Returns the exit code."""

    shown: list[dict[str, Any]] = []
    counts = Counter[tuple[str, str, str]]()
    marks = Marks()
    with ExitStack() as stack:
        recorder = None if output.mcap is None else stack.enter_context(_recorder(running, output.mcap))
        for line, violation in violations:
            about = violation.node, violation.clause, violation.fault.value
            counts[about] += 1
            marks.note(violation)
            if recorder is not None:
                recorder.found(violation)
            if not output.show_all and counts[about] > VIOLATIONS_SHOWN:
                continue
            if output.as_json:
                shown.append({**violation_json(violation), "line": line})
            else:
                text = violation.text()  # the remedy once for a clause
                click.echo(text if counts[about] == 1 else text.replace(TOLERANCE, ""))
    further = dict(beyond())
    if output.timeline is not None:
        _draw(running, Path(trace), marks, output.timeline)
    if output.as_json:
        digest = "" if trace in ("-", "") else digest_trace(Path(trace))
        told = {"trace": trace, "sha256": digest, "violations": shown, "contradicted": further}
        click.echo(document({**running.summary(), **told}))
    else:
        for (node, clause, fault), count in () if output.show_all else counts.items():
            if count > VIOLATIONS_SHOWN:
                click.echo(f"… and {count - VIOLATIONS_SHOWN} more of {node}.{clause}: {fault} (--all shows them)")
        for claim, why in further.items():
            click.echo(f"{claim}: {why}")
        _print_summary(running, len(further))
    return 0 if running.clean and not further and _anything_judged(running) and not running.unmonitored() else 1


def _recorder(running: Session, path: Path) -> Recorder:
    """An MCAP that records each judgement. Raises Rejected."""

    recorder = Recorder(path)
    for monitor in running.monitors:
        if isinstance(monitor, ReportingMonitor):
            monitor.report = recorder.judged
    return recorder


def _draw(running: Session, trace: Path, marks: Marks, path: Path) -> None:
    """The timeline of all guarantees that were judged. Raises Rejected."""

    setups = [monitor.setup for monitor in running.monitors]
    heard = signals(setups, trace, origin(running.system), running.events, marks, running.listens)
    clauses = [(setup, clause) for setup in setups for clause in setup.node.guarantees]
    drawn = timeline(trace.name, running.events, heard, marks, clauses, lambda node, name: f"{node}.{name}")
    _write(path, f"{picture(drawn, alone=True)}\n")


def _write(path: Path, text: str) -> None:
    """Write a file. Raises Rejected."""

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise Rejected(Diagnostic("MON304", f"{path} cannot be written: {error.strerror}")) from None


def _anything_judged(running: Session) -> bool:
    return any(tally.judged for *_, tally in running.clauses())


def _print_summary(running: Session, further: int) -> None:
    silent = (topic for monitor in running.monitors for topic in monitor.silent.values() if running.unheard)
    for topic in dict.fromkeys(silent):
        click.echo(f"  {silent_topic(topic, running.unheard)}")
    for monitor, name, kind, tally in running.clauses():
        words = [coverage(tally) if tally.published else f"judged {tally.judged} times"]
        if tally.judged and not tally.triggered and not tally.broken:
            words.append("a condition of it was never met")
        if tally.reason:
            words.append(tally.reason)
        if monitor.backwards:
            words.append(f"no evidence: {monitor.backwards}")
        click.echo(f"  {monitor.setup.node.name}.{name} ({kind}): {'; '.join(words)}")
    passages = {topic: passage for monitor in running.monitors for topic, passage in monitor.timing.passages.items()}
    if gone := [f"{topic} lost {p.lost}" for topic, p in passages.items() if p.lost]:
        click.echo(f"messages lost, by their numbers: {', '.join(gone)}")
    if mixed := [f"{topic} {p.disordered}" for topic, p in passages.items() if p.disordered]:
        click.echo(f"messages out of order: {', '.join(mixed)}")
    if running.withheld:
        click.echo(f"withheld: {', '.join(f'{topic} {count}' for topic, count in running.withheld.items())}")
    if unmonitored := running.unmonitored():
        click.echo(f"unmonitored: {', '.join(unmonitored)}")
        for remedy in dict.fromkeys(filter(None, unmonitored.values())):
            click.echo(f"  {', '.join(name for name, its in unmonitored.items() if its == remedy)}: {remedy}")
    if running.unheard:
        told = listed([f"{topic} ({count})" for topic, count in running.unheard.items()], 10)
        click.echo(f"topics of the trace that no clause uses, and their events: {told}")
        click.echo(f"topics listened to: {', '.join(running.topics) or 'none'}")
    summary = [f"{count} × {fault}" for fault, count in running.counts.items()]
    summary += [f"{further} × claim of the plan not met, or unknown"] if further else []
    if not any(True for _ in running.clauses()):
        summary.append("nothing was judged: write what a node promises in place of `to_write`")
    elif not _anything_judged(running):
        quiet = "no event came; of a running robot: is it up, in the domain and network that are listened to?"
        why = "no clause ever had a value for all that it speaks of" if running.events else quiet
        summary.append(f"nothing was judged: {why}")
    fine = "nothing broken in what was decided" if unmonitored else "nothing broken"
    click.echo(f"{running.events} events: {', '.join(summary) or fine}")


def _serve(system: System, nodes: tuple[str, ...], port: int) -> None:
    from .live.serve import HOST, serve

    session(system, nodes)  # an error in the plan is reported now, not at the first connection

    def ready(server: Any) -> None:
        click.echo(f"the oracle of {system.name} listens on ws://{HOST}:{server.socket.getsockname()[1]}")

    serve(lambda: session(system, nodes), port, ready)

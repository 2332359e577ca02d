"""Runs that a simulator made: performed, recorded, judged by the node's monitors, and read again as evidence.

The drawn runs are trials. Runs that failed once are kept in a second table: each has to pass after a repair, but none
counts for a rate, since it was chosen.
"""

from __future__ import annotations

import csv
import io
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path

from avow.backend_kit.programs.judging import Formula, triggers
from avow.backend_kit.protocol import Backend, Job, JudgedRun
from avow.backend_kit.registry import judge_of_runs
from avow.base import process
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write
from avow.base.plain import listed
from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.base.workspace import find_workspace
from avow.isolation.tracing import Trace, traces
from avow.language.terms import TRUE
from avow.ros.bags import digest_trace

from . import options
from .judging import Claim, Judged
from .profile import Campaign, Run, command_files
from .table import Table, read_table

OK = "ok"
"""The entry under `ended` of a run that wrote its recording."""


class NotMade(Exception):  # noqa: N818 - it names a state
    """There are no runs of this campaign to be judged. Arguments: a verdict, and the reason."""


@dataclass(frozen=True, slots=True)
class Row:
    """A run that was made. `ended` is OK, or how the command failed; `sha256` is of the recording."""

    run: Run
    ended: str
    made_by: str
    sha256: str = ""

    @property
    def cells(self) -> dict[str, str]:
        """What defines the run."""
        return {"seed": str(self.run.seed), **self.run.cells}


@dataclass(frozen=True, slots=True)
class Made:
    row: Row
    verdicts: Mapping[str, Judged]
    """Guarantee → what the monitors say."""
    distances: Mapping[str, float]
    """Guarantee → its least distance from a breach, if it has one."""
    conditions: Mapping[str, int] = field(default_factory=dict)
    """Guarantee → the number of its conditions."""
    unseen: tuple[str, ...] = ()
    """Assumptions that could not be judged."""


Judge = Callable[[Row], Made]


def monitored(job: Job, campaign: Campaign) -> tuple[Backend, Job]:
    """What judges the recordings, and the job for it. Raises Rejected if the node has no monitors."""
    tool = judge_of_runs()
    methods = job.system.plan.node(job.node.name).methods
    method = next((m for m in methods if tool is not None and m.backend == tool.name), None)
    if tool is None or method is None:
        message = f"{job.node.name} has no monitors to judge the runs of its campaign"
        hint = f"add `{tool.name if tool is not None else 'rosmonitoring'}` with a `mapping` to its methods"
        raise Rejected(Diagnostic("EXP101", message, job.method.options.at("campaign"), hint=hint))
    return tool, replace(job, method=method, claims=())


def monitors(job: Job, campaign: Campaign) -> Judge:
    """Judges a run by its recording. Raises Rejected if the node has no monitors."""
    tool, asked = monitored(job, campaign)
    judge = tool.judge(asked)

    def judged(row: Row) -> Made:
        if row.ended != OK:
            return Made(row, {o.name: Judged(asked=True, broken=0, lost=row.ended) for o in job.obligations}, {})
        run = judge(campaign.recording(row.run.name))
        found = {name: each.distance for name, each in run.clauses.items() if each.distance is not None}
        count = {name: len(each.met) for name, each in run.clauses.items()}
        return Made(row, {name: _judged(name, run) for name in run.clauses}, found, count, run.unseen)

    return judged


def _judged(name: str, run: JudgedRun) -> Judged:
    one = run.clauses[name]
    met = frozenset(n for n, met in enumerate(one.met) if met)
    if one.broken:
        shown = one.shown.values if one.shown is not None else ()
        return Judged(met, True, broken=0, shown=shown, why=one.reason)
    if run.assumption is not None:
        return Judged(met, excused=True, why=run.assumption[1])
    return Judged(met, one.held > 0, open=one.open, undecided=one.reason if one.undecided else "")


def perform(job: Job, campaign: Campaign, run: Run, seconds: float) -> tuple[Row, str]:
    """Make one run, with its recording in place, and the last line of a failing command. Raises process.ToolMissing."""
    place = campaign.recording(run.name)
    place.parent.mkdir(parents=True, exist_ok=True)
    remove(place)
    with tempfile.TemporaryDirectory(prefix="avow-campaign-") as made:
        trace = Path(made) / campaign.trace
        words, watching = campaign.words(run, str(trace)), Trace() if traces() else None
        program = str(job.root / words[0]) if os.sep in words[0] else shutil.which(words[0])
        if watching is None or program is None:
            done = process.run(words, cwd=job.root, seconds=seconds)
        else:
            done = process.run(watching.around([program, *words[1:]]), cwd=job.root, seconds=seconds)
            _all_named(job, watching.read_all(program, job.root) or ())
        told = (done.stderr.strip() or done.stdout.strip()).rpartition("\n")[2]
        if done.code != 0:
            how = f"timed out after {seconds:g} s" if done.timed_out else f"exit code {done.code}"
            return Row(run, how, campaign.made_by), told
        if not trace.exists():
            return Row(run, "no recording", campaign.made_by), told
        shutil.move(trace, place)
    return Row(run, OK, campaign.made_by, digest_trace(place)), ""


def _all_named(job: Job, events: Iterable[tuple[str, str]]) -> None:
    """Raises Rejected if the simulator read a file of the workspace whose change would make no run stale."""
    own, place = job.root.resolve(), find_workspace(job.root.resolve())
    root = place.root.resolve() if place else own
    read = {Path(os.path.realpath(path)) for event, path in events if event == "read"} - set(command_files(job))
    unnamed = [
        p for p in sorted(read) if root in p.parents and p.is_file() and not (own not in p.parents and _tool(p, root))
    ]
    if left := [os.path.relpath(p, own) for p in unnamed if "__pycache__" not in p.parts]:
        message = f"the simulator reads {listed(left)}, which the plan does not name"
        hint = f"add `files: [{', '.join(left)}]`, so that the runs no longer count when it changes"
        if outside := [name for name in left if name.startswith("..")]:
            hint = f"copy {listed(outside)} into the system's folder, and name its files under `files`"
        raise Rejected(Diagnostic("EXP107", message, job.method.options.at("campaign"), hint=hint))


def _tool(path: Path, root: Path) -> bool:
    """Whether a file below `root` belongs to a Python environment, or lies in a hidden folder."""
    above = (path, *(folder for folder in path.parents if root in folder.parents))
    return any(place.name.startswith(".") or (place / "pyvenv.cfg").is_file() for place in above)


def remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def copied(campaign: Campaign, row: Row, name: str) -> Row:
    """The run under another name, with a copy of its recording."""
    place, recording = campaign.recording(name), campaign.recording(row.run.name)
    remove(place)
    if row.ended == OK:
        shutil.copytree(recording, place) if recording.is_dir() else shutil.copyfile(recording, place)
    return replace(row, run=replace(row.run, name=name))


# -- tables ------------------------------------------------------------------------------------------------------------


def write_rows(path: Path, campaign: Campaign, rows: Iterable[Row]) -> None:
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(campaign.columns)
    for row in rows:
        lines.writerow((row.run.name, row.run.seed, *row.run.cells.values(), row.ended, row.made_by, row.sha256))
    write(path, text.getvalue())


def _rows(table: Table, campaign: Campaign) -> tuple[Row, ...]:
    if table.columns != campaign.columns:
        hint = "`avow campaign` writes the table; in one of regressions, add or remove the parameters' columns"
        raise Rejected(table.fault(1, "EXP112", f"the columns must be {', '.join(campaign.columns)}", hint))
    found = []
    for row in table.rows:
        cells = {p.name: row.cells[p.name] for p in campaign.parameters}
        if not row.cells["seed"].isdecimal() or not row.cells["run"].isalnum():
            raise Rejected(table.fault(row.line, "EXP113", "'run' is a word, and 'seed' a number"))
        run = Run(row.cells["run"], int(row.cells["seed"]), cells)
        found.append(Row(run, row.cells["ended"], row.cells["made_by"], row.cells["sha256"]))
    return tuple(found)


def regressions(campaign: Campaign) -> tuple[Row, ...]:
    """The runs that failed once. Raises Rejected."""
    return _rows(read_table(campaign.regressions), campaign) if campaign.regressions.is_file() else ()


def drawn(campaign: Campaign) -> tuple[Row, ...]:
    """The drawn runs of the table. Raises NotMade, and Rejected if a row is no drawn run of this campaign."""
    if not campaign.table.is_file():
        raise NotMade(Verdict.NOT_RUN, "no run was made")
    table = read_table(campaign.table)
    if any(row.cells.get("made_by", campaign.made_by) != campaign.made_by for row in table.rows):
        why = "the command, its files, the scenario or the seed have changed since the runs were made"
        raise NotMade(Verdict.UNKNOWN, why)
    rows = _rows(table, campaign)
    for at, (row, line) in enumerate(zip(rows, table.rows, strict=True), start=1):
        if row.run != campaign.drawn(at):
            message = f"run '{row.run.name}' is not the run {at} that seed and scenario draw: it is no random trial"
            raise Rejected(table.fault(line.line, "EXP113", message, "start `avow campaign`: it writes this table"))
    return rows


def intact(campaign: Campaign, row: Row) -> bool:
    """Whether the recording is the one that the row names."""
    try:
        return row.ended != OK or digest_trace(campaign.recording(row.run.name)) == row.sha256
    except OSError:
        return False


# -- the evidence ------------------------------------------------------------------------------------------------------


def recorded(job: Job, campaign: Campaign) -> options.Experiment:
    """The runs of both tables as an experiment. Raises NotMade, and Rejected."""
    rows, again = drawn(campaign), regressions(campaign)
    if "at_least" in job.options and len(rows) != campaign.runs:
        raise NotMade(Verdict.UNKNOWN, f"a claimed rate needs all: {len(rows)} of {campaign.runs} runs were made")
    for row in (*rows, *again):
        if row.made_by != campaign.made_by:
            raise NotMade(Verdict.UNKNOWN, f"regression {row.run.name} was not replayed yet")
        if not intact(campaign, row):
            name = campaign.recording(row.run.name).relative_to(job.root.resolve()).as_posix()
            raise NotMade(Verdict.NOT_RUN, f"the recording {name} (SHA-256 {row.sha256}) is not here")
    judge = monitors(job, campaign)
    return experiment(job, [judge(row) for row in rows], [judge(row) for row in again])


def rows_of(campaign: Campaign) -> tuple[Row, ...]:
    """The runs of both tables. Raises NotMade, and Rejected."""
    return (*drawn(campaign), *regressions(campaign))


def experiment(job: Job, made: Sequence[Made], again: Sequence[Made]) -> options.Experiment:
    """Raises Rejected."""
    strata = job.options.get("strata", "")

    def runs(of: Sequence[Made]) -> tuple[options.Run, ...]:
        return tuple(
            options.Run(one.row.run.name, one.row.cells.get(strata, ""), (one.row.cells,), ({},), one.verdicts)
            for one in of
        )

    claims = {o.name: _claim(job, o.name, made) for o in job.obligations}
    recordings = [one.row.sha256 for one in made if one.row.ended == OK]
    alike = len(recordings) - len(set(recordings))
    return replace(options.limits(job, runs(made), claims, runs(again)), alike=alike)


def _claim(job: Job, name: str, made: Sequence[Made]) -> Claim:
    clause = job.node.clause(name)
    known, count = triggers(clause), max((one.conditions.get(name, 0) for one in made), default=0)
    names = [known[n].name if len(known) == count else f"condition {n + 1}" for n in range(count)]
    unseen = tuple(sorted({name for one in made for name in one.unseen}))
    conditions = tuple(Formula(text, TRUE, None) for text in names)
    own = Formula.of(clause)
    return Claim(own, conditions, None, (), unseen, (), frozenset(), False, (), None, (), clause.chance)

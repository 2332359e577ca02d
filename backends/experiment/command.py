"""``avow campaign``: make, judge and record the runs of a simulator, or search for a failing one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import takewhile
from typing import Any

import click

from avow.backend_kit.given import file_path, misshapen
from avow.backend_kit.protocol import Job, Limits
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.plain import count
from avow.base.process import ToolMissing
from avow.base.suggestions import suggest
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import find_workspace, system_folder
from avow.evidence.ledger import ledger_of
from avow.evidence.obligation import Kind, Obligation
from avow.evidence.record import CASE
from avow.system.load import load_system
from avow.system.plan import System

from .campaign import (
    Judge,
    Made,
    NotMade,
    copied,
    drawn,
    experiment,
    intact,
    monitors,
    perform,
    regressions,
    remove,
    write_rows,
)
from .options import SCHEMA
from .profile import Campaign, Run, read_campaign
from .searching import Cells, Searched, Tried, search
from .tuning import SEARCH_RUNS
from .verdict import settle


@click.command()
@click.argument("system")
@click.argument("node", required=False)
@click.option("--runs", type=click.IntRange(1, 100_000), help="At most so many new runs now.")
@click.option("--search", "searching", is_flag=True, help="Search for a failing scenario, in place of drawn runs.")
@click.option("--json", "as_json", is_flag=True, help="For machines.")
def command(system: str, node: str | None, runs: int | None, searching: bool, as_json: bool) -> int:
    """Make the runs of the campaigns in the plan of SYSTEM (a folder, or a name under contracts/), or of one NODE.

    First each regression (a run that failed once) is replayed. Then scenarios are drawn from the plan's profile, until
    the runs show what the criticality demands or one fails; --search chooses scenarios by their distance to a breach,
    and simplifies what fails. The tables beside `data` hold the runs, for `avow verify`. Chosen runs count for no rate.

    Code 1 if a run failed or ended without a recording, or too few runs were made; 3 if the program is missing.
    """
    loaded = load_system(system_folder(system))
    works = [_Work(job, campaign, monitors(job, campaign), as_json) for job, campaign in _jobs(loaded, node)]
    try:
        for work in works:
            experiment(work.job, (), ())  # wrong options, before any run
            work.replay()
            work.search(runs or SEARCH_RUNS) if searching else work.draw(runs or work.campaign.runs)
    except ToolMissing as missing:
        click.echo(f"error: the campaign's command does not start: {missing}", err=True)
        return 3
    if as_json:
        click.echo(document({"campaigns": [work.summary() for work in works]}))
    else:
        click.echo("\n\n".join("\n".join(work.text()) for work in works))
    return 0 if all(work.good for work in works) else 1


@dataclass(slots=True)
class _Work:
    """One campaign, and the runs that were made of it."""

    job: Job
    campaign: Campaign
    judge: Judge
    silent: bool
    again: list[Made] = field(default_factory=list)
    """The regressions."""
    made: list[Made] = field(default_factory=list)
    """The drawn runs."""
    chosen: dict[str, Made] = field(default_factory=dict)
    """The failing runs of a search, by their names."""
    searched: Searched | None = None
    excused: int = 0
    """The runs of the search that broke an assumption."""

    def perform(self, run: Run) -> Made:
        row, told = perform(
            self.job, self.campaign, run, float(self.job.method.options.data.get("seconds", Limits().seconds))
        )
        made = self.judge(row)
        if not self.silent:
            click.echo(" ".join(filter(None, (_line(made), f"({told})" if told else ""))))
        return made

    def replay(self) -> None:
        """The regressions, by recordings of this campaign."""
        for row in regressions(self.campaign):
            current = row.made_by == self.campaign.made_by and intact(self.campaign, row)
            self.again.append(self.judge(row) if current else self.perform(row.run))
        self.write_regressions()

    def write_regressions(self) -> None:
        if self.again:
            write_rows(self.campaign.regressions, self.campaign, [made.row for made in self.again])

    def keep(self, made: Made) -> None:
        """A failing run becomes a regression."""
        if all(made.row.cells != other.row.cells for other in self.again):
            numbers = [int(other.row.run.name[1:]) for other in self.again if other.row.run.name[1:].isdecimal()]
            row = copied(self.campaign, made.row, f"r{max(numbers, default=0) + 1}")
            self.again.append(replace(made, row=row))
            self.write_regressions()

    def draw(self, most: int) -> None:
        """Drawn runs until no further one is needed: after a failure, or once all that is asked is shown without any.
        A claimed rate gets all runs of the plan, since a number that depends on failures would make its bound false."""
        try:
            rows = list(takewhile(lambda row: intact(self.campaign, row), drawn(self.campaign)))
        except (NotMade, Rejected):  # the table is written anew
            rows = []
        self.made = [self.judge(row) for row in rows]
        left = min(most, self.campaign.runs - len(self.made))
        while left > 0 and not self.enough():
            self.made.append(self.perform(self.campaign.drawn(len(self.made) + 1)))
            write_rows(self.campaign.table, self.campaign, [made.row for made in self.made])
            left -= 1
        for made in self.made:
            if _failed(made):
                self.keep(made)

    def enough(self) -> bool:
        if not self.made or "at_least" in self.job.options:
            return False
        return any(map(_failed, (*self.made, *self.again))) or all(
            _shown(outcome) for outcome in self.outcomes().values()
        )

    def outcomes(self, kept: Callable[[Obligation], Iterable[Any]] = lambda _: ()) -> dict[str, Outcome]:
        whole = experiment(self.job, self.made, self.again)
        return {o.name: settle(o.name, whole, kept(o))[0] for o in self.job.obligations} if self.made else {}

    def shown(self) -> dict[str, Outcome]:
        """As `avow verify` finds them: it does not forget a failing run whose row was removed."""
        place = find_workspace(self.job.root)
        ledger = ledger_of(place.ledger(self.job.system.name)) if place is not None else None
        entries = ledger.refutations if ledger is not None else lambda *_: ()
        return self.outcomes(lambda o: [e.evidence.details[CASE] for e in entries(o.id, o.digest, "experiment")])

    def search(self, runs: int) -> None:
        self.searched = search(self.campaign.parameters, self.attempt, runs, self.campaign.seed)
        for made in self.chosen.values():
            if made.row.run.cells == self.searched.failing:
                self.keep(made)
        for name in ("search", *self.chosen):
            remove(self.campaign.recording(name))

    def attempt(self, cells: Cells) -> Tried:
        made = self.perform(Run("search", self.campaign.seed, cells))
        if any(one.excused for one in made.verdicts.values()):
            self.excused += 1
            return Tried({}, False)
        if _failed(made):
            name = f"s{len(self.chosen) + 1}"
            self.chosen[name] = replace(made, row=copied(self.campaign, made.row, name))
        return Tried(made.distances, _failed(made))

    @property
    def good(self) -> bool:
        if any(map(_failed, self.again)):
            return False
        if self.searched is not None:
            return self.searched.failing is None and self.excused < self.searched.runs
        whole = "at_least" not in self.job.options or len(self.made) == self.campaign.runs
        return whole and bool(self.made) and all(map(_shown, self.shown().values()))

    def text(self) -> Iterator[str]:
        node = self.job.node.name
        for name, outcome in self.shown().items():
            word = "vacuous" if outcome.vacuous else outcome.verdict.value
            yield f"{node}.{name}: {word}: {outcome.summary}"
        if self.made and (worst := min(self.made, key=_distance)).distances:
            yield f"nearest to a breach: {_line(worst)}"
        if self.searched is not None:
            yield self.found(self.searched)
        if self.again:
            yield f"{node}: {count(len(self.again), 'regression')} in {self.campaign.regressions}:"
            yield from map(_line, self.again)

    def found(self, searched: Searched) -> str:
        node = self.job.node.name
        if searched.failing is None:
            excused = f" ({self.excused} broke an assumption)" if self.excused else ""
            return f"{node}: no failing scenario in {count(searched.runs, 'run')} of a search{excused}, for no rate"
        return f"{node}: run {searched.runs} of the search failed; simplified in {searched.shrinking} more, and kept"

    def summary(self) -> dict[str, Any]:
        searched = self.searched
        return {
            "node": self.job.node.name,
            "runs": [_data(made) for made in self.made],
            "regressions": [_data(made) for made in self.again],
            "verdicts": {name: [one.verdict.value, one.summary] for name, one in self.shown().items()},
            "searched": None if searched is None else {"runs": searched.runs, "failing": searched.failing},
        }


def _shown(outcome: Outcome) -> bool:
    return outcome.verdict is Verdict.TESTED and not outcome.vacuous


def _failed(made: Made) -> bool:
    """Also if it cannot be judged."""
    return any(one.broken is not None or (one.undecided and not one.excused) for one in made.verdicts.values())


def _distance(made: Made) -> float:
    return min(made.distances.values(), default=math.inf)


def _word(made: Made) -> str:
    broken = [name for name, one in made.verdicts.items() if one.broken is not None]
    if broken:
        return next((one.lost for one in made.verdicts.values() if one.lost), f"failed: {', '.join(broken)}")
    for word in ("excused", "undecided"):
        if why := next((one.undecided or one.why for one in made.verdicts.values() if getattr(one, word)), ""):
            return f"{'an assumption is broken' if word == 'excused' else word}: {why}"
    met = any(one.met or not made.conditions[name] for name, one in made.verdicts.items())
    return "held" if met else "not triggered"


def _line(made: Made) -> str:
    cells = " ".join(f"{name}={value}" for name, value in made.row.cells.items())
    distance = f", distance {_distance(made):.4g}" if made.distances else ""
    return f"  {made.row.run.name:>6}  {cells}  {_word(made)}{distance}"


def _data(made: Made) -> dict[str, Any]:
    return {"run": made.row.run.name, **made.row.cells, "verdict": _word(made), "distances": dict(made.distances)}


def _jobs(system: System, node: str | None) -> list[tuple[Job, Campaign]]:
    """Raises Rejected, with all faults."""
    known = {each.name: each for each in system.contract.nodes}
    if node is not None and node not in known:
        raise Rejected(Diagnostic("EXP104", f"{system.name} has no node '{node}'", hint=suggest(node, known)))
    found, faults = [], list[Diagnostic]()
    for plan in system.plan.nodes:
        for one in plan.methods:
            data = one.options.data
            given = one.backend == "experiment" and isinstance(data, Mapping) and "campaign" in data
            if node not in (None, plan.node) or not given:
                continue
            wrong = misshapen(SCHEMA, one.options, f"nodes.{plan.node}: {one.backend}")
            faults += wrong
            whole = known[plan.node]
            clauses = [whole.clause(name) for name in one.guarantees]
            asked = [
                Obligation(system.name, plan.node, Kind.GUARANTEE, c.name, "", "", "", (), c.span) for c in clauses
            ]
            job = Job(system, whole, one, tuple(asked))
            try:
                found += [] if wrong else [(job, read_campaign(job, file_path(job, "data")))]
            except Rejected as rejected:
                faults += rejected.diagnostics
    if faults:
        raise Rejected(*faults)
    if not found:
        message = f"the plan of {system.name} has no `experiment` with a `campaign`"
        raise Rejected(Diagnostic("EXP104", message, hint="docs/campaign.md has an example"))
    return found

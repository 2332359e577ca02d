"""The option `campaign`: the command that simulates one run, the profile of scenarios, and how a run is drawn from it.

Run n follows from the campaign's digest and n alone, so a reader of the table can tell a drawn run from a chosen one.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import digest_or_missing, inside, sha256
from avow.base.plain import decimal, exact
from avow.base.records import dataclass
from avow.base.suggestions import suggest

from .tuning import DRAWN_STEPS

COLUMNS = ("run", "seed", "ended", "made_by", "sha256")
"""The columns of a table of runs besides the parameters."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A column of the scenario: one of `values`, equally frequent, or a number from `low` to `high`. `usual`, as `at`
    takes it, is where shrinking leads."""

    name: str
    values: tuple[str, ...]
    low: Fraction = Fraction(0)
    high: Fraction = Fraction(0)
    usual: Fraction = Fraction(0)

    def at(self, share: Fraction) -> str:
        """The value below which this share (0 to 1) of the distribution lies."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        return _decimal(self.low + (self.high - self.low) * share)


@dataclass(frozen=True, slots=True)
class Run:
    """A run to be made; `cells`: parameter → value."""

    name: str
    seed: int
    cells: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Campaign:
    command: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    trace: str
    runs: int
    seed: int
    made_by: str
    """Digest of command, profile, seed and files: runs of another campaign do not count."""
    table: Path
    """The drawn runs."""

    @property
    def regressions(self) -> Path:
        return regressions_of(self.table)

    @property
    def columns(self) -> tuple[str, ...]:
        return ("run", "seed", *(p.name for p in self.parameters), *COLUMNS[2:])

    def recording(self, run: str) -> Path:
        return self.table.with_suffix("") / f"{run}{Path(self.trace).suffix}"

    def drawn(self, number: int) -> Run:
        """The run of that number, from 1. Only `random()` is used: it draws alike in every version of Python."""
        source = random.Random(f"{self.made_by}/{number}")
        cells = {p.name: p.at(Fraction(int(source.random() * DRAWN_STEPS), DRAWN_STEPS)) for p in self.parameters}
        return Run(str(number), int(source.random() * 2**31), cells)

    def words(self, run: Run, trace: str) -> tuple[str, ...]:
        """The command for a run."""
        known = {**run.cells, "seed": str(run.seed), "trace": trace}
        return tuple(_PLACE.sub(lambda found: known[found[1]], word) for word in self.command)


def regressions_of(table: Path) -> Path:
    """The table of runs that failed once."""
    return table.with_name(f"{table.stem}_regressions.csv")


_PLACE = re.compile(r"\{(\w+)\}")


def read_campaign(job: Job, table: Path | None) -> Campaign:
    """Raises Rejected with all faults of the option; its shape is right."""
    given, faults = job.options["campaign"], list[Diagnostic]()

    def wrong(message: str, *place: str, hint: str | None = None) -> None:
        faults.append(Diagnostic("EXP101", message, job.method.options.at("campaign", *place), hint=hint))

    for key in ("mapping", "interpret", "run_column", "steps"):
        if key in job.options:
            place = job.method.options.at(key)
            hint = "the node's monitors say how messages become values"
            faults.append(Diagnostic("EXP101", f"'{key}' does not go with 'campaign'", place, hint=hint))
    parameters = []
    for name, entry in given["scenario"].items():
        if name in (*COLUMNS, "trace"):
            wrong(f"scenario: '{name}' has a meaning of its own: give the parameter another name", "scenario", name)
            continue
        try:
            parameters.append(_parameter(name, entry))
        except ValueError as error:
            wrong(f"scenario.{name}: {error}", "scenario", name)
    command = tuple(map(str, given["command"]))
    known, used = {*given["scenario"], "seed", "trace"}, {place for word in command for place in _PLACE.findall(word)}
    for place in sorted(used - known):
        wrong(f"command: {{{place}}} is no parameter of the scenario", "command", hint=suggest(place, sorted(known)))
    for name in sorted({*given["scenario"], "trace"} - used):
        wrong(f"command: no argument has {{{name}}}, so the simulator does not get it", "command")
    if (strata := job.options.get("strata")) not in (None, *given["scenario"]):
        place, near = job.method.options.at("strata"), suggest(str(strata), tuple(given["scenario"]))
        faults.append(Diagnostic("EXP101", f"strata: '{strata}' is no parameter of the scenario", place, hint=near))
    if Path(given["trace"]).name != given["trace"] or given["trace"] in ("", ".", ".."):
        wrong(f"trace: '{given['trace']}' is no name of a file", "trace")
    for name in given.get("files", ()):
        if (path := inside(job.root, name)) is None or not path.exists():
            wrong(f"files: there is no '{name}' in the system's folder", "files")
        elif table is not None and path in table.parents:
            wrong(f"files: '{name}' holds the table that the campaign writes", "files")
    if table is None:
        faults.append(Diagnostic("EXP101", "'data' is no path in the system's folder", job.method.options.at("data")))
    if faults or table is None:
        raise Rejected(*faults)
    files = {p.relative_to(job.root.resolve()).as_posix(): digest_or_missing(p) for p in command_files(job)}
    runs = given.get("runs", 300)
    # of a claimed rate, whose bound is right only for a number of runs that was chosen before them
    fixed = runs if "at_least" in job.options else 0
    made_by = sha256(json.dumps([command, given["scenario"], given["trace"], job.seed, files, fixed], default=str))[:16]
    return Campaign(command, tuple(parameters), given["trace"], runs, job.seed, made_by, table)


def command_files(job: Job) -> tuple[Path, ...]:
    """The files of the system's folder that the command names, with the modules beside a Python script, which it may
    import; and those under `files`. Never raises."""
    given = job.options.get("campaign")
    found: dict[Path, None] = {}
    lists = [given.get(key) for key in ("command", "files")] if isinstance(given, Mapping) else []
    for name in (name for names in lists if isinstance(names, list) for name in names):
        path = inside(job.root, str(name)) if _PLACE.search(str(name)) is None else None
        found |= dict.fromkeys(_files(path)) if path is not None and path != job.root.resolve() else {}
    return tuple(found)


def _files(path: Path) -> Iterator[Path]:
    if path.is_dir():
        yield from (p for p in sorted(path.rglob("*")) if p.is_file() and "__pycache__" not in p.parts)
    elif path.is_file():
        yield path
        yield from sorted(p for p in path.parent.glob("*.py") if p != path and path.suffix == ".py")


def _parameter(name: str, entry: Any) -> Parameter:
    """Raises ValueError with the reason."""
    if isinstance(entry, list):
        values = tuple(_word(value) for value in entry)
        if len(set(values)) < len(values):
            raise ValueError("a value occurs twice")
        return Parameter(name, values)
    try:
        low, high = exact(_word(entry["from"])), exact(_word(entry["to"]))
        usual = exact(_word(entry["usual"])) if "usual" in entry else (low + high) / 2
    except ValueError:
        raise ValueError("'from', 'to' and 'usual' are numbers") from None
    if not low < high or not low <= usual <= high or None in (decimal(low), decimal(high)):
        raise ValueError("'from' must be less than 'to', with 'usual' between them, and both decimals")
    return Parameter(name, (), low, high, (usual - low) / (high - low))


def _word(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _decimal(value: Fraction) -> str:
    found = decimal(value)
    assert found is not None  # `low`, `high` and shares are decimals
    return found

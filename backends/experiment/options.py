"""The options of an experiment in plan.yaml, its data, and each guarantee prepared for judging; or all errors."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from pathlib import Path

from avow.backend_kit.further import unknown_outside
from avow.backend_kit.given import existing_file, schema
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import read_text
from avow.base.plain import alike, exact
from avow.base.records import dataclass
from avow.base.suggestions import nearest, suggest
from avow.kernel.rates import Trial
from avow.language.sorts import BOOL, REAL, Sort

from .binding import WORDS, Binding, Interpretation, Unfit, bound, interpretation
from .judging import Claim, Judged, Step, claim
from .network import with_outputs
from .table import Row, Table, read_table

SCHEMA = schema(json.loads(read_text(Path(__file__).with_name("options.json"), "utf-8")), "data")

RUN_COLUMNS = ("run", "trial", "id")
"""The columns that may contain the names of runs, unless the plan names one."""

FLOORS = {"high": Fraction(9, 10), "medium": Fraction(4, 5), "low": Fraction(1, 2)}
"""Criticality of the node → the least success rate that may be claimed, or shown."""

LEAST_CONFIDENCE = Fraction(9, 10)


@dataclass(frozen=True, slots=True)
class Run:
    """One run; each step's cells (those that the guarantees read), and its values."""

    name: str
    stratum: str
    rows: tuple[Mapping[str, str], ...]
    steps: tuple[Step, ...]
    verdicts: Mapping[str, Judged] = field(default_factory=dict)
    """Guarantee → its verdict, if monitors judged the run; `rows` is then its scenario."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """`claims` are by the guarantee's name; the others are the options, in exact numbers."""

    runs: tuple[Run, ...]
    claims: Mapping[str, Claim]
    bindings: tuple[Binding, ...]
    confidence: Fraction
    at_least: Fraction | None
    floor: Fraction
    """The least success rate that the runs must show, whatever is claimed."""
    strata: str
    trial: Trial
    protocol: str
    left_out: tuple[str, ...] = ()
    """Failing runs that the plan declares as left out of the data; `because` is the reason."""
    because: str = ""
    replayed: tuple[Run, ...] | None = None
    """The regressions of a campaign; None if there is no campaign."""
    alike: int = 0
    """The runs of a campaign whose recording equals that of an earlier one."""
    computed: frozenset[str] = frozenset()
    """The columns that a network adds: they change with it, and are no part of what was measured."""

    def values(self, rows: Iterable[Mapping[str, str]]) -> tuple[Step, ...]:
        """Raises Unfit, and KeyError if a cell is missing."""
        return tuple({b.name: b.value(cells) for b in self.bindings} for cells in rows)


def read(job: Job, run: bool = False) -> Experiment:
    """Raises Rejected, with all errors of options and data; Missing if a network has to be `run` and cannot be."""
    reader = _Reader(job, run)
    found = reader.experiment()
    if found is None or reader.found:
        raise Rejected(*reader.found)
    return found


def everything(job: Job) -> tuple[tuple[Run, ...], tuple[Interpretation, ...], set[str]]:
    """The runs of a table without errors, with the value of each port that has one in every row; the meanings of
    predicates; and the names of these ports."""
    reader = _Reader(job, run=True)
    table = reader._table()
    assert table is not None
    meanings = tuple(reader._meanings(table))
    bindings = {b.name: b for b in (*reader._mapped(table), *(b for one in meanings for b in one.bindings))}
    readable = [b for b in bindings.values() if all(_readable(b, row) for row in table.rows)]
    return reader._runs(table, [], readable), meanings, {binding.name for binding in readable}


def _readable(binding: Binding, row: Row) -> bool:
    try:
        binding.value(row.cells)
    except (Unfit, KeyError):
        return False
    return True


def limits(job: Job, runs: tuple[Run, ...], claims: Mapping[str, Claim], replayed: tuple[Run, ...]) -> Experiment:
    """A campaign's runs with the options of the claim. Raises Rejected."""
    reader = _Reader(job)
    found = reader.claimed(runs, claims, replayed=replayed)
    if found is None:
        raise Rejected(*reader.found)
    return found


class _Reader:
    def __init__(self, job: Job, run: bool = False) -> None:
        self.job = job
        self.run = run
        self.options = job.options
        self.found: list[Diagnostic] = []

    def add(self, key: str, message: str, hint: str | None = None, code: str = "EXP101", entry: str = "") -> None:
        self.found.append(Diagnostic(code, message, self._at(key, entry), hint=hint))

    def _at(self, key: str, entry: str = "") -> Span | None:
        return self.job.method.options.at(*((key, entry) if entry else (key,)))

    def experiment(self) -> Experiment | None:
        table = self._table()
        if table is None:
            return None
        bindings = [*self._mapped(table)]
        meanings = [*self._meanings(table)]
        self._measured(bindings, meanings)
        bindings += {b.name: b for one in meanings for b in one.bindings}.values()
        claims = self._claims(bindings, meanings)
        self._outside()
        named = [column for binding in bindings for column in binding.columns]
        for unused in [name for name in self.options.get("network", {}).get("outputs", {}) if name not in named]:
            message = f"no port is read from '{unused}', an output of the network: the evidence would not be of it"
            self.add("network", message, f"mapping: {{out.PORT: {unused}}}, or leave this output out", "EXP103")
        runs = self._runs(table, named, bindings := self._read(bindings, claims))
        return self.claimed(runs, claims, tuple(bindings))

    def claimed(
        self,
        runs: tuple[Run, ...],
        claims: Mapping[str, Claim],
        bindings: tuple[Binding, ...] = (),
        replayed: tuple[Run, ...] | None = None,
    ) -> Experiment | None:
        confidence = self._probability("confidence", Fraction(95, 100))
        if confidence is not None and not LEAST_CONFIDENCE <= confidence < 1:
            self.add("confidence", f"the confidence must be at least {float(LEAST_CONFIDENCE):g} and less than 1")
        at_least, floor = self._claimed()
        if self.found or confidence is None:
            return None
        left_out = self.options.get("left_out", {})
        return Experiment(
            runs,
            claims,
            bindings,
            confidence,
            at_least,
            floor,
            self.options.get("strata", ""),
            Trial.RUN if self.options.get("steps") or replayed is not None else Trial.STEP,
            " ".join(self.options.get("protocol", "").split()),
            tuple(str(name) for name in left_out.get("runs", ())),
            " ".join(left_out.get("because", "").split()),
            replayed,
            computed=frozenset(self.options.get("network", {}).get("outputs", {})),
        )

    def _claimed(self) -> tuple[Fraction | None, Fraction]:
        at_least = self._probability("at_least", None)
        floor = FLOORS[self.job.system.plan.node(self.job.node.name).criticality or "medium"]
        if at_least is not None and not 0 < at_least < 1:
            hint = "no finite number of runs shows a certainty; leave 'at_least' out to demand that no run fails"
            self.add("at_least", "the claimed probability of success must lie between 0 and 1", hint)
        elif at_least is not None and at_least < floor:
            message = f"a success rate of {float(at_least):g} is below the {float(floor):g} of this criticality"
            self.add("at_least", message, code="EXP105")
        return at_least, floor

    def _probability(self, key: str, default: Fraction | None) -> Fraction | None:
        if key not in self.options:
            return default
        try:
            return exact(str(self.options[key]))  # for a float the digits as typed
        except ValueError:
            self.add(key, f"'{key}' must be a number")
            return None

    def _table(self) -> Table | None:
        try:
            path = existing_file(self.job, "data", self.options.get("data", ""), wrong="EXP101", absent="EXP102")
            table = read_table(path)
            return with_outputs(self.job, table, self.run) if "network" in self.options else table
        except Rejected as rejected:
            self.found.extend(rejected.diagnostics)
            return None

    # -- the meaning of columns ----------------------------------------------------------------------------------------

    def _mapped(self, table: Table) -> Iterator[Binding]:
        ports = {p.variable.qualified: p.sort for p in (*self.job.node.inputs, *self.job.node.outputs)}
        entries = {name: name for name in ports if name in table.columns} | self.options.get("mapping", {})
        for name, entry in entries.items():
            if name not in ports:
                hint = suggest(name, tuple(ports))
                self.add("mapping", f"{self.job.node.name} has no port '{name}'", hint, "EXP103", name)
                continue
            try:
                yield bound(name, ports[name], entry)
            except Unfit as unfit:
                self.add("mapping", f"{name}: {unfit}", code="EXP103", entry=name)

    def _meanings(self, table: Table) -> Iterator[Interpretation]:
        columns = {name: _sort(table, name) for name in table.columns if re.fullmatch(r"[^\W\d]\w*", name)}
        for pattern, meaning in self.options.get("interpret", {}).items():
            place = self._at("interpret", pattern)
            try:
                yield interpretation(pattern, meaning, self.job.node, self.job.contract, columns, place)
            except Unfit as unfit:
                self.add("interpret", f"{pattern}: {unfit}", code="EXP106", entry=pattern)
            except Rejected as rejected:
                self.found.extend(rejected.diagnostics)

    def _measured(self, bindings: Iterable[Binding], meanings: Iterable[Interpretation]) -> None:
        """An output that is read from an input's column is not a measurement."""
        given = {column for b in bindings if b.name.startswith("in.") for column in b.columns}
        for b in bindings:
            if b.name.startswith("out.") and (shared := given & {*b.columns}):
                message = f"{b.name}: column '{min(shared)}' is bound to an input too, so it measures no output"
                self.add("mapping", message, code="EXP103", entry=b.name)
        for one in meanings:
            if one.output and all(column in given for b in one.bindings for column in b.columns):
                message = f"{one.pattern_text}: its meaning reads only columns that are bound to inputs"
                self.add("interpret", message, code="EXP106", entry=one.pattern_text)

    def _outside(self) -> None:
        for name, message, hint in unknown_outside(self.job.node, self.options.get("outside", {})):
            self.add("outside", message, hint, entry=name)

    def _claims(self, bindings: Iterable[Binding], meanings: Sequence[Interpretation]) -> Mapping[str, Claim]:
        known, node = {binding.name for binding in bindings}, self.job.node
        claims = {o.name: claim(self.job.clause(o), node.assumptions, meanings, known) for o in self.job.obligations}
        for meaning in meanings:
            if not any(meaning.text in one.interpreted for one in claims.values()):
                message = f"{meaning.pattern_text} occurs in no guarantee of this method, and in no assumption"
                self.add("interpret", message, code="EXP106", entry=meaning.pattern_text)
        for name, one in claims.items():
            for port in one.missing:
                hint = "name its column under 'mapping', or what its predicate means under 'interpret'"
                self.add("mapping", f"{name} speaks of {port}, and no column is bound to it", hint, "EXP103")
            if one.remembers and not self.options.get("steps"):
                message = f"{name}, or an assumption, speaks of other steps: a row by itself is no run"
                self.add("data", message, "with 'steps: true', the rows of one run are its steps")
        return claims

    def _read(self, bindings: Iterable[Binding], claims: Mapping[str, Claim]) -> list[Binding]:
        """The bindings that a guarantee, or an assumption that can be judged, reads."""
        used = {name for one in claims.values() for name in one.reads}
        return [binding for binding in bindings if binding.name in used]

    # -- runs ----------------------------------------------------------------------------------------------------------

    def _runs(self, table: Table, named: list[str], bindings: list[Binding]) -> tuple[Run, ...]:
        column = self.options.get("run_column") or next((n for n in RUN_COLUMNS if n in table.columns), None)
        if column is None:
            near = next((f"`{n}`: did you mean `{m}`? " for m in RUN_COLUMNS for n in nearest(m, table.columns)), "")
            hint = f"{near}Name it under 'run_column': without one, a copied row would count as another run"
            self.found.append(table.fault(1, "EXP112", "no column identifies a run", hint))
            return ()
        strata = self.options.get("strata", "")
        read = tuple(dict.fromkeys(name for binding in bindings for name in binding.columns))
        needed = dict.fromkeys((column, *((strata,) if strata else ()), *named))
        confused = [fault for name in needed if (fault := table.confused(name)) is not None]
        self.found.extend(confused)
        if confused:
            return ()
        grouped = self._grouped(table, column).items()
        return tuple(self._run(table, name, rows, strata, read, bindings) for name, rows in grouped)

    def _grouped(self, table: Table, column: str) -> dict[str, list[Row]]:
        grouped, names = dict[str, list[Row]](), dict[str | Fraction, str]()
        last: str | None = None
        for row in table.rows:
            name = row.cells[column]
            if not name:
                self.found.append(table.fault(row.line, "EXP113", "the run has no name"))
            if (other := names.setdefault(_identity(name), name)) != name:
                message = f"'{name}' may be the run '{other}' of line {grouped[other][0].line}"
                different = "write the name of one run in one way, and give different runs names that differ by more"
                self.found.append(table.fault(row.line, "EXP113", message, different))
            if name in grouped and not (self.options.get("steps") and name == last):
                first = grouped[name][0].line
                message = f"a second run named '{name}'; the first is in line {first}"
                hint = None if self.options.get("steps") else "with 'steps: true', the rows of a run are its steps"
                self.found.append(table.fault(row.line, "EXP113", message, hint))
            grouped.setdefault(name, []).append(row)
            last = name
        return grouped

    def _run(
        self, table: Table, name: str, rows: list[Row], strata: str, read: tuple[str, ...], bindings: list[Binding]
    ) -> Run:
        steps = list[Step]()
        for row in rows:
            step = {}
            for binding in bindings:
                try:
                    step[binding.name] = binding.value(row.cells)
                except Unfit as unfit:
                    self.found.append(table.fault(row.line, "EXP113", str(unfit)))
            steps.append(step)
        among = {row.cells[strata] for row in rows} if strata else {""}
        if len(among) > 1:
            message = f"run '{name}' has several conditions in column '{strata}': {', '.join(sorted(among))}"
            self.found.append(table.fault(rows[0].line, "EXP113", message))
        return Run(name, min(among), tuple({c: row.cells[c] for c in read} for row in rows), tuple(steps))


def _identity(name: str) -> str | Fraction:
    """Equal for names that a person reads as the same: `1` and `01`, `Run 1` and `run 1`."""
    try:
        return exact(name)
    except ValueError:
        return re.sub(r"\d+", lambda number: str(int(number[0])), alike(name))


def _sort(table: Table, column: str) -> Sort:
    """The sort of a column in a formula: BOOL if each cell is a word for a truth value, else REAL."""
    words = {word for word in WORDS if word.isalpha()}
    return BOOL if all(row.cells[column].casefold() in words for row in table.rows) else REAL

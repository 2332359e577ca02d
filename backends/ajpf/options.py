"""The method's options in plan.yaml, read and checked; every problem has its place."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from avow.backend_kit.given import existing_file
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.packaged import packaged
from avow.formulas.renaming import bound_names
from avow.language.load import parse_formula
from avow.language.sorts import BUILTINS, IntegerSort, NaturalSort, Sort
from avow.language.subterms import subterms
from avow.language.terms import Not, Quantified, Role, Term, Variable
from avow.system.schema import violations

from .environment import Environment, read_environment
from .interpreter import Semantics
from .mapping import Row, domain_of
from .parser import read_system
from .psl import AGENT_NAME, KEYWORDS, Formula, Modality, atoms
from .psl_parser import Malformed, index_names, instantiate, parse_psl
from .shape import TooComplex, shape
from .syntax import Program
from .tuning import DEFAULT_STATES, INDEX_VALUES

_BINDER = re.compile(r"\b(?:forall|exists|exists_unique)\s*\(([^|;]*)[|;]")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*'*")
"""A pattern's own quantifiers bind names that the clauses use too: these are not free variables of it."""


@dataclass(frozen=True, slots=True)
class Extra:
    """A property that the plan adds."""

    name: str
    formula: Formula
    guarantee: str | None
    counts: bool
    """Whether the guarantee's verdict depends on it."""
    because: str
    indices: Mapping[str, tuple[int, ...]]
    """Index variables that it is instantiated over, with their ranges."""
    span: Span
    forbids: Term | None = None
    """It stands for what the guarantee forbids by this formula (in normal form), which "eventually" cannot express."""


@dataclass(frozen=True, slots=True)
class Setup:
    """The options, checked."""

    programs: tuple[Program, ...]
    """The agents of the system."""
    agent: str
    """The node's."""
    environment: Environment
    environment_path: Path
    rows: tuple[Row, ...]
    instances: Mapping[str, tuple[int, ...]]
    extras: tuple[Extra, ...]
    semantics: Semantics
    states: int


def read(job: Job) -> Setup:
    """Raises Rejected with every problem."""
    options = job.method.options
    own = replace(options, data=job.options)
    odd = [
        replace(fault, code="AJPF119")
        for fault in violations(own, packaged("avow.backends.ajpf", "options.json"), "options")
    ]
    if odd:
        raise Rejected(*odd)
    reader = _OptionsReader(job)
    setup = reader.setup()
    if reader.faults or setup is None:
        raise Rejected(*reader.faults)
    return setup


class _OptionsReader:
    def __init__(self, job: Job) -> None:
        self.job = job
        self.faults: list[Diagnostic] = []
        self.options = job.options

    def fault(self, code: str, message: str, *path: str | int, hint: str | None = None) -> None:
        self.faults.append(Diagnostic(code, message, self.job.method.options.at(*path), hint=hint))

    def setup(self) -> Setup | None:
        programs, _ = self.file("program", read_system)
        environment, environment_path = self.file("environment", read_environment)
        if programs is not None:
            self.agents(programs)
        instances = self.ranges(self.options.get("instances", {}), "instances")
        rows = self.rows(programs)
        extras = self.extras(programs, instances)
        if programs is None or environment is None or environment_path is None:
            return None
        return Setup(
            programs,
            self.options.get("agent", programs[0].name),
            environment,
            environment_path,
            rows,
            instances,
            extras,
            Semantics(self.options.get("semantics", "mcapl")),
            self.options.get("states", DEFAULT_STATES),
        )

    def file(self, key: str, read_file: Any) -> tuple[Any, Path | None]:
        try:
            path = existing_file(self.job, key, self.options.get(key, ""), wrong="AJPF120", absent="AJPF120")
            return read_file(path), path
        except Rejected as error:
            self.faults.extend(error.diagnostics)
            return None, None

    def agents(self, programs: Sequence[Program]) -> None:
        for program in programs:
            if program.name in KEYWORDS or not AGENT_NAME.match(program.name):
                why = (
                    "is a word of AJPF's property language"
                    if program.name in KEYWORDS
                    else "must start with a small letter"
                )
                message = f"an agent cannot be called '{program.name}': the name {why}"
                self.faults.append(Diagnostic("AJPF104", message, program.name_span))
        names = [program.name for program in programs]
        wanted = self.options.get("agent", names[0])
        if wanted not in names:
            self.fault("AJPF121", f"agent: {_called(names)}, not {wanted!r}", "agent")

    def ranges(self, given: Mapping[str, object], *path: str) -> dict[str, tuple[int, ...]]:
        result = {}
        for name, value in given.items():
            found = self.range_of(value)
            if isinstance(found, str):
                self.fault("AJPF122", f"{'.'.join(path)}.{name}: {found}", *path, name)
            else:
                result[name] = found
        return result

    def range_of(self, value: object) -> tuple[int, ...] | str:
        cells: Sequence[object]
        if isinstance(value, list):
            cells = value
        else:
            text = str(value)
            span = re.fullmatch(r"\s*([0-9]{1,9})\s*\.\.\s*([0-9]{1,9})\s*", text)
            table, dot, column = text.partition(".")
            if span:
                low, high = int(span[1]), int(span[2])
                if high - low >= INDEX_VALUES:
                    return f"more than {INDEX_VALUES} instances"
                cells = range(low, high + 1)
            elif dot and self.job.system.plan.scenario is not None:
                try:
                    cells = self.job.system.plan.scenario.table(table).column(column)
                except (KeyError, ValueError):
                    return f"the scenario has no column {text!r}"
            else:
                cells = [value]
        if not all(re.fullmatch(r"[0-9]{1,9}", str(cell)) for cell in cells):
            return "the instances must be natural numbers"
        found = tuple(dict.fromkeys(int(str(cell)) for cell in cells))
        if not found:
            return "the range is empty"
        return found if len(found) <= INDEX_VALUES else f"more than {INDEX_VALUES} instances"

    def sorts(self) -> dict[str, Sort]:
        """Pattern variables by default have the sorts that the node's own clauses give to these names."""
        found: dict[str, Sort] = {}
        for clause in self.job.node.clauses:
            for term in subterms(clause.formula):
                if isinstance(term, Quantified):
                    for variable in term.variables:
                        found.setdefault(variable.name, variable.sort)
        for name, sort in self.options.get("variables", {}).items():
            found[name] = BUILTINS[sort]
        ports = {p.name for p in (*self.job.node.inputs, *self.job.node.outputs)}
        return {name: sort for name, sort in found.items() if name not in ports}

    def domains(self) -> dict[str, tuple[int, ...]]:
        """The scenario's domains of the variables that the node's clauses quantify over: their ranges if the plan's
        `instances` give none."""
        scenario = self.job.system.plan.scenario
        variables = (Variable(Role.BOUND, name, sort) for name, sort in self.sorts().items() if is_index(sort))
        return {v.name: tuple(found) for v in variables if (found := domain_of(v, scenario))}

    def rows(self, programs: Sequence[Program] | None) -> tuple[Row, ...]:
        sorts = self.sorts()
        rows = []
        for text, target in self.options.get("predicates", {}).items():
            span = self.job.method.options.at("predicates", text)
            pattern = self.pattern(text, sorts, "predicates", text)
            formula = self.psl(target, programs, "predicates", text)
            if pattern is None or formula is None:
                continue
            made, names = pattern
            loose = sorted(index_names(formula) & set(sorts) - names)
            if loose:
                message = f"'{loose[0]}' in the formula is no variable of the pattern “{text}”"
                self.fault("AJPF123", message, "predicates", text)
                continue
            rows.append(Row(text, made, names, formula, span))
        return tuple(rows)

    def pattern(self, text: str, sorts: Mapping[str, Sort], *path: str) -> tuple[Term, frozenset[str]] | None:
        span = self.job.method.options.at(*path)
        bound = {name for binder in _BINDER.findall(text) for name in _NAME.findall(binder)}
        free_sorts = {name: sort for name, sort in sorts.items() if name not in bound}
        try:
            term = shape(parse_formula(text, self.job.node, self.job.contract, span, free_sorts))
        except Rejected as error:
            self.faults.extend(error.diagnostics)
            return None
        except (TooComplex, RecursionError):
            self.fault("AJPF123", "the pattern is too complex", *path)
            return None
        return term, bound_names(term)

    def psl(self, text: str, programs: Sequence[Program] | None, *path: str) -> Formula | None:
        try:
            formula = parse_psl(text)
        except Malformed as error:
            span = self.job.method.options.at(*path)
            shown = f"{text[: error.offset]}▸{text[error.offset :]}" if len(text) <= 200 else text[error.offset :][:40]
            hint = f"at the mark: {shown}" if error.offset else None
            self.faults.append(Diagnostic("AJPF124", f"{path[-1]}: {error.reason}", span, hint=hint))
            return None
        names = [program.name for program in programs or ()]
        for atom in atoms(formula):
            if programs is not None and atom.modality is not Modality.PERCEPT and atom.agent not in names:
                message = f"there is no agent '{atom.agent}'; {_called(names)}"
                self.fault("AJPF121", message, *path)
                return None
        return formula

    def extras(self, programs: Sequence[Program] | None, instances: Mapping[str, tuple[int, ...]]) -> tuple[Extra, ...]:
        found = []
        for name, entry in self.options.get("properties", {}).items():
            data: Mapping[str, Any] = {"psl": entry} if isinstance(entry, str) else entry
            formula = self.psl(data["psl"], programs, "properties", name)
            if formula is None:
                continue
            guarantee = data.get("guarantee")
            if guarantee is not None and guarantee not in [c.name for c in self.job.node.guarantees]:
                message = f"properties.{name}: there is no guarantee '{guarantee}'"
                self.fault("AJPF125", message, "properties", name, "guarantee")
                continue
            own = self.ranges(data.get("instances", {}), "properties", name, "instances")
            ranges = {**self.domains(), **instances, **own}
            indices = {i: ranges[i] for i in sorted(index_names(formula) & set(ranges))}
            try:
                for choice in product(*indices.values()):
                    instantiate(formula, dict(zip(indices, choice, strict=True)))
            except Malformed as error:
                self.fault("AJPF124", f"properties.{name}: {error.reason}", "properties", name)
                continue
            span = self.job.method.options.at("properties", name)
            counts = guarantee is not None and data.get("counts", True)
            forbids = None
            if "forbids" in data:
                if not counts:
                    message = f"properties.{name}: what says what a guarantee forbids must count for one"
                    self.fault("AJPF125", message, "properties", name, "forbids")
                pattern = self.pattern(data["forbids"], self.sorts(), "properties", name, "forbids")
                if pattern is None:
                    continue
                forbids = pattern[0].body if isinstance(pattern[0], Not) else pattern[0]
            found.append(Extra(name, formula, guarantee, counts, data.get("because", ""), indices, span, forbids))
        return tuple(found)


def _called(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"the program's agent is called '{names[0]}'"
    return f"the program's agents are called {', '.join(map(repr, names))}"


def is_index(sort: Sort) -> bool:
    return isinstance(sort, IntegerSort | NaturalSort)

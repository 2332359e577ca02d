"""The generated test: a property test as a person would write it, which runs with pytest and Hypothesis alone."""

from __future__ import annotations

import builtins
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files as files_of
from pathlib import PurePosixPath

from avow.backend_kit.programs.samples import leaves
from avow.backend_kit.protocol import Job
from avow.base.plain import as_identifier, one_line
from avow.formulas.temporal.cells import Records, longest_limits, remembers
from avow.language import sorts
from avow.language.contract import Clause, ClauseKind, Port
from avow.language.printer import show_term
from avow.language.subterms import histories
from avow.language.terms import Implies, Term

from . import tuning
from .convention import EXACT
from .strategies import Rows, Strategies, bounds, readable
from .subject import SubjectFile, modules
from .thresholds import thresholds
from .translate import Translator, Untranslatable, safe_name

SCENARIO = "scenario.json"
"""Beside it: the rows of the plan's scenario that the node reads."""

_NUMBERS = sorts.RealSort | sorts.IntegerSort | sorts.NaturalSort

MACHINE, ADVANCE = "Runs", "advance"
"""The names that `running` uses in a generated test."""


def _helpers() -> dict[str, str]:
    """Functions that generated tests need, by name, each after those that it calls."""
    text = files_of(__package__).joinpath("helpers.txt").read_text(encoding="utf-8")
    parts = [part.strip("\n") for part in text.split("\n\n\n")]
    return {re.split(r"[\s(:]", part)[1]: part for part in parts}


_RESERVED = frozenset(dir(builtins)).union(
    ("self", "st", "given", "assume", "settings", "rule", "precondition", "Fraction", "Path", "SimpleNamespace"),
    ("json", "sys", "out", "answer", "inputs", "now", "name", "other", "by", "way", "times"),
    ("CONSTANTS", "NUMBERS", "TEXTS", "WORDS", "LENGTHS", "TABLES", MACHINE),
    _helpers(),
)


def cases(job: Job) -> int:
    """The number of cases in the plan."""
    return int(job.options.get("cases", 500))


def numbers(job: Job) -> str:
    """The representation of a REAL: for a driven class as the plan declares, unless the option is given."""
    given = job.options.get("numbers")
    if job.options.get("subject") is None and job.source is not None and given is None:
        return job.source.numbers.value
    return str(given or EXACT)


def test_name(job: Job) -> str:
    return f"test_{as_identifier(job.node.name)}.py"


def _port_names(ports: Sequence[Port]) -> dict[str, str]:
    """The Python name of each port."""
    found: dict[str, str] = {}
    for port in ports:
        found[port.name] = safe_name(port.name, _RESERVED | {*found.values()})
    return found


def constants(job: Job, subject: SubjectFile) -> tuple[Port, ...]:
    """The parameters with values that the unit takes as arguments."""
    return () if subject.source else tuple(p for p in job.node.fixed if subject.takes(p.name))


class GeneratedTest:
    """The test of a unit against the guarantees of a job."""

    def __init__(self, job: Job, subject: SubjectFile) -> None:
        """Reads the unit under test. Raises RecursionError."""
        self.job, self.subject = job, subject
        node, left = job.node, subject.left_out
        self.inputs = tuple(p for p in node.inputs if p.variable.qualified not in left)
        self.outputs = tuple(p for p in node.outputs if p.variable.qualified not in left)
        self.guarantees = tuple(job.clause(o) for o in job.obligations)
        clauses = (*node.assumptions, *self.guarantees)
        self.limit = longest_limits(c.formula for c in clauses)
        """The largest number of steps of the limits of one clause."""
        self.doubles = numbers(job) != EXACT
        self.runs = subject.driven or remembers(node)
        """Whether it is tested over runs."""
        self.limits = bounds(c.formula for c in node.assumptions)
        self.names = _port_names(self.inputs)
        """Input port → its Python name."""
        # by the clause's name, over one step and the remembered values
        records = Records()
        self.formulas = {c.name: records.clause(c.formula) if histories(c.formula) else c.formula for c in clauses}
        known = thresholds((c.formula for c in clauses), modules(subject.path), leaves(dict(subject.parameters)))
        tables = {} if subject.driven else {p.name: t for p in self.inputs if (t := _table(job, p)) is not None}
        meeting = any(isinstance(p.sort, sorts.FunctionSort) for p in self.inputs)
        self.strategies = Strategies(known, self.doubles, subject.driven, meeting, tables)
        taken = {f"in.{port}": name for port, name in self.names.items()}
        taken |= {f"out.{p.name}": f"out.{safe_name(p.name)}" for p in self.outputs}
        reserved = _RESERVED | {*self.names.values(), PurePosixPath(subject.name).stem}
        self.before = Translator(taken, reserved)
        """For formulas before the unit is called; it has no names for the state after this step."""
        named: dict[Term, str] = {}
        self.after = Translator(taken, reserved, named)
        self.kept: list[tuple[str, str, str]] = []
        """The contract's state variables: name, first value, value after a step."""
        for number, cell in enumerate(c for c in records.cells if not c.parameters):
            name = f"{cell.record.operator if cell.record is not None else 'first'}_{number + 1}"
            try:
                first = self.before.formula(cell.initial) if cell.initial is not None else "None"
                taken[cell.before.qualified] = f"self.{name}"
                self.kept.append((name, first, self.after.formula(cell.now)))
                if cell.now.children:
                    named[cell.now] = name
            except Untranslatable:
                taken.pop(cell.before.qualified, None)

    @property
    def steps(self) -> int:
        """Steps of a run: enough for the contract's time limits to expire."""
        return tuning.STEPS + min(2 * self.limit, tuning.LONGEST_RUN)

    def files(self) -> Mapping[str, str]:
        """Relative path → text."""
        found = {test_name(self.job): self.text()}
        if self.strategies.tables:
            rows = {name: rows for name, (_, rows) in self.strategies.tables.items()}
            found[SCENARIO] = json.dumps(rows) + "\n"
        return found

    def untranslated(self) -> frozenset[str]:
        """The guarantees that it leaves to Avow."""
        return frozenset(c.name for c in self.guarantees if isinstance(self.said(c), Untranslatable))

    def said(self, clause: Clause) -> str | Untranslatable:
        """The clause in Python."""
        try:
            translator = self.before if clause.kind is ClauseKind.ASSUMPTION else self.after
            return translator.formula(self.formulas[clause.name])
        except Untranslatable as why:
            return why

    # -- the file ----------------------------------------------------------------------------------------

    def text(self) -> str:
        folder = str(PurePosixPath("contracts", self.job.root.name, self.subject.name).parent)
        body = "\n".join(self._machine() if self.runs else self._function())
        drawn = "\n".join(["", "", *self.strategies.definitions.values()])
        helpers = ""
        for name, text in reversed(_helpers().items()):  # each follows those that it calls
            if re.search(rf"\b{name}[(),]", helpers + drawn + body):
                helpers = f"\n\n{text}\n{helpers}"
        everything = helpers + drawn + "\n\n" + body
        node, system = _plain(self.job.node.name), _plain(self.job.system.name)
        head = [
            f'"""Property tests of the node {node} of {system}, generated by Avow from its contract.',
            "",
            "Run them with pytest; they need Hypothesis, and nothing of Avow. `avow verify` runs this very file.",
            '"""',
            "",
            *_imports(everything, self.runs),
            "",
            f"# The unit under test: {folder}, in a folder above this file.",
            f'sys.path[:0] = [str(folder / "{_plain(folder)}") for folder in Path(__file__).resolve().parents]',
            f"{self._imported()}  # noqa: E402",
        ]
        return "\n".join([*head, everything, ""])

    def _imported(self) -> str:
        stem = PurePosixPath(self.subject.name).stem
        if stem.isidentifier() and stem == safe_name(stem, {*self.names.values()} | _RESERVED):
            return f"import {stem}"
        return f'unit_under_test = __import__("importlib").import_module({stem!r})'

    def _module(self) -> str:
        imported = self._imported()
        return imported.removeprefix("import ") if imported.startswith("import ") else "unit_under_test"

    def _function(self) -> Iterator[str]:
        numbers = {p.name for p in self.inputs if isinstance(p.sort, _NUMBERS) and p.name not in self.strategies.tables}
        numbers = numbers if len(numbers) > 1 else set()
        drawn = [f"    {self.names[p.name]}={self._drawn(p)}," for p in self.inputs if p.name not in numbers]
        if numbers:
            related = [f"        {self.names[p.name]}={self._drawn(p)}," for p in self.inputs if p.name in numbers]
            drawn += ["    **together(", *related, "    ),"]
        drawn = drawn or ["    nothing=st.none(),"]
        arguments = ", ".join(self.names.values()) or "nothing"
        yield ""
        yield f"@settings(max_examples={cases(self.job)}, deadline=None)"
        yield from ("@given(", *drawn, ")")
        yield f"def test_{as_identifier(self.job.node.name)}({arguments}):"
        body = [*self._step(f"{self._module()}.{self.subject.function}", "assume({})")]
        yield from body[not body[0] :]

    def _machine(self) -> Iterator[str]:
        free = [p for p in self.inputs if p.name not in self.subject.memory]
        arguments = ", ".join(self.names[p.name] for p in free)
        passed = ", ".join(f"{self.names[p.name]}={self.names[p.name]}" for p in free)
        yield ""
        yield f"class {MACHINE}(RuleBasedStateMachine):"
        yield '    """Runs from the start, each step judged by itself."""'
        yield ""
        yield "    def __init__(self):"
        yield "        super().__init__()"
        if self.subject.driven:
            given = repr(dict(self.subject.parameters)) if self.subject.wants_parameters else ""
            yield f"        self.unit = {self._module()}.{self.subject.class_name}({given})"
        yield "        self.last = None  # the inputs of the step before"
        for name, first, _ in self.kept:
            yield f"        self.{name} = {first}"
        drawn = {self.names[p.name]: self._drawn(p) for p in free}
        rule = ", ".join(f"{name}={strategy}" for name, strategy in drawn.items())
        yield from ("", f"    @rule({rule})", f"    def step(self{', ' * bool(free)}{arguments}):")
        yield f"        self.{ADVANCE}({passed})"
        again = "    @precondition(lambda self: self.last is not None)"
        for name, strategy in drawn.items() if len(drawn) > 1 else ():
            yield from ("", again, f"    @rule({name}={strategy})", f"    def change_{name}(self, {name}):")
            yield f"        self.{ADVANCE}(**{{**self.last, {name!r}: {name}}})"
        yield from ("", again, f"    @rule(times=st.integers(1, {self.limit + 4}))", "    def hold(self, times):")
        yield "        for _ in range(times):"
        yield f"            self.{ADVANCE}(**self.last)"
        reals = [self.names[p.name] for p in free if isinstance(p.sort, sorts.RealSort)]
        if reals:
            ports = f"name=st.sampled_from({reals!r}), other=st.sampled_from({reals!r})"
            by = 'by=st.sampled_from(CONSTANTS) | st.sampled_from(NUMBERS), way=st.sampled_from("+-~*/")'
            yield from ("", again, f"    @rule({ports}, {by})", "    def move(self, name, other, by, way):")
            yield f"        self.{ADVANCE}(**{{**self.last, name: moved(self.last[other], by, way)}})"
        yield from ("", f"    def {ADVANCE}(self{', ' * bool(free)}{arguments}):")
        unit = "self.unit.step" if self.subject.driven else f"{self._module()}.{self.subject.function}"
        lines = [*self._step(unit, "if not ({}):\n    return")]
        yield from (f"    {line}" if line else line for text in lines for line in text.split("\n"))
        yield ""
        yield from (f"        self.{name} = {name}" for name, *_ in self.kept)
        runs = math.ceil(cases(self.job) / self.steps)
        case = f"Test{as_identifier(self.job.node.name[:1].upper() + self.job.node.name[1:])}"
        yield from ("", "", f"{case} = {MACHINE}.TestCase")
        yield f"{case}.settings = settings(max_examples={runs}, stateful_step_count={self.steps}, deadline=None)"

    def _drawn(self, port: Port) -> str:
        limits = self.limits.get(port.name, (None, None)) if port.name not in self.subject.memory else (None, None)
        return self.strategies.port(port.name, port.sort, limits)

    def _step(self, unit: str, assume: str) -> Iterator[str]:
        """The body: inputs that the assumptions allow, outputs, an assertion for each guarantee."""
        given = [p for p in self.inputs if p.name not in self.subject.memory]
        taken = [p for p in given if self.subject.takes(p.name)]
        direct = not self.doubles and all(p.name == self.names[p.name] for p in taken)
        fixed = [f"{p.name}={self._constant(p)}" for p in constants(self.job, self.subject)]
        called = ", ".join([*(f"{p.name}={p.name}" for p in taken), *fixed] if direct else ["**inputs", *fixed])
        if self.runs:
            yield f"    now = {{{', '.join(f'{self.names[p.name]!r}: {self.names[p.name]}' for p in given)}}}"
        if not direct:
            yield f"    inputs = {{{', '.join(f'{p.name!r}: {self.names[p.name]}' for p in taken)}}}"
        for port in self.inputs:
            name, attribute = self.names[port.name], dict(self.subject.held).get(port.name)
            if attribute is not None:
                yield f"    {name} = {_converted(f'self.unit.{attribute}', port.sort)}"
            elif self.doubles and sorts.RealSort() in sorts.components(port.sort):
                yield f"    {name} = exact({name})"
        for clause in self.job.node.assumptions:
            yield from self._heading(clause)
            code = self.said(clause)
            if isinstance(code, str):
                yield from (f"    {line}" for line in assume.format(_inside(_wrapped(code))).split("\n"))
        yield ""
        if self.runs:
            yield "    self.last = now"
        returned = [p for p in self.outputs if p.name not in dict(self.subject.held)]
        yield f"    answer = {unit}({called})"
        if len(returned) == 1:
            only = returned[0].name
            yield f"    if not (isinstance(answer, dict) and {only!r} in answer):"
            yield f"        answer = {{{only!r}: answer}}"
        yield "    out = SimpleNamespace("
        for port in self.outputs:
            attribute = dict(self.subject.held).get(port.name)
            value = f"answer[{port.name!r}]" if attribute is None else f"self.unit.{attribute}"
            yield f"        {safe_name(port.name)}={_converted(value, port.sort)},"
        yield "    )"
        yield from (f"    {name} = {now}" for name, _, now in self.kept)
        for clause in self.guarantees:
            yield from self._heading(clause)
            yield from self._asserted(clause)

    def _constant(self, port: Port) -> str:
        """The value of a parameter, as the unit takes it."""
        assert port.value is not None
        text = self.before.formula(port.value)
        return f"float({text})" if self.doubles and isinstance(port.sort, sorts.RealSort) else text

    def _heading(self, clause: Clause) -> Iterator[str]:
        yield ""
        yield f"    # {clause.name}: {one_line(show_term(clause.formula, 'unicode'))}"
        code = self.said(clause)
        if isinstance(code, Untranslatable):
            yield f"    # This is left to `avow verify`: {one_line(str(code))}."

    def _asserted(self, clause: Clause) -> Iterator[str]:
        formula, code = self.formulas[clause.name], self.said(clause)
        if isinstance(code, Untranslatable):
            return
        message = repr(f"{clause.name}: {one_line(clause.sentence)}" if clause.sentence else clause.name)
        indent = "    "
        if isinstance(formula, Implies):
            yield f"    if {self.after.formula(formula.left)}:"
            indent, code = "        ", self.after.formula(formula.right)
        yield from (indent + line for line in f"assert {_wrapped(code)}, {message}".split("\n"))


def _wrapped(code: str) -> str:
    """A long expression in parentheses, on several lines; not if it contains a text with spaces."""
    if len(code) < 90 or "\\" in code or any(" " in text for text in re.findall(r"""'[^']*'|"[^"]*\"""", code)):
        return code
    lines = [""]
    for part in re.split(r"(?<= )(?=(?:for|if|and|or) )", code):
        lines[-1:] = [lines[-1] + part] if len(lines[-1] + part) < 90 else [lines[-1], part]
    return "(\n    " + "\n    ".join(line.strip() for line in lines) + "\n)"


def _inside(wrapped: str) -> str:
    """The text for the parentheses of a call."""
    return wrapped.removeprefix("(").removesuffix(")") if wrapped.startswith("(\n") else wrapped


def _table(job: Job, port: Port) -> tuple[sorts.FunctionSort, Rows] | None:
    """The scenario's rows for an input that it interprets."""
    scenario, sort = job.system.plan.scenario, port.sort
    relation = scenario.interpreted(job.node.name, port) if scenario is not None else None
    if scenario is None or relation is None or not isinstance(sort, sorts.FunctionSort):
        return None
    table = scenario.table(relation[0])
    at = [table.columns.index(column) for column in relation[1] if column in table.columns]
    columns = sort.parameters if isinstance(sort.result, sorts.BoolSort) else (*sort.parameters, sort.result)
    rows = readable(tuple(tuple(row[k] for k in at) for row in table.rows), columns)
    return (sort, rows) if rows else None


def _plain(text: str) -> str:
    return one_line(text).replace("\\", "/").replace('"', "'")


def _converted(value: str, sort: sorts.Sort) -> str:
    """A returned or held value, as the test compares it."""
    match sort:
        case sorts.EnumSort():
            return f"named({value})"
        case sorts.DataSort():
            return f"made({value})"
        case sorts.FunctionSort(result=result):
            return f"relation({value})" if isinstance(result, sorts.BoolSort) else f"function({value})"
        case sorts.TupleSort(labels=labels) if labels:
            return f"exact(record({value}, {list(labels)!r}))"
        case sorts.RealSort() | sorts.SequenceSort() | sorts.TupleSort():
            return f"exact({value})"
        case _:  # as it is
            return value


def _imports(text: str, runs: bool) -> Iterator[str]:
    yield from ["import json"] * ("json." in text)
    yield "import sys"
    yield from ["from fractions import Fraction"] * ("Fraction" in text)
    yield "from pathlib import Path"
    yield "from types import SimpleNamespace"
    yield ""
    names = ["settings"] if runs else [*["assume"] * ("assume(" in text), "given", "settings"]
    yield f"from hypothesis import {', '.join(names)}"
    yield "from hypothesis import strategies as st"
    if runs:
        yield "from hypothesis.stateful import RuleBasedStateMachine, precondition, rule"

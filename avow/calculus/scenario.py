"""A plan's finite scenario as values: the possible environment inputs and outputs in a bounded check.

The scenario restricts which values are *tried*; whether a guarantee holds for them is judged exactly.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.plain import listed
from avow.base.records import dataclass
from avow.base.tuning.bounds import SMALL_TABLE, VALUES_OF_A_PORT
from avow.base.tuning.shown import DOMAIN_VALUES
from avow.base.verdict import Hypothesis, bound
from avow.calculus.variables import Frame, frame
from avow.evaluation.compiler import combinations
from avow.evaluation.evaluate import NotEvaluable, evaluate, finite_values
from avow.formulas.finite import cell_value
from avow.formulas.formula import free_variables
from avow.formulas.temporal.ages import CLOCK
from avow.formulas.temporal.clock import pace_of
from avow.formulas.values import Data, FunctionValue, Opaque, Value
from avow.language import sorts as s
from avow.language.contract import Port
from avow.language.subterms import histories
from avow.language.terms import Term
from avow.system.names import ports_named
from avow.system.plan import STEP_LENGTH, Scenario, System

Point = tuple[Value, ...]


class CannotRun(Exception):  # noqa: N818 - it names a state
    """The composed contracts cannot be run over this scenario; the message says why, and what would help."""


@dataclass(frozen=True, slots=True)
class World:
    """The scenario of one system, read once."""

    frame: Frame
    scenario: Scenario
    domains: dict[s.Sort, tuple[Value, ...]]
    effort: int = 10_000
    """The effort limit of one solver query."""

    def choices(self, node: str, port: Port) -> tuple[Value, ...]:
        """The values that an environment input may take at each step. Raises CannotRun."""
        table = self.scenario.interpreted(node, port)
        if table is not None:
            return (self.interpreted(port.sort, *table),)
        return self.values(f"{node}.{port.name}", ("in", node), port)

    def lengths(self) -> tuple[Fraction, ...]:
        """The possible times between steps, in seconds: those of ``scenario.domains.dt`` or, without it, the nodes' own
        and half of these. Raises CannotRun."""
        paces = [pace for node in self.frame.system.contract.nodes if (pace := pace_of(node)) is not None]
        limits = [(p.relation, p.number) for p in paces]
        texts = self.scenario.domains.get(STEP_LENGTH)
        if texts is not None:
            tried = [t for text in texts if isinstance(t := self.parse(text, s.REAL), Fraction)]
        else:
            tried = [part for relation, most in limits for part in ((most,) if relation == "==" else (most / 2, most))]
        found = tuple(
            dict.fromkeys(
                t for t in tried if t > 0 and all(t == most if r == "==" else t <= most for r, most in limits)
            )
        )
        if not found:
            raise CannotRun(f"how long a step takes is not said; give scenario.domains: {{{STEP_LENGTH}: …}}")
        return found

    def candidates(self, node: str, port: Port) -> tuple[Value, ...]:
        """The values that are tried for an output that is not a function. Raises CannotRun."""
        return self.values(f"{node}.{port.name}", ("out", node), port)

    def domain(self, owners: Sequence[str], port: Port) -> tuple[str, ...] | None:
        """The scenario's values for a port, by its name."""
        found = (self.scenario.domains.get(f"{owner}.{port.name}") for owner in owners)
        return next((texts for texts in found if texts is not None), None)

    def results(self, node: str, port: Port) -> tuple[Value, ...]:
        """The values that a function may have at each point. Raises CannotRun."""
        sort = port.sort
        assert isinstance(sort, s.FunctionSort)
        texts = self.domain(("out", node), port)
        if texts is not None:
            return tuple(dict.fromkeys(self.parse(text, sort.result) for text in texts))
        found = self.plain_values(sort.result)
        if found is None or len(found) > VALUES_OF_A_PORT:
            raise CannotRun(
                f"what values {node}.{port.name} has is not said; give scenario.domains: {{out.{port.name}: …}}"
            )
        return found

    def points(self, node: str, port: Port) -> tuple[Point, ...]:
        """The points at which a relation may hold. Raises CannotRun."""
        sort = port.sort
        assert isinstance(sort, s.FunctionSort)
        texts = self.domain(("out", "in", node), port)
        if texts is not None:
            wanted = sort.parameters[0] if len(sort.parameters) == 1 else s.TupleSort(sort.parameters)
            found = [self.parse(text, wanted) for text in texts]
            return tuple(v if isinstance(v, tuple) else (v,) for v in found)
        found_points = self.tuples(sort.parameters)
        if found_points is None:
            raise CannotRun(
                f"where {node}.{port.name} may hold is not said, or too many places; give scenario.domains: "
                f"{{out.{port.name}: …}} or the ranges of its parameters' types"
            )
        return found_points

    def tuples(self, sorts: Sequence[s.Sort]) -> tuple[Point, ...] | None:
        """The combinations of values that are tried: from the given ranges if every sort has one, otherwise the points
        that the interpreted tables contain (a relation on REAL x REAL x NATURAL contains pairs of reals)."""
        if all(finite_values(sort, self.domains) is not None for sort in sorts):
            return combinations(sorts, self.domains, VALUES_OF_A_PORT)
        found: dict[Point, None] = {}
        for signature, rows in self.rows():
            for start in range(len(signature) - len(sorts) + 1):
                if list(signature[start : start + len(sorts)]) == list(sorts):
                    found.update(dict.fromkeys(row[start : start + len(sorts)] for row in rows))
        return tuple(found) or None

    def rows(self) -> Iterator[tuple[tuple[s.Sort, ...], list[Point]]]:
        """Every interpreted table: the sorts of its columns, and its rows."""
        for name, (table, columns) in self.scenario.interpret.items():
            ports = ports_named(name, self.frame.system.contract.nodes)
            if not ports or not isinstance(ports[0][1].sort, s.FunctionSort):
                continue
            sort = ports[0][1].sort
            signature = sort.parameters if sort.result == s.BOOL else (*sort.parameters, sort.result)
            cells = [self.scenario.table(table).column(column) for column in columns]
            yield (
                signature,
                [
                    tuple(self.parse(c, part) for c, part in zip(row, signature, strict=False))
                    for row in zip(*cells, strict=True)
                ],
            )

    def plain_values(self, sort: s.Sort) -> tuple[Value, ...] | None:
        """The values of a sort that are tried; None if they are not finitely many."""
        if isinstance(sort, s.DataSort) and sort not in self.domains:
            found: list[Value] = []
            for constructor in sort.constructors:
                arguments = self.tuples(constructor.parameters) if constructor.parameters else ((),)
                if arguments is None:
                    return None
                found += [Data(constructor.name, values) for values in arguments]
            return tuple(found)
        if isinstance(sort, s.TupleSort) and sort not in self.domains:
            return self.tuples(sort.items)
        return finite_values(sort, self.domains) or (tuple(p[0] for p in self.tuples((sort,)) or ()) or None)

    def values(self, name: str, owners: Sequence[str], port: Port) -> tuple[Value, ...]:
        texts = self.domain(owners, port)
        if texts is not None and not isinstance(port.sort, s.FunctionSort):
            return tuple(self.parse(text, port.sort) for text in texts)
        if isinstance(port.sort, s.OpaqueSort):
            return (Opaque(port.sort.name, 0),)
        if isinstance(port.sort, s.FunctionSort):
            raise CannotRun(f"{name}: say where it holds: scenario.interpret: {{in.{port.name}: table(column, …)}}")
        found = self.plain_values(port.sort)
        if found is None or len(found) > VALUES_OF_A_PORT:
            why = "has infinitely many values" if found is None else "has too many values"
            raise CannotRun(f"{name} ({port.type_name}) {why}; give scenario.domains: {{{owners[0]}.{port.name}: …}}")
        return tuple(found)

    def interpreted(self, sort: s.Sort, table: str, columns: tuple[str, ...]) -> FunctionValue:
        """A relation that holds at exactly the rows of a table, or a function given by them."""
        assert isinstance(sort, s.FunctionSort)
        found = self.scenario.table(table)
        cells = [found.column(column) for column in columns]
        rows = list(zip(*cells, strict=True))
        keys = [tuple(self.parse(cell, part) for cell, part in zip(row, sort.parameters, strict=False)) for row in rows]
        if sort.result == s.BOOL:
            return FunctionValue(dict.fromkeys(keys, True), False)
        results = [self.parse(row[-1], sort.result) for row in rows]
        return FunctionValue(dict(zip(keys, results, strict=True)), self.elsewhere(sort.result, results))

    def elsewhere(self, sort: s.Sort, results: Sequence[Value]) -> Value:
        """A function's value outside its table: a value that is not in the table and not next to one in it."""
        if isinstance(sort, s.NaturalSort | s.IntegerSort | s.RealSort):
            numbers = [value for value in results if isinstance(value, int | Fraction)]
            top = max(numbers, default=0)
            return Fraction(top + 2) if isinstance(sort, s.RealSort) else int(top) + 2
        known = finite_values(sort, self.domains) or tuple(results)
        unused = [value for value in known if value not in results]
        if not (unused or known):
            raise CannotRun("a function's table is empty, and nothing else says what its values may be")
        return (unused or list(known))[0]

    def allows(self, formula: Term, port: Port, text: str) -> bool:
        """Whether an assumption about one input may hold for a value."""
        try:
            return bool(evaluate(formula, {port.variable.qualified: self.parse(text, port.sort)}))
        except (CannotRun, NotEvaluable):
            return True

    def parse(self, text: str, sort: s.Sort) -> Value:
        """Parses a table cell or a value in RCL notation. Raises CannotRun."""
        from avow.language.load import parse_term

        if not text.startswith('"'):
            with contextlib.suppress(ValueError):
                return cell_value(text, sort)
        try:
            return evaluate(parse_term(text, None, self.frame.system.contract, sort=sort), {})
        except Rejected as rejected:
            raise CannotRun(f"scenario: {text!r}: {rejected.diagnostics[0].message}") from None
        except NotEvaluable as reason:
            raise CannotRun(f"scenario: {text!r}: {reason.reason}") from None


def world(frame: Frame) -> World:
    """The scenario of a system. Raises CannotRun if there is none, or its values cannot be read."""
    scenario = frame.system.plan.scenario or Scenario()
    found = World(frame, scenario, {})
    named = {**s.BUILTINS, **dict(frame.system.contract.types)}
    for name, texts in scenario.domains.items():
        sort = named.get(name)
        if sort is not None and not isinstance(sort, s.FunctionSort):
            found.domains[sort] = tuple(dict.fromkeys(found.parse(text, sort) for text in texts))
    return found


def excluded(system: System) -> Iterator[Diagnostic]:
    """A warning at each assumption about one input that excludes values that `scenario.domains` gives to it."""
    scenario, nodes = system.plan.scenario, system.contract.nodes
    if scenario is None or not any(ports_named(name, nodes) for name in scenario.domains):
        return
    found, places = World(frame(system), scenario, {}), {e.port: e.assume_span for e in system.plan.environment}
    for name, texts in scenario.domains.items():
        for node, port in ports_named(name, nodes):
            about = [(a.formula, places[a.port]) for a in found.frame.assumed if a.node == node.name]
            for formula, span in (*about, *((clause.formula, clause.span) for clause in node.assumptions)):
                if free_variables(formula) == {port.variable} and not histories(formula):
                    never = [text for text in texts if not found.allows(formula, port, text)]
                    if never:
                        message = f"scenario.domains.{name} has {listed(never)}, which this assumption never allows"
                        yield Diagnostic("PLAN137", message, span, Severity.WARNING)


def restrictions(world: World, given: Sequence[Mapping[str, Value]] = ()) -> tuple[Hypothesis, ...]:
    """What a bounded check assumes about the values that the contracts leave open, by its name in the plan: a range
    that leaves out values of its sort, a relation or function given by a table, and the sorts that are sampled.
    `given`: the environment's inputs, one step each; a range has the values of these."""
    scenario, found = world.scenario, list[Hypothesis]()
    named = {**s.BUILTINS, **dict(world.frame.system.contract.types)}
    for name, texts in scenario.domains.items():
        ports = ports_named(name, world.frame.system.contract.nodes)
        sort = named.get(name) or (ports[0][1].sort if ports else None)
        everything = None if sort is None or isinstance(sort, s.FunctionSort) else finite_values(sort)
        if everything is None or sort is None or not set(everything) <= {world.parse(text, sort) for text in texts}:
            place = f"scenario.domains.{name}"
            read = {world.frame.input(node.name, p.name).qualified for node, p in ports if p in node.inputs}
            read |= {CLOCK.qualified} if name == STEP_LENGTH else set()
            tried = {key(values[each]) for values in given for each in read if each in values}
            tried = set() if isinstance(sort, s.FunctionSort) else tried  # its values are given point by point
            out = [text for text in texts if tried and key(world.parse(text, sort or s.REAL)) not in tried]
            left = f"; the assumptions leave out {listed(out, DOMAIN_VALUES)}" if out else ""
            kept = listed([text for text in texts if text not in out], DOMAIN_VALUES)
            found.append(bound(place, f"{place}: it is one of {kept}{left}"))
    for name, (table, columns) in scenario.interpret.items():
        place = f"scenario.interpret.{name}"
        found.append(bound(place, f"{place}: it is as {table}({', '.join(columns)}) has it"))
    for node in world.frame.system.contract.nodes:
        for port in (*node.inputs, *node.outputs):
            role = "in" if port in node.inputs else "out"
            ranged = {f"{role}.{port.name}", f"{node.name}.{port.name}"} & {*scenario.domains, *scenario.interpret}
            if not ranged and port.sort not in world.domains and _is_sampled(port.sort):
                text = f"scenario: {node.name}.{port.name} has one of the values that are tried"
                found.append(bound(f"scenario.values.{node.name}.{port.name}", text))
    if world.frame.timed and STEP_LENGTH not in scenario.domains:
        found.append(bound("scenario.values.dt", "scenario: the time between steps is one that is tried"))
    return tuple(dict.fromkeys(found))


def _is_sampled(sort: s.Sort) -> bool:
    """Whether only some of a sort's values are tried, although no range for it is given."""
    if isinstance(sort, s.FunctionSort):
        return any(finite_values(part) is None for part in (*sort.parameters, sort.result))
    return finite_values(sort) is None


_KEYS: dict[int, tuple[FunctionValue, object]] = {}


def key(value: Value) -> object:
    """A key that is equal for equal values and quick to look up (functions hash poorly)."""
    if not isinstance(value, FunctionValue):
        return value
    if len(value.table) <= SMALL_TABLE:
        return _function_key(value)
    # Maps and plans occur many times as the same objects: their keys are computed once.
    known = _KEYS.get(id(value))
    if known is None or known[0] is not value:
        if len(_KEYS) > 10_000:
            _KEYS.clear()
        known = _KEYS[id(value)] = (value, _function_key(value))
    return known[1]


def _function_key(value: FunctionValue) -> object:
    return (frozenset((p, v) for p, v in value.table.items() if v != value.default), value.default)

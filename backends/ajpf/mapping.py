"""From contract formulas to properties of the agent, through the table that a person wrote in the plan.

Each row says which agent formula stands for which contract formula (the paper's mapping table). Parts that no row
covers, and parts that the scenario does not decide, are reported, never dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Span
from avow.evaluation.evaluate import NotEvaluable, evaluate, free_names
from avow.formulas.finite import interpretation, rows_of
from avow.formulas.formula import substitute
from avow.formulas.renaming import bound_names
from avow.formulas.values import FunctionValue, Value
from avow.language.contract import Node
from avow.language.printer import show_term
from avow.language.sorts import FunctionSort, IntegerSort, NaturalSort
from avow.language.subterms import subterms
from avow.language.terms import TRUE, And, Literal, Not, Or, Quantified, Quantifier, Role, Term, Variable
from avow.system.plan import Scenario

from . import psl
from .matching import Binding, choose, match
from .psl import Formula
from .psl_parser import Malformed, instantiate
from .shape import conjunction, conjuncts, disjunction, shape
from .tautology import constant


class NotCovered(Exception):  # noqa: N818 - it names what happened
    """No row of the table fits; `reason` is a clause for people."""

    def __init__(self, reason: str, span: Span | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.span = span


@dataclass(frozen=True, slots=True)
class Row:
    """``pattern`` (in normal form, with free `variables`) is mapped to `formula`."""

    text: str
    pattern: Term
    variables: frozenset[str]
    formula: Formula
    span: Span | None = None

    def say(self, values: Mapping[str, int]) -> str:
        """The pattern with numbers for its index variables, for people."""
        known = {t for t in subterms(self.pattern) if isinstance(t, Variable) and t.name in values}
        return show_term(substituted(self.pattern, {v: values[v.name] for v in known if v.role is Role.BOUND}))


@dataclass(frozen=True, slots=True)
class Unit:
    """The part that one row covered, mapped; `output` if the row is about an output."""

    formula: Formula
    output: bool
    forbids: bool = False
    """It only excludes values of an output: "eventually not" would be met by an agent that takes the excluded value."""
    term: Term = field(default=TRUE, compare=False)
    """The covered part, without its negation."""


@dataclass(frozen=True, slots=True)
class Junction:
    """`items` all (``and``) or one at least (``or``)."""

    all: bool
    items: tuple[Mapped, ...]


Mapped = Unit | Junction

Decide = Callable[[Term], bool | None]
"""The truth of a closed formula in the plan's scenario, or None if the scenario does not decide it."""

Range = Callable[[Variable], Sequence[int] | None]
"""The finite range of a quantified index variable, or None."""

YES = Junction(True, ())
NO = Junction(False, ())


@dataclass(slots=True)
class Mapper:
    rows: Sequence[Row]
    decide: Decide
    range_of: Range
    used: set[str] = field(default_factory=set)
    """The texts of the rows that covered something."""
    expanded: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """Index variables quantified within formulas, and their finite ranges."""
    granted: set[str] = field(default_factory=set)
    """Rows that covered something with a formula that is true (or false) for every agent."""
    constants: dict[Formula, bool | None] = field(default_factory=dict)
    words: dict[Formula, str] = field(default_factory=dict)
    """Formula of the agent → its meaning, as covered in the contract: for counterexamples."""

    def map(self, term: Term) -> Mapped:
        """A formula in normal form. Raises NotCovered."""
        match term:
            case Literal(value=value):
                return YES if value else NO
            case And() | Or():
                return self._junction(term)
            case Quantified():
                return self._quantified(term)
            case _:  # an atom: covered by a row, or NotCovered
                return self._atom(term)

    def _junction(self, term: And | Or) -> Mapped:
        is_and = isinstance(term, And)
        return _join(is_and, [made for made, _ in self._cover(term.items, is_and)])

    def _cover(self, items: Sequence[Term], is_and: bool) -> list[tuple[Mapped, tuple[Term, ...]]]:
        """Rows that span several items first, the longest before; then item by item."""
        found: list[tuple[Mapped, tuple[Term, ...]]] = []
        rest = list(items)
        kind = And if is_and else Or
        rows = [row for row in self.rows if isinstance(row.pattern, kind)]
        for row in sorted(rows, key=lambda row: -len(_items(row.pattern))):
            while True:
                taken = next(choose(_items(row.pattern), rest, row.variables, {}), None)
                if taken is None:
                    break
                binding, places = taken
                covered = tuple(rest[p] for p in places)
                whole = conjunction(list(covered)) if is_and else disjunction(list(covered))
                found.append((self._unit(row, binding, whole), covered))
                rest = [t for p, t in enumerate(rest) if p not in places]
        return found + [(self.map(item), (item,)) for item in rest]

    def _atom(self, term: Term) -> Mapped:
        made = self._at_once(term)
        if made is None and isinstance(term, Not):
            body = self._whole(term.body)
            made = _negated(body) if body is not None else None
        return made if made is not None else self._fail(term)

    def _whole(self, term: Term) -> Mapped | None:
        """By a row that covers just this."""
        for row in self.rows:
            binding = next(match(row.pattern, term, row.variables, {}), None)
            if binding is not None:
                return self._unit(row, binding, term)
        return None

    def _at_once(self, term: Term) -> Mapped | None:
        """By one row, or because the term is true or false for every agent."""
        made = self._whole(term)
        if made is not None:
            return made
        truth = self._decided(term)
        return None if truth is None else YES if truth else NO

    def _decided(self, term: Term) -> bool | None:
        return None if bound_names(term) else self.decide(term)

    def _quantified(self, term: Quantified) -> Mapped:
        made = self._at_once(term)
        if made is not None:
            return made
        if term.quantifier is Quantifier.UNIQUE:
            return self._fail(term)
        exists = term.quantifier is Quantifier.EXISTS
        denied = self._whole(shape(Not(term)))
        if denied is not None:  # a row for ``exists x: P`` covers ``forall x: not P`` too
            return _negated(denied)
        for variable in term.variables:
            if isinstance(variable.sort, IntegerSort | NaturalSort):
                return self._expanded(term, variable, exists)
        if not exists:
            # forall x: P  is  not exists x: not P
            inner = shape(Not(term))
            return _negated(self.map(inner)) if inner != term else self._fail(term)
        return self._block(term)

    def _fail(self, term: Term) -> Mapped:
        raise NotCovered(f"no mapping for {show_term(term)}", term.span or _first_span(term))

    def _expanded(self, term: Quantified, variable: Variable, exists: bool) -> Mapped:
        values = self.range_of(variable)
        if values is None:
            raise NotCovered(f"{variable.name} has no finite range here (options: instances)", term.span)
        self.expanded[variable.name] = tuple(values)
        rest = tuple(v for v in term.variables if v != variable)
        cases = []
        for value in values:
            body = substitute(term.body, {variable: Literal(value, variable.sort)})
            cases.append(shape(Quantified(term.quantifier, rest, body, term.span) if rest else body))
        return self.map(disjunction(cases) if exists else conjunction(cases))

    def _block(self, term: Quantified) -> Mapped:
        """``exists(x | P and Q)``: rows may not separate parts that share x."""
        names = {v.name for v in term.variables}
        items = conjuncts(term.body)
        static = [i for i in items if not bound_names(i) - names and not has_output(i)]
        if static:
            possible = Quantified(Quantifier.EXISTS, _used(term, static), conjunction(static), term.span)
            if self._decided(possible) is False:
                return NO
        made = self._cover(items, True)
        for name in names:
            joined = [m for m, covered in made if m != YES and any(name in bound_names(c) for c in covered)]
            if len(joined) > 1:
                raise NotCovered(
                    f"{name} joins parts of {show_term(term)} that different rows would cover; one row must cover both",
                    term.span or _first_span(term),
                )
        return _join(True, [m for m, _ in made])

    def _unit(self, row: Row, binding: Binding, term: Term) -> Mapped:
        self.used.add(row.text)
        values = {
            name: value.value
            for name, value in binding.items()
            if isinstance(value, Literal) and type(value.value) is int
        }
        try:
            formula = instantiate(row.formula, values)
        except Malformed as error:
            raise NotCovered(f"the row “{row.text}” cannot be used here: {error.reason}", row.span) from None
        truth = self._constant(formula)
        if truth is not None:
            self.granted.add(row.text)
            return YES if truth else NO
        meaning = row.say(values)
        if self.words.setdefault(formula, meaning) != meaning:  # the row omits an index: one formula for several
            self.words[formula] = row.say({})
        body = term.body if isinstance(term, Not) else term
        return Unit(formula, has_output(term), _only_forbids(term), body)

    def _constant(self, formula: Formula) -> bool | None:
        if formula not in self.constants:
            self.constants[formula] = None if psl.is_temporal(formula) else constant(formula)
        return self.constants[formula]


def _used(term: Quantified, items: Sequence[Term]) -> tuple[Variable, ...]:
    mentioned = {name for item in items for name in bound_names(item)}
    return tuple(v for v in term.variables if v.name in mentioned) or term.variables


def _items(pattern: Term) -> tuple[Term, ...]:
    return pattern.items if isinstance(pattern, And | Or) else (pattern,)


def has_output(term: Term) -> bool:
    return any(isinstance(t, Variable) and t.role is Role.OUTPUT for t in subterms(term))


def _only_forbids(term: Term) -> bool:
    """Whether a formula in normal form only excludes values of outputs."""
    match term:
        case Not(body=body):
            return has_output(body)
        case And(items=items) | Or(items=items):
            return has_output(term) and all(_only_forbids(item) for item in items if has_output(item))
        case Quantified(body=body):
            return _only_forbids(body)
        case _:  # an atom requires a value
            return False


def _first_span(term: Term) -> Span | None:
    return next((t.span for t in subterms(term) if t.span is not None), None)


def _join(all_: bool, items: Sequence[Mapped]) -> Mapped:
    unit, zero = (YES, NO) if all_ else (NO, YES)
    flat: list[Mapped] = []
    for item in items:
        pieces = item.items if isinstance(item, Junction) and item.all is all_ else (item,)
        for piece in pieces:
            if piece == zero:
                return zero
            if piece != unit and piece not in flat:
                flat.append(piece)
    return flat[0] if len(flat) == 1 else Junction(all_, tuple(flat))


def _negated(mapped: Mapped) -> Mapped:
    if isinstance(mapped, Unit):
        return replace(mapped, formula=psl.negation(mapped.formula), forbids=mapped.output and not mapped.forbids)
    return _join(not mapped.all, [_negated(item) for item in mapped.items])


def to_formula(mapped: Mapped) -> Formula:
    if isinstance(mapped, Unit):
        return mapped.formula
    made = [to_formula(item) for item in mapped.items]
    return psl.conjunction(made) if mapped.all else psl.disjunction(made)


def clauses(mapped: Mapped, limit: int = 64) -> list[tuple[Unit, ...]]:
    """Conjunctive normal form. Raises NotCovered if it is too large."""
    if isinstance(mapped, Unit):
        return [(mapped,)]
    if mapped.all:
        return [clause for item in mapped.items for clause in clauses(item, limit)]
    rows: list[tuple[Unit, ...]] = [()]
    for item in mapped.items:
        rows = [tuple(dict.fromkeys((*row, *clause))) for row in rows for clause in clauses(item, limit)]
        if len(rows) > limit:
            raise NotCovered("the guarantee's consequent multiplies out to too many cases")
    return rows


def substituted(term: Term, values: Mapping[Variable, int]) -> Term:
    """The formula with numbers for index variables."""
    return substitute(term, {v: Literal(n, v.sort) for v, n in values.items()}) if values else term


# Decisions by the plan's finite scenario


class Decider:
    """Decides closed formulas over interpreted inputs. Arguments outside a function's table have no value: no number
    that a contract can name equals it."""

    def __init__(self, job: Job) -> None:
        scenario = job.system.plan.scenario
        self.valuation: dict[str, Value] = _interpretations(job.node, scenario) if scenario else {}
        self._known: dict[Term, bool | None] = {}

    def __call__(self, term: Term) -> bool | None:
        if term not in self._known:
            self._known[term] = self._decide(term)
        return self._known[term]

    def _decide(self, term: Term) -> bool | None:
        names = free_names(term)
        if not names or not names <= self.valuation.keys():
            return None
        try:
            value = evaluate(term, self.valuation)
        except NotEvaluable:
            return None
        return value if isinstance(value, bool) else None


def range_of(
    variable: Variable, instances: Mapping[str, tuple[int, ...]], scenario: Scenario | None
) -> Sequence[int] | None:
    """The finite range of an index variable: the plan's instances, else the scenario's domain of its sort."""
    plain = variable.name.rstrip("'")
    for name in (variable.name, plain):
        if name in instances:
            return instances[name]
    return domain_of(variable, scenario)


def domain_of(variable: Variable, scenario: Scenario | None) -> Sequence[int] | None:
    """The scenario's domain of an index variable's sort."""
    names = ("NATURAL", "INTEGER") if isinstance(variable.sort, NaturalSort) else ("INTEGER",)
    for name in names:
        texts = scenario.domains.get(name) if scenario is not None else None
        if texts and all(text.isdigit() for text in texts):
            return tuple(dict.fromkeys(int(text) for text in texts))
    return None


def _interpretations(node: Node, scenario: Scenario) -> dict[str, Value]:
    """A relation holds at the table's rows; a function to whole numbers takes its last column as value there. (Other
    sorts have no value for "none".)"""
    found = {variable.qualified: value for variable, value in interpretation(node, scenario).items()}
    for port in node.inputs:
        sort = port.sort
        if isinstance(sort, FunctionSort) and isinstance(sort.result, IntegerSort | NaturalSort):
            rows = rows_of(node, port, (*sort.parameters, sort.result), scenario)
            if rows is not None:
                points = {row[:-1]: row[-1] for row in rows}
                lowest = min((v for v in points.values() if isinstance(v, int)), default=0)
                found[port.variable.qualified] = FunctionValue(points, min(-1, lowest - 1))
    return found

"""A clause with history as a formula of one step over cells.

A cell is what one step leaves to the next. Equal records share one. What speaks of a quantified variable is remembered
for each of its values: such a cell is a function. Responses are said by the past: `T -> within[n steps](R)` is broken
where T was met, R was not since, and that is n steps ago.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import assert_never

from avow.base.diagnostics import Span
from avow.formulas.formula import conjunction, digest, disjunction, free_variables, negation
from avow.language.contract import Clause, Node
from avow.language.sorts import (
    BOOL,
    INTEGER,
    NATURAL,
    REAL,
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    RealSort,
    SequenceSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.language.terms import (
    FALSE,
    RESPONSES,
    TRUE,
    Apply,
    Arithmetic,
    Builtin,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    History,
    Iff,
    Implies,
    Limit,
    Literal,
    Operation,
    Past,
    Quantified,
    Quantifier,
    Role,
    SequenceTerm,
    Term,
    TupleTerm,
    Variable,
    histories,
)

CELL = "#"
"""In the name of every cell, and in that of no port."""


class Unsaid(Exception):  # noqa: N818 - it names what happened
    """A clause that has no formula of one step; `reason` is for people."""

    def __init__(self, reason: str, span: Span | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.span = span


@dataclass(frozen=True, slots=True)
class Cell:
    """What one step leaves to the next."""

    before: Variable
    """What the step before has left: a function of the `parameters`, where there are some. Its name says which record
    it is of, so that a formula that reads it has another digest where the record is another."""
    parameters: tuple[Variable, ...]
    initial: Term | None
    """What it is before the first step, at every argument; None: any value, which nothing looks at."""
    now: Term
    """What this step leaves, at the `parameters`: over the node's ports and what the step before has left."""
    record: History | None = field(default=None, compare=False, repr=False)
    """What it is kept for; None of whether a step is the first."""

    @property
    def name(self) -> str:
        return self.before.name

    @property
    def sort(self) -> Sort:
        return self.before.sort

    @property
    def read(self) -> Term:
        """What the step before has left at the `parameters`."""
        return _at(self.before, self.parameters)

    def begins(self, cell: Variable | None = None) -> Term:
        """That a variable (the cell's own) is as the cell is before the first step."""
        if self.initial is None:
            return TRUE
        return self._everywhere(_equal(_at(cell or self.before, self.parameters), self.initial))

    def leaves(self, after: Variable) -> Term:
        """That a variable is what this step leaves."""
        return self._everywhere(_equal(_at(after, self.parameters), self.now))

    def _everywhere(self, formula: Term) -> Term:
        return Quantified(Quantifier.FORALL, self.parameters, formula) if self.parameters else formula


@dataclass(frozen=True, slots=True)
class Remembering:
    """A node whose clauses are formulas of one step over its ports and what `cells` have kept; names, sentences and
    texts of the clauses are as they were."""

    node: Node
    cells: tuple[Cell, ...]
    unsaid: Mapping[str, Unsaid] = field(default_factory=dict)
    """The clauses that speak of other steps all the same, each with the reason."""

    @property
    def before(self) -> tuple[Variable, ...]:
        return tuple(cell.before for cell in self.cells)


def remembers(node: Node) -> bool:
    """Whether a clause of the node speaks of other steps."""
    return any(histories(clause.formula) for clause in node.clauses)


def compile_node(node: Node) -> Remembering:
    """The node's clauses as formulas of one step. What has none is left as it is, and told of."""
    records = Records()
    unsaid: dict[str, Unsaid] = {}

    def said(clauses: Iterable[Clause]) -> Iterator[Clause]:
        for clause in clauses:
            try:
                yield replace(clause, formula=records.clause(clause.formula)) if histories(clause.formula) else clause
            except Unsaid as reason:
                unsaid[clause.name] = reason
                yield clause

    assumptions, guarantees = tuple(said(node.assumptions)), tuple(said(node.guarantees))
    compiled = replace(node, assumptions=assumptions, guarantees=guarantees)
    return Remembering(compiled, tuple(records.cells), unsaid)


@dataclass(slots=True)
class Records:
    """The cells of some formulas, made as they are asked for."""

    cells: list[Cell] = field(default_factory=list)
    _values: dict[str, Term] = field(default_factory=dict)
    _first: Cell | None = None

    def clause(self, formula: Term) -> Term:
        """A clause, which may be a response, as a formula of one step. Raises Unsaid, and has then made no cell."""
        cells, values, first = len(self.cells), dict(self._values), self._first
        try:
            return self.term(in_the_past(formula))
        except Unsaid:
            del self.cells[cells:]
            self._values, self._first = values, first
            raise

    def term(self, term: Term) -> Term:
        """A term of the past as one of this step. Raises Unsaid."""
        if isinstance(term, History):
            meaning = digest(term)  # what means the same has one cell: a cell is named by its meaning
            if meaning not in self._values:
                self._values[meaning] = self._record(term)
            return self._values[meaning]
        parts = term.children
        made = tuple(map(self.term, parts))
        return term if all(one is other for one, other in zip(parts, made, strict=True)) else term.rebuild(made)

    def _record(self, term: History) -> Term:
        parts = tuple(map(self.term, term.arguments))
        amount = self._amount(term)
        match term.operator:
            case Past.PREVIOUS:
                value, first = parts
                if not free_variables(first):
                    return self._cell(term, value, first, term.sort).read
                before = self._cell(term, value, some_value(term.sort), term.sort).read
                return Conditional(self._is_first(), first, before, term.sort)
            case Past.ROSE:
                return conjunction((parts[0], negation(self._cell(term, parts[0], FALSE).read)))
            case Past.FELL:
                return conjunction((negation(parts[0]), self._cell(term, parts[0], FALSE).read))
            case Past.CHANGED:
                before = self._cell(term, parts[0], some_value(parts[0].sort)).read
                return conjunction((negation(self._is_first()), negation(_equal(parts[0], before))))
            case Past.ONCE if amount is None:
                return self._kept(term, BOOL, FALSE, lambda before: disjunction((parts[0], before)))
            case Past.HISTORICALLY if amount is None:
                return self._kept(term, BOOL, TRUE, lambda before: conjunction((parts[0], before)))
            case Past.SINCE if amount is None:
                holds, began = parts
                return self._kept(term, BOOL, FALSE, lambda b: disjunction((began, conjunction((holds, b)))))
            case Past.COUNTED:
                holds, began = parts
                return self._kept(term, NATURAL, _ZERO, lambda b: _if(began, _ZERO, _if(holds, _plus_one(b), b)))
            case Past.ONCE:
                assert amount is not None
                return self._latest(term, TRUE, parts[0], "<=", amount)
            case Past.HISTORICALLY:
                assert amount is not None
                return negation(self._latest(term, TRUE, negation(parts[0]), "<=", amount))
            case Past.HELD:
                assert amount is not None
                return self._earliest(term, parts[0], parts[0], ">=", amount)
            case Past.SINCE:
                assert amount is not None
                assert term.limit is not None
                (holds, began), relation = parts, term.limit.relation
                age = self._earliest if relation in (">", ">=") else self._latest
                return age(term, holds, began, relation, amount)
            case Past.NEXT | Past.WITHIN | Past.FOR | Past.UNTIL | Past.EVENTUALLY:
                raise Unsaid(f"`{term.operator}` in a place where no response stands", term.span)
            case _:
                assert_never(term.operator)

    def _amount(self, term: History) -> Term | None:
        if term.limit is None:
            return None
        if not term.limit.steps:
            raise Unsaid(f"`{term.operator}` with a limit in seconds", term.span)
        return self.term(term.limit.amount)

    def _latest(self, term: History, holds: Term, began: Term, relation: str, amount: Term) -> Term:
        """``holds since[<= amount] began``: the cell has how many steps ago the latest beginning is, -1 for none. One
        that is older than a limit that is written down is as good as none."""
        most = written(amount)

        def age(before: Term) -> Term:
            young = [Compare("<=", _ZERO, before)]
            if most is not None:
                young.append(Compare("<", before, Literal(most, INTEGER)))
            return _if(began, _ZERO, _if(conjunction((holds, *young)), _plus_one(before), _NONE))

        found = self._kept(term, INTEGER, _NONE, age)
        return conjunction((Compare("<=", _ZERO, found), Compare(relation, found, amount)))

    def _earliest(self, term: History, holds: Term, began: Term, relation: str, amount: Term) -> Term:
        """``holds since[>= amount] began``: the cell has how many steps ago the earliest beginning is, -1 for none.
        Beyond a limit that is written down it stays."""
        most = written(amount)

        def age(before: Term) -> Term:
            older = _plus_one(before)
            if most is not None:
                older = Operation(Builtin.MIN, (older, Literal(max(most + 1, 0), INTEGER)), INTEGER)
            return _if(conjunction((holds, Compare("<=", _ZERO, before))), older, _if(began, _ZERO, _NONE))

        found = self._kept(term, INTEGER, _NONE, age)
        return conjunction((Compare("<=", _ZERO, found), Compare(relation, found, amount)))

    def _kept(self, term: History, sort: Sort, initial: Term, now: Callable[[Term], Term]) -> Term:
        """What a step leaves, as a function of what the one before has left: also the value now."""
        cell = self._cell(term, now, initial, sort)
        return cell.now

    def _is_first(self) -> Term:
        """Whether this is the first step."""
        if self._first is None:
            self._first = Cell(Variable(Role.INPUT, f"first step{CELL}", BOOL), (), TRUE, FALSE)
            self.cells.append(self._first)
        return self._first.read

    def _cell(
        self, term: History, now: Term | Callable[[Term], Term], initial: Term | None, sort: Sort | None = None
    ) -> Cell:
        """A new cell for a record; `now` is what a step leaves, or makes that of what the one before has left."""
        bound = {v for part in term.children for v in free_variables(part) if v.role is Role.BOUND}
        parameters = tuple(sorted(bound, key=lambda v: v.name))
        if sort is None:
            assert not callable(now)
            sort = now.sort
        kept = FunctionSort(tuple(v.sort for v in parameters), sort) if parameters else sort
        before = Variable(Role.INPUT, f"{term.operator}{CELL}{digest(term)[:12]}", kept)
        read = _at(before, parameters)
        cell = Cell(before, parameters, initial, now(read) if callable(now) else now, term)
        self.cells.append(cell)
        return cell


def in_the_past(formula: Term) -> Term:
    """A clause without responses: what it demands of later steps, said of earlier ones. Raises Unsaid where it demands
    that something comes at some time, which no first steps of a run can break."""
    match formula:
        case Quantified(quantifier=Quantifier.FORALL):
            return formula.rebuild((in_the_past(formula.body),))
        case Implies() | History() if (found := _response(formula)) is not None:
            triggers, response = found
            return _demanded(conjunction(triggers), response)
        case _:  # it has none
            return formula


def _response(formula: Term) -> tuple[list[Term], History] | None:
    """What stands before a response that is a formula's right side, and the response; None where there is none."""
    triggers = list[Term]()
    while isinstance(formula, Implies):
        triggers.append(formula.left)
        formula = formula.right
    return (triggers, formula) if isinstance(formula, History) and formula.operator in RESPONSES else None


def _demanded(trigger: Term, response: History) -> Term:
    wanted, limit, span = response.arguments[0], response.limit, response.span
    match response.operator:
        case Past.NEXT:
            return Implies(History(Past.PREVIOUS, (trigger, FALSE), BOOL, None, span), wanted, span)
        case Past.WITHIN:
            assert limit is not None
            late = Limit(">=" if limit.steps else ">", limit.amount, limit.steps)
            unmet = negation(wanted)
            return negation(History(Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL, late, span))
        case Past.FOR:
            return Implies(History(Past.ONCE, (trigger,), BOOL, limit, span), wanted, span)
        case Past.UNTIL:
            ended = response.arguments[1]
            waiting = conjunction((trigger, negation(ended)))
            return Implies(History(Past.SINCE, (negation(ended), waiting), BOOL, None, span), wanted, span)
        case _:
            raise Unsaid(f"`{response.operator}`, which no first steps of a run can break", span)


def pending(formula: Term) -> Term | None:
    """When a clause that is a response demands something of steps to come, as a formula of the past; None where it is
    no response, or one that no first steps can break."""
    if (found := _response(_unquantified(formula))) is None:
        return None
    trigger, response = conjunction(found[0]), found[1]
    match response.operator:
        case Past.NEXT:
            return trigger
        case Past.WITHIN | Past.FOR:
            assert response.limit is not None
            early = replace(response.limit, relation="<")
            unmet = negation(response.arguments[0]) if response.operator is Past.WITHIN else TRUE
            return History(Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL, early, response.span)
        case Past.UNTIL:
            going = negation(response.arguments[1])
            return History(Past.SINCE, (going, conjunction((trigger, going))), BOOL, None, response.span)
        case _:  # it comes at some time
            return None


@dataclass(frozen=True, slots=True)
class Due:
    """``T -> next(R)`` and its like: `triggers` together are T, `outer` the quantified variables around it."""

    outer: tuple[Variable, ...]
    triggers: tuple[Term, ...]
    full: Term
    """That all of what a trigger demands has come due, of some trigger, as a formula of the past."""


def due(formula: Term) -> Due | None:
    """When a clause that is a response demands something; None of other clauses."""
    found = responding(formula)
    if found is None:
        return None
    outer, triggers, response = found
    full = conjunction(triggers)
    match response.operator:
        case Past.NEXT:
            full = History(Past.PREVIOUS, (full, FALSE), BOOL)
        case Past.WITHIN | Past.FOR:
            assert response.limit is not None
            full = History(Past.SINCE, (TRUE, full), BOOL, replace(response.limit, relation=">="))
        case _:  # with the trigger
            pass
    return Due(outer, triggers, full)


def responding(formula: Term) -> tuple[tuple[Variable, ...], tuple[Term, ...], History] | None:
    """Of a clause that is a response: the variables of the quantifiers around it, what triggers it, and the response;
    None of other clauses."""
    outer = list[Variable]()
    while isinstance(formula, Quantified) and formula.quantifier is Quantifier.FORALL:
        outer.extend(formula.variables)
        formula = formula.body
    found = _response(formula)
    return None if found is None else (tuple(outer), tuple(found[0]), found[1])


def fulfilled(formula: Term) -> Term | None:
    """When a clause ``T -> within[…](R)`` is met, as a formula of the past; None of other clauses."""
    found = _response(_unquantified(formula))
    if found is None or found[1].operator is not Past.WITHIN:
        return None
    trigger, wanted = conjunction(found[0]), found[1].arguments[0]
    unmet = negation(wanted)
    waiting = History(Past.SINCE, (unmet, conjunction((trigger, unmet))), BOOL)
    return conjunction((wanted, disjunction((trigger, History(Past.PREVIOUS, (waiting, FALSE), BOOL)))))


def _unquantified(formula: Term) -> Term:
    while isinstance(formula, Quantified) and formula.quantifier is Quantifier.FORALL:
        formula = formula.body
    return formula


def written(amount: Term) -> int | None:
    """A number of steps that is written down."""
    value = amount.value if isinstance(amount, Literal) else None
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def longest_limits(formulas: Iterable[Term]) -> int:
    """The most steps that the limits in one formula come to together, of those that are written down."""
    totals = (
        sum(max(0, written(h.limit.amount) or 0) for h in histories(formula) if h.limit is not None)
        for formula in formulas
    )
    return max(totals, default=0)


def some_value(sort: Sort) -> Term | None:
    """A value of a sort, written down; None of an unspecified type, which has no name for one, and of functions."""
    match sort:
        case BoolSort():
            return FALSE
        case NaturalSort() | IntegerSort():
            return Literal(0, NATURAL)
        case RealSort():
            return Literal(Fraction(0), REAL)
        case StringSort():
            return Literal("", sort)
        case EnumSort(members=(first, *_)):
            return EnumValue(first, sort)
        case SequenceSort():
            return SequenceTerm((), sort)
        case TupleSort(items=items):
            parts = tuple(map(some_value, items))
            return TupleTerm(tuple(p for p in parts if p is not None), sort) if None not in parts else None
        case DataSort(constructors=constructors):
            for made in constructors:
                arguments = tuple(map(some_value, made.parameters))
                if None not in arguments:
                    return Construct(made.name, tuple(a for a in arguments if a is not None), sort)
            return None
        case _:  # nothing is known of it
            return None


_ZERO, _NONE, _ONE = Literal(0, NATURAL), Literal(-1, INTEGER), Literal(1, NATURAL)


def _if(condition: Term, then: Term, otherwise: Term) -> Term:
    sort = then.sort if then.sort == otherwise.sort else INTEGER
    return Conditional(condition, then, otherwise, sort)


def _plus_one(term: Term) -> Term:
    return Arithmetic("+", term, _ONE, term.sort)


def _equal(left: Term, right: Term) -> Term:
    return Iff(left, right) if left.sort == BOOL else Compare("==", left, right)


def _at(variable: Variable, parameters: tuple[Variable, ...]) -> Term:
    sort = variable.sort
    return Apply(variable, parameters, sort.result) if parameters and isinstance(sort, FunctionSort) else variable

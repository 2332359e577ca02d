"""A clause with history as a formula of one step over state variables (cells).

A cell holds a value that one step leaves to the next. Equal records share one. A record that mentions a quantified
variable is kept for each of its values: such a cell is a function.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field, replace
from typing import assert_never

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, digest, disjunction, equation, free_variables, negation
from avow.formulas.temporal.cell import CELL, Cell, Unsaid, at, at_the_parameters, some_value
from avow.formulas.temporal.responses import in_the_past
from avow.language import terms as t
from avow.language.contract import Clause, Node
from avow.language.definedness import defined
from avow.language.sorts import BOOL, INTEGER, NATURAL, Sort
from avow.language.subterms import counts_steps, histories


@dataclass(frozen=True, slots=True)
class Remembering:
    """A node whose clauses are formulas of one step over its ports and the values of `cells`; names, sentences and
    texts of the clauses are unchanged."""

    node: Node
    cells: tuple[Cell, ...]
    unsaid: Mapping[str, Unsaid] = field(default_factory=dict)
    """The clauses that still refer to other steps, each with the reason."""

    @property
    def before(self) -> tuple[t.Variable, ...]:
        return tuple(cell.before for cell in self.cells)


def remembers(node: Node) -> bool:
    """Whether a clause of the node refers to other steps."""
    return any(histories(clause.formula) for clause in node.clauses)


def compile_node(node: Node) -> Remembering:
    """The node's clauses as formulas of one step. A clause without such a form is unchanged and listed in `unsaid`; so
    is one with limits in seconds (which `avow.formulas.temporal.clock` handles, too)."""
    return compiled(node, Records())


def compiled(node: Node, records: Records) -> Remembering:
    """The node's clauses compiled with `records`, which must not have made cells for other clauses."""
    unsaid: dict[str, Unsaid] = {}

    def rewritten(clauses: Iterable[Clause]) -> Iterator[Clause]:
        for clause in clauses:
            try:
                yield replace(clause, formula=records.clause(clause.formula)) if histories(clause.formula) else clause
            except Unsaid as reason:
                unsaid[clause.name] = reason
                yield clause

    assumptions, guarantees = tuple(rewritten(node.assumptions)), tuple(rewritten(node.guarantees))
    compiled = replace(node, assumptions=assumptions, guarantees=guarantees)
    return Remembering(compiled, tuple(records.cells), unsaid)


@dataclass(slots=True)
class Records:
    """The cells of some formulas, made on demand."""

    apart: str = ""
    """Why limits in steps have no common meaning, if they have none."""
    cells: list[Cell] = field(default_factory=list)
    _values: dict[str, t.Term] = field(default_factory=dict)
    _first: Cell | None = None

    def clause(self, formula: t.Term) -> t.Term:
        """A clause, which may be a response, as a formula of one step. Raises Unsaid without having made a cell."""
        if self.apart and counts_steps(formula):
            raise Unsaid(self.apart)
        with self._undone():
            return self.term(in_the_past(formula))

    @contextmanager
    def _undone(self) -> Iterator[None]:
        """Remove the cells made inside if a clause has no formula of one step."""
        cells, values, first = len(self.cells), dict(self._values), self._first
        try:
            yield
        except Unsaid:
            del self.cells[cells:]
            self._values, self._first = values, first
            raise

    def term(self, term: t.Term) -> t.Term:
        """A past-time term as a term of this step. Raises Unsaid."""
        if isinstance(term, t.History):
            meaning = digest(term)  # equal meanings share a cell, which is named by its meaning
            if meaning not in self._values:
                self._values[meaning] = self._record(term)
            return self._values[meaning]
        parts = term.children
        made = tuple(map(self.term, parts))
        return term if all(one is other for one, other in zip(parts, made, strict=True)) else term.rebuild(made)

    def _record(self, term: t.History) -> t.Term:
        parts = tuple(map(self.term, term.arguments))
        amount = self._amount(term)
        match term.operator:
            case t.Past.PREVIOUS:
                value, first = _with_any_value(parts[0]), parts[1]
                if not free_variables(first):
                    return self._cell(term, value, first, term.sort).read
                before = self._cell(term, value, some_value(term.sort), term.sort).read
                return t.Conditional(self._is_first(), first, before, term.sort)
            case t.Past.ROSE:
                return conjunction((parts[0], negation(self._cell(term, parts[0], t.FALSE).read)))
            case t.Past.FELL:
                return conjunction((negation(parts[0]), self._cell(term, parts[0], t.FALSE).read))
            case t.Past.CHANGED:
                before = self._cell(term, _with_any_value(parts[0]), some_value(parts[0].sort)).read
                return conjunction((negation(self._is_first()), negation(equation(parts[0], before))))
            case t.Past.ONCE if amount is None:
                return self._kept(term, BOOL, t.FALSE, lambda before: disjunction((parts[0], before)))
            case t.Past.HISTORICALLY if amount is None:
                return self._kept(term, BOOL, t.TRUE, lambda before: conjunction((parts[0], before)))
            case t.Past.SINCE if amount is None:
                holds, began = parts
                return self._kept(term, BOOL, t.FALSE, lambda b: disjunction((began, conjunction((holds, b)))))
            case t.Past.COUNTED:
                holds, began = parts
                return self._kept(term, NATURAL, _ZERO, lambda b: _if(began, _ZERO, _if(holds, _plus_one(b), b)))
            case t.Past.ONCE:
                assert amount is not None
                return self._latest(term, t.TRUE, parts[0], "<=", amount)
            case t.Past.HISTORICALLY:
                assert amount is not None
                return negation(self._latest(term, t.TRUE, negation(parts[0]), "<=", amount))
            case t.Past.HELD:
                assert amount is not None
                return self._earliest(term, parts[0], parts[0], ">=", amount)
            case t.Past.SINCE:
                assert amount is not None
                assert term.limit is not None
                (holds, began), relation = parts, term.limit.relation
                age = self._earliest if relation in (">", ">=") else self._latest
                return age(term, holds, began, relation, amount)
            case t.Past.ARRIVED | t.Past.STEPS:
                raise Unsaid(f"`{term.operator}`, which is no matter of steps alone", term.span)
            case t.Past.NEXT | t.Past.WITHIN | t.Past.FOR | t.Past.UNTIL | t.Past.EVENTUALLY:
                raise Unsaid(f"`{term.operator}` in a place where no response stands", term.span)
            case _:
                assert_never(term.operator)

    def _amount(self, term: t.History) -> t.Literal | None:
        if term.limit is None:
            return None
        if not term.limit.steps:
            raise Unsaid(self.apart or f"`{term.operator}` with a limit in seconds", term.span)
        return term.limit.amount

    def _latest(self, term: t.History, holds: t.Term, began: t.Term, relation: str, amount: t.Literal) -> t.Term:
        """``holds since[<= amount] began``: the cell counts the steps since the latest beginning, -1 for none. A
        beginning older than the limit counts as none."""

        def age(before: t.Term) -> t.Term:
            young = (t.Compare("<=", _ZERO, before), t.Compare("<", before, t.Literal(amount.value, INTEGER)))
            return _if(began, _ZERO, _if(conjunction((holds, *young)), _plus_one(before), _NONE))

        found = self._kept(term, INTEGER, _NONE, age)
        return conjunction((t.Compare("<=", _ZERO, found), t.Compare(relation, found, amount)))

    def _earliest(self, term: t.History, holds: t.Term, began: t.Term, relation: str, amount: t.Literal) -> t.Term:
        """``holds since[>= amount] began``: the cell counts the steps since the earliest beginning, -1 for none. It
        stops growing beyond the limit."""

        def age(before: t.Term) -> t.Term:
            most = t.Literal(int(amount.value) + 1, INTEGER)
            older = t.Operation(t.Builtin.MIN, (_plus_one(before), most), INTEGER)
            return _if(conjunction((holds, t.Compare("<=", _ZERO, before))), older, _if(began, _ZERO, _NONE))

        found = self._kept(term, INTEGER, _NONE, age)
        return conjunction((t.Compare("<=", _ZERO, found), t.Compare(relation, found, amount)))

    def _kept(self, term: t.History, sort: Sort, initial: t.Term, now: Callable[[t.Term], t.Term]) -> t.Term:
        """The value that a step leaves, as a function of the value left by the previous one; also the value now."""
        cell = self._cell(term, now, initial, sort)
        return cell.now

    def _named(self, term: t.History) -> str:
        """The name of a record's cell."""
        return f"{term.operator}{CELL}{digest(term)[:12]}"

    def _is_first(self) -> t.Term:
        """Whether this is the first step."""
        if self._first is None:
            self._first = Cell(t.Variable(t.Role.INPUT, f"first step{CELL}", BOOL), (), t.TRUE, t.FALSE)
            self.cells.append(self._first)
        return self._first.read

    def _cell(
        self,
        term: t.History,
        now: t.Term | Callable[[t.Term], t.Term],
        initial: t.Term | None,
        sort: Sort | None = None,
    ) -> Cell:
        """A new cell for a record; `now` is the value that a step leaves, or computes it from the value left by the
        previous step."""
        if sort is None:
            assert not callable(now)
            sort = now.sort
        before, parameters = at_the_parameters(self._named(term), term.children, sort)
        read = at(before, parameters)
        cell = Cell(before, parameters, initial, now(read) if callable(now) else now, term)
        self.cells.append(cell)
        return cell


def longest_limits(formulas: Iterable[t.Term]) -> int:
    """The largest sum of the limits in steps in one formula."""
    totals = (
        sum(int(h.limit.number) for h in histories(formula) if h.limit is not None and h.limit.steps)
        for formula in formulas
    )
    return max(totals, default=0)


_ZERO, _NONE, _ONE = t.Literal(0, NATURAL), t.Literal(-1, INTEGER), t.Literal(1, NATURAL)


def _if(condition: t.Term, then: t.Term, otherwise: t.Term) -> t.Term:
    sort = then.sort if then.sort == otherwise.sort else INTEGER
    return t.Conditional(condition, then, otherwise, sort)


def _with_any_value(term: t.Term) -> t.Term:
    """The value of a term that is kept for the next step: an arbitrary value if the term has none, so that every run
    can be judged. A claim that reads an arbitrary value is not met (`avow.language.definedness`)."""
    has, otherwise = defined(term), some_value(term.sort)
    return term if term.sort == BOOL or has == t.TRUE or otherwise is None else _if(has, term, otherwise)


def _plus_one(term: t.Term) -> t.Term:
    return t.Arithmetic("+", term, _ONE, term.sort)

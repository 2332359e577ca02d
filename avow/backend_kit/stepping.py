"""A stateful program and a contract with state variables, as one step of a larger node.

The program's state and the contract's state variables (cells), as the previous step left them, are inputs of that node;
the program's state after the step is an output. An *invariant* links the two: it holds before the first step, and a
step keeps it, so that it is an assumption of every step. Each guarantee is then about a single step.

Invariants come from the plan or are guesses; the largest set of guesses that a step keeps is used. A state variable is
a definition: its value needs no proof.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.base.tuning.bounds import COUNTS_GUESSED
from avow.formulas.formula import equation, free_variables, substitute
from avow.formulas.temporal.cell import Cell, Unsaid
from avow.formulas.temporal.cells import Records
from avow.formulas.traversal import transform
from avow.language import terms as t
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port
from avow.language.definedness import with_value
from avow.language.load import NOTHING, parse_formula
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, EnumSort, Sort
from avow.language.subterms import subterms

_NUMBERS: tuple[Sort, ...] = (NATURAL, INTEGER, REAL)


@dataclass(frozen=True, slots=True)
class Held:
    """A part of a program's state; `initial` is its value before the first step, without variables."""

    name: str
    sort: Sort
    initial: t.Term

    @property
    def before(self) -> t.Variable:
        return t.Variable(t.Role.INPUT, self.name, self.sort)

    @property
    def after(self) -> t.Variable:
        return t.Variable(t.Role.OUTPUT, self.name, self.sort)


@dataclass(frozen=True, slots=True)
class Invariant:
    """What holds before every step, over the contract's and the program's state."""

    text: str
    formula: t.Term
    span: Span | None = None
    guessed: bool = False


@dataclass(frozen=True, slots=True)
class Stepping:
    """A node's steps, as those of a larger one."""

    own: Node
    """The contract's."""
    node: Node
    """Its clauses as formulas of one step; the ports include the contract's and the program's state."""
    cells: tuple[Cell, ...]
    held: tuple[Held, ...]
    invariants: tuple[Invariant, ...]

    def first(self, formula: t.Term) -> t.Term:
        """A formula over state, before the first step."""
        values = {h.before: h.initial for h in self.held}
        return self._at(formula, values, {c: c.initial for c in self.cells if c.initial is not None})

    def after(self, formula: t.Term) -> t.Term:
        """The same after this step, over the node's ports."""
        return self._at(formula, {h.before: h.after for h in self.held}, {c: c.now for c in self.cells})

    def _at(self, formula: t.Term, held: Mapping[t.Variable, t.Term], cells: Mapping[Cell, t.Term]) -> t.Term:
        """The formula with other terms for all state at once."""
        functions = {c: replace(c.before, name=f"{c.name}'") for c in cells if c.parameters}
        plain = {c.before: term for c, term in cells.items() if not c.parameters}
        made = substitute(formula, {**held, **plain, **{c.before: name for c, name in functions.items()}})
        return _applied(made, {name: (c.parameters, cells[c]) for c, name in functions.items()})

    def knowing(self, invariants: Iterable[Invariant]) -> Node:
        """The larger node, with invariants among its assumptions."""
        more = tuple(
            Clause(ClauseKind.ASSUMPTION, f"invariant {k}", 0, i.formula, None, i.text, i.span or self.node.span)
            for k, i in enumerate(invariants, start=1)
        )
        return replace(self.node, assumptions=(*self.node.assumptions, *more))


def stepping(
    node: Node,
    names: Iterable[str],
    held: Sequence[Held] = (),
    stated: Iterable[tuple[str, Span]] = (),
    contract: Contract = NOTHING,
) -> Stepping:
    """The steps of a node whose guarantees `names` are checked. `stated` are the plan's invariants, each with its
    place: RCL about the program's state, by name, and about earlier steps (``previous(…)``, …). Raises Rejected (code
    ``BACKEND007``)."""
    records = Records()
    wanted = frozenset(names)

    def said(clause: Clause) -> Clause:
        return replace(clause, formula=records.clause(clause.formula))

    assumptions = tuple(map(said, node.assumptions))
    guarantees = tuple(said(clause) if clause.name in wanted else clause for clause in node.guarantees)
    taken = {port.name for port in (*node.inputs, *node.outputs)}
    for each in held:
        if each.name in taken:
            message = f"`{each.name}` is a port of {node.name}: what the program keeps needs another name"
            raise Rejected(Diagnostic("BACKEND007", message, node.span))
    invariants = tuple(_stated(text, span, contract, node, held, records) for text, span in stated)
    ports = [Port(v.role, v.name, v.sort, "", None) for h in held for v in (h.before, h.after)]
    cells = [Port(t.Role.INPUT, c.name, c.sort, "", None) for c in records.cells]
    larger = replace(
        node,
        inputs=(*node.inputs, *(p for p in ports if p.role is t.Role.INPUT), *cells),
        outputs=(*node.outputs, *(p for p in ports if p.role is t.Role.OUTPUT)),
        assumptions=assumptions,
        guarantees=guarantees,
    )
    return Stepping(node, larger, tuple(records.cells), tuple(held), invariants)


def _stated(text: str, span: Span, contract: Contract, node: Node, held: Sequence[Held], records: Records) -> Invariant:
    extra = {each.name: each.sort for each in held}
    formula = with_value(parse_formula(text, node, contract, span, extra, remembers=True))
    try:
        formula = records.term(formula)
    except Unsaid as unsaid:
        raise Rejected(Diagnostic("BACKEND007", f"the invariant speaks of {unsaid.reason}", span)) from unsaid
    formula = substitute(formula, {t.Variable(t.Role.BOUND, h.name, h.sort): h.before for h in held})
    known = {*(h.before for h in held), *(c.before for c in records.cells)}
    foreign = sorted(free_variables(formula) - known, key=lambda v: v.qualified)
    if foreign:
        message = f"the invariant is about what was before a step, and speaks of {foreign[0].qualified} at that step"
        hint = f"previous({foreign[0].qualified}, …) is its value before"
        raise Rejected(Diagnostic("BACKEND007", message, span, hint=hint))
    return Invariant(text, formula, span)


def _applied(term: t.Term, functions: Mapping[t.Variable, tuple[tuple[t.Variable, ...], t.Term]]) -> t.Term:
    """The term with functions that are given by terms applied."""

    def applied(part: t.Term) -> t.Term:
        if isinstance(part, t.Apply) and isinstance(part.function, t.Variable) and part.function in functions:
            parameters, body = functions[part.function]
            return substitute(body, dict(zip(parameters, part.arguments, strict=True)))
        return part

    return transform(term, applied) if functions else term


# -- guesses ----------------------------------------------------------------------------------------------------------


def guesses(steps: Stepping) -> Iterator[tuple[Invariant, ...]]:
    """Common links between a program's state and a contract's: initial values, ranges, equal counters or conditions.
    Each in its forms, the strongest first; most are wrong."""
    for forms in dict.fromkeys(_families(steps)):
        yield tuple(Invariant("", formula, None, True) for formula in forms)


def _families(steps: Stepping) -> Iterator[tuple[t.Term, ...]]:
    first = next((c for c in steps.cells if c.initial == t.TRUE and c.now == t.FALSE), None)
    if first is not None:
        yield from ((t.Implies(first.before, c.begins()),) for c in steps.cells if c.initial is not None and c != first)
        yield from ((t.Implies(first.before, equation(h.before, h.initial)),) for h in steps.held)
    cells = [c for c in steps.cells if not c.parameters]
    numbers = [c for c in cells if c.sort in _NUMBERS]
    for cell in (c for c in numbers if c.sort == INTEGER):
        yield (t.Compare("<=", _number(-1), cell.before),)
        yield tuple(t.Compare("<=", cell.before, _number(n)) for n in sorted(_limits(cell)))
    for each in (h for h in steps.held if h.sort in _NUMBERS):
        yield from ((t.Compare(sign, each.before, each.initial),) for sign in (">=", "<="))
        yield from (tuple(_counters(each.before, cell)) for cell in numbers)
    for k, a in enumerate(cells):
        yield from ((equation(a.before, b.before),) for b in cells[:k] if a.sort == b.sort)
    for h in steps.held:
        yield from ((equation(h.before, c.before),) for c in cells if c.sort == h.sort and c.sort not in _NUMBERS)
    for held in steps.held:
        for one in _conditions(held.before):
            yield from _agreeing(one, (other for c in cells for other in _conditions(c.before)))
    plain = [(c, next(_conditions(c.before), None)) for c in cells]
    for k, (_, condition) in enumerate(plain):
        if condition is not None:
            yield from _agreeing(condition, (other for _, other in plain[:k] if other is not None))


def _agreeing(one: t.Term, others: Iterable[t.Term]) -> Iterator[tuple[t.Term, ...]]:
    """That two conditions are equivalent, or that one or its negation follows from the other."""
    for other in others:
        yield t.Iff(one, other), t.Implies(other, one), t.Implies(other, t.Not(one))
        yield t.Iff(one, t.Not(other)), t.Implies(one, other), t.Implies(t.Not(one), other)


def _counters(counter: t.Variable, cell: Cell) -> Iterator[t.Term]:
    """A counter of the program and a number among the contract's state variables, which starts at 0 or (a timer) at
    -1."""
    ages = cell.sort == INTEGER
    value: t.Term = t.Arithmetic("+", cell.before, _number(1), INTEGER) if ages else cell.before
    if (counter.sort == REAL) != (cell.sort == REAL):
        return
    yield t.Compare("==", counter, value)
    yield t.Compare("==", counter, cell.before)
    if counter.sort != REAL:
        bounds = sorted({n + d for n in _limits(cell) for d in (0, 1, 2)} | set(range(1, COUNTS_GUESSED)), reverse=True)
        yield from (t.Compare("==", counter, _least(value, most)) for most in bounds)
        yield from (t.Compare("==", _least(counter, most), _least(value, most)) for most in bounds)


def _limits(cell: Cell) -> tuple[int, ...]:
    """The numbers in a state variable's definition."""
    values = (part.value for part in subterms(cell.now) if isinstance(part, t.Literal) and part.sort != BOOL)
    return tuple(dict.fromkeys(value for value in values if isinstance(value, int) and value > 0))


def _conditions(variable: t.Variable) -> Iterator[t.Term]:
    match variable.sort:
        case EnumSort(members=members):
            yield from (t.Compare("==", variable, t.EnumValue(m, variable.sort)) for m in members)
        case sort if sort == BOOL:
            yield variable
        case sort if sort in (NATURAL, INTEGER):
            yield from (t.Compare(">=", variable, _number(n)) for n in range(0 if sort == INTEGER else 1, 3))
        case _:  # no condition is read off its values
            pass


def _least(term: t.Term, most: int) -> t.Term:
    return t.Operation(t.Builtin.MIN, (term, _number(most)), term.sort)


def _number(value: int) -> t.Term:
    return t.Literal(value, INTEGER if value < 0 else NATURAL)

"""Weakest preconditions and verification conditions (E. W. Dijkstra, "A Discipline of Programming", 1976).

The condition of a loop is its invariant; that the invariant is kept, and suffices, are conditions of their own. Every
assignment and test also demands that what it computes is defined: no division by zero, no negative natural number.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field
from fractions import Fraction

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.formulas.formula import conjunction, disjunction, equation, free_variables, negation, substitute
from avow.formulas.renaming import rename_apart
from avow.formulas.traversal import transform
from avow.language.definedness import may_lack_value
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, FunctionSort, SequenceSort, Sort, TupleSort
from avow.language.subterms import subterms
from avow.language.terms import (
    TRUE,
    And,
    Apply,
    Arithmetic,
    Compare,
    Construct,
    Iff,
    Implies,
    Index,
    Length,
    Literal,
    Not,
    Or,
    Quantified,
    Quantifier,
    SequenceTerm,
    Term,
    TupleTerm,
    Variable,
)

from .program import Assign, Block, If, Match, Skip, Statement, Update, While, statements, variable
from .triples import Triple
from .tuning import FORMULA_NODES


class TooLarge(Exception):  # noqa: N818 - it names what happened
    """The weakest precondition has grown beyond `FORMULA_NODES`."""

    def __init__(self, span: Span) -> None:
        super().__init__(f"the weakest precondition of the statement at {span} has more than {FORMULA_NODES} parts")
        self.span = span


@dataclass(frozen=True, slots=True)
class Condition:
    """One verification condition: the hypotheses imply the goal, for all values of their free variables."""

    name: str
    hypotheses: tuple[Term, ...]
    goal: Term
    what: str
    span: Span | None = field(default=None, compare=False)

    @property
    def term(self) -> Term:
        return Implies(conjunction(self.hypotheses), self.goal)


@dataclass(slots=True)
class Conditions:
    """Side conditions of loops, as they are met; `known` holds all the time, for it is about constants only."""

    known: Term
    found: list[Condition] = field(default_factory=list)
    assigned: frozenset[str] | None = None
    """The names that the whole program assigns. None: not known, so that no test is taken to go on holding."""

    def under(self, test: Term) -> Conditions:
        """The same within a branch: what its test says of variables that are never assigned goes on holding there."""
        if self.assigned is None:
            return self
        parts = test.items if isinstance(test, And) else (test,)
        lasting = [p for p in parts if not any(v.name in self.assigned for v in free_variables(p))]
        return Conditions(conjunction((self.known, *lasting)), self.found, self.assigned) if lasting else self


def side_conditions(triple: Triple, body: Block) -> Conditions:
    """None met yet."""
    targets = frozenset(s.target.name for s in statements(body) if isinstance(s, Assign | Update))
    return Conditions(triple.pre, assigned=targets)


def conditions(triple: Triple, body: Block) -> tuple[Condition, ...]:
    """The triple holds if all of these do. Raises TooLarge."""
    side = side_conditions(triple, body)
    goal = weakest(body, triple.post, side)
    whole = Condition("pre", (triple.full_pre,), goal, "the precondition implies the program's weakest precondition")
    return (whole, *side.found)


def weakest(body: Block, post: Term, side: Conditions) -> Term:
    """The weakest precondition of some statements. Raises TooLarge."""
    for statement in reversed(body):
        post = _statement(statement, post, side)
        if _size(post) > FORMULA_NODES:
            raise TooLarge(statement.span)
    return post


def _statement(statement: Statement, post: Term, side: Conditions) -> Term:
    match statement:
        case Skip():
            return post
        case Assign(target=target, value=value):
            safe = [defined(value), *in_range(value, target.sort)]
            return conjunction((*safe, assigned(post, target, value)))
        case Update(target=target, arguments=arguments, value=value):
            assert isinstance(target.sort, FunctionSort)
            safe = [defined(t) for t in (*arguments, value)]
            for argument, parameter in zip(arguments, target.sort.parameters, strict=True):
                safe.extend(in_range(argument, parameter))
            safe.extend(in_range(value, target.sort.result))
            return conjunction((*safe, updated(post, target, arguments, value)))
        case If(condition=condition, then=then, otherwise=otherwise):
            yes = weakest(then, post, side.under(condition))
            no = weakest(otherwise, post, side.under(negation(condition)))
            if yes == no:
                return conjunction((defined(condition), yes))
            cases = (Implies(condition, yes), Implies(negation(condition), no))
            return conjunction((defined(condition), *cases))
        case Match():
            return _match(statement, post, side)
        case While():
            return _while(statement, post, side)


def fits(statement: Match, names: Iterable[Variable]) -> Term:
    """That the subject was made by the pattern's constructor, from values that `names` stand for."""
    return Compare("==", statement.subject, Construct(statement.constructor, tuple(names), statement.sort))


def misfits(statement: Match) -> Term:
    """That it was made by another constructor."""
    others: list[Term] = []
    for constructor in statement.sort.constructors:
        if constructor.name != statement.constructor:
            # no variable of a program has such a name, so none is captured
            fresh = tuple(
                variable(f"x{_BELOW[k % 10]}" + "'" * (k // 10), s) for k, s in enumerate(constructor.parameters)
            )
            made = Compare("==", statement.subject, Construct(constructor.name, fresh, statement.sort))
            others.append(Quantified(Quantifier.EXISTS, fresh, made) if fresh else made)
    return disjunction(others)


_BELOW = "₁₂₃₄₅₆₇₈₉₀"


def _match(statement: Match, post: Term, side: Conditions) -> Term:
    assert not free_variables(post) & frozenset(statement.variables), "bound names of triples are apart from these"
    then = weakest(statement.then, post, side.under(fits(statement, statement.variables)))
    otherwise = weakest(statement.otherwise, post, side.under(misfits(statement)))
    if then == otherwise:
        return conjunction((defined(statement.subject), then))
    yes: Term = Implies(fits(statement, statement.variables), then)
    if statement.variables:
        yes = Quantified(Quantifier.FORALL, statement.variables, yes)
    return conjunction((defined(statement.subject), yes, Implies(misfits(statement), otherwise)))


def _while(statement: While, post: Term, side: Conditions) -> Term:
    at, test, invariant = statement.span, statement.condition, statement.invariant
    known = (side.known, invariant)
    line, name = f"loop-{at.line}-{at.column}", f"line {at.line}"
    kept: Term = invariant
    what = f"the loop at {name} keeps its invariant"
    before: tuple[Term, ...] = ()
    if statement.variant is not None:
        first = variable(f"variant~{at.line}~{at.column}", INTEGER)
        before = (Compare("==", first, statement.variant),)
        kept = conjunction((invariant, Compare("<", statement.variant, first)))
        what += ", and its variant falls"
    body = weakest(statement.body, kept, side)
    side.found.append(Condition(f"{line}-kept", (*known, test, *before), body, what, at))
    side.found.append(
        Condition(f"{line}-suffices", (*known, negation(test)), post, f"the loop at {name} ends as wanted", at)
    )
    side.found.append(Condition(f"{line}-test", known, defined(test), f"the loop's test at {name} is defined", at))
    if statement.variant is not None:
        bounded = Compare(">=", statement.variant, Literal(0, INTEGER))
        side.found.append(
            Condition(f"{line}-bounded", (*known, test), bounded, f"the variant at {name} is bounded", at)
        )
    return invariant


# -- assignments -------------------------------------------------------------------------------------------------------


def assigned(post: Term, target: Variable, value: Term) -> Term:
    """The postcondition before ``target := value``."""
    return substitute(post, {target: value})


def updated(post: Term, target: Variable, arguments: tuple[Term, ...], value: Term) -> Term:
    """The postcondition before ``target[arguments] := value``: each atom split by whether it looks at that point."""
    names = {v.name for t in (post, value, *arguments) for v in free_variables(t)}
    after = variable(f"{target.name}~after", target.sort)
    renamed = substitute(rename_apart(post, names), {target: after})
    update = Update(target, arguments, value, Span("", 0, 0, 0, 0))
    return transform(renamed, lambda part: _looked_up(part, after, update))


def _looked_up(part: Term, after: Variable, update: Update) -> Term:
    """An atom about the function after the update, said of the function before."""
    if isinstance(part, Quantified | And | Or | Not | Implies | Iff) or part.sort != BOOL:
        return part
    inner = next((a for a in _applications(part, after) if not any(_applications(x, after) for x in a.arguments)), None)
    if inner is None:
        return part
    same = conjunction(equation(a, b) for a, b in zip(inner.arguments, update.arguments, strict=True))
    before = Apply(update.target, inner.arguments, inner.sort)
    if inner == part:
        return disjunction((conjunction((same, update.value)), conjunction((negation(same), before))))
    there, elsewhere = (_looked_up(_replaced(part, inner, new), after, update) for new in (update.value, before))
    return conjunction((Implies(same, there), Implies(negation(same), elsewhere)))


def _applications(term: Term, function: Variable) -> list[Apply]:
    return [part for part in subterms(term) if isinstance(part, Apply) and part.function == function]


def _replaced(term: Term, old: Term, new: Term) -> Term:
    return transform(term, lambda part: new if part == old else part)


# -- what a program can compute ----------------------------------------------------------------------------------------


def in_range(value: Term, sort: Sort) -> list[Term]:
    """That an INTEGER value is a NATURAL one, where it has to be."""
    return [Compare(">=", value, Literal(0, INTEGER))] if sort == NATURAL and value.sort == INTEGER else []


def defined(term: Term) -> Term:
    """That evaluation from left to right, with `and`, `or` and `->` cut short, divides by nothing that is zero, asks
    for no element before the first or after the last of a sequence, and puts no negative number in the place of a
    natural one."""
    match term:
        case And(items=items) | Or(items=items):
            conditions: list[Term] = []
            for k, item in enumerate(items):
                reached = items[:k] if isinstance(term, And) else tuple(negation(i) for i in items[:k])
                conditions.append(_when(conjunction(reached), defined(item)))
            return conjunction(conditions)
        case Implies(left=left, right=right):
            return conjunction((defined(left), _when(left, defined(right))))
    parts = [defined(child) for child in term.children]
    match term:
        case Arithmetic(operator="/", right=right):
            parts.append(Compare("!=", right, Literal(Fraction(0), REAL)))
        case Apply(function=Variable(sort=FunctionSort(parameters=sorts)), arguments=arguments):
            parts.extend(r for a, s in zip(arguments, sorts, strict=True) for r in in_range(a, s))
        case Construct(constructor=name, arguments=arguments, sort=data):
            sorts = data.constructor(name).parameters
            parts.extend(r for a, s in zip(arguments, sorts, strict=True) for r in in_range(a, s))
        case Index(sequence=sequence, index=index):
            parts.extend(in_range(index, NATURAL))
            parts.append(Compare("<", index, Length(sequence, NATURAL)))
        case SequenceTerm(items=items, sort=SequenceSort(item=sort)):
            parts.extend(r for i in items for r in in_range(i, sort))
        case TupleTerm(items=items, sort=TupleSort(items=sorts)):
            parts.extend(r for i, s in zip(items, sorts, strict=True) for r in in_range(i, s))
        case _:  # has a value where its parts have one
            assert not may_lack_value(term), f"no condition of a {type(term).__name__}"
    return conjunction(parts)


def _when(condition: Term, consequence: Term) -> Term:
    return consequence if consequence == TRUE else Implies(condition, consequence)


def _size(term: Term) -> int:
    return sum(1 for _ in zip(range(FORMULA_NODES + 1), subterms(term), strict=False))

"""Weakest preconditions and verification conditions (E. W. Dijkstra, "A Discipline of Programming", 1976).

The condition of a loop is its invariant, and the parts of the postcondition about variables that the loop does not
assign; that the invariant is kept, and suffices for the rest, are conditions of their own. Every assignment and test
also demands that what it computes is defined: no division by zero, no negative natural number.
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
from avow.language import terms as t
from avow.language.definedness import may_lack_value
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, FunctionSort, SequenceSort, Sort, TupleSort
from avow.language.subterms import subterms

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
    hypotheses: tuple[t.Term, ...]
    goal: t.Term
    what: str
    span: Span | None = field(default=None, compare=False)

    @property
    def term(self) -> t.Term:
        return t.Implies(conjunction(self.hypotheses), self.goal)


@dataclass(slots=True)
class Conditions:
    """Side conditions of loops, as they are met; `known` holds all the time, for it is about constants only."""

    known: t.Term
    found: list[Condition] = field(default_factory=list)
    assigned: frozenset[str] | None = None
    """The names that the whole program assigns. None: not known, so that no test is taken to go on holding."""

    def under(self, test: t.Term) -> Conditions:
        """The same within a branch: what its test says of variables that are never assigned goes on holding there."""
        if self.assigned is None:
            return self
        parts = test.items if isinstance(test, t.And) else (test,)
        lasting = [p for p in parts if not any(v.name in self.assigned for v in free_variables(p))]
        return Conditions(conjunction((self.known, *lasting)), self.found, self.assigned) if lasting else self


def side_conditions(triple: Triple, body: Block) -> Conditions:
    """None met yet."""
    return Conditions(triple.pre, assigned=targets(body))


def targets(body: Block) -> frozenset[str]:
    """The names of the variables that some statements assign."""
    return frozenset(s.target.name for s in statements(body) if isinstance(s, Assign | Update))


def conditions(triple: Triple, body: Block) -> tuple[Condition, ...]:
    """The triple holds if all of these do. Raises TooLarge."""
    side = side_conditions(triple, body)
    goal = weakest(body, triple.post, side)
    whole = Condition("pre", (triple.full_pre,), goal, "the precondition implies the program's weakest precondition")
    return (whole, *side.found)


def weakest(body: Block, post: t.Term, side: Conditions) -> t.Term:
    """The weakest precondition of some statements. Raises TooLarge."""
    for statement in reversed(body):
        post = _statement(statement, post, side)
        if _size(post) > FORMULA_NODES:
            raise TooLarge(statement.span)
    return post


def _statement(statement: Statement, post: t.Term, side: Conditions) -> t.Term:
    match statement:
        case Skip():
            return post
        case Assign(target=target, value=value):
            safe = [defined(value), *in_range(value, target.sort)]
            return conjunction((*safe, assigned(post, target, value)))
        case Update(target=target, arguments=arguments, value=value):
            assert isinstance(target.sort, FunctionSort)
            safe = [defined(term) for term in (*arguments, value)]
            for argument, parameter in zip(arguments, target.sort.parameters, strict=True):
                safe.extend(in_range(argument, parameter))
            safe.extend(in_range(value, target.sort.result))
            return conjunction((*safe, updated(post, target, arguments, value)))
        case If(condition=condition, then=then, otherwise=otherwise):
            yes = weakest(then, post, side.under(condition))
            no = weakest(otherwise, post, side.under(negation(condition)))
            if yes == no:
                return conjunction((defined(condition), yes))
            cases = (t.Implies(condition, yes), t.Implies(negation(condition), no))
            return conjunction((defined(condition), *cases))
        case Match():
            return _match(statement, post, side)
        case While():
            return _while(statement, post, side)


def fits(statement: Match, names: Iterable[t.Variable]) -> t.Term:
    """That the subject was made by the pattern's constructor, from the values of `names`."""
    return t.Compare("==", statement.subject, t.Construct(statement.constructor, tuple(names), statement.sort))


def misfits(statement: Match) -> t.Term:
    """That it was made by another constructor."""
    others: list[t.Term] = []
    for constructor in statement.sort.constructors:
        if constructor.name != statement.constructor:
            # no variable of a program has such a name, so none is captured
            fresh = tuple(
                variable(f"x{_BELOW[k % 10]}" + "'" * (k // 10), s) for k, s in enumerate(constructor.parameters)
            )
            made = t.Compare("==", statement.subject, t.Construct(constructor.name, fresh, statement.sort))
            others.append(t.Quantified(t.Quantifier.EXISTS, fresh, made) if fresh else made)
    return disjunction(others)


_BELOW = "₁₂₃₄₅₆₇₈₉₀"


def _match(statement: Match, post: t.Term, side: Conditions) -> t.Term:
    assert not free_variables(post) & frozenset(statement.variables), "bound names of triples are apart from these"
    then = weakest(statement.then, post, side.under(fits(statement, statement.variables)))
    otherwise = weakest(statement.otherwise, post, side.under(misfits(statement)))
    if then == otherwise:
        return conjunction((defined(statement.subject), then))
    yes: t.Term = t.Implies(fits(statement, statement.variables), then)
    if statement.variables:
        yes = t.Quantified(t.Quantifier.FORALL, statement.variables, yes)
    return conjunction((defined(statement.subject), yes, t.Implies(misfits(statement), otherwise)))


def _while(statement: While, post: t.Term, side: Conditions) -> t.Term:
    at, test, invariant = statement.span, statement.condition, statement.invariant
    changed = targets(statement.body)
    parts = post.items if isinstance(post, t.And) else (post,)
    lasting = [part for part in parts if changed.isdisjoint(v.name for v in free_variables(part))]
    wanted = conjunction(part for part in parts if part not in lasting)
    known = (side.known, invariant, *lasting)
    line, name = f"loop-{at.line}-{at.column}", f"line {at.line}"
    kept: t.Term = invariant
    what = f"the loop at {name} keeps its invariant"
    before: tuple[t.Term, ...] = ()
    if statement.variant is not None:
        first = variable(f"variant~{at.line}~{at.column}", INTEGER)
        before = (t.Compare("==", first, statement.variant),)
        kept = conjunction((invariant, t.Compare("<", statement.variant, first)))
        what += ", and its variant falls"
    body = weakest(statement.body, kept, side)
    side.found.append(Condition(f"{line}-kept", (*known, test, *before), body, what, at))
    side.found.append(
        Condition(f"{line}-suffices", (*known, negation(test)), wanted, f"the loop at {name} ends as wanted", at)
    )
    side.found.append(Condition(f"{line}-test", known, defined(test), f"the loop's test at {name} is defined", at))
    if statement.variant is not None:
        bounded = t.Compare(">=", statement.variant, t.Literal(0, INTEGER))
        side.found.append(
            Condition(f"{line}-bounded", (*known, test), bounded, f"the variant at {name} is bounded", at)
        )
    return conjunction((invariant, *lasting))


# -- assignments -------------------------------------------------------------------------------------------------------


def assigned(post: t.Term, target: t.Variable, value: t.Term) -> t.Term:
    """The postcondition before ``target := value``."""
    return substitute(post, {target: value})


def updated(post: t.Term, target: t.Variable, arguments: tuple[t.Term, ...], value: t.Term) -> t.Term:
    """The postcondition before ``target[arguments] := value``: each atom split by whether it looks at that point."""
    names = {v.name for term in (post, value, *arguments) for v in free_variables(term)}
    after = variable(f"{target.name}~after", target.sort)
    renamed = substitute(rename_apart(post, names), {target: after})
    update = Update(target, arguments, value, Span("", 0, 0, 0, 0))
    return transform(renamed, lambda part: _looked_up(part, after, update))


def _looked_up(part: t.Term, after: t.Variable, update: Update) -> t.Term:
    """An atom about the function after the update, as one about the function before."""
    if isinstance(part, t.Quantified | t.And | t.Or | t.Not | t.Implies | t.Iff) or part.sort != BOOL:
        return part
    inner = next((a for a in _applications(part, after) if not any(_applications(x, after) for x in a.arguments)), None)
    if inner is None:
        return part
    same = conjunction(equation(a, b) for a, b in zip(inner.arguments, update.arguments, strict=True))
    before = t.Apply(update.target, inner.arguments, inner.sort)
    if inner == part:
        return disjunction((conjunction((same, update.value)), conjunction((negation(same), before))))
    there, elsewhere = (_looked_up(_replaced(part, inner, new), after, update) for new in (update.value, before))
    return conjunction((t.Implies(same, there), t.Implies(negation(same), elsewhere)))


def _applications(term: t.Term, function: t.Variable) -> list[t.Apply]:
    return [part for part in subterms(term) if isinstance(part, t.Apply) and part.function == function]


def _replaced(term: t.Term, old: t.Term, new: t.Term) -> t.Term:
    return transform(term, lambda part: new if part == old else part)


# -- what a program can compute ----------------------------------------------------------------------------------------


def in_range(value: t.Term, sort: Sort) -> list[t.Term]:
    """That an INTEGER value is a NATURAL one, where it has to be."""
    return [t.Compare(">=", value, t.Literal(0, INTEGER))] if sort == NATURAL and value.sort == INTEGER else []


def defined(term: t.Term) -> t.Term:
    """That evaluation from left to right, with `and`, `or` and `->` cut short, divides by nothing that is zero, asks
    for no element before the first or after the last of a sequence, and puts no negative number in the place of a
    natural one."""
    match term:
        case t.And(items=items) | t.Or(items=items):
            conditions: list[t.Term] = []
            for k, item in enumerate(items):
                reached = items[:k] if isinstance(term, t.And) else tuple(negation(i) for i in items[:k])
                conditions.append(_when(conjunction(reached), defined(item)))
            return conjunction(conditions)
        case t.Implies(left=left, right=right):
            return conjunction((defined(left), _when(left, defined(right))))
    parts = [defined(child) for child in term.children]
    match term:
        case t.Arithmetic(operator="/", right=right):
            parts.append(t.Compare("!=", right, t.Literal(Fraction(0), REAL)))
        case t.Operation(operator=t.Builtin.SQRT, arguments=(inner,)):
            parts.append(t.Compare(">=", inner, t.Literal(Fraction(0), REAL)))
        case t.Operation(operator=t.Builtin.ATAN2, arguments=vector):
            parts.append(t.Or(tuple(t.Compare("!=", each, t.Literal(Fraction(0), REAL)) for each in vector)))
        case t.Apply(function=t.Variable(sort=FunctionSort(parameters=sorts)), arguments=arguments):
            parts.extend(r for a, s in zip(arguments, sorts, strict=True) for r in in_range(a, s))
        case t.Construct(constructor=name, arguments=arguments, sort=data):
            sorts = data.constructor(name).parameters
            parts.extend(r for a, s in zip(arguments, sorts, strict=True) for r in in_range(a, s))
        case t.Index(sequence=sequence, index=index):
            parts.extend(in_range(index, NATURAL))
            parts.append(t.Compare("<", index, t.Length(sequence, NATURAL)))
        case t.SequenceTerm(items=items, sort=SequenceSort(item=sort)):
            parts.extend(r for i in items for r in in_range(i, sort))
        case t.TupleTerm(items=items, sort=TupleSort(items=sorts)):
            parts.extend(r for i, s in zip(items, sorts, strict=True) for r in in_range(i, s))
        case _:  # has a value where its parts have one
            assert not may_lack_value(term), f"no condition of a {type(term).__name__}"
    return conjunction(parts)


def _when(condition: t.Term, consequence: t.Term) -> t.Term:
    return consequence if consequence == t.TRUE else t.Implies(condition, consequence)


def _size(term: t.Term) -> int:
    return sum(1 for _ in zip(range(FORMULA_NODES + 1), subterms(term), strict=False))

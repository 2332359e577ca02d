"""Definedness of claims: the conditions of partial operations (a quotient by zero, an element that a sequence does not
have) become part of the claim itself, so that every engine checks them.

A claim that has no value is not met. `1 / in.x == 1 or 1 / in.x != 1` implies `in.x != 0` as well; an operation that
the claim itself guards (``in.x != 0 -> 1 / in.x < 2``) adds no condition. A part of a conjunction (disjunction,
implication) need not have a value if another part, which always has one or comes before it, makes the whole false
(true).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import combinations
from typing import assert_never

from avow.base.tuning.bounds import GUARDS
from avow.language import terms as t
from avow.language.bounds import constant
from avow.language.operators import OPPOSITE
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL
from avow.language.subterms import histories, subterms

Facts = tuple[t.Term, ...]
_ZERO = t.Literal(0, NATURAL)


def with_value(claim: t.Term) -> t.Term:
    """The conjunction of the claim and that it has a value. Idempotent."""
    if histories(claim):
        claim = _at_their_steps(claim)
        if any(part.operator in t.RESPONSES for part in histories(claim)):
            return _responding(claim)
    needed = _needed(claim)
    if needed == t.TRUE or demanded(claim) is not claim:
        return claim
    return t.And((*_parts(needed), *_parts(claim)), claim.span)


def _at_their_steps(term: t.Term) -> t.Term:
    """The term with the conditions of its history operators at the steps they refer to: a formula without a value
    counts as false there."""
    parts = tuple(map(_at_their_steps, term.children))
    if isinstance(term, t.History):
        parts = tuple(with_value(part) if part.sort == BOOL else part for part in parts)
    return term if parts == term.children else term.rebuild(parts)


def _responding(claim: t.Term) -> t.Term:
    """A claim with a response keeps its form: a trigger without a value counts as false."""
    match claim:
        case t.Implies(left=left, right=right):
            return t.Implies(with_value(left), _responding(right), claim.span)
        case t.Quantified(body=body):
            return claim.rebuild((_responding(body),))
    return claim


def demanded(claim: t.Term) -> t.Term:
    """The claim without the condition that it has a value: the inverse of `with_value`."""
    parts = _parts(claim) if _is_partial(claim) else ()
    for k in range(1, len(parts)):
        rest = t.And(parts[k:], claim.span) if k + 1 < len(parts) else parts[k]
        if parts[:k] == _parts(_needed(rest)):
            return rest
    return claim


def unless_without_value(claim: t.Term) -> t.Term:
    """The claim, or that it has no value: its meaning under a `not`."""
    needed = _needed(claim)
    return claim if needed == t.TRUE else t.Implies(needed, claim, claim.span)


def _needed(claim: t.Term) -> t.Term:
    return defined(claim) if _is_partial(claim) else t.TRUE


def _is_partial(term: t.Term) -> bool:
    return any(map(may_lack_value, subterms(term)))


def may_lack_value(term: t.Term) -> bool:
    """Whether the term may lack a value although its parts have one."""
    match term:
        case t.Arithmetic(operator=sign):
            return sign == "/"
        case t.Index():
            return True
        case (
            t.Variable() | t.Literal() | t.Compare() | t.And() | t.Or() | t.Not() | t.Implies() | t.Apply()
            | t.EnumValue() | t.Quantified() | t.Widen() | t.History() | t.In() | t.Item() | t.Construct()
            | t.TupleTerm() | t.SequenceTerm() | t.SequenceRange() | t.SetTerm() | t.Length() | t.Negative() | t.Iff()
            | t.Conditional()
        ):  # fmt: skip
            return False
        case t.Operation(operator=operator):
            match operator:
                case (
                    t.Builtin.XOR | t.Builtin.ABS | t.Builtin.MIN | t.Builtin.MAX | t.Builtin.SIN | t.Builtin.COS
                    | t.Builtin.MOD | t.Builtin.DIV  # whose divisor is a positive literal
                ):  # fmt: skip
                    return False
                case t.Builtin.SQRT | t.Builtin.ATAN2:
                    return True
                case _:
                    assert_never(operator)
        case t.Argument():
            raise AssertionError("it is put for a variable only where a formula's conditions are written out already")
        case _:
            assert_never(term)


def defined(term: t.Term, sequences: Collection[t.Variable] | None = None, facts: Facts = ()) -> t.Term:
    """A condition under which a formula does not depend on the values of partial operations outside their domains; with
    `sequences`, on elements outside these only. `facts` hold in its context."""
    match term:
        case t.Not(body=body):
            found = defined(body, sequences, facts)
        case t.And(items=items):
            found = _in_turn(items, items, sequences, facts)
        case t.Or(items=items):
            found = _in_turn(items, tuple(map(_denial, items)), sequences, facts)
        case t.Implies(left=left, right=right):
            found = _in_turn((left, right), (left, _denial(right)), sequences, facts)
        case t.Iff(left=left, right=right):
            found = _all((defined(left, sequences, facts), defined(right, sequences, facts)))
        case t.Quantified(variables=variables, body=body):
            inner = defined(body, sequences, facts)
            found = inner if inner == t.TRUE else t.Quantified(t.Quantifier.FORALL, variables, inner, term.span)
        case t.Conditional(condition=condition, then=then, otherwise=otherwise):
            branches = ((condition, then), (_denial(condition), otherwise))
            needed = [(guard, defined(part, sequences, (*facts, *_parts(guard)))) for guard, part in branches]
            safe = (t.Implies(guard, inner, term.span) for guard, inner in needed if inner != t.TRUE)
            found = _all((defined(condition, sequences, facts), *safe))
        case _:  # no connective: all parts matter
            found = _all(_risks(term, sequences, facts))
    return _all(part for part in _parts(found) if part not in facts)


def _in_turn(
    items: Sequence[t.Term], guards: Sequence[t.Term], sequences: Collection[t.Variable] | None, facts: Facts
) -> t.Term:
    """Each item matters only if the guards of the items that always have a value, and of those before it, hold."""
    partial = [_is_partial(item) for item in items]
    safe = [guard for guard, doubtful in zip(guards, partial, strict=True) if not doubtful]
    found, asked = list[t.Term](), list[t.Term]()
    for item, guard, doubtful in zip(items, guards, partial, strict=True):
        if doubtful:
            inner = defined(item, sequences, (*facts, *_parts(_all((*safe, *asked)))))
            asked += _parts(inner)  # a condition required once may be assumed for later items
            if inner != t.TRUE:
                found.append(t.Implies(_all(safe), inner, item.span) if safe else inner)
            safe.append(guard)
    return _all(found)


def _risks(atom: t.Term, sequences: Collection[t.Variable] | None, facts: Facts) -> Iterator[t.Term]:
    """The conditions for an atom to be defined, including those of formulas within it."""
    match atom:
        case t.Index(sequence=sequence, index=index) if sequences is None or sequence in sequences:
            asked = [t.Compare("<=", _ZERO, index, atom.span)] if index.sort != NATURAL else []
            asked.append(t.Compare("<", index, t.Length(sequence, NATURAL), atom.span))
            yield from (each for each in asked if not _follows(each, facts))
        case t.Arithmetic(operator="/", right=right) if sequences is None:
            yield from _one_not_zero((right,), facts, atom)
        case t.Operation(operator=t.Builtin.ATAN2, arguments=vector) if sequences is None:
            yield from _one_not_zero(vector, facts, atom)
        case t.Operation(operator=t.Builtin.SQRT, arguments=(inner,)) if sequences is None:
            wanted = t.Compare(">=", inner, t.Literal(Fraction(0), REAL), atom.span)
            if not (_is_never_negative(inner) or _follows(wanted, facts)):
                yield wanted
        case t.History(operator=t.Past.PREVIOUS | t.Past.CHANGED) if atom.arguments[0].sort != BOOL:
            yield from _risks_before(atom, sequences, facts)
            return
        case _:  # has a value if its parts have one
            assert sequences is not None or not may_lack_value(atom), f"no condition of a {type(atom).__name__}"
    for part in atom.children:
        if isinstance(atom, t.History) and part.sort == BOOL:
            continue  # it contains its own conditions
        if part.sort == BOOL or isinstance(part, t.Conditional):
            yield from _parts(defined(part, sequences, facts))
        else:
            yield from _risks(part, sequences, facts)


def _one_not_zero(terms: Sequence[t.Term], facts: Facts, atom: t.Term) -> Iterator[t.Term]:
    """The condition that some term is not zero, unless it plainly follows from the facts."""
    signs = ("!=", ">", "<")
    asked = [[t.Compare(sign, term, t.Literal(Fraction(0), REAL), atom.span) for sign in signs] for term in terms]
    if not any(_follows(each, facts) for row in asked for each in row):
        yield asked[0][0] if len(asked) == 1 else t.Or(tuple(row[0] for row in asked), atom.span)


def _risks_before(atom: t.History, sequences: Collection[t.Variable] | None, facts: Facts) -> Iterator[t.Term]:
    """The conditions for a value of the previous step: that it was defined there. Facts about this step do not apply to
    that step."""
    value, *initial = atom.arguments
    if not initial:  # `changed` compares it with the present value
        yield from _parts(defined(value, sequences, facts))
    before = defined(value, sequences)
    first = defined(initial[0], sequences) if initial else t.TRUE
    if (before, first) != (t.TRUE, t.TRUE):
        yield t.History(t.Past.PREVIOUS, (before, first), BOOL, None, atom.span)


def _parts(term: t.Term) -> tuple[t.Term, ...]:
    return term.items if isinstance(term, t.And) else () if term == t.TRUE else (term,)


def _all(terms: Iterable[t.Term]) -> t.Term:
    parts = tuple(dict.fromkeys(part for term in terms for part in _parts(term)))
    return t.TRUE if not parts else parts[0] if len(parts) == 1 else t.And(parts, parts[0].span)


def _denial(term: t.Term) -> t.Term:
    match term:
        case t.Not(body=body):
            return body
        case t.Or(items=items):
            return _all(map(_denial, items))
        case t.Implies(left=left, right=right):
            return _all((left, _denial(right)))
        case t.Compare(operator=sign, left=left, right=right):
            return t.Compare(OPPOSITE[sign], left, right, term.span)
        case t.Literal(value=bool() as value):
            return t.FALSE if value else t.TRUE
    return t.Not(term, term.span)


# -- what plainly follows from guards: sums of numbers that are compared -----------------------------------------------


def _is_never_negative(term: t.Term) -> bool:
    """Whether it is plainly a sum or product of squares, of numbers without sign, and of numbers that are written."""
    match term:
        case t.Arithmetic(operator="*", left=left, right=right) if left == right:
            return True
        case t.Arithmetic(operator="+" | "*" | "/") | t.Widen():
            return all(map(_is_never_negative, term.children))
        case t.Operation(operator=t.Builtin.ABS | t.Builtin.SQRT):
            return True
    number = constant(term)
    return term.sort == NATURAL or (number is not None and number >= 0)


_Sum = dict[t.Term, Fraction]
_ONE = t.Literal(1, INTEGER)
"""Key for the constant of a sum."""


def _follows(goal: t.Compare, facts: Facts) -> bool:
    """Whether the goal follows from the sum of at most two of the facts."""
    facts = tuple(_denial(fact.body) if isinstance(fact, t.Not) else fact for fact in facts)
    if goal in facts:
        return True
    if goal.operator == "!=":
        return constant(goal.left) not in (None, 0)
    (wanted,) = _below(goal)
    given = [each for fact in facts[-GUARDS:] for each in _below(fact)]
    chosen = (sums for count in (0, 1, 2) for sums in combinations(given, count))
    return any(_at_most_zero(_added(wanted, *(_times(each, -1) for each in sums))) for sums in chosen)


def _at_most_zero(rest: _Sum) -> bool:
    """Whether a sum is at most zero for all values of the naturals in it."""
    signed = (_ONE, _TINY)
    return all(n <= 0 if term in signed or term.sort == NATURAL else n == 0 for term, n in rest.items())


def _below(fact: t.Term) -> list[_Sum]:
    """Sums that are at most zero if a comparison holds."""
    match fact:
        case t.Compare(operator="<" | "<=" as sign, left=left, right=right):
            return [_added(_sum(left), _times(_sum(right), -1), _strict(sign, left, right))]
        case t.Compare(operator=">" | ">=" as sign, left=left, right=right):
            return _below(t.Compare("<" if sign == ">" else "<=", right, left))
        case t.Compare(operator="==", left=left, right=right) if left.sort in (INTEGER, NATURAL, REAL):
            return [*_below(t.Compare("<=", left, right)), *_below(t.Compare("<=", right, left))]
        case t.Compare(operator="!=", left=left, right=right):
            for one, other in ((left, right), (right, left)):
                if one.sort == NATURAL and isinstance(other, t.Literal) and other.value == 0:
                    return _below(t.Compare("<", other, one))
                if isinstance(other, t.SequenceTerm) and not other.items:
                    return _below(t.Compare("<", _ZERO, t.Length(one, NATURAL)))
        case t.In(item=item, collection=t.SequenceRange(low=low, high=high)):
            return [*_below(t.Compare("<=", low, item)), *_below(t.Compare("<=", item, high))]
    return []


_TINY = t.Literal(0, REAL)
"""As a summand, an unspecified positive number: the difference between the sides of a strict comparison of reals."""


def _strict(sign: str, left: t.Term, right: t.Term) -> _Sum:
    if sign == "<=":
        return {}
    whole = all(part.sort in (INTEGER, NATURAL) for part in (left, right))
    return {_ONE: Fraction(1)} if whole else {_TINY: Fraction(1)}


def _sum(term: t.Term) -> _Sum:
    match term:
        case t.Widen(term=inner):
            return _sum(inner)
        case t.Negative(term=inner):
            return _times(_sum(inner), -1)
        case t.Arithmetic(operator="+", left=left, right=right):
            return _added(_sum(left), _sum(right))
        case t.Arithmetic(operator="-", left=left, right=right):
            return _added(_sum(left), _times(_sum(right), -1))
        case t.Literal(value=int() | Fraction() as value) if not isinstance(value, bool):
            return {_ONE: Fraction(value)}
        case t.Length(sequence=t.SequenceTerm(items=items)):
            return {_ONE: Fraction(len(items))}
    return {term: Fraction(1)}


def _times(sum_: _Sum, factor: int) -> _Sum:
    return {term: number * factor for term, number in sum_.items()}


def _added(*sums: _Sum) -> _Sum:
    found: _Sum = {}
    for each in sums:
        for term, number in each.items():
            found[term] = found.get(term, Fraction(0)) + number
    return found

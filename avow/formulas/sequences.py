"""Sequences as a length and a function from positions: the form in which solvers (and the search for witnesses) can
say something about ``forall(i | i < length(s) -> s(i) > 0)``.

What the function yields outside the length is anything at all, where in RCL it is some unspecified value that depends
on the sequence and the position alone. So the changed formulas hold in more cases than the original ones: if they
contradict one another then the original ones do, whatever lies outside. The other way round, what meets them counts
only together with `defined`: that no element outside a sequence matters.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Generic, TypeVar

from avow.base.records import dataclass
from avow.base.tuning.bounds import SEQUENCE_SHOWN
from avow.base.tuning.sizes import REWRITTEN_DEPTH
from avow.formulas.formula import conjunction, free_variables, fresh
from avow.formulas.renaming import map_children
from avow.formulas.traversal import depth
from avow.formulas.values import FunctionValue, SequenceValue, Value
from avow.language.sorts import INTEGER, NATURAL, FunctionSort, SequenceSort, SetSort, Sort
from avow.language.subterms import subterms
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Compare,
    Implies,
    In,
    Index,
    Length,
    Literal,
    Not,
    Quantified,
    Quantifier,
    Role,
    SequenceRange,
    SequenceTerm,
    Term,
    Variable,
)

Label = TypeVar("Label")


@dataclass(frozen=True, slots=True)
class Flat(Generic[Label]):
    """Formulas without some sequences: `parts` has the length and the function that stand for each."""

    formulas: Mapping[Label, Term]
    parts: Mapping[Variable, tuple[Variable, Variable]]

    def variables(self, originals: Iterable[Variable]) -> tuple[Variable, ...]:
        """The variables that stand for these."""
        return tuple(part for v in originals for part in self.parts.get(v, (v,)))

    def restored(self, term: Term) -> Term:
        """A formula with the sequences again: their lengths and elements in the place of what stands for them."""
        lengths: dict[Term, Term] = {length: Length(v, NATURAL) for v, (length, _) in self.parts.items()}
        elements: dict[Term, Variable] = {element: v for v, (_, element) in self.parts.items()}

        def put(part: Term) -> Term:
            match part:
                case Apply(function=function, arguments=(at,)) if function in elements:
                    return Index(elements[function], put(at), part.sort)
                case _:  # an element is only asked for by its position
                    return lengths[part] if part in lengths else map_children(part, put)

        return put(term)

    def values(self, found: Mapping[Variable, Value]) -> dict[Variable, Value] | None:
        """The values of the original variables; None where one is too long to be of use."""
        parts = {part for pair in self.parts.values() for part in pair}
        values = {variable: value for variable, value in found.items() if variable not in parts}
        for variable, (length, element) in self.parts.items():
            count, at = found.get(length, 0), found.get(element)
            assert isinstance(count, int)
            if count > SEQUENCE_SHOWN or (count and not isinstance(at, FunctionValue)):
                return None
            values[variable] = SequenceValue(
                tuple(at(k) for k in range(count)) if isinstance(at, FunctionValue) else ()
            )
        return values


def flatten(formulas: Mapping[Label, Term], sequences: Iterable[Variable]) -> Flat[Label] | None:
    """The formulas without these sequences; None where a sequence is used as a whole in another value, or there is
    none of them."""
    parts = {}
    for variable in sequences:
        sort = variable.sort
        if not isinstance(sort, SequenceSort) or isinstance(sort.item, SequenceSort | FunctionSort | SetSort):
            return None
        element = Variable(variable.role, f"{variable.name} (elements)", FunctionSort((INTEGER,), sort.item))
        parts[variable] = (Variable(variable.role, f"{variable.name} (length)", NATURAL), element)
    if not parts or any(depth(formula) > REWRITTEN_DEPTH for formula in formulas.values()):
        return None
    changed = {label: _change(formula, parts) for label, formula in formulas.items()}
    if any(free_variables(formula) & parts.keys() for formula in changed.values()):
        return None
    return Flat(changed, parts)


def _change(term: Term, parts: Mapping[Variable, tuple[Variable, Variable]]) -> Term:
    match term:
        case Length(sequence=Variable() as s) if s in parts:
            return parts[s][0]
        case Index(sequence=Variable() as s, index=index) if s in parts:
            return Apply(parts[s][1], (_change(index, parts),), term.sort)
        case In(item=item, collection=Variable() as s) if s in parts:
            length, element = parts[s]
            k = _position(term)
            here = Compare("==", Apply(element, (k,), _item(s)), _change(item, parts))
            return Quantified(Quantifier.EXISTS, (k,), And((Compare("<", k, length), here)))
        case Compare(operator="==" | "!=" as operator, left=left, right=right) if isinstance(left.sort, SequenceSort):
            for one, other in ((left, right), (right, left)):
                if isinstance(one, Variable) and one in parts:
                    same = _same(one, other, term, parts)
                    return same if operator == "==" else Not(same)
            return term
        case _:  # says nothing of a sequence itself: its parts may
            return map_children(term, lambda child: _change(child, parts))


def _same(s: Variable, other: Term, within: Term, parts: Mapping[Variable, tuple[Variable, Variable]]) -> Term:
    """That a sequence is another one; the equation itself where nothing simpler says so."""
    length, element = parts[s]
    sort = _item(s)
    k = _position(within)
    inside = Compare("<", k, length)
    here = Apply(element, (k,), sort)
    match other:
        case SequenceTerm(items=items):
            elements = (
                Compare("==", Apply(element, (Literal(n, INTEGER),), sort), _change(item, parts))
                for n, item in enumerate(items)
            )
            return conjunction((Compare("==", length, Literal(len(items), INTEGER)), *elements))
        case SequenceRange(low=low, high=high):
            low, high = _change(low, parts), _change(high, parts)
            count = Arithmetic("+", Arithmetic("-", high, low, INTEGER), Literal(1, INTEGER), INTEGER)
            measured = And(
                (
                    Implies(Compare("<=", low, high), Compare("==", length, count)),
                    Implies(Compare("<", high, low), Compare("==", length, Literal(0, INTEGER))),
                )
            )
            each = Implies(inside, Compare("==", here, Arithmetic("+", low, k, INTEGER)))
            return And((measured, Quantified(Quantifier.FORALL, (k,), each)))
        case Variable() if other in parts:
            other_length, other_element = parts[other]
            each = Implies(inside, Compare("==", here, Apply(other_element, (k,), _item(other))))
            return And((Compare("==", length, other_length), Quantified(Quantifier.FORALL, (k,), each)))
        case _:  # no simpler form: the sequence stays, and `flatten` refuses
            return Compare("==", s, other)


def _item(s: Variable) -> Sort:
    assert isinstance(s.sort, SequenceSort)
    return s.sort.item


def _position(within: Term) -> Variable:
    taken = {part.name for part in subterms(within) if isinstance(part, Variable)}
    return Variable(Role.BOUND, fresh("k", taken), NATURAL)

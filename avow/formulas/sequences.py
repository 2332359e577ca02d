"""Sequences as a length and a function from positions: the form in which solvers (and the search for witnesses) can
handle ``forall(i | i < length(s) -> s(i) > 0)``.

Outside the length the function yields any value, whereas in RCL it is an unspecified value that depends on the sequence
and the position alone. So the changed formulas hold in more cases than the original ones: if they contradict one
another, so do the original ones. Conversely, a solution of them is valid only together with `defined`: that no element
outside a sequence matters.
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
from avow.language import terms as t
from avow.language.sorts import INTEGER, NATURAL, FunctionSort, SequenceSort, SetSort, Sort
from avow.language.subterms import subterms

Label = TypeVar("Label")


@dataclass(frozen=True, slots=True)
class Flat(Generic[Label]):
    """Formulas without some sequences: `parts` maps each to the length and the function that represent it."""

    formulas: Mapping[Label, t.Term]
    parts: Mapping[t.Variable, tuple[t.Variable, t.Variable]]

    def variables(self, originals: Iterable[t.Variable]) -> tuple[t.Variable, ...]:
        """The variables that represent the originals."""
        return tuple(part for v in originals for part in self.parts.get(v, (v,)))

    def restored(self, term: t.Term) -> t.Term:
        """A formula with the sequences restored: their lengths and elements replace the variables for them."""
        lengths: dict[t.Term, t.Term] = {length: t.Length(v, NATURAL) for v, (length, _) in self.parts.items()}
        elements: dict[t.Term, t.Variable] = {element: v for v, (_, element) in self.parts.items()}

        def put(part: t.Term) -> t.Term:
            match part:
                case t.Apply(function=function, arguments=(at,)) if function in elements:
                    return t.Index(elements[function], put(at), part.sort)
                case _:  # an element is accessed only by its position
                    return lengths[part] if part in lengths else map_children(part, put)

        return put(term)

    def values(self, found: Mapping[t.Variable, Value]) -> dict[t.Variable, Value] | None:
        """The values of the original variables; None if a sequence is too long to be useful."""
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


def flatten(formulas: Mapping[Label, t.Term], sequences: Iterable[t.Variable]) -> Flat[Label] | None:
    """The formulas without these sequences; None if a sequence is used as a whole in another value, or if there are
    none."""
    parts = {}
    for variable in sequences:
        sort = variable.sort
        if not isinstance(sort, SequenceSort) or isinstance(sort.item, SequenceSort | FunctionSort | SetSort):
            return None
        element = t.Variable(variable.role, f"{variable.name} (elements)", FunctionSort((INTEGER,), sort.item))
        parts[variable] = (t.Variable(variable.role, f"{variable.name} (length)", NATURAL), element)
    if not parts or any(depth(formula) > REWRITTEN_DEPTH for formula in formulas.values()):
        return None
    changed = {label: _change(formula, parts) for label, formula in formulas.items()}
    if any(free_variables(formula) & parts.keys() for formula in changed.values()):
        return None
    return Flat(changed, parts)


def _change(term: t.Term, parts: Mapping[t.Variable, tuple[t.Variable, t.Variable]]) -> t.Term:
    match term:
        case t.Length(sequence=t.Variable() as s) if s in parts:
            return parts[s][0]
        case t.Index(sequence=t.Variable() as s, index=index) if s in parts:
            return t.Apply(parts[s][1], (_change(index, parts),), term.sort)
        case t.In(item=item, collection=t.Variable() as s) if s in parts:
            length, element = parts[s]
            k = _position(term)
            here = t.Compare("==", t.Apply(element, (k,), _item(s)), _change(item, parts))
            return t.Quantified(t.Quantifier.EXISTS, (k,), t.And((t.Compare("<", k, length), here)))
        case t.Compare(operator="==" | "!=" as operator, left=left, right=right) if isinstance(left.sort, SequenceSort):
            for one, other in ((left, right), (right, left)):
                if isinstance(one, t.Variable) and one in parts:
                    same = _same(one, other, term, parts)
                    return same if operator == "==" else t.Not(same)
            return term
        case _:  # not about a sequence itself, but its parts may be
            return map_children(term, lambda child: _change(child, parts))


def _same(
    s: t.Variable, other: t.Term, within: t.Term, parts: Mapping[t.Variable, tuple[t.Variable, t.Variable]]
) -> t.Term:
    """The formula that two sequences are equal; the equation itself if there is no simpler form."""
    length, element = parts[s]
    sort = _item(s)
    k = _position(within)
    inside = t.Compare("<", k, length)
    here = t.Apply(element, (k,), sort)
    match other:
        case t.SequenceTerm(items=items):
            elements = (
                t.Compare("==", t.Apply(element, (t.Literal(n, INTEGER),), sort), _change(item, parts))
                for n, item in enumerate(items)
            )
            return conjunction((t.Compare("==", length, t.Literal(len(items), INTEGER)), *elements))
        case t.SequenceRange(low=low, high=high):
            low, high = _change(low, parts), _change(high, parts)
            count = t.Arithmetic("+", t.Arithmetic("-", high, low, INTEGER), t.Literal(1, INTEGER), INTEGER)
            measured = t.And(
                (
                    t.Implies(t.Compare("<=", low, high), t.Compare("==", length, count)),
                    t.Implies(t.Compare("<", high, low), t.Compare("==", length, t.Literal(0, INTEGER))),
                )
            )
            each = t.Implies(inside, t.Compare("==", here, t.Arithmetic("+", low, k, INTEGER)))
            return t.And((measured, t.Quantified(t.Quantifier.FORALL, (k,), each)))
        case t.Variable() if other in parts:
            other_length, other_element = parts[other]
            each = t.Implies(inside, t.Compare("==", here, t.Apply(other_element, (k,), _item(other))))
            return t.And((t.Compare("==", length, other_length), t.Quantified(t.Quantifier.FORALL, (k,), each)))
        case _:  # no simpler form: the sequence remains, and `flatten` returns None
            return t.Compare("==", s, other)


def _item(s: t.Variable) -> Sort:
    assert isinstance(s.sort, SequenceSort)
    return s.sort.item


def _position(within: t.Term) -> t.Variable:
    taken = {part.name for part in subterms(within) if isinstance(part, t.Variable)}
    return t.Variable(t.Role.BOUND, fresh("k", taken), NATURAL)

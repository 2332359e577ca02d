"""Terms as Python expressions that a person would write, for the generated tests.

A quantifier over infinitely many values becomes a comprehension over the values that its guards name: the points of a
relation, the arguments of a command, a range. A formula whose guards name none raises `Untranslatable`: Avow judges it
all the same, by exact evaluation, and the generated test has a comment on it.
"""

from __future__ import annotations

import keyword
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import assert_never

from avow.base.plain import as_identifier, decimal
from avow.formulas.formula import free_variables, negation
from avow.language import terms as t
from avow.language.operators import OPPOSITE
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort

from .tuning import ALTERNATIVES

_OR, _AND, _NOT, _COMPARE, _ADD, _MULTIPLY, _SIGN, _ATOM = range(1, 9)
"""Python's precedences, loosest first."""


class Untranslatable(Exception):  # noqa: N818 - it names what is wrong
    """The formula has no plain Python form; the text is the reason, for people."""


def safe_name(name: str, taken: Iterable[str] = ()) -> str:
    """An identifier for a name of the contract, different from those taken."""
    found = as_identifier(name).lstrip("_") or "x"
    found = f"x{found}" if found[0].isdigit() else found
    while keyword.iskeyword(found) or found in taken:
        found += "_"
    return found


def number(value: Fraction | int) -> str:
    """An exact number."""
    exact = Fraction(value)
    if exact.denominator == 1:
        return str(exact.numerator)
    text = decimal(exact)
    return f'Fraction("{text}")' if text is not None else f"Fraction({exact.numerator}, {exact.denominator})"


Branch = tuple[tuple[t.Variable, ...], tuple[t.Term, ...]]
"""Existential variables, and their joint conditions."""

Binding = tuple[str, set[t.Variable]]
"""A loop, and the variables that it binds."""


@dataclass(frozen=True, slots=True)
class Translator:
    """`names` has the Python expression of each variable, by qualified name."""

    names: Mapping[str, str]
    reserved: frozenset[str] = field(default=frozenset())
    """Names that no bound variable may take."""
    known: Mapping[t.Term, str] = field(default_factory=dict)
    """Terms whose values have names."""

    def formula(self, term: t.Term) -> str:
        """Raises Untranslatable."""
        return self._text(term)[0]

    def _at(self, term: t.Term, least: int) -> str:
        text, binds = self._text(term)
        return text if binds >= least else f"({text})"

    def _joined(self, parts: Iterable[t.Term], between: str, least: int) -> str:
        return between.join(self._at(part, least) for part in parts)

    def _call(self, name: str, parts: Iterable[t.Term]) -> tuple[str, int]:
        return f"{name}({self._joined(parts, ', ', _OR)})", _ATOM

    def _text(self, term: t.Term) -> tuple[str, int]:
        """The expression, and its precedence."""
        if self.known and term in self.known:
            return self.known[term], _ATOM
        match term:
            case t.Literal(value=bool() | str()):
                return repr(term.value), _ATOM
            case t.Literal(value=value):
                text = number(value)  # type: ignore[arg-type]
                return text, _SIGN if text.startswith("-") else _ATOM
            case t.EnumValue(name=name):
                return repr(name), _ATOM
            case t.Variable():
                if term.qualified not in self.names:
                    raise Untranslatable(f"{term.qualified} is not kept for each value")
                return self.names[term.qualified], _ATOM
            case t.Construct(constructor=constructor, arguments=arguments):
                return self._row([repr(constructor), *(self._at(a, _OR) for a in arguments)]), _ATOM
            case t.TupleTerm(items=items) | t.SequenceTerm(items=items) | t.SetTerm(items=items):
                return self._row([self._at(item, _OR) for item in items]), _ATOM
            case t.SequenceRange():
                return f"tuple({self._range(term)})", _ATOM
            case t.Apply(function=function, arguments=arguments):
                return self._call(self._at(function, _ATOM), arguments)
            case t.Index(sequence=sequence, index=index):
                return f"{self._at(sequence, _ATOM)}[{self._at(index, _OR)}]", _ATOM
            case t.Item(record=record, position=position):
                return f"{self._at(record, _ATOM)}[{position}]", _ATOM
            case t.Argument(value=value, position=position):
                return f"{self._at(value, _ATOM)}[{position + 1}]", _ATOM
            case t.Length(sequence=sequence):
                return self._call("len", (sequence,))
            case t.Widen(term=inner):
                return self._text(inner)
            case t.Negative(term=inner):
                return f"-{self._at(inner, _SIGN)}", _SIGN
            case t.Arithmetic():
                return self._arithmetic(term)
            case t.Operation(operator=operator, arguments=arguments):
                return self._operation(operator, arguments)
            case t.Conditional(condition=condition, then=then, otherwise=otherwise):
                parts = (self._at(part, _OR) for part in (then, condition, otherwise))
                return "({} if {} else {})".format(*parts), _ATOM
            case t.Compare(operator=operator, left=left, right=right):
                return f"{self._at(left, _ADD)} {operator} {self._at(right, _ADD)}", _COMPARE
            case t.In(item=item, collection=collection):
                return f"{self._at(item, _ADD)} in {self._collection(collection)}", _COMPARE
            case t.Not(body=t.In(item=item, collection=collection)):
                return f"{self._at(item, _ADD)} not in {self._collection(collection)}", _COMPARE
            case t.Not(body=body):
                return f"not {self._at(body, _NOT)}", _NOT
            case t.And(items=items):
                return self._conjunction(items), _AND
            case t.Or(items=items):
                return self._joined(items, " or ", _AND), _OR
            case t.Implies(left=left, right=right):
                return f"{self._at(negation(left), _AND)} or {self._at(right, _AND)}", _OR
            case t.Iff(left=left, right=right):
                return f"{self._at(left, _ADD)} == {self._at(right, _ADD)}", _COMPARE
            case t.Quantified():
                return self._quantified(term)
            case t.History(operator=operator):
                raise Untranslatable(f"`{operator}` speaks of other steps")
            case _:
                assert_never(term)

    def _row(self, parts: Sequence[str]) -> str:
        return f"({', '.join(parts)}{',' if len(parts) == 1 else ''})"

    def _range(self, term: t.SequenceRange) -> str:
        match term.high:
            case t.Arithmetic(operator="-", left=length, right=t.Literal(value=1)):  # the positions of a sequence
                low = "" if term.low == t.Literal(0, term.low.sort) else f"{self._at(term.low, _OR)}, "
                return f"range({low}{self._at(length, _OR)})"
            case _:  # the last number is included
                return f"range({self._at(term.low, _OR)}, {self._at(term.high, _ADD)} + 1)"

    def _collection(self, term: t.Term) -> str:
        return self._range(term) if isinstance(term, t.SequenceRange) else self._at(term, _ADD)

    def _arithmetic(self, term: t.Arithmetic) -> tuple[str, int]:
        match term.operator:
            case "/":  # two integers would make a float
                return f"Fraction({self._at(term.left, _OR)}) / {self._at(term.right, _SIGN)}", _MULTIPLY
            case "*":
                return f"{self._at(term.left, _MULTIPLY)} * {self._at(term.right, _SIGN)}", _MULTIPLY
            case operator:
                return f"{self._at(term.left, _ADD)} {operator} {self._at(term.right, _MULTIPLY)}", _ADD

    def _operation(self, operator: t.Builtin, arguments: Sequence[t.Term]) -> tuple[str, int]:
        match operator:
            case t.Builtin.XOR:
                return self._joined(arguments, " != ", _ADD), _COMPARE
            case t.Builtin.ABS | t.Builtin.MIN | t.Builtin.MAX:
                return self._call(str(operator), arguments)
            case t.Builtin.MOD:
                return f"{self._at(arguments[0], _SIGN)} % {self._at(arguments[1], _SIGN)}", _MULTIPLY
            case t.Builtin.DIV:
                return f"{self._at(arguments[0], _SIGN)} // {self._at(arguments[1], _SIGN)}", _MULTIPLY
            case t.Builtin.SQRT:
                raise Untranslatable("floating point has square roots only nearly")
            case t.Builtin.SIN | t.Builtin.COS | t.Builtin.ATAN2:
                raise Untranslatable(f"floating point has `{operator}` only nearly")

    def _conjunction(self, items: Sequence[t.Term]) -> str:
        """``0 <= x and x < 9`` as a chain of comparisons."""
        parts: list[str] = []
        end: t.Term | None = None
        for item in items:
            rising = isinstance(item, t.Compare) and item.operator in ("<", "<=")
            if rising and isinstance(item, t.Compare) and end == item.left:
                parts[-1] += f" {item.operator} {self._at(item.right, _ADD)}"
            else:
                parts.append(self._at(item, _NOT))
            end = item.right if rising and isinstance(item, t.Compare) else None
        return " and ".join(parts)

    # -- quantifiers -----------------------------------------------------------------------------------------

    def _quantified(self, term: t.Quantified) -> tuple[str, int]:
        inner = self._binding(term.variables)
        match term.quantifier:
            case t.Quantifier.EXISTS:
                return inner._exists(term.variables, term.body)
            case t.Quantifier.FORALL:
                return inner._for_all(term.variables, term.body)
            case t.Quantifier.UNIQUE:
                row = inner._row([inner.names[v.qualified] for v in term.variables])
                parts: list[str] = []
                for inside, items in _branches(term.body, True, term.variables):
                    scope = inner._binding(v for v in inside if v.qualified not in inner.names)
                    loops = scope._loops(inside, items)
                    if loops.before:
                        raise Untranslatable("a condition beside what exists once")
                    parts.append(f"{{{row} {loops.filtered(scope)}}}")
                return f"len({' | '.join(parts)}) == 1", _COMPARE

    def _binding(self, variables: Iterable[t.Variable]) -> Translator:
        names = dict(self.names)
        for variable in variables:
            names[variable.qualified] = safe_name(variable.name, self.reserved | {*names.values()})
        return Translator(names, self.reserved, self.known)

    def _exists(self, variables: Sequence[t.Variable], body: t.Term) -> tuple[str, int]:
        found: list[str] = []
        for inside, items in _branches(body, True, variables):
            scope = self._binding(v for v in inside if v.qualified not in self.names)
            loops = scope._loops(inside, items)
            shown = [scope._at(item, _NOT) for item in loops.before]
            if loops.text:
                shown.append(f"any({scope._conjunction(loops.last) or 'True'} {loops.text})")
            found.append(" and ".join(shown) or "True")
        return " or ".join(found), _OR if len(found) > 1 else _AND

    def _for_all(self, variables: Sequence[t.Variable], body: t.Term) -> tuple[str, int]:
        match body:
            case t.Implies(left=left, right=right):
                cases = [(left, right)]
            case t.Iff(left=left, right=right):
                cases = [(left, right), (right, left)]
            case _:  # no condition names the values: refused below
                cases = []
        try:
            found = [self._each(variables, left, right) for left, right in cases]
        except Untranslatable:
            found = []
        if found:
            return " and ".join(f"({text})" if len(found) > 1 else text for text in found), _OR
        return f"not ({self._exists(variables, negation(body))[0]})", _NOT

    def _each(self, variables: Sequence[t.Variable], given: t.Term, demanded: t.Term) -> str:
        """That `demanded` holds wherever `given` holds."""
        found: list[str] = []
        for inside, items in _branches(given, True, variables):
            scope = self._binding(v for v in inside if v.qualified not in self.names)
            free = {v for v in free_variables(demanded) if v in variables}
            loops = scope._loops(tuple(dict.fromkeys((*inside, *free))), items)
            every = (
                f"all({scope.formula(demanded)} {loops.filtered(scope)})" if loops.text else scope._at(demanded, _AND)
            )
            found.append(" or ".join([*[scope._at(negation(item), _AND) for item in loops.before], every]))
        return " and ".join(f"({text})" if len(found) > 1 else text for text in found)

    def _loops(self, variables: Sequence[t.Variable], items: Sequence[t.Term]) -> _Loops:
        """Raises Untranslatable."""
        used = {v for item in items for v in free_variables(item)}
        unbound = [v for v in variables if v in used]
        left = list(items)
        before = [item for item in left if not free_variables(item) & {*unbound}]
        left = [item for item in left if item not in before]
        text: list[str] = []
        ready: list[t.Term] = []
        while unbound:
            if ready:
                text.append(f"if {self._conjunction(ready)}")
            binder, (loop, bound) = self._binder(left, unbound)
            left = [item for item in left if item is not binder]
            text.append(loop)
            unbound = [v for v in unbound if v not in bound]
            ready = [item for item in left if not free_variables(item) & {*unbound}]
            left = [item for item in left if item not in ready]
        return _Loops(before, " ".join(text), ready)

    def _binder(self, items: Sequence[t.Term], unbound: Sequence[t.Variable]) -> tuple[t.Term | None, Binding]:
        """A loop over the values of some variables, and the part that determines these values."""
        for way in (self._equal, self._row_of, self._member, self._below):
            for item in items:
                found = way(item, items, unbound)
                if found is not None:
                    return item, found
        for variable in unbound:
            match variable.sort:
                case EnumSort(members=members):
                    values = self._row([*map(repr, members)])
                    return None, (f"for {self.names[variable.qualified]} in {values}", {variable})
                case BoolSort():
                    return None, (f"for {self.names[variable.qualified]} in (False, True)", {variable})
        names = ", ".join(v.name for v in unbound)
        raise Untranslatable(f"nothing that it says names the values of {names}")

    def _closed(self, term: t.Term, unbound: Sequence[t.Variable]) -> bool:
        return not free_variables(term) & {*unbound}

    def _pattern(
        self, parts: Sequence[t.Term], unbound: Sequence[t.Variable]
    ) -> tuple[list[str], str, set[t.Variable]] | None:
        """Names for the parts of a row, the checks on them, and the variables among them."""
        names: list[str] = []
        checks: list[str] = []
        bound: set[t.Variable] = set()
        for part in parts:
            if isinstance(part, t.Variable) and part in unbound and part not in bound:
                names.append(self.names[part.qualified])
                bound.add(part)
            elif self._closed(part, [v for v in unbound if v not in bound]):
                names.append(f"_{len(names)}")
                checks.append(f"{names[-1]} == {self._at(part, _ADD)}")
            else:
                return None
        return names, f" if {' and '.join(checks)}" if checks else "", bound

    def _equal(self, item: t.Term, _: Sequence[t.Term], unbound: Sequence[t.Variable]) -> Binding | None:
        if not isinstance(item, t.Compare) or item.operator != "==":
            return None
        for one, other in ((item.left, item.right), (item.right, item.left)):
            if not self._closed(other, unbound):
                continue
            if isinstance(one, t.Variable) and one in unbound:
                natural = isinstance(one.sort, NaturalSort) and not isinstance(other.sort, NaturalSort)
                name = self.names[one.qualified]
                check = f" if {name} >= 0" if natural else ""
                return f"for {name} in [{self._at(other, _OR)}]{check}", {one}
            if isinstance(one, t.Construct) and (made := self._pattern(one.arguments, unbound)) is not None and made[2]:
                names, checks, bound = made
                rows = f"arguments({self._at(other, _OR)}, {one.constructor!r})"
                target = ", ".join(names) + "," * (len(names) == 1)
                return f"for {target} in {rows}{checks}", bound
        return None

    def _row_of(self, item: t.Term, _: Sequence[t.Term], unbound: Sequence[t.Variable]) -> Binding | None:
        if not isinstance(item, t.Apply) or not self._closed(item.function, unbound):
            return None
        made = self._pattern(item.arguments, unbound)
        if made is None or not made[2]:
            return None
        names, checks, bound = made
        return f"for {', '.join(names)} in {self._at(item.function, _ATOM)}.points(){checks}", bound

    def _member(self, item: t.Term, _: Sequence[t.Term], unbound: Sequence[t.Variable]) -> Binding | None:
        if isinstance(item, t.In) and item.item in unbound and self._closed(item.collection, unbound):
            assert isinstance(item.item, t.Variable)
            return f"for {self.names[item.item.qualified]} in {self._collection(item.collection)}", {item.item}
        return None

    def _below(self, item: t.Term, items: Sequence[t.Term], unbound: Sequence[t.Variable]) -> Binding | None:
        """``k < n`` of a natural number, or of an integer that has a lower bound as well."""
        end = _bound(item, unbound, above=True)
        if end is None or not self._closed(end[1], unbound):
            return None
        variable, most, strict = end
        low = "0"
        if isinstance(variable.sort, IntegerSort):
            lower = [b for other in items if (b := _bound(other, (variable,), above=False)) is not None]
            if not lower or not self._closed(lower[0][1], unbound):
                return None
            low = f"{self._at(lower[0][1], _ADD)}{' + 1' if lower[0][2] else ''}"
        high = self._at(most, _OR) if strict else f"{self._at(most, _ADD)} + 1"
        return f"for {self.names[variable.qualified]} in range({'' if low == '0' else low + ', '}{high})", {variable}


@dataclass(frozen=True, slots=True)
class _Loops:
    """The loops over the values of some variables. `before`: conditions without these variables; `last`: conditions on
    all of them."""

    before: Sequence[t.Term]
    text: str
    last: Sequence[t.Term]

    def filtered(self, scope: Translator) -> str:
        return f"{self.text} if {scope._conjunction(self.last)}" if self.last else self.text


def _bound(item: t.Term, unbound: Sequence[t.Variable], *, above: bool) -> tuple[t.Variable, t.Term, bool] | None:
    """The whole number that a comparison bounds from above (or below), the bound, and whether it is strict."""
    if not isinstance(item, t.Compare) or item.operator not in ("<", "<=", ">", ">="):
        return None
    small, large = (item.left, item.right) if (item.operator in ("<", "<=")) else (item.right, item.left)
    one, other = (small, large) if above else (large, small)
    if not isinstance(one, t.Variable) or one not in unbound or isinstance(one.sort, RealSort):
        return None
    return None if isinstance(other.sort, RealSort) else (one, other, item.operator in ("<", ">"))


def _branches(term: t.Term, positive: bool, variables: Sequence[t.Variable] = ()) -> list[Branch]:
    """The alternatives under which a formula (or its negation) holds. Raises Untranslatable if there are too many."""
    found = [((*variables, *inside), items) for inside, items in _alternatives(term, positive)]
    if len(found) > ALTERNATIVES:
        raise Untranslatable("it has too many alternatives")
    return found


def _alternatives(term: t.Term, positive: bool) -> list[Branch]:
    match term:
        case t.Not(body=body):
            return _branches(body, not positive)
        case t.And(items=items) | t.Or(items=items):
            parts = [_branches(item, positive) for item in items]
            if isinstance(term, t.And) is not positive:
                return [branch for part in parts for branch in part]
            return [_together(chosen) for chosen in product(*parts)]
        case t.Implies(left=left, right=right):
            return _alternatives(t.Or((negation(left), right)), positive)
        case t.Iff(left=left, right=right):
            return [
                _together(chosen)
                for one, other in ((True, positive), (False, not positive))
                for chosen in product(_branches(left, one), _branches(right, other))
            ]
        case t.Quantified(quantifier=t.Quantifier.EXISTS, variables=variables, body=body) if positive:
            return _branches(body, True, variables)
        case t.Quantified(quantifier=t.Quantifier.FORALL, variables=variables, body=body) if not positive:
            return _branches(body, False, variables)
        case t.Compare(operator=operator, left=left, right=right) if not positive:
            return [((), (t.Compare(OPPOSITE[operator], left, right),))]
        case _:  # a part that is not decomposed
            return [((), (term if positive else negation(term),))]


def _together(branches: Iterable[Branch]) -> Branch:
    chosen = list(branches)
    return tuple(v for inside, _ in chosen for v in inside), tuple(item for _, items in chosen for item in items)

"""What typed terms mean, by the book and by enumeration: at one step, and over the steps of a run.

Values are Python's: truth values, strings (also for members of an enumeration), numbers, ``("go", "red")`` for data,
tuples for tuples and sequences, dictionaries from arguments to values for functions (`Table`: with a value elsewhere; a
set of arguments: TRUE there alone). A step maps names as a formula writes them (``in.a``) to values; a run is a list of
steps, or what can be asked for the step at each of its places.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import chain, product
from typing import Any

from avow.formulas.values import Data, Element, FunctionValue, SequenceValue
from avow.language.sorts import (
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
    RESPONSES,
    And,
    Apply,
    Argument,
    Arithmetic,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    History,
    Iff,
    Implies,
    In,
    Index,
    Item,
    Length,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
    Past,
    Quantified,
    Quantifier,
    SequenceRange,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
    Widen,
)

Step = Mapping[str, Any]
Run = Sequence[Step]
NOWHERE: Step = {}

COMPARED: Mapping[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_OPERATIONS: Mapping[str, Callable[[Any, Any], Any]] = {"+": operator.add, "-": operator.sub, "*": operator.mul}


class NoValue(Exception):  # noqa: N818 - it names what a term has
    """A partial operation is asked for a value that it does not have."""


class Table(dict[Any, Any]):
    """A total function: points, and what it is elsewhere."""

    def __init__(self, points: Mapping[Any, Any], default: Any) -> None:
        super().__init__(points)
        self.default = default

    def __missing__(self, _: Any) -> Any:
        return self.default


def plain(value: Any) -> Any:
    """A value of Avow's as the oracle has it."""
    match value:
        case Element(name=name):
            return name
        case Data(constructor=name, arguments=arguments):
            return (name, *map(plain, arguments))
        case SequenceValue(items=items) | tuple(items):
            return tuple(map(plain, items))
        case FunctionValue(table=table, default=default):
            return Table({tuple(map(plain, at)): plain(v) for at, v in table.items()}, plain(default))
        case bool() | str():
            return value
    return Fraction(value)


def domain(sort: Sort) -> list[Any]:
    """All values of a finite sort; of an infinite one, some simple values, in the order of size."""
    match sort:
        case BoolSort():
            return [False, True]
        case EnumSort(members=members):
            return list(members)
        case NaturalSort():
            return [0, 1, 2, 3]
        case IntegerSort():
            return [-2, -1, 0, 1, 2, 3]
        case RealSort():
            return [Fraction(0), Fraction(1, 2), Fraction(1), Fraction(2), Fraction(7, 3)]
        case StringSort():
            return ["", "a", "zz"]
        case DataSort(constructors=constructors):
            return [(c.name, *items) for c in constructors for items in product(*map(domain, c.parameters))]
        case TupleSort(items=items):
            return list(product(*map(domain, items)))
        case SequenceSort(item=item):
            return _sequences(domain(item))
        case FunctionSort(parameters=parameters, result=result):
            points = list(product(*map(domain, parameters)))
            return [dict(zip(points, values, strict=True)) for values in product(domain(result), repeat=len(points))]
    raise AssertionError(sort)


def _sequences(items: list[Any]) -> list[Any]:
    """All of up to one element (up to two, of two values), and one that is longer."""
    most = 2 if len(items) <= 2 else 1
    short = chain.from_iterable(product(items, repeat=length) for length in range(most + 1))
    return [*short, (items[0],) * (most + 1)]


def is_finite(sort: Sort) -> bool:
    match sort:
        case BoolSort() | EnumSort():
            return True
        case DataSort(constructors=constructors):
            return all(is_finite(p) for c in constructors for p in c.parameters)
        case TupleSort(items=items):
            return all(map(is_finite, items))
        case FunctionSort(parameters=parameters, result=result):
            return all(map(is_finite, (*parameters, result)))
        case _:
            return False


def situations(variables: Iterable[Variable]) -> list[Step]:
    """Every choice of values for some variables."""
    listed = list(variables)
    names = [v.qualified for v in listed]
    return [dict(zip(names, chosen, strict=True)) for chosen in product(*(domain(v.sort) for v in listed))]


class Meaning:
    """Values of terms. A partial operation has no value outside its domain, and a formula none that hangs on it; or
    its value there is the `unspecified`-th of the values in `domain`, and `strayed` tells that one was asked for.
    `ranges`: what quantified variables of infinite sorts range over; else over what their formula restricts them to."""

    def __init__(self, unspecified: int | None = 0, ranges: Mapping[Sort, Iterable[Any]] = {}) -> None:
        self.unspecified = unspecified
        self.ranges = ranges
        self.strayed = False

    def holds(self, formula: Term, step: Step) -> bool:
        """Of one that speaks of this step alone."""
        found = self.value(formula, [step])
        assert isinstance(found, bool)
        return found

    def truth(self, formula: Term, run: Run, k: int = 0, bound: Step = NOWHERE) -> bool | None:
        """None: it has no value."""
        try:
            return bool(self.value(formula, run, k, bound))
        except NoValue:
            return None

    def value(self, term: Term, run: Run, k: int = 0, bound: Step = NOWHERE) -> Any:
        """At step `k`; a response is looked at as far as the run goes. Raises NoValue."""
        match term:
            case Literal(value=value):
                return value if isinstance(value, bool | str) else Fraction(value)
            case Variable():
                name = term.qualified
                return bound[name] if name in bound else run[k][name]
            case Widen(term=inner):
                return self.value(inner, run, k, bound)
            case Not(body=body):
                return not self.value(body, run, k, bound)
            case And(items=items):
                return self._decided((self.truth(item, run, k, bound) for item in items), False)
            case Or(items=items):
                return self._decided((self.truth(item, run, k, bound) for item in items), True)
            case Implies(left=left, right=right):
                return self.value(Or((Not(left), right)), run, k, bound)
            case Iff(left=left, right=right):
                return self.value(left, run, k, bound) == self.value(right, run, k, bound)
            case Compare(operator=sign, left=left, right=right):
                return COMPARED[sign](self.value(left, run, k, bound), self.value(right, run, k, bound))
            case In(item=item, collection=collection):
                return self.value(item, run, k, bound) in self._members(collection, run, k, bound)
            case Quantified():
                return self._quantified(term, run, k, bound)
            case History():
                return self.history(term, run, k, bound)
            case _:
                return self._built(term, run, k, bound)

    def _decided(self, truths: Iterator[bool | None], end: bool) -> bool:
        """`end` where one of them is that. Raises NoValue where it hangs on one without a value."""
        unsure = False
        for found in truths:
            if found is end:
                return end
            unsure |= found is None
        if unsure:
            raise NoValue
        return not end

    def _built(self, term: Term, run: Run, k: int, bound: Step) -> Any:
        def of(part: Term) -> Any:
            return self.value(part, run, k, bound)

        match term:
            case EnumValue(name=name):
                return name
            case Apply(function=function, arguments=arguments):
                found, at = of(function), tuple(map(of, arguments))
                return found[at] if isinstance(found, dict) else at in found
            case Construct(constructor=constructor, arguments=arguments):
                return (constructor, *map(of, arguments))
            case Argument(value=whole, constructor=constructor, position=position):
                name, *given = of(whole)
                return given[position] if name == constructor else self._stray(term.sort)
            case TupleTerm(items=items) | SequenceTerm(items=items):
                return tuple(map(of, items))
            case SequenceRange():
                return tuple(self._members(term, run, k, bound))
            case Index(sequence=sequence, index=index):
                items, at = of(sequence), of(index)
                return items[int(at)] if 0 <= at < len(items) else self._stray(term.sort)
            case Length(sequence=sequence):
                return len(of(sequence))
            case Item(record=record, position=position):
                return of(record)[position]
            case Negative(term=inner):
                return -of(inner)
            case Arithmetic(operator=sign, left=left, right=right):
                one, other = of(left), of(right)
                if sign == "/":
                    return Fraction(one) / other if other else self._stray(term.sort)
                return _OPERATIONS[sign](one, other)
            case Conditional(condition=condition, then=then, otherwise=otherwise):
                return of(then if of(condition) else otherwise)
            case Operation(operator=name, arguments=arguments):
                return _builtin(name, list(map(of, arguments)))
        raise AssertionError(term)

    def _stray(self, sort: Sort) -> Any:
        self.strayed = True
        if self.unspecified is None:
            raise NoValue
        return domain(sort)[self.unspecified]

    def _members(self, collection: Term, run: Run, k: int, bound: Step) -> list[Any]:
        match collection:
            case SetTerm(items=items):
                return [self.value(item, run, k, bound) for item in items]
            case SequenceRange(low=low, high=high):
                first, last = (int(self.value(end, run, k, bound)) for end in (low, high))
                return list(range(first, last + 1))
            case _:
                return list(self.value(collection, run, k, bound))

    def _quantified(self, term: Quantified, run: Run, k: int, bound: Step) -> bool:
        found = (self.truth(term.body, run, k, {**bound, **more}) for more in self._choices(term, run, k, bound))
        match term.quantifier:
            case Quantifier.FORALL:
                return self._decided(found, False)
            case Quantifier.EXISTS:
                return self._decided(found, True)
            case Quantifier.UNIQUE:
                listed = list(found)
                if listed.count(True) < 2 and None in listed:
                    raise NoValue
                return listed.count(True) == 1

    def _choices(self, term: Quantified, run: Run, k: int, bound: Step) -> Iterator[Step]:
        ranges: list[Iterable[Any]] = []
        for variable in term.variables:
            if is_finite(variable.sort):
                ranges.append(domain(variable.sort))
            elif variable.sort in self.ranges:
                ranges.append(self.ranges[variable.sort])
            else:
                ranges.append(dict.fromkeys(self._members(_range_of(variable, term), run, k, bound)))
        names = [variable.qualified for variable in term.variables]
        for choice in product(*ranges):
            yield dict(zip(names, choice, strict=True))

    # -- other steps ---------------------------------------------------------------------------------------------------

    def history(self, term: History, run: Run, k: int, bound: Step) -> Any:
        """From the definitions over all steps of a run."""
        f, *others = term.arguments

        def at(formula: Term, j: int) -> Any:
            return self.value(formula, run, self.place(j), bound)

        def all_along(formula: Term, first: int, last: int) -> bool:
            return all(at(formula, j) for j in range(first, last + 1))

        limit = None if term.limit is None else at(term.limit.amount, k)
        match term.operator:
            case Past.PREVIOUS:
                return at(f, k - 1) if k else at(others[0], 0)
            case Past.ROSE:
                return at(f, k) and not (k > 0 and at(f, k - 1))
            case Past.FELL:
                return k > 0 and at(f, k - 1) and not at(f, k)
            case Past.CHANGED:
                return k > 0 and at(f, k - 1) != at(f, k)
            case Past.ONCE:
                return any(at(f, j) for j in range(k + 1) if limit is None or k - j <= limit)
            case Past.HISTORICALLY:
                return all(at(f, j) for j in range(k + 1) if limit is None or k - j <= limit)
            case Past.HELD:
                return any(k - j >= limit and all_along(f, j, k) for j in range(k + 1))
            case Past.SINCE:
                fits = COMPARED[term.limit.relation if term.limit is not None else ">="]
                return any(
                    at(others[0], j) and all_along(f, j + 1, k) and fits(k - j, 0 if limit is None else limit)
                    for j in range(k + 1)
                )
            case Past.COUNTED:
                last = max((j for j in range(k + 1) if at(others[0], j)), default=-1)
                return sum(1 for j in range(last + 1, k + 1) if at(f, j))
        raise AssertionError(term.operator)

    def place(self, j: int) -> int:
        """Where a run has its step `j`."""
        return j

    def broken(self, trigger: Term, response: History, run: Run) -> int | None:
        """The first step at which a run has broken `trigger -> response`, by what a response demands of the steps that
        follow its trigger; None where no step has."""
        wanted = response.arguments[0]
        limit = None if response.limit is None else response.limit.amount.value  # type: ignore[union-attr]
        found: list[int] = []

        def at(formula: Term, k: int) -> Any:
            return self.value(formula, run, k)

        for j in range(len(run)):
            if not at(trigger, j):
                continue
            match response.operator:
                case Past.NEXT:
                    found += [k for k in (j + 1,) if k < len(run) and not at(wanted, k)]
                case Past.FOR:
                    found += [k for k in range(j, j + limit + 1) if k < len(run) and not at(wanted, k)]
                case Past.WITHIN:
                    due = j + limit
                    if due < len(run) and not any(at(wanted, k) for k in range(j, due + 1)):
                        found.append(due)
                case Past.UNTIL:
                    for k in range(j, len(run)):
                        if at(response.arguments[1], k):
                            break
                        if not at(wanted, k):
                            found.append(k)
                            break
                case _:
                    raise AssertionError(response.operator)
        return min(found, default=None)


def value(term: Term, run: Run, k: int) -> Any:
    return Meaning().value(term, run, k)


def holds(formula: Term, step: Step) -> bool:
    return Meaning().holds(formula, step)


def broken(trigger: Term, response: History, run: Run) -> int | None:
    return Meaning().broken(trigger, response, run)


def keeps(clause: Term, run: Run) -> bool:
    """Whether a clause is not broken at the last step of a run (and, of a response, at none before)."""
    if isinstance(clause, Implies) and isinstance(clause.right, History) and clause.right.operator in RESPONSES:
        return broken(clause.left, clause.right, run) is None
    return bool(value(clause, run, len(run) - 1))


def breaks(clause: Term, run: Run) -> bool:
    """Whether some step of a run breaks a clause."""
    return not all(keeps(clause, run[: k + 1]) for k in range(len(run)))


def _builtin(name: str, given: list[Any]) -> Any:
    match name:
        case "xor":
            return (given[0] or given[1]) and not (given[0] and given[1])
        case "abs":
            return given[0] if given[0] >= 0 else -given[0]
        case "min":
            return sorted(given)[0]
        case "max":
            return sorted(given)[-1]
    assert name in ("mod", "div"), f"the oracle does not know {name}: describe it in {__file__}"
    whole, divisor = given
    quotient = next(q for q in chain.from_iterable((k, -k) for k in range(10**6)) if 0 <= whole - q * divisor < divisor)
    return quotient if name == "div" else whole - quotient * divisor


def _range_of(variable: Variable, term: Quantified) -> Term:
    """The collection that the body restricts a variable of an infinite sort to."""
    stack = [term.body]
    while stack:
        match stack.pop():
            case In(item=Variable() as item, collection=collection) if item == variable:
                return collection
            case And(items=items):
                stack.extend(reversed(items))
            case Implies(left=left) if term.quantifier is Quantifier.FORALL:
                stack.append(left)
    raise AssertionError(f"{variable.name} ranges over too much")

"""A formula as SMT-LIB 2.6 text: the one translation that a certified claim rests on.

NATURAL is Int, with membership said wherever a natural can stand: of free and bound variables, of functions' results,
of parts of data; an element beyond a sequence's end is some value of its type. Division by zero is some value.
Functions that are free are uninterpreted functions; functions under a quantifier are arrays, one argument after the
other. Nothing is simplified: the text says what the formula says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from typing import assert_never

from avow.language.sorts import (
    INTEGER,
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    SequenceSort,
    SetSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Builtin,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Index,
    Length,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
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

_MAX_CHARACTER = 0x2FFFF
"""The largest code point of an SMT-LIB string."""

_MAX_RANGE = 1000

Symbols = Callable[[Variable], tuple[str, Sort]]
"""What a free variable is called, and its sort (an INTEGER input may read a NATURAL output)."""


class Untranslatable(Exception):  # noqa: N818 - it names what happened
    """The text cannot be written: the question stays open."""


class Text:
    """The text of one question or claim. `declarations` grow as sorts and free variables are used."""

    def __init__(self) -> None:
        self.declarations: dict[str, str] = {}
        """Name → command, each after those that it needs."""
        self.free: dict[str, Sort] = {}
        self._sorts: dict[str, Sort] = {}
        self._bound = 0

    def formula(self, term: Term, symbols: Symbols, bound: Mapping[Variable, str] | None = None) -> str:
        """The formula's text; its bound variables are numbered from the first on. Raises Untranslatable."""
        self._bound = 0
        try:
            return _Formula(self, symbols).text(term, dict(bound or {}))
        except RecursionError:
            raise Untranslatable("a formula that is too deep") from None

    def facts(self) -> list[str]:
        """What is true of the free variables by their types."""
        found = []
        for name, sort in self.free.items():
            self._bound = 0
            fact = self.member(sort, name)
            if fact is not None:
                found.append(fact)
        return found

    def declare(self, name: str, sort: Sort) -> None:
        """A free variable."""
        if self.free.setdefault(name, sort) != sort:
            raise Untranslatable(f"{name} has two types")
        if name not in self.declarations:
            parameters = sort.parameters if isinstance(sort, FunctionSort) else ()
            result = sort.result if isinstance(sort, FunctionSort) else sort
            signature = f"({' '.join(map(self.field, parameters))}) {self.field(result)}"
            self.declarations[name] = f"(declare-fun {name} {signature})"

    def fresh(self) -> str:
        """A name for a bound variable."""
        self._bound += 1
        return f"b{self._bound}"

    # -- sorts ---------------------------------------------------------------------------------------------------------

    def sort(self, sort: Sort) -> str:
        """The name of a sort, declared with those that it is made of."""
        match sort:
            case BoolSort():
                return "Bool"
            case RealSort():
                return "Real"
            case IntegerSort() | NaturalSort():
                return "Int"
            case StringSort():
                return "String"
            case SequenceSort(item=item):
                return f"(Seq {self.field(item)})"
            case FunctionSort(parameters=parameters, result=result):
                name = self.field(result)
                for parameter in reversed(parameters):
                    name = f"(Array {self.field(parameter)} {name})"
                return name
            case OpaqueSort(name=own):
                name = self._named(own, sort)
                self.declarations.setdefault(name, f"(declare-sort {name} 0)")
            case EnumSort(name=own, members=members):
                name = self._named(own, sort)
                constructors = " ".join(f"({part(name, member)})" for member in members)
                self.declarations.setdefault(name, f"(declare-datatypes (({name} 0)) (({constructors})))")
            case DataSort(name=own, constructors=made):
                name = self._named(own, sort)
                self._datatype(name, [(part(name, c.name), c.parameters) for c in made])
            case TupleSort(items=items):
                name = symbol(f"({','.join(bare(self.field(item)) for item in items)})")
                self._datatype(name, [(part(name, "of"), items)])
            case SetSort():
                raise Untranslatable("a set outside the right-hand side of `in`")
        return name

    def field(self, sort: Sort) -> str:
        """The name of a sort that is part of another value."""
        if isinstance(sort, FunctionSort | SetSort):
            raise Untranslatable("a function or a set as part of another value")
        return self.sort(sort)

    def _named(self, own: str, sort: Sort) -> str:
        """The name of a declared type; two types of one name are told apart by a prime, in the order of their use."""
        name = symbol(f"type {own}")
        while self._sorts.setdefault(name, sort) != sort:
            name = symbol(bare(name) + "'")
        return name

    def _datatype(self, name: str, constructors: list[tuple[str, tuple[Sort, ...]]]) -> None:
        if name in self.declarations:
            return
        written = []
        for constructor, parameters in constructors:
            fields = "".join(f" ({part(constructor, k)} {self.field(p)})" for k, p in enumerate(parameters))
            written.append(f"({constructor}{fields})")
        self.declarations[name] = f"(declare-datatypes (({name} 0)) (({' '.join(written)})))"

    def member(self, sort: Sort, value: str) -> str | None:
        """That a value is one of its sort: its naturals are not negative. None where every one is."""
        match sort:
            case NaturalSort():
                return f"(>= {value} 0)"
            case TupleSort(items=items):
                name = part(self.sort(sort), "of")
                return conjunction(self.member(p, f"({part(name, k)} {value})") for k, p in enumerate(items))
            case DataSort(constructors=constructors):
                cases = []
                for made in constructors:
                    name = part(self.sort(sort), made.name)
                    inside = conjunction(
                        self.member(p, f"({part(name, k)} {value})") for k, p in enumerate(made.parameters)
                    )
                    cases.append(None if inside is None else f"(=> ((_ is {name}) {value}) {inside})")
                return conjunction(cases)
            case SequenceSort(item=item):
                at = self.fresh()
                inside = self.member(item, f"(seq.nth {value} {at})")
                within = f"(and (>= {at} 0) (< {at} (seq.len {value})))"
                return None if inside is None else f"(forall (({at} Int)) (=> {within} {inside}))"
            case FunctionSort(parameters=parameters, result=result):
                names = [self.fresh() for _ in parameters]
                inside = self.member(result, application(value, names, is_array=not value.startswith("|")))
                given = conjunction(self.member(p, n) for p, n in zip(parameters, names, strict=True))
                body = inside if given is None else f"(=> {given} {inside})"
                return None if inside is None else f"(forall ({self.binders(names, parameters)}) {body})"
            case _:  # every value of its SMT-LIB sort is one of it
                return None

    def clamped(self, value: str, sort: Sort) -> str:
        """The value where it is one of the sort, else some value of the sort that depends on it alone."""
        match sort:
            case NaturalSort():
                return f"(ite (>= {value} 0) {value} 0)"
            case TupleSort(items=items) if self.member(sort, value) is not None:
                name = part(self.sort(sort), "of")
                return (
                    f"({name} {' '.join(self.clamped(f'({part(name, k)} {value})', p) for k, p in enumerate(items))})"
                )
            case _:  # as it is
                return value  # more values than the sort has: what is shown of all of them is shown of its own

    def binders(self, names: Iterable[str], sorts: Iterable[Sort]) -> str:
        return " ".join(f"({n} {self.sort(s)})" for n, s in zip(names, sorts, strict=True))


class _Formula:
    def __init__(self, text: Text, symbols: Symbols) -> None:
        self.out, self.symbols = text, symbols

    def text(self, term: Term, bound: Mapping[Variable, str]) -> str:
        def say(part_: Term) -> str:
            return self.text(part_, bound)

        match term:
            case Literal():
                return _literal(term)
            case EnumValue(name=name, sort=enum):
                return part(self.out.sort(enum), name)
            case Variable():
                return self.variable(term, bound)
            case Apply(function=Variable() as function, arguments=arguments):
                assert isinstance(function.sort, FunctionSort)
                fitted = [self.fit(a, p, bound) for a, p in zip(arguments, function.sort.parameters, strict=True)]
                return application(self.name(function, bound), fitted, is_array=function in bound)
            case Construct(constructor=name, arguments=arguments, sort=data):
                sorts = data.constructor(name).parameters
                fitted = [self.fit(a, p, bound) for a, p in zip(arguments, sorts, strict=True)]
                return application(part(self.out.sort(data), name), fitted)
            case TupleTerm(items=items, sort=tuple_sort):
                fitted = [self.fit(a, p, bound) for a, p in zip(items, tuple_sort.items, strict=True)]
                return application(part(self.out.sort(tuple_sort), "of"), fitted)
            case Widen(term=inner):
                return self.real(inner, bound)
            case Negative(term=inner):
                return f"(- {say(inner)})"
            case Arithmetic(operator="/", left=left, right=right):
                return f"(/ {self.real(left, bound)} {self.real(right, bound)})"
            case Arithmetic(operator="+" | "-" | "*" as operator, left=left, right=right):
                one, other = self.alike(left, right, bound)
                return f"({operator} {one} {other})"
            case Conditional(sort=sort):
                condition, then, otherwise = term.children
                return f"(ite {say(condition)} {self.fit(then, sort, bound)} {self.fit(otherwise, sort, bound)})"
            case Operation(operator=name, arguments=arguments, sort=sort):
                return _operation(name, [self.fit(a, sort, bound) for a in arguments])
            case Not(body=body):
                return f"(not {say(body)})"
            case And(items=items):
                return f"(and {' '.join(map(say, items))})" if items else "true"
            case Or(items=items):
                return f"(or {' '.join(map(say, items))})" if items else "false"
            case Implies(left=left, right=right):
                return f"(=> {say(left)} {say(right)})"
            case Iff(left=left, right=right):
                return f"(= {say(left)} {say(right)})"
            case Compare():
                return self.compare(term, bound)
            case In():
                return self.member_of(term, bound)
            case Quantified():
                return self.quantified(term, bound)
            case SequenceTerm(items=items, sort=sequence):
                units = [f"(seq.unit {self.fit(item, sequence.item, bound)})" for item in items]
                return self.sequence(units, sequence)
            case SequenceRange(low=Literal(value=low), high=Literal(value=high), sort=sequence):
                first, last = int(low), int(high)
                if last - first > _MAX_RANGE:
                    raise Untranslatable("a long range as a value")
                return self.sequence([f"(seq.unit {_integer(k)})" for k in range(first, last + 1)], sequence)
            case Length(sequence=SequenceRange(low=low_term, high=high_term)):
                one, other = say(low_term), say(high_term)
                return f"(ite (>= {other} {one}) (+ (- {other} {one}) 1) 0)"
            case Length(sequence=inner):
                return f"(seq.len {say(inner)})"
            case Index(sequence=inner, index=at, sort=sort):
                return self.out.clamped(f"(seq.nth {say(inner)} {say(at)})", sort)
            case _:
                raise Untranslatable(f"{type(term).__name__} here")

    def name(self, variable: Variable, bound: Mapping[Variable, str]) -> str:
        if variable in bound:
            return bound[variable]
        name, sort = self.symbols(variable)
        self.out.declare(name, sort)
        return name

    def variable(self, variable: Variable, bound: Mapping[Variable, str]) -> str:
        if isinstance(variable.sort, FunctionSort) and variable not in bound:
            raise Untranslatable("a function as a value")
        return self.name(variable, bound)

    def sequence(self, units: list[str], sort: SequenceSort) -> str:
        if not units:
            return f"(as seq.empty {self.out.sort(sort)})"
        return units[0] if len(units) == 1 else f"(seq.++ {' '.join(units)})"

    def real(self, term: Term, bound: Mapping[Variable, str]) -> str:
        text = self.text(term, bound)
        return text if isinstance(term.sort, RealSort) else f"(to_real {text})"

    def fit(self, term: Term, sort: Sort, bound: Mapping[Variable, str]) -> str:
        return self.real(term, bound) if isinstance(sort, RealSort) else self.text(term, bound)

    def alike(self, left: Term, right: Term, bound: Mapping[Variable, str]) -> tuple[str, str]:
        numbers = [isinstance(term.sort, RealSort) for term in (left, right)]
        if any(numbers) and not all(numbers):
            return self.real(left, bound), self.real(right, bound)
        return self.text(left, bound), self.text(right, bound)

    def compare(self, term: Compare, bound: Mapping[Variable, str]) -> str:
        operator = term.operator
        if operator in ("==", "!="):
            same = self.same(term.left, term.right, bound)
            return same if operator == "==" else f"(not {same})"
        one, other = self.alike(term.left, term.right, bound)
        return f"({operator} {one} {other})"

    def same(self, left: Term, right: Term, bound: Mapping[Variable, str]) -> str:
        if isinstance(left.sort, FunctionSort):
            if not (isinstance(left, Variable) and isinstance(right, Variable)):
                raise Untranslatable("functions compared that are not variables")
            names = [self.out.fresh() for _ in left.sort.parameters]
            sides = [application(self.name(v, bound), names, is_array=v in bound) for v in (left, right)]
            given = conjunction(self.out.member(p, n) for p, n in zip(left.sort.parameters, names, strict=True))
            equal = f"(= {' '.join(sides)})"
            body = equal if given is None else f"(=> {given} {equal})"
            return f"(forall ({self.out.binders(names, left.sort.parameters)}) {body})"
        for one, other in ((left, right), (right, left)):
            if isinstance(one, SequenceRange) and not _written_out(one):
                return self.same_range(one, other, bound)
        first, second = self.alike(left, right, bound)
        return f"(= {first} {second})"

    def same_range(self, one: SequenceRange, other: Term, bound: Mapping[Variable, str]) -> str:
        low, high = self.text(one.low, bound), self.text(one.high, bound)
        if isinstance(other, SequenceRange):
            start, end = self.text(other.low, bound), self.text(other.high, bound)
            return f"(or (and (= {low} {start}) (= {high} {end})) (and (< {high} {low}) (< {end} {start})))"
        value, at = self.text(other, bound), self.out.fresh()
        length = f"(= (seq.len {value}) (ite (>= {high} {low}) (+ (- {high} {low}) 1) 0))"
        inside = f"(and (>= {at} 0) (< {at} (seq.len {value})))"
        return f"(and {length} (forall (({at} Int)) (=> {inside} (= (seq.nth {value} {at}) (+ {low} {at})))))"

    def member_of(self, term: In, bound: Mapping[Variable, str]) -> str:
        match term.collection:
            case SetTerm(items=items) | SequenceTerm(items=items):
                equal = [f"(= {' '.join(self.alike(term.item, item, bound))})" for item in items]
                return f"(or {' '.join(equal)})" if equal else "false"
            case SequenceRange(low=low, high=high):
                item = self.text(term.item, bound)
                return f"(and (<= {self.text(low, bound)} {item}) (<= {item} {self.text(high, bound)}))"
            case collection:
                assert isinstance(collection.sort, SequenceSort)
                item = self.fit(term.item, collection.sort.item, bound)
                return f"(seq.contains {self.text(collection, bound)} (seq.unit {item}))"

    def quantified(self, term: Quantified, bound: Mapping[Variable, str]) -> str:
        def named() -> tuple[list[str], str, str | None, str]:
            names = [self.out.fresh() for _ in term.variables]
            binders = self.out.binders(names, sorts)
            given = conjunction(self.out.member(s, n) for s, n in zip(sorts, names, strict=True))
            return (
                names,
                binders,
                given,
                self.text(term.body, {**bound, **dict(zip(term.variables, names, strict=True))}),
            )

        sorts = [v.sort for v in term.variables]
        names, binders, given, body = named()
        if term.quantifier is Quantifier.FORALL:
            return f"(forall ({binders}) {body if given is None else f'(=> {given} {body})'})"
        within = body if given is None else f"(and {given} {body})"
        if term.quantifier is Quantifier.EXISTS:
            return f"(exists ({binders}) {within})"
        if any(isinstance(s, FunctionSort) for s in sorts):
            raise Untranslatable("unique existence of a function")
        # there is one, and every one is that one
        others, more, again, other_body = named()
        if again is not None:
            other_body = f"(and {again} {other_body})"
        equal = conjunction(f"(= {other} {name})" for other, name in zip(others, names, strict=True))
        return f"(exists ({binders}) (and {within} (forall ({more}) (=> {other_body} {equal}))))"


def symbol(name: str) -> str:
    """A quoted symbol; what may not stand in one, and the dollar sign, is written by its code."""
    plain = (c if " " <= c <= "~" and c not in "|\\$" else f"${ord(c):x}$" for c in name)
    return f"|{''.join(plain)}|"


def bare(name: str) -> str:
    return name.replace("|", "")


def part(name: str, of: object) -> str:
    """The symbol of a constructor or of a field."""
    return f"|{bare(name)}.{of}|"


def application(function: str, arguments: Iterable[str], *, is_array: bool = False) -> str:
    arguments = list(arguments)
    if not is_array:
        return f"({function} {' '.join(arguments)})" if arguments else function
    for argument in arguments:
        function = f"(select {function} {argument})"
    return function


def conjunction(parts: Iterable[str | None]) -> str | None:
    given = [text for text in parts if text is not None]
    return None if not given else given[0] if len(given) == 1 else f"(and {' '.join(given)})"


def _operation(name: Builtin, arguments: list[str]) -> str:
    first, *rest = arguments
    match name:
        case Builtin.ABS:
            return f"(ite (< {first} 0) (- {first}) {first})"
        case Builtin.MIN | Builtin.MAX:
            for other in rest:
                first = f"(ite ({'<' if name is Builtin.MIN else '>'} {other} {first}) {other} {first})"
            return first
        case Builtin.XOR | Builtin.MOD | Builtin.DIV:  # whole division as in SMT-LIB; the divisor is positive
            return f"({name} {first} {rest[0]})"
        case _:
            assert_never(name)


def _integer(value: int) -> str:
    return str(value) if value >= 0 else f"(- {-value})"


def _literal(literal: Literal) -> str:
    match literal.value, literal.sort:
        case bool() as truth, BoolSort():
            return "true" if truth else "false"
        case (int() | Fraction()) as number, RealSort():
            exact = Fraction(number)
            text = f"{abs(exact.numerator)}.0"
            text = text if exact.denominator == 1 else f"(/ {text} {exact.denominator}.0)"
            return text if exact >= 0 else f"(- {text})"
        case (int() | Fraction()) as number, IntegerSort() | NaturalSort() if Fraction(number).denominator == 1:
            return _integer(int(number))
        case str() as characters, StringSort():
            if any(ord(c) > _MAX_CHARACTER for c in characters):
                raise Untranslatable("a string with a character beyond U+2FFFF")
            plain = (c if " " <= c <= "~" and c not in '\\"' else f"\\u{{{ord(c):x}}}" for c in characters)
            return f'"{"".join(plain)}"'
    raise Untranslatable(f"the literal {literal.value!r}")


def _written_out(term: SequenceRange) -> bool:
    return isinstance(term.low, Literal) and isinstance(term.high, Literal) and term.sort.item == INTEGER

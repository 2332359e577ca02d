"""A formula as SMT-LIB 2.6 text: the one translation that a certified claim depends on. Nothing is simplified.

NATURAL is Int, with membership asserted wherever a natural can occur: for free and bound variables, functions' results,
parts of data; an element beyond a sequence's end is some value of its type. A quotient by zero, the square root of a
negative number and the angle of no vector are some value. A sine, a cosine and an angle are a number each for which the
facts of `avow.language.facts` hold. Free functions are uninterpreted; functions under a quantifier are arrays.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import reduce

from avow.kernel.solvers import BOUNDED
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.bounds import closed
from avow.language.facts import known, together
from avow.language.subterms import subterms

# forms that are one SMT-LIB function of their parts; comparisons and arithmetic are written as in RCL
FORMS: dict[type, str] = {t.Not: "not", t.And: "and", t.Or: "or", t.Implies: "=>", t.Iff: "=", t.Conditional: "ite"}
FORMS |= {t.Negative: "-", t.Widen: "to_real", t.Length: "seq.len"}
SORTS: dict[s.Sort, str] = {s.BOOL: "Bool", s.REAL: "Real", s.INTEGER: "Int", s.NATURAL: "Int", s.STRING: "String"}
BUILTINS: dict[t.Builtin, Callable[..., str]] = {
    t.Builtin.XOR: lambda a, b: f"(xor {a} {b})",
    t.Builtin.MOD: lambda a, b: f"(mod {a} {b})",  # here and below the divisor is a positive literal
    t.Builtin.DIV: lambda a, b: f"(div {a} {b})",
    t.Builtin.ABS: lambda a: f"(ite (< {a} 0) (- {a}) {a})",
    t.Builtin.MIN: lambda *all_: reduce(lambda a, b: f"(ite (< {b} {a}) {b} {a})", all_),
    t.Builtin.MAX: lambda *all_: reduce(lambda a, b: f"(ite (> {b} {a}) {b} {a})", all_),
}
assert (OTHERS := set(t.Builtin) - BUILTINS.keys()) == {t.Builtin.SQRT, *t.CIRCULAR}, f"no text for {OTHERS}"

# the name of a free variable, with its sort (an INTEGER input may read a NATURAL output); the name of a bound one
Symbols = Callable[[t.Variable], tuple[str, s.Sort]]
Bound = Mapping[t.Variable, str]


class Untranslatable(Exception):  # noqa: N818 - it names what happened
    """The text cannot be written: the question stays open."""


class Text:
    """The text of one question or claim. `declarations` (name → command) grow as sorts and free variables are used."""

    def __init__(self) -> None:
        self.declarations, self.free, self._sorts = dict[str, str](), dict[str, s.Sort](), dict[str, s.Sort]()
        self._bounded = defaultdict[tuple[t.Builtin, ...], list[tuple[str, ...]]](list)

    def formula(self, term: t.Term, symbols: Symbols, bound: Bound | None = None) -> str:
        """The formula's text; its bound variables are numbered from the first on. Raises Untranslatable."""
        self._bound, self._symbols = 0, symbols
        try:
            return self.say(term, bound or {})
        except RecursionError:
            raise Untranslatable("a formula that is too deep") from None

    def script(self, assertions: Iterable[str]) -> str:
        """A question to a solver: can these formulas hold, for values of their types?"""
        facts = [self.member(sort, name) for name, sort in self.free.items()]
        lines = [f"(assert {each})" for each in (*facts, *assertions) if each is not None]
        return "\n".join([BOUNDED if self._bounded else "(set-logic ALL)", *self.declarations.values(), *lines, ""])

    def declare(self, name: str, sort: s.Sort) -> None:
        if self.free.setdefault(name, sort) != sort:
            raise Untranslatable(f"{name} has two types")
        parameters, result = (sort.parameters, sort.result) if isinstance(sort, s.FunctionSort) else ((), sort)
        signature = f"({' '.join(map(self.sort, parameters))}) {self.sort(result)}"
        self.declarations.setdefault(name, f"(declare-fun {name} {signature})")

    def fresh(self, count: int) -> list[str]:
        self._bound += count
        return [f"b{k}" for k in range(self._bound - count + 1, self._bound + 1)]

    def sort(self, sort: s.Sort) -> str:
        """The name of a sort, declared with the sorts that it consists of."""
        match sort:
            case s.BoolSort() | s.RealSort() | s.IntegerSort() | s.NaturalSort() | s.StringSort():
                return SORTS[sort]
            case s.SequenceSort(item=item):
                return f"(Seq {self.sort(item)})"
            case s.OpaqueSort(name=own):
                self.declarations.setdefault(name := self._named(own, sort), f"(declare-sort {name} 0)")
                return name
            case s.EnumSort(name=own, members=members):
                return self._datatype(self._named(own, sort), [(member, ()) for member in members])
            case s.DataSort(name=own, constructors=made):
                return self._datatype(self._named(own, sort), [(c.name, c.parameters) for c in made])
            case s.TupleSort(items=items):
                return self._datatype(f"|({','.join(map(self.sort, items)).replace('|', '')})|", [("of", items)])
            case s.FunctionSort() | s.SetSort():
                raise Untranslatable("a function or a set as part of another value")

    def array(self, sort: s.Sort) -> str:
        """As `sort`, under a quantifier, where functions are arrays."""
        of, to = (sort.parameters, sort.result) if isinstance(sort, s.FunctionSort) else ((), sort)
        return reduce(lambda found, p: f"(Array {self.sort(p)} {found})", reversed(of), self.sort(to))

    def _named(self, own: str, sort: s.Sort) -> str:
        """The name of a declared type; two types of one name are distinguished by a prime, in order of use."""
        name = symbol(f"type {own}")
        while self._sorts.setdefault(name, sort) != sort:
            name = f"{name[:-1]}'|"
        return name

    def _datatype(self, name: str, constructors: list[tuple[str, tuple[s.Sort, ...]]]) -> str:
        if name not in self.declarations:
            made = [(field(name, own), [self.sort(p) for p in parameters]) for own, parameters in constructors]
            written = (f"({c}{''.join(f' ({field(c, k)} {p})' for k, p in enumerate(parts))})" for c, parts in made)
            self.declarations[name] = f"(declare-datatypes (({name} 0)) (({' '.join(written)})))"
        return name

    def member(self, sort: s.Sort, value: str) -> str | None:
        """That a value is one of its sort: its naturals are not negative. None if every value is."""
        match sort:
            case s.NaturalSort():
                return f"(>= {value} 0)"
            case s.TupleSort(items=items):
                return self.members(items, field(self.sort(sort), "of"), value)
            case s.DataSort(constructors=constructors):
                made = [(field(self.sort(sort), c.name), c.parameters) for c in constructors]
                inside = [(name, self.members(parameters, name, value)) for name, parameters in made]
                return conjunction(f"(=> ((_ is {name}) {value}) {own})" for name, own in inside if own is not None)
            case s.SequenceSort(item=item):
                (at,) = self.fresh(1)
                if (own := self.member(item, f"(seq.nth {value} {at})")) is not None:
                    return f"(forall (({at} Int)) (=> (and (>= {at} 0) (< {at} (seq.len {value}))) {own}))"
            case s.FunctionSort(parameters=parameters, result=result):
                names = self.fresh(len(parameters))
                if (own := self.member(result, application(value, names))) is not None:
                    return self.bound("forall", names, parameters, own)
        return None  # every value of its SMT-LIB sort is one of it

    def members(self, sorts: Iterable[s.Sort], constructor: str, value: str) -> str | None:
        return conjunction(self.member(p, f"({field(constructor, k)} {value})") for k, p in enumerate(sorts))

    def bound(self, quantifier: str, names: Iterable[str], sorts: Iterable[s.Sort], body: str) -> str:
        """A quantifier over the values of sorts."""
        names, sorts = tuple(names), tuple(sorts)
        given = conjunction(self.member(sort, name) for sort, name in zip(sorts, names, strict=True))
        if given is not None:
            body = f"(=> {given} {body})" if quantifier == "forall" else f"(and {given} {body})"
        binders = " ".join(f"({name} {self.array(sort)})" for sort, name in zip(sorts, names, strict=True))
        return f"({quantifier} ({binders}) {body})"

    def say(self, term: t.Term, bound: Bound) -> str:
        def form(head: str, parts: Iterable[t.Term]) -> str:
            return application(head, [self.say(part, bound) for part in parts])

        match term:
            case t.Literal():
                return _literal(term)
            case t.EnumValue(name=name, sort=sort):
                return field(self.sort(sort), name)
            case t.Variable(sort=sort):
                if isinstance(sort, s.FunctionSort):
                    raise Untranslatable("a function as a value")
                return self.name(term, bound)
            case t.Apply(function=t.Variable() as function, arguments=arguments):
                return application(self.name(function, bound), [self.say(a, bound) for a in arguments])
            case t.Construct(sort=sort) | t.TupleTerm(sort=sort):
                constructor = term.constructor if isinstance(term, t.Construct) else "of"
                return form(field(self.sort(sort), constructor), term.children)
            case t.Item(record=record, position=position):
                return form(field(field(self.sort(record.sort), "of"), position), (record,))
            case t.And(items=()) | t.Or(items=()):
                return "true" if isinstance(term, t.And) else "false"
            case t.Compare(operator="==" | "!=" as operator, left=left, right=right):
                return ("{}" if operator == "==" else "(not {})").format(self.same(left, right, bound))
            case t.Compare(operator=head) | t.Arithmetic(operator=head):
                return form(head, term.children)
            case t.Operation(operator=name) if name not in BUILTINS and any(part in bound for part in subterms(term)):
                raise Untranslatable(f"`{name}` of what is quantified")
            case t.Operation(operator=t.Builtin.SQRT, arguments=(square,)):
                name = symbol(f"sqrt {(said := self.say(square, bound))}")
                is_root = f"(and (>= {name} 0) (= (* {name} {name}) {said}))"
                self.declarations[name] = f"(declare-fun {name} () Real)\n(assert (=> (>= {said} 0) {is_root}))"
                return name
            case t.Operation(operator=name, arguments=arguments) if name in t.CIRCULAR:
                return self.circular(name, arguments, bound)
            case t.Operation(operator=builtin, arguments=arguments):
                return BUILTINS[builtin](*(self.say(a, bound) for a in arguments))
            case t.In(item=item, collection=t.SetTerm(items=items) | t.SequenceTerm(items=items)):
                return application("or", [form("=", (item, other)) for other in items]) if items else "false"
            case t.In(item=item, collection=t.SequenceRange(low=low, high=high)):
                return f"(and {form('<=', (low, item))} {form('<=', (item, high))})"
            case t.In(item=item, collection=collection):
                return f"(seq.contains {self.say(collection, bound)} (seq.unit {self.say(item, bound)}))"
            case t.SequenceTerm(items=items, sort=sort):
                units, empty = [form("seq.unit", (item,)) for item in items], f"(as seq.empty {self.sort(sort)})"
                return application("seq.++", units) if len(units) > 1 else units[0] if units else empty
            case t.Length(sequence=t.SequenceRange(low=low, high=high)):
                return _how_many(self.say(low, bound), self.say(high, bound))
            case t.Index(sequence=sequence, index=at, sort=sort):
                found = form("seq.nth", (sequence, at))  # beyond the end it is any value of the sort
                return f"(ite (>= {found} 0) {found} 0)" if isinstance(sort, s.NaturalSort) else found
            case t.Quantified():
                return self.quantified(term, bound)
            case _ if type(term) in FORMS:
                return form(FORMS[type(term)], term.children)
            case _:  # a range or a set in a place where it has no text
                raise Untranslatable(f"{type(term).__name__} here")

    def circular(self, operator: t.Builtin, arguments: tuple[t.Term, ...], bound: Bound) -> str:
        """The name of a sine, a cosine or an angle, declared with what is known of it, and of it and earlier ones."""
        given, of = [self.say(a, bound) for a in arguments], together(operator)
        names = [symbol(f"{each} {' '.join(given)}") for each in of]
        if names[0] not in self.declarations:
            values = [closed(t.Operation(each, arguments, s.REAL)) for each in of]
            parts, earlier = (*given, *names), self._bounded[of]
            inner = next((v for v in self._bounded[together(t.Builtin.ATAN2)] if [v[-1]] == given), None)
            facts = [self.say(fact, called) for fact, called in known(of, parts, values, earlier, inner)]
            declared = [f"(declare-fun {name} () Real)" for name in names]
            self.declarations[names[0]] = "\n".join([*declared, *(f"(assert {fact})" for fact in facts)])
            earlier.append(parts)
        return names[of.index(operator)]

    def name(self, variable: t.Variable, bound: Bound) -> str:
        if variable not in bound:
            self.declare(*self._symbols(variable))
        return bound.get(variable) or self._symbols(variable)[0]

    def same(self, left: t.Term, right: t.Term, bound: Bound) -> str:
        match (right, left) if isinstance(left, t.SequenceRange) else (left, right):
            case t.Variable(sort=s.FunctionSort(parameters=sorts)), t.Variable():
                names = self.fresh(len(sorts))
                one, two = (application(self.name(v, bound), names) for v in (left, right) if isinstance(v, t.Variable))
                return self.bound("forall", names, sorts, f"(= {one} {two})")
            case other, t.SequenceRange(low=low_term, high=high_term):
                value, low, high = (self.say(term, bound) for term in (other, low_term, high_term))
                (at,) = self.fresh(1)
                each = f"(=> (and (>= {at} 0) (< {at} (seq.len {value}))) (= (seq.nth {value} {at}) (+ {low} {at})))"
                return f"(and (= (seq.len {value}) {_how_many(low, high)}) (forall (({at} Int)) {each}))"
        return f"(= {self.say(left, bound)} {self.say(right, bound)})"

    def quantified(self, term: t.Quantified, bound: Bound) -> str:
        sorts = [v.sort for v in term.variables]

        def named() -> tuple[list[str], str]:
            names = self.fresh(len(sorts))
            return names, self.say(term.body, {**bound, **dict(zip(term.variables, names, strict=True))})

        names, body = named()
        if term.quantifier is not t.Quantifier.UNIQUE:
            return self.bound(term.quantifier, names, sorts, body)
        if any(isinstance(sort, s.FunctionSort) for sort in sorts):
            raise Untranslatable("unique existence of a function")
        others, again = named()  # one exists, and every one equals it
        equal = conjunction(f"(= {other} {name})" for other, name in zip(others, names, strict=True))
        only = self.bound("forall", others, sorts, f"(=> {again} {equal})")
        return self.bound("exists", names, sorts, f"(and {body} {only})")


def symbol(name: str) -> str:
    """A quoted symbol; characters that are not allowed in one, and the dollar sign, are written by their code."""
    plain = (c if " " <= c <= "~" and c not in "|\\$" else f"${ord(c):x}$" for c in name)
    return f"|{''.join(plain)}|"


def field(of: str, name: object) -> str:
    """The symbol of a constructor of a type, or of a field of a constructor."""
    return f"|{of.replace('|', '')}.{name}|"


def application(function: str, arguments: Iterable[str]) -> str:
    """A function applied to arguments; one that is bound (b1, b2, …) is an array."""
    arguments = tuple(arguments)
    if function[0] == "b":
        return reduce(lambda array, argument: f"(select {array} {argument})", arguments, function)
    return f"({function} {' '.join(arguments)})" if arguments else function


def conjunction(parts: Iterable[str | None]) -> str | None:
    given = [text for text in parts if text is not None]
    return None if not given else given[0] if len(given) == 1 else application("and", given)


def _how_many(low: str, high: str) -> str:
    return f"(ite (>= {high} {low}) (+ (- {high} {low}) 1) 0)"


def _literal(literal: t.Literal) -> str:
    match literal.value, literal.sort:
        case bool() as truth, s.BoolSort():
            return "true" if truth else "false"
        case (int() | Fraction()) as number, s.IntegerSort() | s.NaturalSort() if number.denominator == 1:
            return str(number) if number >= 0 else f"(- {-number})"
        case (int() | Fraction()) as number, s.RealSort():
            text = f"(/ {abs(number.numerator)}.0 {number.denominator}.0)"
            return text if number >= 0 else f"(- {text})"
        case str() as characters, s.StringSort() if all(ord(c) <= 0x2FFFF for c in characters):  # SMT-LIB has no others
            plain = (c if " " <= c <= "~" and c not in '\\"' else f"\\u{{{ord(c):x}}}" for c in characters)
            return f'"{"".join(plain)}"'
    raise Untranslatable(f"the literal {literal.value!r}")

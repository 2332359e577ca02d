"""Typed terms as Dafny expressions, and the contract's names as Dafny identifiers.

Every quantifier becomes a call of a named predicate that holds its body: bare nested quantifiers give Dafny no terms as
triggers, and an implementation can name a witness (``assert Contract.exit_ex1(in_map, out_command, x, y)``).
Partial operations (division by zero, an element beyond a sequence's end) become calls of functions that are unspecified
there, so that every proof holds for any reading of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from functools import reduce
from typing import assert_never

from avow.base.diagnostics import Span
from avow.base.plain import decimal
from avow.base.records import dataclass
from avow.formulas.formula import free_variables
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.operators import OPERATORS, Level, Operator, Why


class NotExpressible(Exception):  # noqa: N818 - it names what the term is
    """A construct without a counterpart here; clauses that need it are reported as not covered."""

    def __init__(self, what: str, span: Span | None) -> None:
        super().__init__(what)
        self.what = what
        self.span = span


@dataclass(frozen=True, slots=True)
class Predicate:
    """A generated predicate: a clause, or the body of one of its quantifiers."""

    name: str
    parameters: tuple[t.Variable, ...]
    body: str
    origin: str
    """The clause that it comes from."""


@dataclass(slots=True)
class Vocabulary:
    """The names of one node's export, shared by all its printed parts."""

    names: Names
    """The names of types, constructors and predicates."""
    locals: Names
    """The names of ports and bound variables."""
    ports: tuple[t.Variable, ...]
    types: dict[s.Sort, str] = field(default_factory=dict)
    """Declared sorts that occur, in order of first use."""
    functions: set[str] = field(default_factory=set)
    """The called functions on numbers, without their module."""

    def local(self, variable: t.Variable) -> str:
        wanted = None if variable.role == "bound" else f"{variable.role}_{variable.name}"
        return self.locals(str(variable.role), variable.name, wanted)

    def declared(self, sort: s.EnumSort | s.DataSort | s.OpaqueSort) -> str:
        if sort not in self.types:
            self.types[sort] = self.names.fresh(sort.name)
        return f"Types.{self.types[sort]}"

    def constructor(self, sort: s.EnumSort | s.DataSort, name: str) -> str:
        prefix = self.declared(sort)
        return f"{prefix}.{self.names(f'constructor of {prefix}', name)}"


def sort_text(sort: s.Sort, words: Vocabulary) -> str:
    """The Dafny type of a sort. Raises NotExpressible."""
    match sort:
        case s.BoolSort():
            return "bool"
        case s.RealSort():
            return "real"
        case s.IntegerSort():
            return "int"
        case s.NaturalSort():
            return "nat"
        case s.StringSort():
            return "string"
        case s.EnumSort() | s.DataSort() | s.OpaqueSort():
            return words.declared(sort)
        case s.FunctionSort(parameters=parameters, result=result):
            return f"({', '.join(sort_text(p, words) for p in parameters)}) -> {sort_text(result, words)}"
        case s.TupleSort(items=items):
            if len(items) < 2:
                raise NotExpressible("a tuple of fewer than two items", None)
            return f"({', '.join(sort_text(i, words) for i in items)})"
        case s.SequenceSort(item=item):
            return f"seq<{sort_text(item, words)}>"
        case s.SetSort():
            raise NotExpressible("a set outside 'in'", None)


def print_clause(name: str, formula: t.Term, words: Vocabulary) -> tuple[Predicate, ...]:
    """The predicate of a clause, after those of its quantifiers. Raises NotExpressible."""
    printer = _Printer(name, words)
    body, _ = printer.term(formula, words.ports)
    parameters = printer.parameters(formula, words.ports)
    whole = Predicate(words.names("clause", name), parameters, body, name)
    return (*printer.made, whole)


def call(predicate: Predicate, words: Vocabulary, module: str = "") -> str:
    """The predicate applied to variables with the names of its parameters."""
    arguments = ", ".join(words.local(p) for p in predicate.parameters)
    return f"{module}{predicate.name}({arguments})"


def signature(variables: Sequence[t.Variable], words: Vocabulary) -> str:
    """Variables with their types, as parameters."""
    return ", ".join(f"{words.local(v)}: {sort_text(v.sort, words)}" for v in variables)


_Text = tuple[str, bool]
"""Text, and whether it can be an operand without parentheses."""

_KINDS: Mapping[t.Quantifier, str] = {
    t.Quantifier.FORALL: "all",
    t.Quantifier.EXISTS: "ex",
    t.Quantifier.UNIQUE: "one",
}


class _Printer:
    def __init__(self, clause: str, words: Vocabulary) -> None:
        self.clause = clause
        self.words = words
        self.made: list[Predicate] = []
        self.count = 0

    def parameters(self, term: t.Term, scope: tuple[t.Variable, ...]) -> tuple[t.Variable, ...]:
        free = free_variables(term)
        return tuple(variable for variable in scope if variable in free)

    def operand(self, term: t.Term, scope: tuple[t.Variable, ...]) -> str:
        text, atomic = self.term(term, scope)
        return text if atomic else f"({text})"

    def list(self, terms: tuple[t.Term, ...], scope: tuple[t.Variable, ...]) -> str:
        return ", ".join(self.term(term, scope)[0] for term in terms)

    def infix(self, operator: str, terms: tuple[t.Term, ...], scope: tuple[t.Variable, ...]) -> _Text:
        texts = [self.operand(term, scope) for term in terms]
        return f" {OPERATORS[operator].dafny} ".join(texts), len(texts) == 1

    def term(self, term: t.Term, scope: tuple[t.Variable, ...]) -> _Text:
        match term:
            case t.Literal():
                return _literal(term)
            case t.EnumValue(name=name, sort=sort):
                return self.words.constructor(sort, name), True
            case t.Variable():
                return self.words.local(term), True
            case t.Construct(constructor=name, arguments=arguments, sort=sort):
                inner = self.list(arguments, scope)
                made = self.words.constructor(sort, name)
                return (f"{made}({inner})" if arguments else made), True
            case t.Apply(function=function, arguments=arguments):
                head = self.operand(function, scope)
                inner = self.list(arguments, scope)
                return f"{head}({inner})", True
            case t.Index(sequence=sequence, index=index):
                inner = self.list((sequence, index), scope)
                return f"Types.Nth({inner})", True
            case t.Item(record=record, position=position):
                inner = self.operand(record, scope)
                return f"{inner}.{position}", True
            case t.Argument():
                raise NotExpressible("an argument of a value's constructor", term.span)
            case t.Length(sequence=sequence):
                inner, _ = self.term(sequence, scope)
                return f"|{inner}|", True
            case t.Widen(term=inner_term):
                inner = self.operand(inner_term, scope)
                return f"{inner} as real", False
            case t.Negative(term=inner_term, sort=sort):
                inner = self.operand(inner_term, scope)
                # For a natural, Dafny 2.3 takes `-n` to be one too, and then complains that it may not be.
                return (f"-{inner}" if sort == s.REAL or isinstance(inner_term, t.Literal) else f"0 - {inner}"), False
            case t.Arithmetic(operator=operator) | t.Operation(operator=operator):
                return self.operation(OPERATORS[operator], term, scope)
            case t.Conditional(condition=condition, then=then, otherwise=otherwise):
                test, _ = self.term(condition, scope)
                yes, _ = self.term(then, scope)
                no, _ = self.term(otherwise, scope)
                return f"(if {test} then {yes} else {no})", True
            case t.TupleTerm(items=items):
                if len(items) < 2:
                    raise NotExpressible("a tuple of fewer than two items", term.span)
                inner = self.list(items, scope)
                return f"({inner})", True
            case t.SequenceTerm(items=items, sort=sequence_sort):
                inner = self.list(items, scope)
                if items:
                    return f"[{inner}]", True
                # An empty display alone does not determine its type.
                return f"(var nothing: {sort_text(sequence_sort, self.words)} := []; nothing)", True
            case t.SequenceRange(low=low, high=high):
                inner = self.list((low, high), scope)
                return f"Types.Upto({inner})", True
            case t.SetTerm():
                raise NotExpressible("a set outside 'in'", term.span)
            case t.History(operator=operator):
                raise NotExpressible(f"'{operator}', which speaks of other steps", term.span)
            case t.Compare(operator=operator, left=left, right=right):
                return self.infix(operator, (left, right), scope)
            case t.In(item=item, collection=collection):
                return self.membership(item, collection, scope)
            case t.Not(body=body):
                inner = self.operand(body, scope)
                return f"!{inner}", True
            case t.And(items=items):
                return self.infix("and", items, scope) if items else ("true", True)
            case t.Or(items=items):
                return self.infix("or", items, scope) if items else ("false", True)
            case t.Implies(left=left, right=right):
                return self.infix("->", (left, right), scope)
            case t.Iff(left=left, right=right):
                return self.infix("<=>", (left, right), scope)
            case t.Quantified():
                return self.quantified(term, scope)
            case _:
                assert_never(term)

    def operation(self, operator: Operator, term: t.Arithmetic | t.Operation, scope: tuple[t.Variable, ...]) -> _Text:
        if isinstance(operator.dafny, Why):
            raise NotExpressible(f"'{operator.name}': {operator.dafny.reason}", term.span)
        if not operator.dafny.startswith("Types."):
            return self.infix(operator.name, term.children, scope)
        texts = [self.term(argument, scope)[0] for argument in term.children]
        if operator.level is not Level.ATOM:
            return f"{operator.dafny}({', '.join(texts)})", True
        sorts = {argument.sort for argument in term.children}
        name = f"{operator.dafny}{'Real' if s.REAL in sorts else 'Bool' if s.BOOL in sorts else 'Int'}"
        self.words.functions.add(name.removeprefix("Types."))
        if not isinstance(operator.takes, Why) and operator.takes[1] is not None:
            return f"{name}({', '.join(texts)})", True
        return reduce(lambda a, b: f"{name}({a}, {b})", texts), True  # any number of arguments: pairwise

    def membership(self, item: t.Term, collection: t.Term, scope: tuple[t.Variable, ...]) -> _Text:
        left = self.operand(item, scope)
        if not isinstance(collection, t.SetTerm):
            right = self.operand(collection, scope)
            return f"{left} in {right}", False
        if not collection.items:
            return "false", True
        # A disjunction, not a set display: it needs no compilable equality.
        parts = [f"{left} == {self.operand(member, scope)}" for member in collection.items]
        return (f"({parts[0]})", True) if len(parts) == 1 else (" || ".join(parts), False)

    def quantified(self, term: t.Quantified, scope: tuple[t.Variable, ...]) -> _Text:
        self.count += 1
        name = self.words.names.fresh(f"{self.clause}_{_KINDS[term.quantifier]}{self.count}")
        inner_scope = scope + term.variables
        body, _ = self.term(term.body, inner_scope)
        outer = self.parameters(term, scope)
        # Every bound variable is a parameter, used or not: the call is the only trigger term.
        predicate = Predicate(name, outer + term.variables, body, self.clause)
        self.made.append(predicate)
        bound = ", ".join(f"{self.words.local(v)}: {sort_text(v.sort, self.words)}" for v in term.variables)
        applied = call(predicate, self.words)
        match term.quantifier:
            case t.Quantifier.FORALL:
                return f"forall {bound} :: {applied}", False
            case t.Quantifier.EXISTS:
                return f"exists {bound} :: {applied}", False
            case t.Quantifier.UNIQUE:
                table = self.words.locals.inner()
                others = {v: table.fresh(f"{self.words.local(v)}_other") for v in term.variables}
                more = ", ".join(f"{others[v]}: {sort_text(v.sort, self.words)}" for v in term.variables)
                arguments = [others.get(p, self.words.local(p)) for p in predicate.parameters]
                same = " && ".join(f"{self.words.local(v)} == {others[v]}" for v in term.variables)
                unique = f"forall {bound}, {more} :: {applied} && {name}({', '.join(arguments)}) ==> {same}"
                return f"(exists {bound} :: {applied}) && ({unique})", False


def _literal(term: t.Literal) -> _Text:
    match term.value, term.sort:
        case bool() as truth, _:
            return ("true" if truth else "false"), True
        case str() as text, _:
            return _string(text, term.span), True
        case int() | Fraction() as number, s.RealSort():
            return _real(Fraction(number))
        case number, _:
            return (str(number), True) if number >= 0 else (f"({number})", True)


def _real(value: Fraction) -> _Text:
    text = decimal(abs(value))
    if text is None:
        return f"({value.numerator}.0 / {value.denominator}.0)", True
    if "." not in text:
        text = f"{text}.0"
    return (text, True) if value >= 0 else (f"(-{text})", True)


def _string(text: str, span: Span | None) -> str:
    """Dafny 2.3 and 4.x write other characters differently, so only these are expressible in both."""
    if not all(" " <= c <= "~" for c in text):
        raise NotExpressible("a string with other than printable ASCII characters", span)
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


# -- names of the contract as Dafny identifiers ------------------------------------------------------------------------


RESERVED = frozenset(
    re.findall(
        r"\w+",
        """
    abstract allocated array arrow as assert assume bool bv break by calc case char class codatatype colemma const
    constructor continue copredicate datatype decreases default downto else ensures exists expect export extends
    fallible false feature for forall free fresh function ghost greatest hide hints if imap import in include
    inductive int invariant is iset iterator label labeled least lemma level map match method modifies modify module
    multiset nameonly new newtype nat null object old older opaque opened ORDINAL or predicate print protected
    provides reads real refines requires return returns reveal reveals seq set static string then this to trait true
    twostate type unchanged using var where while witness yield yields
    array0 array1 array2 array3 array4 Main Env EnvNotEmpty Step Types Contract Base Upto Divide DivideByZero Nth Beyond
    AbsInt AbsReal MinInt MinReal MaxInt MaxReal
        """,
    )
)
"""Keywords and built-in names of Dafny 2.3 to 4.x, and the names that the generated modules use themselves."""

_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_']*")
_BIT_VECTOR = re.compile(r"bv\d+|array\d+")


@dataclass(slots=True)
class Names:
    """Hands out identifiers; the same (kind, name) always gets the same one within a table. Text from a contract is
    data: any name (a keyword, a primed or a Greek name) gives an identifier, unchanged if Dafny allows it, and
    different names give different identifiers."""

    taken: set[str] = field(default_factory=set)
    given: dict[tuple[str, str], str] = field(default_factory=dict)

    def __call__(self, kind: str, name: str, wanted: str | None = None) -> str:
        """The identifier for a name; `wanted` is its preferred form, if not the name itself."""
        key = (kind, name)
        if key not in self.given:
            self.given[key] = self.fresh(name if wanted is None else wanted)
        return self.given[key]

    def fresh(self, wanted: str) -> str:
        """A unique identifier."""
        base = identifier(wanted)
        candidate, number = base, 2
        while candidate in self.taken or candidate in RESERVED or _BIT_VECTOR.fullmatch(candidate):
            candidate = f"{base}_{number}"
            number += 1
        self.taken.add(candidate)
        return candidate

    def inner(self, more: Iterable[str] = ()) -> Names:
        """A table for an inner scope: shadows nothing."""
        return Names(self.taken | set(more))


def identifier(text: str) -> str:
    """`text`, if it may be an identifier, else an identifier similar to it."""
    if _PLAIN.fullmatch(text):
        return text
    safe = "".join(c if c.isascii() and (c.isalnum() or c in "_'") else f"u{ord(c):04x}" for c in text)
    return safe if _PLAIN.fullmatch(safe) else f"n{safe}"


def file_stem(name: str) -> str:
    """The same for the name of a file."""
    return identifier(name).replace("'", "_prime")

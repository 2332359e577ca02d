"""Terms and sorts as text: RCL, or Unicode mathematics; with only the necessary parentheses.

Printing in the style ``rcl`` and reading the result gives an equal term (tests check this for generated terms).
"""

from __future__ import annotations

from collections.abc import Container
from fractions import Fraction
from typing import Literal as OneOf
from typing import assert_never

from avow.base.plain import decimal
from avow.base.records import dataclass
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.lexer import quote
from avow.language.operators import OPERATORS, Level

_LOOSEST, IFF, IMPLIES, OR, AND, LASTING, NOT, COMPARE, SUM, PRODUCT, UNARY, ATOM = Level
StyleName = OneOf["unicode", "rcl"]


@dataclass(frozen=True, slots=True)
class _Style:
    """The notation of each part of a term."""

    words: dict[str, str]
    quantifiers: dict[t.Quantifier, tuple[str, str, str]]
    """The texts before the variables, after them, and after the body."""
    sorts: dict[str, str]
    times: str
    arrow: str
    unspecified: str
    sequence: tuple[str, str]
    tight_quantifier: bool
    """Whether a quantifier is self-delimiting, so that it never needs parentheses."""
    careful: bool = False
    """Whether `and` and `or` get parentheses beside `->` and `<=>`, though they need none."""


_WORDS = {
    **{row.name: row.rcl for row in OPERATORS.values()},
    **{word: f" {word} " for word in ("in", "!in", "upto", "then", "else")},
    "TRUE": "TRUE",
    "FALSE": "FALSE",
}
_STYLES: dict[StyleName, _Style] = {
    "rcl": _Style(
        words=_WORDS,
        quantifiers={q: (f"{q.value}(", " | ", ")") for q in t.Quantifier},
        sorts={name: name for name in s.BUILTINS},
        times=" x ",
        arrow=" --> ",
        unspecified="{}",
        sequence=("<", ">"),
        tight_quantifier=True,
        careful=True,
    ),
    "unicode": _Style(
        words={
            **_WORDS,
            **{row.name: row.unicode for row in OPERATORS.values()},
            "in": " ∈ ",
            "!in": " ∉ ",
            "upto": " … ",
            "TRUE": "true",
            "FALSE": "false",
        },
        quantifiers={
            t.Quantifier.FORALL: ("∀ ", " · ", ""),
            t.Quantifier.EXISTS: ("∃ ", " · ", ""),
            t.Quantifier.UNIQUE: ("∃! ", " · ", ""),
        },
        sorts={"BOOL": "𝔹", "REAL": "ℝ", "INTEGER": "ℤ", "NATURAL": "ℕ", "STRING": "String"},
        times=" × ",
        arrow=" → ",
        unspecified="unspecified",
        sequence=("⟨", "⟩"),
        tight_quantifier=False,
    ),
}
_UP, _DOWN = frozenset(("<", "<=", "==")), frozenset((">", ">=", "=="))


def show_term(term: t.Term, style: StyleName = "unicode") -> str:
    """The term as text."""
    return _Printer(style).show(term, _LOOSEST)


def show_sort(sort: s.Sort, style: StyleName = "rcl", named: Container[str] | None = None) -> str:
    """A sort by its name, or written out if it has none (or none of those `named`)."""
    chosen = _STYLES[style]
    match sort:
        case s.BoolSort() | s.RealSort() | s.IntegerSort() | s.NaturalSort() | s.StringSort():
            return chosen.sorts[_BUILTIN[sort]]
        case s.EnumSort(name=name) | s.DataSort(name=name) | s.OpaqueSort(name=name) | s.TupleSort(name=name) if (
            name if named is None else name in named
        ):
            return name
        case s.FunctionSort(parameters=parameters, result=result):
            left = chosen.times.join(_in_product(p, style, named) for p in parameters)
            return f"{left}{chosen.arrow}{_in_product(result, style, named)}"
        case s.SequenceSort(item=item):
            return f"{chosen.sequence[0]}{show_sort(item, style, named)}{chosen.sequence[1]}"
        case s.SetSort(item=item):
            return f"a set of {show_sort(item, style, named)}"
        case s.EnumSort() | s.DataSort() | s.OpaqueSort() | s.TupleSort():
            return show_type(sort, style, named)


def show_type(sort: s.Sort, style: StyleName = "rcl", named: Container[str] | None = None) -> str:
    """The sort as its declaration writes it: ``{red, orange, green}``, ``{}``."""
    chosen = _STYLES[style]
    match sort:
        case s.EnumSort(members=members):
            return f"{{{', '.join(members)}}}"
        case s.DataSort(constructors=constructors):
            shown = []
            for c in constructors:
                arguments = ", ".join(show_sort(p, style, named) for p in c.parameters)
                shown.append(f"{c.name}({arguments})" if arguments else c.name)
            return f"{{{', '.join(shown)}}}"
        case s.OpaqueSort():
            return chosen.unspecified
        case s.TupleSort(items=items, labels=labels):
            shown = [show_sort(item, style, named) for item in items]
            if not labels:
                return f"({', '.join(shown)})"
            return f"[{', '.join(f'{label} : {part}' for label, part in zip(labels, shown, strict=True))}]"
        case _:  # written out anyway
            return show_sort(sort, style, named)


def _in_product(sort: s.Sort, style: StyleName, named: Container[str] | None) -> str:
    shown = show_sort(sort, style, named)
    return f"({shown})" if isinstance(sort, s.FunctionSort) else shown


_BUILTIN = {sort: name for name, sort in s.BUILTINS.items()}


class _Printer:
    def __init__(self, name: StyleName) -> None:
        self.name = name
        self.style = _STYLES[name]

    def show(self, term: t.Term, place: int, *, real: bool = False) -> str:
        """`place`: how tightly the text must bind. `real`: a number here is read as a REAL in any case."""
        if isinstance(term, t.Widen):
            return self.show(term.term, place)
        text, level = self.form(term, real)
        return f"({text})" if level < place else text

    def form(self, term: t.Term, real: bool) -> tuple[str, int]:
        words = self.style.words
        match term:
            case t.Literal():
                return self.literal(term, real)
            case t.EnumValue(name=name):
                return name, ATOM
            case t.Variable():
                return self.variable(term), ATOM
            case t.Construct(constructor=name, arguments=arguments, sort=sort):
                parameters = sort.constructor(name).parameters
                return self.applied(name, arguments, parameters), ATOM
            case t.Apply(function=function, arguments=arguments):
                sort_ = function.sort
                parameters = sort_.parameters if isinstance(sort_, s.FunctionSort) else ()
                return self.call(self.show(function, ATOM), arguments, parameters), ATOM
            case t.Index(sequence=sequence, index=index):
                return self.call(self.show(sequence, ATOM), (index,), ()), ATOM
            case t.Item(record=record, position=position):
                labels = record.sort.labels if isinstance(record.sort, s.TupleSort) else ()
                label = labels[position] if labels else str(position)
                return f"{self.show(record, ATOM)}.{label}", ATOM
            case t.Argument(value=value, constructor=name, position=position):
                return f"{self.show(value, ATOM)}.{name}.{position}", ATOM
            case t.Length(sequence=sequence):
                return f"length({self.show(sequence, _LOOSEST)})", ATOM
            case t.Arithmetic():
                return self.arithmetic(term)
            case t.Negative(term=inner):
                shown = self.show(inner, UNARY)
                return f"-({shown})" if isinstance(inner, t.Literal) or shown.startswith("-") else f"-{shown}", UNARY
            case t.TupleTerm(items=items):
                return f"({self.listed(items, _LOOSEST)})", ATOM
            case t.SequenceTerm(items=items):
                left, right = self.style.sequence
                return f"{left}{self.listed(items, SUM)}{right}", ATOM
            case t.SequenceRange(low=low, high=high):
                left, right = self.style.sequence
                return f"{left}{self.show(low, SUM)}{words['upto']}{self.show(high, SUM)}{right}", ATOM
            case t.SetTerm(items=items):
                return f"{{{self.listed(items, SUM)}}}", ATOM
            case t.Compare():
                return self.chain((term,)), COMPARE
            case t.In(item=item, collection=collection):
                return self.membership(item, collection, "in"), COMPARE
            case t.Not(body=t.In(item=item, collection=collection)):
                return self.membership(item, collection, "!in"), COMPARE
            case t.Not(body=body):
                return f"{words['not']}{self.show(body, NOT)}", NOT
            case t.And(items=items) if len(items) > 1 and _is_chain(items):
                return self.chain(tuple(i for i in items if isinstance(i, t.Compare))), COMPARE
            case t.And(items=()):
                return words["TRUE"], ATOM
            case t.Or(items=()):
                return words["FALSE"], ATOM
            case t.And(items=(only,)) | t.Or(items=(only,)):
                return self.form(only, real)
            case t.And(items=items):
                return words["and"].join(self.show(i, LASTING) for i in items), AND
            case t.Or(items=items):
                return words["or"].join(self.show(i, AND) for i in items), OR
            case t.Implies(left=left, right=right):
                return f"{self.side(left, OR)}{words['->']}{self.side(right, IMPLIES)}", IMPLIES
            case t.Iff(left=left, right=right):
                return f"{self.side(left, IFF)}{words['<=>']}{self.side(right, IMPLIES)}", IFF
            case t.Quantified():
                return self.quantified(term)
            case t.Operation(operator=operator, arguments=arguments):
                return f"{words[operator]}({self.listed(arguments, _LOOSEST)})", ATOM
            case t.Conditional(condition=condition, then=then, otherwise=otherwise):
                whole = words["if"] + self.show(condition, IFF) + words["then"] + self.show(then, IFF)
                return whole + words["else"] + self.show(otherwise, _LOOSEST), _LOOSEST
            case t.History():
                return self.history(term)
            case t.Widen(term=inner):
                return self.form(inner, real)
            case _:
                assert_never(term)

    def history(self, term: t.History) -> tuple[str, int]:
        """``once[5 steps](F)``, ``F since G``."""
        if term.operator is t.Past.STEPS and term.limit is not None:
            told = {"==": "every", "<=": "at most"}[term.limit.relation]
            return f"{term.operator}({told} {show_number(term.limit.number)[0]} s)", ATOM
        limit = "" if term.limit is None else self.limit(term.limit)
        if term.operator in (t.Past.SINCE, t.Past.UNTIL):
            left, right = (self.show(each, NOT) for each in term.arguments)
            return f"{left} {term.operator}{limit} {right}", LASTING
        if term.operator is t.Past.COUNTED:
            left, right = (self.show(each, NOT) for each in term.arguments)
            return f"{term.operator}({left} {t.Past.SINCE} {right})", ATOM
        real = term.operator is t.Past.PREVIOUS and any(map(_shows_real, term.arguments))
        return f"{term.operator}{limit}({self.listed(term.arguments, _LOOSEST, real=real)})", ATOM

    def limit(self, limit: t.Limit) -> str:
        relation = self.style.words[limit.relation].strip() + " " if limit.relation else ""
        return f"[{relation}{show_number(limit.number)[0]} {'steps' if limit.steps else 's'}]"

    def variable(self, term: t.Variable) -> str:
        """``in.r``; for another node, ``sensor.r`` (in RCL ``sensor.in.r``, which is never ambiguous)."""
        node, dot, name = term.name.partition(".")
        if not dot or term.role is t.Role.BOUND:
            return term.qualified
        return f"{node}.{term.role}.{name}" if self.style.careful else term.name

    def side(self, term: t.Term, place: int) -> str:
        """A side of `->` or `<=>`. RCL has parentheses around `and` and `or` there, as the lint RCL401 requires."""
        bare = (
            isinstance(term, t.And | t.Or)
            and len(term.items) > 1
            and not (isinstance(term, t.And) and _is_chain(term.items))
        )
        return self.show(term, ATOM if bare and self.style.careful else place)

    def literal(self, term: t.Literal, real: bool) -> tuple[str, int]:
        value = term.value
        if isinstance(value, bool):
            return self.style.words["TRUE" if value else "FALSE"], ATOM
        if isinstance(value, str):
            return quote(value), ATOM
        fraction = Fraction(value)
        text, level = show_number(fraction)
        if term.unit and level == ATOM and self.name == "rcl":
            return f"{text} {term.unit}", ATOM
        if term.sort == s.REAL and fraction.denominator == 1 and not real:
            text += ".0"
        return text, level

    def applied(self, name: str, arguments: tuple[t.Term, ...], parameters: tuple[s.Sort, ...]) -> str:
        return self.call(name, arguments, parameters) if arguments else name

    def call(self, name: str, arguments: tuple[t.Term, ...], parameters: tuple[s.Sort, ...]) -> str:
        shown = []
        for i, argument in enumerate(arguments):
            real = i < len(parameters) and parameters[i] == s.REAL
            shown.append(self.show(argument, _LOOSEST, real=real))
        return f"{name}({', '.join(shown)})"

    def listed(self, items: tuple[t.Term, ...], place: int, *, real: bool = False) -> str:
        return ", ".join(self.show(i, place, real=real) for i in items)

    def arithmetic(self, term: t.Arithmetic) -> tuple[str, int]:
        level = OPERATORS[term.operator].level
        divided = term.operator == "/"
        left = self.show(term.left, level, real=divided or _shows_real(term.right))
        right = self.show(term.right, level + 1, real=divided or _shows_real(term.left))
        return f"{left}{self.style.words[term.operator]}{right}", level

    def membership(self, item: t.Term, collection: t.Term, relation: str) -> str:
        shown = self.show(item, SUM)
        if isinstance(collection, t.SetTerm):
            of = f"{{{self.listed(collection.items, SUM, real=_shows_real(item))}}}"
        else:
            of = self.show(collection, SUM)
        return f"{shown}{self.style.words[relation]}{of}"

    def chain(self, links: tuple[t.Compare, ...]) -> str:
        parts = [self.show(links[0].left, SUM, real=_shows_real(links[0].right))]
        for i, link in enumerate(links):
            neighbours = (link.left, links[i + 1].right) if i + 1 < len(links) else (link.left,)
            real = all(_shows_real(n) for n in neighbours)
            if i + 1 < len(links) and links[i + 1].left.sort != s.REAL:
                real = True  # written as a whole number: it is one for the next comparison
            parts.append(self.style.words[link.operator])
            parts.append(self.show(link.right, SUM, real=real))
        return "".join(parts)

    def quantified(self, term: t.Quantified) -> tuple[str, int]:
        groups: list[tuple[list[str], s.Sort]] = []
        for variable in term.variables:
            if groups and groups[-1][1] == variable.sort:
                groups[-1][0].append(variable.name)
            else:
                groups.append(([variable.name], variable.sort))
        binders = ", ".join(
            f"{', '.join(names)}{self.style.words['in']}{show_sort(sort, self.name)}" for names, sort in groups
        )
        before, between, after = self.style.quantifiers[term.quantifier]
        text = f"{before}{binders}{between}{self.show(term.body, _LOOSEST)}{after}"
        return text, ATOM if self.style.tight_quantifier else _LOOSEST


def show_number(value: Fraction) -> tuple[str, int]:
    """A number and how tightly its text binds: a decimal if it has one, else a division."""
    text = decimal(value)
    if text is None:
        return f"{value.numerator} / {value.denominator}", PRODUCT
    return text, UNARY if value < 0 else ATOM


def _shows_real(term: t.Term) -> bool:
    """Whether the printed term is read as a REAL without knowing the expected sort."""
    match term:
        case t.Literal(value=value):
            return isinstance(value, Fraction) and value.denominator != 1
        case t.Widen():
            return False
        case t.Arithmetic(operator="/"):
            return True
        case t.Arithmetic(left=left, right=right):
            return _shows_real(left) or _shows_real(right)
        case t.Negative(term=inner):
            return _shows_real(inner)
        case t.Operation(arguments=terms) if term.sort == s.REAL:
            return any(map(_shows_real, terms))
        case t.Conditional(then=then, otherwise=otherwise):
            return _shows_real(then) or _shows_real(otherwise)
        case _:  # a term that is not a literal number has its sort from its name
            return bool(term.sort == s.REAL)


def _is_chain(items: tuple[t.Term, ...]) -> bool:
    """Whether a conjunction is ``a < b <= c``: each comparison begins with the last one's right side, all in one
    direction."""
    previous: t.Term | None = None
    operators = set()
    for item in items:
        if not isinstance(item, t.Compare) or isinstance(item.left.sort, s.BoolSort):
            return False
        if previous is not None and _bare(previous) != _bare(item.left):
            return False
        operators.add(item.operator)
        previous = item.right
    return operators <= _UP or operators <= _DOWN


def _bare(term: t.Term) -> t.Term:
    if isinstance(term, t.Widen):
        return term.term
    if isinstance(term, t.Literal) and not isinstance(term.value, bool | str):
        return t.Literal(Fraction(term.value), s.REAL)
    return term

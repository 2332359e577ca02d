"""Random formulas as text, made from types: of every kind of sort and operator, as far as `Knobs` allow."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from avow.language.contract import Contract, Node
from avow.language.load import check_text


class Type(NamedTuple):
    """`kind` is REAL …, enum, data, tuple, seq, fun (the last of `parts` is the result) or opaque."""

    kind: str
    name: str = ""
    members: tuple[str, ...] = ()
    parts: tuple[Type, ...] = ()
    arguments: tuple[tuple[Type, ...], ...] = ()

    @property
    def opaque(self) -> bool:
        """Whether no term of the type can be written down."""
        return self.kind == "opaque" or any(t.opaque for t in (*self.parts, *(t for a in self.arguments for t in a)))

    @property
    def finite(self) -> bool:
        parts = (*self.parts, *(t for a in self.arguments for t in a))
        return self.kind in ("enum", "BOOL", "data", "tuple", "fun") and all(t.finite for t in parts)


REAL, INTEGER, NATURAL, BOOL, STRING = map(Type, ("REAL", "INTEGER", "NATURAL", "BOOL", "STRING"))
NUMBERS = (NATURAL, INTEGER, REAL)
Names = Mapping[str, Type]
"""What a formula may speak of, as it writes it (``in.a``)."""

ORDERS = ("<", "<=", ">", ">=")
CONNECTIVES = ("and", "or", "->", "<=>", "not", "several", "choice")


@dataclass(frozen=True, slots=True)
class Knobs:
    """What formulas are made of. Numbers are chances, of a formula (or a term of a number) that is no atom."""

    connectives: tuple[str, ...] = CONNECTIVES
    """`several`: more than two parts in a chain; `choice`: xor and if."""
    atoms: float = 0.15
    """Of an atom where there could be more."""
    quantified: float = 0.3
    past: float = 0.0
    """Of one that speaks of other steps."""
    seconds: bool = False
    """Limits are in seconds, and inputs arrive."""
    terms: int = 1
    """How deep terms are."""
    arithmetic: bool = True
    """Sums, and quantifiers over numbers."""
    builtin: bool = True
    """min, mod, if …, of numbers."""
    partial: bool = True
    """Elements of sequences, and quotients by what may be zero."""
    roots: bool = False
    """Square roots, also of what may be negative."""
    angles: bool = False
    """Sines, cosines, and angles also of what may be no vector."""
    bare: float = 0.0
    """Of a part without parentheses."""
    wild: bool = False
    """Numbers and texts of any size, and quantifiers over infinite types."""


PLAIN = Knobs(atoms=0.25, quantified=0, terms=0, arithmetic=False, builtin=False, partial=False)
"""Connectives, equations and orders."""

_SMALL = {"NATURAL": ("0", "1", "2", "3"), "INTEGER": ("0", "1", "2", "-1"), "REAL": ("0", "0.5", "1", "2", "1.5")}
_LARGE = ("0", "1", "7", str(10**20), str(10**40))
_WILD = {
    "NATURAL": _LARGE,
    "INTEGER": (*_LARGE, "-1", "(-2)", "- -3"),
    "REAL": (*_LARGE, "-1", "(-2)", "1.50", "0.001", "-0.5", "1/3", "123456789.987654321", "0.0"),
}
_TEXTS = ('""', '"a"', '"b"')
_WILD_TEXTS = (
    *('""', '"a b"', r'"\"q\" \\ %d $x_1^2 & # ~ {}"', r'"日本 ∀ 🤖 \n\t"', '"--> // no comment /* */"'),
    r'"|piped| \\end{document}"',
)


class Formulas:
    """A source of formulas. `types` are those that a contract declares, `constants` and `sets` by their names."""

    def __init__(
        self,
        source: random.Random,
        knobs: Knobs = Knobs(),
        *,
        types: Mapping[str, Type] | None = None,
        constants: Names | None = None,
        sets: Names | None = None,
    ) -> None:
        self.random = source
        self.knobs = knobs
        self.types = {} if types is None else types
        self.constants = {} if constants is None else constants
        self.sets = {} if sets is None else sets
        self.bound = 0

    def fresh(self) -> str:
        """A name for a bound variable."""
        self.bound += 1
        return f"v{self.bound}"

    def basic(self, depth: int = 1) -> Type:
        """Some type, to speak of or to declare a port with."""
        named = [t for t in self.types.values() if t.kind in ("enum", "data", "opaque")]
        form = self.random.random()
        if named and form < 0.35:
            return self.random.choice(named)
        if depth > 0 and form < 0.5:
            return Type("tuple", parts=self.several(depth - 1, 2, 3))
        if depth > 0 and form < 0.65:
            return Type("seq", parts=(self.basic(depth - 1),))
        return self.random.choice((REAL, REAL, INTEGER, NATURAL, BOOL, STRING))

    def several(self, depth: int, least: int, most: int) -> tuple[Type, ...]:
        return tuple(self.basic(depth) for _ in range(self.random.randint(least, most)))

    def written(self, of: Type) -> str:
        for name, known in self.types.items():
            if known == of and (of.kind in ("enum", "data", "opaque") or self.random.random() < 0.5):
                return name
        parts = [self.written(p) for p in of.parts]
        match of.kind:
            case "tuple":
                return f"({', '.join(parts)})" if self.random.random() < 0.6 else f"({' x '.join(parts)})"
            case "seq":
                return f"<{parts[0]}>"
            case "fun":
                return f"{' x '.join(parts[:-1])} --> {parts[-1]}"
        return of.kind

    # -- terms ---------------------------------------------------------------------------------------------------------

    def term(self, of: Type, depth: int, names: Names) -> str:
        """A term of that type, which may stand anywhere."""
        choice = self.random.choice
        known = list(self._known(of, depth, names))
        if known and self.random.random() < 0.6:
            return choice(known)()
        if depth > 0 and self.knobs.builtin and of != BOOL and of not in NUMBERS and self.random.random() < 0.08:
            return self._either(of, depth, names)
        match of.kind:
            case "REAL" | "INTEGER" | "NATURAL":
                return self._number(of, depth, names)
            case "BOOL":
                return f"({self.formula(depth - 1, names, depth - 1)})" if depth > 0 else choice(("TRUE", "FALSE"))
            case "STRING":
                return choice(_WILD_TEXTS if self.knobs.wild else _TEXTS)
            case "enum":
                return choice(of.members)
            case "data":
                at = self.random.randrange(len(of.members))
                given = ", ".join(self.term(t, depth - 1, names) for t in of.arguments[at])
                return of.members[at] + (f"({given})" if given else "")
            case "tuple":
                return f"({', '.join(self.term(t, depth - 1, names) for t in of.parts)})"
            case "seq" if of.parts[0] == NATURAL and self.random.random() < 0.4:
                return self._upto(names)
            case "seq":
                return self.collection(of.parts[0], depth, names, "<>")
        raise AssertionError(of)

    def _known(self, of: Type, depth: int, names: Names) -> Iterator[Callable[[], str]]:
        """What there is of a type: names, and what functions and sequences have."""
        for name, t in (*names.items(), *self.constants.items()):
            if t == of:
                yield from [lambda name=name: name] * 2  # type: ignore[misc]
            elif t.kind == "fun" and depth > 0 and t.parts[-1] == of and not t.opaque:
                yield from [lambda name=name, t=t: self._applied(name, t, depth, names)] * 2  # type: ignore[misc]
            elif t.kind == "seq" and t.parts[0] == of and self.knobs.partial:
                yield lambda name=name: f"{name}({self._small(names)})"  # type: ignore[misc]

    def _applied(self, name: str, of: Type, depth: int, names: Names) -> str:
        return f"{name}({', '.join(self.term(t, depth - 1, names) for t in of.parts[:-1])})"

    def collection(self, of: Type, depth: int, names: Names, signs: str) -> str:
        """A set ``{…}`` or a sequence ``<…>``."""
        least = 0 if signs == "<>" and not self.knobs.wild else 1
        items = [self.term(of, depth - 1, names) for _ in range(self.random.randint(least, 2 if least == 0 else 3))]
        return f"{signs[0]}{', '.join(items)}{signs[1]}"

    def _upto(self, names: Names) -> str:
        return f"<{self.random.choice([0, 1])} upto {self._small(names)}>"

    def _small(self, names: Names) -> str:
        naturals = [name for name, t in names.items() if t == NATURAL]
        return self.random.choice(["0", "1", "2", *naturals, *naturals])

    def _either(self, of: Type, depth: int, names: Names) -> str:
        one, other = (self.term(of, depth - 1, names) for _ in range(2))
        return f"(if {self.formula(depth - 1, names, depth - 1)} then {one} else {other})"

    def _number(self, of: Type, depth: int, names: Names) -> str:
        choice = self.random.choice
        forms = ["literal", "literal", "narrow"]
        if any(t.kind == "seq" for t in names.values()):
            forms.append("length")
        if depth > 0 and self.knobs.arithmetic:
            forms += ["sum", "sum", "sum", "negative", "quotient", "quotient"]
        if depth > 0 and self.knobs.builtin:
            forms += ["if", "builtin"]

        def inner(kind: Type = of) -> str:
            return self.term(kind, depth - 1, names)

        match choice(forms):
            case "narrow" if of != NATURAL:
                return self.term(choice(NUMBERS[: NUMBERS.index(of)]), depth, names)
            case "length":
                return f"length({choice([name for name, t in names.items() if t.kind == 'seq'])})"
            case "sum":
                whole = f"{inner()} {choice('+*' if of == NATURAL else '+-*')} {inner()}"
                return whole if self.random.random() < self.knobs.bare else f"({whole})"
            case "negative" if of != NATURAL:
                return f"-({inner()})"
            case "quotient" if of == REAL:
                divisor = inner() if self.knobs.partial else "0"
                return f"({inner()} / {choice((2, 3, 7, '2.5')) if divisor == '0' else divisor})"
            case "if":
                return self._either(of, depth, names)
            case "builtin" if of == REAL and self.knobs.roots and self.random.random() < 0.7:
                return choice((f"sqrt({inner()})", f"norm({inner()}, {inner()})"))
            case "builtin" if of == REAL and self.knobs.angles and self.random.random() < 0.8:
                return choice((f"sin({inner()})", f"cos({inner()})", f"atan2({inner()}, {inner()})"))
            case "builtin":
                whole = inner(choice((INTEGER, NATURAL)) if of != NATURAL else NATURAL)
                calls = [f"{choice(('min', 'max'))}({inner()}, {inner()})", f"abs({inner()})"]
                return choice((*calls, f"{choice(('mod', 'div'))}({whole}, {choice((1, 2, 3))})"))
        return choice((_WILD if self.knobs.wild else _SMALL)[of.kind])

    # -- formulas ------------------------------------------------------------------------------------------------------

    def atom(self, names: Names, depth: int) -> str:
        """A formula without connectives; its terms are so deep."""
        choice = self.random.choice
        spoken = [t for t in names.values() if t.kind != "fun"]
        spoken += [t.parts[-1] for t in names.values() if t.kind == "fun"] if depth else []
        spoken += [t.parts[0] for t in names.values() if t.kind == "seq"]
        of = choice([*spoken, self.basic()] if self.knobs.wild or not spoken else spoken)
        of = choice(NUMBERS) if self.knobs.wild and self.random.random() < 0.3 else of
        if of.opaque:
            same = [n for n, t in names.items() if t == of]
            return f"{choice(same)} {choice(('==', '!='))} {choice(same)}" if same else "TRUE"
        form = self.random.random()
        if not self.knobs.terms:
            return self._plain(of, names)
        if of == BOOL and form < 0.75:
            return self.term(BOOL, depth, names)
        one = self.term(of, depth, names)
        if of in NUMBERS and form < 0.7:
            other = self._another(one, choice((of, INTEGER, REAL)), depth, names)
            if form < 0.15:
                first, second = choice((("<", "<="), (">", ">="), ("==", "<"), ("<=", "=="), ("<=", "<")))
                return f"{self.term(INTEGER, 0, names)} {first} {one} {second} {other}"
            return f"{one} {choice((*ORDERS, '==', '!='))} {other}"
        if depth and form > 0.8:
            return f"{one} {choice(('in', '!in', 'in'))} {self._among(of, depth, names)}"
        return f"{one} {choice(('==', '==', '!='))} {self._another(one, of, depth, names)}"

    def _another(self, one: str, of: Type, depth: int, names: Names) -> str:
        """A term, most likely another than this one."""
        drawn = [self.term(of, depth, names) for _ in range(2)]
        return next((term for term in drawn if term != one), one)

    def _plain(self, of: Type, names: Names) -> str:
        """A name, or how it compares with another or a constant."""
        choice, same = self.random.choice, [name for name, t in names.items() if t == of]
        if not same or (of == BOOL and self.random.random() < 0.2):
            return choice(("TRUE", "FALSE"))
        one = choice(same)
        others = [name for name in same if name != one]
        if of == BOOL:
            return f"{one} {choice(('==', '!='))} {choice(others)}" if others and self.random.random() < 0.1 else one
        other = choice(others) if others and self.random.random() < 0.4 else self.term(of, 0, {})
        return f"{one} {choice((*ORDERS, '==', '!=') if of in NUMBERS else ('==', '!='))} {other}"

    def _among(self, of: Type, depth: int, names: Names) -> str:
        """A collection of things of a type."""
        known = [name for name, t in self.sets.items() if t == of]
        known += [name for name, t in names.items() if t.kind == "seq" and t.parts[0] == of]
        known += [of.name] if of.kind == "enum" and of.name in self.types else []
        known += [self._upto(names)] if of == NATURAL else []
        made = self.collection(of, depth, names, "{}")
        return self.random.choice([*known, made, made])

    def formula(self, depth: int, names: Names, terms: int | None = None) -> str:
        """`terms`: how deep its terms are, if not as the knobs say."""
        knobs, chance = self.knobs, self.random.random()
        terms = knobs.terms if terms is None else terms

        def smaller() -> str:
            return self.formula(depth - 1, names, terms)

        if depth <= 0 or chance < knobs.atoms:
            return self.atom(names, terms)
        if chance < knobs.atoms + knobs.quantified:
            return self.quantified(depth, names, terms)
        if chance < knobs.atoms + knobs.quantified + knobs.past:
            return self.past(smaller, names)

        def part() -> str:
            inner = smaller()
            return inner if self.random.random() < knobs.bare else f"({inner})"

        match self.random.choice(knobs.connectives):
            case "not":
                return f"not {part()}"
            case "several":
                sign = self.random.choice((" and ", " or ", " <=> ", " -> "))
                return sign.join(part() for _ in range(self.random.choice((3, 3, 4))))
            case "choice":
                whole = f"xor({part()}, {part()})", f"(if {part()} then {part()} else {part()})"
                return self.random.choice(whole)
            case sign:
                return f"{part()} {sign} {part()}"

    def quantified(self, depth: int, names: Names, terms: int) -> str:
        inside, binders = dict(names), []
        for _ in range(self.random.choice((1, 1, 2) if self.knobs.wild else (1,))):
            of, domain = self.domain(names)
            variables = [self.fresh()]
            if self.random.random() < 0.3 and (self.knobs.wild or of.kind in ("enum", "BOOL")):
                variables.append(self.fresh())
            inside.update(dict.fromkeys(variables, of))
            binders.append(f"{', '.join(variables)} in {domain}")
        word = self.random.choice(("forall", "forall", "exists", "exists", "exists_unique"))
        sign = self.random.choice("|;") if self.knobs.wild else "|"
        return f"{word}({', '.join(binders)} {sign} {self.formula(depth - 1, inside, terms)})"

    def domain(self, names: Names) -> tuple[Type, str]:
        """What a bound variable ranges over."""
        choice = self.random.choice
        finite = [t for t in (BOOL, *self.types.values()) if t.finite and t.kind != "fun"]
        sequences = [(name, t) for name, t in names.items() if t.kind == "seq"]
        match choice(("type", "type", "type", "upto", "numbers", "sequence", "set", "any")):
            case "upto" if self.knobs.arithmetic:
                return NATURAL, self._upto(names)
            case "numbers" if self.knobs.arithmetic:
                return choice(((INTEGER, "{-1, 0, 5}"), (REAL, "{0, 0.5, 2}")))
            case "sequence" if sequences:
                name, t = choice(sequences)
                return t.parts[0], name
            case "set" if self.sets:
                name = choice(list(self.sets))
                return self.sets[name], name
            case "set":
                of = choice([*finite, NATURAL] if self.knobs.arithmetic else finite)
                return of, self.collection(of, 1, names, "{}")
            case "any" if self.knobs.wild:
                finite = [self.basic()]
        of = choice(finite)
        return of, f"({', '.join(map(self.written, of.parts))})" if of.kind == "tuple" else self.written(of)

    # -- other steps ---------------------------------------------------------------------------------------------------

    def past(self, inner: Callable[[], str], names: Names) -> str:
        """A formula that speaks of the past, with parts such as `inner` makes."""
        choice, numbers = self.random.choice, [name for name, t in names.items() if t == NATURAL]

        def limit(relation: str = "") -> str:
            return f"[{relation}{self.random.randrange(4)} {'s' if self.knobs.seconds else 'steps'}]"

        def perhaps(chance: float, relation: str = "") -> str:
            return limit(relation) if self.random.random() < chance else ""

        forms = ["previous", "edge", "once", "once", "held", "held", "counted", "since", "since"]
        forms += ["number", "number"] if numbers and not self.knobs.seconds else []
        forms += ["arrived", "steps"] if self.knobs.seconds else []
        match choice(forms):
            case "previous":
                return f"previous({inner()}, {inner()})"
            case "edge":
                what = self.atom(names, 0) if self.knobs.seconds else inner()
                return f"{choice(('rose', 'fell', 'changed'))}({what})"
            case "number":
                before = f"{numbers[0]} == previous({numbers[0]}, {choice((numbers[0], '2'))})"
                return choice((before, f"changed({choice(numbers)})"))
            case "once":
                return f"{choice(('once', 'historically'))}{perhaps(0.6)}({inner()})"
            case "held":
                return f"held{limit()}({inner()})"
            case "counted":
                return f"counted(({inner()}) since ({inner()})) {choice(ORDERS)} {self.random.randrange(4)}"
            case "arrived":
                return f"arrived({choice([name for name in names if name.startswith('in.') and names[name] == BOOL])})"
            case "steps":
                word = choice(("once", "historically", "held"))
                return f"{word}[{self.random.randrange(3)} steps]({inner()})"
        return f"({inner()}) since{perhaps(0.75, choice(ORDERS) + ' ')} ({inner()})"

    def response(self, depth: int, names: Names, wanted: str = "") -> str:
        """A trigger and what it demands of steps to come, of one's own choice or `wanted`."""
        unit, choice = "s" if self.knobs.seconds else "steps", self.random.choice
        wanted, more = wanted or self.formula(depth, names), self.formula(depth, names)
        limited = [f"{word}[{self.random.randrange(4)} {unit}]({wanted})" for word in ("within", "for")]
        forms = [*limited, f"(({wanted}) until ({more}))", *([] if self.knobs.seconds else [f"next({wanted})"])]
        return f"({self.formula(depth, names)}) -> {choice(forms)}"


def checked(text: str) -> Contract:
    """The contract of a text that is sound."""
    contract, found = check_text(text, "drawn.rcl")
    assert contract is not None, (text, [f"{d.span} {d.message}" for d in found if d.is_error])
    return contract


def node_of(inputs: Names, outputs: Names, *clauses: str) -> Node:
    """A node ``n``; names without ``in.`` and ``out.``, types without declarations."""
    ports = [", ".join(f"{name} : {of.kind}" for name, of in each.items()) for each in (inputs, outputs)]
    said = " ".join(clauses) or "guarantee( TRUE )"
    return checked(f"node n {{ inputs( {ports[0]} ) outputs( {ports[1]} ) topics() {said} }}").nodes[0]

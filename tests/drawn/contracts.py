"""Random contracts: small enough to write out every case, as strange as the language allows, or about one node that has
ports of every type."""

from __future__ import annotations

import random
from collections.abc import Mapping

from hypothesis import strategies as st
from oracle.sanity import LIMIT

from avow.language.lexer import KEYWORDS
from avow.language.load import parse_formula
from avow.language.terms import Builtin, Term, Variable

from .formulas import BOOL, INTEGER, NATURAL, REAL, STRING, Formulas, Knobs, Names, Type, checked

COLOUR = Type("enum", "Colour", ("red", "green", "blue"))

# -- small -------------------------------------------------------------------------------------------------------------

_COMMAND = Type("data", "Cmd", ("go", "spin", "halt"), arguments=((COLOUR,), (BOOL,), ()))
_PAIR = Type("tuple", parts=(COLOUR, BOOL))
_TYPES = {
    "Colour": COLOUR,
    "Cmd": _COMMAND,
    "Deep": Type("data", "Deep", ("wrap", "tag"), arguments=((_COMMAND,), (COLOUR, BOOL))),
    "Pair": _PAIR,
}
_CONTEXT = """\
context {
  Colour : {red, green, blue};
  Cmd : {go(Colour), spin(BOOL), halt};
  Deep : {wrap(Cmd), tag(Colour, BOOL)};
  Pair : (Colour, BOOL);
}
"""
_PORTS: Mapping[Type, str] = {
    **dict.fromkeys((BOOL, *_TYPES.values()), ""),
    NATURAL: "{v} <= 2",
    INTEGER: "-1 <= {v} <= 2",
    REAL: "{v} in {{0, 0.5, 1, 2}}",
    STRING: '{v} in {{"a", ""}}',
    Type("seq", parts=(BOOL,)): "length({v}) <= 2",
    Type("seq", parts=(_PAIR,)): "length({v}) <= 1",
    Type("seq", parts=(NATURAL,)): "{v} in {{<>, <0>, <1>, <2>}}",
    Type("fun", parts=(COLOUR, BOOL)): "",
    Type("fun", parts=(COLOUR, COLOUR)): "",
    Type("fun", parts=(BOOL, _COMMAND)): "",
    Type("fun", parts=(BOOL, NATURAL)): "forall(q in BOOL | {v}(q) <= 2)",
    Type("fun", parts=(COLOUR, BOOL, BOOL)): "",
}
"""What a port may be, and what keeps one of an infinite type within values of `oracle.domains.domain`, not all."""


def small_contract(seed: int) -> str:
    """A contract of one node over nearly all of the language, small enough that every case can be written out."""
    source = random.Random(seed)
    choice, made = source.choice, Formulas(source, Knobs(terms=source.choice([1, 1, 2])), types=_TYPES)
    ports = {
        role: {f"{role[0]}{k}": choice(list(_PORTS)) for k in range(choice(counts))}
        for role, counts in (("in", [1, 2, 2]), ("out", [1, 1, 2]))
    }
    ins: Names = {f"in.{name}": of for name, of in ports["in"].items()}
    outs: Names = {f"out.{name}": of for name, of in ports["out"].items()}
    assumed = [made.formula(choice([0, 1, 2]), ins) for _ in range(choice([0, 1, 1]))]
    promised = [made.formula(choice([1, 2, 3]), {**ins, **outs}) for _ in range(choice([1, 2, 2, 3]))]
    clauses = [
        *_limits("assume", ins),
        *(f"assume( {formula} )" for formula in assumed),
        *_limits("guarantee", outs),
        *(f"guarantee( {formula} )" for formula in promised),
    ]
    told = [", ".join(f"{name} : {made.written(of)}" for name, of in each.items()) for each in ports.values()]
    head = f"inputs( {told[0]} ) outputs( {told[1]} ) topics()"
    return _CONTEXT + "node n {\n  " + "\n  ".join([head, *clauses]) + "\n}\n"


def _limits(clause: str, ports: Names) -> list[str]:
    limited = ((name, _PORTS[of].format(v=name)) for name, of in ports.items() if _PORTS[of])
    return [f"{clause} {LIMIT}{name.partition('.')[2]} ( {formula} )" for name, formula in limited]


# -- finite ------------------------------------------------------------------------------------------------------------

FINITE = checked(
    "context { Colour : {red, green, blue}; } node n { inputs( b : BOOL, c : Colour, r : Colour --> BOOL )"
    " outputs( p : BOOL, d : Colour, s : Colour --> BOOL ) topics() guarantee( TRUE ) }"
)
INPUTS = tuple(port.variable for port in FINITE.nodes[0].inputs)
OUTPUTS = tuple(port.variable for port in FINITE.nodes[0].outputs[:2])
FUNCTION_OUTPUT = FINITE.nodes[0].outputs[2].variable
_FINITE_TYPES = {"b": BOOL, "c": COLOUR, "p": BOOL, "d": COLOUR} | dict.fromkeys(
    "rs", Type("fun", parts=(COLOUR, BOOL))
)


def finite_formulas(free: tuple[Variable, ...] = (*INPUTS, *OUTPUTS), depth: int = 3) -> st.SearchStrategy[Term]:
    """Formulas over finite sorts."""
    names = {v.qualified: _FINITE_TYPES[v.name] for v in free}

    def made(seed: int) -> Term:
        text = Formulas(random.Random(seed), Knobs(arithmetic=False), types={"Colour": COLOUR}).formula(depth, names)
        return parse_formula(text, FINITE.nodes[0], FINITE)

    return st.integers(0, 2**32).map(made)


# -- of one node with ports of every type ------------------------------------------------------------------------------

CONTRACT = """\
context {
  RadStat : {red, orange, green};
  Cmd : {move(REAL, REAL), inspect(NATURAL), halt};
  M : REAL x INTEGER --> BOOL;
  F : NATURAL --> REAL;
  O : {};
  K = 3;
  Q = {red, green};
  W = {wa, wb};
}
node n {
  inputs( r : REAL, i : INTEGER, k : NATURAL, b : BOOL, s : STRING, st : RadStat, m : M, f : F, sq : <REAL>,
          ns : <NATURAL>, p : (REAL, INTEGER), o : O, inl : {go, stop}, w : W )
  outputs( c : Cmd, st2 : RadStat, b2 : BOOL, o : O )
  topics()
  guarantee( TRUE )
}
"""


_STATUS = Type("enum", "RadStat", ("red", "orange", "green"))
_OPAQUE = Type("opaque", "O")
VARIED: Names = {
    **dict.fromkeys(("r", "in.r"), REAL),
    **dict.fromkeys(("i", "in.i"), INTEGER),
    **dict.fromkeys(("k", "in.k"), NATURAL),
    **dict.fromkeys(("b", "in.b", "b2"), BOOL),
    **dict.fromkeys(("st", "st2"), _STATUS),
    **dict.fromkeys(("in.o", "out.o"), _OPAQUE),
    "s": STRING,
    "c": Type("data", "Cmd", ("move", "inspect", "halt"), arguments=((REAL, REAL), (NATURAL,), ())),
    "m": Type("fun", parts=(REAL, INTEGER, BOOL)),
    "f": Type("fun", parts=(NATURAL, REAL)),
    "in.sq": Type("seq", parts=(REAL,)),
    "ns": Type("seq", parts=(NATURAL,)),
    "p": Type("tuple", parts=(REAL, INTEGER)),
    "inl": Type("enum", "", ("go", "stop")),
    "w": Type("enum", "W", ("wa", "wb")),
}
"""The names of `CONTRACT`, qualified and not."""


class Varied(Formulas):
    """A source of formulas over the node of `CONTRACT`, many of them without parentheses."""

    def __init__(self, seed: int) -> None:
        types = {"RadStat": _STATUS, "Cmd": VARIED["c"], "W": VARIED["w"], "O": _OPAQUE}
        knobs = Knobs(bare=0.6, wild=True, terms=2)
        super().__init__(random.Random(seed), knobs, types=types, constants={"K": NATURAL}, sets={"Q": _STATUS})

    def fresh(self) -> str:
        return super().fresh() + "'" * self.random.randrange(3)

    def formula(self, depth: int, names: Names = VARIED, terms: int | None = None) -> str:
        return super().formula(depth, names, terms)


# -- strange -----------------------------------------------------------------------------------------------------------

WORDS = tuple(
    word
    for line in (
        "assert let Int Real Bool String select store declare as ite distinct reset push pop model set method function",
        "var seq map bool int real nat char object array class module import datatype string new return returns old",
        "predicate lemma ghost reads modifies decreases fresh multiset this null proctype active mtype byte bit short",
        "timeout run goto atomic never ltl init do od fi def lambda None is pass del yield x' x'' X Y l O I0 A G _ __",
        "a_b aB Ab ab begin input frac alpha sum Type type fun Prop Set nil cons head tail empty ensures",
    )
    for word in line.split()
)
SENTENCES = (
    r'"100 % \\section{x} & $y$ #1 _ ^ ~ {b}"',
    r'"\\input{/etc/passwd} \\write18{ls} é ∀ 🤖 <b> \n\n x"',
    r'"…“”‘’–—ß ﬁ مرحبا 日本語 \t ^^M %"',
    *("", "", ""),
)


class Strange(Formulas):
    """A contract made from its types: declared types of every kind, nested in one another; names that are words of the
    languages that contracts are translated to; constants of every type; comments and line ends anywhere."""

    def __init__(self, seed: int) -> None:
        super().__init__(random.Random(seed), Knobs(bare=0.3, wild=True, terms=2, partial=False))
        self.types: dict[str, Type] = {}
        self.constants: dict[str, Type] = {}
        self.sets: dict[str, Type] = {}
        self.used = {*KEYWORDS, *Builtin, "x", "length"}
        self.lines: list[str] = []
        self.comments: list[str] = []

    def fresh(self) -> str:
        for _ in range(50):
            name = self.random.choice(WORDS)
            if self.random.random() < 0.4:
                name = "".join(self.random.choices("abXY_", k=self.random.randrange(1, 7)))
                name += self.random.choice(("", "'", "''", "1", "_2"))
            if name not in self.used:
                break
        else:
            name = f"n{len(self.used)}"
        self.used.add(name)
        return name

    def _declare(self) -> None:
        for _ in range(self.random.randrange(7)):
            name, of = self.fresh(), self._declared()
            sign = ":"
            if of.kind in ("enum", "data", "opaque"):
                of = of._replace(name=name)
            if of.kind == "enum":
                sign, shown = self.random.choice(":="), "{" + ", ".join(of.members) + "}"
            elif of.kind == "data":
                shown = ", ".join(
                    c + (f"({', '.join(map(self.written, a))})" if a else "")
                    for c, a in zip(of.members, of.arguments, strict=True)
                )
                shown = "{" + shown + "}"
            else:
                shown = "{}" if of.kind == "opaque" else self.written(of)
            self.types[name] = of
            self.lines.append(f"{name} {sign} {shown};")
        for _ in range(self.random.randrange(4)):
            name, of = self.fresh(), self.basic(1)
            if not of.opaque:
                self.lines.append(f"{name} = ({self.term(of, 2, {})});")
                self.constants[name] = of
        for _ in range(self.random.randrange(3)):
            name, of = self.fresh(), self.basic(1)
            if not of.opaque and of.kind != "enum":
                self.lines.append(f"{name} = {self.collection(of, 1, {}, '{}')};")
                self.sets[name] = of

    def _declared(self) -> Type:
        match self.random.randrange(7):
            case 0 | 1:
                return Type("enum", members=tuple(self.fresh() for _ in range(self.random.randint(1, 4))))
            case 2:
                members = tuple(self.fresh() for _ in range(self.random.randint(1, 3)))
                arguments = (self.several(2, 1, 2), *(self.several(2, 0, 2) for _ in members[1:]))
                return Type("data", members=members, arguments=arguments)
            case 3:
                return Type("opaque")
            case 4:
                return Type("fun", parts=self.several(2, 2, 4))
            case 5:
                return Type("tuple", parts=self.several(2, 2, 3))
        return Type("seq", parts=(self.basic(2),))

    def text(self) -> str:
        self._declare()
        out = ["context {", *self.lines, "}"] if self.lines else []
        for _ in range(self.random.randint(1, 3)):
            out += self._node()
        return self._laid_out("\n".join(out))

    def _node(self) -> list[str]:
        names: dict[str, Type] = {}
        lists: dict[str, list[str]] = {"in": [], "out": []}
        topics = []
        for role, ports in lists.items():
            for _ in range(self.random.randint(0 if role == "in" else 1, 3)):
                of = self.random.choice([*self.types.values(), self.basic(2), self.basic(2)])
                port = self.fresh()
                ports.append(f"{port} : {self.written(of)}")
                names[f"{role}.{port}" if self.random.random() < 0.6 else port] = of
                if self.random.random() < 0.5:
                    ros = self.random.choice(("std_msgs/Bool", "a_b/msg/C_d", "float64"))
                    topics.append(f"{ros} t{len(topics)} matches({role}.{port})")
        clauses = []
        for word in ["assume"] * self.random.randrange(3) + ["guarantee"] * self.random.randint(1, 3):
            head = f"{self.random.choice((word, word[0].upper()))} {self.random.choice((self.fresh(), ''))} "
            formula = self.formula(self.random.randint(1, 3), names)
            clauses.append(f"{head}{self.random.choice(SENTENCES)} ( {formula} )")
        inputs, outputs = (f"( {', '.join(ports)} )" for ports in lists.values())
        head = f"node {self.fresh()} {{"
        return [head, f"inputs{inputs}", f"outputs{outputs}", f"topics( {', '.join(topics)} )", *clauses, "}"]

    def _laid_out(self, text: str) -> str:
        """The text with comments, tabs, and line ends of every kind in places of its spaces outside strings."""
        if self.random.random() < 0.4:
            return text
        pieces: list[str] = []
        quoted = False
        for i, character in enumerate(text):
            if character == '"' and (not quoted or (len(text[:i]) - len(text[:i].rstrip("\\"))) % 2 == 0):
                quoted = not quoted
            if character != " " or quoted or text[i - 1] == "!":
                pieces.append(character)
                continue
            number = len(self.comments)
            form = self.random.choices(range(7), (3, 2, 2, 4, 3, 3, 83))[0]
            comments = (f"/* c{number} é */", f"// d{number} \" ' ) }}", f"/* m{number}\n  two\n*/")
            if form < 3:
                self.comments.append(comments[form])
                pieces.append(f" {comments[form]}\n" if form == 1 else f" {comments[form]} ")
            else:
                pieces.append(("\n\n\n", "\t", "\r\n", " ")[form - 3])
        return "".join(pieces)

"""Random contracts made from their types: types first, then terms and formulas of them, so that nearly all are sound.

Other shapes than `generate`: declared types of every kind, nested in one another; names that are words of the languages
that contracts are translated to; constants of every type; comments and line ends anywhere.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from typing import NamedTuple

from avow.language.lexer import KEYWORDS
from avow.language.terms import Builtin

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
TEXTS = (
    *('""', '"a b"', r'"\"q\" \\ %d $x_1^2 & # ~ {}"', r'"日本 ∀ 🤖 \n\t"', '"--> // no comment /* */"'),
    r'"|piped| \\end{document}"',
)
SENTENCES = (
    r'"100 % \\section{x} & $y$ #1 _ ^ ~ {b}"',
    r'"\\input{/etc/passwd} \\write18{ls} é ∀ 🤖 <b> \n\n x"',
    r'"…“”‘’–—ß ﬁ مرحبا 日本語 \t ^^M %"',
    *("", "", ""),
)


class Type(NamedTuple):
    """`kind` is REAL …, enum, data, tuple, seq, fun (the last of `parts` is the result) or opaque."""

    kind: str
    name: str = ""
    members: tuple[str, ...] = ()
    parts: tuple[Type, ...] = ()
    arguments: tuple[tuple[Type, ...], ...] = ()


REAL, INTEGER, NATURAL, BOOL, STRING = map(Type, ("REAL", "INTEGER", "NATURAL", "BOOL", "STRING"))
Names = Mapping[str, Type]


class Contracts:
    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.used = {*KEYWORDS, *Builtin, "x", "length"}
        self.types: dict[str, Type] = {}
        self.constants: dict[str, Type] = {}
        self.sets: dict[str, Type] = {}
        self.lines: list[str] = []
        self.comments: list[str] = []

    def name(self) -> str:
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

    # --- types -------------------------------------------------------------------------------------------------------

    def basic(self, depth: int) -> Type:
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

    def declare(self) -> None:
        for _ in range(self.random.randrange(7)):
            name, of = self.name(), self.declared()
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
            name, of = self.name(), self.basic(1)
            if not opaque(of):
                self.lines.append(f"{name} = ({self.term(of, 2, {})});")
                self.constants[name] = of
        for _ in range(self.random.randrange(3)):
            name, of = self.name(), self.basic(1)
            if not opaque(of) and of.kind != "enum":
                self.lines.append(f"{name} = {self.collection(of, 1, {}, '{}')};")
                self.sets[name] = of

    def declared(self) -> Type:
        match self.random.randrange(7):
            case 0 | 1:
                return Type("enum", members=tuple(self.name() for _ in range(self.random.randint(1, 4))))
            case 2:
                members = tuple(self.name() for _ in range(self.random.randint(1, 3)))
                arguments = (self.several(2, 1, 2), *(self.several(2, 0, 2) for _ in members[1:]))
                return Type("data", members=members, arguments=arguments)
            case 3:
                return Type("opaque")
            case 4:
                return Type("fun", parts=self.several(2, 2, 4))
            case 5:
                return Type("tuple", parts=self.several(2, 2, 3))
        return Type("seq", parts=(self.basic(2),))

    # --- terms -------------------------------------------------------------------------------------------------------

    def term(self, of: Type, depth: int, names: Names) -> str:
        """A term of that type, which may stand anywhere."""
        choice = self.random.choice
        known: list[Callable[[], str]] = [
            *(lambda n=n: n for n, t in (*names.items(), *self.constants.items()) if t == of),  # type: ignore[misc]
            *(
                lambda n=n, t=t: self.applied(n, t, depth, names)  # type: ignore[misc]
                for n, t in names.items()
                if depth > 0 and t.kind == "fun" and t.parts[-1] == of and not any(map(opaque, t.parts))
            ),
        ]
        if known and self.random.random() < 0.55:
            return choice(known)()
        match of.kind:
            case "REAL" | "INTEGER" | "NATURAL":
                return self.number(of, depth, names)
            case "BOOL":
                return f"({self.formula(depth - 1, names)})" if depth > 0 else choice(("TRUE", "FALSE"))
            case "STRING":
                return choice(TEXTS)
            case "enum":
                return choice(of.members)
            case "data":
                at = self.random.randrange(len(of.members))
                given = ", ".join(self.term(t, depth - 1, names) for t in of.arguments[at])
                return of.members[at] + (f"({given})" if given else "")
            case "tuple":
                return f"({', '.join(self.term(t, depth - 1, names) for t in of.parts)})"
            case "seq" if of.parts[0].kind == "NATURAL" and self.random.random() < 0.4:
                return f"<{self.random.randrange(3)} upto {self.term(NATURAL, 0, names)}>"
            case "seq":
                return self.collection(of.parts[0], depth, names, "<>")
        raise AssertionError(of)

    def applied(self, name: str, of: Type, depth: int, names: Names) -> str:
        return f"{name}({', '.join(self.term(t, depth - 1, names) for t in of.parts[:-1])})"

    def collection(self, of: Type, depth: int, names: Names, signs: str) -> str:
        items = ", ".join(self.term(of, depth - 1, names) for _ in range(self.random.randint(1, 3)))
        return f"{signs[0]}{items}{signs[1]}"

    def number(self, of: Type, depth: int, names: Names) -> str:
        form, choice = self.random.randrange(8 if depth > 0 else 2), self.random.choice
        if form < 2:
            numbers = ["0", "1", "7", str(10**20), str(10**40)]
            numbers += ["-1", "(-2)", "- -3"] if of.kind != "NATURAL" else []
            numbers += ["1.50", "0.001", "-0.5", "1/3", "123456789.987654321", "0.0"] if of.kind == "REAL" else []
            return choice(numbers)
        left, right = self.term(of, depth - 1, names), self.term(of, depth - 1, names)
        if form == 6:
            return f"(if {self.formula(depth - 1, names)} then {left} else {right})"
        if form == 7:
            whole = self.term(choice((INTEGER, NATURAL)) if of.kind != "NATURAL" else NATURAL, depth - 1, names)
            calls = [f"{choice(('min', 'max'))}({left}, {right})", f"abs({left})"]
            return choice((*calls, f"{choice(('mod', 'div'))}({whole}, {choice((1, 2, 7))})"))
        if form < 4:
            return f"({left} {choice('+*' if of.kind == 'NATURAL' else '+-*')} {right})"
        if form == 4 and of.kind == "REAL":
            return f"({left} / {choice((2, 3, 7, '2.5'))})"
        return f"-({left})" if of.kind != "NATURAL" else f"length({self.collection(BOOL, depth - 1, names, '<>')})"

    # --- formulas ----------------------------------------------------------------------------------------------------

    def atom(self, depth: int, names: Names) -> str:
        choice = self.random.choice
        of = choice([t for t in names.values() if t.kind != "fun"] + [self.basic(1)])
        if opaque(of):
            same = [n for n, t in names.items() if t == of]
            return f"{choice(same)} {choice(('==', '!='))} {choice(same)}" if same else "TRUE"
        one = self.term(of, depth, names)
        numeric = choice((REAL, INTEGER))
        match self.random.randrange(8):
            case 0 | 1 | 2:
                return f"{one} {choice(('==', '!='))} {self.term(of, depth, names)}"
            case 3:
                sign = choice(("<", "<=", ">", ">="))
                return f"{self.term(numeric, depth, names)} {sign} {self.term(numeric, depth, names)}"
            case 4:
                signs = choice((("<", "<="), (">", ">="), ("==", "<"), ("<=", "==")))
                terms = [self.term(numeric, depth, names) for _ in range(3)]
                return f"{terms[0]} {signs[0]} {terms[1]} {signs[1]} {terms[2]}"
            case 5 | 6:
                known = [name for name, t in self.sets.items() if t == of]
                among = choice(known) if known else self.collection(of, depth, names, choice(("{}", "<>")))
                if of.kind == "enum" and self.random.random() < 0.4:
                    among = of.name
                return f"{one} {choice(('in', '!in', '! in'))} {among}"
        truths = [name for name, t in names.items() if t == BOOL]
        return choice((*truths, "TRUE", "FALSE"))

    def formula(self, depth: int, names: Names) -> str:
        if depth <= 0:
            return self.atom(0, names)
        count = self.random.randint(2, 4)
        inner = [self.formula(depth - 1, names) for _ in range(count)]
        parts = [f"({p})" if self.random.random() < 0.7 else p for p in inner]
        match self.random.randrange(10):
            case 9:
                whole = f"if {inner[0]} then {inner[1]} else {inner[-1]}"
                return self.random.choice((f"xor({inner[0]}, {inner[1]})", f"({whole})"))
            case 0 | 1:
                return self.random.choice((" and ", " or ")).join(parts)
            case 2 | 3:
                return self.random.choice((" -> ", " <=> ")).join(parts[:3])
            case 4:
                return f"not {parts[0]}"
            case 5 | 6 | 7:
                return self.quantified(depth, names)
        return self.atom(depth, names)

    def quantified(self, depth: int, names: Names) -> str:
        inside, binders = dict(names), []
        for _ in range(self.random.randint(1, 2)):
            variables = [self.name() for _ in range(self.random.randint(1, 2))]
            of, domain = self.domain()
            inside.update(dict.fromkeys(variables, of))
            binders.append(f"{', '.join(variables)} in {domain}")
        word = self.random.choice(("forall", "exists", "exists_unique", "forall "))
        return f"{word}({', '.join(binders)} {self.random.choice('|;')} {self.formula(depth - 1, inside)})"

    def domain(self) -> tuple[Type, str]:
        match self.random.randrange(5):
            case 0:
                return NATURAL, "<0 upto 3>"
            case 1:
                return INTEGER, "{-1, 0, 5}"
            case 2 if self.sets:
                name = self.random.choice(list(self.sets))
                return self.sets[name], name
        of = self.basic(1)
        if of.kind == "tuple":
            return of, f"({', '.join(map(self.written, of.parts))})"
        return of, self.written(of)

    # --- the text ----------------------------------------------------------------------------------------------------

    def text(self) -> str:
        self.declare()
        out = ["context {", *self.lines, "}"] if self.lines else []
        for _ in range(self.random.randint(1, 3)):
            out += self.node()
        return self.laid_out("\n".join(out))

    def node(self) -> list[str]:
        names: dict[str, Type] = {}
        lists: dict[str, list[str]] = {"in": [], "out": []}
        topics = []
        for role, ports in lists.items():
            for _ in range(self.random.randint(0 if role == "in" else 1, 3)):
                of = self.random.choice([*self.types.values(), self.basic(2), self.basic(2)])
                port = self.name()
                ports.append(f"{port} : {self.written(of)}")
                names[f"{role}.{port}" if self.random.random() < 0.6 else port] = of
                if self.random.random() < 0.5:
                    ros = self.random.choice(("std_msgs/Bool", "a_b/msg/C_d", "float64"))
                    topics.append(f"{ros} t{len(topics)} matches({role}.{port})")
        clauses = []
        for word in ["assume"] * self.random.randrange(3) + ["guarantee"] * self.random.randint(1, 3):
            head = f"{self.random.choice((word, word[0].upper()))} {self.random.choice((self.name(), ''))} "
            formula = self.formula(self.random.randint(1, 3), names)
            clauses.append(f"{head}{self.random.choice(SENTENCES)} ( {formula} )")
        inputs, outputs = (f"( {', '.join(ports)} )" for ports in lists.values())
        head = f"node {self.name()} {{"
        return [head, f"inputs{inputs}", f"outputs{outputs}", f"topics( {', '.join(topics)} )", *clauses, "}"]

    def laid_out(self, text: str) -> str:
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


def opaque(of: Type) -> bool:
    """Whether no term of the type can be written down."""
    return of.kind == "opaque" or any(map(opaque, (*of.parts, *(t for a in of.arguments for t in a))))

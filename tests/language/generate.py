"""Random well-formed formulas (nearly all well-typed), and random damage to texts."""

from __future__ import annotations

import random
import re

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

_NUMBERS = ("0", "1", "12", "2.5", "0.125", "1.0", "-3", "-2.5", "3 / 4", "K", "in.r", "i", "in.i", "k", "length(sq)")
_OTHERS = (
    'b2 == (s == "a\\"b\\\\")',
    's != ""',
    "inl == go",
    "p == (1, 2)",
    "p == (2.5, i)",
    "(1, 2) == p",
    "sq == <>",
    "<> != sq",
    "ns == <1, 2>",
    "sq == <1, 2>",
    "<1 upto k> == ns",
    "in.o == out.o",
    "w in W",
    "length(<1, 2>) == 2",
    "(1, k) == (1.0, 2)",
)
_DOMAINS = (
    *(("REAL", True), ("INTEGER", True), ("NATURAL", True), ("{1, 2}", True), ("<0 upto k>", True), ("ns", True)),
    *((d, False) for d in ("RadStat", "BOOL", "Q", "(REAL, INTEGER)", "<REAL>", "O", "Cmd", "W")),
)


class Formulas:
    """A source of formulas over the node of `CONTRACT`."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.count = 0

    def number(self, depth: int, names: tuple[str, ...]) -> str:
        choice = self.random.choice
        form = self.random.randrange(9 if depth > 0 else 3)
        if form < 3:
            return choice((*_NUMBERS, *names))
        if form < 6:
            text = f"{self.number(depth - 1, names)} {choice('+-*/')} {self.number(depth - 1, names)}"
            return f"({text})" if self.random.random() < 0.5 else text
        if form == 6 and self.random.random() < 0.6:
            first, second = self.number(depth - 1, names), self.number(depth - 1, names)
            whole = choice(("in.i", "k", "length(sq)"))
            calls = (f"{choice(('min', 'max'))}({first}, {second})", f"abs({first})", f"mod({whole}, 3)")
            return choice((*calls, f"div({whole}, 2)", f"(if in.b then {first} else {second})"))
        if form == 6:
            return f"-({self.number(depth - 1, names)})"
        if form == 7:
            return f"f(in.k + {self.random.randrange(3)})"
        return f"in.sq({choice(('0', 'k', 'length(ns) - 1'))})"

    def atom(self, depth: int, names: tuple[str, ...]) -> str:
        choice, number = self.random.choice, self.number
        match self.random.randrange(12):
            case 0 | 1 | 2:
                operator = choice(("<", "<=", ">", ">=", "==", "!="))
                return f"{number(depth, names)} {operator} {number(depth, names)}"
            case 3:
                first = choice(("<", "<=", "=="))
                return f"{number(1, names)} {first} {number(1, names)} <= {number(1, names)}"
            case 4:
                return choice(("b", "in.b", "b2", "TRUE", "FALSE"))
            case 5:
                of = choice(("{red, green}", "Q", "RadStat", "{}"))
                return f"{choice(('st', 'st2', 'red'))} {choice(('in', '!in'))} {of}"
            case 6:
                command = choice(("halt", f"move({number(1, names)}, {number(1, names)})", "inspect(k + 1)"))
                return f"c == {command}"
            case 7:
                return f"in.m({number(1, names)}, {choice(('i', 'k', '3', 'i - 2'))})"
            case 8:
                of = choice(("{1, 2.5}", "{1, 2}", "<1 upto 5>", "<0.5, r>", "sq", "{in.i, k}"))
                return f"{number(1, names)} in {of}"
            case 9:
                return choice(_OTHERS)
            case 10 if depth > 0:
                return f"({self.formula(depth - 1, names)}) == {choice(('TRUE', 'FALSE', 'b'))}"
        return f"({self.formula(depth - 1, names)})" if depth > 0 else "b"

    def formula(self, depth: int, names: tuple[str, ...] = ()) -> str:
        if depth <= 0:
            return self.atom(0, names)
        inner = [self.formula(depth - 1, names) for _ in range(self.random.randrange(2, 4))]
        choice = self.random.choice
        match self.random.randrange(11):
            case 10:
                return choice((f"xor({inner[0]}, {inner[1]})", f"(if {inner[0]} then {inner[1]} else {inner[-1]})"))
            case 0 | 1:
                return " and ".join(inner)
            case 2 | 3:
                return " or ".join(inner)
            case 4:
                return f"{inner[0]} -> {inner[1]}"
            case 5:
                return f"{inner[0]} <=> {inner[1]}"
            case 6:
                return f"not {inner[0]}"
            case 7 | 8:
                self.count += 1
                bound = [f"v{self.count}" + "'" * self.random.randrange(3)]
                if self.random.random() < 0.4:
                    bound.append(f"u{self.count}")
                domain, numeric = self.random.choice(_DOMAINS)
                body = self.formula(depth - 1, (*names, *bound) if numeric else names)
                quantifier = self.random.choice(("forall", "exists", "exists_unique"))
                return f"{quantifier}({', '.join(bound)} in {domain} | {body})"
        return self.atom(depth, names)


_PIECES = re.compile(r"\w+'*|[^\w\s]+|\s+")
_WORDS = (
    *("context", "node", "inputs", "outputs", "topics", "matches", "assume", "guarantee", "forall", "exists", "in"),
    *("exists_unique", "upto", "length", "TRUE", "REAL", "STRING", "A", "G", "x", "not", "!in", "out", ".", "1.5"),
    *("<", ">", "<>", "<=>", "->", "-->", "--", "==", "=", "{", "}", "(", ")", "|", ";", "//", "/*", "*/", '"', "\n"),
    *("∀", "é", "\x00", "\x1b[31m", "\\", "9" * 600, "'", "\ufeff", "\u202e"),
)


def damaged(text: str, source: random.Random) -> str:
    """The text with a few of its words replaced, dropped, doubled, swapped or reversed, or junk put between them."""
    if source.random() < 0.4:
        start = source.randrange(len(text))
        text = text[start : start + source.randrange(3000)]
    parts = _PIECES.findall(text)
    for _ in range(source.randrange(1, 12)):
        if not parts:
            break
        at = source.randrange(len(parts))
        match source.randrange(7):
            case 0 | 1:
                parts[at] = source.choice(_WORDS)
            case 2:
                del parts[at]
            case 3:
                parts.insert(at, source.choice(_WORDS))
            case 4:
                other = source.randrange(len(parts))
                parts[at], parts[other] = parts[other], parts[at]
            case 5:
                parts[at] = parts[at][::-1]
            case _:
                parts.insert(at, "".join(chr(source.randrange(0x3000)) for _ in range(source.randrange(6))))
    return "".join(parts)

"""Random small contracts with a program that means to keep them, and near misses of both."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from differential.inputs import COLOURS, grid, literal
from differential.language import (
    DAFNY,
    FIELDS,
    INPUTS,
    ORDER,
    OUTPUTS,
    TYPES,
    WRITTEN,
    Expr,
    Statement,
    arith,
    compare,
    conj,
    dafny_lines,
    imp_lines,
    inp,
    is_expression,
    num,
    out,
    python_lines,
    rcl,
    var,
    widen,
)  # fmt: skip
from differential.near_misses import near_miss
from differential.oracle import truth

Leaf = tuple[list[Expr], list[tuple[str, str]], Expr]
"""Conditions of a path, variables of its matches, and the value at its end."""


@dataclass
class Contract:
    """One source: `assumptions` and `guarantees` by name, and the program."""

    inputs: list[str]
    outputs: list[str]
    assumptions: dict[str, Expr]
    guarantees: dict[str, Expr]
    program: list[Statement]

    @property
    def rcl(self) -> str:
        ins = ", ".join(f"{n} : {WRITTEN[INPUTS[n]]}" for n in self.inputs)
        outs = ", ".join(f"{n} : {WRITTEN[OUTPUTS[n]]}" for n in self.outputs)
        topics = [f"a/I given matches(in.{n})" for n in self.inputs] + [
            f"a/O made matches(out.{n})" for n in self.outputs
        ]
        lines = [f"  assume {k} ( {rcl(e)} )" for k, e in self.assumptions.items()]
        lines += [f"  guarantee {k} ( {rcl(e)} )" for k, e in self.guarantees.items()]
        head = f"{TYPES}node n {{\n  inputs( {ins} )\n  outputs( {outs} )\n  topics( {', '.join(topics)} )\n"
        return head + "\n".join(lines) + "\n}\n"

    @property
    def imp(self) -> str:
        return "\n".join(imp_lines(self.program)) + "\n"

    @property
    def python(self) -> str:
        made = ", ".join(f'"{n}": out_{n}' for n in self.outputs)
        body = [f"def step({', '.join(self.inputs)}):", *python_lines(self.program), f"    return {{{made}}}"]
        return "\n".join(["from fractions import Fraction", "", *body, ""])

    def dafny(self, example: dict[str, Any]) -> str:
        ins = ", ".join(f"in_{n}: {DAFNY[INPUTS[n]]}" for n in self.inputs)
        outs = ", ".join(f"out_{n}: {DAFNY[OUTPUTS[n]]}" for n in self.outputs)
        names = ", ".join(f"in_{n}" for n in self.inputs)
        values = ", ".join(literal(example[f"in.{n}"], INPUTS[n]) for n in self.inputs)
        return "\n".join(
            [
                'include "n_spec.dfy"',
                'module {:options "--function-syntax:3"} NImpl refines NSpec {',
                f"  predicate Env({ins}) {{ true }}",
                f"  lemma EnvNotEmpty() returns ({ins}) {{ {names} := {values}; }}",
                f"  method Step({ins}) returns ({outs})",
                "  {",
                *dafny_lines(self.program),
                "  }",
                "}",
                "",
            ]
        )


class Writer:
    """One random contract."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.inputs = self.rng.sample(sorted(INPUTS), self.rng.choice((2, 2, 3, 3, 4)))
        self.outputs = self.rng.sample(sorted(OUTPUTS), self.rng.choice((1, 2)))
        if not {"r", "t", "k", "j", "m", "w"} & set(self.inputs):
            self.inputs[0] = self.rng.choice("rkm")
        needed = {"done": "before", "lev": "level"}
        self.inputs += sorted({needed[o] for o in self.outputs if o in needed} - set(self.inputs))
        self.bound: list[tuple[str, str]] = []
        self.fresh = 0

    def pick(self, *choices: Any) -> Any:
        return self.rng.choice(choices)

    def given(self, sorts: str) -> list[Expr]:
        found = [inp(n) for n in self.inputs if INPUTS[n] in sorts]
        return found + [var(n, s) for n, s in self.bound if s in sorts]

    def constant(self, sort: str) -> Expr:
        if sort == "R":
            return num(self.pick("0.25", "0.5", "1.5", "2.75", "0.1", 1, 2, 3), "R")
        return num(self.rng.randint(0 if sort == "N" else -2, 4), sort)

    def number(self, sort: str, depth: int = 1) -> Expr:
        """Of this sort or a smaller one; partial only where `safe` is not asked."""
        below = {"N": "N", "I": "IN", "R": "RIN"}[sort]
        known = self.given(below)
        if depth == 0 or self.rng.random() < 0.35:
            return self.pick(*known, *known, self.constant(sort)) if known else self.constant(sort)
        kinds = ["+", "+", "times"]
        if sort != "N":
            kinds += ["-", "-", "neg"]
            kinds += ["level"] * (2 * len(self.given("L"))) + ["nth"] * len(self.given("S"))
        if sort == "R":
            kinds += ["/", "/", "over"]
        kinds += ["len"] * len(self.given("S"))
        match self.rng.choice(kinds):
            case "times":
                return arith("*", num(2), self.number(sort, depth - 1))
            case "neg":
                inner = self.number(sort, depth - 1)
                inner = widen(inner, "I") if inner[1] == "N" else inner
                return ("neg", inner[1], inner)
            case "level":
                return ("app", "I", inp("level"), self.number("N", 0))
            case "nth":
                return ("nth", "I", inp("path"), self.number("N", 0))
            case "len":
                return ("len", "N", inp("path"))
            case "/":
                return arith("/", self.number("R", depth - 1), num(self.pick(2, 4, "0.5"), "R"))
            case "over":
                return arith("/", self.number("R", 0), self.number("R", 0))
            case op:
                return arith(op, self.number(sort, depth - 1), self.number(sort, 0))

    def colour(self) -> Expr:
        return self.pick(*self.given("C"), *(("elem", "C", c) for c in COLOURS))

    def command(self) -> Expr:
        name = self.pick("move", "mark", "halt")
        arguments = [widen(self.number(s, self.rng.randint(0, 1)), s) for s in FIELDS[name]]
        return self.pick(*self.given("D"), ("data", "D", name, *arguments))

    def pair(self) -> Expr:
        return self.pick(*self.given("P"), ("pair", "P", widen(self.number("I"), "I"), self.colour()))

    def path(self) -> Expr:
        made = ("seq", "S", *(widen(self.number("I", 0), "I") for _ in range(self.rng.randint(0, 3))))
        return self.pick(*self.given("S"), made)

    def test(self, depth: int = 1) -> Expr:
        if depth and self.rng.random() < 0.4:
            kind = self.pick("and", "or", "not", "->", "<=>")
            parts = [self.test(depth - 1) for _ in range(1 if kind == "not" else 2)]
            return (kind, "B", *parts)
        choices: list[Callable[[], Expr]] = [self.comparison, self.comparison, self.chain]
        for sort in "BCDMSP":
            if self.given(sort):
                choices += [getattr(self, f"of_{sort}")] * 2
        if self.given("IN"):
            choices.append(self.member)
        return self.rng.choice(choices)()

    def comparison(self) -> Expr:
        sort = self.pick("R", "I", "N")
        a, b = self.pick(*(self.given("RIN"))), self.number(sort, self.rng.randint(0, 1))
        if a == b:
            b = self.constant(sort)
        return compare(a, self.pick("<", "<=", ">", ">=", "==", "!="), b)

    def chain(self) -> Expr:
        low, high = sorted((self.constant("R"), self.constant("I")), key=lambda e: e[2])
        middle = self.number("R")
        if self.rng.random() < 0.3:
            return compare(high, self.pick(">", ">="), middle, self.pick(">", ">="), low)
        return compare(low, self.pick("<", "<="), middle, self.pick("<", "<=", "=="), high)

    def member(self) -> Expr:
        item = self.pick(*self.given("IN"))
        return (self.pick("in", "!in"), "B", item, *(self.constant(item[1]) for _ in range(2)))

    def of_B(self) -> Expr:  # noqa: N802 - sorts are letters
        return self.pick(*self.given("B"))

    def of_C(self) -> Expr:  # noqa: N802
        one = self.pick(*self.given("C"))
        other = self.colour()
        return self.pick(
            compare(one, self.pick("==", "!="), other if other != one else ("elem", "C", "green")),
            (self.pick("in", "!in"), "B", one, *(("elem", "C", c) for c in self.rng.sample(COLOURS, 2))),
            ("near", "B", one),
        )

    def of_D(self) -> Expr:  # noqa: N802
        name = self.pick("move", "mark", "halt")
        made = ("data", "D", name, *(widen(self.number(s, 0), s) for s in FIELDS[name]))
        return compare(inp("command"), self.pick("==", "==", "!="), made)

    def of_M(self) -> Expr:  # noqa: N802
        return ("app", "B", inp("before"), self.number("N"))

    def of_S(self) -> Expr:  # noqa: N802
        return self.pick(
            ("within", "B", widen(self.number("I", 0), "I"), inp("path")),
            compare(("len", "N", inp("path")), self.pick("<", "==", ">", ">="), self.constant("N")),
            compare(inp("path"), self.pick("==", "!="), ("seq", "S", widen(self.number("I", 0), "I"))),
        )

    def of_P(self) -> Expr:  # noqa: N802
        other = ("pair", "P", widen(self.number("I"), "I"), self.colour())
        return compare(inp("pair"), self.pick("==", "!="), other)

    # -- programs

    def block(self, name: str, depth: int) -> list[Statement]:
        if depth and self.rng.random() < 0.75:
            if "command" in self.inputs and self.rng.random() < 0.4:
                return [self.match(name, depth)]
            return [("if", self.test(), self.block(name, depth - 1), self.block(name, depth - 1))]
        return self.leaf(name)

    def match(self, name: str, depth: int) -> Statement:
        constructor = self.pick("move", "mark", "halt")
        self.fresh += 1
        new = [(f"{'y' if s == 'R' else 'i'}{self.fresh}", s) for s in FIELDS[constructor]]
        self.bound += new
        then = self.block(name, depth - 1)
        self.bound = [b for b in self.bound if b not in new]
        return ("match", constructor, [n for n, _ in new], then, self.block(name, depth - 1))

    def leaf(self, name: str) -> list[Statement]:
        sort = OUTPUTS[name]
        match sort:
            case "M" | "L":
                base: list[Statement] = [("set", name, inp("before" if sort == "M" else "level"))]
                if self.rng.random() < 0.2:
                    return base
                new = self.pick(("true", "B"), self.test(0)) if sort == "M" else widen(self.number("I"), "I")
                return [*base, ("update", name, self.number("N", self.rng.randint(0, 1)), new)]
            case "R" | "I" | "N":
                # a smaller sort than the output's is widened; a larger number for a natural is the program's fault
                wanted = "I" if sort == "N" and self.rng.random() < 0.25 else sort
                found = self.number(wanted, self.rng.randint(0, 2))
                return [
                    (
                        "set",
                        name,
                        widen(found, sort) if found[1] != "I" else found if sort != "R" else widen(found, "R"),
                    )
                ]
            case "B":
                return [("set", name, self.test())]
        made = {"C": self.colour, "D": self.command, "S": self.path, "P": self.pair}[sort]()
        return [("set", name, made)]

    # -- what the program does, as claims

    def leaves(self, block: list[Statement], path: list[Expr], names: list[tuple[str, str]]) -> Iterator[Leaf]:
        kind, *parts = block[0]
        match kind:
            case "if":
                yield from self.leaves(parts[1], [*path, parts[0]], names)
                yield from self.leaves(parts[2], [*path, ("not", "B", parts[0])], names)
            case "match":
                new = list(zip(parts[1], FIELDS[parts[0]], strict=True))
                is_it = compare(inp("command"), "==", ("data", "D", parts[0], *(var(n, s) for n, s in new)))
                yield from self.leaves(parts[2], [*path, is_it], [*names, *new])
                if not new:
                    yield from self.leaves(parts[3], [*path, ("not", "B", is_it)], names)
                else:
                    other = ("not", "B", ("exists", "B", tuple(new), is_it))
                    yield from self.leaves(parts[3], [*path, other], names)
            case "set":
                yield path, names, ("made", "?", *block)

    def claim(self, name: str, made: Expr) -> Expr:
        """Something that an output with this value has."""
        o, sort = out(name), OUTPUTS[name]
        setting, *updates = made[2:]
        e = setting[2]
        match sort:
            case "R" | "I" | "N":
                d = self.constant("N") if sort != "R" else self.constant("R")
                if e[1] == "I" and sort == "N":
                    return self.pick(compare(o, "==", e), compare(e, "<=", o))
                return self.pick(
                    compare(o, "==", e),
                    compare(o, "==", e),
                    compare(o, self.pick("<=", ">="), e),
                    compare(arith("-", e, d), "<=", o, "<=", arith("+", e, d)),
                    compare(o, "<", arith("+", e, num(1))),
                    ("not", "B", compare(o, "!=", e)),
                )
            case "B":
                return self.pick(("<=>", "B", o, e), ("->", "B", e, o), ("->", "B", ("not", "B", e), ("not", "B", o)))
            case "C":
                return self.pick(compare(o, "==", e), ("in", "B", o, e, self.colour()))
            case "P":
                if e[0] != "pair" or self.rng.random() < 0.5:
                    return compare(o, "==", e)
                a, c = var("a", "I"), var("c", "C")
                inner = conj(compare(o, "==", ("pair", "P", a, c)), compare(a, self.pick("<=", ">="), e[2]))
                return ("exists", "B", (("a", "I"), ("c", "C")), inner)
            case "D":
                if e[0] == "data" and e[2] == "move" and self.rng.random() < 0.5:
                    y, i = var("y", "R"), var("i", "N")
                    inner, there = ("data", "D", "move", y, i), ("data", "D", "move", y, e[4])
                    both = (("y", "R"), ("i", "N"))
                    return self.pick(
                        ("exists", "B", (("y", "R"),), conj(compare(o, "==", there), compare(y, ">=", e[3]))),
                        ("forall", "B", both, ("->", "B", compare(o, "==", inner), compare(y, "<=", e[3]))),
                        ("exists_unique", "B", both, compare(o, "==", inner)),
                    )  # fmt: skip
                i = var("i", "N")
                marked = conj(compare(o, "==", ("data", "D", "mark", i)), compare(i, ">=", num(0)))
                return self.pick(
                    compare(o, "==", e),
                    ("exists", "B", (("i", "N"),), marked)
                    if e[0] == "data" and e[2] == "mark"
                    else ("not", "B", compare(o, "!=", e)),
                )  # fmt: skip
            case "S":
                v = var("v", "N")
                choices = [compare(o, "==", e), compare(("len", "N", o), "==", ("len", "N", e))]
                if e[0] == "seq" and len(e) > 2:
                    at = self.rng.randrange(len(e) - 2)
                    choices += [compare(("nth", "I", o, num(at)), "==", e[2 + at]), ("within", "B", e[2 + at], o)]
                last = arith("-", ("len", "N", o), num(1))
                choices.append(("each", "B", "v", num(0), last, compare(("nth", "I", o, v), "==", ("nth", "I", e, v))))
                return self.rng.choice(choices)
            case "M":
                v = var("v", "N")
                held, now = ("app", "B", inp("before"), v), ("app", "B", o, v)
                if not updates:
                    return ("forall", "B", (("v", "N"),), ("<=>", "B", now, held))
                at, new = updates[0][2], updates[0][3]
                here = compare(v, "==", at)
                if new[0] == "true":
                    same = ("<=>", "B", now, ("or", "B", held, here))
                else:
                    same = (
                        "<=>",
                        "B",
                        now,
                        ("or", "B", ("and", "B", here, new), ("and", "B", ("not", "B", here), held)),
                    )
                return self.pick(
                    ("forall", "B", (("v", "N"),), same),
                    ("<=>", "B", ("app", "B", o, at), new),
                    ("forall", "B", (("v", "N"),), ("->", "B", compare(v, "!=", at), ("<=>", "B", now, held))),
                    ("->", "B", ("app", "B", o, at), ("exists", "B", (("v", "N"),), now)),
                )
            case _:
                v = var("v", "N")
                held, now = ("app", "I", inp("level"), v), ("app", "I", o, v)
                if not updates:
                    return ("forall", "B", (("v", "N"),), compare(now, "==", held))
                at, new = updates[0][2], updates[0][3]
                return self.pick(
                    compare(("app", "I", o, at), "==", new),
                    ("forall", "B", (("v", "N"),), ("->", "B", compare(v, "!=", at), compare(now, "==", held))),
                    conj(
                        compare(("app", "I", o, at), "==", new),
                        ("forall", "B", (("v", "N"),), ("or", "B", compare(v, "==", at), compare(now, "==", held))),
                    ),
                )

    def guarantee(self, leaf: Leaf, name: str) -> Expr:
        path, names, made = leaf
        body = self.claim(name, made)
        if path:
            if self.rng.random() < 0.3:
                for condition in reversed(path):
                    body = ("->", "B", condition, body)
            else:
                body = ("->", "B", conj(*path), body)
        return ("forall", "B", tuple(names), body) if names else body

    def assumption(self) -> Expr:
        return self.pick(self.comparison(), self.chain(), self.test(0))

    def contract(self, *, spiced: bool = False) -> Contract:
        blocks = {name: self.block(name, self.rng.choice((0, 1, 1, 2, 2))) for name in self.outputs}
        guarantees: dict[str, Expr] = {}
        for name, block in blocks.items():
            found = list(self.leaves(block, [], []))
            for leaf in self.rng.sample(found, min(3, len(found))):
                guarantees[f"g{len(guarantees)}"] = self.guarantee(leaf, name)
        program = [s for name in self.outputs for s in blocks[name]]
        assumptions = {f"a{k}": self.assumption() for k in range(self.pick(0, 0, 1, 1, 2))}
        made = Contract(self.inputs, self.outputs, assumptions, guarantees, program)
        tried = grid(made, random.Random(0), 60)
        if not any(all(truth(a, inputs) for a in assumptions.values()) for inputs in tried):
            made.assumptions = {}
        if spiced:
            guarantees.update({name: self.spiced(g) for name, g in guarantees.items()})
        chance = self.rng.random()
        if chance < 0.5:
            made.program = near_miss(made.program, self.rng, self.given)
        elif chance < 0.75:
            name = self.rng.choice(sorted(guarantees))
            guarantees[name] = near_miss(guarantees[name], self.rng, self.given)
        return made

    # -- operators that programs do not have

    def spiced(self, e: Any, *, inside: bool = False) -> Any:
        """A claim with operators of contracts alone, here and there: most change nothing, some make it another one."""
        if not isinstance(e, tuple):
            return e
        if e[0] in ("forall", "exists", "exists_unique", "each", "some"):
            return (*e[:-1], self.spiced(e[-1], inside=True))
        if e[0] == "cmp":
            e = (*e[:3], *(self.spiced(p, inside=inside) for p in e[3:]))
        elif e[0] not in ("app", "nth", "len", "near", "within", "in", "!in"):
            e = tuple(self.spiced(p, inside=inside) if is_expression(p) else p for p in e)
        if self.rng.random() > 0.2:
            return e
        sort = e[1]
        if sort == "B":
            other = self.test(0)
            return self.pick(
                ("not", "B", ("xor", "B", e, ("true", "B"))) if self.rng.random() < 0.5 else ("xor", "B", e, other),
                ("ite", "B", other, e, self.pick(e, ("not", "B", ("not", "B", e)), self.test(0))),
            )
        if sort not in ORDER:
            return e
        if self.rng.random() < 0.3:
            return ("ite", sort, self.test(0), e, self.pick(e, self.constant(sort)))
        if sort != "R" and self.rng.random() < 0.4:
            by = num(self.pick(2, 3, 5))
            whole = ("+", "I" if sort == "I" else "N", ("*", sort, by, ("div", sort, e, by)), ("mod", "N", e, by))
            return self.pick(whole, whole, widen(("mod", "N", e, by), sort))
        if self.rng.random() < 0.3:
            absolute = ("abs", "R" if sort == "R" else "N", e)
            return widen(absolute, sort)
        other = self.pick(e, self.constant(sort))
        return (self.pick("min", "max"), sort, e, other)

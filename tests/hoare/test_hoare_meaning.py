"""Weakest preconditions, the simplifier and the interpreter held against each other on generated programs."""

from __future__ import annotations

import random
from collections.abc import Iterator
from fractions import Fraction

import pytest
from helpers import some

from avow.backends.hoare import wp
from avow.backends.hoare.checker import Checked, check
from avow.backends.hoare.interpreter import Fault, Machine
from avow.backends.hoare.parser import parse_expression, parse_program
from avow.backends.hoare.typing import Expressions, Names
from avow.backends.hoare.wp import Conditions, weakest
from avow.base.diagnostics import Span
from avow.evaluation.evaluate import evaluate
from avow.formulas.values import Data, Element, FunctionValue, Value
from avow.language.contract import Contract
from avow.language.load import check_text
from avow.language.scope import of_contract
from avow.language.sorts import BOOL
from avow.language.terms import TRUE, Term

RCL = """
context { Colour : {red, orange, green}; Command : { move(INTEGER, INTEGER), inspect(INTEGER), halt };
          Map : INTEGER --> INTEGER; }
node n {
  inputs( a : INTEGER, b : INTEGER, r : REAL, m : Map, command : Command )
  outputs( x : INTEGER, y : INTEGER, q : REAL, p : Map, colour : Colour, flag : BOOL )
  topics( a/B c matches(in.a) )
  assume( TRUE )
  guarantee( TRUE )
}
"""
PLACE = Span("plan.yaml", 1, 1, 1, 1)
START = "VAR x, y : INTEGER; VAR q : REAL; VAR p : Map; VAR colour : Colour; VAR flag : BOOL;\n"


class Writer:
    """Random programs as text."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.matched: list[str] = []
        self.count = 0

    def number(self, depth: int = 2) -> str:
        leaves = ["a", "b", "x", "y", *self.matched, str(self.chance.randrange(4))]
        if depth == 0 or self.chance.random() < 0.4:
            return self.chance.choice(leaves)
        kind = self.chance.choice(["+", "-", "*", "p", "m", "neg"])
        if kind in {"p", "m"}:
            return f"{kind}({self.number(depth - 1)})"
        if kind == "neg":
            return f"-{self.number(0)}"
        return f"({self.number(depth - 1)} {kind} {self.number(depth - 1)})"

    def real(self) -> str:
        return self.chance.choice(["r", "q", "1.5", "q + 0.5", "q / r", "r * 2", f"q - {self.number(0)}"])

    def test(self, depth: int = 2) -> str:
        if depth and self.chance.random() < 0.4:
            operator = self.chance.choice(["and", "or", "->", "<=>"])
            return f"({self.test(depth - 1)} {operator} {self.test(depth - 1)})"
        comparison = self.chance.choice(["<", "<=", "==", "!=", ">", ">="])
        return self.chance.choice(
            [
                f"{self.number(1)} {comparison} {self.number(1)}",
                f"{self.real()} {comparison} {self.real()}",
                "colour == red",
                "colour in {red, green}",
                "flag",
                "not flag",
                f"command == inspect({self.number(0)})",
                f"p({self.number(1)}) == m({self.number(0)})",
            ]
        )

    def block(self, depth: int, indent: str) -> Iterator[str]:
        for _ in range(self.chance.randint(1, 3)):
            yield from self.statement(depth, indent)

    def statement(self, depth: int, indent: str) -> Iterator[str]:
        kinds = ["x", "x", "y", "q", "p", "copy", "colour", "flag", "skip"] + (["if", "if", "match"] if depth else [])
        match self.chance.choice(kinds):
            case "x":
                yield f"{indent}x := {self.number()}"
            case "y":
                yield f"{indent}y := {self.number()}"
            case "q":
                yield f"{indent}q := {self.real()}"
            case "p":
                yield f"{indent}p[{self.number(1)}] := {self.number(1)}"
            case "copy":
                yield f"{indent}p := m"
            case "colour":
                yield f"{indent}colour := {self.chance.choice(['red', 'orange', 'green'])}"
            case "flag":
                yield f"{indent}flag := {self.test(1)}"
            case "skip":
                yield f"{indent}SKIP"
            case "if":
                yield f"{indent}IF {self.test()} THEN"
                yield from self.block(depth - 1, indent + "  ")
                if self.chance.random() < 0.7:
                    yield f"{indent}ELSE"
                    yield from self.block(depth - 1, indent + "  ")
            case "match":
                self.count += 1
                names = [f"k{self.count}", f"l{self.count}"]
                name = self.chance.choice(["move", "inspect", "halt"])
                names = names[: {"move": 2, "inspect": 1, "halt": 0}[name]]
                yield f"{indent}MATCH command WITH {name}{'(' + ', '.join(names) + ')' if names else ''} THEN"
                self.matched += names
                yield from self.block(depth - 1, indent + "  ")
                self.matched = [n for n in self.matched if n not in names]
                yield f"{indent}ELSE"
                yield from self.block(depth - 1, indent + "  ")

    def program(self) -> str:
        return START + "\n".join(self.block(2, ""))


def contract() -> Contract:
    found, faults = check_text(RCL, "n.rcl")
    assert found is not None, faults
    return found


CONTRACT = contract()
NODE = CONTRACT.nodes[0]


def checked(text: str) -> Checked:
    return check(parse_program(text, "p.imp"), CONTRACT, NODE, {})


def assertion(text: str, made: Checked) -> Term:
    names = Names(of_contract(CONTRACT), {v.name: v.sort for v in made.program.state})
    written = parse_expression(text, PLACE)
    return Expressions(names, written.text, {}, asserts=True).read(written.tree, BOOL)


def state(chance: random.Random, made: Checked) -> dict[str, Value]:
    def number() -> int:
        return chance.randrange(-2, 4)

    def table() -> FunctionValue:
        return FunctionValue({(number(),): number() for _ in range(chance.randrange(3))}, number())

    commands: list[Value] = [Data("move", (number(), number())), Data("inspect", (number(),)), Data("halt")]
    known: dict[str, Value] = {
        **{name: number() for name in ("a", "b", "x", "y")},
        **{name: Fraction(chance.randrange(-4, 5), 2) for name in ("r", "q")},
        **{name: table() for name in ("m", "p")},
        "command": chance.choice(commands),
        "colour": Element(chance.choice(["red", "orange", "green"])),
        "flag": chance.random() < 0.5,
    }
    return known


@pytest.mark.parametrize("seed", some(range(60), 20, slow=40))
def test_weakest_preconditions_are_what_running_shows(seed: int) -> None:
    writer = Writer(seed)
    text = writer.program()
    made = checked(text)
    post = assertion(writer.test(), made)
    wanted = weakest(made.program.body, post, Conditions(TRUE))
    machine, chance = Machine(), random.Random(seed)
    for _ in range(15):
        start = state(chance, made)
        try:
            end = machine.run(made.program.body, start)
            held = evaluate(post, end) is True if defined_in(post, end) else None
        except Fault:
            held = False
        if held is None:
            continue  # the postcondition itself divides by zero there: it says nothing
        assert evaluate(wanted, start) is held, (text, start)


def defined_in(term: Term, values: dict[str, Value]) -> bool:
    from avow.backends.hoare.wp import defined

    return evaluate(defined(term), values) is True


@pytest.mark.parametrize("broken", ["updated", "assigned", "misfits", "defined"])
def test_a_broken_calculus_would_be_caught(monkeypatch: pytest.MonkeyPatch, broken: str) -> None:
    """The comparison with running programs notices each part of the calculus when it is replaced by a wrong one."""
    wrong = {
        "updated": lambda post, *_: post,
        "assigned": lambda post, *_: post,
        "misfits": lambda _: TRUE,
        "defined": lambda _: TRUE,
    }
    monkeypatch.setattr(wp, broken, wrong[broken])
    with pytest.raises(AssertionError):  # noqa: PT012 - one of the programs shows it
        for seed in range(60):
            test_weakest_preconditions_are_what_running_shows(seed)

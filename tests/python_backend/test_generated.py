"""Generated programs: their translation run in doubles is CPython, bit for bit; and the facts of their symbolic run
hold of every such run, with one way out, whose outputs are CPython's."""

from __future__ import annotations

import ast
import functools
import json
import random
import tempfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.programs.samples import Drawing, pool
from avow.backends.python.program import Step, run
from avow.backends.python.symbolic import Run
from avow.backends.python.translate import Translator
from avow.backends.python.whole_file import read
from avow.drive.steps import coded, driver
from avow.evaluation.evaluate import evaluate
from avow.formulas.values import Element, Value
from avow.language.contract import Node
from avow.language.load import load_contract
from avow.language.sorts import EnumSort
from avow.language.terms import And, Arithmetic, Compare, Iff, Implies, Term, Variable

CONTRACT = """context { MODE : { idle, busy, done }; }
node made {
  inputs( a : REAL, b : REAL, n : INTEGER, flag : BOOL, mode : MODE, held : REAL, count : INTEGER )
  outputs( u : REAL, v : INTEGER, w : BOOL, m : MODE, held : REAL, count : INTEGER ) topics()
  guarantee nothing ( out.w or not out.w )
}"""
MEMORY = {"held": "held", "count": "count"}
FLOATS = ("0.1", "0.3", "1.5", "2.0", "-0.5", "3.0")


class Author:
    """Writes a class by chance."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.floats = ["a", "b", "self.held", "self.gain"]
        self.ints = ["n", "self.count"]
        self.truths = ["flag"]

    def float(self, depth: int = 0) -> str:
        kind = self.chance.randrange(9 if depth < 3 else 2)
        one, other = (lambda: self.float(depth + 1)), (lambda: self.float(depth + 1))
        match kind:
            case 0:
                return self.chance.choice(FLOATS)
            case 1:
                return self.chance.choice(self.floats)
            case 2 | 3:
                return f"({one()} {self.chance.choice('+-*/')} {other()})"
            case 4:
                return f"{self.chance.choice(['min', 'max'])}({one()}, {other()})"
            case 5:
                return f"({one()} if {self.truth(depth + 1)} else {other()})"
            case 6:
                return self.chance.choice([f"abs({one()})", f"(-{one()})", f"self._half({one()})", f"clip({one()})"])
            case 7:
                return f"({one()} {self.chance.choice('+-*/')} {self.int(depth + 1)})"
            case _:
                return f"({self.int(depth + 1)} / {self.int(depth + 1)})"

    def int(self, depth: int = 0) -> str:
        match self.chance.randrange(6 if depth < 3 else 2):
            case 0:
                return str(self.chance.randrange(-2, 5))
            case 1:
                return self.chance.choice(self.ints)
            case 2 | 3:
                return f"({self.int(depth + 1)} {self.chance.choice('+-*')} {self.int(depth + 1)})"
            case 4:
                return f"({self.int(depth + 1)} {self.chance.choice(['//', '%'])} {self.int(depth + 1)})"
            case _:
                return f"max({self.int(depth + 1)}, {self.int(depth + 1)})"

    def truth(self, depth: int = 0) -> str:
        match self.chance.randrange(7 if depth < 3 else 3):
            case 0:
                return self.chance.choice(self.truths)
            case 1:
                return f"{self.chance.choice(self.floats)} {self.compared()} {self.chance.choice(FLOATS)}"
            case 2:
                return self.chance.choice(["mode == 'idle'", "mode != 'busy'", "mode in ('idle', 'done')"])
            case 3:
                return f"({self.float(depth + 1)} {self.compared()} {self.float(depth + 1)})"
            case 4:
                return f"({self.int(depth + 1)} {self.compared()} {self.chance.choice(self.floats)} < 4.0)"
            case 5:
                return f"({self.truth(depth + 1)} {self.chance.choice(['and', 'or'])} {self.truth(depth + 1)})"
            case _:
                return f"(not {self.truth(depth + 1)})"

    def compared(self) -> str:
        return self.chance.choice(["<", "<=", ">", ">=", "==", "!="])

    def block(self, indent: int, depth: int) -> Iterator[str]:
        pad = " " * indent
        for _ in range(self.chance.randrange(1, 4)):
            match self.chance.randrange(7 if depth < 2 else 5):
                case 0:
                    yield f"{pad}x = {self.float()}"
                case 1:
                    yield f"{pad}self.held {self.chance.choice(['=', '+=', '*='])} {self.float()}"
                case 2:
                    yield f"{pad}self.count = {self.int()}"
                case 3:
                    yield f"{pad}t = {self.truth()}"
                case 4:
                    yield f"{pad}x, self.held, self.count = self.held, {self.float()}, {self.int()}"
                case 5:
                    yield f"{pad}if {self.truth()}:"
                    yield from self.block(indent + 4, depth + 1)
                    if self.chance.random() < 0.5:
                        yield f"{pad}else:"
                        yield from self.block(indent + 4, depth + 1)
                case _:
                    yield f"{pad}if {self.truth()}:"
                    yield from self.block(indent + 4, depth + 1)
                    yield f"{pad}    {self.result()}"

    def result(self) -> str:
        mode = self.chance.choice(["mode", "'idle'", "('busy' if t else 'done')"])
        return f"return {{'u': {self.float()}, 'v': {self.int()}, 'w': {self.truth()}, 'm': {mode}}}"

    def text(self) -> str:
        self.floats += ["x"]
        self.truths += ["t"]
        body = "\n".join(self.block(8, 0))
        return f"""
def clip(value):
    if value > 1.5:
        return 1.5
    return value if value > -1.5 else -1.5

class Made:
    GAIN = 0.7
    def __init__(self):
        self.held, = (0.0,)
        self.count = 0
        self.gain = self.GAIN
    def _half(self, value):
        if value < self.held:
            return self.held / 2.0
        return value / 2.0
    def step(self, a, b, n, flag, mode):
        x = a
        t = flag
{body}
        {self.result()}
""".replace("self.held, = (0.0,)", "self.held = 0.0")


def translated(text: str, node: Node) -> Step:
    parts, refused = read(ast.parse(text), "Made", Path("made.py"))
    assert parts is not None
    assert not refused, refused
    return Translator(parts, node, MEMORY, {}, text).step()


def facts_hold(step: Step, node: Node, case: dict[str, Any], reply: dict[str, Any]) -> None:
    """Work out every name of the symbolic run as IEEE has it, and look whether all facts are true."""
    modes = next(p.sort for p in node.inputs if isinstance(p.sort, EnumSort))
    run_ = Run(step, dict.fromkeys(modes.members, modes), False, (0.0, 1.5, 0.3), (Fraction(3, 10),), ())
    names = {
        port.name: f"self.{MEMORY[port.name]}" if port.name in MEMORY else f"in.{port.name}" for port in node.inputs
    }
    run_.whole({names[port.name]: port.variable for port in node.inputs})
    values: dict[str, Value] = {}
    for name, value in case.items():
        values[f"in.{name}"] = (
            Fraction(value) if type(value) is float else Element(value) if type(value) is str else value
        )
    for fact in run_.facts:
        match fact:
            case Compare(operator="==", left=Variable() as name, right=term) if name.qualified not in values:
                values[name.qualified] = evaluate(term, values)
                continue
            case Iff(left=Variable() as name, right=term) if name.qualified not in values:
                values[name.qualified] = evaluate(term, values)
                continue
            case And(items=(Compare(left=Arithmetic(left=Variable() as name, right=exact)), *_)) if (
                name.name.startswith("rounded") and name.qualified not in values
            ):
                try:
                    values[name.qualified] = Fraction(float(Fraction(number(exact, values))))
                except OverflowError:
                    return  # infinite: what follows is about no number
            case Implies(
                right=Compare(
                    left=whole,
                    right=Arithmetic(left=Arithmetic(left=Variable() as name, right=divisor), right=Variable() as rest),
                )
            ) if name.name.startswith("floored") and name.qualified not in values:
                by, of = int(number(divisor, values)), int(number(whole, values))
                values |= {name.qualified: of // by if by else 0, rest.qualified: of % by if by else 0}
            case Implies(right=Compare(left=Arithmetic(left=Variable() as name, right=divisor), right=whole)) if (
                name.name.startswith("quotient") and name.qualified not in values
            ):
                below = number(divisor, values)
                values[name.qualified] = Fraction(number(whole, values)) / below if below else Fraction(0)
            case _:
                pass
        assert evaluate(fact, values) is True, fact
    error = "error" in reply
    failed = [c for c in run_.checks if evaluate(c.guard, values) is True and evaluate(c.goal, values) is not True]
    if error or failed:
        assert failed
        return
    ends = [end for end in run_.ends if evaluate(end.guard, values) is True]
    assert len(ends) == 1
    given = dict(reply["value"]["d"]) | reply["memory"]
    for name, term in ends[0].outputs.items():
        if name.startswith("out."):
            value = evaluate(term, values)
            theirs = plain_number(given[name.removeprefix("out.")])
            assert (str(value) if isinstance(value, Element) else value) == theirs, name


def number(term: Term, values: dict[str, Value]) -> Fraction:
    found = evaluate(term, values)
    assert isinstance(found, int | Fraction)
    return Fraction(found)


def plain_number(data: Any) -> Any:
    match data:
        case {"f": text}:
            return Fraction(float.fromhex(text))
        case {"i": digits}:
            return int(digits)
        case _:
            return data


@functools.cache
def made_node() -> Node:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made.rcl"
        path.write_text(CONTRACT)
        (node,) = load_contract((path,)).nodes
    return node


def compare(seed: int, cases: int = 12) -> int:
    chance = random.Random(seed)
    text = Author(chance).text()
    node = made_node()
    step = translated(text, node)
    space: dict[str, Any] = {}
    exec(compile(text, "made.py", "exec"), space)
    ask = driver(space["Made"], {"params": coded({}), "memory": MEMORY, "attributes": []})
    sorts = {p.name: p.sort for p in node.inputs}
    drawn = Drawing(pool({Fraction(3, 10), Fraction(3, 2)}), sorts, chance)
    answered = 0
    for case in drawn.cases(cases, lambda _: True):
        inputs = {n: v for n, v in case.items() if n not in MEMORY}
        memory = {n: v for n, v in case.items() if n in MEMORY}
        asked = {n: {k: coded(v) for k, v in part.items()} for n, part in (("memory", memory), ("steps", inputs))}
        (theirs,) = json.loads(ask(json.dumps({**asked, "steps": [asked["steps"]]})))["steps"]
        ours = run(step, inputs, memory)
        assert ours.error == theirs.get("error", ""), (text, case)
        if not ours.error:
            assert dict(theirs["value"]["d"]) == {n: coded(v) for n, v in ours.outputs.items()}, (text, case)
            answered += 1
        assert theirs["memory"] == {n: coded(v) for n, v in ours.memory.items()}, (text, case)
        assert theirs["changed"] == []
        finite = not any(s in json.dumps(theirs) for s in ('"inf"', '"-inf"', '"nan"'))
        if finite:
            facts_hold(step, node, case, theirs)
    return answered


@pytest.mark.slow
def test_generated_programs() -> None:
    assert sum(compare(seed, 5) for seed in range(25)) > 40, "most of them have answers"


@pytest.mark.nightly
def test_many_generated_programs() -> None:
    for seed in range(25, 2000):
        compare(seed)

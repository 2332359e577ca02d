"""A contract's clauses as the Python that CrossHair looks at: a function for each guarantee, made of syntax trees.

Names are generated, and texts are constants of the tree, so that no text of a contract becomes code. Numbers are the
floats next to the contract's: what CrossHair finds with them is judged elsewhere, exactly.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from avow.language.contract import Clause, Node
from avow.language.operators import definition
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort, SequenceSort, Sort
from avow.language.terms import (
    And,
    Arithmetic,
    Compare,
    Conditional,
    EnumValue,
    Iff,
    Implies,
    Index,
    Length,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    Role,
    Term,
    Variable,
    Widen,
)

_TYPES = {BoolSort: "bool", EnumSort: "str", IntegerSort: "int", NaturalSort: "int", RealSort: "float"}


class Unsaid(Exception):  # noqa: N818 - it names what happened
    """A part of a formula that is not translated."""


def written(node: Node, clauses: Iterable[Clause], how: Mapping[str, Any]) -> tuple[str, Mapping[str, int]]:
    """The file's text, and the guarantee → number of its function; one that cannot be said is left out. `how` has the
    class: its file, name, parameters and memory."""
    translator = Translator(
        {p.name: k for k, p in enumerate(node.inputs)}, {p.name: k for k, p in enumerate(node.outputs)}
    )
    given = [f"i{k}: {_type(p.sort)}" for k, p in enumerate(node.inputs)]
    allowed = [ast.unparse(translator.term(a.formula)) for a in node.assumptions]
    allowed = [*(line for k, p in enumerate(node.inputs) for line in _ranges(f"i{k}", p.sort)), *allowed]
    memory: Mapping[str, str] = how["memory"]
    asked = [(k, p) for k, p in enumerate(node.inputs) if p.name not in memory]
    held = [f"    setattr(node, {memory[p.name]!a}, i{k})" for k, p in enumerate(node.inputs) if p.name in memory]
    others = [(k, p) for k, p in enumerate(node.outputs) if p.name not in memory]
    names = ", ".join(f"{p.name!a}: i{k}" for k, p in asked)
    step = [*held, f"    found = node.step(**{{{names}}})"]
    if len(others) == 1:
        step.append(f"    o{others[0][0]} = found[{others[0][1].name!a}] if isinstance(found, dict) else found")
    else:
        step += [f"    o{k} = found[{p.name!a}]" for k, p in others]
    step += [f"    o{k} = getattr(node, {memory[p.name]!a})" for k, p in enumerate(node.outputs) if p.name in memory]
    parts = [_HEAD.format(path=how["path"], name=how["class"], params=how["params"])]
    numbers: dict[str, int] = {}
    for k, clause in enumerate(clauses):
        try:
            demanded = ast.unparse(translator.term(clause.formula))
        except Unsaid:
            continue
        lines = [f"def guarantee_{k}({', '.join(given)}) -> None:", *(f"    assert {line}" for line in allowed)]
        lines += ["    assert True" if not allowed else "", "    node = made()", *step, f"    assert {demanded}"]
        parts.append("\n".join(line for line in lines if line) + "\n")
        numbers[clause.name] = k
    return "\n\n".join(parts), numbers


_HEAD = """\
import importlib.util
import inspect
import math

spec = importlib.util.spec_from_file_location("subject", {path!a})
subject = importlib.util.module_from_spec(spec)
spec.loader.exec_module(subject)
CLASS = getattr(subject, {name!a})
WANTS = len(inspect.signature(CLASS).parameters) > 0


def made():
    return CLASS({params!r}) if WANTS else CLASS()
"""


def _type(sort: Sort) -> str:
    if isinstance(sort, SequenceSort):
        return f"list[{_type(sort.item)}]"
    if type(sort) not in _TYPES:
        raise Unsaid(f"an input of the type {sort}")
    return _TYPES[type(sort)]


def _ranges(name: str, sort: Sort) -> list[str]:
    match sort:
        case RealSort():
            return [f"math.isfinite({name})"]
        case NaturalSort():
            return [f"{name} >= 0"]
        case EnumSort(members=members):
            return [f"{name} in {tuple(members)!a}"]
        case SequenceSort(item=item):
            return [f"all({line} for x in {name})" for line in _ranges("x", item)]
    return []


@dataclass(slots=True)
class Translator:
    """`inputs` and `outputs`: name → number."""

    inputs: Mapping[str, int]
    outputs: Mapping[str, int]
    bound: dict[Variable, str] = field(default_factory=dict)

    def term(self, term: Term) -> ast.expr:
        """Raises Unsaid."""
        match term:
            case Literal(value=bool() | str() | int() as value):
                return ast.Constant(value)
            case Literal(value=Fraction() as value):
                return ast.Constant(float(value))
            case EnumValue(name=name):
                return ast.Constant(name)
            case Variable(role=Role.INPUT, name=name):
                return ast.Name(f"i{self.inputs[name]}")
            case Variable(role=Role.OUTPUT, name=name):
                return ast.Name(f"o{self.outputs[name]}")
            case Variable() if term in self.bound:
                return ast.Name(self.bound[term])
            case Widen(term=inner):
                return self.term(inner)
            case Negative(term=inner):
                return ast.UnaryOp(ast.USub(), self.term(inner))
            case Not(body=inner):
                return ast.UnaryOp(ast.Not(), self.term(inner))
            case Arithmetic(operator=operator, left=left, right=right) if operator in _COMPUTED:
                return ast.BinOp(self.term(left), _COMPUTED[operator](), self.term(right))
            case Compare(operator=operator, left=left, right=right):
                return ast.Compare(self.term(left), [_COMPARED[operator]()], [self.term(right)])
            case And(items=items) if items:
                return ast.BoolOp(ast.And(), [*map(self.term, items), ast.Constant(True)])
            case Or(items=items) if items:
                return ast.BoolOp(ast.Or(), [*map(self.term, items), ast.Constant(False)])
            case Implies(left=left, right=right):
                return ast.BoolOp(ast.Or(), [ast.UnaryOp(ast.Not(), self.term(left)), self.term(right)])
            case Iff(left=left, right=right):
                return ast.Compare(_truth(self.term(left)), [ast.Eq()], [_truth(self.term(right))])
            case Conditional(condition=condition, then=then, otherwise=otherwise):
                return ast.IfExp(self.term(condition), self.term(then), self.term(otherwise))
            case Index(sequence=sequence, index=index):
                return ast.Subscript(self.term(sequence), self.term(index))
            case Length(sequence=sequence):
                return ast.Call(ast.Name("len"), [self.term(sequence)], [])
            case Operation() if (same := definition(term)) is not None:
                return self.term(same)
            case Quantified(quantifier=Quantifier.FORALL, variables=(one,), body=Implies(left=left, right=right)):
                return self._over(one, left, Implies(left, right), "all")
            case Quantified(quantifier=Quantifier.EXISTS, variables=(one,), body=And(items=items)):
                return self._over(one, And(items), And(items), "any")
        raise Unsaid(f"a {type(term).__name__}")

    def _over(self, one: Variable, guard: Term, body: Term, word: str) -> ast.expr:
        """Over the places of the sequence whose length bounds the variable."""
        parts = guard.items if isinstance(guard, And) else (guard,)
        for part in parts:
            match part:
                case Compare(operator="<", left=left, right=Length(sequence=sequence)) if _plain(left) == one:
                    if not isinstance(one.sort, NaturalSort):
                        break
                    name = f"x{len(self.bound)}"
                    self.bound[one] = name
                    inner = self.term(body)
                    del self.bound[one]
                    length = ast.Call(ast.Name("len"), [self.term(sequence)], [])
                    places = ast.Call(ast.Name("range"), [length], [])
                    each = ast.GeneratorExp(inner, [ast.comprehension(ast.Name(name), places, [], 0)])
                    return ast.Call(ast.Name(word), [each], [])
        raise Unsaid("a quantifier that no sequence's length bounds")


_COMPUTED: Mapping[str, Any] = {"+": ast.Add, "-": ast.Sub, "*": ast.Mult, "/": ast.Div}
_COMPARED: Mapping[str, Any] = {"<": ast.Lt, "<=": ast.LtE, ">": ast.Gt, ">=": ast.GtE, "==": ast.Eq, "!=": ast.NotEq}


def _truth(value: ast.expr) -> ast.expr:
    return ast.Call(ast.Name("bool"), [value], [])


def _plain(term: Term) -> Term:
    return _plain(term.term) if isinstance(term, Widen) else term

"""Contracts and formulas for the tests of the logic, and a small evaluator that shares no code with Avow's."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from pathlib import Path

from avow.language.contract import Contract, Node
from avow.language.load import check_text, load_contract, parse_formula
from avow.language.sorts import BOOL, EnumSort, FunctionSort, Sort
from avow.language.terms import (
    And,
    Apply,
    Compare,
    EnumValue,
    Iff,
    Implies,
    In,
    Literal,
    Not,
    Or,
    Quantified,
    Quantifier,
    SetTerm,
    Term,
    Variable,
)

CONTRACTS = Path(__file__).parent.parent.parent / "contracts"


def contract(text: str) -> Contract:
    found, diagnostics = check_text(text, "test.rcl")
    assert found is not None, [d.message for d in diagnostics]
    return found


def node(text: str, context: str = "") -> Node:
    """The node of a text such as ``inputs( … ) outputs( … ) assume( … ) guarantee( … )``."""
    head, _, clauses = text.partition("|")
    body = f"node n {{ {head} topics() {clauses} }}"
    return contract((f"context {{ {context} }}" if context else "") + body).nodes[0]


def formula(text: str, within: Node, context: Contract | None = None) -> Term:
    return parse_formula(text, within, context) if context else parse_formula(text, within)


def case_study(name: str) -> Contract:
    return load_contract([CONTRACTS / name / "system.rcl"])


Values = dict[Variable, object]


def domain(sort: Sort) -> list[object]:
    """All values of a finite sort; functions as frozen sets of (arguments, value) pairs."""
    match sort:
        case EnumSort(members=members):
            return list(members)
        case FunctionSort(parameters=parameters, result=result):
            points = list(product(*(domain(p) for p in parameters)))
            return [dict(zip(points, values, strict=True)) for values in product(domain(result), repeat=len(points))]
    assert sort == BOOL
    return [False, True]


def holds(term: Term, values: Values) -> object:
    """The value of a term over finite sorts, by the book."""
    match term:
        case Literal(value=value):
            return Fraction(value) if isinstance(value, int) and not isinstance(value, bool) else value
        case EnumValue(name=name):
            return name
        case Variable():
            return values[term]
        case Apply(function=function, arguments=arguments):
            table = holds(function, values)
            assert isinstance(table, dict)
            return table[tuple(holds(a, values) for a in arguments)]
        case Not(body=body):
            return not holds(body, values)
        case And(items=items):
            return all(holds(item, values) for item in items)
        case Or(items=items):
            return any(holds(item, values) for item in items)
        case Implies(left=left, right=right):
            return not holds(left, values) or holds(right, values)
        case Iff(left=left, right=right):
            return holds(left, values) == holds(right, values)
        case Compare(operator="==", left=left, right=right):
            return holds(left, values) == holds(right, values)
        case Compare(operator="!=", left=left, right=right):
            return holds(left, values) != holds(right, values)
        case In(item=item, collection=SetTerm(items=items)):
            return any(holds(item, values) == holds(one, values) for one in items)
        case Quantified(quantifier=quantifier, variables=variables, body=body):
            count = 0
            whole = 0
            for choice in product(*(domain(v.sort) for v in variables)):
                whole += 1
                count += bool(holds(body, {**values, **dict(zip(variables, choice, strict=True))}))
            match quantifier:
                case Quantifier.FORALL:
                    return count == whole
                case Quantifier.EXISTS:
                    return count > 0
                case Quantifier.UNIQUE:
                    return count == 1
    raise AssertionError(f"not finite: {term}")

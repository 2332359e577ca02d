"""Random formulas over finite sorts, for comparing answers with brute force."""

from __future__ import annotations

from hypothesis import strategies as st

from avow.language.sorts import BOOL, EnumSort, FunctionSort, SetSort, Sort
from avow.language.terms import (
    And,
    Apply,
    Builtin,
    Compare,
    Conditional,
    EnumValue,
    Iff,
    Implies,
    In,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    Role,
    SetTerm,
    Term,
    Variable,
)

COLOUR = EnumSort("Colour", ("red", "green", "blue"))
RELATION = FunctionSort((COLOUR,), BOOL)
MAP = FunctionSort((COLOUR,), COLOUR)

INPUTS = (
    Variable(Role.INPUT, "b", BOOL),
    Variable(Role.INPUT, "c", COLOUR),
    Variable(Role.INPUT, "r", RELATION),
)
OUTPUTS = (
    Variable(Role.OUTPUT, "p", BOOL),
    Variable(Role.OUTPUT, "d", COLOUR),
)
FUNCTION_OUTPUT = Variable(Role.OUTPUT, "s", RELATION)


@st.composite
def formulas(draw: st.DrawFn, free: tuple[Variable, ...] = INPUTS + OUTPUTS, depth: int = 3) -> Term:
    return _formula(draw, free, depth, 0)


def _formula(draw: st.DrawFn, scope: tuple[Variable, ...], depth: int, level: int) -> Term:
    kinds = ["boolean", "equal", "apply", "in"]
    if depth:
        kinds += ["not", "and", "or", "implies", "iff", "quantified"] * 2 + ["xor", "if"]
    match draw(st.sampled_from(kinds)):
        case "boolean":
            found = [v for v in scope if v.sort == BOOL]
            return draw(st.sampled_from(found)) if found else Compare("==", _colour(draw, scope), _colour(draw, scope))
        case "equal":
            return Compare(draw(st.sampled_from(("==", "!="))), _colour(draw, scope), _colour(draw, scope))
        case "apply":
            found = [v for v in scope if v.sort == RELATION]
            if not found:
                return Compare("==", _colour(draw, scope), _colour(draw, scope))
            return Apply(draw(st.sampled_from(found)), (_colour(draw, scope),), BOOL)
        case "in":
            members = draw(st.lists(st.sampled_from(COLOUR.members), min_size=1, max_size=2, unique=True))
            return In(_colour(draw, scope), SetTerm(tuple(EnumValue(m, COLOUR) for m in members), SetSort(COLOUR)))
        case "not":
            return Not(_formula(draw, scope, depth - 1, level))
        case "and":
            return And((_formula(draw, scope, depth - 1, level), _formula(draw, scope, depth - 1, level)))
        case "or":
            return Or((_formula(draw, scope, depth - 1, level), _formula(draw, scope, depth - 1, level)))
        case "implies":
            return Implies(_formula(draw, scope, depth - 1, level), _formula(draw, scope, depth - 1, level))
        case "xor":
            parts = (_formula(draw, scope, depth - 1, level), _formula(draw, scope, depth - 1, level))
            return Operation(Builtin.XOR, parts, BOOL)
        case "if":
            return Conditional(
                _formula(draw, scope, depth - 1, level),
                _formula(draw, scope, depth - 1, level),
                _formula(draw, scope, depth - 1, level),
                BOOL,
            )
        case "iff":
            return Iff(_formula(draw, scope, depth - 1, level), _formula(draw, scope, depth - 1, level))
    variable = Variable(Role.BOUND, f"x{level}", COLOUR)
    quantifier = draw(st.sampled_from(tuple(Quantifier)))
    return Quantified(quantifier, (variable,), _formula(draw, (*scope, variable), depth - 1, level + 1))


def _colour(draw: st.DrawFn, scope: tuple[Variable, ...]) -> Term:
    options: list[Term] = [v for v in scope if v.sort == COLOUR]
    options += [EnumValue(member, COLOUR) for member in COLOUR.members]
    truths = [v for v in scope if v.sort == BOOL]
    if truths and draw(st.integers(0, 9)) == 0:
        condition = draw(st.sampled_from(truths))
        return Conditional(condition, draw(st.sampled_from(options)), draw(st.sampled_from(options)), COLOUR)
    return draw(st.sampled_from(options))


def sorts_of(variables: tuple[Variable, ...]) -> tuple[Sort, ...]:
    return tuple(v.sort for v in variables)

"""What `avow check` tells of a monitor: which field each variable is read from, and numbers that no message holds."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.formulas.formula import free_variables
from avow.formulas.values import show
from avow.language.contract import Clause
from avow.language.sorts import RealSort
from avow.language.terms import Compare, Literal, Negative, Term, Variable, Widen
from avow.ros.definitions import FLOATS, Scalar

from .options import Setup
from .reading import shown
from .rules import Choice, Fields, Rule
from .wires import of_type


def readings(setup: Setup, span: Span | None) -> Iterator[Diagnostic]:
    """One note that names for each variable of the node's clauses the fields that it is read from."""
    spoken = {v.qualified for clause in setup.node.clauses for v in free_variables(clause.formula)}
    texts = [reading(name, rule) for name, rule in setup.rules.items() if name in spoken]
    told = "; ".join(text for text in texts if text)
    if told:
        yield Diagnostic("MON107", f"{setup.node.name}: {told}", span, Severity.NOTE)


def reading(name: str, rule: Rule) -> str:
    """``in.range ← range : float32 (/scan)``; empty for what no message carries."""
    match rule:
        case Fields():
            parts = []
            for at, path in enumerate(rule.paths):
                wire = rule.wire(at)
                parts.append((shown(path) or "the message") + (f" : {wire}" if wire else ""))
            taken = f"{rule.take} of " if rule.take else ""
            each = f" of each of {shown(rule.each)}" if rule.each else ""
            return f"{name} ← {taken}{', '.join(parts)}{each} ({rule.topic})"
        case Choice():
            return f"{name} ← {shown(rule.tag)} and its arguments ({rule.topic})"
        case _:  # the scenario, or the step before
            return ""


def unholdable(setup: Setup, clause: Clause) -> Iterator[Diagnostic]:
    """A warning for each number that a variable is asked to equal and that its field's type has no room for."""
    stack: list[Term] = [clause.formula]
    while stack:
        term = stack.pop()
        stack.extend(term.children)
        if not isinstance(term, Compare) or term.operator not in ("==", "!="):
            continue
        for one, other in ((term.left, term.right), (term.right, term.left)):
            variable, number = _bare(one), _number(other)
            if isinstance(variable, Variable) and number is not None:
                yield from _unholdable(setup, clause, variable, number)


def _unholdable(setup: Setup, clause: Clause, variable: Variable, number: Fraction) -> Iterator[Diagnostic]:
    rule = setup.rules.get(variable.qualified)
    if not isinstance(rule, Fields) or not isinstance(variable.sort, RealSort) or rule.take is not None:
        return
    wire = rule.wire(0)
    if not isinstance(wire, Scalar) or wire.name not in FLOATS:
        return
    try:
        near = of_type(number, wire)
    except OverflowError:
        near = Fraction(0)
    if near != number:
        message = (
            f"{clause.name} asks whether {variable.qualified} is {show(number)}, which no {wire} is: the nearest one "
            f"is another number, so the answer is always no"
        )
        yield Diagnostic("MON106", message, clause.span, Severity.WARNING, hint="ask for a range")


def _bare(term: Term) -> Term:
    return term.term if isinstance(term, Widen) else term


def _number(term: Term) -> Fraction | None:
    match term:
        case Widen(term=inner):
            return _number(inner)
        case Negative(term=inner):
            number = _number(inner)
            return None if number is None else -number
        case Literal(value=bool() | str()):
            return None
        case Literal(value=value):
            return Fraction(value)
        case _:  # no number that is written down
            return None

"""The numbers of program and contract, side by side: a hint, where a proof cannot give one.

A program with other thresholds than its contract is refuted, as a rule. A guarantee that is weaker than it looks (a
lost pair of parentheses can make it a tautology) is proved of it all the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Severity
from avow.language.bounds import bounds, constant
from avow.language.contract import Clause
from avow.language.printer import show_number
from avow.language.subterms import subterms
from avow.language.terms import Term

from .program import Assign, If, Program, Update, While, statements

_COMMON = frozenset({Fraction(-1), Fraction(0), Fraction(1)})
"""Numbers that stand in programs for reasons of their own."""


def other_numbers(program: Program, clauses: Iterable[Clause]) -> Iterator[Diagnostic]:
    """A warning where the program compares with numbers that are not the contract's, and the contract with numbers that
    are not the program's."""
    formulas = [clause.formula for clause in clauses]
    conditions = [s for s in statements(program.body) if isinstance(s, If | While)]
    assigned = [s.value for s in statements(program.body) if isinstance(s, Assign | Update)]
    in_program = _numbers([*(s.condition for s in conditions), *assigned])
    foreign = _thresholds(s.condition for s in conditions) - _numbers(formulas)
    missing = _thresholds(formulas) - in_program
    if not foreign or not missing:
        return
    first = next(s for s in conditions if _thresholds([s.condition]) & foreign)
    yield Diagnostic(
        "HOARE410",
        f"the program compares with {_shown(foreign)}, and the contract has no such number; the contract compares with "
        f"{_shown(missing)}, and the program does not",
        first.span,
        Severity.WARNING,
        hint="if the program means the contract's thresholds, write these",
    )


def _thresholds(formulas: Iterable[Term]) -> frozenset[Fraction]:
    return frozenset(b.number for formula in formulas for b in bounds(formula)) - _COMMON


def _numbers(terms: Iterable[Term]) -> frozenset[Fraction]:
    return frozenset(n for term in terms for part in subterms(term) if (n := constant(part)) is not None)


def _shown(numbers: Iterable[Fraction]) -> str:
    texts = [show_number(number)[0] for number in sorted(numbers)]
    return ", ".join(texts[:6]) + (", …" if len(texts) > 6 else "")

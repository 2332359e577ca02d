"""The cases of a denied guarantee as queries in VNN-LIB (S. Demarchi et al., Supporting standardization of neural
networks verification with VNN-LIB and CoCoNet, 2023), which the tools of the VNN competition read."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from avow.backend_kit.protocol import Job
from avow.base.plain import decimal
from avow.language.subterms import histories

from .cases import Case, Constraint, NotLinear, denials
from .options import Given

SCALED = "(* "
"""Marabou's own reader accepts no such part of a sum."""


def queries(job: Job, given: Given) -> Iterator[tuple[str, str, str]]:
    """The guarantee's name, a file's name, and its text. None for a guarantee that is not linear or of two steps."""
    assumed = [*(clause.formula for clause in job.node.assumptions), *given.box.terms]
    for obligation in job.obligations:
        if histories(formula := job.clause(obligation).formula):  # of two networks: the format is of one
            continue
        try:
            cases, _ = denials(formula, assumed, given)
        except NotLinear:
            continue
        for number, case in enumerate(cases, 1):
            yield obligation.name, f"{obligation.name}-{number}.vnnlib", _text(given, case)


def _text(given: Given, case: Case) -> str:
    network = given.network
    names = [f"X_{k}" for k in range(network.inputs)] + [f"Y_{k}" for k in range(len(network.outputs))]
    lines = ["; If no values meet all of this, the guarantee has no counterexample of this case.", ""]
    lines += [f"(declare-const {name} Real)" for name in names]
    return "\n".join((*lines, "", *map(_asserted, case), ""))


def _asserted(constraint: Constraint) -> str:
    """Strict inequalities are not in the format: they are taken as not strict, and the query admits more."""
    left = constraint.left
    if not left.terms:
        return "; (a constraint that always holds)"
    unit = max(map(abs, left.terms.values()))
    terms = {f"{kind}_{index}": by / unit for (kind, index), by in left.terms.items()}
    bound = -left.constant / unit
    match sorted(terms.items(), key=lambda term: -term[1]):
        case [(name, by)]:
            return f"(assert ({'<=' if by > 0 else '>='} {name} {_number(bound * by)}))"
        case [(one, by), (other, less)] if by == 1 and less == -1:
            return f"(assert (<= {one} {other}))" if bound == 0 else f"(assert (<= (- {one} {other}) {_number(bound)}))"
    parts = " ".join(name if by == 1 else f"{SCALED}{_number(by)} {name})" for name, by in terms.items())
    return f"(assert (<= (+ {parts}) {_number(bound)}))"


def _number(value: Fraction) -> str:
    text = decimal(value) or repr(float(value))
    return text if "." in text or "e" in text else f"{text}.0"

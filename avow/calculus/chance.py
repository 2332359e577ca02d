"""Requirements with a probability.

The formula is proved for every step at which the guarantees with a probability under `supported_by` keep theirs. So it
fails at a step only if one of these fails at that step, however the rest of the system behaves, and the probabilities
are composed by the kernel's arithmetic (`avow.kernel.rates.together`). Such a guarantee has no formula anywhere else:
no assumption of a node is discharged by it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.plain import decimal, listed
from avow.formulas.formula import conjunction, substitute
from avow.formulas.temporal.responses import responding
from avow.kernel.rates import Likely, Trial, together
from avow.language.contract import Clause
from avow.language.subterms import ports_of
from avow.language.terms import Implies, Role, Term, Variable
from avow.system.plan import Requirement, System
from avow.system.probability import Probability
from avow.system.temporal import written_state


def likely(system: System, requirement: Requirement) -> dict[str, Clause]:
    """The guarantees with a probability that the requirement names one by one: ``node.guarantee`` → the clause."""
    named = requirement.supported_by if requirement.probability else ()
    found = {f"{node.name}.{g.name}": g for node in system.contract.nodes for g in node.guarantees if g.chance}
    return {name: found[name] for name in named if name in found}


def over_system(term: Term, node: str) -> Term:
    """A formula of a node over ``node.port``."""
    return substitute(
        term, {v: Variable(v.role, f"{node}.{v.name}", v.sort) for v in ports_of(term) if v.role is not Role.BOUND}
    )


def kept(system: System, requirement: Requirement) -> dict[str, Term]:
    """What these guarantees do at a step at which they do not fail, over ``node.port``."""
    found = likely(system, requirement)
    return {name: over_system(g.chance.always, name.partition(".")[0]) for name, g in found.items() if g.chance}


def while_kept(system: System, requirement: Requirement, formula: Term) -> Term:
    """What has to be proved of a requirement: its formula; with a probability, at the steps that meet its condition and
    at which no guarantee with a probability fails."""
    if requirement.probability is None:
        return formula
    if responding(formula) is not None:
        message = f"{requirement.id}: a response to come has no probability: it may be due at a later step"
        hint = "ask for a formula about this step and earlier ones"
        raise Rejected(Diagnostic("PLAN142", message, requirement.formula_span, hint=hint))
    given = condition(system, requirement.probability)
    parts = [*kept(system, requirement).values(), *([given] if given is not None else [])]
    return Implies(conjunction(parts), formula) if parts else formula


def condition(system: System, asked: Probability) -> Term | None:
    """The condition of the steps that are meant; None: every step. Raises Rejected."""
    return written_state(asked.given, system.contract, asked.given_span) if asked.given else None


def leaves(found: Mapping[str, Clause]) -> tuple[Likely, ...]:
    """The guarantees as the kernel's arithmetic takes them."""
    of = {True: Trial.RUN, False: Trial.STEP}
    chances = ((name, g.chance) for name, g in found.items() if g.chance)
    return tuple(Likely(name, decimal(c.least) or str(c.least), of[c.per_run]) for name, c in chances)


def least(asked: Probability, found: Sequence[Likely]) -> Fraction:
    """The least probability of the requirement by those of its guarantees. Raises Refused."""
    return together(found, None if asked.per_run else asked.steps, independent=bool(asked.independent))


def made_of(found: Sequence[Likely]) -> str:
    """``tracker.keeps with 0.99 in each step and tracker.seen with 0.9 in each step; tracker.seen costs most``."""
    each = listed([f"{leaf.claim} with {leaf.least} in each {leaf.trial}" for leaf in found], 6)
    return f"{each}; {min(found, key=lambda leaf: Fraction(leaf.least)).claim} costs most"


def text(value: Fraction) -> str:
    """An exact decimal if it is short, otherwise rounded down to six digits."""
    exact = decimal(value)
    return exact if exact is not None and len(exact) <= 12 else f"{int(value * 10**6) / 10**6:g}"

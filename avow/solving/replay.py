"""Do formulas hold for given values? The result of a model or a search counts only if this confirms it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from avow.base.remembered import by_identity
from avow.formulas.values import Value
from avow.language.sorts import FunctionSort, OpaqueSort, SequenceSort, Sort, components
from avow.language.subterms import subterms
from avow.language.terms import Arithmetic, Builtin, Operation, Quantified, Term, Variable
from avow.solving.checking import Engine, check
from avow.solving.limits import allowed
from avow.solving.translation import Translator, Unsupported, same_session
from avow.solving.z3_module import z3


def replay(
    formulas: Iterable[Term],
    values: Mapping[Variable, Value],
    *,
    effort: int = 5_000,
) -> bool | None:
    """Do the formulas hold for these values, whatever partial operations yield outside their domains?

    True only if that is proved; False if some formula is proved false; None if neither can be shown. An unspecified
    sort has the elements that the values name, and up to three more if the formulas hold only then.
    """
    if not allowed(effort):
        return None
    formulas = tuple(formulas)
    unspecified = sorted({sort for f in formulas for sort in opaque_sorts(f)}, key=lambda sort: sort.name)
    with same_session():
        try:
            if not unspecified and _is_seen(Translator(), formulas, values):
                return True
            for more in range(4 if unspecified else 1):
                found = _replay(Translator(), formulas, values, unspecified, more, effort)
                if found or not unspecified:
                    return found
        except (Unsupported, z3.Z3Exception):
            pass
    return None


def _is_seen(translator: Translator, formulas: Sequence[Term], values: Mapping[Variable, Value]) -> bool:
    """Whether total formulas are true for these values by calculation only: no quantifier is left then. Raises
    Unsupported."""
    if any(isinstance(v.sort, FunctionSort) for v in values) or any(map(is_partial, formulas)):
        return False
    put = [(translator.variable(v), translator.value(value, v.sort)) for v, value in values.items()]
    facts = [*translator.background(values), *map(translator.term, formulas)]
    return not facts or z3.is_true(z3.simplify(z3.substitute(z3.And(facts), *put)))


def _replay(
    translator: Translator,
    formulas: Sequence[Term],
    values: Mapping[Variable, Value],
    unspecified: Sequence[OpaqueSort],
    more: int,
    effort: int,
) -> bool | None:
    meanings = {variable: translator.value(value, variable.sort) for variable, value in values.items()}
    for sort in unspecified:
        translator.add_elements(sort, more)
    facts = [*translator.background(values, meanings), *(translator.term(f, meanings) for f in formulas)]
    known = translator.opaque_facts()
    whole = z3.And(facts) if facts else translator.true()
    denied = [*known, z3.Not(whole)]
    attempts: tuple[tuple[Engine, int], ...] = (
        ("smt", min(500, effort)),
        ("qsat", effort),
        ("smt", effort),
    )
    for engine, limit in attempts:
        status = check(translator, denied, effort=limit, engine=engine).status
        if status == "unsat":
            return True
        if status == "sat":
            break
    if check(translator, [*known, whole], effort=effort).status == "unsat":
        return False
    return None


@by_identity(500)
def opaque_sorts(formula: Term) -> frozenset[OpaqueSort]:
    """The unspecified sorts that a formula's terms and bound variables have, or contain."""
    sorts: dict[Sort, None] = {}
    for part in subterms(formula):
        sorts[part.sort] = None
        if isinstance(part, Quantified):
            sorts.update((variable.sort, None) for variable in part.variables)
    return frozenset(sort for sort in components(*sorts) if isinstance(sort, OpaqueSort))


@by_identity(500)
def is_partial(formula: Term) -> bool:
    """Whether sequences, divisions, square roots or angles of vectors occur."""
    return any(
        isinstance(part.sort, SequenceSort)
        or (isinstance(part, Arithmetic) and part.operator == "/")
        or (isinstance(part, Operation) and part.operator in (Builtin.SQRT, Builtin.ATAN2))
        for part in subterms(formula)
    )

"""Confirms by a separate query that a contract is realizable, or that it is not, before this is reported.

A search returns alternatives for the outputs (`Proof`), or values of the inputs. Its conclusions are not trusted. For a
proof the following is checked:

- that the constants in the alternatives exist for all inputs: each axiom only names something that exists (Hilbert's
  epsilon, the least natural number, the integer part, the best of finitely many positions), by a constant that nothing
  before it mentions;
- that the contract's own assumptions exclude that every alternative violates what was shown, by a new solver query. An
  alternative's terms are first substituted into the formulas; a function, or a found value, has its meaning in the
  query. `unsat` then holds for every result that operations may have outside their domains;
- that what was shown implies the contract's own guarantees, if it was transformed: with instances for `exists`, items
  for tuples, lengths and functions for sequences, or one point of a function for all; and that the contract's
  assumptions imply the transformed ones.

A proof without alternatives claims that some output is possible for all allowed inputs: that query is made again. For a
refutation, the assumptions are evaluated at the inputs, and no output may meet the guarantees with these as constants.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from avow.base.tuning.sizes import REWRITTEN_DEPTH
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, free_variables, negation, substitute
from avow.formulas.negation_normal_form import push_negations
from avow.formulas.traversal import depth
from avow.formulas.values import Value
from avow.language import terms as t
from avow.language.sorts import INTEGER, NATURAL, REAL
from avow.sanity.witness_candidates import Candidates, Definition
from avow.sanity.witnesses import Fixed, Witness, applied, meanings_of
from avow.solving.checking import check
from avow.solving.questions import entails, solve
from avow.solving.replay import replay
from avow.solving.translation import Expr, Translator, Unsupported
from avow.solving.z3_module import z3

Formulas = Mapping[str, t.Term]


@dataclass(frozen=True, slots=True)
class Proof:
    """For all `inputs`, one of the `alternatives` (over inputs and constants) meets the guarantees as `shown`; without
    alternatives, some values of the `outputs` do. `axioms` are those of `constants` that it needs."""

    inputs: tuple[t.Variable, ...]
    outputs: tuple[t.Variable, ...]
    shown: Formulas
    alternatives: tuple[Witness, ...]
    axioms: tuple[t.Term, ...]
    constants: Candidates


def confirmed(
    proofs: Sequence[Proof],
    assumptions: Formulas,
    guarantees: Formulas,
    *,
    effort: int,
    seed: int = 0,
) -> bool:
    """Whether the proofs together, each about its own outputs, show that some output meets all guarantees."""
    labels = [label for proof in proofs for label in proof.shown]
    outputs = [output for proof in proofs for output in proof.outputs]
    if set(labels) != set(guarantees) or len(set(labels)) < len(labels) or len(set(outputs)) < len(outputs):
        return False
    try:
        return all(
            # without alternatives no axiom is used
            (not proof.alternatives or _conservative(proof))
            and _met(proof, assumptions, effort, seed)
            and implied(proof.shown, guarantees, effort=effort, seed=seed)
            for proof in proofs
        )
    except (Unsupported, z3.Z3Exception):
        return False


def refutes(
    inputs: Mapping[t.Variable, Value],
    assumptions: Formulas,
    guarantees: Formulas,
    outputs: Iterable[t.Variable],
    *,
    effort: int,
    seed: int = 0,
) -> bool:
    """Whether the inputs are allowed, and no output meets the guarantees there."""
    outputs = tuple(outputs)
    spoken = {v for formula in (*assumptions.values(), *guarantees.values()) for v in free_variables(formula)}
    if not spoken - set(outputs) <= inputs.keys() or not replay(assumptions.values(), inputs, effort=effort):
        return False
    found = solve(guarantees, effort=effort, seed=seed, given=inputs, variables=outputs)
    return found.status == "unsat"


def implied(stronger: Formulas, weaker: Formulas, *, effort: int, seed: int = 0) -> bool:
    """Whether it is proved that each formula implies the one with the same label: the transformed formulas serve for
    the original ones."""
    pairs = [(stronger[label], formula) for label, formula in weaker.items() if label in stronger]
    return all(one == other or _implies(one, other, effort, seed) for one, other in pairs)


def _implies(one: t.Term, other: t.Term, effort: int, seed: int) -> bool:
    def proved(left: t.Term, right: t.Term) -> bool:
        return entails([left], right, effort=effort, seed=seed, whether=True).verdict is Verdict.PROVED

    pushed = push_negations(other) if depth(other) <= REWRITTEN_DEPTH else other
    return proved(pushed, other) if _is_instance(one, pushed) else proved(one, other)


def _is_instance(one: t.Term, other: t.Term) -> bool:
    """Whether a formula is another with values for its `exists` variables: then it implies it."""
    match one, other:
        case (t.And(items=ones), t.And(items=others)) | (t.Or(items=ones), t.Or(items=others)) if len(ones) == len(
            others
        ):
            return all(map(_is_instance, ones, others))
        case (
            t.Quantified(quantifier=t.Quantifier.FORALL, variables=variables, body=body),
            t.Quantified(quantifier=t.Quantifier.FORALL, variables=same, body=weaker),
        ) if variables == same:
            return _is_instance(body, weaker)
        case _, t.Quantified(quantifier=t.Quantifier.EXISTS, variables=variables, body=body) if one != other:
            return any(
                all(_is_one_of(part, variables, body) for part in parts)
                for parts in ((one,), one.items if isinstance(one, t.Or) else ())
                if parts
            )
        case _:  # no instance
            return one == other


def _is_one_of(one: t.Term, variables: tuple[t.Variable, ...], body: t.Term) -> bool:
    values: dict[t.Variable, t.Term] = {}
    _align(one, body, set(variables), values)
    sorted_right = all(v.sort == value.sort for v, value in values.items())
    return sorted_right and len(values) == len(variables) and _is_instance(one, substitute(body, values))


def _align(one: t.Term, body: t.Term, variables: set[t.Variable], values: dict[t.Variable, t.Term]) -> None:
    """The subterms of a term at the positions of another's variables; a guess, to be checked."""
    if isinstance(body, t.Variable) and body in variables:
        values.setdefault(body, one)
    elif type(one) is type(body) and len(one.children) == len(body.children):
        for part, other in zip(one.children, body.children, strict=True):
            _align(part, other, variables, values)


def _met(proof: Proof, assumptions: Formulas, effort: int, seed: int) -> bool:
    """Whether there is no allowed input, with constants that satisfy the axioms, at which every alternative fails."""
    shown = tuple(proof.shown.values())
    if not proof.alternatives:
        bound = {v: t.Variable(t.Role.BOUND, f"some {v.name}", v.sort) for v in proof.outputs}
        never = negation(substitute(conjunction(shown), bound))
        if bound:
            never = t.Quantified(t.Quantifier.FORALL, tuple(bound.values()), never)
        formulas = (*assumptions.values(), never)
        return solve(formulas, effort=effort, seed=seed, variables=proof.inputs).status == "unsat"
    translator = Translator()
    # values that the search found do not determine the elements of an unspecified sort
    facts = [*translator.opaque_facts(), *map(translator.term, proof.axioms)]
    facts += [z3.Not(_meets(translator, shown, alternative)) for alternative in proof.alternatives]
    # an output that an alternative leaves out may have any value
    free = {v for formula in (*assumptions.values(), *shown) for v in free_variables(formula)}
    free -= {v for v in proof.outputs if all(v in alternative for alternative in proof.alternatives)}
    named = dict.fromkeys((*proof.inputs, *proof.constants.constants))
    free.difference_update(named)
    facts += translator.background([*named, *sorted(free, key=lambda v: v.qualified)])
    tracked = [(label, translator.term(formula)) for label, formula in assumptions.items()]
    return check(translator, facts, tracked=tracked, effort=effort, seed=seed).status == "unsat"


def _meets(translator: Translator, shown: Iterable[t.Term], alternative: Witness) -> Expr:
    terms = {
        output: _widened(value, output)
        for output, value in alternative.items()
        if not isinstance(value, Fixed | Definition)
    }
    others = {output: value for output, value in alternative.items() if output not in terms}
    meanings = meanings_of(translator, alternative, {})
    members = translator.background(alternative, meanings)
    left = {v: meanings[v] for v in others}
    return z3.And(
        [*members, *(translator.term(substitute(applied(formula, alternative), terms), left) for formula in shown)]
    )


def _widened(value: object, output: t.Variable) -> t.Term:
    assert isinstance(value, t.Term)
    return t.Widen(value, REAL) if output.sort == REAL and value.sort in (INTEGER, NATURAL) else value


def _conservative(proof: Proof) -> bool:
    """Whether suitable constants exist for all inputs: each axiom introduces new constants."""
    found = proof.constants
    taken = {*proof.inputs, *proof.outputs}
    if any(constant.role is not t.Role.BOUND or constant in taken for constant in found.constants):
        return False
    blocks = iter(found.blocks)
    seen = set[t.Variable]()
    least = list[t.Term]()
    for axiom in found.axioms:
        extreme = found.extremes.get(axiom)
        match axiom:
            case t.Implies() if extreme is not None:
                if axiom != extreme.axiom() or not extreme.exists(seen):
                    return False
                new = {extreme.constant}
            case t.Implies(
                left=t.Quantified(quantifier=t.Quantifier.EXISTS, variables=variables, body=guard), right=chosen
            ):
                block = tuple(v for v in next(blocks, ()) if isinstance(v, t.Variable))
                sorts = [v.sort for v in block]
                new = {*block}
                if (
                    sorts != [v.sort for v in variables]
                    or len(new) < len(block)
                    or new & (seen | free_variables(guard))
                ):
                    return False
                if chosen != substitute(guard, dict(zip(variables, block, strict=True))):
                    return False
                if sorts == [NATURAL]:
                    smallest = t.Implies(guard, t.Compare("<=", block[0], variables[0]))
                    least.append(t.Quantified(t.Quantifier.FORALL, variables, smallest))
            case t.And(
                items=(t.Compare(operator="<=", left=t.Widen(term=t.Variable() as whole) as least_one, right=ground), _)
            ):
                above = t.Arithmetic("+", least_one, t.Literal(Fraction(1), REAL), REAL)
                between = t.And((t.Compare("<=", least_one, ground), t.Compare("<", ground, above)))
                if axiom != between or whole.sort != INTEGER or whole in seen | free_variables(ground):
                    return False
                new = {whole}
            case _:  # an axiom that need not be satisfiable
                return False
        if not new <= set(found.constants) or free_variables(axiom) & set(proof.outputs):
            return False
        seen |= free_variables(axiom)
    return set(found.least) <= set(least) and set(proof.axioms) <= {*found.axioms, *found.least}

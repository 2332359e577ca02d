"""Candidate outputs, read off the guarantees: they turn `realizable` into a query that a solver can answer.

"For all inputs some output" is too hard for solvers directly. But the demand of a guarantee usually shows what to
output: `out.c == move(x, y)`, `out.f(x) <=> p(x)`, `t <= out.n`. Here these become *witnesses*: each output gets a term
over the inputs, or a defining term if it is a function. Quantified variables on the way to the demand become constants,
one for each, that satisfy the condition of the demand if any value does (Hilbert's epsilon: adding such a constant with
its axiom excludes no input). If for all allowed inputs at least one witness meets every guarantee, the node is
realizable; which one may depend on the input (an implicit if-then-else).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import islice, pairwise, product
from typing import assert_never

from avow.base.tuning.bounds import WITNESS_ARGUMENTS, WITNESSES, WITNESSES_PER_OUTPUT
from avow.base.tuning.sizes import REWRITTEN_DEPTH
from avow.formulas.formula import conjunction, disjunction, free_variables, negation, substitute
from avow.formulas.negation_normal_form import push_negations
from avow.formulas.renaming import rename_apart
from avow.formulas.traversal import depth, transform
from avow.formulas.values import Value
from avow.language import sorts as s
from avow.language import terms as t
from avow.sanity.witness_candidates import Candidates, Definition
from avow.solving.translation import Expr, Meaning, Translator
from avow.solving.z3_module import z3


@dataclass(frozen=True, slots=True)
class Fixed:
    """A concrete value."""

    value: Value


Meant = t.Term | Definition | Fixed

Witness = Mapping[t.Variable, Meant]
"""A meaning for every output."""


def witnesses(found: Candidates) -> list[Witness]:
    """Combinations of candidates, the likeliest first; at most `WITNESSES`."""
    choices: list[list[t.Term | Definition]] = []
    for output in found.outputs:
        if isinstance(output.sort, s.FunctionSort):
            choices.append(list(_functions(found, output, output.sort)))
        else:
            terms = dict.fromkeys([*found.values.get(output, ()), *_ground(found, output.sort)])
            choices.append(list(islice(terms, WITNESSES_PER_OUTPUT)))
    result = []
    for combination in islice(product(*choices), WITNESSES * 4):
        witness = _resolve(dict(zip(found.outputs, combination, strict=True)), found)
        if witness is not None and witness not in result:
            result.append(witness)
        if len(result) >= WITNESSES:
            break
    return result


def instantiate(found: Candidates, guarantee: t.Term, *, wide: bool = True) -> t.Term:
    """A stronger guarantee: each `exists` about an output is replaced by its instances at known terms; if not `wide`,
    only at terms that were read together."""
    if depth(guarantee) > REWRITTEN_DEPTH:
        return guarantee
    return _instantiate(found, push_negations(guarantee), wide)


# -- functions -------------------------------------------------------------------------------------------------------


def _functions(found: Candidates, function: t.Variable, sort: s.FunctionSort) -> Iterable[t.Term | Definition]:
    parameters = tuple(t.Variable(t.Role.BOUND, f"p{k}'''", p) for k, p in enumerate(sort.parameters))
    if sort.result == s.BOOL:
        lower, upper = found.lower.get(function, []), found.upper.get(function, [])
        least = Definition(parameters, disjunction(_at(d, parameters) for d in lower))
        most = Definition(parameters, conjunction(negation(_at(d, parameters)) for d in upper))
        yield least
        yield most
        if lower and upper:
            yield Definition(parameters, conjunction((least.body, most.body)))
        for definition in lower[:4]:
            yield Definition(parameters, _at(definition, parameters))
        yield Definition(parameters, t.FALSE)
        yield Definition(parameters, t.TRUE)
        return
    yield from dict.fromkeys(_partly_applied(found, parameters, sort))
    branches = found.branches.get(function, [])
    for default in _ground(found, sort.result)[:8]:
        whole = default  # the first case whose condition holds, otherwise the default
        for d, v in reversed(branches):
            value = substitute(v, dict(zip(d.parameters, parameters, strict=True)))
            whole = t.Conditional(_at(d, parameters), value, whole, sort.result)
        yield Definition(parameters, whole)
    if branches:
        for value in _ground(found, sort.result)[:4]:
            yield Definition(parameters, value)
    yield from _rising(found, parameters, sort)


def _partly_applied(
    found: Candidates, parameters: tuple[t.Variable, ...], sort: s.FunctionSort
) -> Iterable[Definition]:
    """Given functions with their first arguments fixed as somewhere in the formulas: if an assumption states that a way
    exists by naming it (``in.way(in.start, in.goal, k)``), it may serve as the plan."""
    count = len(parameters)
    for term in found.pool.get(sort.result, ()):
        if not isinstance(term, t.Apply) or not isinstance(term.function.sort, s.FunctionSort) or found.mentions(term):
            continue
        if len(term.arguments) >= count and term.function.sort.parameters[-count:] == sort.parameters:
            yield Definition(parameters, replace(term, arguments=(*term.arguments[:-count], *parameters), span=None))


def _rising(found: Candidates, parameters: tuple[t.Variable, ...], sort: s.FunctionSort) -> Iterable[Definition]:
    """Strictly increasing functions of a number."""
    numbers = s.RealSort | s.IntegerSort | s.NaturalSort
    if [isinstance(part, numbers) for part in (*sort.parameters, sort.result)] != [True, True]:
        return
    argument: t.Term = parameters[0]
    if isinstance(sort.result, s.RealSort) and isinstance(argument.sort, s.IntegerSort | s.NaturalSort):
        argument = t.Widen(argument, s.REAL)
    if isinstance(argument.sort, s.RealSort) is not isinstance(sort.result, s.RealSort):
        return
    yield Definition(parameters, argument)
    whole = s.REAL if isinstance(sort.result, s.RealSort) else s.INTEGER
    few = [t.Literal(Fraction(k), s.REAL) if whole == s.REAL else t.Literal(k, s.INTEGER) for k in (1, 2)]
    for start in (*few, *_ground(found, sort.result)[:4]):
        yield Definition(parameters, t.Arithmetic("+", argument, start, whole))


def _at(definition: Definition, parameters: Sequence[t.Variable]) -> t.Term:
    return substitute(definition.body, dict(zip(definition.parameters, parameters, strict=True)))


# -- ground terms ------------------------------------------------------------------------------------------------------


def _ground(found: Candidates, sort: s.Sort, level: int = 0) -> list[t.Term]:
    """Terms of a sort, without outputs: those seen in the guarantees, and the simplest ones."""
    seen = [*found.chosen.get(sort, ()), *(term for term in found.pool.get(sort, ()) if not found.mentions(term))]
    match sort:
        case s.BoolSort():
            return [t.TRUE, t.FALSE]
        case s.EnumSort(members=members):
            return list(dict.fromkeys([*(t.EnumValue(m, sort) for m in members), *seen]))
        case s.NaturalSort():
            return list(dict.fromkeys([*seen, t.Literal(0, sort)]))
        case s.IntegerSort():
            naturals = found.pool.get(s.NaturalSort(), ())
            return list(dict.fromkeys([*seen, *naturals, t.Literal(0, sort)]))
        case s.RealSort():
            return list(dict.fromkeys([*seen, t.Literal(Fraction(0), sort)]))
        case s.StringSort():
            return list(dict.fromkeys([*seen, t.Literal("", sort)]))
        case s.DataSort(constructors=constructors) if level < 2:
            made: list[t.Term] = []
            for constructor in constructors:
                pools = [_ground(found, parameter, level + 1) for parameter in constructor.parameters]
                combinations = sorted(
                    product(*(list(enumerate(pool))[:WITNESS_ARGUMENTS] for pool in pools)), key=_spread
                )
                made.extend(
                    t.Construct(constructor.name, tuple(term for _, term in combination), sort)
                    for combination in combinations[:12]
                )
            return list(dict.fromkeys([*seen, *made]))
        case s.TupleSort(items=items) if level < 2:
            pools = [_ground(found, item, level + 1) for item in items]
            tried = (list(enumerate(pool))[:WITNESS_ARGUMENTS] for pool in pools)
            combinations = sorted(product(*tried), key=_spread)
            return list(
                dict.fromkeys([*seen, *(t.TupleTerm(tuple(value for _, value in c), sort) for c in combinations[:12])])
            )
        case s.SequenceSort():
            return list(dict.fromkeys([*seen, t.SequenceTerm((), sort)]))
        case s.OpaqueSort() if not seen:
            # Nothing in the contract names an element, but the sort is not empty: any constant will do.
            constant = t.Variable(t.Role.BOUND, f"{sort.name} (some)", sort)
            if constant not in found.constants:
                found.constants.append(constant)
            return [constant]
        case (
            s.DataSort() | s.OpaqueSort() | s.FunctionSort() | s.TupleSort() | s.SetSort()
        ):  # nothing unspecified in it
            return seen
        case _:
            assert_never(sort)


def _spread(combination: tuple[tuple[int, t.Term], ...]) -> tuple[int, int]:
    """Arguments that were read together (neighbours in the pool) come first: ``move(x, y)`` before ``move(x, x)``."""
    positions = [position for position, _ in combination]
    steps = sum(abs(later - earlier - 1) for earlier, later in pairwise(positions))
    return steps, sum(positions)


def _resolve(choice: Mapping[t.Variable, t.Term | Definition], found: Candidates) -> Witness | None:
    """Substitute the chosen terms of other outputs into the candidates that mention them; None for a cycle."""
    outputs = set(found.outputs)
    terms = {output: value for output, value in choice.items() if not isinstance(value, Definition)}
    mentioned = {output: free_variables(value) & outputs for output, value in terms.items()}
    done: dict[t.Variable, t.Term] = {}
    while len(done) < len(terms):
        ready = [output for output in terms if output not in done and mentioned[output] <= done.keys()]
        if not ready:
            return None
        for output in ready:
            done[output] = substitute(terms[output], {other: done[other] for other in mentioned[output]})
    terms = done
    witness: dict[t.Variable, Meant] = {}
    for output, value in choice.items():
        if not isinstance(value, Definition):
            witness[output] = terms[output]
            continue
        if free_variables(value.body) & outputs - set(terms):
            return None  # defined by another output function: not tried
        witness[output] = value
    return witness


def _instantiate(found: Candidates, term: t.Term, wide: bool) -> t.Term:
    match term:
        case t.And(items=items):
            return t.And(tuple(_instantiate(found, item, wide) for item in items))
        case t.Or(items=items):
            return t.Or(tuple(_instantiate(found, item, wide) for item in items))
        case t.Quantified(quantifier=t.Quantifier.FORALL, variables=variables, body=body):
            return t.Quantified(t.Quantifier.FORALL, variables, _instantiate(found, body, wide))
        case t.Quantified(quantifier=t.Quantifier.EXISTS, variables=variables, body=body) if found.mentions(body):
            inner = _instantiate(found, body, wide)
            places = _places(found, variables, wide)
            instances = [substitute(inner, dict(zip(variables, place, strict=True))) for place in places]
            return disjunction(instances) if instances else term
        case _:  # no outermost quantifier about outputs
            return term


def _places(found: Candidates, variables: Sequence[t.Variable], wide: bool) -> list[tuple[t.Term, ...]]:
    sorts = [variable.sort for variable in variables]
    if not wide:
        return [block for block in found.blocks if [term.sort for term in block] == sorts]
    pools = [list(enumerate(_ground(found, sort)))[:WITNESS_ARGUMENTS] for sort in sorts]
    combinations = sorted(product(*pools), key=_spread)[:24]
    return [tuple(term for _, term in combination) for combination in combinations]


# -- meanings ----------------------------------------------------------------------------------------------------------


def applied(formula: t.Term, witness: Witness) -> t.Term:
    """The formula with each application of a function that a witness defines replaced by its definition: this exposes
    equations for quantified variables (`avow.formulas.one_point_rule`)."""
    defined = {output: value for output, value in witness.items() if isinstance(value, Definition)}
    if not defined:
        return formula

    def at(part: t.Term) -> t.Term:
        if not isinstance(part, t.Apply) or part.function not in defined:
            return part
        definition = defined[part.function]
        return substitute(definition.body, dict(zip(definition.parameters, part.arguments, strict=True)))

    return transform(rename_apart(formula, {v.name for d in defined.values() for v in free_variables(d.body)}), at)


def meanings_of(
    translator: Translator, witness: Witness, inputs: Mapping[t.Variable, Meaning]
) -> dict[t.Variable, Meaning]:
    """The outputs' meanings under a witness."""
    meanings: dict[t.Variable, Meaning] = {}
    for output, value in witness.items():
        match value:
            case Fixed():
                meanings[output] = translator.value(value.value, output.sort)
            case Definition():
                continue
            case _:  # a term
                term = translator.term(value, inputs)
                meanings[output] = z3.ToReal(term) if output.sort == s.REAL and z3.is_int(term) else term
    for output, value in witness.items():
        if isinstance(value, Definition):
            meanings[output] = _function(translator, value, {**inputs, **meanings})
    return meanings


def _function(
    translator: Translator, definition: Definition, meanings: Mapping[t.Variable, Meaning]
) -> Callable[..., Expr]:
    def function(*arguments: Expr) -> Expr:
        return translator.term(definition.body, meanings, dict(zip(definition.parameters, arguments, strict=True)))

    return function

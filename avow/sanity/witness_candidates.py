"""The demands of the guarantees on the outputs, and their conditions: the raw material of witnesses.

`avow.sanity.witnesses` explains the purpose. Nothing here has to be complete or even correct for a verdict to be sound:
every witness is proved to work before it counts. Only the `axioms` must be true of suitable `constants` for all inputs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import chain

from avow.base.tuning.bounds import NUMBERS_PAIRED
from avow.base.tuning.sizes import REWRITTEN_DEPTH
from avow.formulas.formula import conjunction, free_variables, negation, substitute
from avow.formulas.negation_normal_form import push_negations
from avow.formulas.traversal import depth
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.subterms import subterms
from avow.sanity.extremes import Extreme, bounded, measures

Known = Mapping[t.Variable, t.Term]


@dataclass(frozen=True, slots=True)
class Definition:
    """A function by its defining term over `parameters` (role BOUND)."""

    parameters: tuple[t.Variable, ...]
    body: t.Term


@dataclass(slots=True)
class Candidates:
    """The suggestions of the guarantees. `axioms` are true of suitable `constants` for all inputs."""

    outputs: tuple[t.Variable, ...]
    constants: list[t.Variable] = field(default_factory=list)
    axioms: list[t.Term] = field(default_factory=list)
    least: list[t.Term] = field(default_factory=list)
    """Further axioms, which not every query needs: a chosen natural number is the least one that exists."""
    extremes: dict[t.Term, Extreme] = field(default_factory=dict)
    """The meaning of some of the axioms: the chosen position is the first of the best."""
    values: dict[t.Variable, list[t.Term]] = field(default_factory=dict)
    lower: dict[t.Variable, list[Definition]] = field(default_factory=dict)
    upper: dict[t.Variable, list[Definition]] = field(default_factory=dict)
    branches: dict[t.Variable, list[tuple[Definition, t.Term]]] = field(default_factory=dict)
    chosen: dict[s.Sort, list[t.Term]] = field(default_factory=dict)
    """Constants with an axiom: the likeliest arguments."""
    blocks: list[tuple[t.Term, ...]] = field(default_factory=list)
    """The same constants, in the groups in which they were chosen."""
    pool: dict[s.Sort, list[t.Term]] = field(default_factory=dict)
    floors: dict[t.Term, t.Variable] = field(default_factory=dict)
    bounds: dict[t.Variable, list[t.Term]] = field(default_factory=dict)
    """The terms with which a real output is compared."""
    effort: int = 200_000
    """The remaining effort, in visits times conditions. `<=>` is read four ways, so a chain of them would double the
    effort with every link. Formulas that are not read suggest nothing, which is sound."""

    def mentions(self, term: t.Term) -> bool:
        return any(part in self.outputs for part in subterms(term) if isinstance(part, t.Variable))


def candidates(
    outputs: Sequence[t.Variable], assumptions: Iterable[t.Term], guarantees: Iterable[t.Term]
) -> Candidates:
    """Read the candidates off a contract's formulas."""
    found = Candidates(tuple(outputs))
    for formula in chain(assumptions, guarantees):
        if depth(formula) <= REWRITTEN_DEPTH:
            _visit(found, push_negations(formula), _Under())
    return found


# -- reading the guarantees --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Under:
    """A term is demanded under `conditions` (in its own variables), for all `open` variables. `known` maps the bound
    variables on the way to their constants."""

    known: Known = field(default_factory=dict)
    conditions: tuple[t.Term, ...] = ()
    open: tuple[t.Variable, ...] = ()

    def given(self, *more: t.Term) -> _Under:
        return replace(self, conditions=(*self.conditions, *more))

    @property
    def outer(self) -> dict[t.Variable, t.Term]:
        """The constants, except for those of open variables."""
        return {v: item for v, item in self.known.items() if v not in self.open}


def _visit(found: Candidates, term: t.Term, under: _Under) -> None:
    """Reads a term in negation normal form."""
    known = under.known
    found.effort -= 1 + len(under.conditions)
    if found.effort <= 0:
        return
    if not found.mentions(term):
        if isinstance(term, t.Quantified) and term.quantifier is not t.Quantifier.FORALL:
            inner = _choose(found, term.variables, [term.body], known)
            _visit(found, term.body, replace(under, known=inner))
        elif isinstance(term, t.And):
            for item in term.items:
                _visit(found, item, under)
        _remember(found, term, known)
        return
    match term:
        case t.And(items=items):
            for item in items:
                _visit(found, item, under)
        case t.Or(items=items):
            free = tuple(item for item in items if not found.mentions(item))
            bound = tuple(item for item in items if found.mentions(item))
            for item in free:
                _remember(found, item, known)
            for item in bound:
                if found.effort <= 0:
                    break
                others = tuple(negation(o) for o in bound if o is not item)
                _visit(found, item, under.given(*map(negation, free), *others))
        case t.Implies(left=left, right=right):
            _visit(found, t.Or((negation(left), right)), under)
        case t.Iff(left=left, right=right):
            for one, other in ((left, right), (right, left)):
                _remember(found, other, known)
                _visit(found, one, under.given(other))
                _visit(found, push_negations(t.Not(one)), under.given(negation(other)))
        case t.Conditional(condition=condition, then=then, otherwise=otherwise):
            _remember(found, condition, known)
            _visit(found, then, under.given(condition))
            _visit(found, otherwise, under.given(negation(condition)))
        case t.Quantified(quantifier=t.Quantifier.FORALL, variables=variables, body=body):
            opened = replace(under, open=(*under.open, *variables))
            for item in body.items if isinstance(body, t.And) else (body,):
                guards = [negation(o) for o in _alternatives(item) if not found.mentions(o)]
                for constant in _extremes(found, variables, guards, item, known):
                    _visit(found, item, replace(opened, known={**known, variables[0]: constant}))
                _visit(found, item, replace(opened, known=_choose(found, variables, guards, known)))
        case t.Quantified(variables=variables, body=body):
            for item in body.items if isinstance(body, t.Or) else (body,):
                parts = item.items if isinstance(item, t.And) else (item,)
                guards = [part for part in parts if not found.mentions(part)]
                inner = _choose(found, variables, guards, known)
                # The chosen constants replace the variables in everything that follows, including definitions.
                here = {v: inner[v] for v in variables}
                replaced = substitute(item, here)
                _visit(found, replaced, replace(under, known=inner))
        case _:  # an atom: a suggestion is read off it if it is an equation or a bound
            _atom(found, term, under)


def _alternatives(term: t.Term) -> tuple[t.Term, ...]:
    match term:
        case t.Or(items=items):
            return items
        case t.Implies(left=left, right=right):
            return (push_negations(t.Not(left)), *_alternatives(right))
        case _:  # no alternatives
            return (term,)


def _choose(
    found: Candidates, variables: Sequence[t.Variable], guards: Sequence[t.Term], known: Known
) -> dict[t.Variable, t.Term]:
    """A constant for each variable, such that the guards hold for them if they hold for any values."""
    inner = dict(known)
    fresh = {}
    for variable in variables:
        constant = t.Variable(t.Role.BOUND, f"{variable.name} ({len(found.constants) + 1})", variable.sort)
        found.constants.append(constant)
        fresh[variable] = constant
    guard = substitute(conjunction(guards), dict(known))
    if guard != t.TRUE:
        chosen = substitute(guard, fresh)
        found.axioms.append(t.Implies(t.Quantified(t.Quantifier.EXISTS, tuple(variables), guard), chosen))
        found.blocks.append(tuple(fresh.values()))
        if [variable.sort for variable in variables] == [s.NATURAL]:
            (variable,) = variables
            smallest = t.Implies(guard, t.Compare("<=", fresh[variable], variable))
            found.least.append(t.Quantified(t.Quantifier.FORALL, (variable,), smallest))
        for constant in fresh.values():
            found.chosen.setdefault(constant.sort, []).append(constant)
    else:
        for constant in fresh.values():
            _add(found, constant)
    return {**inner, **fresh}


def _extremes(
    found: Candidates,
    variables: Sequence[t.Variable],
    guards: Sequence[t.Term],
    item: t.Term,
    known: Known,
) -> Iterator[t.Variable]:
    """Constants for the decisive positions, if a demand on all positions compares outputs with numbers."""
    if len(variables) > 1:
        return
    (position,) = variables
    guard = substitute(conjunction(guards), dict(known))
    if not bounded(position, guard):
        return
    for measure, greatest, last in measures(position, item, frozenset(found.outputs)):
        constant = t.Variable(t.Role.BOUND, f"{position.name} ({len(found.constants) + 1})", s.NATURAL)
        found.constants.append(constant)
        choice = Extreme(constant, position, guard, substitute(measure, dict(known)), greatest, last)
        found.axioms.append(choice.axiom())
        found.extremes[found.axioms[-1]] = choice
        found.chosen.setdefault(s.NATURAL, []).append(constant)
        yield constant


def _remember(found: Candidates, term: t.Term, known: Known) -> None:
    """Keep the ground terms in a term that mentions no output: arguments for constructors."""
    for part in subterms(term):
        if part.sort == s.BOOL or isinstance(part, t.Quantified | t.SetTerm | t.SequenceRange) or found.mentions(part):
            continue
        if isinstance(part.sort, s.FunctionSort | s.SetSort):
            continue
        ground = substitute(part, dict(known))
        if all(v.role is not t.Role.BOUND or v in found.constants for v in free_variables(ground)):
            _add(found, ground)


def _add(found: Candidates, term: t.Term) -> None:
    terms = found.pool.setdefault(term.sort, [])
    if term not in terms:
        terms.append(term)


def _atom(found: Candidates, term: t.Term, under: _Under) -> None:
    """Reads an atom or negated atom that mentions an output."""
    positive = not isinstance(term, t.Not)
    atom = term.body if isinstance(term, t.Not) else term
    match atom:
        case t.Apply(function=t.Variable() as function, arguments=arguments) if function in found.outputs:
            definition = _definition(function, arguments, under)
            if definition is not None:
                side = found.lower if positive else found.upper
                side.setdefault(function, []).append(definition)
        case t.Compare(operator=operator, left=left, right=right):
            for one, other in ((left, right), (right, left)):
                if isinstance(one, t.Apply) and one.function in found.outputs and operator == "==":
                    assert isinstance(one.function, t.Variable)
                    _branch(found, one.function, one.arguments, other, under)
                else:
                    _suggest(found, one, other, operator, under.known)
        case t.In(item=t.Variable() as output, collection=t.SetTerm(items=items) | t.SequenceTerm(items=items)):
            for item in items:
                _suggest(found, output, item, "==", under.known)
    for part in subterms(atom):
        if not found.mentions(part):
            _remember(found, part, under.known)


def _suggest(found: Candidates, left: t.Term, right: t.Term, operator: str, known: Known) -> None:
    """From ``left ~ right``, with one output on the left side: possible values of that output."""
    while not isinstance(left, t.Variable):
        match left:
            case t.Widen(term=inner) if isinstance(right, t.Widen):
                left, right = inner, right.term
            case t.Widen(term=inner) if isinstance(right, t.Literal) and Fraction(right.value).denominator == 1:
                left, right = inner, t.Literal(int(Fraction(right.value)), s.INTEGER)
            case t.Widen(term=inner):
                left, right = inner, _floor(found, right, known)
            case t.Negative(term=inner):
                left, right = inner, t.Negative(right, right.sort)
            case t.Arithmetic(operator="+", left=one, right=other, sort=sort):
                if found.mentions(one):
                    left, right = one, t.Arithmetic("-", right, other, sort)
                else:
                    left, right = other, t.Arithmetic("-", right, one, sort)
            case t.Arithmetic(operator="-", left=one, right=other, sort=sort):
                if found.mentions(one):
                    left, right = one, t.Arithmetic("+", right, other, sort)
                else:
                    left, right = other, t.Arithmetic("-", one, right, sort)
            case t.Arithmetic(operator="*", left=one, right=other, sort=s.RealSort() as sort):
                if found.mentions(one):
                    left, right = one, t.Arithmetic("/", right, other, sort)
                else:
                    left, right = other, t.Arithmetic("/", right, one, sort)
            case t.Arithmetic(operator="/", left=one, right=other, sort=sort) if found.mentions(one):
                left, right = one, t.Arithmetic("*", right, other, sort)
            case _:  # not solved for an output: nothing is suggested
                return
    if left not in found.outputs:
        return
    value = substitute(right, dict(known))
    if any(v.role is t.Role.BOUND and v not in found.constants for v in free_variables(value)):
        return
    options = found.values.setdefault(left, [])
    near = [value]
    if operator != "==":
        near += _neighbours(value)
        near += _halfway(found, left, value)
    for option in near:
        if option not in options:
            options.append(option)


def _floor(found: Candidates, value: t.Term, known: Known) -> t.Term:
    """A constant for the greatest integer not greater than a number: it exists, but RCL has no term for it."""
    ground = substitute(value, dict(known))
    if ground not in found.floors:
        constant = t.Variable(t.Role.BOUND, f"floor ({len(found.constants) + 1})", s.INTEGER)
        whole = t.Widen(constant, s.REAL)
        next_one = t.Arithmetic("+", whole, t.Literal(Fraction(1), s.REAL), s.REAL)
        found.constants.append(constant)
        found.axioms.append(t.And((t.Compare("<=", whole, ground), t.Compare("<", ground, next_one))))
        found.floors[ground] = constant
    return found.floors[ground]


def _halfway(found: Candidates, output: t.Variable, bound: t.Term) -> list[t.Term]:
    """The midpoints between the numbers with which an output is compared."""
    if not isinstance(output.sort, s.RealSort):
        return []
    others = found.bounds.setdefault(output, [])
    half = t.Literal(Fraction(1, 2), s.REAL)
    sums = [t.Arithmetic("+", other, bound, s.REAL) for other in others if other != bound]
    others.append(bound)
    del others[NUMBERS_PAIRED:]
    return [t.Arithmetic("*", half, both, s.REAL) for both in sums]


def _neighbours(value: t.Term) -> list[t.Term]:
    if not isinstance(value.sort, s.IntegerSort | s.NaturalSort | s.RealSort):
        return []
    one = t.Literal(Fraction(1), s.REAL) if isinstance(value.sort, s.RealSort) else t.Literal(1, s.INTEGER)
    sort = s.REAL if isinstance(value.sort, s.RealSort) else s.INTEGER
    return [t.Arithmetic("+", value, one, sort), t.Arithmetic("-", value, one, sort)]


# -- functions ---------------------------------------------------------------------------------------------------------


def _definition(function: t.Variable, arguments: Sequence[t.Term], under: _Under) -> Definition | None:
    """The arguments at which a demand is made: those with values of the open variables that satisfy the conditions."""
    sort = function.sort
    assert isinstance(sort, s.FunctionSort)
    if any(function in free_variables(term) for term in (*arguments, *under.conditions)):
        return None
    outer = under.outer
    conditions = [substitute(condition, outer) for condition in under.conditions]
    arguments = [substitute(argument, outer) for argument in arguments]
    names = {v.name for term in (*arguments, *conditions) for v in subterms(term) if isinstance(v, t.Variable)}
    names |= {v.name for v in under.open}
    parameters = []
    for k, parameter_sort in enumerate(sort.parameters):
        name = f"p{k}"
        while name in names:
            name += "'"
        parameters.append(t.Variable(t.Role.BOUND, name, parameter_sort))
    rest = list(under.open)
    equations: list[t.Term] = []
    direct: dict[t.Variable, t.Term] = {}
    for parameter, argument in zip(parameters, arguments, strict=True):
        if isinstance(argument, t.Variable) and argument in rest and _stands_for(parameter, argument):
            rest.remove(argument)
            direct[argument] = parameter
            if argument.sort != parameter.sort:
                equations.append(t.Compare("<=", t.Literal(0, s.INTEGER), parameter))
        else:
            equations.append(t.Compare("==", parameter, argument))
    body = conjunction(substitute(part, direct) for part in (*conditions, *equations))
    used = [variable for variable in rest if variable in free_variables(body)]
    if used:
        body = t.Quantified(t.Quantifier.EXISTS, tuple(used), body)
    return Definition(tuple(parameters), body)


def _stands_for(parameter: t.Variable, argument: t.Variable) -> bool:
    """Whether a function's parameter may replace a variable (an integer for a natural, if it is not negative)."""
    return argument.sort == parameter.sort or (argument.sort, parameter.sort) == (s.NATURAL, s.INTEGER)


def _branch(found: Candidates, function: t.Variable, arguments: Sequence[t.Term], value: t.Term, under: _Under) -> None:
    """Reads a demand ``out.f(arguments) == value`` under the conditions."""
    if value.sort == s.BOOL or function in free_variables(value):
        return
    definition = _definition(function, arguments, under)
    if definition is None:
        return
    direct = under.outer
    for parameter, argument in zip(definition.parameters, arguments, strict=True):
        if isinstance(argument, t.Variable) and argument in under.open and _stands_for(parameter, argument):
            direct.setdefault(argument, parameter)
    result = substitute(value, direct)
    if any(v in under.open for v in free_variables(result)):
        return
    found.branches.setdefault(function, []).append((definition, result))

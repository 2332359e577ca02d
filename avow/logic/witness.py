"""Candidate outputs, read off the guarantees: how `realizable` becomes a question that a solver can answer.

"For all inputs some output" is beyond solvers when asked so. But what a guarantee demands usually says what to
output: `out.c == move(x, y)`, `out.f(x) <=> p(x)`, `t <= out.n`. Here these become *witnesses*: each output gets a term
over the inputs, or a defining term if it is a function. Quantified variables on the way to the demand become constants,
one for each, that satisfy the condition under which the demand is made if anything does (Hilbert's epsilon: adding such
a constant with its axiom excludes no input). If for all inputs allowed at least one witness meets every guarantee, the
node is realizable; which of them does may depend on the input (an if-then-else that nobody has to write down).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice, pairwise, product

from avow.language.sorts import (
    BOOL,
    INTEGER,
    REAL,
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    SequenceSort,
    SetSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.language.terms import (
    FALSE,
    TRUE,
    And,
    Apply,
    Arithmetic,
    Compare,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Literal,
    Negative,
    Not,
    Or,
    Quantified,
    Quantifier,
    Role,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
    Widen,
)
from avow.logic.formula import conjunction, disjunction, free_variables, negation, substitute
from avow.logic.normal import push_negations
from avow.logic.traversal import depth, subterms
from avow.logic.values import Value

MAX_DEPTH = 200
"""Formulas nested deeper are not searched for witnesses (they remain correct to ask about, only harder)."""

MAX_PER_OUTPUT = 24
MAX_WITNESSES = 96
ARGUMENTS = 12
"""How many terms are tried for one argument of a constructor or one quantified variable."""


@dataclass(frozen=True, slots=True)
class Definition:
    """A function by its defining term over `parameters` (role BOUND)."""

    parameters: tuple[Variable, ...]
    body: Term


@dataclass(frozen=True, slots=True)
class Cases(Definition):
    """A function by cases: the first whose condition holds, else the default."""

    cases: tuple[tuple[Term, Term], ...] = ()

    @property
    def default(self) -> Term:
        return self.body


@dataclass(frozen=True, slots=True)
class Fixed:
    """A concrete value."""

    value: Value


Meant = Term | Definition | Fixed

Witness = Mapping[Variable, Meant]
"""A meaning for every output."""


@dataclass(slots=True)
class Candidates:
    """What the guarantees suggest. `axioms` are true of suitable `constants`, whatever the inputs."""

    outputs: tuple[Variable, ...]
    constants: list[Variable] = field(default_factory=list)
    axioms: list[Term] = field(default_factory=list)
    values: dict[Variable, list[Term]] = field(default_factory=dict)
    lower: dict[Variable, list[Definition]] = field(default_factory=dict)
    upper: dict[Variable, list[Definition]] = field(default_factory=dict)
    branches: dict[Variable, list[tuple[Definition, Term]]] = field(default_factory=dict)
    chosen: dict[Sort, list[Term]] = field(default_factory=dict)
    """Constants with an axiom: the likeliest arguments."""
    blocks: list[tuple[Term, ...]] = field(default_factory=list)
    """The same, in the groups in which they were chosen."""
    pool: dict[Sort, list[Term]] = field(default_factory=dict)

    def mentions(self, term: Term) -> bool:
        return any(part in self.outputs for part in subterms(term) if isinstance(part, Variable))


def candidates(outputs: Sequence[Variable], assumptions: Iterable[Term], guarantees: Iterable[Term]) -> Candidates:
    """Read the candidates off a contract's formulas."""
    found = Candidates(tuple(outputs))
    for formula in assumptions:
        if depth(formula) <= MAX_DEPTH:
            _visit(found, push_negations(formula), {}, (), ())
    for formula in guarantees:
        if depth(formula) <= MAX_DEPTH:
            _visit(found, push_negations(formula), {}, (), ())
    return found


def witnesses(found: Candidates) -> list[Witness]:
    """Combinations of candidates, the likeliest first; at most `MAX_WITNESSES`."""
    choices: list[list[Term | Definition]] = []
    for output in found.outputs:
        if isinstance(output.sort, FunctionSort):
            choices.append(list(_functions(found, output, output.sort)))
        else:
            terms = _unique([*found.values.get(output, ()), *_ground(found, output.sort)])
            choices.append(list(islice(terms, MAX_PER_OUTPUT)))
    result = []
    for combination in islice(product(*choices), MAX_WITNESSES * 4):
        witness = _resolve(dict(zip(found.outputs, combination, strict=True)), found)
        if witness is not None and witness not in result:
            result.append(witness)
        if len(result) >= MAX_WITNESSES:
            break
    return result


def instantiate(found: Candidates, guarantee: Term, *, wide: bool = True) -> Term:
    """A stronger guarantee: `exists` that concern an output are replaced by their instances at known terms; if not
    `wide`, only at terms that were read together."""
    if depth(guarantee) > MAX_DEPTH:
        return guarantee
    return _instantiate(found, push_negations(guarantee), wide)


# -- reading the guarantees --------------------------------------------------------------------------------------------


def _visit(
    found: Candidates,
    term: Term,
    known: Mapping[Variable, Term],
    conditions: tuple[Term, ...],
    open_variables: tuple[Variable, ...],
) -> None:
    """`term` (negations pushed in) is demanded under `conditions`, for all `open_variables`.

    `known` maps the bound variables on the way to their constants; `conditions` are in the term's own variables.
    """
    if not found.mentions(term):
        if isinstance(term, Quantified) and term.quantifier is not Quantifier.FORALL:
            inner = _choose(found, term.variables, [term.body], known)
            _visit(found, term.body, inner, conditions, open_variables)
        elif isinstance(term, And):
            for item in term.items:
                _visit(found, item, known, conditions, open_variables)
        _remember(found, term, known)
        return
    match term:
        case And(items=items):
            for item in items:
                _visit(found, item, known, conditions, open_variables)
        case Or(items=items):
            free = tuple(item for item in items if not found.mentions(item))
            bound = tuple(item for item in items if found.mentions(item))
            for item in free:
                _remember(found, item, known)
            for item in bound:
                others = tuple(negation(o) for o in bound if o is not item)
                _visit(found, item, known, (*conditions, *map(negation, free), *others), open_variables)
        case Implies(left=left, right=right):
            _visit(found, Or((negation(left), right)), known, conditions, open_variables)
        case Iff(left=left, right=right):
            for one, other in ((left, right), (right, left)):
                _remember(found, other, known)
                _visit(found, one, known, (*conditions, other), open_variables)
                _visit(found, push_negations(Not(one)), known, (*conditions, negation(other)), open_variables)
        case Quantified(quantifier=Quantifier.FORALL, variables=variables, body=body):
            for item in body.items if isinstance(body, And) else (body,):
                guards = [negation(o) for o in _alternatives(item) if not found.mentions(o)]
                inner = _choose(found, variables, guards, known)
                _visit(found, item, inner, conditions, (*open_variables, *variables))
        case Quantified(variables=variables, body=body):
            for item in body.items if isinstance(body, Or) else (body,):
                parts = item.items if isinstance(item, And) else (item,)
                guards = [part for part in parts if not found.mentions(part)]
                inner = _choose(found, variables, guards, known)
                # The chosen constants stand for the variables in all that follows, definitions too.
                here = {v: inner[v] for v in variables}
                replaced = substitute(item, here)
                _visit(found, replaced, inner, conditions, open_variables)
        case _:
            _atom(found, term, known, conditions, open_variables)


def _alternatives(term: Term) -> tuple[Term, ...]:
    match term:
        case Or(items=items):
            return items
        case Implies(left=left, right=right):
            return (push_negations(Not(left)), *_alternatives(right))
        case _:
            return (term,)


def _choose(
    found: Candidates, variables: Sequence[Variable], guards: Sequence[Term], known: Mapping[Variable, Term]
) -> dict[Variable, Term]:
    """A constant for each variable, such that the guards hold of them if they hold of anything."""
    inner = dict(known)
    fresh = {}
    for variable in variables:
        constant = Variable(Role.BOUND, f"{variable.name} ({len(found.constants) + 1})", variable.sort)
        found.constants.append(constant)
        fresh[variable] = constant
    guard = substitute(conjunction(guards), dict(known))
    if guard != TRUE:
        chosen = substitute(guard, fresh)
        found.axioms.append(Implies(Quantified(Quantifier.EXISTS, tuple(variables), guard), chosen))
        found.blocks.append(tuple(fresh.values()))
        for constant in fresh.values():
            found.chosen.setdefault(constant.sort, []).append(constant)
    else:
        for constant in fresh.values():
            _add(found, constant)
    return {**inner, **fresh}


def _remember(found: Candidates, term: Term, known: Mapping[Variable, Term]) -> None:
    """Keep the ground terms in a term that knows no output: arguments for constructors."""
    for part in subterms(term):
        if part.sort == BOOL or isinstance(part, Quantified | SetTerm) or found.mentions(part):
            continue
        if isinstance(part.sort, FunctionSort | SetSort):
            continue
        ground = substitute(part, dict(known))
        if all(v.role is not Role.BOUND or v in found.constants for v in free_variables(ground)):
            _add(found, ground)


def _add(found: Candidates, term: Term) -> None:
    terms = found.pool.setdefault(term.sort, [])
    if term not in terms:
        terms.append(term)


def _atom(
    found: Candidates,
    term: Term,
    known: Mapping[Variable, Term],
    conditions: tuple[Term, ...],
    open_variables: tuple[Variable, ...],
) -> None:
    """An atom or negated atom that knows an output."""
    positive = not isinstance(term, Not)
    atom = term.body if isinstance(term, Not) else term
    match atom:
        case Apply(function=Variable() as function, arguments=arguments) if function in found.outputs:
            definition = _definition(found, function, arguments, conditions, open_variables, known)
            if definition is not None:
                side = found.lower if positive else found.upper
                side.setdefault(function, []).append(definition)
        case Compare(operator=operator, left=left, right=right):
            for one, other in ((left, right), (right, left)):
                if isinstance(one, Apply) and one.function in found.outputs and operator == "==":
                    assert isinstance(one.function, Variable)
                    _branch(found, one.function, one.arguments, other, conditions, open_variables, known)
                else:
                    _suggest(found, one, other, operator, known)
        case In(item=Variable() as output, collection=SetTerm(items=items) | SequenceTerm(items=items)):
            for item in items:
                _suggest(found, output, item, "==", known)
    for part in subterms(atom):
        if not found.mentions(part):
            _remember(found, part, known)


def _suggest(found: Candidates, left: Term, right: Term, operator: str, known: Mapping[Variable, Term]) -> None:
    """From ``left ~ right``, where the left side holds one output: what that output could be."""
    while not isinstance(left, Variable):
        match left:
            case Widen(term=inner) if isinstance(right, Widen):
                left, right = inner, right.term
            case Widen(term=inner) if isinstance(right, Literal) and Fraction(right.value).denominator == 1:
                left, right = inner, Literal(int(Fraction(right.value)), INTEGER)
            case Negative(term=inner):
                left, right = inner, Negative(right, right.sort)
            case Arithmetic(operator="+", left=one, right=other, sort=sort):
                if found.mentions(one):
                    left, right = one, Arithmetic("-", right, other, sort)
                else:
                    left, right = other, Arithmetic("-", right, one, sort)
            case Arithmetic(operator="-", left=one, right=other, sort=sort):
                if found.mentions(one):
                    left, right = one, Arithmetic("+", right, other, sort)
                else:
                    left, right = other, Arithmetic("-", one, right, sort)
            case Arithmetic(operator="*", left=one, right=other, sort=RealSort() as sort):
                if found.mentions(one):
                    left, right = one, Arithmetic("/", right, other, sort)
                else:
                    left, right = other, Arithmetic("/", right, one, sort)
            case Arithmetic(operator="/", left=one, right=other, sort=sort) if found.mentions(one):
                left, right = one, Arithmetic("*", right, other, sort)
            case _:
                return
    if left not in found.outputs:
        return
    value = substitute(right, dict(known))
    if any(v.role is Role.BOUND and v not in found.constants for v in free_variables(value)):
        return
    options = found.values.setdefault(left, [])
    near = [value]
    if operator not in {"==", "!="} or operator == "!=":
        near += _neighbours(value)
    for option in near:
        if option not in options:
            options.append(option)


def _neighbours(value: Term) -> list[Term]:
    if not isinstance(value.sort, IntegerSort | NaturalSort | RealSort):
        return []
    one = Literal(Fraction(1), REAL) if isinstance(value.sort, RealSort) else Literal(1, INTEGER)
    sort = REAL if isinstance(value.sort, RealSort) else INTEGER
    return [Arithmetic("+", value, one, sort), Arithmetic("-", value, one, sort)]


# -- functions ---------------------------------------------------------------------------------------------------------


def _definition(
    found: Candidates,
    function: Variable,
    arguments: Sequence[Term],
    conditions: Sequence[Term],
    open_variables: Sequence[Variable],
    known: Mapping[Variable, Term],
) -> Definition | None:
    """The arguments at which a demand is made: where the open variables take values that meet the conditions."""
    sort = function.sort
    assert isinstance(sort, FunctionSort)
    if any(function in free_variables(term) for term in (*arguments, *conditions)):
        return None
    outer = {v: t for v, t in known.items() if v not in open_variables}
    conditions = [substitute(condition, outer) for condition in conditions]
    arguments = [substitute(argument, outer) for argument in arguments]
    names = {v.name for term in (*arguments, *conditions) for v in subterms(term) if isinstance(v, Variable)}
    names |= {v.name for v in open_variables}
    parameters = []
    for k, parameter_sort in enumerate(sort.parameters):
        name = f"p{k}"
        while name in names:
            name += "'"
        parameters.append(Variable(Role.BOUND, name, parameter_sort))
    rest = list(open_variables)
    equations: list[Term] = []
    direct: dict[Variable, Term] = {}
    for parameter, argument in zip(parameters, arguments, strict=True):
        if isinstance(argument, Variable) and argument in rest and argument.sort == parameter.sort:
            rest.remove(argument)
            direct[argument] = parameter
        else:
            equations.append(Compare("==", parameter, argument))
    body = conjunction(substitute(part, direct) for part in (*conditions, *equations))
    used = [variable for variable in rest if variable in free_variables(body)]
    if used:
        body = Quantified(Quantifier.EXISTS, tuple(used), body)
    return Definition(tuple(parameters), body)


def _branch(
    found: Candidates,
    function: Variable,
    arguments: Sequence[Term],
    value: Term,
    conditions: Sequence[Term],
    open_variables: Sequence[Variable],
    known: Mapping[Variable, Term],
) -> None:
    """``out.f(arguments) == value`` is demanded under the conditions."""
    if value.sort == BOOL or function in free_variables(value):
        return
    definition = _definition(found, function, arguments, conditions, open_variables, known)
    if definition is None:
        return
    direct: dict[Variable, Term] = {v: t for v, t in known.items() if v not in open_variables}
    for parameter, argument in zip(definition.parameters, arguments, strict=True):
        if isinstance(argument, Variable) and argument in open_variables and argument.sort == parameter.sort:
            direct.setdefault(argument, parameter)
    result = substitute(value, direct)
    if any(v in open_variables for v in free_variables(result)):
        return
    found.branches.setdefault(function, []).append((definition, result))


def _functions(found: Candidates, function: Variable, sort: FunctionSort) -> Iterable[Term | Definition]:
    if sort.result == BOOL:
        lower, upper = found.lower.get(function, []), found.upper.get(function, [])
        parameters = tuple(Variable(Role.BOUND, f"p{k}'''", p) for k, p in enumerate(sort.parameters))
        least = Definition(parameters, disjunction(_at(d, parameters) for d in lower))
        most = Definition(parameters, conjunction(negation(_at(d, parameters)) for d in upper))
        yield least
        yield most
        if lower and upper:
            yield Definition(parameters, conjunction((least.body, most.body)))
        for definition in lower[:4]:
            yield Definition(parameters, _at(definition, parameters))
        yield Definition(parameters, FALSE)
        yield Definition(parameters, TRUE)
        return
    parameters = tuple(Variable(Role.BOUND, f"p{k}'''", p) for k, p in enumerate(sort.parameters))
    branches = found.branches.get(function, [])
    for default in _ground(found, sort.result)[:8]:
        cases = tuple(
            (_at(d, parameters), substitute(v, dict(zip(d.parameters, parameters, strict=True)))) for d, v in branches
        )
        yield Cases(parameters, default, cases)


def _at(definition: Definition, parameters: Sequence[Variable]) -> Term:
    return substitute(definition.body, dict(zip(definition.parameters, parameters, strict=True)))


# -- ground terms ------------------------------------------------------------------------------------------------------


def _ground(found: Candidates, sort: Sort, level: int = 0) -> list[Term]:
    """Terms of a sort, without outputs: those seen in the guarantees, and the simplest ones."""
    seen = [*found.chosen.get(sort, ()), *(term for term in found.pool.get(sort, ()) if not found.mentions(term))]
    match sort:
        case BoolSort():
            return [TRUE, FALSE]
        case EnumSort(members=members):
            return list(_unique([*(EnumValue(m, sort) for m in members), *seen]))
        case NaturalSort():
            return list(_unique([*seen, Literal(0, sort)]))
        case IntegerSort():
            naturals = found.pool.get(NaturalSort(), ())
            return list(_unique([*seen, *naturals, Literal(0, sort)]))
        case RealSort():
            return list(_unique([*seen, Literal(Fraction(0), sort)]))
        case StringSort():
            return list(_unique([*seen, Literal("", sort)]))
        case DataSort(constructors=constructors) if level < 2:
            made: list[Term] = []
            for constructor in constructors:
                pools = [_ground(found, parameter, level + 1) for parameter in constructor.parameters]
                combinations = sorted(product(*(list(enumerate(pool))[:ARGUMENTS] for pool in pools)), key=_spread)
                made.extend(
                    Construct(constructor.name, tuple(term for _, term in combination), sort)
                    for combination in combinations[:12]
                )
            return list(_unique([*seen, *made]))
        case TupleSort(items=items) if level < 2:
            pools = [_ground(found, item, level + 1) for item in items]
            combinations = sorted(product(*(list(enumerate(pool))[:ARGUMENTS] for pool in pools)), key=_spread)
            return list(_unique([*seen, *(TupleTerm(tuple(t for _, t in c), sort) for c in combinations[:12])]))
        case SequenceSort():
            return list(_unique([*seen, SequenceTerm((), sort)]))
        case OpaqueSort() if not seen:
            # Nothing in the contract names an element, but the sort is not empty: any constant is one.
            constant = Variable(Role.BOUND, f"{sort.name} (some)", sort)
            if constant not in found.constants:
                found.constants.append(constant)
            return [constant]
        case _:
            return seen


def _spread(combination: tuple[tuple[int, Term], ...]) -> tuple[int, int]:
    """Arguments that were read together (neighbours in the pool) come first: ``move(x, y)`` before ``move(x, x)``."""
    positions = [position for position, _ in combination]
    steps = sum(abs(later - earlier - 1) for earlier, later in pairwise(positions))
    return steps, sum(positions)


def _unique(terms: Iterable[Term]) -> Iterable[Term]:
    seen: list[Term] = []
    for term in terms:
        if term not in seen:
            seen.append(term)
            yield term


def _resolve(choice: Mapping[Variable, Term | Definition], found: Candidates) -> Witness | None:
    """Put the chosen terms of other outputs where a candidate mentions them; None for a circle."""
    outputs = set(found.outputs)
    terms = {output: value for output, value in choice.items() if not isinstance(value, Definition)}
    for _ in terms:
        terms = {output: substitute(value, _chosen(terms, value, outputs)) for output, value in terms.items()}
    if any(free_variables(value) & outputs for value in terms.values()):
        return None
    witness: dict[Variable, Meant] = {}
    for output, value in choice.items():
        if not isinstance(value, Definition):
            witness[output] = terms[output]
            continue
        parts = (
            [value.body, *(part for case in value.cases for part in case)] if isinstance(value, Cases) else [value.body]
        )
        if any(free_variables(part) & outputs - set(terms) for part in parts):
            return None  # a function defined by another function that is an output: not tried
        witness[output] = value
    return witness


def _chosen(terms: Mapping[Variable, Term], value: Term, outputs: set[Variable]) -> dict[Variable, Term]:
    return {other: terms[other] for other in free_variables(value) & outputs if other in terms}


def _instantiate(found: Candidates, term: Term, wide: bool) -> Term:
    match term:
        case And(items=items):
            return And(tuple(_instantiate(found, item, wide) for item in items))
        case Or(items=items):
            return Or(tuple(_instantiate(found, item, wide) for item in items))
        case Quantified(quantifier=Quantifier.FORALL, variables=variables, body=body):
            return Quantified(Quantifier.FORALL, variables, _instantiate(found, body, wide))
        case Quantified(quantifier=Quantifier.EXISTS, variables=variables, body=body) if found.mentions(body):
            inner = _instantiate(found, body, wide)
            places = _places(found, variables, wide)
            instances = [substitute(inner, dict(zip(variables, place, strict=True))) for place in places]
            return disjunction(instances) if instances else term
        case _:
            return term


def _places(found: Candidates, variables: Sequence[Variable], wide: bool) -> list[tuple[Term, ...]]:
    sorts = [variable.sort for variable in variables]
    if not wide:
        return [block for block in found.blocks if [term.sort for term in block] == sorts]
    pools = [list(enumerate(_ground(found, sort)))[:ARGUMENTS] for sort in sorts]
    combinations = sorted(product(*pools), key=_spread)[:24]
    return [tuple(term for _, term in combination) for combination in combinations]

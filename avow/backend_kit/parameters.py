"""A job as its method takes the parameters of the contract: see `Opens`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

from avow.backend_kit.protocol import Backend, Job, Opens
from avow.base.diagnostics import Diagnostic
from avow.base.tuning.sizes import PARAMETER_VALUES, PARAMETERS_TRIED
from avow.base.verdict import Outcome, Verdict
from avow.formulas.formula import equation
from avow.language.bounds import constant
from avow.language.contract import Clause, ClauseKind, Node, Port
from avow.language.printer import show_term
from avow.language.sorts import INTEGER, BoolSort, EnumSort, RealSort, StringSort
from avow.language.subterms import ports_of, subterms
from avow.language.terms import Compare, EnumValue, Literal, Term, Widen
from avow.system.parameters import decimal, of_parameters, plain, with_values

Values = tuple[tuple[str, str], ...]
"""Parameters and their values, as counterexamples have them."""
ALONE: Values = ()


def place(number: int) -> str:
    """The folder of the files that are generated for some values."""
    return f"values{number}"


def jobs(tool: Backend, job: Job) -> Mapping[Values, Job]:
    """The jobs to be done in place of one, by the values of the parameters that it leaves open; empty: the parameters
    need values (`missing`)."""
    node = job.node
    match tool.opens(job):
        case Opens.INPUT if node.fixed:
            return {ALONE: _of(job, _as_inputs(node))}
        case Opens.VALUES if node.parameters:
            return {_shown(fixed): _valued(job, fixed) for fixed in samples(node)}
        case Opens.REFUSED if _needed(job):
            return {}
        case _:  # nothing to do
            return {ALONE: job}


def _needed(job: Job) -> tuple[str, ...]:
    """The open parameters that the job's clauses mention."""
    clauses = (*job.node.assumptions, *map(job.clause, job.obligations))
    spoken = {variable for clause in clauses for variable in ports_of(clause.formula)}
    return tuple(port.name for port in job.node.parameters if port.variable in spoken)


def missing(tool: Backend, job: Job) -> str:
    """Why there is no job."""
    names = " and ".join(_needed(job) or (port.name for port in job.node.parameters))
    return f"{tool.name} needs a value of {names}: write it under nodes.{job.node.name}.parameters"


def _as_inputs(node: Node) -> Node:
    """The node whose parameters with values are inputs, and an assumption for each says the value."""
    ports = tuple(replace(port, value=None) for port in node.fixed)
    said = tuple(equals(port) for port in node.fixed)
    return replace(node, inputs=(*node.inputs, *ports), assumptions=(*node.assumptions, *said), fixed=())


def equals(port: Port) -> Clause:
    """The assumption that a parameter has its value of the plan."""
    assert port.value is not None
    formula = equation(port.variable, port.value)
    name, sentence = f"{port.name}_value", f"The parameter {port.name} has its value of the plan"
    return Clause(ClauseKind.ASSUMPTION, name, 0, formula, sentence, show_term(formula, "rcl"), port.span)


def _of(job: Job, node: Node) -> Job:
    nodes = tuple(node if each.name == node.name else each for each in job.contract.nodes)
    return replace(job, node=node, system=replace(job.system, contract=replace(job.contract, nodes=nodes)))


def _shown(fixed: tuple[Port, ...]) -> Values:
    return tuple((p.variable.qualified, show_term(decimal(p.value), "rcl")) for p in fixed if p.value is not None)


def _valued(job: Job, fixed: tuple[Port, ...]) -> Job:
    """The job with values for its open parameters, in the contract and in the program."""
    made = _of(job, with_values(job.node, fixed, []))
    given = {port.name: plain(port.value) for port in fixed}
    plan = job.system.plan
    nodes = tuple(
        replace(e, source=replace(e.source, values={**e.source.values, **given}))
        if e.node == job.node.name and e.source is not None
        else e
        for e in plan.nodes
    )
    return replace(made, system=replace(made.system, plan=replace(plan, nodes=nodes)))


def samples(node: Node) -> tuple[tuple[Port, ...], ...]:
    """Values for the open parameters that the assumptions about them allow: the least, the greatest, and some between.
    Empty if none is found."""
    ports = node.parameters
    tried = itertools.product(*(list(_candidates(node, port)) for port in ports))
    allowed = []
    for values in itertools.islice(tried, PARAMETERS_TRIED):
        fixed = tuple(replace(port, value=value) for port, value in zip(ports, values, strict=True))
        excluded: list[Diagnostic] = []
        left = with_values(replace(node, assumptions=of_parameters(node)), fixed, excluded)
        if not left.assumptions and not excluded:
            allowed.append(fixed)
    if len(allowed) <= PARAMETER_VALUES:
        return tuple(allowed)
    last = len(allowed) - 1
    return tuple(allowed[k * last // (PARAMETER_VALUES - 1)] for k in range(PARAMETER_VALUES))


def _candidates(node: Node, port: Port) -> Iterator[Term]:
    """Values that may be allowed, in order."""
    sort = port.sort
    match sort:
        case BoolSort():
            yield from (Literal(value, sort) for value in (False, True))
        case EnumSort(members=members):
            yield from (EnumValue(name, sort) for name in members)
        case StringSort():
            texts = {term.value for c in node.clauses for term in subterms(c.formula) if isinstance(term, Literal)}
            yield from (Literal(text, sort) for text in sorted(t for t in texts if isinstance(t, str)) or [""])
        case _:  # a number
            ends = sorted(set(_ends(node, port))) or [Fraction(0)]
            between = [(a + b) / 2 for a, b in itertools.pairwise(ends)]
            numbers = sorted({ends[0] - 1, *ends, *between, ends[-1] + 1})
            if not isinstance(sort, RealSort):
                whole = sorted({int(n) for n in numbers if n >= 0 or sort == INTEGER})
                yield from (Literal(n, sort) for n in whole)
            else:
                yield from (Literal(Fraction(float(n)), sort) for n in numbers)


def _ends(node: Node, port: Port) -> Iterator[Fraction]:
    """The constants with which clauses compare a parameter."""
    about = (port.variable, Widen(port.variable, RealSort()))
    for clause in node.clauses:
        for term in subterms(clause.formula):
            if isinstance(term, Compare) and (term.left in about or term.right in about):
                number = constant(term.right if term.left in about else term.left)
                if number is not None:
                    yield number


def together(found: Mapping[Values, Outcome]) -> Outcome:
    """The outcome of an obligation, from its outcomes with several values: the worst, at most `tested`."""
    worst = next((k for k, o in found.items() if o.verdict is Verdict.REFUTED), None)
    worst = worst or next((k for k, o in found.items() if not o.verdict.supports), None)
    if worst is not None:
        one = found[worst]
        shown = one.counterexample
        if shown is not None:
            shown = replace(shown, values=(*worst, *shown.values))
        return replace(one, summary=f"with {_told(worst)}: {one.summary}", counterexample=shown)
    first = next(iter(found.values()))
    told = list(map(_told, found))
    bound = {**first.bound, "parameters": told}
    summary = f"with each of {len(found)} values ({'; '.join(told)}): {first.summary}"
    vacuous = all(o.vacuous for o in found.values())
    rests = tuple(dict.fromkeys(h for o in found.values() for h in o.rests_on))
    return replace(first, verdict=Verdict.TESTED, summary=summary, bound=bound, vacuous=vacuous, rests_on=rests)


def _told(values: Values) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values)

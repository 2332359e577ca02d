"""A guarantee as properties: one instance for each value of its index variables, ``[] (H -> <> C)`` each.

H and C are the guarantee's antecedent and consequent, mapped. Where the consequent speaks of inputs too, these belong
to the moment of the trigger and move to H. Alternatives in H give a property each, each with a vacuity of its own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

from avow.backend import Job
from avow.backends.ajpf import psl
from avow.backends.ajpf.checker import Property
from avow.backends.ajpf.mapping import Mapped, Mapper, NotCovered, Unit, clauses, substituted, to_formula
from avow.backends.ajpf.options import Extra, Setup, is_index
from avow.backends.ajpf.psl import Always, Eventually, Formula, Implies
from avow.backends.ajpf.psl_parser import instantiate
from avow.backends.ajpf.scenario import Decider, range_of
from avow.backends.ajpf.shape import MAX_DEPTH, TooComplex, free, shape
from avow.diagnostics import Diagnostic, Severity, Span
from avow.language.contract import Clause
from avow.language.terms import FALSE, TRUE, And, Quantified, Quantifier, Term, Variable
from avow.language.terms import Implies as RclImplies
from avow.logic.traversal import depth

MAX_ALTERNATIVES = 8
MAX_PROPERTIES = 5_000


@dataclass(frozen=True, slots=True)
class Claim:
    """What one guarantee became: its properties, or why it is not covered."""

    guarantee: str
    properties: tuple[Property, ...] = ()
    not_covered: str | None = None
    span: Span | None = None
    indices: tuple[str, ...] = ()
    """Index variables with their ranges, in words."""
    settled: tuple[str, ...] = ()
    """Instances that the scenario alone settles, in words."""


@dataclass(frozen=True, slots=True)
class Instantiation:
    claims: tuple[Claim, ...]
    extras: tuple[tuple[Extra, tuple[Property, ...]], ...]
    unused: tuple[str, ...]
    """Rows of the table that covered nothing."""
    words: Mapping[Formula, str] = field(default_factory=dict)
    """What each formula that came of a row stands for in the contract."""

    @property
    def properties(self) -> tuple[Property, ...]:
        found = [p for claim in self.claims for p in claim.properties]
        return tuple(found + [p for _, properties in self.extras for p in properties])


def instances(job: Job, setup: Setup) -> Instantiation:
    """All properties of a method, with keys that are unique."""
    scenario = job.system.plan.scenario
    mapper = Mapper(setup.rows, Decider(job), lambda v: range_of(v, setup.instances, scenario))
    keys: set[str] = set()
    claims = tuple(_claim(job.clause(o), mapper, setup, keys) for o in job.obligations)
    extras = tuple((extra, _extra(extra, keys)) for extra in setup.extras)
    unused = tuple(row.text for row in setup.rows if row.text not in mapper.used)
    return Instantiation(claims, extras, unused, dict(mapper.words))


def diagnose(setup: Setup, made: Instantiation) -> Iterator[Diagnostic]:
    """What the table does not cover, and rows without use: warnings, since the other guarantees can be checked."""
    for claim in made.claims:
        if claim.not_covered is not None:
            yield Diagnostic(
                "AJPF130",
                f"guarantee '{claim.guarantee}' is not covered: {claim.not_covered}",
                claim.span,
                Severity.WARNING,
                hint="add a row to the method's predicates, or leave the guarantee to other methods (guarantees: …)",
            )
    if all(claim.not_covered is None for claim in made.claims):
        for row in setup.rows:
            if row.text in made.unused:
                yield Diagnostic("AJPF131", f"the row “{row.text}” covers nothing", row.span, Severity.WARNING)


def _claim(clause: Clause, mapper: Mapper, setup: Setup, keys: set[str]) -> Claim:
    try:
        return _instantiate(clause, mapper, keys)
    except NotCovered as error:
        return Claim(clause.name, not_covered=error.reason, span=error.span or clause.span)
    except (TooComplex, RecursionError):
        return Claim(clause.name, not_covered="the formula is too complex to map", span=clause.span)


def _instantiate(clause: Clause, mapper: Mapper, keys: set[str]) -> Claim:
    if depth(clause.formula) > MAX_DEPTH:
        raise TooComplex
    found: dict[Formula, Property] = {}
    about: dict[Formula, list[str]] = {}
    ranges: dict[str, str] = {}
    settled: list[str] = []
    mapper.expanded.clear()
    for variables, antecedent, consequent in _implications(clause.formula):
        used = [v for v in variables if is_index(v.sort) and v.name in free(antecedent) | free(consequent)]
        others = tuple(v for v in variables if not is_index(v.sort))
        domains = []
        for variable in used:
            values = mapper.range_of(variable)
            if values is None:
                raise NotCovered(f"{variable.name} has no finite range (options: instances)", clause.span)
            ranges[variable.name] = _span(values)
            domains.append(values)
        for choice in product(*domains):
            values_now = dict(zip(used, choice, strict=True))
            said = ", ".join(f"{v.name} = {n}" for v, n in values_now.items())
            made = list(
                _properties(substituted(antecedent, values_now), substituted(consequent, values_now), others, mapper)
            )
            for trigger, goal in made:
                if trigger == psl.FALSE:
                    settled.append(f"{said or 'the guarantee'}: the scenario rules the trigger out")
                    continue
                formula = (
                    Always(Implies(trigger, Eventually(goal))) if goal != psl.FALSE else Always(psl.negation(trigger))
                )
                if formula not in found:
                    found[formula] = Property("", formula, trigger, goal if goal != psl.FALSE else None)
                    about[formula] = []
                if said and said not in about[formula]:
                    about[formula].append(said)
                if len(found) > MAX_PROPERTIES:
                    raise NotCovered(f"more than {MAX_PROPERTIES} instances", clause.span)
            if not made:
                settled.append(f"{said or 'the guarantee'}: the scenario alone makes it true")
    properties = tuple(
        replace(p, key=_key(clause.name, about[f], keys), about=_merged(about[f])) for f, p in found.items()
    )
    for name, numbers in mapper.expanded.items():
        ranges.setdefault(name, _span(numbers))
    indices = tuple(f"{name} in {values}" for name, values in ranges.items())
    return Claim(clause.name, properties, None, clause.span, indices, tuple(settled))


def _implications(term: Term) -> Iterator[tuple[tuple[Variable, ...], Term, Term]]:
    """The formula as implications under universal quantifiers: (variables, antecedent, consequent)."""
    match term:
        case Quantified(quantifier=Quantifier.FORALL, variables=variables, body=body):
            for inner, left, right in _implications(body):
                yield (*variables, *inner), left, right
        case And(items=items):
            for item in items:
                yield from _implications(item)
        case RclImplies(left=left, right=right):
            for variables, more, final in _implications(right):
                yield variables, left if more == TRUE else And((left, more)), final
        case _:
            yield (), TRUE, term


def _properties(
    antecedent: Term, consequent: Term, others: tuple[Variable, ...], mapper: Mapper
) -> Iterator[tuple[Formula, Formula]]:
    """Trigger and goal of each property; nothing where the consequent is true anyway."""
    left, right = shape(antecedent), shape(consequent)
    if left == FALSE:
        yield psl.FALSE, psl.TRUE
        return
    shared = sorted({v.name for v in others} & free(right))
    if shared:
        raise NotCovered(f"{shared[0]} joins what triggers the guarantee and what it demands", consequent.span)
    bound = tuple(v for v in others if v.name in free(left))
    trigger = mapper.map(shape(Quantified(Quantifier.EXISTS, bound, left)) if bound else left)
    for inputs, outputs in _parted(mapper.map(right)):
        condition = psl.conjunction([to_formula(trigger), *(psl.negation(u.formula) for u in inputs)])
        for alternative in _alternatives(condition):
            yield alternative, outputs


def _parted(goal: Mapped) -> list[tuple[tuple[Unit, ...], Formula]]:
    """Clauses of the consequent, grouped by the input parts that they offer as a way out."""
    if not any(not unit.output for unit in _units(goal)):
        formula = to_formula(goal)
        return [] if formula == psl.TRUE else [((), formula)]
    groups: dict[tuple[Unit, ...], list[Formula]] = {}
    for clause in clauses(goal):
        inputs = tuple(u for u in clause if not u.output)
        outputs = psl.disjunction([u.formula for u in clause if u.output])
        if outputs != psl.TRUE:
            groups.setdefault(inputs, []).append(outputs)
    return [(inputs, psl.conjunction(outputs)) for inputs, outputs in groups.items()]


def _units(mapped: Mapped) -> Iterator[Unit]:
    if isinstance(mapped, Unit):
        yield mapped
    else:
        for item in mapped.items:
            yield from _units(item)


def _alternatives(trigger: Formula) -> Sequence[Formula]:
    """The disjuncts of a trigger, unless they are many."""
    if isinstance(trigger, psl.Or):
        return trigger.items if len(trigger.items) <= MAX_ALTERNATIVES else [trigger]
    if not isinstance(trigger, psl.And):
        return [trigger]
    rows: list[list[Formula]] = [[]]
    for item in trigger.items:
        choices = item.items if isinstance(item, psl.Or) else (item,)
        rows = [[*row, choice] for row in rows for choice in choices]
        if len(rows) > MAX_ALTERNATIVES:
            return [trigger]
    return [psl.conjunction(row) for row in rows]


def _extra(extra: Extra, keys: set[str]) -> tuple[Property, ...]:
    found = []
    for choice in product(*extra.indices.values()):
        values: Mapping[str, int] = dict(zip(extra.indices, choice, strict=True))
        said = ", ".join(f"{n} = {v}" for n, v in values.items())
        formula = instantiate(extra.formula, values)
        trigger, goal = _response(formula)
        found.append(Property(_key(extra.name, [said] if said else [], keys), formula, trigger, goal, said))
    return tuple(found)


def _response(formula: Formula) -> tuple[Formula | None, Formula | None]:
    """Trigger (and goal) of ``[] (H -> …)``, where H has no temporal operator."""
    if isinstance(formula, Always) and isinstance(formula.body, Implies) and not psl.is_temporal(formula.body.left):
        right = formula.body.right
        goal = right.body if isinstance(right, Eventually) and not psl.is_temporal(right.body) else None
        return formula.body.left, goal
    return None, None


def _key(name: str, about: Sequence[str], keys: set[str]) -> str:
    """ASCII, without colons or spaces: AJPF's property files want it so."""
    words = [name, *re.findall(r"[0-9]+", about[0] if about else "")]
    base = re.sub(r"[^A-Za-z0-9]+", "_", "_".join(words)).strip("_") or "property"
    key, number = base, 1
    while key in keys:
        number += 1
        key = f"{base}_{number}"
    keys.add(key)
    return key


def _span(values: Sequence[int]) -> str:
    if len(values) > 2 and list(values) == list(range(values[0], values[0] + len(values))):
        return f"{values[0]}…{values[-1]}"
    return ", ".join(map(str, values))


def _merged(about: Sequence[str]) -> str:
    """Instances that gave one and the same property."""
    if len(about) <= 1:
        return "".join(about)
    split = [text.split(" = ") for text in about]
    if all(len(s) == 2 and s[0] == split[0][0] and s[1].isdigit() for s in split):
        return f"{split[0][0]} = {_span([int(s[1]) for s in split])}"
    return "; ".join(about)

"""What the sanity verdicts about a small contract have to be: every input is written out with every output.

A claim *holds* of the cases listed, where its output ranges over the values of `values.domain`:

| claim                   | holds if                                                                             |
|-------------------------|--------------------------------------------------------------------------------------|
| assumptions-satisfiable | an input meets the assumptions: it is *allowed*                                      |
| consistent              | an allowed input has a *good* output, one that meets every guarantee                 |
| realizable              | every allowed input has a good output                                                |
| not-tautological        | an allowed input has an output that the guarantee excludes;                          |
|                         | an input fails the assumption                                                        |
| not-vacuous             | each of the guarantee's triggers comes about, at an allowed input with some output   |
| not-redundant           | an allowed input has an output that meets all guarantees but this one;               |
|                         | an input meets all assumptions but this one                                          |
| constrained             | a good output is good no longer for another value of this output                     |
| determined              | no allowed input has two good outputs that differ in this one                        |
| needed                  | an input that meets all assumptions but this one has no good output                  |

Infinite types are cut off, which decides no less where the clauses that limit them (`LIMIT`) apply.
Where they do not (a guarantee by itself, the limits themselves), an example decides, and that there is none does not.
A claim of a contract that asks for elements of sequences or quotients may stay open.

Left out: unspecified types (``{}``), infinite ones without limits, quantifiers over them, functions on them, scenarios;
conflicts, counterexamples and explanations, and what is a consequence of what. A guarantee's triggers are Avow's own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from reference.meaning import Meaning, Step, has_value_always, is_finite

from avow.base.verdict import Verdict
from avow.language.contract import Node
from avow.language.terms import Term, Variable
from avow.sanity.claims import triggers
from avow.sanity.results import SanityResult

from .domains import as_written, domain

LIMIT = "limit_"
"""A clause of this name keeps the port named after it within the values of `values.domain`, and not all of these."""
MOST_CASES = 4_000
"""Contracts with more pairs of an input and an output are left out."""


@dataclass(frozen=True, slots=True)
class Fact:
    """Whether a claim holds; if not `firm`, it may hold of values that were not listed."""

    holds: bool
    firm: bool = True

    def allows(self, verdict: Verdict) -> bool:
        return verdict is (Verdict.PROVED if self.holds else Verdict.REFUTED) or not (self.holds or self.firm)


@dataclass(frozen=True, slots=True)
class Judgement:
    """Names of a node's claims, by what is to be said of their verdicts."""

    right: tuple[str, ...] = ()
    wrong: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    hinging: tuple[str, ...] = ()
    """Open, in a contract that asks for something unspecified."""


def is_small(node: Node) -> bool:
    """Whether the oracle can say anything about it."""
    ports = (*node.inputs, *node.outputs)
    return math.prod(len(domain(port.variable.sort)) for port in ports) <= MOST_CASES


def judge(node: Node, results: Iterable[SanityResult]) -> Judgement:
    """Hold verdicts against the facts about a node that is small."""
    table = Survey(node).facts()
    strayed = not all(has_value_always(as_written(clause)) for clause in node.clauses)
    found: dict[str, list[str]] = {"right": [], "wrong": [], "unknown": [], "hinging": []}
    for result in results:
        if result.verdict is Verdict.UNKNOWN:
            kind = "hinging" if strayed else "unknown"
        else:
            kind = "right" if table[result.name].allows(result.verdict) else "wrong"
        found[kind].append(result.name)
    return Judgement(**{kind: tuple(names) for kind, names in found.items()})


@dataclass(frozen=True, slots=True)
class Case:
    """One output for one input: which of the values each port has, which guarantees it fails, which triggers are on."""

    at: tuple[int, ...]
    failed: frozenset[str]
    triggered: Mapping[str, tuple[bool, ...]]


@dataclass(frozen=True, slots=True)
class Situation:
    """One input: the assumptions that it fails, and every output for it."""

    failed: frozenset[str]
    cases: tuple[Case, ...]

    @property
    def good(self) -> tuple[Case, ...]:
        return tuple(case for case in self.cases if not case.failed)


class Survey:
    """All cases of a node."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.meaning = Meaning()
        self.outputs = [port.variable for port in node.outputs]
        self.assumptions = {c.name: as_written(c) for c in node.assumptions}
        self.guarantees = {c.name: as_written(c) for c in node.guarantees}
        self.triggers = {c.name: triggers(c.formula) for c in node.guarantees}
        self.situations = tuple(self._situations([port.variable for port in node.inputs]))
        self.allowed = tuple(situation for situation in self.situations if not situation.failed)
        self.all_inputs = all(is_finite(port.variable.sort) for port in node.inputs)
        self.all_outputs = all(is_finite(output.sort) for output in self.outputs)

    def _situations(self, inputs: Sequence[Variable]) -> Iterator[Situation]:
        for _, given in _choices(inputs):
            cases = tuple(self._case(at, {**given, **chosen}) for at, chosen in _choices(self.outputs))
            yield Situation(self._failed(self.assumptions, given), cases)

    def _case(self, at: tuple[int, ...], values: Step) -> Case:
        triggered = {
            name: tuple(self.meaning.met(trigger, [values]) for trigger in each) for name, each in self.triggers.items()
        }
        return Case(at, self._failed(self.guarantees, values), triggered)

    def _failed(self, clauses: Mapping[str, Term], values: Step) -> frozenset[str]:
        return frozenset(name for name, formula in clauses.items() if not self.meaning.met(formula, [values]))

    def facts(self) -> dict[str, Fact]:
        """By the claims' names."""
        found = {
            "assumptions-satisfiable": Fact(bool(self.allowed)),
            "consistent": Fact(any(situation.good for situation in self.allowed)),
            "realizable": Fact(all(situation.good for situation in self.allowed)),
        }
        for name in self.guarantees:
            found |= self._of_guarantee(name)
        for place, output in enumerate(self.outputs):
            found |= self._of_output(place, output)
        for name in self.assumptions:
            found |= self._of_assumption(name)
        return found

    def _of_guarantee(self, name: str) -> dict[str, Fact]:
        cases = [case for situation in self.allowed for case in situation.cases]
        excludes = any(name in case.failed for case in cases)
        possible = all(any(on) for on in zip(*(case.triggered[name] for case in cases), strict=True)) and bool(cases)
        alone = any(case.failed == {name} for case in cases)
        return {
            f"not-tautological-{name}": Fact(excludes, self.all_outputs),
            f"not-vacuous-{name}": Fact(possible, self.all_outputs),
            f"not-redundant-{name}": Fact(alone, self.all_outputs or not name.startswith(LIMIT)),
        }

    def _of_output(self, place: int, output: Variable) -> dict[str, Fact]:
        return {
            f"constrained-{output.name}": Fact(any(self._is_constrained(place, s) for s in self.allowed)),
            f"determined-{output.name}": Fact(
                all(len({case.at[place] for case in situation.good}) < 2 for situation in self.allowed)
            ),
        }

    def _is_constrained(self, place: int, situation: Situation) -> bool:
        """Whether one of the good outputs is spoilt by another value there."""
        good = {case.at for case in situation.good}
        bad = {case.at for case in situation.cases} - good
        return not {_without(at, place) for at in good}.isdisjoint(_without(at, place) for at in bad)

    def _of_assumption(self, name: str) -> dict[str, Fact]:
        firm = self.all_inputs or not name.startswith(LIMIT)
        excluded = [situation for situation in self.situations if situation.failed == {name}]
        return {
            f"not-tautological-{name}": Fact(any(name in s.failed for s in self.situations), self.all_inputs),
            f"not-redundant-{name}": Fact(bool(excluded), firm),
            f"needed-{name}": Fact(any(not situation.good for situation in excluded), firm),
        }


def _choices(variables: Sequence[Variable]) -> Iterator[tuple[tuple[int, ...], Step]]:
    """Every choice of values, with their places in the domains."""
    for chosen in product(*(tuple(enumerate(domain(v.sort))) for v in variables)):
        yield tuple(k for k, _ in chosen), {v.qualified: value for v, (_, value) in zip(variables, chosen, strict=True)}


def _without(at: tuple[int, ...], place: int) -> tuple[int, ...]:
    return (*at[:place], *at[place + 1 :])

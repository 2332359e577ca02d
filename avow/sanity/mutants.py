"""Mutants of a formula: small changes to a clause that show whether the evidence for it would detect them.

The evidence of a method that supports a guarantee and would also support its mutants is non-discriminating. Mutants
that follow from the original (a weaker claim) do not test this, and `telling` leaves them out.

`difference` shows what distinguishes a surviving mutant from the guarantee. There are two cases. At some input, *every*
output that the contract allows may violate the mutant: a program that keeps the contract violates it there, so a method
that accepts the mutant has not examined that input. Or the contract allows an output that the mutant forbids, and
others too: then only a program with that output shows the difference, and the method may be blameless.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, free_variables, normalise
from avow.formulas.values import Value
from avow.formulas.written import show_values
from avow.language import terms as t
from avow.language.contract import Node
from avow.language.definedness import with_value
from avow.language.printer import show_term
from avow.language.sorts import REAL, EnumSort, RealSort
from avow.sanity.realizability import realizable
from avow.solving.questions import entails, solve
from avow.solving.translation import new_session

_TAKEN_FOR = {t.Builtin.MIN: t.Builtin.MAX, t.Builtin.MAX: t.Builtin.MIN}
_FLIPPED = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}


@dataclass(frozen=True, slots=True)
class Mutant:
    """`change` describes the change; `formula` is the whole formula, changed in one place."""

    change: str
    formula: t.Term


def mutants(formula: t.Term) -> tuple[Mutant, ...]:
    """Every mutant of a formula, in reading order, without duplicates or equivalents of the original (after
    normalisation)."""
    seen = {normalise(formula)}
    found = []
    changed = (Mutant("the whole is negated", _negated(formula)), *_everywhere(formula))
    for mutant in (Mutant(each.change, with_value(each.formula)) for each in changed):
        meaning = normalise(mutant.formula)
        if meaning not in seen:
            seen.add(meaning)
            found.append(mutant)
    return tuple(found)


@new_session()
def telling(
    formula: t.Term, assumptions: tuple[t.Term, ...], limit: int, effort: int = 2_000, others: tuple[t.Term, ...] = ()
) -> tuple[Mutant, ...]:
    """Up to `limit` mutants that do not follow from the original under the assumptions, spread over the formula; nor
    from it and the `others`, the node's further guarantees: programs that keep the contract keep such a mutant."""
    kept = [
        m
        for m in mutants(formula)
        if entails((*assumptions, formula), m.formula, effort=effort).verdict is Verdict.REFUTED
        and not (
            others and entails((*assumptions, *others, formula), m.formula, effort=effort).verdict is Verdict.PROVED
        )
    ]
    if len(kept) <= limit:
        return tuple(kept)
    return tuple(kept[k * len(kept) // limit] for k in range(limit))


def _negated(formula: t.Term) -> t.Term:
    """The negation under the universal quantifiers: ``forall x | not F`` denies the claim everywhere, not somewhere."""
    if isinstance(formula, t.Quantified) and formula.quantifier.value == "forall":
        return t.Quantified(formula.quantifier, formula.variables, _negated(formula.body), formula.span)
    if isinstance(formula, t.Implies):
        return t.Implies(formula.left, t.Not(formula.right), formula.span)
    return t.Not(formula)


def _everywhere(formula: t.Term) -> Iterator[Mutant]:
    """Mutants at each place, with an explicit stack: formulas may be deep."""
    stack: list[tuple[t.Term, Callable[[t.Term], t.Term]]] = [(formula, lambda item: item)]
    while stack:
        term, put = stack.pop()
        for change, new in _here(term):
            yield Mutant(change, put(new))
        parts = term.children
        if isinstance(term, t.Operation) and term.operator in (t.Builtin.MOD, t.Builtin.DIV):
            stack.append((parts[0], _at(term, parts, 0, put)))  # the divisor must stay positive
            continue
        for place in reversed(range(len(parts))):
            stack.append((parts[place], _at(term, parts, place, put)))


def _at(
    term: t.Term, parts: tuple[t.Term, ...], place: int, put: Callable[[t.Term], t.Term]
) -> Callable[[t.Term], t.Term]:
    return lambda new: put(term.rebuild((*parts[:place], new, *parts[place + 1 :])))


def _here(term: t.Term) -> Iterator[tuple[str, t.Term]]:
    match term:
        case t.Literal(value=bool()) | t.Literal(value=str()):
            return
        case t.Literal(value=value, sort=sort) if isinstance(value, int | Fraction):
            step: int | Fraction = max(1, abs(int(value)) // 10)
            for new in (value + step, value - step):
                if isinstance(sort, RealSort) or new >= 0 or value < 0:
                    yield f"{value} becomes {new}", _literal(new, term)
        case t.EnumValue(name=name, sort=EnumSort(members=members) as sort) if len(members) > 1:
            other = members[(members.index(name) + 1) % len(members)]
            yield f"{name} becomes {other}", t.EnumValue(other, sort, term.span)
        case t.Compare(operator=operator, left=left, right=right):
            flipped = _FLIPPED[operator]
            yield f"{operator} becomes {flipped}", t.Compare(flipped, left, right, term.span)
        case t.And(items=items) if len(items) > 1:
            for place in range(len(items)):
                rest = (*items[:place], *items[place + 1 :])
                yield f"part {place + 1} of a conjunction is dropped", conjunction(rest)
        case t.Or(items=items) if len(items) > 1:
            for place in range(len(items)):
                rest = (*items[:place], *items[place + 1 :])
                yield (
                    f"part {place + 1} of a disjunction is dropped",
                    rest[0] if len(rest) == 1 else t.Or(rest, term.span),
                )
        case t.Not(body=body):
            yield "a negation is dropped", body
        case t.Operation(operator=operator, arguments=arguments) if operator in _TAKEN_FOR:
            other_operator = _TAKEN_FOR[operator]
            yield f"{operator} becomes {other_operator}", t.Operation(other_operator, arguments, term.sort, term.span)
        case t.Operation(operator=t.Builtin.XOR, arguments=(left, right)):
            yield "xor becomes <=>", t.Iff(left, right, term.span)
        case t.Conditional(condition=condition, then=then, otherwise=otherwise):
            yield (
                "the branches of an `if` change places",
                t.Conditional(condition, otherwise, then, term.sort, term.span),
            )
        case t.Implies(right=right):  # detects a conclusion that a table maps to something always true
            yield "a condition is dropped", right
        case _:  # no mutant of its own, only of its parts
            return


def _literal(value: int | Fraction, old: t.Literal) -> t.Term:
    if isinstance(old.sort, RealSort):
        return t.Literal(Fraction(value), REAL, old.span)
    return t.Literal(int(value), old.sort, old.span)


@dataclass(frozen=True, slots=True)
class Difference:
    """`formula` is the mutant. `at` is an input and `answer` an output that the contract allows there and the mutant
    does not, in the contract's terms; with `forced`, this is so for every output that the contract allows there. Both
    are empty if none was found in time."""

    change: str
    formula: str
    at: tuple[tuple[str, str], ...] = ()
    answer: tuple[tuple[str, str], ...] = ()
    forced: bool = False

    @property
    def why(self) -> str:
        """One sentence: where the two differ, and what would show it."""
        if not self.at and not self.answer:
            return "where the two differ was not found in time"
        if self.forced:
            place = f"at {_listed(self.at)}" if self.at else "at every input"
            return f"{place} every answer that the contract allows breaks it, {_listed(self.answer)} too"
        place = f" at {_listed(self.at)}" if self.at else ""
        return f"the contract also allows {_listed(self.answer)}{place}, which breaks it, and others, which do not"


@new_session()
def difference(node: Node, mutant: Mutant, effort: int = 4_000) -> Difference:
    """The difference between a mutant of one of the node's guarantees and the node's contract; `effort` limits each of
    two queries."""
    shown = Difference(mutant.change, show_term(mutant.formula))
    assumptions = {f"assumed {c.name}": c.formula for c in node.assumptions}
    guarantees = {c.name: c.formula for c in node.guarantees}
    inputs = tuple(port.variable for port in node.inputs)
    outputs = tuple(port.variable for port in node.outputs)
    wanted = {**guarantees, " mutant": mutant.formula}
    kept = realizable(inputs, outputs, assumptions, wanted, effort=effort, doubtful=True)
    if kept.verdict is Verdict.REFUTED:
        found = solve(guarantees, given=kept.inputs, variables=outputs, effort=effort)
        if found.status == "sat":  # otherwise the contract has no output there, so no difference
            concerned = [formula for name, formula in guarantees.items() if name in kept.group]
            return _shown(shown, {**kept.inputs, **found.values}, [mutant.formula, *concerned], forced=True)
    answer = entails({**assumptions, **guarantees}, mutant.formula, effort=effort)
    return _shown(shown, answer.values, [mutant.formula]) if answer.verdict is Verdict.REFUTED else shown


def _shown(
    difference: Difference, values: Mapping[t.Variable, Value], formulas: list[t.Term], forced: bool = False
) -> Difference:
    """The difference with the inputs that the formulas mention, and the outputs that the mutant (the first) does."""
    inputs = frozenset[t.Variable]().union(*map(free_variables, formulas))
    outputs = free_variables(formulas[0])

    def of(role: t.Role, spoken: frozenset[t.Variable]) -> tuple[tuple[str, str], ...]:
        names = {v.qualified for v in spoken if v.role is role}
        return show_values({v: value for v, value in values.items() if v.qualified in names})

    return replace(difference, at=of(t.Role.INPUT, inputs), answer=of(t.Role.OUTPUT, outputs), forced=forced)


def _listed(values: tuple[tuple[str, str], ...]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values) or "this"

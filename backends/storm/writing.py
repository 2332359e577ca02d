"""Guarantees as labels, rewards and properties of a model in PRISM.

A guarantee with a probability p per step becomes a reward of each state: 1 if nothing is given there, 2 - p if the
claim is met, 1 - p if it is not. The expected reward of the next state is at least 1 exactly if the claim holds there
with probability p or more under the condition that it meets what is given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

from avow.formulas.conditions import conditions
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.contract import Clause
from avow.language.operators import definition
from avow.language.printer import show_term

from .options import OWN, Bound, Given

TYPED, ASSUMED = f"{OWN}typed", f"{OWN}assumed"


class NoCounterpart(Exception):  # noqa: N818 - it names what the formula is
    """Why a formula is no expression in PRISM, in words."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A property. `given` and `kept` are labels; `least` is the probability per step, or None."""

    name: str
    prop: str
    """Holds exactly if the claim does."""
    number: str
    """Storm's number for it: a probability, or for a probability per step an expected reward."""
    given: str
    kept: str
    least: Fraction | None = None
    whens: Mapping[str, str] = field(default_factory=dict)
    """A label for each condition under which the guarantee demands something, and the condition in RCL."""


@dataclass(frozen=True, slots=True)
class Written:
    """The model with labels and rewards, the properties, and for each guarantee without one the reason."""

    model: str
    asked: tuple[Asked, ...]
    refused: dict[str, str]

    @property
    def props(self) -> str:
        return "".join(f'"{each.name}": {each.prop};\n' for each in self.asked)


def written(given: Given, clauses: Iterable[Clause], assumptions: Iterable[Clause]) -> Written:
    """Raises NoCounterpart if an assumption has none."""
    least = "min" if given.nondeterministic else ""
    say = Expressions(given).say
    lines = [f'label "{TYPED}" = {" & ".join(filter(None, map(_typed, given.ports.values()))) or "true"};']
    lines.append(f'label "{ASSUMED}" = {" & ".join(say(a.formula) for a in assumptions) or "true"};')
    asked = [_always(name, name, least) for name in (TYPED, ASSUMED)]
    refused = {}
    for clause in clauses:
        name = label(clause.name)
        chance = clause.chance
        try:
            if chance is None or chance.per_run:
                lines.append(f'label "{name}" = {say(clause.spoken)};')
                always = _always(name, name, least, None if chance is None else chance.least)
                asked.append(replace(always, whens=_whens(clause, say, lines)))
                continue
            condition, claim, p = say(chance.given), say(chance.claim), chance.least
        except NoCounterpart as part:
            refused[clause.name] = str(part)
            continue
        at, kept = f"{name}_given", f"{name}_kept"
        lines += [f'label "{at}" = {condition};', f'label "{kept}" = {condition} & {claim};', f'rewards "{name}"']
        lines += [f"  !{condition} : 1;", f"  {condition} & {claim} : {_number(2 - p)};"]
        lines += [f"  {condition} & !{claim} : {_number(1 - p)};", "endrewards"]
        first = f'filter(forall, !"{at}" | "{kept}", "init")'
        asked.append(Asked(f"{name}_first", first, "", at, kept))
        reward = f'R{{"{name}"}}{least}'
        prop = f"filter(forall, {reward}>=1 [ I=1 ], true)"
        whens = {at: show_term(chance.given)} | _whens(clause, say, lines)
        asked.append(Asked(name, prop, f"{reward}=? [ I=1 ]", at, kept, p, whens))
    return Written(given.text.rstrip() + "\n\n// from the contract\n" + "\n".join(lines) + "\n", tuple(asked), refused)


def _whens(clause: Clause, say: Callable[[t.Term], str], lines: list[str]) -> dict[str, str]:
    """Writes the labels of the conditions into `lines`; not of a condition without a counterpart."""
    found = {}
    for k, each in enumerate(conditions(clause.spoken)):
        try:
            lines.append(f'label "{label(clause.name)}_when{k}" = {say(each.formula)};')
        except NoCounterpart:
            continue
        found[f"{label(clause.name)}_when{k}"] = show_term(each.formula)
    return found


def label(clause: str) -> str:
    """The name of a clause's property: PRISM has no primes in names."""
    return OWN + clause.replace("'", "_prime")


def _always(name: str, label: str, least: str, bound: Fraction | None = None) -> Asked:
    at_least = "1" if bound is None else _number(bound)
    return Asked(name, f'P>={at_least} [ G "{label}" ]', f'P{least}=? [ G "{label}" ]', "", label)


def _typed(bound: Bound) -> str:
    match bound.port.sort:
        case s.EnumSort():
            return "(" + " | ".join(f"{bound.name}={value}" for value in bound.values) + ")"
        case s.NaturalSort():
            return f"({bound.name}>=0)"
    return ""


def _number(value: Fraction) -> str:
    return str(value.numerator) if value.denominator == 1 else f"({value.numerator}/{value.denominator})"


class Expressions:
    """Terms as expressions in PRISM, each in parentheses. An element of an enumeration is its position."""

    def __init__(self, given: Given) -> None:
        self.ports = given.ports

    def say(self, term: t.Term) -> str:
        """Raises NoCounterpart."""
        two: Callable[[str], str] = lambda sign: f"({sign.join(map(self.say, term.children))})"  # noqa: E731
        match term:
            case t.Literal(value=bool() as value):
                return "true" if value else "false"
            case t.Literal(value=int() | Fraction() as value) if Fraction(value).denominator == 1:
                return f"({value})"
            case t.EnumValue(name=name, sort=s.EnumSort(members=members)):
                return f"{members.index(name)}"
            case t.Variable() if term.qualified in self.ports:
                return self.port(self.ports[term.qualified])
            case t.Variable():
                raise NoCounterpart(f"'ports' names no variable or formula of the model for {term.qualified}")
            case t.Widen(term=inner):
                return self.say(inner)
            case t.Not(body=body):
                return f"(!{self.say(body)})"
            case t.And(items=()) | t.Or(items=()):
                return "true" if isinstance(term, t.And) else "false"
            case t.And():
                return two(" & ")
            case t.Or():
                return two(" | ")
            case t.Implies():
                return two(" => ")
            case t.Iff():
                return two(" <=> ")
            case t.Compare(operator=operator, left=left, right=right) if _is_plain(left.sort):
                return self.compared(operator, left, right)
            case t.In(item=item, collection=t.SetTerm(items=items)):
                return self.say(t.Or(tuple(t.Compare("==", item, each) for each in items)))
            case t.Conditional(condition=condition, then=then, otherwise=otherwise):
                return f"({self.say(condition)} ? {self.say(then)} : {self.say(otherwise)})"
            case t.Negative(term=inner):
                return f"(0 - {self.say(inner)})"
            case t.Arithmetic(operator="+" | "-" | "*" as operator):
                return two(f" {operator} ")
            case t.Operation() if (meant := definition(term)) is not None:
                return self.say(meant)
        raise NoCounterpart(f"PRISM has no counterpart of `{show_term(term, 'unicode')}`".replace("\n", " "))

    def compared(self, operator: str, left: t.Term, right: t.Term) -> str:
        one, other = self.say(left), self.say(right)
        if operator in ("==", "!=") and left.sort == s.BOOL:
            return f"({'' if operator == '==' else '!'}({one} <=> {other}))"
        return f"({one} {'=' if operator == '==' else operator} {other})"

    def port(self, bound: Bound) -> str:
        text = f"{len(bound.values)}"
        for position, value in reversed([*enumerate(bound.values)]):
            text = f"({bound.name}={value} ? {position} : {text})"
        return text if bound.values else bound.name


def _is_plain(sort: s.Sort) -> bool:
    return isinstance(sort, s.BoolSort | s.EnumSort | s.IntegerSort | s.NaturalSort | s.RealSort)

"""The points of functions' tables: if a part is false for the functions' default values, only these points remain."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from avow.base.records import dataclass
from avow.base.tuning.bounds import ROWS_WITHOUT_INDEX
from avow.evaluation.compiler import Code, Compiler, Env, NotEvaluable
from avow.evaluation.patterns import Match, patterns
from avow.formulas.disjunctions import Part
from avow.formulas.formula import digest
from avow.formulas.renaming import bound_names
from avow.language.terms import Apply, Not, Quantified, Role, Term, Variable


class Unrestricted(NotEvaluable):
    """Found at run time: a table's default makes infinitely many points satisfy a part."""


@dataclass(frozen=True, slots=True)
class Step:
    """Binds `binds` to each value that can satisfy one part; lower ranks yield fewer candidates."""

    rank: int
    binds: frozenset[str]
    run: Callable[[Env], Iterable[object]]


class Lookup:
    """The points of a table that agree with the arguments already known: by an index, if that pays.

    The index of the last table is kept: a map is the same from one evaluation to the next. Tables do not change.
    """

    def __init__(self, known: tuple[int, ...], codes: tuple[Code, ...]) -> None:
        self._known = known
        self._codes = codes
        self._table: Any = None
        self._index: dict[tuple[Any, ...], list[tuple[Any, Any]]] = {}

    def rows(self, table: Mapping[Any, Any], env: Env) -> Iterable[tuple[Any, Any]]:
        if not self._known or len(table) <= ROWS_WITHOUT_INDEX:
            return list(table.items())
        if table is not self._table:
            index: dict[tuple[Any, ...], list[tuple[Any, Any]]] = {}
            for key, value in table.items():
                index.setdefault(tuple([key[k] for k in self._known]), []).append((key, value))
            self._table, self._index = table, index
        return self._index.get(tuple([code(env) for code in self._codes]), ())


def table_rows(compiler: Compiler, part: Part, unbound: set[str]) -> Step | None:
    """For a part in which the variables are arguments of functions only: it can hold at a point of one of these."""
    elsewhere: dict[Term, Variable] = {}
    term = _elsewhere(part.term, unbound, elsewhere)
    if not elsewhere or bound_names(term) & unbound:
        return None
    tables: list[tuple[Code, Match]] = []
    left: set[str] | None = None
    for apply in elsewhere:
        assert isinstance(apply, Apply)
        free = set(unbound)
        match = patterns(compiler, apply.arguments, free)
        if match is None or (left is not None and free != left):
            return None
        left = free
        tables.append((compiler.code(apply.function), match))
    if left is None or left == unbound:
        return None
    slots = tuple(compiler.bind(variable) for variable in elsewhere.values())
    truth = compiler.code(term if part.positive else Not(term))

    def run(env: Env) -> Iterator[None]:
        found = [(function(env), match) for function, match in tables]
        if any(value.table.__class__ is not dict for value, _ in found):  # it is only partly known
            raise Unrestricted("a function's table is open")
        away = [*env, *[None] * (compiler.size - len(env))]  # a plan may be made after the environment
        for slot, (value, _) in zip(slots, found, strict=True):
            away[slot] = value.default
        try:
            if truth(away):
                raise Unrestricted("functions have such values at infinitely many points")
        except NotEvaluable as reason:
            raise Unrestricted(reason.reason) from None
        for value, match in found:
            for key in list(value.table):
                if match(env, key):
                    yield None

    return Step(2, frozenset(unbound - left), run)


def _elsewhere(term: Term, unbound: set[str], found: dict[Term, Variable]) -> Term:
    """The part with each application of a function to one of the variables replaced by a new variable."""
    if isinstance(term, Quantified) or not bound_names(term) & unbound:
        return term
    if isinstance(term, Apply) and not bound_names(term.function):
        if term not in found:
            found[term] = Variable(Role.BOUND, f"elsewhere {digest(term)}", term.sort)
        return found[term]
    return term.rebuild(tuple(_elsewhere(child, unbound, found) for child in term.children))

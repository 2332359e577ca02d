"""Quantifiers over infinite sorts, made finite if that is exact (the safe-range fragment, as in MonPoly).

``exists(x, y in REAL | in.at(x, y) and …)`` can only hold at a point of the table ``in.at``; ``out.c == move(x, y)``
fixes x and y; ``0 <= i < n`` leaves n values. A `Search` turns the body into alternatives of conjunctions, finds for
each an order in which its parts bind the variables, and checks every candidate against all parts. ``forall`` is the
search for a counterexample. For a variable that no part restricts a solver is used
(`avow.evaluation.solved_variables`); if it finds no answer, `NotEvaluable` names the variable.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from avow.base.tuning.bounds import DISJUNCTION_DEPTH, VALUES_ENUMERATED
from avow.evaluation.compiler import Code, Compiler, Env, NotEvaluable, finite_values
from avow.evaluation.patterns import pattern, patterns
from avow.evaluation.solved_variables import solved_step
from avow.evaluation.table_rows import Lookup, Step, Unrestricted, table_rows
from avow.formulas.disjunctions import Part, alternatives, branches, conjunction, occurring, relations
from avow.formulas.renaming import bound_names
from avow.language import terms as t
from avow.language.operators import FLIPPED, OPPOSITE
from avow.language.sorts import BoolSort, IntegerSort, NaturalSort

Doubt = NotEvaluable | None
"""The status of a candidate: None if it certainly satisfies the body, otherwise why that could not be determined."""


class Incomplete(NotEvaluable):
    """Candidates could not all be enumerated; those enumerated are not all that exist."""


class Search:
    """The assignments to `variables` for which `body` has the truth value `positive`."""

    def __init__(
        self, compiler: Compiler, variables: Sequence[t.Variable], body: t.Term, positive: bool, *, unique: bool = False
    ) -> None:
        self._compiler = compiler
        self._unique = unique
        self._slots = tuple(compiler.bind(v) for v in variables)
        self._branches = tuple(branches(body, positive, tuple(variables)))
        for _, inner in self._branches:
            for variable in inner:
                compiler.bind(variable)
        self._relations = tuple(sorted({compiler.slot(v) for v in relations(body)}))
        self._plans: dict[tuple[bool, ...], tuple[Plan, ...]] = {}
        self._fallbacks: dict[tuple[int, tuple[bool, ...] | None], Plan] = {}
        self._plan(tuple(False for _ in self._relations))

    def exists(self, env: Env) -> bool:
        doubt: Doubt = None
        for reason in self._solutions(env):
            if reason is None:
                return True
            doubt = doubt or reason
        if doubt is not None:
            raise doubt
        return False

    def exactly_one(self, env: Env) -> bool:
        doubt: Doubt = None
        found: set[tuple[Any, ...]] = set()
        for reason in self._solutions(env):
            if reason is None:
                found.add(tuple([env[s] for s in self._slots]))
                if len(found) > 1:
                    return False
            else:
                doubt = doubt or reason
        if doubt is not None:
            raise doubt
        return len(found) == 1

    def witnesses(self, env: Env) -> Iterator[tuple[Any, ...]]:
        """Values of `variables` that certainly satisfy the body (perhaps not all of them, and perhaps repeated)."""
        for reason in self._solutions(env):
            if reason is None:
                yield tuple([env[s] for s in self._slots])

    def _solutions(self, env: Env) -> Iterator[Doubt]:
        defaults = tuple([env[s].default is True for s in self._relations])
        for at, plan in enumerate(self._plan(defaults)):
            fallbacks = (self._fallback(at, defaults, tables=tables) for tables in (True, False))
            tried: Plan | None = plan
            while tried is not None:
                unrestricted = False
                for reason in tried.solutions(env):
                    if isinstance(reason, Unrestricted):
                        unrestricted = True
                    else:
                        yield reason
                tried = next(fallbacks, None) if unrestricted else None

    def all(self, env: Env) -> dict[tuple[Any, ...], None]:
        """All assignments, each once; values that nothing names are represented by one of them. Raises NotEvaluable."""
        found: dict[tuple[Any, ...], None] = {}
        for reason in self._solutions(env):
            if reason is not None:
                raise reason
            found[tuple([env[s] for s in self._slots])] = None
        return found

    def _fallback(self, at: int, defaults: tuple[bool, ...], *, tables: bool) -> Plan:
        """For functions whose default values (or whose lack of a table) restrict nothing."""
        key = at, defaults if tables else None
        if key not in self._fallbacks:
            parts, variables = self._branches[at]
            true = self._true(defaults) if tables else frozenset[int]()
            self._fallbacks[key] = Plan(
                self._compiler, parts, variables, true, complete=True, unique=self._unique, tables=tables, rows=False
            )
        return self._fallbacks[key]

    def _true(self, defaults: tuple[bool, ...]) -> frozenset[int]:
        return frozenset(slot for slot, default in zip(self._relations, defaults, strict=True) if default)

    def _plan(self, defaults: tuple[bool, ...]) -> tuple[Plan, ...]:
        """Which parts restrict depends on the relations' defaults, nearly always FALSE: one plan for each case met."""
        found = self._plans.get(defaults)
        if found is None:
            true = self._true(defaults)
            found = tuple(
                Plan(self._compiler, parts, variables, true, complete=True, unique=self._unique)
                for parts, variables in self._branches
            )
            self._plans[defaults] = found
        return found


class Plan:
    """An order of steps for one conjunction, with the checks that are possible after each."""

    def __init__(
        self,
        compiler: Compiler,
        parts: Sequence[Part],
        variables: Sequence[t.Variable],
        true_defaults: frozenset[int],
        *,
        complete: bool,
        unique: bool = False,
        tables: bool = True,
        rows: bool = True,
        depth: int = 0,
    ) -> None:
        """`complete`: bind every variable, otherwise only those that parts restrict. `unique`: bind also variables that
        no part mentions, since the number of their values matters. `tables`: functions' tables restrict variables;
        `rows`: also if something is false for all default values."""
        self._compiler = compiler
        self._depth = depth
        self._tables, self._rows = tables, rows
        self._true = true_defaults
        by_name = {v.name: v for v in variables}
        mentioned = frozenset[str]().union(*(p.names for p in parts))
        unbound = {
            name
            for name, variable in by_name.items()
            if unique or name in mentioned or finite_values(variable.sort, compiler.domains) == ()
        }
        pending = list(parts)
        self.bound: frozenset[str] = frozenset()
        self._steps: list[Callable[[Env], Iterable[object]]] = []
        self._checks: list[tuple[Code, ...]] = [self._ready(pending, unbound)]
        while unbound:
            step = self._best(pending, unbound, by_name) if complete else self._restriction(pending, unbound, by_name)
            if step is None:
                if complete:
                    self._leftover(pending, [by_name[n] for n in by_name if n in unbound], unique)
                break
            unbound -= step.binds
            self.bound |= step.binds
            self._steps.append(step.run)
            self._checks.append(self._ready(pending, unbound))

    def solutions(self, env: Env) -> Iterator[Doubt]:
        """Binds the variables in `env` before each yield."""
        return self._descend(0, env, None)

    def _descend(self, k: int, env: Env, doubt: Doubt) -> Iterator[Doubt]:
        for check in self._checks[k]:
            try:
                if not check(env):
                    return
            except NotEvaluable as reason:
                doubt = doubt or reason
        if k == len(self._steps):
            yield doubt
            return
        try:
            for _ in self._steps[k](env):
                yield from self._descend(k + 1, env, doubt)
        except NotEvaluable as reason:
            yield reason if isinstance(reason, Unrestricted) else Incomplete(reason.reason)

    def _ready(self, pending: list[Part], unbound: set[str]) -> tuple[Code, ...]:
        """Remove the parts that are now fully bound; returns their checks."""
        ready = [p for p in pending if not p.names & unbound]
        pending[:] = [p for p in pending if p.names & unbound]
        return tuple(_truth(self._compiler, p) for p in ready)

    def _best(self, pending: Sequence[Part], unbound: set[str], by_name: dict[str, t.Variable]) -> Step | None:
        step = self._restriction(pending, unbound, by_name)
        if step is not None:
            return step
        for name in by_name:
            if name in unbound:
                finite = finite_values(by_name[name].sort, self._compiler.domains)
                if finite is not None:
                    return _one_of(self._compiler, by_name[name], finite)
        return None

    def _restriction(self, pending: Sequence[Part], unbound: set[str], by_name: dict[str, t.Variable]) -> Step | None:
        found: list[Step] = []
        for part in pending:
            step = self._restrict(part, unbound)
            if step is not None:
                if step.rank == 0:
                    return step
                found.append(step)
        if not found:
            found = [s for n in by_name if n in unbound and (s := self._interval(pending, by_name[n], unbound))]
        return min(found, key=lambda s: s.rank, default=None)

    def _leftover(self, pending: Sequence[Part], variables: list[t.Variable], unique: bool) -> None:
        truths = [_truth(self._compiler, p) for p in pending]
        self._steps.append(solved_step(self._compiler, pending, variables, unique=unique))
        self._checks.append(tuple(truths))

    def _restrict(self, part: Part, unbound: set[str]) -> Step | None:
        term, positive = part.term, part.positive
        options = alternatives(term, positive)
        if options is not None:
            return self._cover(options, unbound)
        match term:
            case t.Quantified(quantifier=t.Quantifier.UNIQUE) if positive:
                return self._cover(((term.body, True),), unbound, term.variables)
            case t.Apply(sort=BoolSort()) if self._tables and not bound_names(term.function):
                return self._points(term, positive, unbound)
            case t.Compare(operator=operator) if operator == ("==" if positive else "!="):
                found = self._equation(term.left, term.right, unbound) or self._equation(term.right, term.left, unbound)
            case t.In() if positive:
                found = self._membership(term, unbound)
            case _:  # only by functions' default values
                found = None
        return found or (table_rows(self._compiler, part, unbound) if self._rows else None)

    def _cover(
        self, options: Sequence[tuple[t.Term, bool]], unbound: set[str], variables: Sequence[t.Variable] = ()
    ) -> Step | None:
        """A disjunction restricts the variables that all of its sides restrict."""
        if self._depth >= DISJUNCTION_DEPTH:
            return None
        plans: list[Plan] = []
        common = frozenset(unbound)
        for option, positive in options:
            parts, inner = conjunction(option, positive)
            for variable in (*variables, *inner):
                self._compiler.bind(variable)
            wanted = [t.Variable(v.role, v.name, v.sort) for v in (*variables, *inner)]
            wanted += occurring(parts, unbound)
            plan = Plan(
                self._compiler,
                parts,
                wanted,
                self._true,
                complete=False,
                tables=self._tables,
                rows=self._rows,
                depth=self._depth + 1,
            )
            common &= plan.bound
            plans.append(plan)
        if not common:
            return None
        slots = tuple(self._compiler.bound[name] for name in sorted(common))

        def run(env: Env) -> Iterator[None]:
            # First all candidates: a check that runs between two of them may use the slots of the inner variables.
            found: dict[tuple[Any, ...], None] = {}
            for plan in plans:
                for reason in plan.solutions(env):
                    if isinstance(reason, Unrestricted | Incomplete):
                        raise reason
                    found[tuple([env[s] for s in slots])] = None
            for candidate in found:
                for slot, value in zip(slots, candidate, strict=True):
                    env[slot] = value
                yield None

        return Step(2, common, run)

    def _points(self, term: t.Apply, positive: bool, unbound: set[str]) -> Step | None:
        if isinstance(term.function, t.Variable) and (self._compiler.slot(term.function) in self._true) is positive:
            return None
        left = set(unbound)
        matching = patterns(self._compiler, term.arguments, left)
        if matching is None or len(left) == len(unbound):
            return None
        match, function = matching, self._compiler.code(term.function)
        known = tuple(k for k, a in enumerate(term.arguments) if not bound_names(a) & unbound)
        lookup = Lookup(known, tuple(self._compiler.code(term.arguments[k]) for k in known))

        def run(env: Env) -> Iterator[None]:
            value = function(env)
            if value.default is positive:
                raise Unrestricted("a relation holds at infinitely many points")
            for key, result in lookup.rows(value.table, env):
                if result is positive and match(env, key):
                    yield None

        return Step(1, frozenset(unbound - left), run)

    def _equation(self, left: t.Term, right: t.Term, unbound: set[str]) -> Step | None:
        """``left == right`` with a known left side."""
        if bound_names(left) & unbound:
            return None
        known = self._compiler.code(left)
        free = set(unbound)
        matching = pattern(self._compiler, right, free)
        if matching is not None and len(free) < len(unbound):
            match = matching

            def once(env: Env) -> Iterator[None]:
                if match(env, known(env)):
                    yield None

            return Step(0, frozenset(unbound - free), once)
        if self._tables and isinstance(right, t.Apply) and not bound_names(right.function):
            return self._preimage(right, known, unbound)
        return None

    def _preimage(self, term: t.Apply, known: Code, unbound: set[str]) -> Step | None:
        free = set(unbound)
        matching = patterns(self._compiler, term.arguments, free)
        if matching is None or len(free) == len(unbound):
            return None
        match, function = matching, self._compiler.code(term.function)

        def run(env: Env) -> Iterator[None]:
            value, wanted = function(env), known(env)
            if value.default == wanted:
                raise Unrestricted("a function has a value at infinitely many points")
            for key, result in list(value.table.items()):
                if result == wanted and match(env, key):
                    yield None

        return Step(1, frozenset(unbound - free), run)

    def _membership(self, term: t.In, unbound: set[str]) -> Step | None:
        if bound_names(term.collection) & unbound:
            return None
        free = set(unbound)
        matching = pattern(self._compiler, term.item, free)
        if matching is None or len(free) == len(unbound):
            return None
        match = matching
        candidates: Callable[[Env], Iterable[Any]]
        match term.collection:
            case t.SetTerm(items=items) | t.SequenceTerm(items=items):
                codes = tuple(map(self._compiler.code, items))

                def candidates(env: Env) -> Iterable[Any]:
                    return [c(env) for c in codes]

            case t.SequenceRange(low=low, high=high):
                start, end = self._compiler.code(low), self._compiler.code(high)

                def candidates(env: Env) -> Iterable[Any]:
                    return _integers(start(env), end(env))

            case collection:
                whole = self._compiler.code(collection)

                def candidates(env: Env) -> Iterable[Any]:
                    items: Iterable[Any] = whole(env).items
                    return items

        def run(env: Env) -> Iterator[None]:
            for value in candidates(env):
                if match(env, value):
                    yield None

        return Step(1, frozenset(unbound - free), run)

    def _interval(self, parts: Sequence[Part], variable: t.Variable, unbound: set[str]) -> Step | None:
        """An integer variable between two known bounds."""
        if not isinstance(variable.sort, IntegerSort | NaturalSort) or variable.sort in self._compiler.domains:
            return None
        lower: list[Code] = [lambda env: 0] if isinstance(variable.sort, NaturalSort) else []
        upper: list[Code] = []
        for part in parts:
            bound = _bound(part, variable.name)
            if bound is None or bound_names(bound[1]) & unbound:
                continue
            operator, other = bound
            code = self._compiler.code(other)
            match operator:
                case "<":
                    upper.append(lambda env, c=code: math.ceil(c(env)) - 1)  # type: ignore[misc]
                case "<=":
                    upper.append(lambda env, c=code: math.floor(c(env)))  # type: ignore[misc]
                case ">":
                    lower.append(lambda env, c=code: math.floor(c(env)) + 1)  # type: ignore[misc]
                case ">=":
                    lower.append(lambda env, c=code: math.ceil(c(env)))  # type: ignore[misc]
        if not lower or not upper:
            return None
        slot = self._compiler.bind(variable)

        def run(env: Env) -> Iterator[None]:
            for value in _integers(max(c(env) for c in lower), min(c(env) for c in upper)):
                env[slot] = value
                yield None

        return Step(3, frozenset((variable.name,)), run)


def _integers(low: int, high: int) -> range:
    if high - low >= VALUES_ENUMERATED:
        raise NotEvaluable(f"there are {high - low + 1} integers to try")
    return range(low, high + 1)


def _one_of(compiler: Compiler, variable: t.Variable, finite: Sequence[Any]) -> Step:
    slot = compiler.bind(variable)

    def run(env: Env) -> Iterator[None]:
        for value in finite:
            env[slot] = value
            yield None

    return Step(3, frozenset((variable.name,)), run)


def _bound(part: Part, name: str) -> tuple[str, t.Term] | None:
    """``("<", t)`` if the part says that the variable is less than t."""
    if not isinstance(part.term, t.Compare) or part.term.operator not in FLIPPED:
        return None
    operator = part.term.operator if part.positive else OPPOSITE[part.term.operator]
    if _is(part.term.left, name):
        return operator, part.term.right
    if _is(part.term.right, name):
        return FLIPPED[operator], part.term.left
    return None


def _is(term: t.Term, name: str) -> bool:
    if isinstance(term, t.Widen):
        term = term.term
    return isinstance(term, t.Variable) and term.qualified == name


def _truth(compiler: Compiler, part: Part) -> Code:
    return compiler.code(part.term if part.positive else t.Not(part.term))

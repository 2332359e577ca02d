"""What a node may put out, found by asking: a function's or a sequence's values are chosen where something looks.

A guarantee that is evaluated over a function of which nothing is decided yet says which point it has to know: the
search goes on with each value that there may be, and what no clause looks at stays open, for whoever reads it later to
decide. So one open function stands for all functions that complete it, and a search that ends has looked at them all
(lazy narrowing: Lindblad 2007; Runciman, Naylor and Lindblad 2008).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from avow.base.records import dataclass
from avow.base.tuning.bounds import PARTIAL_ANSWERS, PARTIAL_ANSWERS_AGAIN
from avow.base.tuning.effort import SEARCH_STEPS
from avow.calculus.open_values import Holds, Lazy, Point, Undecided, Values, asking, decided, lazy_names, opened
from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term
from avow.formulas.formula import free_variables
from avow.formulas.values import Value
from avow.language.contract import Clause
from avow.language.sorts import FunctionSort
from avow.language.terms import And, Apply, Compare, Implies, Role, Term, Variable
from avow.solving.limits import spend

# -- equations ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Forcing:
    """``when -> out.name == value`` or, with arguments, ``when -> out.name(arguments) == value``: no other will do."""

    name: str
    arguments: tuple[Evaluator, ...] | None
    when: tuple[Evaluator, ...]
    value: Evaluator
    lazy: Lazy

    def forced(
        self, found: Mapping[str, Value], point: Point | None, wanted: list[tuple[str, Point]]
    ) -> tuple[Value, ...] | None:
        """The only value that is possible, if this equation says so of this port (at this point). `wanted` gets what it
        would have to know first."""
        if (point is None) is not (self.arguments is None):
            return None
        values, asked = opened(found, self.lazy)
        try:
            if self.arguments is not None and tuple(a(values) for a in self.arguments) != point:
                return None
            if not all(when(values) for when in self.when):
                return None
            value = self.value(values)
        except NotEvaluable:
            wanted += asked
            return None
        # An open sequence is not copied: what is decided of the copy later would not be decided of it.
        return None if asking(value) else (value,)


def forcings(guarantees: Sequence[Clause]) -> tuple[Forcing, ...]:
    """The equations among the guarantees that give an output, or a function's value at a point."""
    found: list[Forcing] = []
    for clause in guarantees:
        stack: list[tuple[Term, tuple[Term, ...]]] = [(clause.formula, ())]
        while stack:
            term, when = stack.pop()
            match term:
                case And(items=items):
                    stack += [(item, when) for item in reversed(items)]
                case Implies(left=left, right=right):
                    stack.append((right, (*when, left)))
                case Compare(operator="==", left=left, right=right):
                    for head, value in ((left, right), (right, left)):
                        forcing = _forcing(head, value, when)
                        if forcing is not None:
                            found.append(forcing)
    return tuple(found)


def _forcing(head: Term, value: Term, when: tuple[Term, ...]) -> Forcing | None:
    port, arguments = (head.function, head.arguments) if isinstance(head, Apply) else (head, None)
    if not isinstance(port, Variable) or port.role is not Role.OUTPUT:
        return None
    if arguments is None and isinstance(port.sort, FunctionSort):
        return None
    parts = (*(arguments or ()), *when, value)
    if port in {v for part in ((value, *when) if arguments is None else parts) for v in free_variables(part)}:
        return None
    try:
        return Forcing(
            port.qualified,
            None if arguments is None else tuple(map(compile_term, arguments)),
            tuple(map(compile_term, when)),
            compile_term(value),
            tuple(dict(entry for part in parts for entry in lazy_names(part)).items()),
        )
    except NotEvaluable:
        return None


# -- the search --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Choices:
    """What an output may be. `values`: of a plain one the values tried, None where they are not known; of a function or
    a sequence the values that it may have at a point. `why` says what would help where they are not known."""

    values: tuple[Value, ...] | None
    why: str = ""
    shells: tuple[Value, ...] | None = None
    """What is tried of an open output to begin with: the open function; open sequences of every length tried."""

    short: str = ""
    """In what way `shells` are not all there are."""

    restricted: str = ""
    """In what way `values`, of what has `shells`, are not all there are."""

    natural: bool = False
    """Whether it, or what it has at a point, is a natural number."""

    def fits(self, value: Value) -> bool:
        """Whether a value that an equation gives is of its sort: the scenario's values do not matter to it."""
        return not (self.natural and isinstance(value, int) and value < 0)

    def begin(self) -> tuple[Value, ...] | None:
        return self.shells if self.shells is not None else self.values


class Unknown(Exception):  # noqa: N818 - it names a state
    """An output whose values are not known, and that no equation gives."""


@dataclass(slots=True)
class Narrowing:
    """The search for the outputs of one node."""

    choices: Mapping[str, Choices]
    """By ``out.port``."""
    guarantees: tuple[tuple[frozenset[str], Holds], ...]
    """With the outputs that each mentions. They raise `Undecided`."""
    forcings: tuple[Forcing, ...]
    incomplete: set[str] = field(default_factory=set)
    """Why a search that came to its end still is not exhaustive."""

    most: int = PARTIAL_ANSWERS

    def answers(self, inputs: Mapping[str, Value], limit: int, *, free: bool = False) -> tuple[list[Values], bool]:
        """Every output that meets the guarantees (with `free`, every output at all), each open where that does not
        matter; and whether these are all. Raises Undecided where an open input has to be known first, and Unknown."""
        pending = () if free else self.guarantees
        stack: list[tuple[Values, tuple[tuple[frozenset[str], Holds], ...]]] = [({}, pending)]
        found: list[Values] = []
        tried = 0
        while stack:
            outputs, pending = stack.pop()
            tried += 1
            spend(SEARCH_STEPS)
            if tried > self.most or len(found) > limit:
                self.most = min(self.most, PARTIAL_ANSWERS_AGAIN)
                return found[:limit], False
            judged = self._judge({**inputs, **outputs}, outputs, pending)
            if judged is None:
                continue
            pending, wanted = judged
            missing = [name for name in self.choices if name not in outputs]
            following = self._next(missing, {**inputs, **outputs}, free, wanted) if missing else None
            if following is not None:
                name, values = following
                stack += [({**outputs, name: value}, pending) for value in reversed(values)]
            elif wanted:
                own = next(((name, point) for name, point in wanted if name in outputs), None)
                if own is None:
                    raise Undecided(wanted)
                name, point = own
                possible = self._possible(name, point, {**inputs, **outputs}, free)
                further = [decided(outputs[name], point, value) for value in reversed(possible)]
                stack += [({**outputs, name: value}, pending) for value in further]
            else:
                found.append(outputs)
        return found, True

    def _judge(
        self, valuation: Values, outputs: Values, pending: tuple[tuple[frozenset[str], Holds], ...]
    ) -> tuple[tuple[tuple[frozenset[str], Holds], ...], list[tuple[str, Point]]] | None:
        """The guarantees that are not judged yet, with the points that they ask for; None if one is broken."""
        left: list[tuple[frozenset[str], Holds]] = []
        wanted: list[tuple[str, Point]] = []
        for guarantee in pending:
            mentioned, holds = guarantee
            if not mentioned <= outputs.keys():
                left.append(guarantee)
                continue
            try:
                if not holds(valuation):
                    return None
            except Undecided as undecided:
                left.append(guarantee)
                wanted += undecided.wanted
        return tuple(left), wanted

    def _next(
        self, missing: Sequence[str], valuation: Values, free: bool, wanted: list[tuple[str, Point]]
    ) -> tuple[str, tuple[Value, ...]] | None:
        """The output to choose next, and what it may be: one that an equation gives, else the one with least choice.
        None where a point has to be decided before: it is added to `wanted`. Raises Unknown."""
        best: tuple[str, tuple[Value, ...]] | None = None
        for name in missing:
            begin = self.choices[name].begin()
            forced = None if free else self._forced(name, None, valuation, wanted)
            if forced is not None:
                return name, tuple(filter(self.choices[name].fits, forced))
            if begin is not None and (best is None or len(begin) < len(best[1])):
                best = name, begin
        if best is not None:
            if self.choices[best[0]].short:
                self.incomplete.add(self.choices[best[0]].short)
            return best
        if wanted:
            return None
        raise Unknown(self.choices[missing[0]].why)

    def _possible(self, name: str, point: Point, valuation: Values, free: bool) -> tuple[Value, ...]:
        values = self.choices[name].values
        wanted: list[tuple[str, Point]] = []
        forced = None if free else self._forced(name, point, valuation, wanted)
        if forced is not None:
            return tuple(filter(self.choices[name].fits, forced))
        if values is None and (foreign := [(n, p) for n, p in wanted if n not in self.choices]):
            raise Undecided(foreign)
        if values is None:
            raise Unknown(self.choices[name].why)
        return values

    def _forced(
        self, name: str, point: Point | None, valuation: Values, wanted: list[tuple[str, Point]]
    ) -> tuple[Value, ...] | None:
        for forcing in self.forcings:
            if forcing.name == name:
                found = forcing.forced(valuation, point, wanted)
                if found is not None:
                    return found
        return None

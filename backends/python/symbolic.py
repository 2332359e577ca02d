"""Verification conditions of a step: its program run on variables.

Every value is given a name, and what is known of it is a fact; where paths meet, a name has the value of the path that
was taken. A check is made of the facts known when it is met, never of later ones. A loop is one turn from any state
that its invariants allow; that they hold before the first turn and after each are checks too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from avow.formulas.formula import conjunction, disjunction, equation, negation
from avow.language import terms as t
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL, EnumSort, FunctionSort, Sort

from . import program
from .program import Expr, assigned
from .rounding import finite, gaps, no_overflow, rounded
from .tuning import BESIDE, MOST_NAMES, UNROLLED

ZERO = t.Literal(0, INTEGER)


@dataclass(frozen=True, slots=True)
class Check:
    """`goal` follows from the first `facts` of the facts, where `guard` holds."""

    facts: int
    guard: t.Term
    goal: t.Term
    what: str
    line: int
    candidate: Candidate | None = None
    """The invariant whose beginning or keeping this is."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A formula that may hold whenever a loop's next turn is decided on; `build` makes it of the loop's state."""

    loop: str
    text: str
    build: Callable[[Turn], t.Term | None] = field(compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Turn:
    """A loop at some moment: the names' values, how many turns are done, and what the names were before the first."""

    values: Mapping[str, t.Term]
    done: t.Term
    entry: Mapping[str, t.Term]
    loop: program.For
    carried: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class End:
    """A way out of the step: where `guard` holds, with the first `facts` of the facts."""

    facts: int
    guard: t.Term
    outputs: Mapping[str, t.Term]
    line: int


@dataclass(slots=True)
class State:
    path: t.Term
    values: dict[str, t.Term]


class TooMuch(Exception):  # noqa: N818 - it names what happened
    """More facts than this method handles."""


@dataclass(slots=True)
class Run:
    """One symbolic run of a step."""

    step: program.Step
    sorts: Mapping[str, EnumSort]
    """Element → its enumeration."""
    exact: bool
    """Nothing is rounded."""
    thresholds: tuple[float, ...]
    """Doubles at which rounded results are distinguished."""
    gaps: tuple[Fraction, ...]
    """Numbers of the contract that may be no doubles."""
    candidates: Sequence[Candidate]
    facts: list[t.Term] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    ends: list[End] = field(default_factory=list)
    loops: list[tuple[program.For, Turn]] = field(default_factory=list)
    rounds: list[int] = field(default_factory=list)
    """Lines where something is rounded."""
    _doubles: list[t.Term] = field(default_factory=list)
    """Inputs, which rounding does not pass."""
    _fresh: int = 0
    _exits: list[list[tuple[State, t.Term | None]]] = field(default_factory=list)
    _left: list[list[tuple[State, str]]] = field(default_factory=list)

    # -- naming ------------------------------------------------------------------------------------------

    def fresh(self, hint: str, sort: Sort) -> t.Variable:
        self._fresh += 1
        if self._fresh > MOST_NAMES:
            raise TooMuch
        return t.Variable(t.Role.BOUND, f"{hint}.{self._fresh}", sort)

    def named(self, hint: str, term: t.Term) -> t.Term:
        """A name for a term, unless it is short anyhow."""
        if isinstance(term, t.Variable | t.Literal | t.EnumValue) or (
            isinstance(term, t.Widen | t.Negative | t.Not) and isinstance(term.children[0], t.Variable)
        ):
            return term
        name = self.fresh(hint, INTEGER if term.sort == NATURAL else term.sort)
        self.facts.append(equation(name, term))
        return name

    def check(self, state: State, goal: t.Term, what: str, line: int, candidate: Candidate | None = None) -> None:
        if goal != t.TRUE:
            self.checks.append(Check(len(self.facts), state.path, goal, what, line, candidate))

    # -- the step ----------------------------------------------------------------------------------------

    def whole(self, inputs: Mapping[str, t.Term]) -> None:
        """`inputs` are the names that a step starts with: ``in.x``, ``self.x``; of a sequence ``in.s#`` its length."""
        values = dict(inputs)
        for name, value in self.step.start.items():
            values.setdefault(f"self.{name}", self.constant(value))
        for term in inputs.values():
            if term.sort == REAL:
                self.double(term)
                self._doubles.append(term)
        self._exits.append([])
        self.block(self.step.body, State(t.TRUE, values), top=True)
        self._exits.pop()

    def double(self, term: t.Term) -> None:
        """What is known of any double."""
        if not self.exact:
            self.facts += [finite(term), *gaps(term, self.gaps)]

    def block(self, body: Sequence[program.Statement], state: State, top: bool = False) -> State | None:
        """The state after the statements; None where no path comes there."""
        current: State | None = state
        for statement in body:
            if current is None:
                return None
            current = self.statement(statement, current, top)
        return current

    def statement(self, statement: program.Statement, state: State, top: bool) -> State | None:
        match statement:
            case program.Assign(name=name, value=value):
                found = self.named(name, self.value(value, state))
                state.values[name] = found
                return state
            case program.If(test=test, then=then, otherwise=otherwise):
                condition = self.named("test", self.value(test, state))
                yes = self.block(then, self.split(state, condition), top)
                no = self.block(otherwise, self.split(state, negation(condition)), top)
                return self.meet(yes, no)
            case program.For():
                return self.loop(statement, state, top)
            case program.Give(values=values, line=line):
                given = {name: self.named("result", self.value(v, state)) for name, v in values}
                if top:
                    outputs = {f"out.{name}": term for name, term in given.items()}
                    held = {port: state.values[f"self.{a}"] for port, a in self.step.memory.items()}
                    outputs |= {f"{side}.{port}": term for port, term in held.items() for side in ("out", "memory")}
                    self.ends.append(End(len(self.facts), state.path, outputs, line))
                else:
                    self._exits[-1].append((state, given[""]))
                return None
            case program.Leave(word=word):
                self._left[-1].append((state, word))
                return None

    def split(self, state: State, condition: t.Term) -> State:
        return State(self.named("path", conjunction((state.path, condition))), dict(state.values))

    def meet(self, one: State | None, other: State | None) -> State | None:
        """Where two paths, of which a run takes at most one, come together."""
        if one is None or other is None:
            return one or other
        values: dict[str, t.Term] = {}
        for name in one.values.keys() & other.values.keys():
            a, b = one.values[name], other.values[name]
            values[name] = a if a == b else self.named(name, t.Conditional(one.path, a, b, wider(a.sort, b.sort)))
        return State(self.named("path", disjunction((one.path, other.path))), values)

    # -- loops -------------------------------------------------------------------------------------------

    def loop(self, loop: program.For, state: State, top: bool) -> State | None:
        if isinstance(loop.count, program.Extreme) and all(
            isinstance(item, program.Const) for item in loop.count.items
        ):
            turns = max(int(item.value) for item in loop.count.items if isinstance(item, program.Const))
            if turns <= UNROLLED:
                return self.unrolled(loop, turns, state, top)
        count = self.named("count", self.value(loop.count, state))
        names = set(assigned(loop.body))
        carried = tuple(sorted(name for name in names if name in state.values))
        entry = dict(state.values)
        first = Turn(entry, ZERO, entry, loop, carried)
        self.loops.append((loop, first))
        own: list[Candidate] = []
        for candidate in (c for c in self.candidates if c.loop == loop.counter):
            goal = candidate.build(first)
            if goal is not None:
                own.append(candidate)
                self.check(state, goal, f"at first {candidate.text}", loop.line, candidate)
        head = dict(state.values)
        for name in carried:
            head[name] = self.fresh(name, widest(head[name].sort))
        done = self.fresh("done", INTEGER)
        at = Turn(head, done, entry, loop, carried)
        assumed: list[t.Term] = [t.Compare("<=", ZERO, done), t.Compare("<=", done, count)]
        before = len(self.facts)
        for name in carried:
            if head[name].sort == REAL:
                self.double(head[name])
        assumed += [goal for c in own if (goal := c.build(at)) is not None]
        doubles, self.facts[before:] = self.facts[before:], []
        self.facts += [t.Implies(state.path, fact) for fact in (*assumed, *doubles)]
        # where no turn is left to be done
        over = self.split(State(state.path, head), t.Compare("==", done, count))
        over.values = {name: over.values[name] for name in state.values}
        turn = self.split(State(state.path, head), t.Compare("<", done, count))
        turn.values[loop.counter] = done
        self._left.append([])
        end = self.block(loop.body, turn, top)
        leaving = self._left.pop()
        for gone, word in (*leaving, *(((end, "continue"),) if end is not None else ())):
            if word == "continue":
                after = Turn(gone.values, plus(done, 1), entry, loop, carried)
                for candidate in own:
                    goal = candidate.build(after) or t.FALSE
                    self.check(gone, goal, f"each turn keeps {candidate.text}", loop.line, candidate)
        result: State | None = over
        for gone, word in leaving:
            if word == "break":
                gone.values = {name: gone.values[name] for name in state.values}
                result = self.meet(result, gone)
        return result

    def unrolled(self, loop: program.For, turns: int, state: State, top: bool) -> State | None:
        """A loop whose turns are counted in the text: one after the other."""
        names = tuple(state.values)
        current: State | None = state
        broken: State | None = None
        for k in range(turns):
            if current is None:
                break
            current.values[loop.counter] = t.Literal(k, INTEGER)
            self._left.append([])
            current = self.block(loop.body, current, top)
            for gone, word in self._left.pop():
                if word == "continue":
                    current = self.meet(current, gone)
                else:
                    broken = self.meet(broken, gone)
        result = self.meet(current, broken)
        if result is not None:
            result.values = {name: result.values[name] for name in names}
        return result

    # -- expressions -------------------------------------------------------------------------------------

    def constant(self, value: bool | int | float | str) -> t.Term:
        match value:
            case bool():
                return t.Literal(value, BOOL)
            case int():
                return t.Literal(value, INTEGER)
            case float():
                return t.Literal(Fraction(value), REAL)
            case str():
                return t.EnumValue(value, self.sorts[value])

    def value(self, expression: Expr, state: State) -> t.Term:
        match expression:
            case program.Const(value=value):
                return self.constant(value)
            case program.Name(name=name):
                return state.values[name]
            case program.Convert(body=body, line=line):
                return self.rounded(t.Widen(self.value(body, state), REAL), (), False, state, line)
            case program.Unary(operator="-", body=body):
                term = self.value(body, state)
                return t.Negative(term, INTEGER if term.sort == NATURAL else term.sort)
            case program.Unary(operator="abs", body=body):
                term = self.named("value", self.value(body, state))
                return t.Conditional(t.Compare("<", term, zero(term)), t.Negative(term, term.sort), term, term.sort)
            case program.Unary(body=body):
                return negation(self.value(body, state))
            case program.Binary():
                return self.arithmetic(expression, state)
            case program.Comparison(operator=operator, left=left, right=right):
                one, other = self.value(left, state), self.value(right, state)
                return self.compared(operator, one, other)
            case program.Junction(operator=operator, items=items):
                return self.junction(operator, items, state)
            case program.Choice(test=test, then=then, otherwise=otherwise):
                condition = self.named("test", self.value(test, state))
                yes = self.value(then, self.split(state, condition))
                no = self.value(otherwise, self.split(state, negation(condition)))
                return t.Conditional(condition, yes, no, wider(yes.sort, no.sort))
            case program.Extreme(operator=operator, items=items):
                found = [self.named("value", self.value(item, state)) for item in items]
                best = found[0]
                for item in found[1:]:
                    nearer = t.Compare("<" if operator == "min" else ">", item, best)
                    best = self.named(operator, t.Conditional(nearer, item, best, wider(item.sort, best.sort)))
                return best
            case program.Length(view=view):
                whole = state.values[f"in.{view.sequence}#"]
                if view.stop is not None:
                    stop = t.Literal(view.stop, INTEGER)
                    whole = t.Conditional(t.Compare("<", whole, stop), whole, stop, INTEGER)
                if not view.start:
                    return whole
                rest = self.named("rest", t.Arithmetic("-", whole, t.Literal(view.start, INTEGER), INTEGER))
                return t.Conditional(t.Compare("<", rest, ZERO), ZERO, rest, INTEGER)
            case program.Item(view=view, index=index, line=line):
                at = self.named("index", self.value(index, state))
                size = self.value(program.Length(view), state)
                inside = conjunction((t.Compare("<=", ZERO, at), t.Compare("<", at, size)))
                self.check(state, inside, "the index lies in the sequence", line)
                place = t.Arithmetic("+", t.Literal(view.start, INTEGER), at, INTEGER) if view.start else at
                elements = state.values[f"in.{view.sequence}"]
                assert isinstance(elements.sort, FunctionSort)
                item = self.named("item", t.Apply(elements, (place,), elements.sort.result))
                before = len(self.facts)
                if item.sort == REAL:
                    self.double(item)
                if elements.sort.result == NATURAL:
                    self.facts.append(t.Compare(">=", item, ZERO))
                self.facts[before:] = [t.Implies(inside, fact) for fact in self.facts[before:]]
                return item
            case program.Inlined(body=body):
                return self.inlined(body, state)

    def inlined(self, body: Sequence[program.Statement], state: State) -> t.Term:
        self._exits.append([])
        inside = State(state.path, dict(state.values))
        self.block(body, inside)
        exits = self._exits.pop()
        found, result = exits[0]
        assert result is not None
        for other, value in exits[1:]:
            assert value is not None
            result = (
                result
                if result == value
                else self.named("result", t.Conditional(found.path, result, value, wider(result.sort, value.sort)))
            )
            met = self.meet(found, other)
            assert met is not None
            found = met
        # its own names are gone; every path of it comes back, so that the caller's path is what it was
        state.values.update({name: found.values[name] for name in state.values if name in found.values})
        return result

    def junction(self, operator: str, items: Sequence[Expr], state: State) -> t.Term:
        """Cut short: an item is only looked at where those before it do not decide."""
        found: list[t.Term] = []
        current = state
        for item in items:
            term = self.named("truth", self.value(item, current))
            found.append(term)
            current = self.split(current, term if operator == "and" else negation(term))
        return conjunction(found) if operator == "and" else disjunction(found)

    def compared(self, operator: str, one: t.Term, other: t.Term) -> t.Term:
        if one.sort == BOOL:
            alike = t.Iff(one, other)
            return alike if operator == "==" else t.Not(alike)
        if one.sort != other.sort and REAL in (one.sort, other.sort):
            one, other = (term if term.sort == REAL else t.Widen(term, REAL) for term in (one, other))
        return t.Compare(operator, one, other)

    def arithmetic(self, expression: program.Binary, state: State) -> t.Term:
        one = self.named("left", self.value(expression.left, state))
        other = self.named("right", self.value(expression.right, state))
        operator, line = expression.operator, expression.line
        if operator in ("//", "%"):
            return self.floored(operator, one, other, state, line)
        if operator == "/":
            self.check(state, t.Compare("!=", other, zero(other)), "the divisor is not zero", line)
            doubles = (one, other) if one.sort == REAL else ()
            one, other = (term if term.sort == REAL else t.Widen(term, REAL) for term in (one, other))
            if isinstance(other, t.Literal) and other.value:
                inverse = t.Literal(1 / Fraction(other.value), REAL)
                quotient: t.Term = t.Arithmetic("*", one, inverse, REAL)
            else:
                quotient = self.fresh("quotient", REAL)
                product = t.Arithmetic("*", quotient, other, REAL)
                self.facts.append(t.Implies(t.Compare("!=", other, zero(other)), t.Compare("==", product, one)))
            return self.rounded(quotient, doubles, True, state, line)
        whole = one.sort != REAL
        exact = t.Arithmetic(operator, one, other, INTEGER if whole else REAL)
        return exact if whole else self.rounded(exact, (one, other), operator == "*", state, line)

    def floored(self, operator: str, one: t.Term, other: t.Term, state: State, line: int) -> t.Term:
        """``//`` and ``%`` of ints: the quotient is rounded down, the remainder has the divisor's sign
        (https://docs.python.org/3/reference/expressions.html#binary-arithmetic-operations)."""
        self.check(state, t.Compare("!=", other, ZERO), "the divisor is not zero", line)
        quotient, rest = self.fresh("floored", INTEGER), self.fresh("remainder", INTEGER)
        whole = t.Arithmetic("+", t.Arithmetic("*", quotient, other, INTEGER), rest, INTEGER)
        above = conjunction((t.Compare("<=", ZERO, rest), t.Compare("<", rest, other)))
        below = conjunction((t.Compare("<", other, rest), t.Compare("<=", rest, ZERO)))
        self.facts += [
            t.Implies(t.Compare("!=", other, ZERO), t.Compare("==", one, whole)),
            t.Implies(t.Compare("<", ZERO, other), above),
            t.Implies(t.Compare("<", other, ZERO), below),
        ]
        return quotient if operator == "//" else rest

    def rounded(self, exact: t.Term, doubles: Sequence[t.Term], products: bool, state: State, line: int) -> t.Term:
        """The double next to an exact result, and the condition that there is one."""
        self.rounds.append(line)
        if self.exact:
            return exact
        exact = self.named("exact", exact)
        self.check(state, no_overflow(exact), "the result is no infinity", line)
        result = self.fresh("rounded", REAL)
        variables = [term for term in (*doubles, *self._doubles[:BESIDE]) if not isinstance(term, t.Literal)]
        self.facts.append(rounded(result, exact, products=products, beside=variables, at=self.thresholds))
        self.facts += gaps(result, self.gaps)
        return result


def zero(term: t.Term) -> t.Literal:
    return t.Literal(Fraction(0), REAL) if term.sort == REAL else ZERO


def plus(term: t.Term, more: t.Term | int) -> t.Term:
    if isinstance(more, int):
        return term if more == 0 else t.Arithmetic("+", term, t.Literal(more, INTEGER), INTEGER)
    return t.Arithmetic("+", term, more, INTEGER)


def wider(one: Sort, other: Sort) -> Sort:
    return INTEGER if {one, other} == {INTEGER, NATURAL} else one


def widest(sort: Sort) -> Sort:
    return INTEGER if sort == NATURAL else sort

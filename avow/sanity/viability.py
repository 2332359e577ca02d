"""Realizability of a contract with state variables: can the node keep its guarantees for ever, for all allowed inputs?

A state (memory) is viable if every allowed input has an output that meets the guarantees and leads to a viable state:
the greatest such set. With finitely many inputs, outputs and states, a game over all reachable states is solved;
otherwise the set is approximated from above by quantifier elimination. The results are not trusted: separate solver
queries check that a set is closed and contains the first state, or that an input leads out of it for every output.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

from avow.base.optional import complete
from avow.base.tuning.bounds import (
    AHEAD_SIZE,
    GAME_ANSWERS,
    GAME_MEMORIES,
    INPUTS_AHEAD,
    VIABILITY_ROUNDS,
)
from avow.base.tuning.effort import DEFEAT_EFFORT, REALIZABLE_SHARE
from avow.base.verdict import Counterexample, Verdict
from avow.evaluation.compiler import combinations
from avow.evaluation.evaluate import NotEvaluable, compile_term, finite_values
from avow.evaluation.running import Keeper
from avow.formulas.formula import conjunction, disjunction, equation, free_variables, negation, substitute
from avow.formulas.temporal.cell import Cell
from avow.formulas.temporal.cells import Remembering
from avow.formulas.temporal.clock import one_step
from avow.formulas.traversal import transform
from avow.formulas.values import Value, show
from avow.formulas.written import value_term
from avow.language.contract import ClauseKind, Node, Port
from avow.language.sorts import Sort, TupleSort
from avow.language.subterms import subterms, timed
from avow.language.terms import FALSE, TRUE, Apply, Conditional, Implies, Quantified, Quantifier, Role, Term, Variable
from avow.sanity.realizability import realizable
from avow.solving.limits import budget
from avow.solving.quantifier_elimination import ELIMINABLE, eliminable, eliminated
from avow.solving.questions import entails, solve
from avow.solving.second import CONTRADICTED, contradicted
from avow.solving.translation import same_session

_Memory = tuple[Value, ...]
_Move = tuple[Mapping[str, Value], tuple[tuple[Mapping[str, Value], _Memory], ...]]
"""An allowed input, and the outputs that meet the guarantees, each with the memory after it."""


@dataclass(frozen=True, slots=True)
class Viability:
    """Whether the node can continue for ever, and if not, the environment's moves up to a step without an output."""

    verdict: Verdict
    reason: str = ""
    run: Counterexample | None = None
    clauses: tuple[str, ...] = ()
    """The guarantees that conflict, if known."""
    reachable: Term | None = None
    """The memories that runs that keep the contract can reach; None if unknown."""
    lasting: Term | None = None
    """The memories that such runs can reach and continue from for ever; None if unknown."""


@dataclass(frozen=True, slots=True)
class Contract:
    """The node's contract over one step, with its memory before and after."""

    remembering: Remembering
    effort: int = 10_000
    seed: int = 0

    @property
    def inputs(self) -> tuple[Variable, ...]:
        return tuple(port.variable for port in self.remembering.node.inputs)

    @property
    def outputs(self) -> tuple[Variable, ...]:
        return tuple(port.variable for port in self.remembering.node.outputs)

    @property
    def assumed(self) -> Mapping[str, Term]:
        return {clause.name: clause.formula for clause in self.remembering.node.assumptions}

    @property
    def promised(self) -> Mapping[str, Term]:
        return {clause.name: clause.formula for clause in self.remembering.node.guarantees}

    def divided(self) -> tuple[list[Term], Contract]:
        """The assumptions on inputs that nothing else depends on, and the contract without these: it only matters
        whether they can be met."""
        node, cells = self.remembering.node, self.remembering.cells
        known = {v for g in self.promised.values() for v in free_variables(g)}
        known = known.union(*(free_variables(cell.now) for cell in cells), (cell.before for cell in cells))
        growing = True
        while growing:
            more = [free_variables(a) for a in self.assumed.values() if free_variables(a) & known]
            growing = not set().union(*more) <= known
            known = known.union(*more)
        apart = [a for a in node.assumptions if not free_variables(a.formula) & known]
        inputs = tuple(port for port in node.inputs if port.variable in known)
        rest = replace(node, inputs=inputs, assumptions=tuple(a for a in node.assumptions if a not in apart))
        return [a.formula for a in apart], replace(self, remembering=replace(self.remembering, node=rest))

    @property
    def first(self) -> Mapping[Variable, Term]:
        return {cell.before: cell.initial for cell in self.remembering.cells if cell.initial is not None}

    def after(self, region: Term) -> Term:
        """The formula that the memory after a step is in a region."""
        return substitute(region, {cell.before: cell.now for cell in self.remembering.cells})

    def at_first(self, region: Term) -> Term:
        return substitute(region, self.first)

    def asked_again(self, impossible: Sequence[Term]) -> None:
        """Check with cvc5, if installed, the formulas that Z3 found unsatisfiable. Raises Contradicted."""
        if contradicted(impossible, effort=self.effort):
            raise Contradicted

    def closed(self, region: Term) -> bool:
        """Whether the solver shows that from each memory of a region every allowed input has an output that stays in
        it, and that the first memory is in it."""
        begins = solve([negation(self.at_first(region))], effort=self.effort, seed=self.seed, values="unused")
        if region != TRUE and begins.status != "unsat":
            return False
        wanted = self.promised if region == TRUE else {**self.promised, "memory": self.after(region)}
        known = self.assumed if region == TRUE else {**self.assumed, "memory": region}
        inputs = (*self.remembering.before, *self.inputs)
        few = combinations([v.sort for v in self.outputs], most=GAME_ANSWERS)
        if few is not None:
            whole = conjunction(wanted.values())
            choices = ({v: value_term(x, v.sort) for v, x in zip(self.outputs, some, strict=True)} for some in few)
            none = [*known.values(), *(negation(substitute(whole, choice)) for choice in choices)]
            if solve(none, effort=self.effort, seed=self.seed, values="unused").status != "unsat":
                return False
            self.asked_again([conjunction(none)])
            return True
        answer = realizable(inputs, self.outputs, known, wanted, effort=self.effort, seed=self.seed)
        return answer.verdict is Verdict.PROVED


def told_apart(remembering: Remembering) -> Remembering:
    """The same contract with a cell for each value of a quantified variable, if these are few: a game cannot have a
    function as a cell. All cells stay as they are if one has too many values."""
    kept: list[Cell] = []
    parts: dict[Variable, list[tuple[tuple[Term, ...], Variable]]] = {}
    for cell in remembering.cells:
        if not cell.parameters:
            kept.append(cell)
            continue
        values = [finite_values(v.sort) for v in cell.parameters]
        few = [[value_term(x, v.sort) for x in some] for v, some in zip(cell.parameters, values, strict=True) if some]
        if len(few) < len(values) or len(kept) + math.prod(map(len, few)) > GAME_MEMORIES:
            return remembering
        parts[cell.before] = []
        for number, place in enumerate(product(*few)):
            here = dict(zip(cell.parameters, place, strict=True))
            before = Variable(Role.INPUT, f"{cell.name} {number}", cell.now.sort)
            parts[cell.before].append((place, before))
            initial = None if cell.initial is None else substitute(cell.initial, here)
            kept.append(replace(cell, before=before, parameters=(), initial=initial, now=substitute(cell.now, here)))

    def read(term: Term) -> Term:
        if not isinstance(term, Apply) or not isinstance(term.function, Variable) or term.function not in parts:
            return term
        (_, found), *others = parts[term.function]
        chosen: Term = found
        for place, cell in others:
            there = conjunction(map(equation, term.arguments, place))
            chosen = Conditional(there, cell, chosen, cell.sort)
        return chosen

    if not parts:
        return remembering
    node = remembering.node
    assumptions = tuple(replace(c, formula=transform(c.formula, read)) for c in node.assumptions)
    guarantees = tuple(replace(c, formula=transform(c.formula, read)) for c in node.guarantees)
    cells = tuple(
        replace(c, now=transform(c.now, read), initial=None if c.initial is None else transform(c.initial, read))
        for c in kept
    )
    return replace(remembering, node=replace(node, assumptions=assumptions, guarantees=guarantees), cells=cells)


class Contradicted(Exception):  # noqa: N818 - it says what happened
    """cvc5 and Z3 give opposite answers."""


@same_session()
def viable(remembering: Remembering, *, effort: int = 10_000, seed: int = 0) -> Viability:
    """Decides viability as far as possible."""
    remembering = told_apart(remembering)
    if remembering.unsaid:
        name, why = next(iter(remembering.unsaid.items()))
        return Viability(Verdict.UNKNOWN, f"{name} speaks of {why.reason}")
    if any(cell.initial is None for cell in remembering.cells):
        return Viability(Verdict.UNKNOWN, "a value of an unspecified type is remembered")
    contract = Contract(remembering, effort, seed)
    if any(v in free_variables(f) for f in contract.assumed.values() for v in contract.outputs):
        return Viability(Verdict.UNKNOWN, "an assumption speaks of an output at the same step")
    apart, about = contract.divided()
    try:
        with budget(effort * REALIZABLE_SHARE):
            found = _decided(about)
        if found.verdict is Verdict.PROVED or not apart:
            return found
        match solve(apart, effort=effort, seed=seed, values="unused").status:
            case "sat":
                return found
            case "unsat":
                contract.asked_again([conjunction(apart)])
                return Viability(Verdict.PROVED, "no input is allowed at any step")
            case _:  # undecided
                return Viability(Verdict.UNKNOWN, "whether its assumptions can be met is open")
    except Contradicted:
        return Viability(Verdict.ERROR, CONTRADICTED)


def lasting(node: Node, *, effort: int = 10_000, seed: int = 0) -> Viability:
    """Whether there are inputs, step by step for ever, that satisfy a node's assumptions: decided as viability of a
    node with these inputs as outputs and the assumptions as guarantees, at the node's pace if the assumptions depend on
    time."""
    in_time = any(timed(c.formula) for c in node.assumptions)
    made = one_step(replace(node, guarantees=tuple(c for c in node.guarantees if in_time and c.pace is not None)))
    ports = (*made.node.inputs, *made.node.outputs)
    given = {p.variable: Variable(Role.OUTPUT, p.variable.qualified, p.sort) for p in ports}
    promised = tuple(
        replace(c, kind=ClauseKind.GUARANTEE, formula=substitute(c.formula, given)) for c in made.node.assumptions
    )
    outputs = tuple(Port(Role.OUTPUT, v.name, v.sort, str(v.sort)) for v in given.values())
    world = replace(made.node, inputs=(), outputs=outputs, assumptions=(), guarantees=promised)
    cells = tuple(replace(cell, now=substitute(cell.now, given)) for cell in made.cells)
    return viable(replace(made, node=world, cells=cells), effort=effort, seed=seed)


def _decided(contract: Contract) -> Viability:
    if any(cell.parameters for cell in contract.remembering.cells):  # no term denotes such a memory
        if contract.closed(TRUE):
            return Viability(Verdict.PROVED, "whatever was before")
        return Viability(Verdict.UNKNOWN, "something is remembered for each value of a quantified variable")
    game = _Game(contract)
    if game.explored() and (played := game.answer()).verdict is not Verdict.UNKNOWN:
        return played
    if contract.closed(TRUE):
        return Viability(Verdict.PROVED, "whatever was before")
    found = _defeated(contract, 1) or _approached(contract)
    if found.verdict is Verdict.PROVED or (found.run is not None and found.run.trace):
        return found
    defeats = (_defeated(contract, length) for length in range(2, INPUTS_AHEAD + 1))
    return next(filter(None, defeats), found)


@dataclass(slots=True)
class _Game:
    """The game over all reachable memories, if these are finite and few."""

    contract: Contract
    moves: dict[_Memory, list[_Move]] = field(default_factory=dict)
    first: _Memory = ()
    lost: dict[_Memory, tuple[int, _Move]] = field(default_factory=dict)
    """A memory from which the environment wins → the round in which this was found, and its move."""

    def explored(self) -> bool:
        remembering = self.contract.remembering
        ports = (*self.contract.inputs, *self.contract.outputs)
        values = complete(finite_values(v.sort) for v in ports)
        if values is None or math.prod(map(len, values)) > GAME_ANSWERS:
            return False
        count = len(self.contract.inputs)
        try:
            keeper = Keeper(remembering.cells)
            assumed = [compile_term(f) for f in self.contract.assumed.values()]
            promised = [compile_term(f) for f in self.contract.promised.values()]
            names = [v.qualified for v in remembering.before]
            self.first = tuple(keeper.memory[name] for name in names)
            waiting = [self.first]
            while waiting:
                memory = waiting.pop()
                if memory in self.moves:
                    continue
                if len(self.moves) >= GAME_MEMORIES:
                    return False
                self.moves[memory] = []
                before = dict(zip(names, memory, strict=True))
                for given in product(*values[:count]):
                    inputs = {v.qualified: x for v, x in zip(ports, given, strict=False)}
                    answers: list[tuple[Mapping[str, Value], _Memory]] = []
                    known = True
                    for number, answer in enumerate(product(*values[count:])):
                        outputs = {v.qualified: x for v, x in zip(ports[count:], answer, strict=True)}
                        at = {**before, **inputs, **outputs}
                        if not number and not all(holds(at) for holds in assumed):
                            known = False
                            break
                        if all(holds(at) for holds in promised):
                            keeper.memory = before
                            keeper.advance({**inputs, **outputs})
                            answers.append((outputs, tuple(keeper.memory[name] for name in names)))
                    if known:
                        self.moves[memory].append((inputs, tuple(answers)))
                        waiting += [left for _, left in answers]
        except (NotEvaluable, KeyError):
            return False
        return True

    def answer(self) -> Viability:
        self._lose()
        reachable = self.region(self.moves)
        if self.first not in self.lost:
            won = [memory for memory in self.moves if memory not in self.lost]
            if self.contract.closed(self.region(won)):
                return Viability(Verdict.PROVED, reachable=reachable, lasting=self.region(self._lasting()))
            return Viability(Verdict.UNKNOWN, "a strategy was found, but the solver does not confirm it")
        if not self._confirmed():
            return Viability(Verdict.UNKNOWN, "the environment wins, but the solver does not confirm it")
        return Viability(Verdict.REFUTED, run=self._run(), reachable=reachable)

    def _lasting(self) -> list[_Memory]:
        """The memories reached by outputs after which the node can continue for all inputs."""
        found = {self.first: None}
        for memory in (waiting := [self.first]):
            left = {after: None for _, answers in self.moves[memory] for _, after in answers if after not in self.lost}
            waiting += [after for after in left if after not in found]
            found |= left
        return list(found)

    def _lose(self) -> None:
        rounds, growing = 0, True
        while growing:
            rounds += 1
            found = {
                memory: (rounds, move)
                for memory, moves in self.moves.items()
                if memory not in self.lost
                for move in moves
                if all(left in self.lost for _, left in move[1])
            }
            self.lost |= found
            growing = bool(found)

    def region(self, memories: Sequence[_Memory] | Mapping[_Memory, object]) -> Term:
        return disjunction(map(self.at, memories))

    def at(self, memory: _Memory) -> Term:
        cells = self.contract.remembering.before
        return conjunction(equation(v, value_term(x, v.sort)) for v, x in zip(cells, memory, strict=True))

    def _confirmed(self) -> bool:
        """Whether the solver shows, for each memory that the environment's moves lead to, that no output leads out."""
        asked, waiting, none = set[_Memory](), [self.first], list[Term]()
        contract = self.contract
        while waiting:
            memory = waiting.pop()
            if memory in asked:
                continue
            asked.add(memory)
            rounds, (inputs, answers) = self.lost[memory]
            given = [equation(v, value_term(inputs[v.qualified], v.sort)) for v in contract.inputs]
            place = [self.at(memory), *given]
            allowed = solve([*place, *contract.assumed.values()], effort=contract.effort, values="unused")
            lower = self.region([m for m, (at, _) in self.lost.items() if at < rounds])
            out = [*place, *contract.promised.values(), negation(contract.after(lower))]
            escapes = solve(out, effort=contract.effort, values="unused")
            if allowed.status != "sat" or escapes.status != "unsat":
                return False
            none.append(conjunction(out))
            waiting += [left for _, left in answers]
        contract.asked_again(none)
        return True

    def _run(self) -> Counterexample:
        steps: list[tuple[tuple[str, str], ...]] = []
        memory = self.first
        while True:
            _, (inputs, answers) = self.lost[memory]
            shown = tuple((name, show(value)) for name, value in inputs.items())
            if not answers:
                explanation = f"after these inputs no output meets the guarantees at step {len(steps) + 1}"
                return Counterexample(shown, explanation, (*steps, shown))
            outputs, memory = max(answers, key=lambda answer: self.lost[answer[1]][0])
            steps.append((*shown, *((name, show(value)) for name, value in outputs.items())))


def _defeated(contract: Contract, length: int) -> Viability | None:
    """A refutation by inputs for the first `length` steps, chosen in advance: these steps are treated as one, with the
    outputs of all. None if there are no such inputs, or none are found."""

    def at(variable: Variable, step: int) -> Variable:
        return Variable(variable.role, f"{variable.name} at {step}", variable.sort)

    memory = dict(contract.first)
    known, wanted = dict[str, Term](), dict[str, Term]()
    for step in range(1, length + 1):
        here: dict[Variable, Term] = {**memory, **{v: at(v, step) for v in (*contract.inputs, *contract.outputs)}}
        known |= {f"{label} at {step}": substitute(f, here) for label, f in contract.assumed.items()}
        wanted |= {f"{label} at {step}": substitute(f, here) for label, f in contract.promised.items()}
        memory = {cell.before: substitute(cell.now, here) for cell in contract.remembering.cells}
    inputs = [at(v, step) for step in range(1, length + 1) for v in contract.inputs]
    outputs = [at(v, step) for step in range(1, length + 1) for v in contract.outputs]
    if any(v in outputs for f in known.values() for v in free_variables(f)):
        return None  # whether an input is allowed depends on the outputs
    if not all(_plain(v.sort) for v in inputs):
        return None
    if sum(1 for f in wanted.values() for _ in subterms(f)) > AHEAD_SIZE:
        return None
    effort = min(contract.effort, DEFEAT_EFFORT)
    answer = realizable(inputs, outputs, known, wanted, effort=effort, seed=contract.seed, doubtful=True)
    if answer.verdict is not Verdict.REFUTED:
        return None
    given = {v: value_term(answer.inputs[v], v.sort) for v in inputs if v in answer.inputs}  # otherwise: any value
    left = {label: substitute(f, given) for label, f in wanted.items()}
    conflict = solve(left, effort=contract.effort, seed=contract.seed, values="unused")
    if conflict.status != "unsat":
        return None
    contract.asked_again([conjunction(left.values())])
    names = tuple(c.name for c in contract.remembering.node.guarantees)
    clauses = tuple(name for name in names if any(label.rpartition(" at ")[0] == name for label in conflict.core))
    run = tuple(
        tuple((v.qualified, show(answer.inputs[x])) for v in contract.inputs if (x := at(v, step)) in answer.inputs)
        for step in range(1, length + 1)
    )
    explanation = f"{'with these inputs ' if contract.inputs else ''}no outputs meet {' and '.join(clauses)} at "
    explanation += "the first step" if length == 1 else f"each of the first {length} steps"
    return Viability(Verdict.REFUTED, run=Counterexample(run[-1], explanation, run), clauses=clauses)


def steps_of(number: int) -> str:
    """A number of steps in words."""
    return "a step" if number == 1 else f"{number} steps"


def _plain(sort: Sort) -> bool:
    return isinstance(sort, ELIMINABLE) or (isinstance(sort, TupleSort) and all(map(_plain, sort.items)))


def _approached(contract: Contract) -> Viability:
    """Decides viability by quantifier elimination, round by round."""
    unknown = Viability(Verdict.UNKNOWN, "which memories are viable could not be worked out")
    region: Term = TRUE
    some = {v: Variable(Role.BOUND, f"some {v.name}", v.sort) for v in contract.outputs}
    every = {v: Variable(Role.BOUND, f"any {v.name}", v.sort) for v in contract.inputs}
    for number in range(1, VIABILITY_ROUNDS + 1):
        met = conjunction((*contract.promised.values(), contract.after(region)))
        answered = Quantified(Quantifier.EXISTS, tuple(some.values()), substitute(met, some)) if some else met
        asked = substitute(Implies(conjunction(contract.assumed.values()), answered), every)
        exact = Quantified(Quantifier.FORALL, tuple(every.values()), asked) if every else asked
        if not eliminable(exact):
            return unknown
        found = eliminated(exact)
        if found is None:
            return unknown
        # the elimination counts only if the solver shows that both are equivalent
        for one, other in ((found, exact), (exact, found)):
            if entails([one], other, effort=contract.effort, seed=contract.seed).verdict is not Verdict.PROVED:
                return unknown
        following = conjunction((region, found))
        if solve([contract.at_first(following)], effort=contract.effort, values="unused").status == "unsat":
            why = f"the environment can bring it to where no output meets the guarantees, within {steps_of(number)}"
            return Viability(Verdict.REFUTED, why, Counterexample(explanation=why))
        if entails([region], following, effort=contract.effort, seed=contract.seed).verdict is Verdict.PROVED:
            return Viability(Verdict.PROVED) if contract.closed(region) else unknown
        region = following
        if region == FALSE:
            return unknown
    return unknown

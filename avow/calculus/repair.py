"""Repairs: if an entailment between contracts fails, a clause that would make it hold.

The search looks for a further guarantee of a provider (over its own ports), a further assumption about the
environment's inputs, and, at the first step, a condition on an initial value. Each is the weakest one, found by
quantifier elimination if the formulas allow it (`avow.solving.quantifier_elimination`), or by trying all values if they
are few. Otherwise a place whose ports cover all variables of the goal gets the goal itself. Each offer is checked: it
makes the goal provable, it does not contradict the other hypotheses, and no guarantee is offered that its node could
not keep. The search is bounded in steps, so a missing offer means nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product

from avow.base.records import dataclass
from avow.base.tuning.bounds import OFFER_HYPOTHESES, OFFER_LENGTH, OFFER_PLACES, VALUES_TRIED
from avow.base.tuning.effort import OFFER_STEP_EFFORT, OFFER_WRITING_STEPS, OFFERS_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.variables import Frame
from avow.evaluation.evaluate import finite_values
from avow.formulas.formula import conjunction, disjunction, free_variables, substitute
from avow.formulas.temporal.cell import CELL
from avow.formulas.written import value_term
from avow.language import terms as t
from avow.language.operators import OPPOSITE
from avow.language.printer import show_term
from avow.language.sorts import SetSort
from avow.language.subterms import subterms
from avow.solving.limits import spend, spent, until
from avow.solving.quantifier_elimination import eliminable, remedy
from avow.solving.questions import entails, solve
from avow.system.plan import Endpoint


@dataclass(frozen=True, slots=True)
class Place:
    """A place where a clause might be added. `ports`: variables of the query → their names in a clause there."""

    kind: str
    """``guarantee`` of a node, ``environment`` assumption, or ``initial`` value of ``node.port``."""
    of: str
    ports: Mapping[t.Variable, t.Variable]
    without: str = ""
    """The label of a hypothesis that the clause would replace."""


@dataclass(frozen=True, slots=True)
class Offer:
    """A clause that would make the goal hold."""

    kind: str
    of: str
    formula: t.Term
    weakest: bool

    @property
    def clause(self) -> str:
        """The clause in RCL; for an initial value, the formula alone, as in the plan."""
        word = {"guarantee": "guarantee ", "environment": "assume "}.get(self.kind, "")
        shown = show_term(self.formula, "rcl")
        return f"{word}( {shown} )" if word else shown

    @property
    def text(self) -> str:
        """Continues "it would hold if …"."""
        shown = show_term(self.formula, "rcl")
        match self.kind:
            case "guarantee":
                return f"{self.of} also had guarantee ( {shown} )"
            case "environment":
                return f"of the environment it were also assumed that ( {shown} )"
            case _:  # initial
                return f"the first value of {self.of} met ( {shown} )"

    def data(self, when: str = "") -> dict[str, object]:
        """The offer as an entry of an outcome's details."""
        found: dict[str, object] = {"kind": self.kind, "of": self.of, "clause": self.clause, "weakest": self.weakest}
        return found | ({"when": when} if when else {})


def offers(frame: Frame, hypotheses: Mapping[str, t.Term], goal: t.Term, places: Iterable[Place]) -> tuple[Offer, ...]:
    """Clauses that would make the hypotheses imply the goal, at most one offer for each place."""
    end = until(OFFERS_EFFORT)
    found: dict[tuple[str, str], Offer] = {}
    size = sum(1 for term in (goal, *hypotheses.values()) for _ in subterms(term))
    for number, place in enumerate(places):
        if number >= OFFER_PLACES or spent() > end:
            break
        spend(size * OFFER_WRITING_STEPS)
        known = {label: term for label, term in hypotheses.items() if label != place.without}
        offer = _offer(frame, known, goal, place)
        if offer is not None and len(offer.clause) <= OFFER_LENGTH:
            found.setdefault((offer.of, offer.clause), offer)
    return tuple(found.values())


def _offer(frame: Frame, known: Mapping[str, t.Term], goal: t.Term, place: Place) -> Offer | None:
    found = _eliminated(known, goal, place)
    if found is None or not found[1] or any(isinstance(part, t.Conditional) for part in subterms(found[0])):
        # If elimination fails, succeeds only without some hypothesis, or writes `if`: try every value, if they are few.
        tried = _enumerated(known, goal, tuple(place.ports), OFFER_STEP_EFFORT)
        found = tried if tried is not None and (tried[1] or found is None) else found
    if found is None:
        return None
    formula = substitute(found[0], place.ports)
    if place.kind == "guarantee" and not _may_be_kept(frame, place.of, formula):
        return None
    return Offer(place.kind, place.of, formula, found[1])


def _eliminated(known: Mapping[str, t.Term], goal: t.Term, place: Place) -> tuple[t.Term, bool] | None:
    """A condition found by quantifier elimination, otherwise the goal itself if the place's ports cover its variables;
    and whether it is the weakest."""
    usable = {label: term for label, term in known.items() if eliminable(term)}
    assumption: t.Term | None = None
    weakest = False
    if eliminable(goal) and len(usable) <= OFFER_HYPOTHESES:
        remedied = remedy(usable, goal, place.ports, effort=OFFER_STEP_EFFORT)
        if remedied is not None:
            assumption, weakest = _tidy(remedied.assumption), remedied.weakest and len(usable) == len(known)
    sufficient = assumption is None and free_variables(goal) <= frozenset(place.ports)
    if sufficient and solve({**known, "the goal": goal}, effort=OFFER_STEP_EFFORT).status == "sat":
        assumption = goal
    if assumption is None or not free_variables(assumption) <= frozenset(place.ports):
        return None
    if len(usable) < len(known) and solve({**known, "offer": assumption}, effort=OFFER_STEP_EFFORT).status == "unsat":
        return None
    return assumption, weakest


def _is_whole(value: object) -> bool:
    return not isinstance(value, bool | str) and isinstance(value, int | Fraction) and value == int(value) >= 0


def _tidy(term: t.Term) -> t.Term:
    """Simplifies ``not x >= 1`` to ``x < 1`` and, for an integer, ``k > 2.0`` to ``k > 2``, as left by elimination."""
    match term:
        case t.Not(body=t.Compare(operator=operator, left=left, right=right)):
            return _tidy(t.Compare(OPPOSITE[operator], left, right))
        case t.Compare(left=t.Widen(term=left), right=t.Literal(value=value)) if _is_whole(value):
            return t.Compare(term.operator, left, t.Literal(int(value), left.sort))
        case t.And(items=items):
            return conjunction(map(_tidy, items))
        case t.Or(items=items):
            return disjunction(map(_tidy, items))
    return term


def _may_be_kept(frame: Frame, name: str, further: t.Term) -> bool:
    """False if, for some inputs that the node has to accept, no outputs satisfy its guarantees and the further one."""
    node = frame.node(name)
    meets = conjunction([*(clause.formula for clause in node.guarantees), further])
    outputs = tuple(port.variable for port in node.outputs)
    bound = {v: t.Variable(t.Role.BOUND, f"some {v.name}", v.sort) for v in outputs}
    possible: t.Term = (
        t.Quantified(t.Quantifier.EXISTS, tuple(bound.values()), substitute(meets, bound)) if bound else meets
    )
    accepted = conjunction(clause.formula for clause in node.assumptions) if node.assumptions else t.TRUE
    return entails({}, t.Implies(accepted, possible), effort=OFFER_STEP_EFFORT).verdict is not Verdict.REFUTED


def _enumerated(
    known: Mapping[str, t.Term], goal: t.Term, ports: Sequence[t.Variable], effort: int
) -> tuple[t.Term, bool] | None:
    """A condition on some of the ports that makes the goal follow, and whether it is the weakest. None if there is
    none, or the ports have too many values."""
    spoken = free_variables(goal).union(*map(free_variables, known.values()))
    finite = [(v, values) for v in ports if v in spoken and (values := finite_values(v.sort))]
    # Relations have finitely many values, but each costs a query: only values that can be written as a set are tried.
    if not finite or math.prod(len(values) for _, values in finite) > VALUES_TRIED:
        return None
    good: list[tuple[t.Term, ...]] = []
    bad: list[tuple[t.Term, ...]] = []
    possible = sure = True
    for choice in product(*(values for _, values in finite)):
        terms = tuple(value_term(value, v.sort) for (v, _), value in zip(finite, choice, strict=True))
        given = {v: term for (v, _), term in zip(finite, terms, strict=True)}
        facts = {label: substitute(term, given) for label, term in known.items()}
        verdict = entails(facts, substitute(goal, given), effort=effort).verdict
        (good if verdict is Verdict.PROVED else bad).append(terms)
        sure = sure and verdict is not Verdict.UNKNOWN
    variables = [v for v, _ in finite]
    if not good or not bad:
        return None
    found = t.Not(_one_of(variables, bad)) if len(bad) < len(good) else _one_of(variables, good)
    together = {**known, "the condition": found}
    possible = solve(together, effort=effort).status == "sat"
    if not possible or entails(together, goal, effort=effort).verdict is not Verdict.PROVED:
        return None
    return found, sure and frozenset(variables) >= spoken & frozenset(ports)


def _one_of(variables: Sequence[t.Variable], choices: Sequence[tuple[t.Term, ...]]) -> t.Term:
    if len(variables) == 1:
        [variable] = variables
        options = [option for (option,) in choices]
        if len(options) == 1:
            return t.Compare("==", variable, options[0])
        return t.In(variable, t.SetTerm(tuple(options), SetSort(variable.sort)))
    return disjunction(
        conjunction(t.Compare("==", v, term) for v, term in zip(variables, choice, strict=True)) for choice in choices
    )


# -- places ------------------------------------------------------------------------------------------------------------


def providers(frame: Frame, nodes: Iterable[str], earlier: int = 0) -> Iterator[Place]:
    """Each node's own guarantees, `earlier` steps ago."""
    for name in nodes:
        yield Place("guarantee", name, _called(frame, name, earlier))


def environment(frame: Frame, nodes: Iterable[str], earlier: int = 0) -> Iterator[Place]:
    """The environment inputs of some nodes: each alone, as a plan's entry; then all of one node together."""
    nodes = tuple(nodes)
    ports: dict[t.Variable, tuple[str, t.Variable]] = {}
    for name in nodes:
        for port in frame.node(name).inputs:
            if CELL not in port.name and Endpoint(name, port.name) not in frame.graph.by_target:
                entry = frame.entry(name, port.name)
                ports.setdefault(frame.input(name, port.name, earlier), (entry, port.variable))
    for variable, (entry, called) in ports.items():
        yield Place("environment", entry, {variable: called})
    for name in nodes:
        yield from _together(frame, name, earlier)


def _together(frame: Frame, name: str, earlier: int) -> Iterator[Place]:
    """All environment inputs of one node, under the plan's entry that is read as that node's."""
    outside = [endpoint for endpoint in frame.graph.environment if endpoint.node == name]
    for endpoint in outside if len(outside) > 1 else ():
        entry = frame.entry(name, endpoint.port)
        first = next(e for e in frame.graph.environment if frame.entry(e.node, e.port) == entry)
        if first.node == name:
            ports = {frame.input(name, e.port, earlier): frame.node(name).input(e.port).variable for e in outside}
            yield Place("environment", entry, ports)
            return


def initial_values(frame: Frame, consumer: str) -> Iterator[Place]:
    """The initial values on the delayed edges that feed a node."""
    for edge in frame.graph.feeding(consumer):
        if edge.delayed:
            source = edge.source
            called = frame.node(source.node).output(source.port).variable
            variable = frame.output(source.node, source.port, 1)
            yield Place("initial", str(source), {variable: called}, f"initial {source}")


def _called(frame: Frame, name: str, earlier: int) -> dict[t.Variable, t.Variable]:
    """System-level variables as the node's own ports, without cells. If two inputs read one value, one is enough."""
    found: dict[t.Variable, t.Variable] = {}
    for variable, meant in frame.mapping(name, earlier).items():
        if isinstance(meant, t.Variable) and CELL not in variable.name:
            found.setdefault(meant, variable)
    return found

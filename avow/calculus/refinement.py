"""Refinement: may one node stand in for another? Weaker assumptions, stronger guarantees.

A refines B if B's assumptions imply those of A, and these together with A's guarantees imply B's guarantees. A contract
that nothing can keep refines vacuously, so it is also checked that A has an output for every input that B allows.
Clauses that mention other steps are checked over every run, as long as B's assumptions have held.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

from avow.base.diagnostics import Diagnostic
from avow.base.verdict import Counterexample, Verdict
from avow.calculus.certificates import requirement_scope
from avow.calculus.composition import Composition, composed_over
from avow.calculus.discharge import Bounds
from avow.calculus.questions import Answer
from avow.calculus.requirements import formula_question
from avow.calculus.variables import framed
from avow.formulas.formula import sort_digest, substitute
from avow.formulas.temporal.cell import CELL
from avow.formulas.temporal.cells import remembers
from avow.formulas.temporal.clock import one_step
from avow.formulas.traversal import transform
from avow.formulas.written import show_values
from avow.kernel.certificate import Certificate, How
from avow.kernel.statements import Claimed
from avow.language.contract import Clause, Contract, Node, Port
from avow.language.printer import show_type
from avow.language.sorts import DataSort, Sort, parts, rebuilt
from avow.language.subterms import ports_of
from avow.language.terms import Quantified, Role, Term, Variable
from avow.sanity.realizability import realizable
from avow.sanity.viability import viable
from avow.solving.limits import NO_ANSWER
from avow.system.formulas import Assumed
from avow.system.graph import dataflow, fits
from avow.system.plan import System
from avow.system.plan_file import bare_plan


@dataclass(frozen=True, slots=True)
class Demand:
    """One clause that has to follow: an assumption of the refining node, or a guarantee of the refined one."""

    node: str
    clause: Clause
    verdict: Verdict
    needed: tuple[str, ...]
    counterexample: Counterexample | None
    reason: str
    vacuous: bool


@dataclass(frozen=True, slots=True)
class Refinement:
    """Whether `concrete` refines `abstract`. `faults`: ports that do not fit; then nothing else is checked.

    `unrealizable`: an input that `abstract` allows, and the guarantees of `concrete` that no output meets there;
    `doubt`: why it is unknown whether there is one.
    """

    concrete: str
    abstract: str
    faults: tuple[Diagnostic, ...]
    demands: tuple[Demand, ...]
    unrealizable: Counterexample | None = None
    doubt: str = ""
    certificates: tuple[Certificate, ...] = ()
    """The certificates from which the kernel established it."""

    @property
    def verdict(self) -> Verdict:
        """`proved` only if it is also known whether anything can keep `concrete`."""
        found = self._demanded
        undecided = found is Verdict.PROVED and bool(self.doubt) and not self._hollow
        return Verdict.UNKNOWN if undecided else found

    @property
    def _demanded(self) -> Verdict:
        verdicts = {demand.verdict for demand in self.demands}
        if self.faults or Verdict.REFUTED in verdicts:
            return Verdict.REFUTED
        return Verdict.UNKNOWN if verdicts - {Verdict.PROVED} else Verdict.PROVED

    @property
    def _hollow(self) -> bool:
        return self.unrealizable is not None or any(demand.vacuous for demand in self.demands)

    @property
    def vacuous(self) -> bool:
        """It holds, but only because nothing can keep the contract (or nothing meets the assumptions)."""
        return self.verdict is Verdict.PROVED and self._hollow

    @property
    def holds(self) -> bool:
        """Whether `concrete` may replace `abstract`."""
        return self.verdict is Verdict.PROVED and not self.vacuous


def refines(
    concrete: Node, abstract: Node, bounds: Bounds | None = None, renames: Mapping[str, str] | None = None
) -> Refinement:
    """Does the first node refine the second? Ports are matched by name, after `renames` (the first node's name of a
    port → the second's); types are matched by structure, not by name."""
    bounds = bounds or Bounds()
    concrete = renamed(concrete, renames or {})
    faults = _ports(concrete, abstract)
    if faults:
        return Refinement(concrete.name, abstract.name, faults, ())
    always = tuple(replace(g, formula=g.spoken) for g in abstract.guarantees)
    concrete, abstract = _of_same_ports(concrete, replace(abstract, guarantees=always))
    answers, certificates = _answered(concrete, abstract, bounds)
    clauses = [(concrete.name, c) for c in concrete.assumptions] + [(abstract.name, c) for c in abstract.guarantees]
    demands = tuple(_demand(concrete, *asked, answer) for asked, answer in zip(clauses, answers, strict=True))
    found = Refinement(concrete.name, abstract.name, (), demands, certificates=certificates)
    return _realized(found, concrete, abstract, bounds) if found.verdict is Verdict.PROVED else found


def _demand(concrete: Node, node: str, clause: Clause, answer: Answer) -> Demand:
    if clause.chance is not None and answer.verdict is not Verdict.PROVED:  # it need not always hold
        why = f"probabilities are not compared, and {concrete.name} does not show that {clause.name} always holds"
        return Demand(node, clause, Verdict.UNKNOWN, (), None, why, False)
    needed = tuple(map(str, answer.details.get("needed", ())))  # type: ignore[call-overload]
    vacuous = answer.vacuous or (answer.established is not None and answer.established.vacuous)
    shown = answer.counterexample
    if shown is not None:  # state variables follow from the ports
        own = f"{concrete.name}."
        values = tuple(
            (f"out.{name.removeprefix(own)}" if name.startswith(own) else name, value)
            for name, value in shown.values
            if CELL not in name
        )
        shown = replace(shown, values=values)
    return Demand(node, clause, answer.verdict, needed, shown, answer.summary, vacuous)


def _realized(found: Refinement, concrete: Node, abstract: Node, bounds: Bounds) -> Refinement:
    """A refinement, and whether `concrete` has an output for every input that `abstract` allows, for ever."""
    if remembers(concrete) or remembers(abstract):
        asked = replace(concrete, inputs=abstract.inputs, assumptions=abstract.assumptions)
        lasting = viable(one_step(asked), effort=2 * bounds.effort, seed=bounds.seed)
        what = f"a run after which no output of {concrete.name} meets what it guarantees"
        verdict, reason, run = lasting.verdict, lasting.reason, lasting.run or Counterexample((), what)
    else:
        answer = realizable(
            tuple(port.variable for port in abstract.inputs),
            tuple(port.variable for port in concrete.outputs),
            {a.name: a.formula for a in abstract.assumptions},
            {g.name: g.formula for g in concrete.guarantees},
            effort=bounds.effort,
            seed=bounds.seed,
            doubtful=True,
        )
        what = f"no output of {concrete.name} meets {', '.join(answer.group)}"
        verdict, reason, run = answer.verdict, answer.reason, Counterexample(show_values(answer.inputs), what)
    match verdict:
        case Verdict.REFUTED:
            return replace(found, unrealizable=run)
        case Verdict.PROVED:
            return found
        case _:  # undecided: a doubt, never a proof
            return replace(found, doubt=reason or NO_ANSWER)


def _of_same_ports(concrete: Node, abstract: Node) -> tuple[Node, Node]:
    """Both nodes over the same ports: the second's inputs, and the first's outputs in the second's types. If one has a
    NATURAL and the other an INTEGER, both use the NATURAL."""
    recast = _recasting(concrete, abstract)
    given = {port.name: port for port in abstract.inputs}
    inputs = tuple(given[port.name] for port in concrete.inputs)
    outputs = tuple(replace(port, sort=recast(port.variable).sort) for port in concrete.outputs)
    made = {port.name: port.variable for port in outputs}
    same = {
        cast(Variable, recast(old.variable)): new.variable for old, new in zip(concrete.inputs, inputs, strict=True)
    }
    same |= {port.variable: made[port.name] for port in abstract.outputs}

    def over(node: Node, change: Callable[[Term], Term]) -> Node:
        assumptions, guarantees = (
            tuple(replace(clause, formula=substitute(change(clause.formula), same)) for clause in clauses)
            for clauses in (node.assumptions, node.guarantees)
        )
        return replace(node, assumptions=assumptions, guarantees=guarantees)

    return over(replace(concrete, inputs=inputs, outputs=outputs), recast), over(abstract, lambda term: term)


def renamed(node: Node, names: Mapping[str, str]) -> Node:
    """A node with some ports renamed. Another port that already has such a name gets a new one."""
    taken = {*names.values()}

    def called(port: Port) -> str:
        name = names.get(port.name, port.name)
        while port.name not in names and name in taken:
            name += "'"
        return name

    def change(ports: tuple[Port, ...]) -> tuple[Port, ...]:
        return tuple(replace(port, name=called(port)) for port in ports)

    if not names:
        return node
    inputs, outputs = change(node.inputs), change(node.outputs)
    given = {
        old.variable: new.variable for old, new in zip((*node.inputs, *node.outputs), (*inputs, *outputs), strict=True)
    }
    assumptions = tuple(replace(a, formula=substitute(a.formula, given)) for a in node.assumptions)
    guarantees = tuple(replace(g, formula=substitute(g.formula, given)) for g in node.guarantees)
    return replace(node, inputs=inputs, outputs=outputs, topics=(), assumptions=assumptions, guarantees=guarantees)


def _ports(concrete: Node, abstract: Node) -> tuple[Diagnostic, ...]:
    faults: list[Diagnostic] = []
    inputs = {port.name: port for port in abstract.inputs}
    outputs = {port.name: port for port in concrete.outputs}
    for port in concrete.inputs:
        if (given := inputs.get(port.name)) is None:
            message = f"{concrete.name} wants an input {port.name!r} that {_the(abstract, concrete)} does not have"
            faults.append(Diagnostic("PLAN126", message, port.span))
        elif not _same(given.sort, port.sort):
            faults.append(_other_type(concrete, port, abstract, given))
    for port in abstract.outputs:
        if (made := outputs.get(port.name)) is None:
            message = f"{concrete.name} has no output {port.name!r}, which {_the(abstract, concrete)} gives"
            faults.append(Diagnostic("PLAN126", message, concrete.span))
        elif not _same(made.sort, port.sort):
            faults.append(_other_type(concrete, made, abstract, port))
    return tuple(faults)


def _the(abstract: Node, concrete: Node) -> str:
    return abstract.name if abstract.name != concrete.name else f"the {abstract.name} to be refined"


def _other_type(concrete: Node, port: Port, abstract: Node, other: Port) -> Diagnostic:
    mine, theirs = _written(port), _written(other)
    where = (concrete.name, abstract.name) if concrete.name != abstract.name else ("the first", "the second")
    message = f"{port.name!r} is {mine} in {where[0]} and {theirs} in {where[1]}"
    return Diagnostic("PLAN126", message, port.span)


def _written(port: Port) -> str:
    """The type as in the port's declaration, and its definition if it is a name."""
    meant = show_type(port.sort)
    return port.type_name if meant == port.type_name else f"{port.type_name} = {meant}"


def _same(given: Sort, wanted: Sort) -> bool:
    return fits(given, wanted) or sort_digest(given) == sort_digest(wanted)


def _recasting(concrete: Node, abstract: Node) -> Callable[[Term], Term]:
    """Translates terms of one file to the sorts of the other: each may declare the same type, perhaps under another
    name."""
    others = {port.name: port.sort for port in (*abstract.inputs, *abstract.outputs)}
    mapping: dict[Sort, Sort] = {}
    for port in (*concrete.inputs, *concrete.outputs):
        if port.name in others:
            _match(port.sort, others[port.name], mapping)
    if all(old == new for old, new in mapping.items()):
        return lambda term: term

    def change(term: Term) -> Term:
        changes: dict[str, Any] = {"sort": _mapped(term.sort, mapping)}
        if isinstance(term, Quantified):
            changes["variables"] = tuple(replace(v, sort=_mapped(v.sort, mapping)) for v in term.variables)
        return replace(term, **changes)

    return lambda term: transform(term, change)


def _match(one: Sort, other: Sort, mapping: dict[Sort, Sort]) -> None:
    if one == other or sort_digest(one) != sort_digest(other):
        return
    theirs = parts(other)
    if isinstance(one, DataSort) and isinstance(other, DataSort):  # the order of constructors may differ
        theirs = tuple(p for made in one.constructors for p in other.constructor(made.name).parameters)
    for a, b in zip(parts(one), theirs, strict=True):
        _match(a, b, mapping)
    mapping[one] = other


def _mapped(sort: Sort, mapping: dict[Sort, Sort]) -> Sort:
    return mapping[sort] if sort in mapping else rebuilt(sort, (_mapped(part, mapping) for part in parts(sort)))


# -- questions ---------------------------------------------------------------------------------------------------------


def _answered(concrete: Node, abstract: Node, bounds: Bounds) -> tuple[tuple[Answer, ...], tuple[Certificate, ...]]:
    """For each assumption of the first node, then each guarantee of the second, whether it follows in every run, by
    induction over steps; and the certificates from which the kernel established it (`Refined` in proofs/instances.dfy).
    Both have the same types.

    The refining node is a system of its own, with the refined node's assumptions as environment assumptions. First its
    assumptions are required for any outputs: its guarantees hold only if these do, and may not be used. Then the
    refined node's guarantees are required, given its guarantees and all assumptions of both.
    """
    alone = replace(concrete, inputs=abstract.inputs, topics=(), assumptions=())
    given = abstract.assumptions
    certificates: list[Certificate] = []
    first = [
        _of_inputs(clause, answer)
        for clause, answer in zip(
            concrete.assumptions,
            _required(replace(alone, guarantees=()), given, concrete.assumptions, bounds, certificates),
            strict=True,
        )
    ]
    then = _required(alone, (*given, *concrete.assumptions), abstract.guarantees, bounds, certificates)
    return (*first, *then), tuple(certificates)


def _required(
    node: Node, assumed: Sequence[Clause], wanted: Sequence[Clause], bounds: Bounds, certificates: list[Certificate]
) -> list[Answer]:
    """Whether the node satisfies the wanted clauses under the assumed ones."""
    if not wanted:
        return []
    system = System(bare_plan(node.name, ()), Contract((), (), (), (node,)))
    supposed = [Assumed(f"{k} {clause.name}", node.name, clause.formula, "", "") for k, clause in enumerate(assumed)]
    required = {clause.name: _placed(node.name, clause.formula) for clause in wanted}
    composition = composed_over(framed(system, dataflow(system), supposed, required))
    support = tuple(f"{node.name}.{clause.name}" for clause in node.guarantees)
    answers = []
    for clause in wanted:
        answer = formula_question(composition.frame, clause.name, support)(composition, bounds)
        answers.append(_alone(composition, answer))
        kept = composition.certificates.made.get(requirement_scope(clause.name))
        if answers[-1].verdict is Verdict.PROVED and kept is not None:
            certificates.append(kept)
    return answers


def _of_inputs(clause: Clause, answer: Answer) -> Answer:
    """An assumption about the node's own outputs may follow from its guarantees: a run found without them does not
    refute."""
    if answer.verdict is not Verdict.REFUTED or all(v.role is Role.INPUT for v in ports_of(clause.formula)):
        return answer
    return Answer(Verdict.UNKNOWN, "it speaks of what the node has put out, of which its guarantees were not used")


def _placed(node: str, formula: Term) -> Term:
    """A clause's formula over ``node.port``, like a requirement's."""
    ports: Mapping[Variable, Variable] = {v: replace(v, name=f"{node}.{v.name}") for v in ports_of(formula)}
    return substitute(formula, ports)


def _alone(composition: Composition, answer: Answer) -> Answer:
    """The answer, proved only if the proof uses nothing but the node's guarantees and the assumptions."""
    if answer.verdict is not Verdict.PROVED:
        return answer
    assumed = {claim.digest for claim in composition.certificates.known.every if claim.kind is Claimed.ENVIRONMENT}
    hypotheses = answer.established.hypotheses if answer.established is not None else ()
    others = [need for need in hypotheses if need.kind is not How.GUARANTEE and need.digest not in assumed]
    if answer.established is not None and not others:
        return answer
    return replace(answer, verdict=Verdict.UNKNOWN, summary="the proof rests on more than the contracts say")

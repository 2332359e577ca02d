"""The sanity claims of a node: what a contract has to satisfy before anything is verified against it.

Every claim is named by the *good* thing that it states, so that `proved` is always good and `refuted`
always bad: `not-vacuous-G1` claims that guarantee G1 is *not* vacuous. Nothing here calls a solver.

| property                 | the claim                                                                | severity |
|--------------------------|--------------------------------------------------------------------------|----------|
| assumptions-satisfiable  | the assumptions can hold together                                        | error    |
| consistent               | some allowed inputs and some outputs meet every guarantee                | error    |
| realizable               | for all allowed inputs some output meets every guarantee                 | error    |
| not-tautological         | the guarantee rules something out that the assumptions allow;            | error    |
|                          | an assumption rules some input out                                       | note     |
| not-vacuous              | what triggers the guarantee can happen                                   | error    |
| not-redundant            | the guarantee (assumption) does not follow from the others               | warning  |
| constrained              | the guarantees exclude some value of the output                          | warning  |
| determined               | the inputs determine the output                                          | note     |
| meetable                 | the assumption is consistent with its providers' guarantees (a claim on  | error    |
|                          | a whole system: `avow.calculus.providers`)                               |          |
| needed                   | the assumption rules out inputs for which no output meets the guarantees | note     |
"""

from __future__ import annotations

import json
from dataclasses import field
from enum import StrEnum

from avow.base.diagnostics import Severity, Span
from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.remembered import Shelf, by_identity
from avow.formulas.conditions import conditions
from avow.formulas.formula import clause_digest, conjunction, free_variables, meaning, node_digest, sort_digest
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port
from avow.language.definitions import show_clause
from avow.language.printer import show_term
from avow.language.subterms import subterms
from avow.language.terms import RESPONSES, TRUE, History, Term


class Property(StrEnum):
    """See the module's table."""

    ASSUMPTIONS_SATISFIABLE = "assumptions-satisfiable"
    CONSISTENT = "consistent"
    REALIZABLE = "realizable"
    NOT_TAUTOLOGICAL = "not-tautological"
    NOT_VACUOUS = "not-vacuous"
    NOT_REDUNDANT = "not-redundant"
    CONSTRAINED = "constrained"
    DETERMINED = "determined"
    NEEDED = "needed"
    MEETABLE = "meetable"


_SEVERITY = {
    Property.NOT_REDUNDANT: Severity.WARNING,
    Property.CONSTRAINED: Severity.WARNING,
    Property.DETERMINED: Severity.NOTE,
    Property.NEEDED: Severity.NOTE,
}


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim about one node. `subject` is the name of the clause or output that the claim is about, if any."""

    about: Property
    subject: str | None
    sentence: str
    """The claim as a sentence."""
    formula: str
    """The formula concerned, in readable notation."""
    clauses: tuple[str, ...]
    """``node.clause`` names that the claim is about."""
    severity: Severity = Severity.ERROR
    """How bad it is if the claim is false."""
    span: Span | None = field(default=None, compare=False, repr=False)

    @property
    def name(self) -> str:
        """``realizable``, ``not-vacuous-G1``: stable, and unique in the node."""
        return str(self.about) if self.subject is None else f"{self.about}-{self.subject}"


@by_identity(20_000)
def claims(node: Node) -> tuple[Claim, ...]:
    """Every sanity claim of a node, in reading order."""
    assumed, guaranteed = _names(node, node.assumptions), _names(node, node.guarantees)
    a = show_term(conjunction(c.formula for c in node.assumptions))
    g = show_term(conjunction(c.formula for c in node.guarantees))
    ins, outs = (", ".join(p.variable.qualified for p in ports) for ports in (node.inputs, node.outputs))
    found: list[Claim] = []

    def ask(about: Property, of: Clause | Port | None, sentence: str, formula: str, names: tuple[str, ...]) -> None:
        noted = isinstance(of, Clause) and of.kind is ClauseKind.ASSUMPTION
        severity = Severity.NOTE if noted else _SEVERITY.get(about, Severity.ERROR)
        found.append(Claim(about, of.name if of else None, sentence, formula, names, severity, (of or node).span))

    def ask_of(clause: Clause) -> None:
        for about, sentence in _of_clause(node, clause).items():
            ask(about, clause, sentence, show_clause(clause, node), _names(node, (clause,)))

    sentence = f"The assumptions of {node.name} can hold together."
    ask(Property.ASSUMPTIONS_SATISFIABLE, None, sentence, f"∃ {ins} · {a}" if ins else a, assumed)
    sentence = f"Some allowed inputs of {node.name} and some outputs meet every guarantee."
    together = f"∃ {', '.join(filter(None, (ins, outs)))} · ({a}) ∧ ({g})"
    ask(Property.CONSISTENT, None, sentence, together, assumed + guaranteed)
    sentence = f"For all inputs that {node.name} assumes, some output meets every guarantee."
    answered = f"∀ {ins} · ({a}) → ∃ {outs} · {g}" if ins and outs else f"({a}) → {g}"
    ask(Property.REALIZABLE, None, sentence, answered, assumed + guaranteed)
    for clause in (c for c in node.guarantees if c.pace is None and not c.unwritten):
        ask_of(clause)
    likely = {v.name for c in node.guarantees if c.chance is not None for v in free_variables(c.spoken)}
    for port in () if node.unwritten else (p for p in node.outputs if p.name not in likely):
        excluded = f"The guarantees of {node.name} exclude some value of out.{port.name}."
        ask(Property.CONSTRAINED, port, excluded, g, guaranteed)
        ask(Property.DETERMINED, port, f"The inputs of {node.name} determine out.{port.name}.", g, guaranteed)
    for clause in (c for c in node.assumptions if c.formula != TRUE and c.name not in node.implied):
        ask_of(clause)
    return tuple(found)


@by_identity(20_000)
def node_key(node: Node) -> str:
    """SHA-256 of everything that the answers depend on: clauses by name and meaning, ports by name and sort."""
    clauses = sorted([str(c.kind), c.name, clause_digest(c)] for c in node.clauses)  # their order does not matter
    ports = [[p.declared, sort_digest(p.sort)] for p in (*node.inputs, *node.outputs)]
    return sha256(json.dumps([clauses, ports]))


def triggers(formula: Term) -> tuple[Term, ...]:
    """For each part of a guarantee that demands something only under a condition: the formula stating that the
    condition can arise. ``forall(x | P(x) -> (Q(x) -> R))`` gives ``exists(x | P(x) and Q(x))``, and so does any
    equivalent formula (`avow.formulas.conditions`). The absence of a response is not a condition."""
    found = dict.fromkeys(condition.formula for condition in conditions(formula))
    return tuple(f for f in found if not any(isinstance(t, History) and t.operator in RESPONSES for t in subterms(f)))


def _names(node: Node, clauses: tuple[Clause, ...]) -> tuple[str, ...]:
    return tuple(f"{node.name}.{clause.name}" for clause in clauses)


def _of_clause(node: Node, clause: Clause) -> dict[Property, str]:
    """The claims about a clause, each as a sentence."""
    if clause.kind is ClauseKind.GUARANTEE:
        whose, others, out = f"Guarantee {clause.name} of {node.name}", node.guarantees, "something"
    else:
        whose, others, out = f"Assumption {clause.name} of {node.name}", node.assumptions, "some input"
    asked = {Property.NOT_TAUTOLOGICAL: f"{whose} rules {out} out."}
    if clause.chance is not None:
        asked[Property.NOT_VACUOUS] = f"What guarantee {clause.name} of {node.name} gives a probability of can happen."
        return asked
    if clause.kind is ClauseKind.GUARANTEE and triggers(clause.formula):
        asked[Property.NOT_VACUOUS] = f"What triggers guarantee {clause.name} of {node.name} can happen."
    if len(others) > 1:
        asked[Property.NOT_REDUNDANT] = f"{whose} does not follow from the others."
    if clause.kind is ClauseKind.ASSUMPTION and not node.unwritten:
        asked[Property.NEEDED] = f"{whose} rules out inputs for which no output meets the guarantees."
    return asked


@dataclass(frozen=True, slots=True)
class _NodeFacts:
    """The facts that depend on one node alone, not on its system: its sanity claims, its digest, and for each clause:
    the digest under the assumptions, that of the formula alone, and the formula in readable notation."""

    claims: tuple[Claim, ...]
    key: str
    clauses: tuple[tuple[str, str, str], ...]


@by_identity(20_000)
def _facts(node: Node) -> _NodeFacts:
    return _NodeFacts(
        claims(node),
        node_key(node),
        tuple((node_digest(node, c), meaning(c.formula), show_clause(c, node)) for c in node.clauses),
    )


def recall(contract: Contract, shelf: Shelf) -> None:
    """Fill the caches of the functions for these facts with results of earlier runs."""
    for node in contract.nodes:
        if node.relay or not shelf.recall(_facts, node):
            continue
        known = _facts(node)
        claims.learn(known.claims, node)
        node_key.learn(known.key, node)
        for clause, (own, alone, shown) in zip(node.clauses, known.clauses, strict=True):
            node_digest.learn(own, node, clause)
            meaning.learn(alone, clause.formula)
            show_clause.learn(shown, clause, node)

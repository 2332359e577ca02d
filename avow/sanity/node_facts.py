"""What follows from one node alone, whatever the system around it: kept from run to run with what its text says."""

from __future__ import annotations

from avow.base.records import dataclass
from avow.base.remembered import Shelf, by_identity
from avow.formulas.formula import meaning, node_digest
from avow.language.contract import Contract, Node
from avow.language.definitions import show_clause
from avow.sanity.claims import Claim, claims, node_key


@dataclass(frozen=True, slots=True)
class NodeFacts:
    """Its sanity claims, its digest, and of each clause: the digest under the assumptions, that of the formula alone,
    and the formula for people."""

    claims: tuple[Claim, ...]
    key: str
    clauses: tuple[tuple[str, str, str], ...]


@by_identity(20_000)
def facts(node: Node) -> NodeFacts:
    return NodeFacts(
        claims(node),
        node_key(node),
        tuple((node_digest(node, c), meaning(c.formula), show_clause(c, node)) for c in node.clauses),
    )


def recall(contract: Contract, shelf: Shelf) -> None:
    """Let the functions that ask for these facts know what was found in earlier runs."""
    for node in contract.nodes:
        if node.relay or not shelf.recall(facts, node):
            continue
        known = facts(node)
        claims.learn(known.claims, node)
        node_key.learn(known.key, node)
        for clause, (digest, alone, shown) in zip(node.clauses, known.clauses, strict=True):
            node_digest.learn(digest, node, clause)
            meaning.learn(alone, clause.formula)
            show_clause.learn(shown, clause, node)

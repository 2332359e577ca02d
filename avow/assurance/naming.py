"""Names of claims, for people and for machines.

An obligation's claim bears its id; a requirement's is ``requirement:REQ1``, a derivation's ``derivation:D1``.
"""

from __future__ import annotations

from avow.evidence.obligation import Kind, Obligation

ADVICE = ("redundant", "unconstrained", "undetermined", "unneeded")
"""Sanity properties that are worth knowing, but that make nothing unsound."""

FOUNDATION = ("assumptions-satisfiable", "consistent", "realizable")
"""Sanity properties without which a node's guarantees say nothing."""


def requirement_claim(name: str) -> str:
    return f"requirement:{name}"


def derivation_claim(name: str) -> str:
    return f"derivation:{name}"


def short(claim: str) -> str:
    """``agent.low`` for a guarantee, ``REQ1``, ``D1``, else the id without the system (a supposition has none)."""
    kind, colon, name = claim.partition(":")
    if colon and kind in ("requirement", "derivation"):
        return name
    if colon and kind == "supposition":
        return name.partition(":")[0]
    parts = claim.split("/", 3)
    if len(parts) != 4:
        return claim
    _, node, kind, name = parts
    return f"{node}.{name}" if kind == Kind.GUARANTEE else f"{node}/{kind}/{name}"


def sanity_property(obligation: Obligation) -> str:
    """Which of the sanity properties an obligation is about: its name up to the clause, if it names one."""
    for name in (*FOUNDATION, *ADVICE, "vacuous", "tautology", "unmeetable"):
        if obligation.name == name or (obligation.name.startswith(name) and not obligation.name[len(name)].isalnum()):
            return name
    return obligation.name


def is_advice(obligation: Obligation) -> bool:
    return obligation.advisory or (obligation.kind is Kind.SANITY and sanity_property(obligation) in ADVICE)


def is_foundation(obligation: Obligation) -> bool:
    return obligation.kind is Kind.SANITY and sanity_property(obligation) in FOUNDATION

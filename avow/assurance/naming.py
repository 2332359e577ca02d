"""Names of claims, for readers and for programs.

An obligation's claim has its id; a requirement's is ``requirement:REQ1``, a derivation's ``derivation:D1``.
"""

from __future__ import annotations

import functools
import shlex

from avow.evidence.obligation import Kind, Obligation

ADVICE = ("not-redundant", "constrained", "determined", "needed")
"""Sanity properties that are useful to know, but whose failure makes nothing unsound."""

FOUNDATION = ("assumptions-satisfiable", "consistent", "realizable")
"""Sanity properties without which a node's guarantees have no meaning."""


def cut(text: str, most: int) -> str:
    """The text, or its beginning with an ellipsis: so many characters in all."""
    return text if len(text) <= most else text[: most - 1].rstrip() + "…"


def requirement_claim(name: str) -> str:
    return f"requirement:{name}"


def derivation_claim(name: str) -> str:
    return f"derivation:{name}"


_SANITY = {
    "assumptions-satisfiable": "its assumptions can hold together",
    "consistent": "its guarantees can hold together",
    "realizable": "its guarantees can always be met",
    "not-tautological": "rules something out",
    "not-vacuous": "can be triggered",
    "not-redundant": "does not follow from the others",
    "constrained": "is constrained",
    "determined": "is determined by the inputs",
    "meetable": "can be met by what its inputs come from",
    "needed": "is needed",
}
"""The statement of a sanity claim, in words that follow a clause's name."""


def short(claim: str) -> str:
    """``agent.low`` for a guarantee, ``REQ1``, ``D1``, else the id without the system (an assumption has none).

    If the id of a claim would mislead readers, words: a sanity claim is ``agent.low (can be triggered)`` and not
    ``agent/sanity/not-vacuous-low``, an assumption about the environment ``what is assumed of in.away``.
    """
    kind, colon, name = claim.partition(":")
    if colon and kind in ("requirement", "derivation"):
        return name
    if colon and kind == "assumption":
        return name.partition(":")[0]
    parts = claim.split("/", 3)
    if len(parts) != 4:
        return claim
    _, node, kind, name = parts
    if kind == Kind.GUARANTEE:
        return f"{node}.{name}"
    if kind == Kind.SANITY:
        about, dash, subject = next(
            ((key, name[len(key) : len(key) + 1], name[len(key) + 1 :]) for key in _SANITY if name.startswith(key)),
            ("", "", ""),
        )
        if about and dash == "-" and subject:
            return f"{node}.{subject} ({_SANITY[about]})"
        if about and not dash:
            return f"{node} ({_SANITY[about]})"
    if kind == Kind.COMPOSITION and name.startswith("environment."):
        return f"what is assumed of {name.removeprefix('environment.')}"
    return f"{node}/{kind}/{name}"


def sanity_property(obligation: Obligation) -> str:
    """The sanity property that an obligation is about: its name up to the clause, if it names one."""
    return _property(obligation.name)


@functools.lru_cache(maxsize=10_000)
def _property(told: str) -> str:
    for name in (*FOUNDATION, *ADVICE, "not-vacuous", "not-tautological", "meetable"):
        if told == name or (told.startswith(name) and not told[len(name)].isalnum()):
            return name
    return told


def is_advice(obligation: Obligation) -> bool:
    return obligation.advisory or (obligation.kind is Kind.SANITY and sanity_property(obligation) in ADVICE)


def is_foundation(obligation: Obligation) -> bool:
    return obligation.kind is Kind.SANITY and sanity_property(obligation) in FOUNDATION


def rerun(obligation: Obligation, method: str) -> str:
    """The command that re-runs a method on a claim and renders the report of it, from the workspace's folder."""
    o = obligation
    match o.kind:
        case Kind.SANITY:
            task = f"sanity:{o.system}:{o.node}"
        case Kind.COMPOSITION | Kind.REQUIREMENT:
            task = f"compose:{o.system}"
        case Kind.WELL_FORMED:
            task = f"check:{o.system}"
        case Kind.GUARANTEE | Kind.PROGRAM:
            task = f"discharge:{o.system}:{o.node}:{method}"
    return f"AVOW_FRESH=1 doit {shlex.quote(task)} && doit {shlex.quote(f'report:{o.system}')}"

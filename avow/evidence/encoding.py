"""Evidence records as JSON, there and back: one canonical text for hashing, a strict reader.

The text is ASCII with sorted keys and no spaces, so that one record has one spelling on every machine. What a backend
puts into `bound` and `details` is made plain first (fractions, tuples, paths, enumerations become strings and lists).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from avow.base.verdict import Counterexample, Hypothesis, HypothesisKind, Link, Verdict
from avow.evidence.record import Evidence


class Unreadable(Exception):  # noqa: N818 - it says what the text is
    """Text that is not a record: torn, edited, or of another program."""


def canonical(value: object) -> str:
    """The one JSON text of a plain value."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def plain(value: object) -> Any:
    """A value as JSON can hold it without loss of what it says; unknown objects become their text."""
    match value:
        case None | bool() | int():
            return value
        case float():
            return value if math.isfinite(value) else str(value)
        case str():
            return str(value)
        case Mapping():
            return {str(key): plain(item) for key, item in value.items()}
        case set() | frozenset():
            return sorted((plain(item) for item in value), key=canonical)
        case list() | tuple():
            return [plain(item) for item in value]
        case _:  # what JSON has no form for
            return str(value)


def encode(evidence: Evidence) -> dict[str, Any]:
    """A record as plain JSON data."""
    later = {"rests_on": encode_hypotheses(evidence.rests_on)} if evidence.rests_on else {}
    return {
        "obligation": evidence.obligation,
        "obligation_digest": evidence.obligation_digest,
        "key": evidence.key,
        "method": evidence.method,
        "backend": evidence.backend,
        "tool": evidence.tool,
        "tool_version": evidence.tool_version,
        "command": list(evidence.command),
        "verdict": str(evidence.verdict),
        "strength": str(evidence.strength),
        "link": str(evidence.link),
        "summary": evidence.summary,
        "started": evidence.started,
        "seconds": plain(float(evidence.seconds)),
        "inputs": plain(evidence.inputs),
        "outputs": plain(evidence.outputs),
        "counterexample": encode_counterexample(evidence.counterexample),
        "hypotheses": list(evidence.hypotheses),
        "bound": plain(evidence.bound),
        "details": plain(evidence.details),
        "vacuous": evidence.vacuous,
        "run": evidence.run,
        **later,
    }


def decode(data: object) -> Evidence:
    """The record that plain JSON data stands for. Raises Unreadable where a field is missing, unknown or ill-typed."""
    fields = _mapping(data, "a record")
    missing, extra = _FIELDS - LATER - fields.keys(), fields.keys() - _FIELDS
    if missing or extra:
        raise Unreadable(f"fields missing: {sorted(missing)}, unknown: {sorted(extra)}")
    try:
        verdict, strength, link = Verdict(fields["verdict"]), Verdict(fields["strength"]), Link(fields["link"])
    except ValueError as error:
        raise Unreadable(str(error)) from error
    return Evidence(
        obligation=_text(fields, "obligation"),
        obligation_digest=_text(fields, "obligation_digest"),
        key=_text(fields, "key"),
        method=_text(fields, "method"),
        backend=_text(fields, "backend"),
        tool=_text(fields, "tool"),
        tool_version=_text(fields, "tool_version"),
        command=_texts(fields["command"], "command"),
        verdict=verdict,
        strength=strength,
        link=link,
        summary=_text(fields, "summary"),
        started=_text(fields, "started"),
        seconds=_number(fields["seconds"]),
        inputs=_digests(fields["inputs"], "inputs"),
        outputs=_digests(fields["outputs"], "outputs"),
        counterexample=decode_counterexample(fields["counterexample"]),
        hypotheses=_texts(fields["hypotheses"], "hypotheses"),
        bound=_mapping(fields["bound"], "bound"),
        details=_mapping(fields["details"], "details"),
        vacuous=_flag(fields["vacuous"]),
        run=_text(fields, "run"),
        rests_on=decode_hypotheses(fields.get("rests_on", [])),
    )


def encode_counterexample(example: Counterexample | None) -> dict[str, Any] | None:
    if example is None:
        return None
    return {
        "values": [list(pair) for pair in example.values],
        "explanation": example.explanation,
        "trace": [[list(pair) for pair in step] for step in example.trace],
        "loop": example.loop,
    }


def decode_counterexample(data: object) -> Counterexample | None:
    if data is None:
        return None
    fields = _mapping(data, "a counterexample")
    if fields.keys() != {"values", "explanation", "trace", "loop"}:
        raise Unreadable("a counterexample has values, explanation, trace and loop")
    loop = fields["loop"]
    if loop is not None and (isinstance(loop, bool) or not isinstance(loop, int)):
        raise Unreadable("a counterexample's loop is a number")
    return Counterexample(
        values=_pairs(fields["values"]),
        explanation=_text(fields, "explanation"),
        trace=tuple(_pairs(step) for step in _sequence(fields["trace"], "trace")),
        loop=loop,
    )


def encode_hypotheses(hypotheses: tuple[Hypothesis, ...]) -> list[dict[str, str]]:
    return [{"kind": str(h.kind), "name": h.name, "digest": h.digest, "text": h.text} for h in hypotheses]


def decode_hypotheses(data: object) -> tuple[Hypothesis, ...]:
    """Raises Unreadable."""
    found = []
    for item in _sequence(data, "rests_on"):
        fields = _mapping(item, "a hypothesis")
        if fields.keys() != {"kind", "name", "digest", "text"}:
            raise Unreadable("a hypothesis has kind, name, digest and text")
        try:
            kind = HypothesisKind(_text(fields, "kind"))
        except ValueError as error:
            raise Unreadable(str(error)) from error
        found.append(Hypothesis(kind, _text(fields, "name"), _text(fields, "digest"), _text(fields, "text")))
    return tuple(found)


_FIELDS = frozenset(Evidence.__slots__)
LATER = frozenset({"rests_on"})
"""Fields that records of earlier versions do not have, and that are not written where they are empty."""


def _mapping(data: object, what: str) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise Unreadable(f"{what} is not an object")
    return data


def _sequence(data: object, what: str) -> list[Any]:
    if not isinstance(data, list):
        raise Unreadable(f"{what} is not a list")
    return data


def _text(fields: Mapping[str, Any], name: str) -> str:
    value = fields[name]
    if not isinstance(value, str):
        raise Unreadable(f"{name} is not text")
    return value


def _texts(data: object, what: str) -> tuple[str, ...]:
    items = _sequence(data, what)
    if not all(isinstance(item, str) for item in items):
        raise Unreadable(f"{what} is not a list of texts")
    return tuple(items)


def _digests(data: object, what: str) -> dict[str, str]:
    fields = _mapping(data, what)
    if not all(isinstance(value, str) for value in fields.values()):
        raise Unreadable(f"{what} does not map paths to digests")
    return fields


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Unreadable("seconds is not a number")
    return float(value)


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise Unreadable("vacuous is not true or false")
    return value


def _pairs(data: object) -> tuple[tuple[str, str], ...]:
    pairs = []
    for pair in _sequence(data, "a step"):
        match pair:
            case [str(name), str(value)]:
                pairs.append((name, value))
            case _:
                raise Unreadable("a counterexample's values are pairs of texts")
    return tuple(pairs)

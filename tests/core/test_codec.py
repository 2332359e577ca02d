"""One way from dataclasses to JSON and back: nothing is guessed, and the text for digests does not move."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.backend_kit.timeline import timelines
from avow.base.codec import LATER, called, canonical, from_json, from_text, schema, to_json
from avow.calculus.entailment import KeptAnswers
from avow.evidence.heads import read_index
from avow.evidence.ledger import Ledger
from avow.evidence.signing import Signed, signature_path, verify_signature
from avow.isolation.observed import Observed
from avow.kernel.certificate import Certificate
from avow.kernel.solvers import Reply


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True, slots=True)
class Inner:
    """One."""

    name: str
    at: int | None = None


class Short(NamedTuple):
    first: int
    word: str


class Long(NamedTuple):
    first: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Outer:
    """All kinds of fields."""

    colour: Colour
    weight: float
    flag: bool
    pairs: tuple[tuple[str, int], ...]
    inner: Inner | None
    inners: tuple[Inner, ...]
    words: Mapping[str, str]
    free: Mapping[str, Any] = field(default_factory=dict)
    new: tuple[Inner, ...] = field(default=(), metadata=LATER)
    rows: tuple[Short | Long, ...] = field(default=(), metadata=called("from"))
    raw: bytes = b""
    either: float | str = 0.0


inner = st.builds(Inner, st.text(), st.none() | st.integers())
outer = st.builds(
    Outer,
    st.sampled_from(Colour),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
    st.lists(st.tuples(st.text(), st.integers())).map(tuple),
    st.none() | inner,
    st.lists(inner).map(tuple),
    st.dictionaries(st.text(), st.text()),
    st.dictionaries(st.text(), st.none() | st.integers() | st.lists(st.text())),
    st.lists(inner).map(tuple),
    st.lists(st.builds(Short) | st.builds(Long, low=st.floats(0, 1), high=st.floats(1, 2))).map(tuple),
    st.binary(),
    st.floats(0, 1) | st.text(),
)
ROWS = (Short(1, "w"), Long(2, 0.5, 1.5))
ONE = Outer(
    *(Colour.RED, 1.5, True, (("a", 1),), Inner("x", 2), (Inner("y"),), {"k": "v"}, {"z": [1]}),
    *((Inner("n"),), ROWS, b"\0\xff", "e"),
)


DEFINITIONS: dict[str, Any] = {}
WHOLE = {**schema(Outer, DEFINITIONS), "$defs": DEFINITIONS}
SCHEMA = jsonschema.validators.validator_for(WHOLE)(WHOLE)


def test_the_schema_is_one() -> None:
    SCHEMA.check_schema(WHOLE)


@pytest.mark.parametrize("examples", [25, pytest.param(300, marks=pytest.mark.slow)])
def test_there_and_back(examples: int) -> None:
    settings(max_examples=examples)(given(outer)(_comes_back))()


def _comes_back(value: Outer) -> None:
    text = canonical(to_json(value))
    assert from_json(Outer, json.loads(text)) == value
    assert canonical(to_json(from_json(Outer, json.loads(text)))) == text
    SCHEMA.validate(json.loads(text))


def test_what_was_added_later_may_be_missing_and_is_not_written_empty() -> None:
    data = to_json(replace(ONE, new=()))
    assert "new" not in data
    assert from_json(Outer, data) == replace(ONE, new=())


def test_what_json_has_no_form_for_becomes_its_text() -> None:
    data = to_json(replace(ONE, free={"f": Fraction(1, 3), "p": Path("a/b"), "s": {"b", "a"}, "c": Colour.BLUE}))
    assert data["free"] == {"f": "1/3", "p": "a/b", "s": ["a", "b"], "c": "blue"}


def test_what_was_stored_reads_back_and_is_written_the_same(tmp_path: Path) -> None:
    """Written by the releases before the codec took the form over: rows; the ledger's lines and head."""
    stored = json.loads(Path(__file__).with_name("stored.json").read_text())
    (timeline,) = timelines({"timeline": [stored["timeline"]]})
    assert to_json(timeline) == stored["timeline"]
    assert to_json(from_json(tuple[Observed, ...], stored["observed"])) == stored["observed"]
    answers = KeptAnswers.read(stored["answers"])
    assert answers.written() == stored["answers"]
    assert answers.before == {"m1": (("A1", "G2"), False), "m2": Reply.UNSAT}
    index = tmp_path / "heads.jsonl"
    index.write_text("".join(f"{line}\n" for line in stored["index"]))
    found = read_index(index)
    assert (found.damage, [s.event for s in found.statements]) == ((), ["began", "reached", "acknowledged"])
    assert found.statements[2].note == "A. Person: seen"
    assert found.marks == tuple(json.loads(line)["hash"] for line in stored["index"])
    certificate = from_text(Certificate, stored["certificate"])
    assert canonical(to_json(certificate)) == stored["certificate"]


def test_a_stored_ledger_is_whole_and_would_be_written_the_same(tmp_path: Path) -> None:
    stored = json.loads(Path(__file__).with_name("stored.json").read_text())
    path = tmp_path / "rover.jsonl"
    path.write_text("".join(f"{line}\n" for line in stored["ledger"]))
    (head := path.with_name("rover.jsonl.head")).write_text(stored["head"])
    signature_path(path).write_text(stored["signature"])
    ledger = Ledger(path)
    assert ledger.damage == ()
    signed = Signed("rover", tuple(entry.hash for entry in ledger.records()))
    assert verify_signature(signature_path(path), signed, None) == (None, 3)
    again = Ledger(tmp_path / "again" / "rover.jsonl")
    again.append_all([entry.evidence for entry in ledger.records()])
    assert again.path.read_bytes() == path.read_bytes()
    assert again.path.with_name(head.name).read_text() == stored["head"]

"""A record's details are data of anybody's who writes the ledger: whatever stands there, the case is told."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from assurance.sample import case, evidence, guarantee, key_of, system
from rich.console import Console

from avow.assurance.codec import from_json, to_json
from avow.base.verdict import Verdict
from avow.evidence.audit import audit
from avow.evidence.currency import as_of_now, looked_at, undeclared
from avow.evidence.ledger import Ledger
from avow.evidence.record import CASE, ISOLATION, OBSERVED, OUTPUT_FOR_EVERY_INPUT, REMARKS, RETRY, SIGNED_BY
from avow.report import formats
from avow.report.terminal import show_obligation

KEYS = (
    *(CASE, ISOLATION, OBSERVED, OUTPUT_FOR_EVERY_INPUT, REMARKS, RETRY, SIGNED_BY),
    *("certificate", "date", "mutation", "needed", "outline", "overhead", "proof_outline", "protocol", "reviewer"),
    *("reviewers", "timeline", "triples", "valid_until", "who", "would_hold_if"),
)
"""The details that something of Avow's own reads."""
SHAPES: tuple[Any, ...] = (
    *(None, True, 0, -1.5, "", "text", "2026-13-77", [], [1], [[]], [None], ["outside"], [["outside"]], {}, {"": []}),
    *([["outside", 1, 2]], [["outside", "a", "b", "c"]], [["read", "a\0b", ""]], [{"code": 1}], {"key": {"a": [1]}}),
)


@pytest.mark.slow
@pytest.mark.parametrize("verdict", [Verdict.PROVED, Verdict.REVIEWED, Verdict.REFUTED, Verdict.UNKNOWN])
def test_whatever_the_details_hold_the_case_is_told(verdict: Verdict, tmp_path: Path) -> None:
    forged = [(f"{key} {at}", {key: shape}) for key in KEYS for at, shape in enumerate(SHAPES)]
    claims = [guarantee("node", f"c{n}") for n in range(len(forged))]
    method = "review" if verdict is Verdict.REVIEWED else "hoare"
    records = [evidence(o, verdict, method, details=told) for o, (_, told) in zip(claims, forged, strict=True)]
    ledger = Ledger(tmp_path / "rover.jsonl")
    ledger.append_all(records)
    kept = Ledger(ledger.path)
    assert [e.evidence for e in kept.records()] == records
    keys = {(o.id, method): key_of(o, method) for o in claims}
    audit(kept, tmp_path, keys=keys)
    looked_at(kept.records(), tmp_path)
    assert not any(undeclared(r) for r in records if r.verdict is not Verdict.UNKNOWN)
    subject = system({"node": [f"c{n}" for n in range(len(forged))]})
    case(subject, claims, [e.evidence for e in as_of_now(kept, tmp_path)], keys=keys)
    found = case(subject, claims, records, keys=keys)  # as a report may have it: nobody looked whether they stand
    assert from_json(to_json(found)) == found
    for name, content in formats(found):
        assert content or name == "report.pdf"
    for view in found.obligations:
        show_obligation(found, view, Console(file=io.StringIO()))


def test_what_was_outside_is_undeclared_only_where_its_row_can_be_read() -> None:
    claim = guarantee("node", "c")
    good = evidence(claim, Verdict.UNKNOWN, details={OBSERVED: [["outside", "the network", ""]]})
    assert undeclared(good)
    for rows in ([[]], [["outside"]], "outside", [{"kind": "outside"}], 7):
        assert not undeclared(evidence(claim, Verdict.UNKNOWN, details={OBSERVED: rows}))

"""What a report keeps of a ledger: what it leaves out changes no conclusion, and `report --check` misses nothing."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest

from avow.assurance.case import conclude, conclude_again
from avow.assurance.codec import from_json, to_json
from avow.assurance.facts import facts_of_case, facts_of_system
from avow.assurance.history import kept_records
from avow.assurance.model import Case
from avow.base.tuning.shown import OLDER_RECORDS
from avow.base.verdict import Verdict
from avow.evidence.currency import changed_since
from avow.evidence.ledger import Entry, Ledger
from avow.evidence.record import CASE, OBSERVED, Evidence
from avow.evidence.status import weigh
from avow.pipeline.report_check import _ledger
from avow.system.plan import System

from .sample import RUN, TODAY, case, chain, evidence, guarantee, node_plan, system

G, H, GONE = (guarantee("n", name) for name in ("g", "h", "gone"))
KEYS = {(o.id, method): "now" for o in (G, H) for method in ("hoare", "tests")}
VERDICTS = (Verdict.PROVED, Verdict.TESTED, Verdict.REFUTED, Verdict.UNKNOWN, Verdict.ERROR)


def subject() -> System:
    return system({"n": ["g", "h"]}, plans=[node_plan("n", "low", "hoare", "tests")])


def random_records(rng: random.Random) -> list[Evidence]:
    made = []
    for run in range(rng.randrange(4, 25)):
        for claim in rng.sample((G, H, GONE), rng.randrange(1, 4)):
            method = rng.choice(("hoare", "tests", "given-up"))
            record = evidence(claim, rng.choice(VERDICTS), method=method, key=rng.choice(("now", "1", "2")))
            meaning = rng.choice((record.obligation_digest, record.obligation_digest, "0" * 64))
            made.append(replace(record, run=f"run{run}", obligation_digest=meaning))
    return made


def of(records: list[Evidence]) -> Case:
    return case(subject(), [G, H], records, keys=KEYS)


def told(found: Case) -> object:
    """Everything but the records."""
    plain = to_json(replace(found, orphans=(), left_out=0))
    for view in plain["obligations"]:
        view["evidence"] = [item for item in view["evidence"] if item["counts"]]
    return plain


@pytest.mark.parametrize("seed", range(25))
def test_what_is_left_out_changes_no_conclusion(seed: int) -> None:
    records = random_records(random.Random(seed))
    found = of(records)
    assert told(conclude(replace(facts_of_case(found), entries=chain(records)))) == told(found)
    assert conclude_again(found) == found
    assert from_json(to_json(found)) == found


@pytest.mark.parametrize("seed", range(25))
def test_what_can_count_every_refutation_and_the_newest_are_kept(seed: int) -> None:
    entries = chain(random_records(random.Random(seed)))
    kept = kept_records(entries, [G, H], KEYS)
    assert entries[-1].hash in kept
    for entry in (e for e in entries if e.hash not in kept):
        record = entry.evidence
        asked = record.obligation, record.method
        digest = {o.id: o.digest for o in (G, H)}.get(record.obligation)
        newer = [e for e in entries[entry.number + 1 :] if (e.evidence.obligation, e.evidence.method) == asked]
        current = KEYS.get(asked) == record.key and record.obligation_digest == digest
        refuted = any(weigh(e.evidence).refuted for e in entries if e.evidence.obligation == record.obligation)
        if not refuted:
            says = [e.evidence.verdict for e in newer if KEYS.get(asked) == e.evidence.key]
            assert sum(e.hash in kept for e in newer) >= OLDER_RECORDS or record.verdict in says
        elif weigh(record).refuted or current:
            newer = [e for e in newer if e.evidence.verdict is record.verdict and e.evidence.key == record.key]
            newer = [e for e in newer if e.evidence.obligation_digest == record.obligation_digest]
        assert not refuted or sum(e.hash in kept for e in newer) >= OLDER_RECORDS


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_report_does_not_grow_with_runs_that_ask_the_same_again(verdict: Verdict) -> None:
    def after(runs: int) -> Case:
        return of([evidence(G, verdict, key="now", run=str(run), details={CASE: [1]}) for run in range(runs)])

    few, many = after(3), after(40)
    most = OLDER_RECORDS if verdict is Verdict.REFUTED else 1
    assert len(few.obligations[0].evidence) == len(many.obligations[0].evidence) == most
    assert many.left_out == 40 - most
    assert many.obligations[0].evidence[-1].entry.evidence.run == "39"


@pytest.mark.parametrize(
    "apart",
    [{"observed": "another file"}, {"valid_until": "2031-01-01"}, {"certificate": {"key": "k"}}, {"retry": True}],
)
def test_of_records_that_may_not_count_together_none_is_left_out_for_another(apart: dict[str, object]) -> None:
    records = [evidence(G, key="now", run=str(run)) for run in range(4)]
    others = [replace(r, details=apart, run="x" + r.run) for r in records]
    kept = kept_records(chain([*others, *records]), [G, H], KEYS)
    assert len(kept) == 2


def test_refutations_by_other_examples_are_all_kept() -> None:
    records = [evidence(G, Verdict.REFUTED, key="now", details={CASE: [k]}) for k in range(9)]
    assert len(kept_records(chain(records), [G, H], KEYS)) == 9


def test_a_report_grows_with_the_claims_and_not_with_the_edits() -> None:
    def after(edits: int, now: Verdict) -> Case:
        return of([evidence(G, key=str(edit), run=str(edit)) for edit in range(edits)] + [evidence(G, now, key="now")])

    for now, older in ((Verdict.PROVED, 0), (Verdict.UNKNOWN, OLDER_RECORDS)):  # an answer that is as before: once
        few, many = after(5, now), after(50, now)
        assert len(few.obligations[0].evidence) == len(many.obligations[0].evidence) == 1 + older
        assert many.left_out == 50 - older


def compared(found: Case, place: Path, records: list[Evidence]) -> list[str]:
    ledger = Ledger(place / "made.jsonl")
    ledger.append_all(records)
    assert [e.hash for e in ledger.records()] == [e.hash for e in chain(records)]
    return list(_ledger(found, ledger, place))


def without(found: Case, entry: Entry) -> Case:
    views = (replace(v, evidence=tuple(i for i in v.evidence if i.entry != entry)) for v in found.obligations)
    orphans = tuple(e for e in found.orphans if e != entry)
    return replace(found, obligations=tuple(views), orphans=orphans, left_out=found.left_out + 1)


@pytest.mark.parametrize("seed", range(8))
def test_no_record_that_is_kept_may_be_missing_though_it_is_counted_as_left_out(seed: int, tmp_path: Path) -> None:
    records = random_records(random.Random(seed))
    found = of(records)
    assert compared(found, tmp_path, records) == []
    for entry in facts_of_case(found).entries:
        missing = list(_ledger(without(found, entry), Ledger(tmp_path / "made.jsonl"), tmp_path))
        assert any("does not show" in line for line in missing)


def test_the_count_is_that_of_the_ledger(tmp_path: Path) -> None:
    records = [evidence(G, key=str(k), run=str(k)) for k in range(6)]
    found = of(records)
    assert compared(found, tmp_path, records) == []
    ledger = Ledger(tmp_path / "made.jsonl")
    fewer = replace(found, left_out=0)
    assert any("leaves out 0 records" in line for line in _ledger(fewer, ledger, tmp_path))


def test_what_counts_no_more_since_a_file_changed_is_kept() -> None:
    """The file may be put back, and then it counts: the ledger alone decides what is kept."""
    entries = chain([evidence(G, key="now", details={OBSERVED: str(k)}) for k in range(6)])
    as_of_now = [changed_since(entry) for entry in entries]
    assert len(kept_records(entries, [G, H], KEYS)) == 6
    found = conclude(facts_of_system(subject(), [G, H], as_of_now, keys=KEYS, today=TODAY, run=RUN, recorded=entries))
    assert len(found.obligations[0].evidence) == 6

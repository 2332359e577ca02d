"""A program that is proved to meet every guarantee shows that the contract is realizable; and when it does not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from assurance.sample import chain, evidence, guarantee, obligation
from avow.assurance.case import shown_by_programs
from avow.base.verdict import Verdict
from avow.evidence.obligation import Kind
from avow.evidence.record import OUTPUT_FOR_EVERY_INPUT, Evidence
from avow.evidence.status import Status, roll_up

LOW, HIGH = guarantee("n", "low"), guarantee("n", "high")
REALIZABLE, CONSISTENT, ALLOWED = (
    obligation("n", Kind.SANITY, name) for name in ("realizable", "consistent", "assumptions-satisfiable")
)
ALL = (LOW, HIGH, REALIZABLE, CONSISTENT, ALLOWED)
TOTAL = {OUTPUT_FOR_EVERY_INPUT: True}


def proof(about: Any, method: str = "hoare", **others: Any) -> Evidence:
    return evidence(about, Verdict.PROVED, method, **{"details": TOTAL, "strength": Verdict.PROVED, **others})


def shown(records: Sequence[Evidence], **statuses: Status) -> Mapping[str, Status]:
    entries = chain(records)
    counting = {o.id: tuple(e for e in entries if e.evidence.obligation == o.id) for o in ALL}
    given = {o.id: statuses.get(o.name.replace("-", "_"), roll_up(e.evidence for e in counting[o.id])) for o in ALL}
    return {name.rpartition("/")[2]: status for name, (status, _) in shown_by_programs(ALL, given, counting).items()}


OPEN = {"realizable": Status.UNKNOWN, "consistent": Status.UNKNOWN, "assumptions_satisfiable": Status.PROVED}


def test_a_program_that_meets_all_shows_that_there_is_one() -> None:
    assert shown([proof(LOW), proof(HIGH)], **OPEN) == {"realizable": Status.PROVED, "consistent": Status.PROVED}


@pytest.mark.parametrize(
    "records",
    [
        [proof(LOW)],  # not all guarantees
        [proof(LOW), proof(HIGH, "dafny")],  # not one program
        [proof(LOW), proof(HIGH, details={})],  # perhaps without an output
        [proof(LOW), proof(HIGH, hypotheses=("in.r is positive",))],
        [proof(LOW), proof(HIGH, strength=Verdict.TESTED)],
        [proof(LOW), evidence(HIGH, Verdict.PARTIAL, "hoare", details=TOTAL)],
        [proof(LOW), evidence(HIGH, Verdict.REFUTED, "hoare", details=TOTAL)],
        [],
    ],
)
def test_anything_less_shows_nothing(records: list[Evidence]) -> None:
    assert shown(records, **OPEN) == {}


def test_of_a_contract_that_allows_nothing_nothing_is_consistent() -> None:
    statuses = OPEN | {"assumptions_satisfiable": Status.UNKNOWN}
    assert shown([proof(LOW), proof(HIGH)], **statuses) == {"realizable": Status.PROVED}


def test_a_refutation_and_such_a_program_are_an_alarm() -> None:
    statuses = OPEN | {"realizable": Status.REFUTED, "consistent": Status.PROVED}
    assert shown([proof(LOW), proof(HIGH)], **statuses) == {"realizable": Status.CONTRADICTORY}

"""What a program shows of its node's contract: one that is proved to meet every guarantee for all allowed inputs, and
to have an output for each, is itself the witness that the contract is realizable, and so consistent.

It counts where the analysis of the contract alone gave no answer. It rests on the program's own records, and only while
they are current; where the analysis says the opposite, one of the tools is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from avow.assurance.naming import sanity_property, short
from avow.base.verdict import Verdict
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Kind, Obligation
from avow.evidence.record import OUTPUT_FOR_EVERY_INPUT, Evidence
from avow.evidence.status import Status, effective


def shown_by_programs(
    obligations: Sequence[Obligation], statuses: Mapping[str, Status], counting: Mapping[str, Sequence[Entry]]
) -> dict[str, tuple[Status, str]]:
    """Obligation → its status and, in words, which method's proofs give it."""
    proofs: dict[str, list[set[str]]] = {}
    for o in obligations:
        if o.kind is Kind.GUARANTEE:
            said = {e.evidence.method for e in counting[o.id] if _is_proof(e.evidence)}
            proofs.setdefault(o.node, []).append(said)
    methods = {node: method for node, of in proofs.items() if (method := _method(of)) is not None}
    sanity = [o for o in obligations if o.kind is Kind.SANITY and o.node in methods]
    allowed = {o.node for o in sanity if sanity_property(o) == "assumptions-satisfiable" and statuses[o.id].supports}
    found: dict[str, tuple[Status, str]] = {}
    for o in sanity:
        about, method = sanity_property(o), methods[o.node]
        if about != "realizable" and not (about == "consistent" and o.node in allowed):
            continue
        program = f"the program that {method} proves to meet every guarantee of {o.node} for all allowed inputs"
        if statuses[o.id] is Status.UNKNOWN:
            text = f"{short(o.id)} is shown by {program}; the analysis of the contract alone: {statuses[o.id]}"
            found[o.id] = (Status.PROVED, text)
        elif statuses[o.id] is Status.REFUTED:
            text = f"{short(o.id)} is refuted by the analysis of the contract, and shown by {program}"
            found[o.id] = (Status.CONTRADICTORY, text)
    return found


def _method(proofs: Sequence[set[str]]) -> str | None:
    """A method whose current records prove every guarantee of a node, unconditionally, of a program that always has
    an output; `proofs` are the methods that prove each."""
    return min(set[str].intersection(*proofs), default=None)


def _is_proof(record: Evidence) -> bool:
    total = record.details.get(OUTPUT_FOR_EVERY_INPUT) is True
    return total and effective(record) is Verdict.PROVED and not record.hypotheses and not record.rests_on

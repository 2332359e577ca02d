"""One evidence record: one attempt by one method at one obligation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from avow.base.codec import LATER
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Hypothesis, Link, Object, Verdict

RETRY = "retry"
"""Among the details of an answer that the next run must not be content with: what asked for it was cut short."""

OUTPUT_FOR_EVERY_INPUT = "output for every input"
"""Among the details of a proof: true where the same program is also proved to have an output for every allowed input,
so that all its proofs together show that such a program exists."""

REMARKS = "remarks"
"""Among the details: what the method's own check remarks of plan and files, a list of ``{code, place, message}``.
Nothing fails for it, but who reads the answer should know."""

SIGNED_BY = "signed_by"
"""Among a review's details: the public key, in hexadecimal, that signed its record."""

OBSERVED = "observed"
"""Among a record's details: what the subject was seen to look at, as (kind, path, digest)."""

ISOLATION = "isolation"
"""Among a record's details: how far the subject was kept from its judge."""

RATE = "rate"
"""Among the details of a sample: its strata (`avow.kernel.rates.Stratum`), from which rates are composed."""

COMPOSES = "composes"
"""Among the details of a requirement's proof: of what samples its failure rate may be composed
(`avow.calculus.trials`)."""

AGREES = "agrees"
"""Among the details of a program's agreement with models: method → the node's guarantees about outputs that were
compared."""

STANDS_ON = (OBSERVED, ISOLATION, RETRY, "certificate", "mutation", "valid_until")
"""The details by which one of two records that say the same may count and the other not."""

CASE = "case"
"""Among the details of a refutation: its inputs as data of the backend's own, to be tried first on every later run."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """A line of the ledger, without its chain hash.

    `key` is what the answer depends on, digested (obligation, options, input files, backend and tool versions): a
    record is current while the key computed afresh is the same. Paths are relative to the workspace.
    """

    obligation: str
    obligation_digest: str
    key: str
    method: str
    """The method's id in the plan, or ``sanity``, ``compose``…"""
    backend: str
    tool: str
    tool_version: str
    command: tuple[str, ...]
    verdict: Verdict
    strength: Verdict
    """The best verdict that the method can give."""
    link: Link
    summary: str
    started: str
    """ISO 8601, UTC."""
    seconds: float
    inputs: Mapping[str, str] = field(default_factory=dict)
    """Path → SHA-256 of every file that the answer rests on."""
    outputs: Mapping[str, str] = field(default_factory=dict)
    """Path → SHA-256 of every file that the attempt left: artifacts and logs."""
    counterexample: Counterexample | None = None
    hypotheses: tuple[str, ...] = ()
    bound: Mapping[str, Any] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    vacuous: bool = False
    run: str = ""
    """Id of the run that produced it."""
    rests_on: tuple[Hypothesis, ...] = field(default=(), metadata=LATER)
    """What the answer rests on: claims of the case, and assumptions that a person has to accept."""
    of: Object = field(default=Object.MODEL, metadata=LATER)
    """What was verified."""
    numbers: str = field(default="exact", metadata=LATER)
    """What a REAL was in it, as plans have it under `numbers`."""

    @property
    def tool_told(self) -> str:
        """The tool and its version, the name once. A person's reason is no tool's."""
        if self.verdict is Verdict.JUSTIFIED:
            return "a person"
        named = self.tool_version.casefold().startswith(self.tool.casefold())
        return self.tool_version if named and self.tool else f"{self.tool} {self.tool_version}".strip()

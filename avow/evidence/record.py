"""One evidence record: one attempt by one method at one obligation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from avow.base.codec import LATER
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Hypothesis, Link, Object, Verdict

RETRY = "retry"
"""Among the details of an answer that the next run must not reuse: the run that requested it was cut short."""

OUTPUT_FOR_EVERY_INPUT = "output for every input"
"""Among the details of a proof: true if the same program is also proved to have an output for every allowed input, so
that all its proofs together show that such a program exists."""

REMARKS = "remarks"
"""Among the details: the remarks of the method's own check on plan and files, a list of ``{code, place, message}``. No
run fails for them; readers of the answer should see them."""

SIGNED_BY = "signed_by"
"""Among a review's details: the public key, in hexadecimal, that signed its record."""

OBSERVED = "observed"
"""Among a record's details: what the program under test was observed to read, as (kind, path, digest)."""

ISOLATION = "isolation"
"""Among a record's details: how far the program under test was isolated from its oracle."""

RATE = "rate"
"""Among the details of a sample: its strata (`avow.kernel.rates.Stratum`), from which rates are composed."""

LIKELY = "least probability"
"""Among the details of evidence that counts no trials, for a guarantee with a probability: its bound."""

LIKELY_LEAVES = "composed of"
"""Key of `details`: the guarantees with a probability that a requirement's is composed of."""

COMPOSES = "composes"
"""Among the details of a requirement's proof: the samples that its failure rate may be composed of
(`avow.calculus.trials`)."""

AGREES = "agrees"
"""Among the details of a program's agreement with models: method → the node's guarantees about outputs that were
compared."""

SOLVER = "solver"
"""Among the details: the solver that decides for the tool, named as methods that call it directly name their tool."""

CONTRADICTS = "contradicts"
"""Among the details of a method that judges recorded data: the other claims that these contradict, by the names of
`avow.backend_kit.further`."""

AGAINST = "against"
"""Among the details of a refutation by data that the plan names under another claim: that method's name."""

STANDS_ON = (OBSERVED, ISOLATION, RETRY, "certificate", "mutation", "valid_until")
"""The details by which one of two records with the same statement may count and the other not."""

IN_PART = "nothing_shown_for"
"""Among the bounds of a record: the parts of the claim for which it shows nothing."""

CASE = "case"
"""Among the details of a refutation: its inputs in the backend's own format, to be tried first on every later run."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """A line of the ledger, without its chain hash.

    `key` is the digest of everything that the answer depends on (obligation, options, input files, backend and tool
    versions): a record is current while its key equals the one computed now. Paths are relative to the workspace.
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
    """Path → SHA-256 of every file that the answer depends on."""
    outputs: Mapping[str, str] = field(default_factory=dict)
    """Path → SHA-256 of every file that the attempt wrote: artifacts and logs."""
    counterexample: Counterexample | None = None
    hypotheses: tuple[str, ...] = ()
    bound: Mapping[str, Any] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    vacuous: bool = False
    run: str = ""
    """Id of the run that produced it."""
    rests_on: tuple[Hypothesis, ...] = field(default=(), metadata=LATER)
    """What the answer rests on: claims of the case, and assumptions that a person must accept."""
    of: Object = field(default=Object.MODEL, metadata=LATER)
    """The kind of object that was verified."""
    numbers: str = field(default="exact", metadata=LATER)
    """The semantics of REAL in it, as plans name it under `numbers`."""

    @property
    def tool_told(self) -> str:
        """The tool and its version, the name once. A justification by a person has no tool."""
        if self.verdict is Verdict.JUSTIFIED:
            return "a person"
        named = self.tool_version.casefold().startswith(self.tool.casefold())
        return self.tool_version if named and self.tool else f"{self.tool} {self.tool_version}".strip()

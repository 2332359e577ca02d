"""What the kernel established for one system in one run."""

from __future__ import annotations

from dataclasses import field

from avow.assurance.certification import KernelRun
from avow.base.records import dataclass
from avow.calculus.certificates import Certificates
from avow.evidence.claims import Reestablished
from avow.evidence.ledger import Entry
from avow.kernel.solvers import Solvers
from avow.solving.apart import Apart


@dataclass(slots=True)
class Checked:
    """The answers for one system as it is now (`Run.checked`).

    `kernels`: one for each file of certificates, by its digest."""

    texts: str
    kernels: dict[str, Certificates] = field(default_factory=dict)
    solvers: Solvers = field(default_factory=lambda: Solvers(z3=Apart("z3")))
    answers: dict[tuple[str, str, str], Reestablished | None] = field(default_factory=dict)
    runs: dict[str, KernelRun] = field(default_factory=dict)
    counting: tuple[tuple[object, ...], tuple[Entry, ...]] | None = None
    """A ledger's path, head and length, and its entries that count."""

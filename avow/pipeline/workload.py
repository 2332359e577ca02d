"""A system as read from its folder, with all its jobs."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from pathlib import Path

from avow import __version__
from avow.base.codec import to_json
from avow.base.diagnostics import Rejected
from avow.base.files import digest_file, read_regular, sha256, write
from avow.base.records import dataclass
from avow.base.remembered import Shelf, by_identity
from avow.base.workspace import Workspace
from avow.evidence.obligation import Kind, Obligation
from avow.pipeline.engine_code import reading_digest
from avow.pipeline.export import whole_digest
from avow.pipeline.methods import Offered
from avow.pipeline.plan_check import of_rest
from avow.pipeline.work import Catalogue, Work, catalogue
from avow.report.layout import json_text
from avow.system.faults import in_order
from avow.system.load import load_system
from avow.system.plan import System


@dataclass(frozen=True, slots=True)
class Survey:
    """`digest` covers the plan's and the contract's text: comments count here, as reports show them."""

    system: System
    catalogue: Catalogue
    digest: str
    shelf: Shelf | None = field(default=None, compare=False, repr=False)
    """The cache of what follows from the texts; none in a run that uses no earlier one."""

    def work(self, method: str) -> Work:
        """The first job of that method, for engines with a single job. Raises KeyError."""
        for work in self.catalogue.works:
            if work.method == method:
                return work
        raise KeyError(method)

    @property
    def keys(self) -> Mapping[tuple[str, str], str]:
        """(obligation id, method id) → what its answer depends on now."""
        return {(o.id, work.method): work.keys[o.id] for work in self.catalogue.works for o in work.obligations}


def survey(folder: Path, offered: Offered = None, fresh: bool = False) -> Survey | Rejected:
    """A system that cannot be read is a value here, so that the others can be verified. `offered`: as for
    `method_work`. `fresh`: without an earlier run's cache of the nodes' texts."""
    shelf = None if fresh else Shelf(folder, reading_digest())
    try:
        system = load_system(folder, shelf)
        listed = catalogue(system, offered, shelf)
        if shelf is not None:
            for node in system.contract.nodes:
                shelf.recall(whole_digest, node)
            shelf.keep()
    except Rejected as rejected:
        return Rejected(*in_order((*rejected.diagnostics, *of_rest(folder))))
    files = (system.plan.path, *system.plan.contract_files, *system.plan.included)
    texts = [__version__, *map(digest_file, files)]
    return Survey(system, listed, sha256(json.dumps(texts)), shelf)


LISTED = "obligations.json"


@dataclass(frozen=True, slots=True)
class ListedClaim:
    """An obligation in obligations.json: `at` is its source position, `methods` are those that discharge it."""

    id: str
    kind: Kind
    claim: str
    formula: str
    digest: str
    clauses: tuple[str, ...]
    at: str | None
    methods: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Listing:
    system: str
    obligations: tuple[ListedClaim, ...]


def write_obligations(workspace: Workspace, surveyed: Survey, dry: bool = False) -> bool:
    """artifacts/<system>/obligations.json: every claim, with its formula and its methods. `dry`: is it current?"""
    text = _listed(workspace, surveyed)
    path = workspace.artifacts / surveyed.system.name / LISTED
    if dry:
        return path.is_file() and read_regular(path) == text.encode()
    return write(path, text)


@by_identity(1)
def _listed(workspace: Workspace, surveyed: Survey) -> str:
    return json_text(to_json(listing(workspace, surveyed)))


def listing(workspace: Workspace, surveyed: Survey) -> Listing:
    """Every obligation of the system."""
    methods: dict[str, list[str]] = {}
    for work in surveyed.catalogue.works:
        for obligation in work.obligations:
            methods.setdefault(obligation.id, []).append(work.method)
    shown = functools.cache(lambda file: workspace.relative(Path(file)))
    listed = tuple(_listed_claim(shown, o, methods.get(o.id, [])) for o in surveyed.catalogue.obligations)
    return Listing(surveyed.system.name, listed)


def _listed_claim(shown: Callable[[str], str], o: Obligation, methods: Sequence[str]) -> ListedClaim:
    at = f"{shown(o.span.file)}:{o.span.line}:{o.span.column}" if o.span else None
    return ListedClaim(o.id, o.kind, o.claim, o.formula, o.digest, o.clauses, at, tuple(methods))

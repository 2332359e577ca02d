"""Two states of the workspace's cases, from reports, ledgers or git revisions."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from datetime import date
from pathlib import Path

from avow import __version__
from avow.assurance.codec import read_case
from avow.assurance.compare import Snapshot, of_case, of_ledger
from avow.assurance.model import RunInfo
from avow.base import git
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.workspace import Workspace
from avow.evidence.ledger import Entry, Ledger


def pair(old: str, new: str | None) -> Iterator[tuple[str, Snapshot, Snapshot]]:
    """(system, before, after) for every system that either side has. Raises Rejected."""
    before, after = snapshots(old), snapshots(new)
    if len(before) == len(after) == 1:  # two reports of one system may stand under different names
        (name, one), (_, other) = next(iter(before.items())), next(iter(after.items()))
        yield name, one, other
        return
    nothing = Snapshot("", {}, {})
    for name in dict.fromkeys((*before, *after)):
        if Path(old).exists() and name not in before:
            continue  # one report or ledger against all of the workspace: only its own system is meant
        yield name, before.get(name, nothing), after.get(name, nothing)


def snapshots(name: str | None) -> dict[str, Snapshot]:
    """System → its snapshot, from a report, a ledger, a revision, or (None) the workspace as it is. Raises Rejected."""
    path = Path(name) if name is not None else None
    if path is not None and path.suffix == ".jsonl" and path.is_file():
        return {path.stem: of_ledger(path.stem, _records(path))}
    if path is not None and (path.is_file() or (path / "report.json").is_file()):
        case = read_case(path)
        return {case.system: of_case(case)}
    from avow.base.workspace import workspace

    place = workspace()
    if name is None:
        return _of_contracts(place, place)
    with tempfile.TemporaryDirectory() as folder:
        _checkout(place, name, Path(folder))
        return _of_contracts(Workspace(Path(folder)), place)


def _records(path: Path) -> tuple[Entry, ...]:
    """Raises Rejected."""
    from avow.cli.ledgers import readable

    with readable(path):
        return Ledger(path).records()


def _checkout(place: Workspace, revision: str, folder: Path) -> None:
    """The contracts as of a revision. Raises Rejected."""
    try:
        git.write_files(place.root, revision, place.contracts.name, folder)
    except (git.GitFailed, OSError) as error:
        message = f"'{revision}' is no report, ledger or revision here: {error}"
        raise Rejected(Diagnostic("DIFF001", message)) from None


def _of_contracts(contracts: Workspace, place: Workspace) -> dict[str, Snapshot]:
    from avow.assurance.case import conclude
    from avow.assurance.facts import facts_of_system
    from avow.pipeline.workload import survey

    found = {}
    for folder in contracts.systems():
        surveyed = survey(folder)
        if isinstance(surveyed, Rejected):
            found[folder.name] = Snapshot(folder.name, {}, {})
            continue
        system = surveyed.system
        case = conclude(
            facts_of_system(
                system,
                surveyed.catalogue.obligations,
                _records(place.ledger(system.name)),
                keys=surveyed.keys,
                today=date.today(),
                run=RunInfo("diff", "", 0.0, __version__),
            )
        )
        found[system.name] = of_case(case)
    return found

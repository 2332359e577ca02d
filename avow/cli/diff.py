"""``avow diff``: what changed in the case between two reports, two ledgers or two git revisions."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import click

from avow.assurance.answers import ChangeLine
from avow.assurance.changes import MARKS, compare, is_worse
from avow.assurance.codec import read_case
from avow.assurance.signed import KEYS, newest_signed, read_signed
from avow.assurance.state import State, state_of, state_of_ledger, state_of_signature
from avow.base import git
from avow.base.codec import document, to_json
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write_out
from avow.base.plain import count
from avow.base.tuning.shown import DIFF_REASONS
from avow.base.workspace import Workspace, workspace
from avow.cli.options import PathArgument, json_option
from avow.evidence.ledger import Entry, Ledger, readable
from avow.pipeline.assess import as_it_is
from avow.pipeline.workload import survey


@click.command()
@click.argument("old")
@click.argument("new", required=False)
@json_option()
@click.option("--html", "page", type=PathArgument(dir_okay=False), help="Write a page to this file, too.")
@click.option(
    "--fail-on",
    type=click.Choice(["worse", "never"]),
    default="worse",
    show_default=True,
    help="Exit code 1 where less is shown or asked, or more assumed, than before; or never.",
)
def command(old: str, new: str | None, as_json: bool, page: Path | None, fail_on: str) -> int:
    """What changed from OLD to NEW, the worst first, with the edits that may be the reason, and what was re-run.

    Each is a report (its folder or report.json), a folder of reports, a ledger (.jsonl), a signature (signed/, a folder
    or file in it), another workspace, or a git revision of this one: then the contracts and plans of that revision are
    held against today's ledger. NEW is the workspace as it is, if left out. Exit code 1 where something got worse.
    """
    changes = [(system, change) for system, before, after in _pair(old, new) for change in compare(before, after)]
    if page is not None:
        _write(page, old, new, changes)
    if as_json:
        listed = [{"system": system, "worse": is_worse(change), **to_json(change)} for system, change in changes]
        click.echo(document({"changes": listed}))
    elif not changes:
        click.echo("nothing changed")
    else:
        for system in dict.fromkeys(s for s, _ in changes):
            click.echo(f"{system}:")
            _tell([change for s, change in changes if s == system])
    return 1 if fail_on == "worse" and any(is_worse(change) for _, change in changes) else 0


def _tell(changes: list[ChangeLine]) -> None:
    for change in changes:
        if change.kind != "rerun":
            click.echo(f"  {MARKS.get(change.kind, '▼')} {change.words}")
            if change.kind == "meaning" and change.before not in change.words:
                click.echo(f"      was: {change.before}")
                click.echo(f"      now: {change.after}")
            more = len(change.edits) - DIFF_REASONS
            for line in (*change.edits[:DIFF_REASONS], *([f"and {more} more"] if more > 0 else ())):
                click.echo(f"      {line}")
    again = sum(change.kind == "rerun" for change in changes)
    if again:
        click.echo(f"  {MARKS['rerun']} re-run, with the same answer: {count(again, 'piece')} of evidence")


def _write(page: Path, old: str, new: str | None, changes: list[tuple[str, ChangeLine]]) -> None:
    """Raises Rejected if the page cannot be written."""
    from avow.report.comparison import render_comparison

    text = render_comparison(old, new or "the workspace as it is", changes)
    try:
        write_out(page, text.encode("utf-8", "replace").decode())
    except OSError as error:
        raise Rejected(Diagnostic("DIFF002", f"{page} cannot be written: {error.strerror}")) from None


def _pair(old: str, new: str | None) -> Iterator[tuple[str, State, State]]:
    """(system, before, after) for every system that either side has. Raises Rejected."""
    before, after = _snapshots(old), _snapshots(new)
    if len(before) == len(after) == 1:  # two reports of one system may have different names
        (name, one), (_, other) = next(iter(before.items())), next(iter(after.items()))
        yield name, one, other
        return
    nothing = State()
    for name in dict.fromkeys((*before, *after)):
        if Path(old).exists() and name not in before:
            continue  # one report or ledger compared with the whole workspace: only its own system counts
        yield name, before.get(name, nothing), after.get(name, nothing)


def _snapshots(name: str | None) -> dict[str, State]:
    """System → its snapshot, from a report, a ledger, a revision, or (None) the workspace as it is. Raises Rejected."""
    path = Path(name) if name is not None else None
    if path is not None and path.exists() and (found := _of_signatures(path)):
        return found
    if path is not None and path.suffix == ".jsonl" and path.is_file():
        return {path.stem: state_of_ledger(_records(path))}
    if path is not None and (path.is_file() or (path / "report.json").is_file()):
        case = read_case(path)
        return {case.system: state_of(case)}
    if path is not None and (reports := sorted(path.glob("*/report.json"))):
        return {case.system: state_of(case) for case in map(read_case, reports)}
    if path is not None and (path / "contracts").is_dir():
        return _of_contracts(Workspace(path), Workspace(path))
    place = workspace()
    if name is None:
        return _of_contracts(place, place)
    with tempfile.TemporaryDirectory() as folder:
        _checkout(place, name, Path(folder))
        return _of_contracts(Workspace(Path(folder)), place)


def _of_signatures(path: Path) -> dict[str, State]:
    """The snapshots of the newest valid signatures in ``signed/`` or a system's folder in it, or of a file there.
    Raises Rejected."""
    path = path.resolve()
    if path.is_file() and path.parent.parent.name == "signed":
        read = {path.parent.name: read_signed(path)}
    else:
        inside = path.parent.name == "signed"
        folders = [path] if inside else sorted(path.glob("*/")) if path.name == "signed" else []
        read = {f.name: newest_signed(f.parent, f.name)[0] or "no signature counts" for f in folders if f.name != KEYS}
    if faults := [f"{path}: {name}: {why}" for name, why in read.items() if isinstance(why, str)]:
        raise Rejected(*(Diagnostic("DIFF001", fault) for fault in faults))
    return {name: state_of_signature(found) for name, found in read.items() if not isinstance(found, str)}


def _records(path: Path) -> tuple[Entry, ...]:
    """Raises Rejected."""
    with readable(path):
        return Ledger(path).records()


def _checkout(place: Workspace, revision: str, folder: Path) -> None:
    """The contracts as of a revision. Raises Rejected."""
    try:
        git.write_files(place.root, revision, place.contracts.name, folder)
    except (git.GitFailed, OSError) as error:
        message = f"'{revision}' is no report, ledger, signature, workspace or revision here: {error}"
        hint = "`avow verify` writes reports/, and `avow sign --report SYSTEM` signed/"
        raise Rejected(Diagnostic("DIFF001", message, hint=hint)) from None


def _of_contracts(contracts: Workspace, place: Workspace) -> dict[str, State]:
    found = {}
    for folder in contracts.systems():
        surveyed = survey(folder)
        if isinstance(surveyed, Rejected):
            if contracts == place:  # the workspace as it is; an earlier revision may have been unreadable
                raise surveyed
            found[folder.name] = State()
            continue
        with readable(place.ledger(surveyed.system.name)):
            case = as_it_is(surveyed, contracts, place.ledger(surveyed.system.name))
        found[case.system] = state_of(case)
    return found

"""``avow report``: render the reports again from the ledger, or check one against it."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from avow.assurance.codec import read_case
from avow.base.codec import document
from avow.base.workspace import ON_DEMAND, find_workspace, report_folder, require_systems, workspace
from avow.cli.options import PathArgument, json_option
from avow.evidence.ledger import Ledger
from avow.pipeline.report_check import check, signed_now, stale
from avow.pipeline.settings import sign_with
from avow.pipeline.state import task_name
from avow.pipeline.tasks import execute
from avow.report.on_demand import export


@click.command()
@click.argument("systems", metavar="[SYSTEM]...", nargs=-1)
@click.option(
    "--check",
    "folder",
    type=PathArgument(),
    metavar="REPORT",
    help="Does the report of this system, or in this folder, say what the ledger says?",
)
@click.option(
    "--format",
    "names",
    type=click.Choice(list(ON_DEMAND)),
    multiple=True,
    help="Write this format as well; repeatable. A later run with another result removes its files.",
)
@click.option("--key", type=PathArgument(exists=True, dir_okay=False), help="Sign the attestations (AVOW_KEY).")
@json_option()
def command(systems: tuple[str, ...], folder: Path | None, names: tuple[str, ...], key: object, as_json: bool) -> int:
    """Render the report of each SYSTEM (its name or folder; else all) from its ledger; nothing is verified.

    With --check REPORT nothing is written: every record that the report quotes is looked up in the ledger, every
    conclusion drawn again, every format rendered again and compared; files that are others now than when the evidence
    was made are named.
    """
    if folder is not None:
        return _check(folder, as_json)
    place = workspace()
    systems = require_systems(place, systems)
    sign_with(key)
    wanted = [f"report:{task_name(name)}" for name in systems] or ["report"]
    code = execute(place.root, wanted, answer=sys.stdout if as_json else None)
    for folder in sorted({path.parent for path in place.reports.glob("*/report.json")}) if names and code == 0 else ():
        if not systems or folder.name in systems:
            for path in export(read_case(folder), folder, names):
                print(place.relative(path), file=sys.stderr)
    return code


def _check(folder: Path, as_json: bool) -> int:
    folder = report_folder(folder)
    place = find_workspace(folder.resolve()) or find_workspace(Path.cwd().resolve())
    case = read_case(folder)
    path = place.ledger(case.system) if place else None
    ledger = Ledger(path) if path is not None and path.exists() else None
    found = check(folder, ledger, place.root if place else None)
    old = stale(case, place.root) if place else ()
    signed = signed_now(case, place.root) if place else case.answers.signed
    if as_json:
        click.echo(
            document(
                {
                    "system": case.system,
                    "agrees": not found,
                    "differences": list(found),
                    "changed_since": list(old),
                    "signed": signed,
                }
            )
        )
    elif found:
        click.echo(f"{folder}: the report does not say what the ledger says")
        for line in found:
            click.echo(f"  ✘ {line}")
    else:
        records = sum(len(view.evidence) for view in case.obligations)
        left_out = f" ({case.left_out} older ones in the ledger alone)" if case.left_out else ""
        told = f"{records} records{left_out}, {len(case.obligations)} obligations, proofs {case.grade.word}"
        told += f"; {case.answers.warned}" if case.answers.warned else ""
        click.echo(f"{folder}: agrees with the ledger: {told}{', of an earlier state' if old else ''}")
    if not as_json:
        click.echo(f"  · {signed}")
    for name in old if not as_json else ():
        click.echo(f"  · {name} has changed since: run `avow verify` to update its evidence")
    return 1 if found else 0

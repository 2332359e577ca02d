"""``avow report``: render the reports again from the ledger, or check one against it."""

from __future__ import annotations

import json
import sys

import click

from avow.cli.options import json_option
from avow.cli.paths import PathArgument


@click.command()
@click.argument("systems", metavar="[SYSTEM]...", nargs=-1)
@click.option(
    "--check",
    "folder",
    type=click.Path(exists=True, file_okay=False),
    help="Does the report in this folder say what the ledger says?",
)
@click.option("--key", type=PathArgument(exists=True, dir_okay=False), help="Sign the attestations (AVOW_KEY).")
@json_option()
def command(systems: tuple[str, ...], folder: str | None, key: object, as_json: bool) -> int:
    """Render the report of each SYSTEM (its name or folder; else all) from its ledger; nothing is verified.

    With --check DIR nothing is written: every record that the report in DIR quotes is looked up in the ledger, every
    conclusion drawn again, every format rendered again and compared.
    """
    from pathlib import Path

    if folder is not None:
        return _check(Path(folder), as_json)
    from avow.base.workspace import require_systems, workspace
    from avow.pipeline.run_info import sign_with
    from avow.pipeline.tasks import execute

    place = workspace()
    systems = require_systems(place, systems)
    sign_with(key)
    return execute(
        place.root, [f"report:{name}" for name in systems] or ["report"], answer=sys.stdout if as_json else None
    )


def _check(folder: object, as_json: bool) -> int:
    from pathlib import Path

    from avow.assurance.codec import read_case
    from avow.base.workspace import find_workspace
    from avow.evidence.ledger import Ledger
    from avow.report.check import check

    assert isinstance(folder, Path)
    place = find_workspace(folder.resolve()) or find_workspace(Path.cwd().resolve())
    case = read_case(folder)
    path = place.ledger(case.system) if place else None
    ledger = Ledger(path) if path is not None and path.is_file() else None
    found = check(folder, ledger, place.root if place else None)
    if as_json:
        click.echo(json.dumps({"system": case.system, "agrees": not found, "differences": list(found)}, indent=1))
    elif found:
        click.echo(f"{folder}: the report does not say what the ledger says")
        for line in found:
            click.echo(f"  ✘ {line}")
    else:
        records = sum(len(view.evidence) for view in case.obligations)
        click.echo(
            f"{folder}: agrees with the ledger: {records} records, {len(case.obligations)} obligations, {case.grade}"
        )
    return 1 if found else 0

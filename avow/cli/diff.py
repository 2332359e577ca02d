"""``avow diff``: what changed in the case between two reports, two ledgers or two git revisions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from avow.base.codec import document, to_json
from avow.base.plain import count
from avow.base.tuning.shown import DIFF_REASONS
from avow.cli.options import json_option

if TYPE_CHECKING:
    from avow.assurance.compare import Change


@click.command()
@click.argument("old")
@click.argument("new", required=False)
@json_option()
@click.option("--html", "page", type=click.Path(dir_okay=False), help="Write a page to this file, too.")
@click.option(
    "--fail-on",
    type=click.Choice(["worse", "never"]),
    default="worse",
    show_default=True,
    help="Exit code 1 where less is shown or more supposed than before, or never.",
)
def command(old: str, new: str | None, as_json: bool, page: str | None, fail_on: str) -> int:
    """What changed from OLD to NEW, and why: claims, what they mean, where they stand, gates, what was asked again.

    Each is a report (its folder or report.json), a ledger (.jsonl), or a git revision of the workspace: then the
    contracts and plans of that revision are held against today's ledger. NEW is the workspace as it is, if left out.
    Exit code 1 where something got worse.
    """
    from avow.assurance.compare import compare
    from avow.cli.snapshots import pair

    changes = [(system, change) for system, before, after in pair(old, new) for change in compare(before, after)]
    if page is not None:
        _write(page, old, new, changes)
    if as_json:
        listed = [{"system": system, "worse": change.is_worse, **to_json(change)} for system, change in changes]
        click.echo(document({"changes": listed}))
    elif not changes:
        click.echo("nothing changed")
    else:
        for system in dict.fromkeys(s for s, _ in changes):
            click.echo(f"{system}:")
            _tell([change for s, change in changes if s == system])
    return 1 if fail_on == "worse" and any(change.is_worse for _, change in changes) else 0


def _tell(changes: list[Change]) -> None:
    for change in changes:
        if change.kind != "rerun":
            click.echo(f"  {change.text}")
            if change.old_formula != change.new_formula:
                click.echo(f"      was: {change.old_formula}")
                click.echo(f"      now: {change.new_formula}")
            for line in change.why[:DIFF_REASONS]:
                click.echo(f"      {line}")
    again = [change for change in changes if change.kind == "rerun"]
    if again:
        click.echo(f"  asked again, with the same verdict: {count(len(again), 'claim')}")


def _write(page: str, old: str, new: str | None, changes: list[tuple[str, Change]]) -> None:
    """Raises Rejected where the page cannot be written."""
    from pathlib import Path

    from avow.base.diagnostics import Diagnostic, Rejected
    from avow.base.files import write_out
    from avow.report.comparison import render_comparison

    text = render_comparison(old, new or "the workspace as it is", changes)
    try:
        write_out(Path(page), text.encode("utf-8", "replace").decode())
    except OSError as error:
        raise Rejected(Diagnostic("DIFF002", f"{page} cannot be written: {error.strerror}")) from None

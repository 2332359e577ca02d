"""``avow diff``: what changed in the case between two reports, two ledgers or two git revisions."""

from __future__ import annotations

import json

import click


@click.command()
@click.argument("old")
@click.argument("new", required=False)
@click.option("--json", "as_json", is_flag=True, help="For machines.")
def command(old: str, new: str | None, as_json: bool) -> int:
    """What changed from OLD to NEW: claims, what they mean, where they stand, gates.

    Each is a report (its folder or report.json), a ledger (.jsonl), or a git revision of the workspace: then the
    contracts and plans of that revision are held against today's ledger. NEW is the workspace as it is, if left out.
    """
    from avow.assurance.compare import compare
    from avow.cli.snapshots import pair

    changes = [(system, change) for system, before, after in pair(old, new) for change in compare(before, after)]
    if as_json:
        listed = [
            {"system": s, "kind": c.kind, "subject": c.subject, "before": c.before, "after": c.after}
            for s, c in changes
        ]
        click.echo(json.dumps({"changes": listed}, indent=1))
    elif not changes:
        click.echo("nothing changed")
    else:
        for system in dict.fromkeys(s for s, _ in changes):
            click.echo(f"{system}:")
            for s, change in changes:
                if s == system:
                    click.echo(f"  {change.text}")
    return 0

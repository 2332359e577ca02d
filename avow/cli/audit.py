"""``avow audit``: is the ledger what was written, and is everything that it refers to still there?"""

from __future__ import annotations

import click

from avow.base.codec import document
from avow.cli.options import json_option


@click.command()
@click.argument("systems", metavar="[SYSTEM]...", nargs=-1)
@json_option()
@click.option(
    "--sign", type=click.Path(exists=True, dir_okay=False), help="Sign each ledger's head with this private key."
)
@click.option("--key", type=click.Path(exists=True, dir_okay=False), help="Check signatures against this public key.")
@click.option(
    "--against",
    type=click.Path(exists=True),
    help="A report, an attestation or a folder of reports, kept elsewhere: the ledgers must hold what it names.",
)
@click.option("--new-key", type=click.Path(dir_okay=False), help="Make a key pair: FILE, and FILE.pub.")
@click.option(
    "--acknowledge", metavar="REASON", help="You have seen what is lost or damaged of these ledgers: no longer open."
)
@click.option("--as", "who", metavar="NAME", help="Who acknowledges.")
def command(
    systems: tuple[str, ...],
    as_json: bool,
    sign: str | None,
    key: str | None,
    against: str | None,
    new_key: str | None,
    acknowledge: str | None,
    who: str | None,
) -> int:
    """Re-digest everything that the ledger of each SYSTEM (its name or folder; all, if none is named) refers to.

    Exit code 1 if the ledger or a file behind today's evidence was tampered with, or a ledger is not the one that the
    index of ledgers, the reports here or --against know; changed inputs are told, but only make evidence stale.
    A ledger that was cut, rolled back, rewritten or begun anew fails the gate *integrity* until a person, by name,
    says with --acknowledge that it was seen and why it happened.
    """
    from pathlib import Path

    from avow.base.persons import unreadable
    from avow.base.plain import invisible, is_blank
    from avow.base.workspace import workspace
    from avow.cli.ledgers import audit_index, audit_system, ledger_names, outside_heads, sign_all
    from avow.pipeline.integrity import reported_heads, settle_losses

    if new_key:
        from avow.evidence.signing import new_key_pair

        public = new_key_pair(Path(new_key))
        click.echo(f"private key {new_key} (keep it), public key {public}")
        return 0
    place = workspace()
    if acknowledge is not None or who is not None:
        if is_blank(acknowledge or "") or invisible(acknowledge or "") or unreadable((who or "").strip()):
            raise click.UsageError(
                'to acknowledge takes a reason and a name: --acknowledge "disk was lost" --as "A. Name"'
            )
        assert acknowledge is not None
        assert who is not None
        for name in ledger_names(place, systems, reported_heads(place)):
            for item in settle_losses(place, name, who.strip(), acknowledge.strip()):
                click.echo(f"{name}: acknowledged: {item.text}")
    anchors = (*reported_heads(place), *(outside_heads(Path(against)) if against else ()))
    found = {name: audit_system(place, name, key, anchors) for name in ledger_names(place, systems, anchors)}
    index = audit_index(place, key)
    bad = any(d.serious for ds in (index, *(ds for ds, _ in found.values())) for d in ds)
    if sign and not bad:
        for path in sign_all(place, tuple(found), Path(sign)):
            click.echo(f"signed: {path}", err=True)
    if as_json:
        listed = {
            name: {"records": count, "discrepancies": discrepancies} for name, (discrepancies, count) in found.items()
        }
        click.echo(document({"systems": listed, "index": index}))
    else:
        for name, (discrepancies, count) in found.items():
            serious = sum(d.serious for d in discrepancies)
            click.echo(f"{name}: {count} records, {serious} discrepanc{'y' if serious == 1 else 'ies'}")
            for d in discrepancies:
                click.echo(f"  {'✘' if d.serious else '·'} {d.fault}: {d.text}")
        for d in index:
            click.echo(f"index of ledgers: {d.fault}: {d.text}")
        if not found and not bad:
            click.echo("no ledger yet: run `avow verify`")
        if sign and bad:
            click.echo("not signed: there are discrepancies", err=True)
    return 1 if bad else 0

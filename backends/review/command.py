"""``avow review stamp``: the digests of what a reviewer read."""

from __future__ import annotations

import json

import click

from avow.base.codec import document


@click.group()
def command() -> None:
    """Review records: stamped with digests, signed with a key."""


@command.command("stamp")
@click.argument("system")
@click.argument("node")
@click.option("--method", help="The review's id, where the node has several.")
@click.option("--json", "as_json", is_flag=True, help="For machines.")
@click.option("--renewed", metavar="DATE", help="Everything that changed was read again on this date.")
def stamp_command(system: str, node: str, method: str | None, as_json: bool, renewed: str | None) -> int:
    """Fill the digests in that the review of NODE in SYSTEM lacks. Never refreshes one by habit: see --renewed."""
    from avow.base.workspace import system_folder

    from .stamp import stamp

    changes = stamp(system_folder(system), node, method=method, renewed=renewed)
    if as_json:
        click.echo(document({"stamped": list(changes)}))
        return 0
    click.echo("\n".join(changes) or "nothing to stamp: every digest is as it should be")
    return 0


@command.command()
@click.argument("system")
@click.argument("node")
@click.option("--method", help="The review's id, where the node has several.")
@click.option("--json", "as_json", is_flag=True, help="For machines.")
@click.option("--key", required=True, metavar="FILE", help="A private key (`avow audit --new-key`).")
def sign(system: str, node: str, method: str | None, as_json: bool, key: str) -> int:
    """Sign the review of NODE in SYSTEM as it is now: RECORD.sig, beside it, vouches for these bytes.

    A record that was changed afterwards, be it by a stamp, has to be read and signed again. With `key: FILE` (a public
    key) the plan says whose signature counts.
    """
    from pathlib import Path

    from avow.base.diagnostics import Diagnostic, Rejected
    from avow.base.workspace import system_folder

    from .signature import sign_record
    from .stamp import record_of

    try:
        found = sign_record(record_of(system_folder(system), node, method)[0], Path(key))
    except OSError as error:
        raise Rejected(Diagnostic("REV123", f"the signature cannot be written: {error.strerror}")) from None
    click.echo(json.dumps({"signed": str(found)}) if as_json else f"signed: {found}")
    return 0

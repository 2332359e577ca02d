"""``avow doctor``: which tools are here."""

from __future__ import annotations

import click

from avow.base.codec import document
from avow.cli.options import json_option


@click.command()
@json_option()
def command(as_json: bool) -> int:
    """Which backends' tools are here, which versions, and the one command that installs a missing one."""
    from avow.pipeline.doctor import findings

    found = findings()
    if as_json:
        click.echo(document({"tools": found}))
    else:
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        table = Table("for", "tool", "version", "where, or how to get it", box=None, header_style="bold")
        for f in found:
            state = "[yellow]missing[/]" if f.version is None else f"[green]{f.version}[/]"
            where = f.install if f.version is None else f.path or ""
            table.add_row(escape(f.used_by), escape(f.tool), state, escape(where))
        Console(highlight=False, soft_wrap=True).print(table)
    return 3 if any(f.version is None and not f.optional for f in found) else 0

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
        click.echo(document({"tools": [f.json() for f in found]}))
    else:
        from rich.console import Console
        from rich.markup import escape
        from rich.table import Table

        table = Table("for", "tool", "version", "where, or how to get it", box=None, header_style="bold")
        for f in found:
            state = f"[green]{f.tool.version}[/]" if f.tool.present else "[yellow]missing[/]"
            where = f.tool.path or "" if f.tool.present else f.tool.install
            table.add_row(escape(f.used_by), escape(f.tool.name), state, escape(where))
        Console(highlight=False, soft_wrap=True).print(table)
    return 3 if any(not f.tool.present and not f.tool.optional for f in found) else 0

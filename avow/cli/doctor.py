"""``avow doctor``: which tools are installed, and whether they work."""

from __future__ import annotations

import click

from avow.base.codec import document
from avow.cli.options import json_option


@click.command()
@json_option()
def command(as_json: bool) -> int:
    """Tries each tool with a one-line job; of a missing one, names the command that installs it.

    Ends with 3 if a backend lacks the tool that it cannot work without."""
    from avow.pipeline.doctor import findings

    found = findings(tried=True)
    if as_json:
        click.echo(document({"tools": found}))
    else:
        width = max(len(f.used_by) for f in found)
        for f in found:
            if f.version is None:
                state, colour, where = "missing", "yellow", f.install
            elif f.fault:
                state, colour, where = f"{f.version} fails", "red", f"{f.fault} ({f.path or f.install})"
            else:
                state, colour, where = f.version, "green", f.path or ""
            click.echo(f"{f.used_by:<{width}}  {f.tool:<13} {click.style(f'{state:<13}', fg=colour)} {where}".rstrip())
    return 3 if any((f.version is None or f.fault) and not f.optional for f in found) else 0

"""``avow fretish``: FRETish requirements as nodes of a contract."""

from __future__ import annotations

from pathlib import Path

import click

from avow.base.codec import document
from avow.base.diagnostics import Rejected
from avow.base.rendering import render
from avow.cli.options import PathArgument, json_option
from avow.cli.translate import put
from avow.fretish.project import nodes, read


@click.command()
@click.argument("file", type=PathArgument(exists=True, dir_okay=False))
@click.option("--outputs", metavar="NAMES", default="", help="Of the names that FRET says nothing of, outputs: a,b.")
@click.option("-o", "--output", type=PathArgument(), help="Write to this file.")
@json_option()
def command(file: Path, outputs: str, output: Path | None, as_json: bool) -> int:
    """The requirements in FILE as nodes of a contract: what FRET exports (JSON), or FRETish sentences, one on a line.

    Code 1 where sentences are left out, 2 where none can be read.
    """
    project = read(file)
    made = nodes(project, frozenset(name.strip() for name in outputs.split(",") if name.strip()))
    left = [fault for fault in made.faults if fault.is_error]
    if not made.text:
        raise Rejected(*made.faults)
    if as_json:
        click.echo(document({"text": made.text, "left_out": [fault.message for fault in left]}))
    elif made.faults:
        click.echo(render(made.faults), err=True)
    if output is not None or not as_json:
        put(made.text, output)
    return 1 if left else 0

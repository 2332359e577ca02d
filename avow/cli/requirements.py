"""``avow requirements``: requirements of another tool as a section of a plan."""

from __future__ import annotations

from pathlib import Path

import click

from avow.assurance.requirements_import import plan_section, read_requirements
from avow.base.codec import document
from avow.cli.options import PathArgument, json_option


@click.command()
@click.argument("file", type=PathArgument(exists=True, dir_okay=False))
@json_option()
def command(file: Path, as_json: bool) -> int:
    """The requirements in FILE (CSV or ReqIF) as the `requirements:` section of a plan.yaml, on standard output."""
    found = read_requirements(file)
    if as_json:
        keys = ("id", "text", "formula", "temporal", "supported_by")
        listed = [{key: getattr(r, key) for key in keys} for r in found]
        click.echo(document({"requirements": listed}))
    else:
        click.echo(plan_section(found), nl=False)
    return 0

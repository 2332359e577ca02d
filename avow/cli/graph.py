"""``avow graph``: how a system is wired: nodes, topics, types, and the environment's inputs."""

from __future__ import annotations

from pathlib import Path

import click

from avow.base.codec import document
from avow.base.diagnostics import refuse
from avow.cli.options import ContractArgument, json_option, system_of
from avow.system.folding import seen
from avow.system.graph import dataflow
from avow.system.graph_svg import sheet
from avow.system.wiring import wiring


@click.command()
@click.argument("path", metavar="SYSTEM", type=ContractArgument())
@click.option("--svg", "as_svg", is_flag=True, help="The dataflow as a picture, nothing else.")
@json_option()
def command(path: Path, as_svg: bool, as_json: bool) -> int:
    """Show how a system is wired.

    SYSTEM is a system's name or folder, or an .rcl file. Of each node the name under which it runs and its remappings;
    of each topic its type, who publishes it and who listens, what comes from the environment, and what arrives one
    step later. Several publishers of one topic are heard each, at any step.
    """
    system = system_of(path)
    graph = dataflow(system)
    refuse(graph.findings)
    found = wiring(system, graph)
    if as_json:
        click.echo(document({"system": system.name, **found.json()}))
    elif as_svg:
        click.echo(sheet(seen(system, graph)))
    else:
        click.echo(found.text())
    return 0

"""``avow init``: a new workspace."""

from __future__ import annotations

import os
import re
from importlib import resources
from pathlib import Path
from shlex import quote

import click

from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write
from avow.base.suggestions import suggest
from avow.base.workspace import find_workspace
from avow.cli.options import PathArgument, json_option
from avow.ros.sources import DISTRIBUTIONS

_TEMPLATES = Path(str(resources.files("avow.cli")))
_PARTS = ("gitignore.txt", "dodo.txt", "monitor.txt")
"""Files of the templates that are not copied as they are."""


@click.command()
@click.argument("directory", type=PathArgument(file_okay=False))
@click.option("--template", type=click.Choice(["ros1", "ros2", "plain"]), help="What the new system is.  [plain]")
@click.option("--from-bag", "bag", type=PathArgument(exists=True), help="Draft the system from a ROS bag.")
@click.option(
    "--from-graph",
    "graph",
    metavar="SOURCE",
    help="Draft it from a running ROS 1 master (`ros1`, or its http://… address), from a running ROS 2 graph "
    "(`ros2[:DOMAIN][@ADDRESS]`, over DDS), or from a file: what `rosnode info` or `ros2 node info` say of the nodes, "
    "or JSON.",
)
@click.option("--distro", help="The ROS distribution whose message types hold: noetic, humble, jazzy, …")
@click.option("--messages", type=PathArgument(exists=True), multiple=True, help="The folder of your own .msg files.")
@json_option()
def command(
    directory: Path,
    template: str | None,
    bag: Path | None,
    graph: str | None,
    distro: str | None,
    messages: tuple[Path, ...],
    as_json: bool,
) -> int:
    """Make DIRECTORY a workspace with one system that verifies. Nothing that exists is overwritten.

    With a template for ROS it is a package, too, whose test runs `avow verify`, and a monitor judges a recorded run.
    With --from-bag or --from-graph (or both) the system is drafted from what was recorded or runs: nodes, ports,
    topics, types and mapping, for you to correct; what a node promises is left to write. Where DIRECTORY is a new
    folder in a workspace's contracts/, only the system is made.
    """
    drafted = bag is not None or graph is not None
    if directory.exists() and any(directory.iterdir()):
        hint = "give the name of a new folder, or of an empty one"
        if drafted and (place := find_workspace(directory.resolve())) is not None:
            new = quote(os.path.relpath(place.contracts / f"{directory.resolve().name}_new"))
            hint = f"draft again beside it, and compare: `avow init {new}` with the same options"
        raise Rejected(Diagnostic("CLI007", f"{directory} is not empty", hint=hint))
    if drafted and template is not None:
        raise click.UsageError("a draft has no template: leave --template out")
    if not drafted and (distro is not None or messages):
        raise click.UsageError("--distro and --messages go with --from-bag or --from-graph")
    if distro is not None and distro not in DISTRIBUTIONS:
        hint = suggest(distro, DISTRIBUTIONS) or f"known: {', '.join(DISTRIBUTIONS)}"
        raise click.UsageError(f"--distro: there is no distribution '{distro}'; {hint}")
    if drafted:
        return _drafted(directory, bag, graph, distro, messages, as_json)
    _from_template(directory, template or "plain")
    _workspace(directory)
    return _told(directory, "thermostat", "doit verify", as_json)


def _drafted(
    directory: Path, bag: Path | None, graph: str | None, distro: str | None, own: tuple[Path, ...], as_json: bool
) -> int:
    from avow.cli.from_ros import draft_system

    outer = find_workspace(directory.resolve().parent)
    within = outer is not None and directory.resolve().parent == outer.contracts.resolve()
    name = re.sub(r"[^A-Za-z0-9_-]", "_", directory.resolve().name).lstrip("_-0123456789") or "robot"
    for text in draft_system(bag, graph, distro, own, directory if within else directory / "contracts" / name):
        click.echo(f"warning: {text}", err=True)
    if not within:
        _workspace(directory)
    name = directory.name if within else name
    return _told(directory, name, f"avow check {name}", as_json)


def _from_template(directory: Path, template: str) -> None:
    for part in ("template", *(("template_ros",) if template != "plain" else ())):
        origin = _TEMPLATES / part
        for source in sorted(origin.rglob("*")):
            if source.is_file() and source.name not in _PARTS and "__pycache__" not in source.parts:
                write(directory / source.relative_to(origin), source.read_bytes())
    if template != "plain":
        plan = directory / "contracts/thermostat/plan.yaml"
        monitor = (_TEMPLATES / "template_ros/monitor.txt").read_text("utf-8").replace("ROS", template)
        write(plan, plan.read_text("utf-8").replace("\n\npolicy:", f"\n{monitor}\npolicy:"))


def _workspace(directory: Path) -> None:
    """The files of every workspace."""
    for name, source in ((".gitignore", "gitignore.txt"), ("dodo.py", "dodo.txt")):
        write(directory / name, (_TEMPLATES / "template" / source).read_bytes())
    for folder in ("artifacts", "reports"):
        write(directory / folder / "README.md", f"Made by `doit verify`: see Avow's documentation of {folder}/.\n")


def _told(directory: Path, system: str, next_: str, as_json: bool) -> int:
    if as_json:
        click.echo(document({"workspace": str(directory), "systems": [system], "next": next_}))
        return 0
    go = "" if directory.resolve() == Path.cwd() else f"  cd {quote(str(directory))}\n"
    made = "a system" if directory.resolve().parent.name == "contracts" else "a workspace with one system"
    where = system if directory.name == system else f"contracts/{system}"
    click.echo(f"{directory}: {made}, {where}\n\nnext:\n{go}  {next_}")
    return 0

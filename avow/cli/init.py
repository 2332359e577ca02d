"""``avow init``: a new workspace."""

from __future__ import annotations

import json
from pathlib import Path

import click

from avow.cli.options import json_option
from avow.cli.paths import PathArgument

_DODO = '''"""The pipeline as doit tasks: `doit verify` does everything for every system under contracts/."""

import sys
from pathlib import Path

if Path(sys.path[0]).resolve() == Path(__file__).resolve().parent:
    del sys.path[0]  # put there by doit: no module of this folder is to stand in for one of Avow's

from avow.pipeline.tasks import Pipeline

RUN = Pipeline(Path(__file__).parent, sys.argv[1:])
DOIT_CONFIG = RUN.config()


def task_avow():
    """all stages from check to verify, for each system, node and method"""
    yield from RUN.tasks()
'''


_MONITOR = """\
      - rosmonitoring:                 # a recorded run; `avow monitor --help` tells how to make one of a bag
          ros_version: {}
          traces: [traces/morning.jsonl]
          answers: {{by: arrival, because: "written by one process, each answer after its input"}}
          mapping: {{in.temperature: data, out.mode: data}}
"""


@click.command()
@click.argument("directory", type=PathArgument(file_okay=False))
@click.option("--template", type=click.Choice(["ros1", "ros2", "plain"]), default="plain", show_default=True)
@json_option()
def command(directory: Path, template: str, as_json: bool) -> int:
    """Make DIRECTORY a workspace with one system that verifies. Nothing that exists is overwritten.

    With a template for ROS it is a package, too, whose test runs `avow verify`, and a monitor judges a recorded run.
    """
    from importlib import resources

    from avow.base.diagnostics import Diagnostic, Rejected
    from avow.base.files import write

    if directory.exists() and any(directory.iterdir()):
        raise Rejected(
            Diagnostic("CLI007", f"{directory} is not empty", hint="give the name of a new folder, or of an empty one")
        )
    for part in ("template", *(("template_ros",) if template != "plain" else ())):
        origin = Path(str(resources.files("avow.cli") / part))
        for source in sorted(origin.rglob("*")):
            if source.is_file() and "__pycache__" not in source.parts:
                name = source.relative_to(origin)
                write(directory / (".gitignore" if name.name == "gitignore.txt" else name), source.read_bytes())
    if template != "plain":
        plan = directory / "contracts/thermostat/plan.yaml"
        write(plan, plan.read_text("utf-8").replace("\n\npolicy:", f"\n{_MONITOR.format(template)}\npolicy:"))
    write(directory / "dodo.py", _DODO)
    for folder in ("artifacts", "reports"):
        write(directory / folder / "README.md", f"Made by `doit verify`: see Avow's documentation of {folder}/.\n")
    if as_json:
        click.echo(
            json.dumps({"workspace": str(directory), "systems": ["thermostat"], "next": "doit verify"}, indent=1)
        )
        return 0
    go = "" if directory.resolve() == Path.cwd() else f"  cd {directory}\n"
    click.echo(f"{directory}: a workspace with one system, contracts/thermostat\n\nnext:\n{go}  doit verify")
    return 0

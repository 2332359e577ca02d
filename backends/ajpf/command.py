"""``avow agent``: agent programs, apart from any contract."""

from __future__ import annotations

import json
from pathlib import Path

import click


@click.group(name="agent")
def command() -> None:
    """Agent programs (Gwendolen), apart from any contract."""


@command.command(name="run")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--environment", type=click.Path(path_type=Path), help="What there is to perceive (YAML); else nothing.")
@click.option("--semantics", type=click.Choice(["mcapl", "edge"]), default="mcapl", show_default=True)
@click.option(
    "--seed",
    default=0,
    show_default=True,
    type=click.IntRange(0, 2**31 - 1),
    help="Where random choices start: the same seed, the same answer.",
)
@click.option("--steps", type=click.IntRange(1, 100_000), default=200, show_default=True, help="At most so many.")
@click.option("--json", "as_json", is_flag=True, help="For machines: one JSON object a step (JSON lines).")
def run(file: Path, environment: Path | None, semantics: str, seed: int, steps: int, as_json: bool) -> int:
    """One run of the agents in FILE, told step by step, by the interpreter whose every run the method `ajpf` checks.

    Code 1 where the agent ends with an error of its own; code 2 if the program or the environment cannot be read.
    """
    from dataclasses import asdict

    from .beliefs import TooDeep
    from .builtin import Crash
    from .environment import Environment, read_environment
    from .interpreter import Semantics
    from .narrate import narrated
    from .parser import read_system
    from .society import system

    programs = read_system(file)
    draws = (
        Environment((), {}, {}, frozenset(), True, "once", ()) if environment is None else read_environment(environment)
    )
    agents = system(programs, draws, Semantics(semantics))
    try:
        for number, step in enumerate(narrated(agents, seed, steps), start=1):
            if as_json:
                click.echo(json.dumps({"step": number, **asdict(step)}, ensure_ascii=False))
                continue
            for at, line in enumerate(step.lines()):
                click.echo(f"{number if at == 0 else '':>4}  {line}")
    except Crash as error:
        click.echo(f"the agent ends with an error of its own: {error}", err=True)
        return 1
    except (TooDeep, RecursionError):
        click.echo("the agent's terms or reasoning rules nest too deeply, or ask for too much", err=True)
        return 1
    return 0

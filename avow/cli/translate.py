"""``avow translate``: a contract in other notations."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, cast

import click

if TYPE_CHECKING:
    from avow.language.contract import Contract

NOTATIONS = {
    **dict.fromkeys(("rcl", "text", "unicode", "latex", "json"), "avow.language.translate"),
    "smtlib": "avow.logic.contract_smtlib",
}
"""Notation → the module with its function ``to_<notation>(contract) -> str``, imported when it is asked for."""


@click.command()
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--to", "notation", required=True, type=click.Choice(sorted(NOTATIONS)), help="The notation.")
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), help="Write to this file.")
def command(paths: tuple[Path, ...], notation: str, output: Path | None) -> int:
    """Print a contract in another notation.

    PATHS are the .rcl files of one contract, or a system's folder.
    """
    from avow.files import write
    from avow.language.load import load_contract

    module = importlib.import_module(NOTATIONS[notation])
    translate = cast("Callable[[Contract], str]", getattr(module, f"to_{notation}"))
    text = translate(load_contract(_files(paths)))
    if output is None:
        click.echo(text, nl=False)
    else:
        write(output, text)
    return 0


def _files(paths: tuple[Path, ...]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        if (path / "plan.yaml").is_file():
            from avow.system.plan_file import read_plan

            found.extend(read_plan(path / "plan.yaml")[0].contract_files)
        elif path.is_dir():
            found.extend(sorted(path.glob("*.rcl")))
        else:
            found.append(path)
    return found

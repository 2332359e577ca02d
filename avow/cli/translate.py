"""``avow translate``: a contract in other notations."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path, PurePosixPath

import click

from avow.backend_kit import one_step
from avow.backend_kit.registry import translators, trust_plugins
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.files import write, write_out
from avow.base.rendering import render, told
from avow.cli.options import ContractArgument, PathArgument, has_nodes, json_option, node_option
from avow.language.contract import Contract
from avow.language.load import load_contract
from avow.system.load import load_bare, load_system
from avow.system.plan import System
from avow.system.plan_file import read_plan

NOTATIONS = {
    **dict.fromkeys(("rcl", "unicode", "json"), "avow.language.translate"),
    "smtlib": "avow.solving.smtlib",
    "fretish": "avow.fretish.writing",
}
"""Notation → the module with its function ``to_<notation>(contract)``, imported on demand: it gives a text, or
(`avow.language.contract.Partial`) a text and the omissions. Further notations are those of the backends
(`avow.backend_kit.protocol.Backend`)."""


@click.command()
@click.argument("paths", metavar="SYSTEM...", nargs=-1, required=True, type=ContractArgument())
@click.option(
    "--to",
    "notation",
    required=True,
    metavar="NOTATION",
    help=f"One of {', '.join(sorted(NOTATIONS))}; or one that a backend offers, such as dafny or rml.",
)
@node_option()
@click.option("-o", "--output", type=PathArgument(), help="Write to this file, or (dafny, rml) into this folder.")
@json_option("each file's text, or where it was written, and what is left out")
def command(paths: tuple[Path, ...], notation: str, nodes: tuple[str, ...], output: Path | None, as_json: bool) -> int:
    """Print a contract in another notation.

    Each SYSTEM is an .rcl file (several are one contract), or a system's name or folder (whose plan the notations of
    backends may need). Code 1 where guarantees are left out, since the notation cannot say them; 2 where nothing can be
    translated.
    """
    trust_plugins()
    if notation not in NOTATIONS:
        return _by_backend(notation, paths, nodes, output, as_json)
    contract = _only(load_contract(_files(paths)), nodes)
    module = importlib.import_module(NOTATIONS[notation])
    translated = getattr(module, f"to_{notation}")(contract)
    text = translated if isinstance(translated, str) else translated.text
    missing = [] if isinstance(translated, str) else translated.missing
    if missing and not text:
        raise Rejected(*missing)
    if not as_json or output is not None:
        put(text, output)
    if as_json:
        click.echo(_data(notation, {output.name if output else "": text}, [*missing], output))
    elif missing:
        click.echo(render(missing), err=True)
    return 1 if missing else 0


def _by_backend(
    notation: str, paths: tuple[Path, ...], nodes: tuple[str, ...], output: Path | None, as_json: bool
) -> int:
    system = load_system(paths[0]) if len(paths) == 1 and paths[0].is_dir() else load_bare(_files(paths))
    known = translators(system.plan.plugins)
    if notation not in known:
        every = ", ".join(sorted({*NOTATIONS, *known}))
        raise click.UsageError(f"there is no notation '{notation}'; known: {every}")
    files: dict[str, str] = {}
    missing: list[Diagnostic] = []
    refused: list[Diagnostic] = []
    for node in _only(system.contract, nodes).nodes:
        try:
            made = one_step.translate(known[notation], notation, system, node)
        except Rejected as rejected:
            refused += rejected.diagnostics
            continue
        missing += made.missing
        files.update({f"{_folder(node.name, system)}/{name}": text for name, text in made.files.items()})
    if not files:
        missing = [replace(fault, severity=Severity.ERROR) for fault in missing]
    if as_json:
        click.echo(_data(notation, files, [*refused, *missing], output))
    elif refused or missing:
        click.echo(render([*refused, *missing]), err=True)
    if not files:
        return 2
    if not as_json or output is not None:
        _put_all(files, output, told=not as_json)
    return 1 if refused or missing else 0


def _only(contract: Contract, nodes: tuple[str, ...]) -> Contract:
    has_nodes(contract, nodes)
    return replace(contract, nodes=tuple(n for n in contract.nodes if n.name in nodes)) if nodes else contract


def _folder(node: str, system: System) -> str:
    """A folder's name for a node: names of RCL are safe file names except for their primes, and case may not
    distinguish two."""
    folded = [other.name for other in system.contract.nodes if other.name.casefold() == node.casefold()]
    return node if len(folded) == 1 else f"{node}_{folded.index(node) + 1}"


def _data(notation: str, files: dict[str, str], left_out: list[Diagnostic], output: Path | None) -> str:
    listed = [{"name": name, "text": text} for name, text in files.items()]
    written = None if output is None else str(output)
    whole = {"notation": notation, "files": listed, "written": written, "left_out": told(left_out).diagnostics}
    return document(whole)


def _put_all(files: dict[str, str], output: Path | None, *, told: bool) -> None:
    """Several files go into a folder; on the terminal, each under its name."""
    if output is None:
        for name, text in files.items():
            click.echo((f"// ---- {name}\n" if len(files) > 1 else "") + text, nl=False)
        return
    if output.exists() and not output.is_dir():
        raise click.UsageError(f"{output} is a file, and this notation has {len(files)} files: name a folder")
    for name, text in files.items():
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
            raise click.UsageError(f"the backend wants to write outside the folder: {name}")
        write(output / name, text)
        if told:
            click.echo(f"wrote {output / name}")


def put(text: str, output: Path | None) -> None:
    """To a file, or to the terminal."""
    if output is None:
        click.echo(text, nl=False)
    elif output.is_dir():
        raise click.UsageError(f"{output} is a folder; name a file")
    else:
        write_out(output, text)


def _files(paths: tuple[Path, ...]) -> list[Path]:
    found: list[Path] = []
    for path in paths:
        if (path / "plan.yaml").is_file():
            found.extend(read_plan(path / "plan.yaml")[0].contract_files)
        elif path.is_dir():
            files = sorted(path.glob("*.rcl"))
            if not files:
                raise Rejected(Diagnostic("RCL002", f"{path} holds neither a plan.yaml nor an .rcl file"))
            found.extend(files)
        else:
            found.append(path)
    return found

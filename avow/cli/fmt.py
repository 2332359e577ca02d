"""``avow fmt``: the canonical layout of .rcl files."""

from __future__ import annotations

import stat
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from avow.base.codec import document
from avow.base.files import read_regular
from avow.base.tuning.sizes import CONTRACT_BYTES
from avow.cli.options import ContractArgument, json_option

if TYPE_CHECKING:
    from avow.base.diagnostics import Diagnostic


@click.command()
@click.argument("paths", metavar="SYSTEM...", nargs=-1, required=True, type=ContractArgument(allow_dash=True))
@click.option("--check", is_flag=True, help="Change nothing; code 1 where a file is not in the canonical layout.")
@json_option("which files are changed, or would be")
def command(paths: tuple[Path, ...], check: bool, as_json: bool) -> int:
    """Put contracts into the canonical layout, in place. Comments are kept, and the meaning.

    Each SYSTEM is a system's name, a folder, an .rcl file, or - for the standard input. A file with a syntax error
    stays as it is.
    """
    from avow.base.diagnostics import Diagnostic, Rejected
    from avow.base.files import write
    from avow.base.rendering import printable, render
    from avow.base.rendering import told as shown
    from avow.language.format import format_text
    from avow.language.load import decode, read_source
    from avow.language.source import Source

    faults: list[Diagnostic] = []
    changed: list[str] = []
    for path in _files(paths, faults):
        source = decode(sys.stdin.buffer.read(CONTRACT_BYTES + 1), "<stdin>") if str(path) == "-" else read_source(path)
        if not isinstance(source, Source):
            faults.append(source)
            continue
        try:
            formatted = format_text(source.text, source.file)
        except Rejected as rejected:
            faults.extend(rejected.diagnostics)
            continue
        if str(path) == "-" and not (check or as_json):
            click.echo(formatted, nl=False)
            continue
        before = source.text if str(path) == "-" else read_regular(path).decode("utf-8")
        if formatted == before:
            continue
        changed.append(printable(str(path)))
        if check:
            if not as_json:
                click.echo(f"{printable(str(path))} is not in the canonical layout")
        elif str(path) != "-":
            target = path.resolve()  # follow a symbolic link, do not replace it
            mode = target.stat().st_mode
            if not mode & stat.S_IWUSR:
                faults.append(Diagnostic("RCL002", f"{path} is read-only and stays as it is"))
                continue
            write(target, formatted)
            target.chmod(stat.S_IMODE(mode))
            if not as_json:
                click.echo(f"formatted {printable(str(path))}")
    if as_json:
        told = {"changed": changed, "written": not check, "faults": shown(faults).diagnostics}
        click.echo(document(told))
    if faults:
        click.echo(render(faults), err=True)
        return 2
    return 1 if changed and check else 0


def _files(paths: tuple[Path, ...], faults: list[Diagnostic]) -> list[Path]:
    from avow.base.diagnostics import Diagnostic

    found: dict[Path, None] = {}
    for path in paths:
        files = sorted(path.rglob("*.rcl")) if path.is_dir() else [path]
        if not files:
            faults.append(Diagnostic("RCL002", f"{path} holds no .rcl file"))
        found.update(dict.fromkeys(files))
    return list(found)

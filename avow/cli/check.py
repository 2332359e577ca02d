"""``avow check``: diagnostics for .rcl files, in milliseconds; for a system's folder, also of its plan."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from avow.base.codec import document
from avow.base.codes import LANGUAGE, is_lint, known, sections
from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.plain import count
from avow.base.rendering import render, summary, to_sarif, told
from avow.base.suggestions import did_you_mean
from avow.base.workspace import system_folder
from avow.cli.options import ContractArgument, json_option

if TYPE_CHECKING:
    from avow.base.remembered import Shelf


@click.command()
@click.argument("paths", metavar="SYSTEM...", nargs=-1, required=True, type=ContractArgument())
@json_option("see docs/schemas/check.schema.json")
@click.option("--sarif", is_flag=True, help="For machines: SARIF 2.1.0.")
@click.option("--off", "off", multiple=True, metavar="CODE", help="A warning that is not wanted (may be repeated).")
@click.option("--explain", is_flag=True, help="Below each kind of diagnostic found, what it means.")
def command(paths: tuple[Path, ...], as_json: bool, sarif: bool, off: tuple[str, ...], explain: bool) -> int:
    """Check contracts: syntax, names, types, and lints.

    Each SYSTEM is a system's name or folder, or an .rcl file. Files of one folder are one contract. Of a system, the
    plan is checked too: its names, and what each method's tool says of its options. Code 2 where anything is an
    error.
    """
    from avow import __version__

    if off:
        from avow.backend_kit.registry import every_code

        if unknown := [code for code in off if code not in every_code()]:
            near = did_you_mean(unknown[0], every_code()) or "each message shows its own, such as RCL402"
            raise click.UsageError(f"--off: there is no code {unknown[0]}; {near}")
    found: list[Diagnostic] = []
    files = 0
    folders = dict.fromkeys(path for path in paths if (path / "plan.yaml").is_file())
    shelves = {folder: _shelf(folder) for folder in folders}
    for group, group_off in _groups(paths, found):
        from avow.language.load import check_paths

        files += len(group)
        shelf = shelves.get(group[0].parent) if group else None
        found.extend(check_paths(group, off=group_off | frozenset(off), shelf=shelf)[1])
    for folder in folders:
        found.extend(
            d for d in _of_plan(folder, shelves[folder]) if d not in found and (d.is_error or d.code not in off)
        )
        shelves[folder].keep()
    found.sort(key=lambda d: list(Severity).index(d.severity))
    if as_json:
        click.echo(document(told(found)))
    elif sarif:
        click.echo(document(to_sarif(found, version=__version__)))
    else:
        if found:
            click.echo(render(found, colour=sys.stdout.isatty()))
        if explain:
            _explain(found)
        click.echo(f"{count(files, 'file')}: {summary(found)}")
    return 2 if any(d.is_error for d in found) else 0


def _explain(found: list[Diagnostic]) -> None:
    for code in sorted({d.code for d in found} & known().keys()):
        said = known()[code]
        click.echo(f"{code} ({said.title}): {' '.join(filter(None, (said.explanation, said.remedy)))}\n")


def _groups(paths: tuple[Path, ...], found: list[Diagnostic]) -> list[tuple[list[Path], frozenset[str]]]:
    """The contracts to check, each with its files and the lints that its plan switches off."""
    by_folder: dict[Path, list[Path]] = {}
    groups: list[tuple[list[Path], frozenset[str]]] = []
    for path in dict.fromkeys(paths):
        if path.is_dir():
            groups.append(_system(path, found))
        elif path.suffix != ".rcl" and not path.exists():
            found.extend(_no_system(path))
        else:
            by_folder.setdefault(path.parent, []).append(path)
    groups += [(files, _off(folder)) for folder, files in by_folder.items()]
    return groups


def _no_system(path: Path) -> Iterator[Diagnostic]:
    try:
        system_folder(str(path))
    except Rejected as rejected:
        yield from rejected.diagnostics


def _system(folder: Path, found: list[Diagnostic]) -> tuple[list[Path], frozenset[str]]:
    """The contract files of a system's folder; without a plan, every .rcl file in it."""
    from avow.system.plan_file import read_rest

    plan_file = folder / "plan.yaml"
    if plan_file.is_file():
        try:
            plan, _, faults, *_ = read_rest(plan_file)
        except Rejected as rejected:
            found.extend(_as_told(d, folder) for d in rejected.diagnostics)
            lints = frozenset(filter(is_lint, sections()[LANGUAGE]))  # which of them are off is unknown
            return sorted(folder.glob("*.rcl")), lints
        found.extend(_as_told(d, folder) for d in faults)
        given = Path.cwd() / folder
        names = [folder / f.relative_to(given) if f.is_relative_to(given) else f for f in plan.contract_files]
        return names, plan.off
    files = sorted(folder.glob("*.rcl"))
    if not files:
        found.append(Diagnostic("RCL002", f"{folder} holds neither a plan.yaml nor an .rcl file"))
    return files, frozenset()


def _shelf(folder: Path) -> Shelf:
    """The cache of a system's read nodes, the same as for `avow verify`."""
    from avow.base.remembered import Shelf
    from avow.pipeline.engine_code import reading_digest

    return Shelf(folder, reading_digest())


def _of_plan(folder: Path, shelf: Shelf) -> Iterator[Diagnostic]:
    """The diagnostics of the folder's plan, without those of its contract files (which are checked already)."""
    from avow.pipeline.plan_check import of_plan, of_rest
    from avow.system.faults import in_order
    from avow.system.load import load_system

    try:
        found = of_plan(load_system(folder, shelf), shelf=shelf)
    except Rejected as rejected:
        # errors in contract files are already reported; formulas of the plan have errors with the same codes
        every = in_order((*rejected.diagnostics, *of_rest(folder)))
        found = tuple(d for d in every if not (d.code.startswith("RCL") and d.span and d.span.file.endswith(".rcl")))
    yield from (_as_told(d, folder) for d in found)


def _as_told(found: Diagnostic, folder: Path) -> Diagnostic:
    """The diagnostic with its paths under the folder as given to the command; tools get absolute ones."""

    def near(span: Span | None) -> Span | None:
        if span is None or not Path(span.file).is_relative_to(folder.resolve()):
            return span
        return replace(span, file=str(folder / Path(span.file).relative_to(folder.resolve())))

    return replace(found, span=near(found.span), notes=tuple((text, near(span)) for text, span in found.notes))


def _off(folder: Path) -> frozenset[str]:
    """The lints that the plan beside a file switches off; none if there is no readable plan."""
    if not (folder / "plan.yaml").is_file():
        return frozenset()
    from avow.system.plan_file import read_plan

    try:
        return read_plan(folder / "plan.yaml")[0].off
    except Rejected:
        return frozenset()

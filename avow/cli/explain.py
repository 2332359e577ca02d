"""``avow explain``: one obligation, and everything that is known of it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import click

from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tuning.shown import DIFF_REASONS
from avow.cli.options import json_option

if TYPE_CHECKING:
    from avow.assurance.model import Case, ObligationView
    from avow.base.workspace import Workspace


@click.command()
@click.argument("name", metavar="ID")
@json_option()
def command(name: str, as_json: bool) -> int:
    """Any name of a report. Of an obligation: its formula, where it stands, its evidence, how to run it again.

    ID is an obligation's id, whole (system/node/kind/name) or in part, a guarantee as node.name, or the name of a
    requirement, a supposition (S1, or its key), a node, a gate, a weakening, a derivation, a method, an element of the
    argument (G4 of gsn.yaml), a digest, a file, a diagnostic's code, or a word such as argued. It is told as the report
    has it, and where that is not what the ledger says: exit code 1, or 2 where the ledger cannot be read.
    """
    from avow.assurance.codec import to_json
    from avow.base.workspace import workspace
    from avow.cli.ledgers import find_claim, reported_cases, unreported

    place = workspace()
    cases_here = reported_cases(place)
    told = [*_others(cases_here, name), *_left_out(place, cases_here, name)]
    try:
        found = find_claim(cases_here, name, unreported(place, cases_here))
    except Rejected:
        if not told:
            raise
        found = ()
    systems = dict.fromkeys([*(system for system, _, _ in told), *(case.system for case, _ in found)])
    wrong, faults = _held_against_ledgers(place, [case for case in cases_here if case.system in systems])
    told = [(system, title, lines) for system, title, lines in told if system in wrong]
    found = tuple((case, view) for case, view in found if case.system in wrong)
    wrong = {system: lines for system, lines in wrong.items() if lines}
    if as_json:
        wanted = {view.id for _, view in found}
        cases = {case.system: case for case, _ in found}.values()
        listed = [o for case in cases for o in to_json(case)["obligations"] if _id(o["obligation"]) in wanted]
        others = [{"system": system, "title": title, "lines": lines} for system, title, lines in told]
        click.echo(document({"obligations": listed, "others": others, "differences": wrong}))
    else:
        _show(told, found, wrong)
    if faults:
        raise Rejected(*faults)
    return 1 if wrong else 0


def _show(
    told: Sequence[tuple[str, str, list[str]]],
    found: Sequence[tuple[Case, ObligationView]],
    wrong: Mapping[str, Sequence[str]],
) -> None:
    from avow.report.terminal import show_obligation

    for system, lines in wrong.items():
        click.echo(f"{system}: as of an earlier state: its report does not say what the ledger says")
        for line in lines[:DIFF_REASONS]:
            click.echo(f"  ✘ {line}")
        if len(lines) > DIFF_REASONS:
            click.echo(f"  and {len(lines) - DIFF_REASONS} more: `avow report --check {system}`")
        click.echo()
    for system, title, lines in told:
        click.echo(f"{system}: {title}")
        for line in lines:
            click.echo(f"  {line}")
        click.echo()
    for at, (case, view) in enumerate(found[:20]):
        if at:
            click.echo()
        show_obligation(case, view)
    if len(found) > 20:
        click.echo(f"\nand {len(found) - 20} more obligations of that name")


def _held_against_ledgers(place: Workspace, cases: Sequence[Case]) -> tuple[dict[str, list[str]], list[Diagnostic]]:
    """System → how its report differs from its ledger, where that can be read; what is wrong where it cannot."""
    from avow.cli.ledgers import readable
    from avow.pipeline.report_check import differences

    wrong: dict[str, list[str]] = {}
    faults: list[Diagnostic] = []
    for case in cases:
        path = place.ledger(case.system)
        try:
            with readable(path):
                wrong[case.system] = list(differences(case, path, place.root))
        except Rejected as rejected:
            faults += rejected.diagnostics
    return wrong, faults


def _others(cases: Sequence[Case], name: str) -> list[tuple[str, str, list[str]]]:
    """(system, heading, lines) of what is no obligation; a word is told once."""
    from avow.report.explained import explained

    found: dict[tuple[str, ...], tuple[str, str, list[str]]] = {}
    for case in cases:
        for title, lines in explained(case, name):
            key = (title,) if title.startswith("the word ") else (case.system, title)
            found.setdefault(key, (case.system, title, lines))
    return list(found.values())


def _left_out(place: Workspace, cases: Sequence[Case], name: str) -> Iterator[tuple[str, str, list[str]]]:
    """As `_others`, of records that stand in the ledger alone."""
    from avow.evidence.ledger import Ledger
    from avow.report.explained import left_out

    for case in cases:
        with contextlib.suppress(OSError):  # what cannot be read has no record to show: `avow audit` says so
            for title, lines in left_out(case, Ledger(place.ledger(case.system)).records(), name):
                yield case.system, title, lines


def _id(obligation: dict[str, str]) -> str:
    return "/".join(obligation[part] for part in ("system", "node", "kind", "name"))

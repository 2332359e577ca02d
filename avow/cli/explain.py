"""``avow explain``: one obligation, and everything that is known about it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence

import click

from avow.assurance.case import as_of
from avow.assurance.codec import read_case, to_json
from avow.assurance.model import Case, ObligationView
from avow.assurance.naming import short
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.suggestions import did_you_mean
from avow.base.tuning.shown import DIFF_REASONS
from avow.base.workspace import Workspace, workspace
from avow.cli.options import json_option
from avow.evidence.ledger import Ledger, readable
from avow.evidence.obligation import Kind
from avow.pipeline.report_check import outdated
from avow.pipeline.run_info import today
from avow.report.explained import explained, left_out, named
from avow.report.terminal import show_obligation


@click.command()
@click.argument("name", metavar="ID")
@json_option()
def command(name: str, as_json: bool) -> int:
    """Any name of a report. Of an obligation: its formula, where it stands, its evidence, how to run it again.

    ID is an obligation's id, whole (system/node/kind/name) or in part, a guarantee as node.name, or the name of a
    requirement, an assumption (A1, or its key), a node, a gate, an assurance deficit, a derivation, a method, an
    element of the argument (G4 of gsn.yaml), a digest, a file, a diagnostic's code, or a word such as argued. The
    answer is the report's, as of today. Where the report is stale (the ledger, the contract, the plan, the scenario or
    a program says something else now), the answer is *not shown*: exit code 1, or 2 where the ledger cannot be read.
    """
    place = workspace()
    cases_here = _reported_cases(place)
    told = [*_others(cases_here, name), *_left_out(place, cases_here, name)]
    try:
        found = find_claim(cases_here, name, _unreported(place, cases_here))
    except Rejected:
        if not told:
            raise
        found = ()
    systems = dict.fromkeys([*(system for system, _, _ in told), *(case.system for case, _ in found)])
    wrong, faults = _held_against_ledgers(place, [case for case in cases_here if case.system in systems])
    told = [(system, title, lines) for system, title, lines in told if system in wrong]
    found = tuple((case, view) for case, view in found if case.system in wrong)
    wrong = {system: lines for system, lines in wrong.items() if lines}
    stale = [view.id for case, view in found if case.system in wrong]
    told = [(system, title, lines) for system, title, lines in told if system not in wrong]
    found = tuple((case, view) for case, view in found if case.system not in wrong)
    if as_json:
        wanted = {view.id for _, view in found}
        cases = {case.system: case for case, _ in found}.values()
        listed = [o for case in cases for o in to_json(case)["obligations"] if _id(o["obligation"]) in wanted]
        others = [{"system": system, "title": title, "lines": lines} for system, title, lines in told]
        click.echo(document({"obligations": listed, "others": others, "not_shown": stale, "differences": wrong}))
    else:
        _show(told, found, stale, wrong)
    if faults:
        raise Rejected(*faults)
    return 1 if wrong else 0


def _show(
    told: Sequence[tuple[str, str, list[str]]],
    found: Sequence[tuple[Case, ObligationView]],
    stale: Sequence[str],
    wrong: Mapping[str, Sequence[str]],
) -> None:
    for system, lines in wrong.items():
        click.echo(f"{system}: not shown: its report is stale (`avow verify {system}` makes a new one)")
        for line in lines[:DIFF_REASONS]:
            click.echo(f"  ✘ {line}")
        if len(lines) > DIFF_REASONS:
            click.echo(f"  and {len(lines) - DIFF_REASONS} more: `avow report --check {system}`")
        click.echo()
    for name in stale:
        click.echo(f"{name}: not shown")
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
    """System → why its report is stale, if its ledger can be read; the diagnostics of unreadable ledgers."""
    wrong: dict[str, list[str]] = {}
    faults: list[Diagnostic] = []
    for case in cases:
        path = place.ledger(case.system)
        try:
            with readable(path):
                wrong[case.system] = list(outdated(case, path, place.root))
        except Rejected as rejected:
            faults += rejected.diagnostics
    return wrong, faults


def _others(cases: Sequence[Case], name: str) -> list[tuple[str, str, list[str]]]:
    """(system, heading, lines) of names that are not obligations; a word is shown once."""
    found: dict[tuple[str, ...], tuple[str, str, list[str]]] = {}
    for case in cases:
        for title, lines in explained(case, name):
            key = (title,) if title.startswith("the word ") else (case.system, title)
            found.setdefault(key, (case.system, title, lines))
    return list(found.values())


def _left_out(place: Workspace, cases: Sequence[Case], name: str) -> Iterator[tuple[str, str, list[str]]]:
    """As `_others`, for records that are only in the ledger."""
    for case in cases:
        with contextlib.suppress(OSError):  # an unreadable ledger has no record to show: `avow audit` reports it
            for title, lines in left_out(case, Ledger(place.ledger(case.system)).records(), name):
                yield case.system, title, lines


def _id(obligation: dict[str, str]) -> str:
    return "/".join(obligation[part] for part in ("system", "node", "kind", "name"))


def _reported_cases(place: Workspace) -> tuple[Case, ...]:
    """Every report in the workspace that can be read, concluded as of today. Raises Rejected if there is none."""
    files = sorted(place.reports.glob("*/report.json")) if place.reports.is_dir() else []
    if not files:
        raise Rejected(Diagnostic("REPORT001", f"no report under {place.reports}", hint="run `avow verify` first"))
    found: list[Case] = []
    faults: list[Diagnostic] = []
    for file in files:
        try:
            found.append(as_of(read_case(file), today()))
        except Rejected as rejected:  # of an older version: the others are still shown
            faults += rejected.diagnostics
        except (ValueError, KeyError, OverflowError) as error:
            faults.append(Diagnostic("REPORT002", f"{file} cannot be concluded again: {error}"))
    if not found:
        raise Rejected(*faults)
    return tuple(found)


def _unreported(place: Workspace, cases: Sequence[Case]) -> tuple[str, ...]:
    """Systems of the workspace without a readable report."""
    folders = sorted(f.name for f in place.contracts.iterdir() if f.is_dir()) if place.contracts.is_dir() else []
    return tuple(name for name in folders if name not in {case.system for case in cases})


def find_claim(
    cases: Sequence[Case], wanted: str, without_report: Sequence[str] = ()
) -> tuple[tuple[Case, ObligationView], ...]:
    """The obligations with a name: a whole id, one without the system, ``agent.low``, ``robot/agent.low``, or the
    end of one.

    Raises Rejected if there is none. `without_report`: systems without a report.
    """
    every = [(case, view) for case in cases for view in case.obligations]
    for test in (
        lambda view: view.id == wanted,
        lambda view: wanted.removeprefix(f"{view.obligation.system}/") in (view.obligation.local_id, short(view.id)),
        lambda view: wanted and (view.id.endswith("/" + wanted) or view.obligation.digest.startswith(wanted)),
    ):
        found = tuple((case, view) for case, view in every if test(view))
        if found:
            return found
    system = wanted.partition("/")[0]
    if system in without_report:
        hint = f"`avow verify {system}` makes one; it says why, if there is something wrong with the system's files"
        raise Rejected(Diagnostic("REPORT001", f"there is no report of {system} yet", hint=hint))
    known = [name for _, view in every for name in (short(view.id), view.id)]
    known += [name for case in cases for _, names, _ in named(case) for name in names]
    guarantees = [short(view.id) for _, view in every if view.obligation.kind is Kind.GUARANTEE]
    such = f" (such as {guarantees[0]})" if guarantees else ""
    kinds = (
        f"a guarantee{such}, a requirement, node, assumption, gate or file, a diagnostic's code, a word of the report"
    )
    hint = did_you_mean(wanted, known, 3) or f"known: {kinds}"
    raise Rejected(Diagnostic("LEDGER002", f"nothing in the reports is called '{wanted}'", hint=hint))

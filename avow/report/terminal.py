"""A claim on the terminal."""

from __future__ import annotations

import sys

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from avow.assurance import answers
from avow.assurance.model import Case, ObligationView
from avow.assurance.naming import short
from avow.base.verdict import Counterexample, in_words
from avow.evidence.status import Status
from avow.report.wording import (
    MARKS,
    MEANINGS,
    bound_text,
    history,
    in_lines,
    mutation,
    numbered,
    outline,
    rerun,
    tone,
    tool_command,
    where,
)

_COLOURS = {"good": "green", "fair": "blue", "open": "yellow", "bad": "red", "amber": "yellow", "grey": "dim"}


def show_obligation(case: Case, view: ObligationView, console: Console | None = None) -> None:
    """Print everything known about an obligation."""
    out = console or Console(highlight=False, emoji=False, soft_wrap=not sys.stdout.isatty())
    o = view.obligation
    required = next((r for r in case.requirements if view.id in r.obligations), None)
    stands, meaning, formula = _status(view.standing), MEANINGS[view.standing], o.formula
    if required is not None:  # a requirement has one verdict, and its formula in the plan's words
        stands = f"[{_COLOURS.get(required.tone, required.tone)}]{required.tone.mark} {required.level}[/]"
        meaning, formula = answers.MEANINGS[required.level], required.formal
    out.print(f"[bold]{escape(view.id)}[/]   {stands} [dim]{meaning}[/]")
    out.print(escape(o.claim))
    if formula:
        out.print("\n" + "\n".join(f"    {escape(line)}" for line in in_lines(formula).splitlines()) + "\n")
    said = case.said(view.id)
    if said:
        by = f" by {escape(said.who)}" if said.who else ""
        until = f" until {said.expires}" if said.expires else ""
        out.print(f"[bold]{said.how}{by}{until}[/] by the plan{f': {escape(said.reason)}' if said.reason else ''}")
    place = where(view)
    at = f"{place}, " if place else ""
    out.print(f"[dim]{escape(at)}meaning {o.digest[:12]}, criticality {escape(view.criticality)}[/]")
    if view.below:
        out.print(f"rests on what is not shown: {escape(', '.join(map(short, view.below)))}")
    for e in view.records:
        vacuous = " (vacuous: supports nothing)" if e.vacuous else ""
        tool = escape(f"({e.tool_told}, tie {e.link})")
        out.print(f"\n{_status(Status(e.verdict))}{vacuous} by [bold]{escape(e.method)}[/] {tool}")
        out.print(f"  {escape(e.summary)}")
        if mutation(e):
            out.print(f"  {escape(mutation(e))}")
        if e.bound:
            out.print(f"  [dim]within: {escape(bound_text(e.bound))}[/]")
        for hypothesis in in_words(e.rests_on, e.hypotheses):
            number = numbered(case).get(hypothesis, "")
            out.print(f"  on the hypothesis{f' {number}' if number else ''}: {escape(hypothesis)}")
        if e.counterexample:
            _show_counterexample(e.counterexample, out)
        if outline(e):
            out.print(
                "  [dim]proof outline:[/]\n" + "\n".join(f"    {escape(line)}" for line in outline(e).splitlines())
            )
        out.print(f"  again: {escape(rerun(view, e))}", soft_wrap=True)  # to be copied: no line may break
        if tool_command(e):
            out.print(f"  [dim]tool: {escape(tool_command(e))}[/]", soft_wrap=True)
    if not view.counting:
        planned = ", ".join(method for method, _ in view.planned)
        out.print(f"\nno evidence that counts; planned: {escape(planned) or 'nothing'}")
    old = history(view)
    if old:
        out.print(f"\n[dim]{len(old)} older record(s), which no longer count:[/]")
        for item in old[:10]:
            e = item.entry.evidence
            out.print(f"[dim]  {e.started[:16]} {escape(e.method)}: {Status(e.verdict).value} ({item.currency})[/]")
    if view.suggestion:
        out.print(f"\nnext: {escape(view.suggestion.text)}")
    needed_by = [r.id for r in case.requirements if view.id in r.rests_on or view.id in r.below]
    if needed_by:
        out.print(f"[dim]needed by {escape(', '.join(needed_by))}[/]")


def _show_changes(example: Counterexample, out: Console) -> None:
    """A run that is too wide for a table: for each step the contract's values that have changed."""
    before: dict[str, str] = {}
    for at, step in enumerate(example.trace[:60]):
        values = {name: value for name, value in step if not name.startswith("(")}
        changed = ", ".join(f"{name}: {value}" for name, value in values.items() if before.get(name) != value)
        mark = " ↺" if at == example.loop else ""
        out.print(f"    [bold]step {at}{mark}[/]  {escape(changed) or '[dim]as before[/]'}")
        before = values
    if any(name.startswith("(") for step in example.trace for name, _ in step):
        out.print("    [dim]what the tool itself shows of each step stands in the report[/]")


def _status(status: Status) -> str:
    return f"[{_COLOURS[tone(status)]}]{MARKS[status]} {status.value}[/]"


def _show_counterexample(example: Counterexample, out: Console) -> None:
    out.print(f"  [red]counterexample[/]{': ' + escape(example.explanation) if example.explanation else ''}")
    for name, value in example.values:
        out.print(f"    {escape(name)} = {escape(value)}")
    if example.trace:
        columns = list(dict.fromkeys(name for step in example.trace for name, _ in step))
        table = Table("step", *map(escape, columns), box=None, header_style="bold", pad_edge=True)
        for at, step in enumerate(example.trace[:60]):
            values = dict(step)
            mark = " ↺" if at == example.loop else ""
            table.add_row(f"{at}{mark}", *(escape(values.get(name, "")) for name in columns))
        if table.__rich_measure__(out, out.options.update(width=10_000)).maximum <= out.width:
            out.print(table)
        else:
            _show_changes(example, out)
        if example.loop is not None:
            out.print(f"    after the last step the run returns to step {example.loop}")

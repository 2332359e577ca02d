"""What a run prints on the terminal at its end."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from avow.base.codec import document
from avow.base.plain import count
from avow.base.rendering import printable
from avow.base.tuning.shown import GATE_REASON, WARNINGS
from avow.pipeline.results import Result

GOOD = ("proved", "checked", "tested", "monitored", "reviewed", "justified")
BAD = ("refuted", "contradictory", "error", "missing", "stale", "vacuous", "unknown", "not-run", "unsupported")
_COLOURS = {"red": "red", "amber": "yellow", "grey": "dim"}


def print_summary(
    results: Sequence[Result], broken: Sequence[str], earlier: Sequence[str], done: int, seconds: float, out: IO[str]
) -> None:
    """A row a system: what was proved, checked, tested, reviewed, refuted, not run; then failing gates. `earlier`: the
    systems whose reports are of an earlier state."""
    if not results and not broken:
        return
    console = Console(file=out, highlight=False, emoji=False, soft_wrap=True, width=None if out.isatty() else 150)
    shown = [word for word in (*GOOD, *BAD) if any(r.counts.get(word) for r in results)]
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("system")
    for at, word in enumerate(shown):
        head = word if at else f"claims {word}"
        table.add_column(head, justify="right", style="red" if word in ("refuted", "contradictory", "error") else None)
    table.add_column("verdict")
    for r in sorted(results, key=lambda r: r.system):
        colour = "red" if r.exit_code else _COLOURS.get(r.tone, "green")
        verdict = f"[{colour}]{escape(r.verdict or _gates(r))}[/]"
        table.add_row(r.system, *(str(r.counts.get(word, "")) or "" for word in shown), verdict)
    for name in broken:
        table.add_row(name, *("" for _ in shown), "[red]not done: see above[/]")
    for name in earlier:
        table.add_row(name, *("" for _ in shown), "[yellow]its report is as of an earlier state[/]")
    console.print()
    if len(results) == 1 and not broken and not earlier and results[0].lines:
        console.print("\n".join(results[0].lines), markup=False)
    else:
        console.print(table)
    said: set[str] = set()
    for r in results:
        more = len(r.failed) - WARNINGS
        for text in (*r.failed[:WARNINGS], *([f"and {more} more methods without an answer"] if more > 0 else [])):
            console.print(f"[yellow]![/] {r.system}: ", end="")
            console.print(printable(text), markup=False)
        for title, passed, reason in r.gates:
            if not passed:
                console.print(f"[red]✗[/] {r.system}: ", end="")
                console.print(f"{title}: {_few(reason, said)}", markup=False)
    for file, why in _left_out(results):
        console.print("[yellow]–[/] ", end="")
        console.print(printable(f"{file}: {why}"), markup=False)
    console.print()
    if results:
        index = str(Path(results[0].report).parent.parent / "index.html")
        console.print(f"{index if len(results) > 1 else results[0].report}   ", markup=False, end="")
    idle = "nothing to do" if not broken else "nothing could be run"
    console.print(f"({count(done, 'stage') + ' run' if done else idle}, {seconds:.1f} s)")


def results_json(results: Sequence[Result], broken: Sequence[str], earlier: Sequence[str], exit_code: int) -> str:
    """The same for machines (`avow verify --json`)."""
    listed = [
        {
            "system": r.system,
            "verdict": r.verdict,
            "tone": r.tone,
            "exit_code": r.exit_code,
            "counts": dict(r.counts),
            "gates": [{"title": title, "passed": passed, "reason": reason} for title, passed, reason in r.gates],
            "report": r.report,
            "left_out": [{"file": file, "reason": why} for file, why in r.left_out],
        }
        for r in sorted(results, key=lambda r: r.system)
    ]
    whole = {"systems": listed, "not_done": list(broken), "earlier_state": list(earlier)}
    return document({**whole, "exit_code": 2 if broken else exit_code}) + "\n"


def _left_out(results: Sequence[Result]) -> Iterable[tuple[str, str]]:
    """What was left out, and why: printed in every run, once for all systems."""
    return dict.fromkeys(row for r in results for row in r.left_out)


def _few(reason: str, said: set[str]) -> str:
    """The reason, shortened for a terminal; the next step is kept, unless another gate has `said` it."""
    why, mark, step = reason.partition("; next: ")
    if len(why) > GATE_REASON:
        why = f"{why[:GATE_REASON].rpartition(';')[0] or why[: GATE_REASON - 1] + '…'}; all in the report"
    step = step.partition("; next: ")[0]
    again = step in said
    said.update({step} - {""})
    return why + mark + ("as above" if again else step)


def _gates(result: Result) -> str:
    return "every gate passes" if result.exit_code == 0 else "a gate fails"

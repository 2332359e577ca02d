"""``avow sanity``: is a contract worth verifying against?"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from avow.base.codec import document
from avow.base.verdict import Counterexample, Verdict
from avow.calculus import providers
from avow.calculus.variables import frame
from avow.cli.options import (
    ContractArgument,
    has_nodes,
    json_option,
    node_option,
    seconds_option,
    seed_option,
    system_of,
)
from avow.formulas.finite import interpretation
from avow.language.contract import Node
from avow.sanity.analysis import analyse
from avow.sanity.claims import Property
from avow.sanity.document import SanityDocument, to_document
from avow.sanity.results import Bounds, SanityResult
from avow.solving.limits import from_seconds


@click.command()
@click.argument("path", metavar="SYSTEM", type=ContractArgument())
@node_option()
@json_option("see docs/schemas/sanity.schema.json")
@click.option("--all", "everything", is_flag=True, help="List also what is as it should be.")
@seconds_option(3)
@seed_option()
def command(path: Path, nodes: tuple[str, ...], as_json: bool, everything: bool, seconds: float, seed: int) -> int:
    """Ask of every node whether its contract is worth verifying: can its assumptions hold, do its guarantees agree, is
    there an output for every input that it allows, does every clause say something?

    SYSTEM is a system's name or folder, or an .rcl file. Code 1 where something is refuted that is an error, or where
    two solvers contradict each other, 2 for bad input.
    """
    system = system_of(path)
    has_nodes(system.contract, nodes)
    bounds = Bounds(from_seconds(seconds), seed)

    def settle(node: Node) -> tuple[SanityResult, ...]:
        scenario = interpretation(node, system.plan.scenario)
        own = analyse(node, scenario=scenario, bounds=bounds)
        return own + providers.settle(linked[node.name], node, bounds)

    whole = frame(system)
    chosen = [node for node in system.contract.nodes if not nodes or node.name in nodes]
    linked = {node.name: providers.provider_claims(whole, node) for node in chosen}
    with ThreadPoolExecutor(os.cpu_count()) as pool:  # Z3 lets other threads run while it searches
        results = [result for found in pool.map(settle, chosen) for result in found]
    if as_json:
        click.echo(document(SanityDocument(tuple(map(to_document, results)))))
    else:
        _listing(results, everything)
    return 1 if any(result.fails or result.verdict is Verdict.ERROR for result in results) else 0


_COLOURS = {"proved": "green", "checked": "cyan", "unknown": "yellow", "refuted": "red", "error": "red"}


def _listing(results: list[SanityResult], everything: bool) -> None:
    console = Console(highlight=False, emoji=False)
    folded = [] if everything else [r for r in results if _free(r)]
    shown = [r for r in results if everything or not (r.verdict is Verdict.PROVED or r.because or r in folded)]
    node = ""
    for result in shown:
        if result.node != node:
            node = result.node
            console.print(Text(node, style="bold"))
        # Text, not markup: names and values come from the contract.
        line = Text.assemble((f"{result.verdict:9}", _style(result)), result.name)
        if result.explanation:
            line.append(f": {result.explanation}")
        if result.asked.severity != "error" and result.verdict is not Verdict.PROVED:
            line.append(f" ({result.asked.severity})", style="dim")
        if result.because:
            line.append(f" (a consequence of {result.because})", style="dim")
        console.print(Padding(line, (0, 0, 0, 2)))
        for example in _examples(result):
            console.print(Padding(Text(example.text()), (0, 0, 0, 13)))
    if folded:
        names = ", ".join(f"{r.node}.{r.asked.subject}" for r in folded)
        console.print(Text(f"more than one value is allowed for the same inputs: {names} (--all shows which)", "dim"))
    refuted = [r for r in results if r.verdict is Verdict.REFUTED]
    unknown = sum(r.verdict is Verdict.UNKNOWN for r in results)
    broken = sum(r.verdict is Verdict.ERROR for r in results)
    contradicted = f", {broken} on which two solvers contradict each other" if broken else ""
    errors = sum(r.fails for r in refuted)
    hidden = 0 if everything else sum(bool(r.because) for r in refuted)
    consequences = f", {hidden} consequences of these not listed" if hidden else ""
    console.print(
        f"{len(results)} claims: {len(results) - len(refuted) - unknown - broken} hold, "
        f"{len(refuted)} refuted ({errors} of them errors{consequences}), {unknown} unknown{contradicted}"
    )


def _free(result: SanityResult) -> bool:
    """Whether the result is only that an output is left to the implementation."""
    return result.asked.about is Property.DETERMINED and result.verdict == "refuted" and not result.because


def _style(result: SanityResult) -> str:
    if result.verdict == "refuted" and result.asked.severity != "error":
        return "yellow"
    return _COLOURS.get(str(result.verdict), "")


def _examples(result: SanityResult) -> list[Counterexample]:
    if result.counterexample is None:  # a contradiction holds for every input, and the explanation is complete
        return []
    return [example for _, example in result.conflicts] or [result.counterexample]

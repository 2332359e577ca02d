"""``avow compose``: the derivation of a system's properties and its side conditions."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import click
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected, refuse
from avow.base.rendering import printable, render
from avow.base.verdict import Counterexample, HypothesisKind, Outcome, Verdict
from avow.calculus.composition import Composition, compose
from avow.calculus.derivation import Goal
from avow.calculus.discharge import Bounds
from avow.calculus.document import to_document
from avow.calculus.export import derived_contract
from avow.calculus.notation import write_goal
from avow.calculus.obligations import all_tasks, settle_each
from avow.cli.options import ContractArgument, json_option, seconds_option, seed_option, system_of
from avow.evidence.obligation import Kind, Obligation
from avow.language.translate import to_rcl
from avow.solving.limits import from_seconds


def _tell(name: str, answer: object) -> None:
    """An answer as soon as it is there, on a terminal's stderr: an interrupt leaves those so far, and none is final."""
    if sys.stderr.isatty():
        click.echo(printable(f"… {name} {answer}"), err=True)


@click.command()
@click.argument("path", metavar="SYSTEM", type=ContractArgument())
@click.option("--goal", "goals", multiple=True, metavar="NAME", help="Only this derivation (may be repeated).")
@json_option("see docs/schemas/compose.schema.json")
@click.option("--rcl", "as_rcl", is_flag=True, help="The derived system-level contract as RCL, nothing else.")
@seconds_option(10.0)
@seed_option()
def command(path: Path, goals: tuple[str, ...], as_json: bool, as_rcl: bool, seconds: float, seed: int) -> int:
    """Combine the contracts of a system's nodes by the rules R1-R4, and discharge the side conditions and the
    requirements that have a formula.

    SYSTEM is a system's name or folder, or an .rcl file (without a plan, ports of one name are connected). Code 1 where
    a side condition or requirement is refuted or not inductive, an answer is vacuous or rests on a vacuous one, or a
    loop cannot start, 2 for bad input. A terminal's stderr tells the answers as they come; who interrupts it gets those
    so far.
    """
    system = system_of(path)
    composition = compose(system)
    refuse(composition.frame.graph.findings)
    known = [goal.name for goal in composition.goals]
    if unknown := [name for name in goals if name not in known]:
        hint = f"known: {', '.join(known)}"
        raise Rejected(Diagnostic("CLI005", f"there is no derivation '{unknown[0]}'", hint=hint))

    bounds = Bounds(from_seconds(seconds), seed)
    composition.told = lambda goal, found: _tell(f"{goal}.{found.condition.about}", found.verdict)
    chosen = [goal for goal in composition.goals if not goals or goal.name in goals]
    if as_rcl:
        goal = chosen[-1] if goals else composition.whole
        standing = composition.stands(goal, bounds)
        if standing is not Verdict.PROVED:
            click.echo(f"{goal.name} is {standing}: no contract follows from it (see `avow compose {path}`)", err=True)
            return 1
        click.echo(to_rcl(derived_contract(composition, goal)), nl=False)
        return 0
    if goals:  # a derivation holds only with those of its subsystems
        chosen = list({part.name: part for goal in chosen for part in goal.inner_first()}.values())
    prefixes = tuple(f"{goal.name}." for goal in chosen)
    every = (task.obligation for task in all_tasks(composition))
    wanted = (*prefixes, "environment.")  # what an assumption that cannot hold supports is vacuous
    obligations = [o for o in every if not goals or (o.kind is Kind.COMPOSITION and o.name.startswith(wanted))]

    settled = []
    for obligation, outcome in zip(obligations, settle_each(composition, obligations, bounds), strict=True):
        _tell(obligation.name, outcome.verdict)
        settled.append(outcome)
    outcomes = _without_what_is_hollow(obligations, settled)
    if as_json:
        click.echo(document(to_document(composition, chosen, obligations, outcomes)))
    else:
        _listing(composition, chosen, obligations, outcomes)
    fails = (o.vacuous or o.verdict is Verdict.REFUTED or o.details.get("induction") == "fails" for o in outcomes)
    return 1 if any(fails) else 0


def _without_what_is_hollow(obligations: list[Obligation], outcomes: list[Outcome]) -> tuple[Outcome, ...]:
    """The outcomes; what rests on a vacuous one, directly or through others, is unknown."""
    found = list(outcomes)
    while True:
        hollow = {o.local_id: o.name for o, outcome in zip(obligations, found, strict=True) if outcome.vacuous}
        for at, outcome in enumerate(found):
            below = [hollow[h.name] for h in outcome.rests_on if h.kind is HypothesisKind.CLAIM and h.name in hollow]
            if below and outcome.verdict.supports and not outcome.vacuous:
                text = f"rests on what is vacuous: {', '.join(below)}; otherwise {outcome.verdict}: {outcome.summary}"
                found[at] = replace(outcome, verdict=Verdict.UNKNOWN, vacuous=True, summary=text)
        if sum(outcome.vacuous for outcome in found) == len(hollow):
            return tuple(found)


_COLOURS = {"proved": "green", "justified": "cyan", "unknown": "yellow", "refuted": "red"}


def _shown(counterexample: Counterexample) -> str:
    """A line for each step of a run, or only the values."""
    if not counterexample.trace:
        return counterexample.text()
    steps = (", ".join(f"{name} = {value}" for name, value in step) for step in counterexample.trace)
    return "\n".join([f"{counterexample.explanation}:", *(f"{at:4}  {step}" for at, step in enumerate(steps, start=1))])


def _listing(
    composition: Composition, goals: list[Goal], obligations: list[Obligation], outcomes: tuple[Outcome, ...]
) -> None:
    console = Console(highlight=False, emoji=False)
    levels = (composition.frame_of(goal).graph for goal in goals if goal.name in composition.levels)
    findings = [
        *composition.frame.graph.findings,
        *(finding for graph in levels for finding in graph.findings),
        *(finding for goal in goals for finding in goal.findings),
    ]
    if findings:
        click.echo(render(findings), err=True)
    for goal in goals:
        # Text, not markup: names come from the contract.
        console.print(Text(write_goal(goal, composition.known(goal)).text), soft_wrap=True)
        console.print()
    for obligation, outcome in zip(obligations, outcomes, strict=True):
        line = Text.assemble((f"{outcome.verdict:9}", _COLOURS.get(str(outcome.verdict), "")), f" {obligation.name}")
        line.append(f": {outcome.summary}")
        if outcome.vacuous:
            line.append(" (vacuous)", style="yellow")
        console.print(line)
        if outcome.counterexample is not None and outcome.counterexample.values:
            console.print(Padding(Text(_shown(outcome.counterexample)), (0, 0, 0, 10)))
    for goal in goals if composition.around else ():
        parts = tuple(f"{part.name}." for part in goal.inner_first())
        wrong = [
            f"{o.name} is {outcome.verdict}"
            for o, outcome in zip(obligations, outcomes, strict=True)
            if o.name.startswith(parts) and outcome.verdict in (Verdict.REFUTED, Verdict.UNKNOWN, Verdict.ERROR)
        ]
        told = f"does not stand yet: {'; '.join(wrong[:4])}{'; …' if len(wrong) > 4 else ''}" if wrong else "stands"
        console.print(Text(f"{goal.name} {told}"), soft_wrap=True)
    counts: dict[str, int] = {}
    for outcome in outcomes:
        counts[str(outcome.verdict)] = counts.get(str(outcome.verdict), 0) + 1
    console.print(", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items())) or "nothing to show")

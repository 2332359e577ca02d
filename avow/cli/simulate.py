"""``avow simulate``: a run of the composed contracts over the plan's scenario."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import click

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tuning.bounds import WALKS
from avow.calculus.scenario import CannotRun, world
from avow.calculus.transition import Machine
from avow.calculus.variables import frame
from avow.cli.options import ContractArgument, json_option, seconds_option, seed_option, system_of
from avow.formulas.temporal.ages import CLOCK
from avow.formulas.values import show
from avow.solving.limits import from_seconds


@click.command()
@click.argument("path", metavar="SYSTEM", type=ContractArgument())
@seed_option()
@seconds_option(10)
@click.option("--steps", type=click.IntRange(1, 100_000), help="How many steps; by default the plan's, or 20.")
@json_option("one JSON object a step (JSON lines)")
@click.option("--all", "everything", is_flag=True, help="Show also inputs that never change.")
def command(path: Path, seed: int, steps: int | None, seconds: float, as_json: bool, everything: bool) -> int:
    """Run the contracts: the environment gives values of the plan's scenario, each node answers with any output that
    meets its guarantees. SYSTEM is a system's name or folder. Of nodes that remember other runs are tried before one
    that gets stuck is shown.

    Code 1 where the system gets stuck: a node has no answer that its contract allows. Code 2 without a usable scenario.
    """
    loaded = system_of(path)
    try:
        machine = Machine(replace(world(frame(loaded)), effort=from_seconds(seconds)), seed)
        scenario = loaded.plan.scenario
        length = steps or (scenario.steps if scenario else None) or 20
        walk = machine.walk(Random(seed), length)
        for again in range(1, WALKS if machine.cells else 1):  # an answer may lead to a memory without allowed answers
            if walk.stuck is None:
                break
            other = machine.walk(Random(seed + again), length)
            walk = other if other.stuck is None else walk
    except CannotRun as reason:
        raise Rejected(Diagnostic("CLI006", f"{loaded.name} cannot be run: {reason}")) from None
    given = [values for choices in machine.environment.values() for values in choices]
    fixed = {name for name in given[0] if all(values[name] == given[0][name] for values in given)}
    names = [name for name in given[0] if (everything or name not in fixed) and name != CLOCK.qualified]
    names += [f"{node}.{port.name}" for node in machine.order for port in loaded.contract.node(node).outputs]
    now = Fraction(0)
    for number, step in enumerate(walk.steps, start=1):
        if number > 1 and machine.frame.timed:
            now += Fraction(str(step.values[CLOCK.qualified]))
        at = {"time": float(now)} if machine.frame.timed else {}
        values = {name: show(step.values[name]) for name in names}
        if as_json:
            told = {"step": number, **at, "values": values, "broken": list(step.broken)}
            click.echo(json.dumps(told, ensure_ascii=False))
            continue
        click.echo(f"step {number}" + (f", at {show(now)} s" if at else ""))
        width = max(map(len, values))
        for name, value in values.items():
            click.echo(f"  {name:{width}}  {value}")
        for clause in step.broken:
            click.echo(f"  the assumption {clause} does not hold")
    if walk.stuck is not None:
        why = walk.stuck.text()
        click.echo(json.dumps({"stuck": why}, ensure_ascii=False) if as_json else f"stuck: {why}")
        return 1
    return 0

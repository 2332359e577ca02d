"""``avow mutate``: would the evidence change if the contract were different?"""

from __future__ import annotations

import io
import os
from typing import Any

import click

from avow.backend_kit.registry import trust_plugins
from avow.base.codec import document
from avow.base.diagnostics import Rejected
from avow.base.workspace import system_folder, workspace
from avow.cli.options import json_option, node_option, seconds_option
from avow.pipeline.mutation import Score, hunt
from avow.pipeline.run_info import new_run
from avow.pipeline.settings import SECONDS
from avow.pipeline.tasks import execute
from avow.pipeline.workload import survey


@click.command()
@click.argument("system")
@click.option("--method", help="Only methods of this id.")
@node_option()
@json_option("every score; progress goes to standard error")
@seconds_option()
@click.option("--limit", type=click.IntRange(1), default=4, show_default=True, help="Mutants for each guarantee.")
@click.option("-n", "jobs", type=click.IntRange(1), default=2, show_default=True, help="How many at once.")
def command(
    system: str, method: str | None, nodes: tuple[str, ...], as_json: bool, seconds: float | None, limit: int, jobs: int
) -> int:
    """Replace each guarantee by mutants and report whether the methods that support it kill them.

    Scores go into the ledger and the report. Evidence that kills no mutant supports nothing from then on, and the exit
    code is 1.
    """
    trust_plugins()
    place = workspace()
    if seconds is not None:
        os.environ[SECONDS] = str(seconds)
    surveyed = survey(system_folder(system))
    if isinstance(surveyed, Rejected):
        raise surveyed
    every = [w for w in surveyed.catalogue.works if not w.is_engine]
    asked = [("node", name, {w.node for w in every}) for name in nodes]
    asked += [("method", method, {w.method for w in every})] if method is not None else []
    for what, name, known in asked:
        if name not in known:
            raise click.UsageError(f"no {what} of the plan is called '{name}'; known: {', '.join(sorted(known))}")
    works = tuple(w for w in every if method in (None, w.method) and (not nodes or w.node in nodes))
    scores: list[Score] = []
    for score in hunt(place, works, new_run(), limit, jobs):  # minutes may pass between two of them
        scores.append(score)
        if not as_json:
            _tell(score)
    hollow = [s for s in scores if s.hollow]
    if as_json:
        click.echo(document({"scores": [_data(score) for score in scores]}))
    elif not scores:
        click.echo("no current evidence to examine: run `doit verify` first")
    if not scores:
        return 0
    # the report is rendered again; with JSON, its lines must not go to standard output
    answer = io.StringIO() if as_json else None
    return execute(place.root, [f"report:{surveyed.system.name}"], answer=answer) or (1 if hollow else 0)


def _tell(score: Score) -> None:
    lost = f"   survives: {'; '.join(score.survivors)}" if score.survivors else ""
    lost += f"   not judged: {'; '.join(score.unjudged)}" if score.unjudged else ""
    click.echo(f"{score.obligation.partition('/')[2]:<44} {score.method:<14} {score.killed}/{score.mutants}{lost}")
    for found in score.differences:
        click.echo(f"    {found.change}: {found.formula}")
        click.echo(f"      {found.why}.")
        click.echo(f"      {score.blind(found)}.")
    for change, reason in zip(score.unjudged, score.reasons, strict=False):
        click.echo(f"    {change}: not judged: {reason}")


def _data(score: Score) -> dict[str, Any]:
    return {
        "obligation": score.obligation,
        "method": score.method,
        "killed": score.killed,
        "mutants": score.mutants,
        "survivors": score.survivors,
        "not_judged": [
            {"change": change, "reason": reason} for change, reason in zip(score.unjudged, score.reasons, strict=False)
        ],
        "differences": [
            {"change": d.change, "formula": d.formula, "why": d.why, "blind": score.blind(d)} for d in score.differences
        ],
        "hollow": score.hollow,
    }

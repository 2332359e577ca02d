"""``avow mutate``: would the evidence notice if the contract said something else?"""

from __future__ import annotations

import click


@click.command()
@click.argument("system")
@click.option("--method", help="Only methods of this id.")
@click.option("--node", help="Only this node.")
@click.option("--limit", default=4, show_default=True, help="Mutants for each guarantee.")
@click.option("-n", "jobs", default=2, show_default=True, help="How many at once.")
def command(system: str, method: str | None, node: str | None, limit: int, jobs: int) -> int:
    """Put near misses of each guarantee in its place and see whether the methods that support it notice.

    Scores go into the ledger and the report. Evidence that notices no mutant is hollow: exit code 1.
    """
    from avow.cli.workspace import system_folder, workspace
    from avow.diagnostics import Rejected
    from avow.pipeline.mutation import hunt
    from avow.pipeline.run_info import this_run
    from avow.pipeline.survey import survey

    place = workspace()
    surveyed = survey(system_folder(system))
    if isinstance(surveyed, Rejected):
        raise surveyed
    works = tuple(w for w in surveyed.catalogue.works if method in (None, w.method) and node in (None, w.node))
    scores = hunt(place, works, this_run(), limit, jobs)
    for score in scores:
        lost = f"   survives: {'; '.join(score.survivors)}" if score.survivors else ""
        click.echo(f"{score.obligation.partition('/')[2]:<44} {score.method:<14} {score.killed}/{score.mutants}{lost}")
    hollow = [s for s in scores if s.hollow]
    if not scores:
        click.echo("no current evidence to examine: run `doit verify` first")
    return 1 if hollow else 0

"""``avow mutate``: would the evidence notice if the contract said something else?"""

from __future__ import annotations

import click


@click.command()
@click.argument("system")
@click.option("--method", help="Only methods of this id.")
@click.option("--node", help="Only this node.")
@click.option("--limit", type=click.IntRange(1), default=4, show_default=True, help="Mutants for each guarantee.")
@click.option("-n", "jobs", type=click.IntRange(1), default=2, show_default=True, help="How many at once.")
def command(system: str, method: str | None, node: str | None, limit: int, jobs: int) -> int:
    """Put near misses of each guarantee in its place and see whether the methods that support it notice.

    Scores go into the ledger and the report, which is rendered again. Evidence that notices no mutant is hollow: it
    supports nothing from then on, and the exit code is 1.
    """
    from avow.backend_kit.registry import trust_plugins

    trust_plugins()
    from avow.base.diagnostics import Rejected
    from avow.base.workspace import system_folder, workspace
    from avow.pipeline.mutation import hunt
    from avow.pipeline.run_info import new_run
    from avow.pipeline.tasks import execute
    from avow.pipeline.workload import survey

    place = workspace()
    surveyed = survey(system_folder(system))
    if isinstance(surveyed, Rejected):
        raise surveyed
    every = [w for w in surveyed.catalogue.works if not w.is_engine]
    for what, name, known in (("node", node, {w.node for w in every}), ("method", method, {w.method for w in every})):
        if name is not None and name not in known:
            raise click.UsageError(f"no {what} of the plan is called '{name}'; known: {', '.join(sorted(known))}")
    works = tuple(w for w in every if method in (None, w.method) and node in (None, w.node))
    scores = []
    for score in hunt(place, works, new_run(), limit, jobs):  # minutes may lie between two of them
        scores.append(score)
        lost = f"   survives: {'; '.join(score.survivors)}" if score.survivors else ""
        lost += f"   not judged: {'; '.join(score.unjudged)}" if score.unjudged else ""
        click.echo(f"{score.obligation.partition('/')[2]:<44} {score.method:<14} {score.killed}/{score.mutants}{lost}")
        for found in score.differences:
            click.echo(f"    {found.change}: {found.formula}")
            click.echo(f"      {found.why}.")
            click.echo(f"      {score.blind(found)}.")
        for change, reason in zip(score.unjudged, score.reasons, strict=False):
            click.echo(f"    {change}: not judged: {reason}")
    hollow = [s for s in scores if s.hollow]
    if not scores:
        click.echo("no current evidence to examine: run `doit verify` first")
        return 0
    return execute(place.root, [f"report:{surveyed.system.name}"]) or (1 if hollow else 0)

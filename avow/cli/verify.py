"""``avow verify``: the same as ``doit verify``, and what doit's command line cannot say."""

from __future__ import annotations

import os

import click


@click.command()
@click.argument("systems", nargs=-1)
@click.option("--fresh", is_flag=True, help="Believe no earlier run: settle every obligation anew.")
@click.option("-n", "jobs", type=click.IntRange(0), default=2, show_default=True, help="How many tasks at once.")
@click.option(
    "--explain", is_flag=True, help="Say what each failing gate lacks, and the cheapest method that would close it."
)
@click.option(
    "--sandbox", is_flag=True, help="Run programs under test sealed (bubblewrap): no network, nothing written, or not."
)
def command(systems: tuple[str, ...], fresh: bool, jobs: int, explain: bool, sandbox: bool) -> int:
    """Verify every system under contracts/, or only SYSTEMS (their names)."""
    from avow.base.workspace import require_systems, workspace
    from avow.isolation.level import SANDBOX
    from avow.pipeline.run_info import EXPLAIN, FRESH
    from avow.pipeline.tasks import execute

    place = workspace()
    systems = require_systems(place, systems)
    if fresh:
        os.environ[FRESH] = "1"
    if sandbox:
        os.environ[SANDBOX] = "required"
    if explain:
        os.environ[EXPLAIN] = "1"
    return execute(place.root, [f"verify:{name}" for name in systems] or ["verify"], jobs)

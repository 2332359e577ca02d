"""``avow verify``: the same as ``doit verify``, with options that doit's command line cannot have."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import click

from avow.base.diagnostics import Rejected
from avow.cli.options import PathArgument, json_option, seconds_option

if TYPE_CHECKING:
    from avow.pipeline.cluster import Cluster
    from avow.pipeline.remote import Remote


@click.command()
@click.argument("systems", metavar="[SYSTEM]...", nargs=-1)
@json_option("what came of each system; progress goes to standard error")
@seconds_option()
@click.option("--fresh", is_flag=True, help="Believe no earlier run: settle every obligation anew.")
@click.option("-n", "jobs", type=click.IntRange(0), help="Tasks at once (default: 2, or the cluster's slots and one).")
@click.option("--on", "address", help="Send jobs to a cluster: dask+tls://HOST:PORT (docs/developers/scale.md).")
@click.option(
    "--explain", is_flag=True, help="Say what each failing gate lacks, and the cheapest method that would close it."
)
@click.option("--key", type=PathArgument(exists=True, dir_okay=False), help="Sign the attestations (AVOW_KEY).")
@click.option(
    "--sandbox", is_flag=True, help="Run programs under test sealed (bubblewrap): no network, nothing written, or not."
)
def command(
    systems: tuple[str, ...],
    as_json: bool,
    seconds: float | None,
    fresh: bool,
    jobs: int | None,
    address: str | None,
    explain: bool,
    key: object,
    sandbox: bool,
) -> int:
    """Verify every system under contracts/, or only each SYSTEM (its name or folder)."""
    from avow.base.workspace import require_systems, workspace
    from avow.pipeline.settings import asked_of_runs, sign_with
    from avow.pipeline.state import task_name
    from avow.pipeline.tasks import execute

    place = workspace()
    systems = require_systems(place, systems)
    sign_with(key)
    asked_of_runs(fresh=fresh, explain=explain, sandbox=sandbox, seconds=seconds)
    wanted = [f"verify:{task_name(name)}" for name in systems] or ["verify"]
    cluster, there = _cluster(address) if address else (None, None)
    if jobs is None:
        jobs = cluster.slots + 1 if cluster else 2  # no slot waits for this machine to prepare its next job
    try:
        return execute(place.root, wanted, jobs, sys.stdout if as_json else None, there)
    finally:
        if cluster:
            cluster.close()


def _cluster(address: str) -> tuple[Cluster, Remote]:
    """Raises Rejected if there is no cluster, or no usable one."""
    from avow.pipeline.cluster import Address, Cluster
    from avow.pipeline.remote import remote
    from avow.pipeline.settings import ON

    found = Cluster(Address.read(address))
    try:
        there = remote(found)
    except Rejected:
        found.close()
        raise
    os.environ[ON] = address
    return found, there

"""``avow worker``: execute jobs for `avow verify --on` of other machines."""

from __future__ import annotations

import os
import sys

import click


@click.command()
@click.option("--on", "address", required=True, help="The cluster: dask+tls://HOST:PORT (dask+tcp:// on this machine).")
@click.option("--slots", type=click.IntRange(1), help="How many works at once (default: one for each core).")
def command(address: str, slots: int | None) -> int:
    """Be a worker of a cluster, until it ends or this command is stopped.

    What is offered are the backends that are installed here and the tools that they find. TLS needs the files that
    AVOW_TLS_CA, AVOW_TLS_CERT and AVOW_TLS_KEY name.
    """
    from avow.pipeline.cluster import Address, serve

    serve(Address.read(address), slots or os.cpu_count() or 1)
    print(f"the cluster at {address} has ended, or let this worker go", file=sys.stderr)
    return 0

"""``avow obligations``: what has to be shown, and by which methods."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import click
from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.workspace import Workspace, workspace
from avow.cli.options import has_nodes, json_option
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.pipeline.workload import ListedClaim, Listing, listing, survey

_CLAIMS = "what is claimed"
_SANITY = "whether the contract is worth verifying"
_GROUPS = {
    _CLAIMS: (Kind.GUARANTEE, Kind.PROGRAM, Kind.COMPOSITION, Kind.REQUIREMENT, Kind.WELL_FORMED),
    _SANITY: (Kind.SANITY,),
}


@click.command()
@click.argument("name", metavar="[SYSTEM | NODE | SYSTEM/NODE]", required=False, default="")
@json_option("see artifacts/<system>/obligations.json")
def command(name: str, as_json: bool) -> int:
    """List the proof obligations of every system, of one system, or of one node: first what is claimed, then whether
    the contracts are worth verifying. `avow explain ID` shows one of them with its evidence."""
    found = list(_listings(workspace(), name))
    if as_json:
        click.echo(document({"systems": found}))
        return 0
    console = Console(highlight=False, emoji=False)
    for read in found:
        for group, kinds in _GROUPS.items():
            _show(console, read.system, group, [claim for claim in read.obligations if claim.kind in kinds])
    return 0


def _listings(place: Workspace, name: str) -> Iterator[Listing]:
    """The requested listings: of each system, or of a node in each system that has it. Raises Rejected."""
    folders: dict[str, Path] = {folder.name: folder for folder in place.systems()}
    system, slash, node = name.partition("/")
    if not slash and system not in folders:
        system, node = "", name
    if system and system not in folders:
        raise _unknown(f"there is no system '{system}'", folders)
    found = not node
    for folder in [folders[system]] if system else folders.values():
        read = survey(folder)
        if isinstance(read, Rejected):
            raise read
        if system and node and node != SYSTEM_LEVEL:
            has_nodes(read.system.contract, [node])
        if system or not node or any(each.name == node for each in read.system.contract.nodes):
            found = True
            yield _of_node(listing(place, read), node)
    if not found:
        raise _unknown(f"there is no system and no node '{name}'", folders)


def _unknown(text: str, folders: Iterable[str]) -> Rejected:
    return Rejected(Diagnostic("CLI002", text, hint=f"systems here: {', '.join(folders)}"))


def _of_node(read: Listing, node: str) -> Listing:
    kept = (claim for claim in read.obligations if not node or claim.id.startswith(f"{read.system}/{node}/"))
    return Listing(read.system, tuple(kept))


def _show(console: Console, system: str, group: str, claims: Sequence[ListedClaim]) -> None:
    if not claims:
        return
    # Text, not markup: names and sentences come from the contract.
    console.print(Text(f"{system}: {group} ({len(claims)})", "bold"))
    for claim in claims:
        console.print(Padding(Text(claim.id.partition("/")[2]), (0, 0, 0, 2)))
        console.print(Padding(Text(f"{claim.claim} [{', '.join(claim.methods) or 'no method'}]"), (0, 0, 0, 6)))
    console.print()

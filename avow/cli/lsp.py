"""``avow lsp``: the language server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.workspace import find_workspace
from avow.evidence.ledger import Ledger
from avow.system.plan_file import read_plan

if TYPE_CHECKING:
    from avow.lsp.features import StatusLookup


@click.command()
def command() -> int:
    """Serve an editor on standard input and output: messages, fixes, completion, rename, references, sanity."""
    try:
        from avow.lsp.server import serve
    except ImportError:
        raise Rejected(
            Diagnostic("CLI010", "the language server needs pygls", hint="pip install 'avow[lsp]'")
        ) from None
    serve(standing)
    return 0


def standing(file: str) -> StatusLookup:
    """The latest verdict of each method on each guarantee of the system that the file belongs to: shown when hovering
    over them.

    The ledger's verdicts may be about an older text: checking that takes too long for an editor, so the answer contains
    the time of the verdict. Files outside a workspace have no status.
    """
    path = Path(file).resolve()
    workspace = find_workspace(path.parent)
    if workspace is None or not path.is_relative_to(workspace.contracts):
        return lambda node, clause: None
    system = _system(path.parent)
    try:
        entries = Ledger(workspace.ledger(system)).records()
    except OSError:
        entries = ()
    latest: dict[str, dict[str, str]] = {}
    for entry in entries:
        evidence = entry.evidence
        said = f"{evidence.verdict} by {evidence.method} ({evidence.started[:16].replace('T', ' ')})"
        latest.setdefault(evidence.obligation, {})[evidence.method] = said

    def lookup(node: str, clause: str) -> str | None:
        found = latest.get(f"{system}/{node}/guarantee/{clause}")
        return "last time: " + ", ".join(found[method] for method in sorted(found)) if found else None

    return lookup


def _system(folder: Path) -> str:
    """The name of the system in a folder: its plan's, else the folder's."""
    try:
        return read_plan(folder / "plan.yaml")[0].system
    except (Rejected, OSError):
        return folder.name

"""``avow lsp``: the language server."""

from __future__ import annotations

import click


@click.command()
def command() -> int:
    """Serve an editor on standard input and output: messages, fixes, completion, rename, references, sanity."""
    from avow.base.diagnostics import Diagnostic, Rejected

    try:
        from avow.cli.clause_status import standing
        from avow.lsp.server import serve
    except ImportError:
        raise Rejected(
            Diagnostic("CLI010", "the language server needs pygls", hint="pip install 'avow[lsp]'")
        ) from None
    serve(standing)
    return 0

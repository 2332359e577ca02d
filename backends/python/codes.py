"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "PYTHON100",
        "no Python source",
        "The node has no `source:` with a readable Python file and a class.",
        "Write `source: {python: src/node.py, class: Node}`.",
    ),
    declare(
        "PYTHON200",
        "not in the subset",
        "The method does not understand a part of the file.",
        "Rewrite it (`docs/backends/python.md`), or use another method.",
        warning=True,
    ),
)

"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "PYTHON100",
        "no Python source",
        "The node has no `source:` with a Python file and a class, or one of its files cannot be read.",
        "Write `source: {python: src/node.py, class: Node}` for the node; `docs/plan.md` has the form.",
    ),
    declare(
        "PYTHON200",
        "not in the subset",
        "The file has something that this method does not understand: nothing is proved of it.",
        "Write it as `docs/backends/python.md` has it, or give the node another method.",
        warning=True,
    ),
)

"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "DFY101",
        "wrong option",
        "The option is unknown, or names a missing file.",
        "Give `implementation`, relative to the system's folder.",
    ),
    declare(
        "DFY102",
        "unreadable implementation",
        "The file does not exist, is too large, or is not UTF-8.",
        "Correct the path or the file.",
    ),
    declare(
        "DFY103",
        "what the proof leaves out",
        "The implementation assumes something, switches checks off, or clashes with the generated file.",
        "Prove it; otherwise it becomes a hypothesis, or nothing is proved.",
        warning=True,
    ),
    declare(
        "DFY104",
        "not expressible",
        "Dafny cannot express the node's contract, so its guarantees are not supported.",
        "Use another method for this node.",
        warning=True,
    ),
    declare(
        "DFY105",
        "no translation",
        "A clause or type has no counterpart in Dafny.",
        "Rewrite what the message names, or leave it out.",
    ),
)

"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "DFY101",
        "wrong option",
        "The option is unknown, or names no file of the system's folder.",
        "Give `implementation`, relative to the system's folder.",
    ),
    declare(
        "DFY102",
        "unreadable implementation",
        "The file of the implementation does not exist, is too large, or is not UTF-8.",
        "Correct the path or the file.",
    ),
    declare(
        "DFY103",
        "what the proof leaves out",
        "The implementation assumes something without proof, switches checks off, or clashes with the generated file.",
        "Prove it instead; otherwise it becomes a hypothesis of the evidence, or no proof is accepted.",
        warning=True,
    ),
    declare(
        "DFY104",
        "not expressible",
        "The node's contract cannot be put into Dafny; its guarantees come out as not supported.",
        "Verify this node with another method.",
        warning=True,
    ),
    declare(
        "DFY105",
        "no translation",
        "A clause or a type has no counterpart in Dafny.",
        "Rewrite what the message names, or leave it out.",
    ),
)

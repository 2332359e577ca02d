"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "HOARE100",
        "not a program",
        "The program does not parse, its layout is inconsistent, or it is nested too deeply.",
        "Write what the hint says; see `docs/backends/hoare.md`.",
    ),
    declare(
        "HOARE200",
        "wrong name",
        "A name is unknown, declared twice, in use, or for formulas only.",
        "Declare it, or use another name.",
    ),
    declare(
        "HOARE300",
        "wrong type",
        "An expression has the wrong type, or one that programs cannot compute.",
        "Correct the expression or the declaration.",
    ),
    declare(
        "HOARE400",
        "program and contract do not fit",
        "The program's file is missing, or a port has no variable in the program.",
        "Map it under `variables`.",
    ),
    declare(
        "HOARE410",
        "other numbers",
        "The program compares with other numbers than the contract.",
        "Correct the program, or switch the warning off if the units differ.",
        warning=True,
    ),
)

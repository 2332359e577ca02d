"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "FUZZ100",
        "no C++ source",
        "The node has no `source:` with an adapter header, or one of its files cannot be read.",
        "Write `source: {cpp: src/node_avow.hpp}` for the node; `docs/backends/fuzz.md` shows such a header.",
    ),
    declare(
        "FUZZ101",
        "no such file or folder",
        "An option names a file or a folder that is not in the system's folder.",
        "Correct the path under `sources` or `include`; both are relative to the system's folder.",
    ),
    declare(
        "FUZZ102",
        "no machine value",
        "A compiled step cannot take a port of this type, or `numbers: exact` is given for it.",
        "Use REAL (float64 or float32), INTEGER, NATURAL, BOOL, enumerations and sequences of these.",
    ),
)

"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "FUZZ100",
        "no C++ source",
        "The node has no `source:` with a readable adapter header.",
        "Write `source: {cpp: src/node_avow.hpp}` (`docs/backends/fuzz.md`).",
    ),
    declare(
        "FUZZ101",
        "no such file or folder",
        "`sources` or `include` names a missing file or folder.",
        "Correct the path.",
    ),
    declare(
        "FUZZ102",
        "no machine value",
        "A compiled step cannot take a port of this type, or `numbers: exact`.",
        "Use numbers, BOOL, enumerations and sequences of these.",
    ),
)

"""The diagnostic codes of this backend: 10x the options, 11x the record, 12x `avow review`."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "REV101",
        "wrong option",
        "An option is unknown, or `record` names a missing file.",
        "Give `record`, relative to the system's folder.",
    ),
    declare("REV102", "no such file", "The record, or a file that it names, cannot be read.", "Correct the path."),
    declare(
        "REV103",
        "another's review",
        "The record is of another node or system, or judges a guarantee that the node lacks.",
        "Correct the names.",
    ),
    declare(
        "REV104",
        "signature does not count",
        "The signature is missing, or is for another text or by another key than the plan's.",
        "The reviewer signs again: `avow review sign`.",
        warning=True,
    ),
    declare(
        "REV111",
        "no record",
        "The record has a wrong format or an unknown key.",
        "Correct it; see `docs/backends/review.md`.",
    ),
    declare(
        "REV112",
        "wrong date",
        "A date is malformed, in the future, before 2000, or out of order.",
        "Write dates as 2026-11-21.",
    ),
    declare(
        "REV113",
        "conclusion does not follow",
        "The conclusion contradicts the answers or conditions of the record.",
        "The reviewer corrects one of them.",
    ),
    declare(
        "REV114",
        "unclear what was read",
        "An entry under `read` names neither a file nor material kept elsewhere, or both.",
        "Name one of them.",
    ),
    declare(
        "REV115",
        "unclear what was judged",
        "`clauses` lacks the digest of a guarantee's meaning.",
        "Let `avow review` fill it in.",
    ),
    declare("REV116", "answer without a note", "This answer needs an explanation.", "The reviewer adds a `note`."),
    declare("REV117", "something missing", "A part of the record is missing or empty.", "Add it."),
    declare("REV118", "wrong word", "The value is not allowed.", "Use a value of the message."),
    declare(
        "REV119",
        "no digest",
        "A digest is not 64 small hexadecimal digits.",
        "Let `avow review` fill it in.",
    ),
    declare(
        "REV120",
        "no review to fill in",
        "The system has no such node, or the plan has no or several reviews of it.",
        "Name the node, and the method.",
    ),
    declare(
        "REV121",
        "changed since it was reviewed",
        "A file or guarantee has changed since the review.",
        "Review it again, and stamp with `--renewed DATE`.",
    ),
    declare(
        "REV122",
        "stamp does not read back",
        "The stamped record would have another meaning, so the file is unchanged.",
        "Write the named entry as in `docs/backends/review.md`, then stamp again.",
    ),
    declare(
        "REV123",
        "no signature written",
        "The signature cannot be written beside the record.",
        "Make the folder writable, or sign a copy elsewhere.",
    ),
    declare(
        "REV124",
        "name that looks like another",
        "A reviewer's name has an invisible character, mixed scripts, no letters, or is TBD.",
        "Use letters of one script.",
    ),
)

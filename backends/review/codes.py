"""The diagnostic codes of this backend: 10x the options, 11x the record, 12x `avow review`."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "REV101",
        "wrong option",
        "An option is unknown, or `record` names no file of the system's folder.",
        "Give `record`, relative to the system's folder.",
    ),
    declare("REV102", "no such file", "The record, or a file that it names, cannot be read.", "Correct the path."),
    declare(
        "REV103",
        "another's review",
        "The record is of another node or system, or judges a guarantee that the node does not have.",
        "Name the record of this node, or correct the names in it.",
    ),
    declare(
        "REV104",
        "signature does not count",
        "The record's signature is missing, belongs to another text, or is by a key that the plan does not name.",
        "The reviewer reads the record and signs it: `avow review sign`.",
        warning=True,
    ),
    declare(
        "REV111",
        "no record",
        "The record lacks the form of one: wrong format, unknown key, a list or text where the other is wanted.",
        "Correct the place named; `docs/backends/review.md` has the form.",
    ),
    declare(
        "REV112",
        "wrong date",
        "A date is not a date, is in the future, or is before the year 2000; or the review expires, or was renewed, "
        "before it was made.",
        "Write dates as 2026-11-21.",
    ),
    declare(
        "REV113",
        "conclusion does not follow",
        "The conclusion does not go with the answers and the conditions of the record.",
        "The reviewer has to correct the one or the other.",
    ),
    declare(
        "REV114",
        "unclear what was read",
        "An entry under `read` names neither a file of the system's folder nor material kept elsewhere, or both.",
        "Name one of them.",
    ),
    declare(
        "REV115",
        "unclear what was judged",
        "`clauses` does not say of each guarantee which meaning was judged.",
        "Let `avow review` fill it in.",
    ),
    declare(
        "REV116", "answer without a note", "This answer needs a note that explains it.", "The reviewer adds the `note`."
    ),
    declare("REV117", "something missing", "The record lacks a part, or it is empty.", "Add it."),
    declare("REV118", "wrong word", "The value is not allowed.", "Use one of those that the message names."),
    declare(
        "REV119",
        "no digest",
        "A digest is not 64 small hexadecimal digits.",
        "Let `avow review` fill it in.",
    ),
    declare(
        "REV120",
        "no review to fill in",
        "The system has no such node, or its plan no review, or several, of that node.",
        "Name the node, and the method where there are several.",
    ),
    declare(
        "REV121",
        "changed since it was reviewed",
        "What the record says was read or judged is no longer the same; its digest is not replaced silently.",
        "Review it again, and say so with `--renewed DATE`.",
    ),
    declare(
        "REV122",
        "stamp does not read back",
        "With its digests filled in, the record would have another meaning. The file is unchanged.",
        "Write the entry that the message names in the plain form of `docs/backends/review.md`, then stamp again.",
    ),
    declare(
        "REV123",
        "no signature written",
        "The signature of a record cannot be written beside it.",
        "Make the folder writable, or sign a copy elsewhere.",
    ),
    declare(
        "REV124",
        "name that looks like another",
        "A reviewer's name holds an invisible character, mixes scripts, has no letters, or is TBD.",
        "Write it in the letters of one script.",
    ),
)

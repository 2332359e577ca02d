"""The diagnostic codes of this backend: 10x the options, 11x the table of runs."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "EXP101",
        "wrong option",
        "An option is missing, unknown, or has a wrong value.",
        "Write what the message wants; `docs/backends/experiment.md` has every option.",
    ),
    declare("EXP102", "no data", "The file of runs does not exist or cannot be read.", "Correct the path."),
    declare(
        "EXP103",
        "wrong mapping",
        "An entry of `mapping` names no port of the node or has a wrong type, or a port has no column.",
        "Name the column of each port that the guarantee refers to.",
    ),
    declare(
        "EXP105",
        "claimed rate too low",
        "The claimed success rate is below the minimum for the node's criticality.",
        "Claim at least 0.9 at high, 0.8 at medium, 0.5 at low.",
    ),
    declare(
        "EXP106",
        "wrong interpretation",
        "An entry of `interpret` names no predicate of the node, or its meaning names no column.",
        "Write `out.at(x, y)`, or a part of a guarantee, and a formula over columns.",
    ),
    declare(
        "EXP111",
        "no table of runs",
        "The file is no CSV in UTF-8 with a line of column names and at least one run.",
        "Export the data again.",
    ),
    declare(
        "EXP112",
        "wrong columns",
        "A column that is needed is missing, occurs twice, or looks like another; or no column identifies a run.",
        "Correct the first line, or the columns that the options name.",
    ),
    declare(
        "EXP113",
        "wrong run",
        "A row has too few or too many cells, a cell that is no value of its port, or the name of another run.",
        "Correct the line. Runs are never left out silently.",
    ),
)

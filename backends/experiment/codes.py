"""The diagnostic codes of this backend: 10x the options, 11x the table of runs."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "EXP101",
        "wrong option",
        "An option is missing, unknown, or wrong.",
        "See `docs/backends/experiment.md`.",
    ),
    declare("EXP102", "no data", "The file of runs cannot be read.", "Correct the path."),
    declare(
        "EXP103",
        "wrong mapping",
        "An entry of `mapping` names no port or has a wrong type, or a port has no column.",
        "Name the column of each port of the guarantee.",
    ),
    declare(
        "EXP105",
        "claimed rate too low",
        "The claimed success rate is too low for the node's criticality.",
        "Claim at least 0.9 at high, 0.8 at medium, 0.5 at low.",
    ),
    declare(
        "EXP106",
        "wrong interpretation",
        "An entry of `interpret` names no predicate of the node, or its meaning names no column.",
        "Write a predicate and a formula over columns.",
    ),
    declare(
        "EXP111",
        "no table of runs",
        "The file is no CSV in UTF-8 with column names and a run.",
        "Export the data again.",
    ),
    declare(
        "EXP112",
        "wrong columns",
        "A column is missing, repeated, or looks like another; or no column identifies a run.",
        "Correct the first line, or the options.",
    ),
    declare(
        "EXP113",
        "wrong run",
        "A row has a wrong number of cells, a cell that is no value of its port, or another run's name.",
        "Correct the line.",
    ),
)

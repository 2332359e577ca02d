"""The diagnostic codes of this backend: 10x the options, 11x the table of runs, 12x the summary of figures."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "EXP101",
        "wrong option",
        "An option is missing, unknown, or has a wrong value.",
        "Write what the message wants; `docs/backends/experiment.md` has every option.",
    ),
    declare("EXP102", "no data", "The file of runs or figures does not exist or cannot be read.", "Correct the path."),
    declare(
        "EXP103",
        "wrong measure",
        "The measure is no expression over the columns.",
        "Correct it at the character that the message names.",
    ),
    declare(
        "EXP104",
        "units do not fit",
        "A figure or a threshold is in a unit that cannot be converted into the measure's.",
        "Give it in a unit of the same kind.",
    ),
    declare(
        "EXP105",
        "claimed rate too low",
        "The success rate that is claimed is below the least one of the node's criticality.",
        "Claim what the criticality asks for: 0.9 at high, 0.8 at medium, 0.5 at low.",
    ),
    declare(
        "EXP106",
        "measure that may flatter",
        "The measure is more than columns, differences of two columns, and `abs`, `hypot` and `max` of these.",
        "Measure what the guarantee speaks of; `docs/backends/experiment.md` has every form.",
    ),
    declare(
        "EXP107",
        "not the contract's tolerance",
        "The guarantee compares with numbers, and the tolerance is not the least that the whole of it bounds by.",
        "Give T where the guarantee says `quantity <= T`, without a unit that changes it.",
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
        "A column that is needed is missing, or a name stands twice.",
        "Correct the first line, or the columns that the options name.",
    ),
    declare(
        "EXP113",
        "wrong run",
        "A run has too few or too many cells, no number where one is needed, or the name of another run.",
        "Correct the line; a run is never left out silently.",
    ),
    declare(
        "EXP114",
        "measure without value",
        "For this run the measure, or a part of it, is negative where it cannot be.",
        "Correct the run's cells, or the measure.",
    ),
    declare(
        "EXP115",
        "copied run",
        "Two runs agree in every cell that the measure reads, as copied lines do and measurements rarely.",
        "Equal runs that succeed count once: record more digits, or what was measured, apart.",
        warning=True,
    ),
    declare(
        "EXP121",
        "no figures",
        "The summary holds no figures, or one of an unknown name.",
        "Give `n` and at least one of mean, min, max, sd.",
    ),
    declare(
        "EXP122",
        "wrong figure",
        "A figure is no number with a unit, is negative, or the number of runs is out of range.",
        "Write it as in `21.4 cm`.",
    ),
)

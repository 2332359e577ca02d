"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "HYPO100",
        "no subject",
        "`subject` is not of the form file.py:function, or missing.",
        "Name the function to be tested.",
    ),
    declare(
        "HYPO101",
        "no such file",
        "The subject's file is missing.",
        "Correct the path.",
    ),
    declare("HYPO102", "no such function", "The file defines no such function.", "Correct the name."),
    declare(
        "HYPO103",
        "not Python",
        "The file cannot be read, or does not parse.",
        "Correct it at the place named.",
    ),
    declare(
        "HYPO104",
        "arguments do not fit",
        "An argument of the function is no input of the node, or the function is async.",
        "Name the arguments as the inputs.",
    ),
    declare(
        "HYPO106",
        "not for a class",
        "A step class takes no values of a port's type, or the class computes with float32.",
        "Give a function as `subject`, or use another method.",
    ),
    declare(
        "HYPO107",
        "callbacks cannot be judged",
        "No installed method judges runs of messages, or the class hears no topic of another node.",
        "Install `rosmonitoring`, or subscribe to the inputs.",
    ),
    declare(
        "HYPO105",
        "nested too deeply",
        "A formula is nested too deeply for a test to compute it.",
        "Split the guarantee, or use another method.",
    ),
)

"""The diagnostic codes of this backend."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "HYPO100",
        "no subject",
        "The option `subject` is missing and the node has no Python source, or it is not of the form file.py:function.",
        "Name the function to be tested.",
    ),
    declare(
        "HYPO101",
        "no such file",
        "The subject's file is not in the system's folder.",
        "Correct the path, which is relative to the system's folder.",
    ),
    declare("HYPO102", "no such function", "The file defines no function of that name.", "Correct the name."),
    declare(
        "HYPO103",
        "not Python",
        "The subject's file cannot be read, or does not parse.",
        "Correct it at the place named.",
    ),
    declare(
        "HYPO104",
        "arguments do not fit",
        "The function wants an argument that is no input of the node, or is async.",
        "Name the arguments as the inputs; inputs may be left out.",
    ),
    declare(
        "HYPO106",
        "not for a class",
        "A port has a type whose values a step class is not given, or the class computes with float32.",
        "Give the node a function as `subject`, or another method.",
    ),
    declare(
        "HYPO107",
        "callbacks cannot be judged",
        "No installed method judges runs of messages, or the class subscribes to no topic of another node.",
        "Install `rosmonitoring`, or let the class subscribe to the inputs.",
    ),
    declare(
        "HYPO105",
        "nested too deeply",
        "A formula of the node is nested too deeply for a test to compute it.",
        "Split the guarantee, or verify this node with another method.",
    ),
)

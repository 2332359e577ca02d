"""The diagnostic codes of this backend: 10x the program, 11x the environment and options, 12x the options' contents,
13x what the table of predicates covers."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "AJPF101",
        "unreadable program",
        "The agent program cannot be read, is too large, or is not UTF-8.",
        "Give a Gwendolen program as UTF-8 text.",
    ),
    declare(
        "AJPF102",
        "not Gwendolen",
        "Something else has to stand here, or terms are nested too deeply.",
        "Write what the hint wants; `docs/backends/ajpf.md` has the part of Gwendolen that is read.",
    ),
    declare(
        "AJPF103",
        "not supported",
        "An initial belief or goal has a variable, or a plan responds to any goal or belief.",
        "Write the facts one by one, and a plan for each goal; or check that agent by other means.",
    ),
    declare(
        "AJPF104",
        "name of the agent",
        "AJPF's property language does not accept this name of an agent, or two agents have it.",
        "Choose a name of its own that starts with a small letter and is no keyword of PSL.",
    ),
    declare(
        "AJPF110",
        "wrong environment",
        "The environment's file cannot be read, names what it does not declare, or has too many combinations.",
        "Correct the place named; `docs/backends/ajpf.md` has the form.",
    ),
    declare(
        "AJPF119",
        "wrong option",
        "An option has an unknown name or a wrong type, or contradicts another one.",
        "Write what the message names.",
    ),
    declare(
        "AJPF120",
        "no such file",
        "An option names no file of the system's folder.",
        "Correct the path, which is relative to the system's folder.",
    ),
    declare(
        "AJPF121",
        "another agent",
        "The plan or a property speaks of an agent other than the program's.",
        "Use the name that the program gives it.",
    ),
    declare(
        "AJPF122",
        "wrong range",
        "A variable's range under `instances` is no range of whole numbers, or too large.",
        "Write it as `0..3` or as a list.",
    ),
    declare(
        "AJPF123",
        "wrong row",
        "A row of `predicates` has a pattern that cannot be used, or a formula with variables that it does not bind.",
        "Bind each variable of the formula in the pattern.",
    ),
    declare(
        "AJPF124",
        "no property",
        "The text is no formula of the property specification language.",
        "Correct it as the hint says.",
    ),
    declare(
        "AJPF125",
        "no such guarantee",
        "A property of the plan is for a guarantee that the node does not have, or `forbids` without counting for one.",
        "Correct the guarantee's name.",
    ),
    declare(
        "AJPF130",
        "guarantee not covered",
        "No row of the table covers a part of the guarantee, so this method cannot check it.",
        "Add a row, or use another method for the guarantee.",
        warning=True,
    ),
    declare(
        "AJPF131",
        "row without use",
        "No part of any guarantee matches the row, or nothing that a guarantee forbids the `forbids` of a property.",
        "Correct its pattern, or delete it.",
        warning=True,
    ),
    declare(
        "AJPF132",
        "row that says nothing",
        "The row's formula is true (or false) for every agent, so the part that it covers is assumed.",
        "Correct the formula. To leave out a part deliberately, map it to `T`.",
        warning=True,
    ),
    declare(
        "AJPF133",
        "instances left out",
        "The plan's `instances` lack values of the scenario's domain, so the guarantee is not checked for these.",
        "Leave the variable out of `instances`, or give the reason in the plan.",
        warning=True,
    ),
    declare(
        "AJPF134",
        "word that the agent lacks",
        "A row, a property or the environment file names a belief, goal, action or percept that never occurs.",
        "Correct its spelling, or the number of its arguments.",
        warning=True,
    ),
)

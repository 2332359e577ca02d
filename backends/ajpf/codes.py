"""The diagnostic codes of this backend: 10x the program, 11x the environment and options, 12x the options' contents,
13x what the table of predicates covers."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "AJPF101",
        "unreadable program",
        "The program cannot be read, is too large, or is not UTF-8.",
        "Give a Gwendolen program as UTF-8 text.",
    ),
    declare(
        "AJPF102",
        "not Gwendolen",
        "The program is not in the supported part of Gwendolen, or nested too deeply.",
        "Write what the hint says; see `docs/backends/ajpf.md`.",
    ),
    declare(
        "AJPF103",
        "not supported",
        "An initial belief or goal has a variable, or a plan responds to any goal or belief.",
        "Write each fact, and a plan for each goal.",
    ),
    declare(
        "AJPF104",
        "name of the agent",
        "AJPF does not accept this agent's name, or two agents have it.",
        "Begin it with a small letter, and avoid keywords of PSL.",
    ),
    declare(
        "AJPF110",
        "wrong environment",
        "The environment's file cannot be read, names something undeclared, or has too many combinations.",
        "Correct it (`docs/backends/ajpf.md`).",
    ),
    declare(
        "AJPF119",
        "wrong option",
        "An option is unknown, has a wrong type, or contradicts another.",
        "Correct what the message names.",
    ),
    declare(
        "AJPF120",
        "no such file",
        "An option names a missing file.",
        "Correct the path.",
    ),
    declare(
        "AJPF121",
        "another agent",
        "The plan or a property names an agent that the program lacks.",
        "Use the name in the program.",
    ),
    declare(
        "AJPF122",
        "wrong range",
        "A range under `instances` is no range of whole numbers, or too large.",
        "Write it as `0..3` or as a list.",
    ),
    declare(
        "AJPF123",
        "wrong row",
        "A row's pattern cannot be used, or does not bind a variable of the formula.",
        "Bind each variable.",
    ),
    declare(
        "AJPF124",
        "no property",
        "The text is no formula of the property language.",
        "Correct it as the hint says.",
    ),
    declare(
        "AJPF125",
        "no such guarantee",
        "A property's guarantee does not exist, or is missing beside `forbids`.",
        "Correct the guarantee's name.",
    ),
    declare(
        "AJPF130",
        "guarantee not covered",
        "No row of the table covers a part of the guarantee.",
        "Add a row, or use another method for the guarantee.",
        warning=True,
    ),
    declare(
        "AJPF131",
        "row without use",
        "The row, or a property's `forbids`, matches no part of any guarantee.",
        "Correct its pattern, or delete it.",
        warning=True,
    ),
    declare(
        "AJPF132",
        "row that says nothing",
        "The row's formula is true (or false) for every agent.",
        "Correct the formula, or map the part to `T` deliberately.",
        warning=True,
    ),
    declare(
        "AJPF133",
        "instances left out",
        "`instances` lack values of the scenario's domain, which are not checked.",
        "Leave the variable out of `instances`, or give the reason in the plan.",
        warning=True,
    ),
    declare(
        "AJPF134",
        "word that the agent lacks",
        "A row, property or environment names a belief, goal, action or percept that never occurs.",
        "Correct its spelling or arguments.",
        warning=True,
    ),
)

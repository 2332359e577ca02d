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
        "variable where none may be",
        "An initial belief or goal has a variable, so that it is not one fact.",
        "Write the facts one by one.",
    ),
    declare(
        "AJPF104",
        "name of the agent",
        "AJPF's property language cannot speak of an agent of this name.",
        "Choose a name that starts with a small letter and is none of its words.",
    ),
    declare(
        "AJPF105",
        "not run",
        "The program is Gwendolen, and has something that the checker does not run: a plan for any goal or belief "
        "at all.",
        "Leave it out, or check that agent by other means.",
    ),
    declare(
        "AJPF106",
        "two agents of one name",
        "Two agents of the system have the same name.",
        "Give each agent a name of its own.",
    ),
    declare(
        "AJPF110",
        "unreadable environment",
        "The environment's file cannot be read, or lacks the form of one.",
        "Correct the place named; `docs/backends/ajpf.md` has the form.",
    ),
    declare(
        "AJPF111",
        "wrong environment",
        "The environment names percepts or groups that it does not declare, or has too many combinations of percepts.",
        "Declare them under `percepts`, or leave out combinations.",
    ),
    declare(
        "AJPF119",
        "wrong option",
        "An option has a type or a name that is none of the backend's.",
        "Write what the message wants.",
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
        "AJPF126",
        "options that AJPF cannot take",
        "The engine `ajpf` is asked for a semantics other than its own.",
        "Leave out `semantics`, or `engine: ajpf`.",
    ),
    declare(
        "AJPF130",
        "guarantee not covered",
        "No rows of the table say what a part of the guarantee is for the agent: this method cannot check it.",
        "Add a row, or leave the guarantee to other methods.",
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
        "The row's formula is true (or false) of every agent, so that what it covers is taken for granted.",
        "Correct the formula. What you want to give up, map to `T`, in the open.",
        warning=True,
    ),
    declare(
        "AJPF133",
        "instances left out",
        "The plan's `instances` lack values of the scenario's domain: the guarantee is not checked for these.",
        "Leave the variable out of `instances`, or say in the plan why the rest does not matter.",
        warning=True,
    ),
    declare(
        "AJPF134",
        "word that the agent lacks",
        "A row, a property or the environment file speaks of a belief, goal, action or percept that there never is. "
        "What is forbidden in such a word is forbidden for nothing.",
        "Correct its spelling, or the number of its arguments.",
        warning=True,
    ),
)

"""The diagnostic codes of plans, systems and the calculus: their examples are plans, in tests/system."""

from __future__ import annotations

from avow.base.codes import declare, register

PLAN_CODES = register(
    declare(
        "PLAN100",
        "no plan",
        "There is neither a plan.yaml nor an .rcl file here.",
        "Give the system's folder.",
    ),
    declare(
        "PLAN101",
        "not YAML",
        "The file is empty, too large, or no plain YAML.",
        "Write one YAML document without anchors or tags.",
    ),
    declare(
        "PLAN102",
        "a key",
        "A key is repeated, a merge key, or no plain text.",
        "Write each key once, as plain text.",
    ),
    declare(
        "PLAN103",
        "unknown key",
        "The plan has no such key here.",
        "Use a key of the hint.",
    ),
    declare(
        "PLAN104",
        "missing key",
        "A required key is missing.",
        "Add it as `docs/plan.md` describes.",
    ),
    declare(
        "PLAN105",
        "wrong value",
        "The value has the wrong type or form, or is not allowed.",
        "Write what the message asks for.",
    ),
    declare(
        "PLAN106",
        "unknown name",
        "The contract has no such node, port or guarantee.",
        "Correct the name.",
    ),
    declare(
        "PLAN107",
        "no such file",
        "A file that the plan names does not exist.",
        "Correct the path.",
    ),
    declare(
        "PLAN108",
        "path outside",
        "A path leads out of the system's folder.",
        "Move the file into the folder.",
    ),
    declare(
        "PLAN109",
        "scenario",
        "A table, interpretation or domain of the scenario cannot be used.",
        "Correct it.",
    ),
    declare(
        "PLAN110",
        "contradiction",
        "Two parts of the plan contradict each other.",
        "Remove one of them.",
    ),
    declare(
        "PLAN112",
        "initial value",
        "The initial value does not fit its output.",
        "Give a value of its type, or a formula about it alone.",
    ),
    declare(
        "PLAN113",
        "environment",
        "An environment assumption refers to inputs that nodes provide.",
        "Use the environment's inputs only.",
    ),
    declare("PLAN114", "temporal property", "The text is no temporal property.", "Write it as in `docs/calculus.md`."),
    declare(
        "PLAN115",
        "plain words",
        "`says` has more than 14 words, or names from the contract.",
        "Use plain words; put the reason under `because`.",
    ),
    declare(
        "PLAN128",
        "no plain words yet",
        "An assumption has no plain words for the report.",
        "Add `says`, `who` and `until`.",
        warning=True,
    ),
    declare(
        "PLAN129",
        "not validated",
        "The requirement has no validation of its current sentence, formula and support.",
        "Compare them, then run `avow validate`.",
        warning=True,
    ),
    declare(
        "PLAN130",
        "parameters",
        "`parameters` is no mapping of numbers, truth values and texts.",
        "Write a YAML mapping; quote texts such as `off` and `1:30`.",
    ),
    declare(
        "PLAN136",
        "parameter without effect",
        "No Python file beside the source mentions this parameter.",
        "Correct or remove its name.",
        warning=True,
    ),
    declare(
        "PLAN137",
        "excluded value",
        "An assumption about one input never allows a value that `scenario.domains` gives to it: no run has it.",
        "Leave the value out, or correct the assumption.",
        warning=True,
    ),
    declare(
        "PLAN121",
        "types clash",
        "An output and the input that it would feed have different types.",
        "Correct a type, or connect other ports.",
    ),
    declare(
        "PLAN122",
        "several providers",
        "Several outputs could feed an input.",
        "Choose one under `connections`, or give both ends their topics.",
    ),
    declare(
        "PLAN123",
        "start-up deadlock",
        "Nodes in a loop wait for each other.",
        "Give one delayed output an initial value.",
        warning=True,
    ),
    declare(
        "PLAN124",
        "memory",
        "An input and an output of a node share a name but are not connected.",
        "Connect them if the node remembers the value; otherwise rename one.",
        warning=True,
    ),
    declare(
        "PLAN125",
        "rule does not fit",
        "The selected nodes are not connected as the rule requires.",
        "Use another rule, or select other nodes.",
    ),
    declare(
        "PLAN135",
        "no derived contract with memory",
        "A derived contract is about one step.",
        "Compare or export nodes without clauses about other steps.",
    ),
    declare(
        "PLAN126",
        "ports do not fit",
        "A node cannot replace another that has other inputs or outputs.",
        "Give both nodes the same ports.",
    ),
    declare(
        "PLAN127",
        "ROS graph",
        "The ROS graph and the plan's `model` differ.",
        "Correct `model`, or record the graph again.",
    ),
)
"""Every code of plans and systems, in order."""

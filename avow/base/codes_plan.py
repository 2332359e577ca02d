"""The diagnostic codes of plans, systems and the calculus: their examples are plans, in tests/system."""

from __future__ import annotations

from avow.base.codes import declare, register

PLAN_CODES = register(
    declare(
        "PLAN100",
        "no plan",
        "There is no system here: neither a plan.yaml nor an .rcl file.",
        "Give the folder that has the `plan.yaml`.",
    ),
    declare(
        "PLAN101",
        "not YAML",
        "The file is empty, too large, or no plain YAML document.",
        "Write one YAML document without anchors, tags or merge keys.",
    ),
    declare(
        "PLAN102",
        "a key",
        "A key is given twice, is a merge key, or is not plain text.",
        "Give each key once, as plain text.",
    ),
    declare(
        "PLAN103",
        "unknown key",
        "The plan has no such key at this place.",
        "Use one of the keys in the hint.",
    ),
    declare(
        "PLAN104",
        "missing key",
        "A key that is needed here is missing.",
        "Add the key; `docs/plan.md` says what it means.",
    ),
    declare(
        "PLAN105",
        "wrong value",
        "The value has the wrong type or form, or is not one of those allowed.",
        "Write what the message wants.",
    ),
    declare(
        "PLAN106",
        "unknown name",
        "The plan names a node, port or guarantee that the contract does not have.",
        "Correct the name, or declare it in the contract.",
    ),
    declare(
        "PLAN107",
        "no such file",
        "The plan names a file that is not there.",
        "Correct the path, which is relative to the system's folder, or add the file.",
    ),
    declare(
        "PLAN108",
        "path outside",
        "A path leads out of the system's folder.",
        "Move the file into the folder: evidence covers nothing outside it.",
    ),
    declare(
        "PLAN109",
        "scenario",
        "A table, an interpretation or a domain of the scenario cannot be used.",
        "Correct the place in the `scenario` or its table.",
    ),
    declare(
        "PLAN110",
        "contradiction",
        "Two things that the plan says do not go together.",
        "Decide for one of the two.",
    ),
    declare(
        "PLAN112",
        "initial value",
        "The initial value does not fit its output.",
        "Give a value of the output's type, or a formula about that output only.",
    ),
    declare(
        "PLAN113",
        "environment",
        "An environment assumption speaks of more than the environment's inputs.",
        "Speak only of inputs that no node provides.",
    ),
    declare("PLAN114", "temporal property", "The text is no temporal property.", "Write it as in `docs/plan.md`."),
    declare(
        "PLAN115",
        "plain words",
        "`says` is for readers who have never seen the contract: at most 14 words, no names from it.",
        "Shorten it; `because` may hold the whole reason.",
    ),
    declare(
        "PLAN128",
        "no plain words yet",
        "An assumption has no words for a reader who has never seen the contract.",
        "Add `says: …` (at most 14 words), `who` and `until`.",
        warning=True,
    ),
    declare(
        "PLAN129",
        "not validated",
        "Nobody has compared the requirement's sentence with its current formula and support.",
        "Compare them; if they agree, record it with `avow validate`.",
        warning=True,
    ),
    declare(
        "PLAN130",
        "parameters",
        "The file under `source: parameters` is no mapping of numbers, truth values and texts.",
        "Write one YAML mapping; quote texts such as `off` and `1:30`.",
    ),
    declare(
        "PLAN136",
        "parameter without effect",
        "No Python file beside the source mentions a parameter that the plan's file sets.",
        "Correct its name, or remove it.",
        warning=True,
    ),
    declare(
        "PLAN121",
        "types clash",
        "An output and the input that it would feed have different types.",
        "Correct one of the types, or connect other ports.",
    ),
    declare(
        "PLAN122",
        "several providers",
        "More than one output could feed an input, by name or by topic.",
        "Choose one under `connections`, or give both ends their topics.",
    ),
    declare(
        "PLAN123",
        "start-up deadlock",
        "Nodes in a loop wait for one another, and no delayed edge has an initial value.",
        "Give one delayed output of the loop an initial value.",
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
        "The selected nodes are not connected as the rule wants them.",
        "Use a rule for this shape, or select other nodes.",
    ),
    declare(
        "PLAN135",
        "no derived contract with memory",
        "A derived contract speaks of one step, and a clause of one of its nodes speaks of others.",
        "Compare or export nodes without such clauses.",
    ),
    declare(
        "PLAN126",
        "ports do not fit",
        "A node cannot stand in for another that has other inputs or outputs.",
        "Give both nodes the same ports.",
    ),
    declare(
        "PLAN127",
        "ROS graph",
        "The ROS graph and the plan's account of it do not agree.",
        "Correct the plan's `model`, or record the graph again.",
    ),
)
"""Every code of plans and systems, in order."""

"""The diagnostic codes of this backend: 10x the options, 20x traces, 30x serving."""

from __future__ import annotations

from avow.base.codes import declare, register

CODES = register(
    declare(
        "MON101",
        "wrong mapping",
        "An entry of `mapping` does not say how a variable is read from messages.",
        "Correct it (`docs/backends/rosmonitoring.md`).",
    ),
    declare(
        "MON102",
        "no such trace",
        "A recorded trace is missing.",
        "Correct the path.",
    ),
    declare(
        "MON103",
        "cannot be monitored",
        "No topic shows what the guarantee refers to, or monitors do not support its operators.",
        "Map it to a topic, or use another method.",
        warning=True,
    ),
    declare(
        "MON105",
        "not in RML",
        "The guarantee has no RML equivalent, or the plan does not map its variables.",
        "Map the named variables, or use Avow's own engine.",
    ),
    declare(
        "MON106",
        "number that the wire cannot hold",
        "A clause compares a message's number for equality with a number that its type cannot hold.",
        "Compare with a range.",
        warning=True,
    ),
    declare(
        "MON107",
        "what is read",
        "This remark shows the message field from which a variable is read.",
        "If another field is meant, name it under `mapping`.",
    ),
    declare(
        "MON108",
        "no measurement",
        "A table under `overhead` is missing or wrong.",
        "Write a row for each run: which monitors ran, and the seconds until each place.",
    ),
    declare("MON104", "no such node", "The system has no such node.", "Use the name of the hint."),
    declare("MON201", "unreadable trace", "The trace's file cannot be read.", "Correct the path."),
    declare("MON203", "not a bag", "The file is no readable ROS bag.", "Record it again, or export JSON lines."),
    declare(
        "MON204",
        "wrong event",
        "A line of the trace is too long, not UTF-8, no JSON object, or has no `time` in seconds from 0.",
        "Correct the line.",
    ),
    declare(
        "MON205",
        "other messages",
        "A bag's topic has another type than in the contract, or another definition.",
        "Correct the contract's type or the plan's definition.",
    ),
    declare(
        "MON206",
        "calls not recorded",
        "A clause refers to calls of a service, but a ROS 1 bag has topics only.",
        "Use a ROS 2 bag with service events, or a JSON trace.",
    ),
    declare(
        "MON207",
        "unknown publisher",
        "Nodes outside the contract publish on one of its topics in the bag.",
        "Add them to the contract, or give the node's name at run time (`ros: {nodes: …}`).",
    ),
    declare(
        "MON301",
        "serving not installed",
        "Oracles, rosbridge and MCAP need a package.",
        "`pip install 'avow[monitor]'`.",
    ),
    declare(
        "MON303",
        "no graph",
        "No ROS 1 master, rosbridge or DDS domain can be reached.",
        "Start one (`roscore`), or name it: `--live ros1:http://host:11311`.",
    ),
    declare(
        "MON304",
        "cannot be written",
        "A file cannot be written.",
        "Correct the path of `--record`, `--timeline`, `--mcap` or `--configuration`.",
    ),
    declare(
        "MON305",
        "DDS not installed",
        "Listening over DDS needs packages.",
        "`pip install 'avow[dds]'`.",
    ),
    declare(
        "MON306",
        "unknown type on DDS",
        "Nothing defines the messages of a DDS type.",
        "Name its `.msg` files under `messages`, or the distribution.",
    ),
    declare(
        "MON307",
        "cannot be filtered",
        "`--enforce` decides on each message alone, on one topic of ROS 1.",
        "Name outputs under `filter` that one message decides.",
    ),
    declare("MON302", "cannot listen", "The port is taken or not allowed.", "Choose another with `--serve`."),
)

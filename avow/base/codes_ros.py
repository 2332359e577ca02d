"""The diagnostic codes of what ROS defines: 10x message definitions, 11x topics, 12x launch files."""

from __future__ import annotations

from avow.base.codes import declare, register

ROS_CODES = register(
    declare(
        "ROS101",
        "no message definition",
        "A file under `messages` defines no message type.",
        "Write it as ROS does: a `type name` a line; parts of services and actions are set apart by `---`.",
    ),
    declare(
        "ROS102",
        "defined twice",
        "Two files under `messages` define one message type, each otherwise.",
        "Name one of the two.",
    ),
    declare(
        "ROS103",
        "message types not installed",
        "The common message types of a distribution, and .idl files, are read by a package that is not installed.",
        "`pip install 'avow[bags]'`, or name the .msg files under `messages`.",
    ),
    declare(
        "ROS104",
        "unknown message type",
        "Nothing defines the type of a topic's messages, though its package is known; or it is a service or an action, "
        "and the part of a call is not said.",
        "Correct the type; of a service write `package/Type_Request` or `_Response`, of an action `_Goal`, `_Result` "
        "or `_Feedback`.",
        warning=True,
    ),
    declare(
        "ROS111",
        "topic of two types",
        "A topic is published or heard as messages of different types: in ROS the two never meet.",
        "Give the topic one type in the contract, or remap one of its ends under `ros`.",
    ),
    declare(
        "ROS112",
        "connection against the topics",
        "The plan connects ports whose topics have different names when the robot runs, or an output without a topic "
        "to an input that hears others on its topic.",
        "Say under `ros` what remaps one of them, give the output its topic, or take the connection out.",
    ),
    declare(
        "ROS113",
        "one name, two topics",
        "An output and an input of one name are on different topics, which do not link them.",
        "Say under `ros` what remaps one of them, where they are one topic when the robot runs.",
        warning=True,
    ),
    declare(
        "ROS114",
        "node hears itself",
        "A node listens to a topic that it publishes itself, and the plan does not say from when on.",
        "Connect the two, delayed, with an initial value.",
    ),
    declare(
        "ROS115",
        "which variable of the topic",
        "A topic carries several variables, and which of them an input is cannot be seen from names.",
        "Give both ports one name, or connect them.",
    ),
    declare(
        "ROS116",
        "remapping the other way round",
        "A node is started with a name for a topic that it does not have, and the new name is that of one that it has: "
        "a remapping says the node's own name first.",
        "Write the name that the contract (the node's code) has, and then the robot's.",
        warning=True,
    ),
    declare(
        "ROS120",
        "no launch file",
        "A launch file of the plan, or one that it includes, cannot be read as one. It is never run.",
        "Correct the file; it is XML, YAML, or Python with `generate_launch_description()`.",
    ),
    declare(
        "ROS121",
        "launch file read in part",
        "What stands at this place of a launch file is known only when it runs: an environment variable, a command, a "
        "loop, a file outside the workspace.",
        "Say under `ros: {nodes: …}` what it does, or give the value as `args` of the launch file in the plan.",
        warning=True,
    ),
    declare(
        "ROS122",
        "plan against launch file",
        "The plan calls a node, or a topic of it, otherwise than the launch files do.",
        "Correct one of the two; what the launch files say need not be said again.",
    ),
    declare(
        "ROS123",
        "which started node",
        "Launch files start several nodes that a node of the contract may be, with other names or remappings.",
        "Name the one under `ros: {nodes: {NODE: {name: /…}}}`, or give the launch file its `args`.",
    ),
    declare(
        "ROS124",
        "started and not modelled",
        "The launch files start a node that is not in the contract, or do not start one that is.",
        "Name it under `ros: {nodes: …}` or under `model` (compound, dropped, external), or add it to the contract.",
        warning=True,
    ),
    declare(
        "ROS125",
        "how a node runs",
        "Under which name a node runs, and what remaps its topics, as the launch files say.",
        "Nothing is to be done where it is what is meant.",
    ),
    declare(
        "ROS126",
        "topics not known",
        "What a launch file remaps or names at a place that cannot be read may reach this node, so that no link of its "
        "topics can be called agreed.",
        "Say under `ros: {nodes: {NODE: {name: /…, remap: {…}}}}` how it runs.",
    ),
)

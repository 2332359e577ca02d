"""The diagnostic codes of what ROS defines: 10x message definitions, 11x topics, 12x launch files."""

from __future__ import annotations

from avow.base.codes import declare, register

ROS_CODES = register(
    declare(
        "ROS101",
        "no message definition",
        "A file under `messages` defines no message type.",
        "Write a `type name` on each line.",
    ),
    declare(
        "ROS102",
        "defined twice",
        "Two files under `messages` define one message type differently.",
        "Name one of them.",
    ),
    declare(
        "ROS104",
        "unknown message type",
        "A message type, its package, or a part of a service or action is not defined.",
        "Correct the type (`package/Type`, `package/Type_Request`, …), or add its definition under `messages`.",
        warning=True,
    ),
    declare(
        "ROS111",
        "topic of two types",
        "Publisher and subscriber of a topic have different message types.",
        "Use one type, or remap one end.",
    ),
    declare(
        "ROS112",
        "connection against the topics",
        "The plan connects ports whose topics differ at run time, or an output without a topic.",
        "Add the remapping under `ros` or the output's topic, or remove the connection.",
    ),
    declare(
        "ROS113",
        "one name, two topics",
        "An output and an input share a name but are on different topics.",
        "Add the remapping under `ros` if they are one topic.",
        warning=True,
    ),
    declare(
        "ROS114",
        "node hears itself",
        "A node subscribes to its own topic.",
        "Add a delayed connection with an initial value.",
    ),
    declare(
        "ROS115",
        "which variable of the topic",
        "No name says which of a topic's variables an input is.",
        "Give both ports one name, or connect them.",
    ),
    declare(
        "ROS116",
        "remapping the other way round",
        "A remapping seems reversed.",
        "Write the name in the node's code first.",
        warning=True,
    ),
    declare(
        "ROS120",
        "no launch file",
        "A launch file is no XML, YAML or Python.",
        "Correct the file.",
    ),
    declare(
        "ROS121",
        "launch file read in part",
        "The launch file depends here on something outside: a variable, a command, a loop, a file.",
        "Describe the node under `ros: {nodes: …}`, or give `args` for the launch file.",
        warning=True,
    ),
    declare(
        "ROS122",
        "plan against launch file",
        "Plan and launch files name a node or topic differently.",
        "Correct one of them.",
    ),
    declare(
        "ROS123",
        "which started node",
        "Several started nodes may be this node.",
        "Choose one under `ros: {nodes: {NODE: {name: /…}}}`, or give `args`.",
    ),
    declare(
        "ROS124",
        "started and not modelled",
        "Launch files and contract have different nodes.",
        "Name it under `ros` or `model`, or add it to the contract.",
        warning=True,
    ),
    declare(
        "ROS125",
        "how a node runs",
        "The name and remappings with which the launch files start a node.",
        "Check that they are intended.",
    ),
    declare(
        "ROS126",
        "topics not known",
        "A launch file may remap this node's topics at a place that Avow cannot read.",
        "Describe the node under `ros: {nodes: …}`.",
    ),
    declare(
        "ROS127",
        "other parameters",
        "A launch file and the plan start the node with different parameters.",
        "Put the robot's parameters into the file under `source: {parameters: …}`.",
    ),
)

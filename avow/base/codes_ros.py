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
)

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
)

"""What a node creates, as its source says it."""

from __future__ import annotations

import re
import sys
from typing import Any

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.ros.quality import Quality


@dataclass(frozen=True, slots=True)
class Created:
    """`side`: one of `avow.ros.listing.EVERY_SIDE`, or ``declares`` for a parameter."""

    side: str
    name: str
    """As written."""
    kind: str
    """``package/Type``; empty if it is not known."""
    span: Span
    quality: Quality = Quality()
    sure: bool = True
    """Whether it is created under no condition."""
    default: Any = None
    """A parameter's, if it is a literal."""


@dataclass(frozen=True, slots=True)
class Code:
    """`unread`: why it may create more, with the places. Without any, it creates nothing else."""

    created: tuple[Created, ...] = ()
    unread: tuple[tuple[str, Span], ...] = ()


_HARMLESS: tuple[str, ...] = ("rclpy", "rospy", "rclcpp", "rclcpp_action", "rclcpp_lifecycle", "rclcpp_components")
_HARMLESS += ("ros", "tf2", "tf2_ros", "tf2_geometry_msgs", "tf2_sensor_msgs", "message_filters", "actionlib", "numpy")
_OF_MESSAGES = re.compile(r"\w+_(msgs|srvs|interfaces)\Z")


def is_harmless(name: str) -> bool:
    """Whether a module or an include (``package/file``) creates no end that its user's own text does not name."""
    package, _, rest = name.replace(".", "/").partition("/")
    known = package in _HARMLESS or package in sys.stdlib_module_names or _OF_MESSAGES.match(package) is not None
    return known or rest.partition("/")[0] in ("msg", "srv", "action")

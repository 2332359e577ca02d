"""Launch files, read and never run: the nodes that they start, with names and remappings.

`elements` is the common form of XML and YAML (`markup`) and Python (`python`, by its syntax only); `reading` interprets
it. Anything that cannot be read without running it is reported with its place. Sources:
http://wiki.ros.org/roslaunch/XML, https://design.ros2.org/articles/roslaunch_xml.html and
https://docs.ros.org/en/rolling/How-To-Guides/Launch-file-different-formats.html.
"""

from __future__ import annotations

from avow.ros.launch.reading import read_launch
from avow.ros.launch.started import Launched, Setting, Started

__all__ = ["Launched", "Setting", "Started", "read_launch"]

"""Launch files, read and never run: which nodes they start, under which names, with which remappings.

`elements` is the one form that XML and YAML (`markup`) and Python (`python`, by its syntax alone) are brought into;
`reading` gives it its meaning. What cannot be read without running something is told with its place. Sources:
http://wiki.ros.org/roslaunch/XML, https://design.ros2.org/articles/roslaunch_xml.html and
https://docs.ros.org/en/rolling/How-To-Guides/Launch-file-different-formats.html.
"""

from __future__ import annotations

from avow.ros.launch.reading import Launched, Setting, Started, read_launch

__all__ = ["Launched", "Setting", "Started", "read_launch"]

"""Parameters among the arguments of a node: ``-p limit:=3``, ``--params-file FILE``, and ``_limit:=3`` in ROS 1.

A parameter for one of a process's nodes (``-p left:limit:=3``) is not read. Sources:
https://docs.ros.org/en/rolling/How-To-Guides/Node-arguments.html and http://wiki.ros.org/Remapping%20Arguments.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence


def overrides(words: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Each parameter with its value as text, in order; a file has no name. The value is empty if it is not read."""
    for before, word in zip(["", *words], words, strict=False):
        name, sign, value = word.partition(":=")
        if before == "--params-file":
            yield "", word
        elif sign and before in ("-p", "--param"):
            node, apart, own = name.rpartition(":")
            yield own, "" if apart and node else value
        elif sign and name.startswith("_") and not name.startswith("__"):
            yield name[1:], value

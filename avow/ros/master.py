"""Publishers and listeners, from a ROS 1 master, which is queried by its XML-RPC interface
(http://wiki.ros.org/ROS/Master_API): no ROS has to be installed."""

from __future__ import annotations

import xmlrpc.client
from http.client import HTTPConnection, HTTPException
from typing import Any
from xml.parsers.expat import ExpatError

from avow.base.tuning.running import MASTER_SECONDS
from avow.ros.definitions import canonical
from avow.ros.listing import Listing, NoListing, listed


class _Bounded(xmlrpc.client.Transport):
    """Waits at most `MASTER_SECONDS` for an answer."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = MASTER_SECONDS
        return connection


FAILURES = (OSError, HTTPException, ExpatError, xmlrpc.client.Error, ValueError, TypeError)
"""The exceptions that a call of `interface` raises if there is no answer, or one that is not ROS's."""


def interface(uri: str) -> Any:
    """The XML-RPC interface of a ROS 1 master or node; a context."""
    return xmlrpc.client.ServerProxy(uri, transport=_Bounded(), allow_none=True)


def ask_master(uri: str) -> Listing:
    """The graph that a running ROS 1 master knows. Raises NoListing if none answers."""
    try:
        with interface(uri) as master:
            graph = master.getSystemState("/avow")
            topics = master.getTopicTypes("/avow")
    except FAILURES as error:
        raise NoListing(f"no ROS 1 master answers at {uri}: {error}") from None
    try:
        sides: dict[str, dict[str, list[str]]] = {}
        for side, entries in zip(("publishes", "subscribes", "serves"), graph[2], strict=True):
            for topic, names in entries:
                for name in names:
                    sides.setdefault(str(name), {}).setdefault(side, []).append(str(topic))
        types = {str(topic): canonical(str(kind)) for topic, kind in topics[2] if kind != "*"}
    except (TypeError, ValueError, LookupError) as error:
        raise NoListing(f"what answers at {uri} is no ROS 1 master: {error}") from None
    found = (listed(name, {k: sorted(v) for k, v in side_of.items()}) for name, side_of in sorted(sides.items()))
    return Listing(tuple(found), types)

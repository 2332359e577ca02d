"""What a report says about one node, kept from one report to the next.

A part is a text that a pure function makes of its arguments, which are frozen data. Its key is the digest of the
arguments and of Avow's code, so a part is made again exactly if one of them differs. A part is no evidence: it is in
the user's cache under the user's seal, one file for each node, and a missing or edited file is made again.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable, Mapping
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, ParamSpec

import jinja2
import yaml

from avow.base.files import is_intact, sha256
from avow.base.remembered import Kept
from avow.evidence.ledger import Entry

P = ParamSpec("P")
_Parts = dict[str, tuple[str, str]]
"""Kind of part → its key and its text."""


class Parts:
    """The parts of one report."""

    def __init__(self, folder: Path | None = None, *given: str) -> None:
        """`folder`: of the report; None: nothing is kept. `given`: what every part depends on."""
        self.folder = folder
        self._place = Kept("parts", folder) if folder is not None else None
        self._given = sha256("\n".join((sys.version, jinja2.__version__, yaml.__version__, *given)))
        self._kept: dict[str, _Parts] = {}
        self._used: dict[str, _Parts] = {}
        self._new: set[str] = set()
        self._digests: dict[int, tuple[object, str]] = {}

    def text(self, node: str, kind: str, make: Callable[P, str], *args: P.args, **kwargs: P.kwargs) -> str:
        """What `make` makes of the arguments. It uses nothing else, and `kind` names it."""
        if self._place is None:
            return make(*args, **kwargs)
        key, kept = self._known(node, kind, *args, **kwargs)
        return self._note(node, kind, key, make(*args, **kwargs)) if kept is None else kept

    def file(self, node: str, name: str, make: Callable[P, str], *args: P.args, **kwargs: P.kwargs) -> str | None:
        """As `text`, the content of a file of the report; None if the file is there as it is to be."""
        key, kept = self._known(node, name, *args, **kwargs) if self._place is not None else ("", None)
        if kept is not None and self.folder is not None and is_intact(self.folder / name, kept):
            return None
        text = make(*args, **kwargs)
        if self._place is not None:
            self._note(node, name, key, sha256(text.encode("utf-8", "replace")))
        return text

    def _known(self, node: str, kind: str, *args: object, **kwargs: object) -> tuple[str, str | None]:
        """The key of a part, and its text if it is kept."""
        assert self._place is not None
        key = sha256("".join(map(self._digest, (*args, *kwargs.values()))))
        if node not in self._kept:
            self._kept[node] = self._place.get(node, self._given) or {}
        found = self._kept[node].get(kind)
        if found is None or found[0] != key:
            return key, None
        self._used.setdefault(node, {})[kind] = found
        return found

    def _note(self, node: str, kind: str, key: str, text: str) -> str:
        self._used.setdefault(node, {})[kind] = key, text
        self._new.add(node)
        return text

    def keep(self) -> None:
        """Write the files of nodes with a new part, and remove those of nodes that are gone."""
        if self._place is not None:
            for node in self._new:
                self._place.put(node, self._given, self._used[node])
            self._place.tidy()

    def _digest(self, value: object) -> str:
        """Digest of frozen data. A node's views (`wording.of_nodes`) are an argument of several parts."""
        if type(value) is not tuple:
            return sha256(json.dumps(value, default=_plain))
        if id(value) not in self._digests:
            self._digests[id(value)] = value, sha256(json.dumps(value, default=_plain))
        return self._digests[id(value)][1]


def _plain(value: Any) -> object:
    """The fields of a dataclass. A record's hash covers all of it; a record that does not count has another key
    (`avow.evidence.currency`)."""
    kind: Any = type(value)
    if kind is Entry:
        return value.hash, value.evidence.key
    return dict(value) if isinstance(value, Mapping) else _fields(kind)(value)


@cache
def _fields(kind: type) -> Callable[[Any], object]:
    return attrgetter(*(field.name for field in dataclasses.fields(kind)))


NOTHING_KEPT = Parts()

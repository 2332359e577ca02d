"""Where message definitions come from: files that the plan names, and the packages of a ROS distribution."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Malformed, Rejected, Span
from avow.base.files import read_text
from avow.base.tuning.sizes import DEFINITION_BYTES
from avow.ros.definitions import (
    OTHER_NAMES,
    STANDARD,
    TIMES,
    Array,
    Definitions,
    Field,
    Message,
    Nested,
    Scalar,
    Wire,
    canonical,
    parse_message,
    parse_parts,
)

SUFFIXES = (".msg", ".srv", ".action", ".idl")

_MISNAMED = {"msgs": "msg", "messages": "msg", "srvs": "srv", "services": "srv", "actions": "action"}
"""Folders that ROS does not read, and the names that were probably meant."""

DISTRIBUTIONS = {
    "noetic": "ros1_noetic",
    **{
        name: f"ros2_{name}"
        for name in ("dashing", "eloquent", "foxy", "galactic", "humble", "iron", "jazzy", "kilted", "lyrical")
    },
}
"""ROS distributions whose common packages are known: their names in plans → their names in `rosbags`."""


def message_files(paths: Iterable[Path]) -> tuple[Path, ...]:
    """The definition files among some files and folders, in order. Never raises."""
    found: dict[Path, None] = {}
    for path in paths:
        inside = sorted(p for p in path.rglob("*") if p.suffix in SUFFIXES and p.is_file()) if path.is_dir() else [path]
        found.update(dict.fromkeys(inside))
    return tuple(found)


def definitions(paths: Iterable[Path], distro: str | None) -> tuple[Definitions, tuple[Diagnostic, ...]]:
    """All known types: the files first, then the distribution's packages, then those that are the same everywhere.
    Faults in the files, each with its place; two files that disagree are a fault naming both."""
    faults: list[Diagnostic] = []
    found: dict[str, Message] = {}
    every = message_files(paths)
    misnamed = {path.parent: path for path in reversed(every) if path.parent.name in _MISNAMED}
    for folder, path in misnamed.items():
        text = f"ROS reads no definitions of the package {folder.parent.name} from a folder `{folder.name}`"
        faults.append(Diagnostic("ROS101", text, _at(path, 1), hint=f"rename it to `{_MISNAMED[folder.name]}`"))
    for path in (path for path in every if path.parent not in misnamed):
        for message in _of_file(path, faults):
            other = found.setdefault(message.name, message)
            if other != message:
                text = f"{message.name} is defined otherwise in {other.source}"
                faults.append(Diagnostic("ROS102", text, _at(path, 1), hint="keep one of the two"))
    known: dict[str, Message] = dict(STANDARD)
    if distro is not None:
        known.update(distribution(distro))
    return Definitions({**known, **found}), tuple(faults)


@functools.lru_cache(maxsize=4)
def distribution(distro: str) -> Mapping[str, Message]:
    """The message types of a distribution's common packages."""
    from rosbags.typesys import Stores, get_typestore

    return from_store(get_typestore(Stores(DISTRIBUTIONS[distro])).fielddefs, distro)


def from_store(fielddefs: Mapping[str, Any], source: str) -> dict[str, Message]:
    """The types as `rosbags` holds them (of a distribution, of a bag)."""
    found = (_message(name, constants, fields, source) for name, (constants, fields) in fielddefs.items())
    return {message.name: message for message in found}


def _message(name: str, constants: Iterable[Any], fields: Iterable[Any], source: str) -> Message:
    called = canonical(name)
    return Message(
        called,
        tuple(Field(field, _wire(kind)) for field, kind in fields if field != _EMPTY),
        tuple((constant, OTHER_NAMES.get(kind, kind), str(value)) for constant, kind, value in constants),
        source,
    )


_EMPTY = "structure_needs_at_least_one_member"
"""The field that ROS 2 adds to a message without fields."""


def _wire(kind: Any) -> Wire:
    tag, content = kind
    match tag.name:
        case "BASE":
            return Scalar(OTHER_NAMES.get(content[0], content[0]))
        case "NAME":
            name = canonical(content)
            return Scalar(TIMES[name]) if name in TIMES else Nested(name)
        case _:  # ARRAY (of a length), SEQUENCE (of a bound, 0 for none)
            item = _wire(content[0])
            assert not isinstance(item, Array)
            return Array(item, content[1] if tag.name == "ARRAY" else None)


def _of_file(path: Path, faults: list[Diagnostic]) -> tuple[Message, ...]:
    """`package/msg/Type.msg`, or `package/Type.msg`: the folder is the package."""
    folder = path.parent
    package = folder.parent.name if folder.name in ("msg", "srv", "action") else folder.name
    name = f"{package}/{path.stem}"
    kind = path.suffix.removeprefix(".")
    try:
        if path.stat().st_size > DEFINITION_BYTES:
            raise ValueError(f"it has more than {DEFINITION_BYTES} bytes")
        text = read_text(path, "utf-8")
        if kind == "idl":
            return _of_idl(text, str(path))
        return parse_parts(text, name, kind, str(path)) if kind != "msg" else (parse_message(text, name, str(path)),)
    except Malformed as wrong:
        faults.append(Diagnostic("ROS101", f"{name}: {wrong}", _at(path, wrong.line), hint=wrong.hint))
    except (OSError, ValueError) as error:
        faults.append(Diagnostic("ROS101", f"{name} cannot be read: {error}", _at(path, 1)))
    return ()


def _of_idl(text: str, source: str) -> tuple[Message, ...]:
    from rosbags.typesys import TypesysError, get_types_from_idl

    try:
        return tuple(from_store(get_types_from_idl(text), source).values())
    except TypesysError as error:
        raise Malformed(f"no IDL that can be read: {error}", 1) from None


def _at(path: Path, line: int) -> Span:
    return Span(str(path), line, 1, line, 2)


def require(found: tuple[Definitions, tuple[Diagnostic, ...]]) -> Definitions:
    """The definitions. Raises Rejected with their faults."""
    known, faults = found
    if faults:
        raise Rejected(*faults)
    return known

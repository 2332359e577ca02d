"""Reads a method's options and files and reports their faults, in the same way for all backends; and the options for
reading messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import COMMON_OPTIONS, Job
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import inside, read_regular
from avow.base.packaged import packaged
from avow.base.remembered import Shelf
from avow.base.suggestions import nearby, suggest
from avow.system.plan import Located

_SHARED = packaged("avow.backend_kit", "options.json")
DURATION: Mapping[str, Any] = _SHARED["duration"]
REASON: Mapping[str, Any] = _SHARED["reason"]
NAN: Mapping[str, Any] = _SHARED["nan"]
"""The option `nan` of a method that runs or reads a program."""
READING: Mapping[str, Any] = _SHARED["reading"]
"""The options of every method that judges messages."""


def schema(properties: Mapping[str, Any], *required: str, **more: Any) -> dict[str, Any]:
    """The JSON schema (2020-12) of a method's options, which allows no others; `more` adds constraints."""
    closed = {"properties": dict(properties), "required": [*required], "additionalProperties": False}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "type": "object", **closed, **more}


def text(what: str) -> dict[str, Any]:
    """An option that is any text."""
    return {"type": "string", "description": what}


def file(what: str) -> dict[str, Any]:
    """An option that names a file."""
    return text(f"{what}, relative to the system's folder")


def whole_number(what: str, most: int, default: int) -> dict[str, Any]:
    """An option that is a number from 1 to `most`."""
    return {"type": "integer", "minimum": 1, "maximum": most, "default": default, "description": what}


def file_path(job: Job, key: str) -> Path | None:
    """The path under an option, whether or not the file exists; None if the option names no path in the system's
    folder. For `Backend.files`, which also includes missing files."""
    name = job.options.get(key)
    return inside(job.root, name) if isinstance(name, str) else None


def existing_file(job: Job, key: str, name: str, *, wrong: str, absent: str, hint: str | None = None) -> Path:
    """The file that the option `key` names (`name` is its value). Raises Rejected: with code `wrong` if that is no path
    in the system's folder, with code `absent` if no file is there; `hint` says how to get one."""
    place = job.method.options.at(key)
    if not name:
        raise Rejected(Diagnostic(wrong, f"{job.method.backend} needs '{key}': a file of the system's folder", place))
    path = inside(job.root, name)
    if path is None:
        raise Rejected(Diagnostic(wrong, f"'{name}' is not a file in the system's folder", place))
    if not path.is_file():
        message = f"there is no file '{name}' in the system's folder"
        raise Rejected(
            Diagnostic(absent, message, place, hint=nearby(path, name) or hint or "write it there, or correct the path")
        )
    return path


def file_bytes(path: Path, absent: str, wrong: str = "", most: int | None = None) -> bytes:
    """A file's bytes. Raises Rejected: with code `absent` if it cannot be read, with code `wrong` if it has more than
    `most` bytes."""
    start = Span(str(path), 1, 1, 1, 2)
    try:
        size = path.stat().st_size
        data = read_regular(path) if most is None or size <= most else b""
    except OSError as error:
        raise Rejected(Diagnostic(absent, f"cannot be read: {error.strerror or error}", start)) from None
    if most is not None and size > most:
        raise Rejected(Diagnostic(wrong, f"the file has {size} bytes; at most {most} are read", start))
    return data


def file_text(path: Path, absent: str, wrong: str, most: int) -> str:
    """The UTF-8 text of a file. Raises Rejected as `file_bytes`, and with code `wrong` if it is not UTF-8."""
    data = file_bytes(path, absent, wrong, most)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise Rejected(Diagnostic(wrong, "not UTF-8 text", Span(str(path), line, 1, line, 2))) from None


def summarized(job: Job, diagnostics: Sequence[Diagnostic], most: int = 5) -> str:
    """Diagnostics in one line, for an outcome's summary, with places that are the same on every machine."""
    lines = [_line(job, d) for d in diagnostics[:most]]
    if len(diagnostics) > most:
        lines.append(f"and {len(diagnostics) - most} more")
    return "; ".join(lines)


def _line(job: Job, diagnostic: Diagnostic) -> str:
    span, told = diagnostic.span, f"{diagnostic.message} ({diagnostic.hint})" if diagnostic.hint else diagnostic.message
    if span is None or not span.file:
        return told
    path, root = Path(span.file), job.root.resolve()
    return f"{(path.relative_to(root).as_posix() if path.is_relative_to(root) else path.name)}:{span.line}: {told}"


def job_for(folder: Path, node: str, backend: str, method: str | None, *, wrong: str, hint: str) -> Job:
    """The job that a command works on: that of the node's only method of a backend, or of the one with the id `method`.
    Raises Rejected with code `wrong` if there is none, or several; `hint` says how to add one."""
    from avow.system.load import load_system  # importing a backend needs no reader of plans

    system = load_system(folder)
    known = [n.name for n in system.contract.nodes]
    if node not in known:
        raise Rejected(Diagnostic(wrong, f"system '{system.name}' has no node '{node}'", hint=suggest(node, known)))
    found = [m for m in system.plan.node(node).methods if m.backend == backend and method in (None, m.id)]
    if len(found) != 1:
        what = f"{len(found)} of {backend} ({', '.join(m.id for m in found)})" if found else f"no {backend}"
        message = f"the plan has {what} among the methods of node '{node}'"
        raise Rejected(Diagnostic(wrong, message, hint="say which one: --method ID" if found else hint))
    return Job(system, system.contract.node(node), found[0], ())


def misshapen(
    schema: Mapping[str, Any], options: Located, whole: str, shelf: Shelf | None = None
) -> tuple[Diagnostic, ...]:
    """Every violation of a backend's schema in a method's options, without those for any backend."""
    from avow.system.schema import violations  # likewise

    if isinstance(options.data, Mapping):
        options = replace(options, data={k: v for k, v in options.data.items() if k not in COMMON_OPTIONS})
    return violations(options, schema, whole, shelf)

"""Cases as JSON, there and back, by the types of their dataclasses; and the JSON schema that follows from these.

Writing, reading and the schema come from one walk over the type hints, so they cannot drift apart. Reading is strict:
an unknown or missing field, or a value of another type, is `Unreadable`, never a guess.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import types
import typing
from collections.abc import Mapping
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any

from avow.assurance.answers import Baseline
from avow.assurance.model import Case
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import write
from avow.evidence.encoding import LATER, Unreadable, encode, plain
from avow.evidence.encoding import decode as decode_evidence
from avow.evidence.record import Evidence

SCHEMA = "https://avow.invalid/schemas/case-4"
"""Names the format in ``report.json``; raised when it changes incompatibly."""


def to_json(case: Case) -> dict[str, Any]:
    """A case as plain data."""
    return {"schema": SCHEMA, **_encode(case)}


def from_json(data: object) -> Case:
    """The case that plain data stands for. Raises Unreadable."""
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise Unreadable(f"not a case of format {SCHEMA}")
    case = _decode(Case, {key: value for key, value in data.items() if key != "schema"}, "case")
    assert isinstance(case, Case)
    return case


def baseline_to_json(baseline: Baseline) -> dict[str, Any]:
    """What of a case was signed, as plain data."""
    found: dict[str, Any] = _encode(baseline)
    return found


def read_case(path: Path) -> Case:
    """The case of a report (its folder, or report.json). Raises Rejected."""
    file = path / "report.json" if path.is_dir() else path
    try:
        return from_json(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise Rejected(Diagnostic("REPORT001", f"{file} cannot be read: {error.strerror}")) from None
    except (ValueError, RecursionError, Unreadable) as error:
        message = f"{file} is no report of this version of Avow: {error}"
        raise Rejected(Diagnostic("REPORT002", message, hint="`doit report` renders it again")) from None


def baseline_from_json(data: object) -> Baseline:
    """Raises Unreadable."""
    found = _decode(Baseline, data, "baseline")
    assert isinstance(found, Baseline)
    return found


def case_schema() -> dict[str, Any]:
    """The JSON schema (2020-12) of ``report.json``."""
    definitions: dict[str, Any] = {}
    _schema(Case, definitions)
    record = definitions["Evidence"]
    record["required"] = [name for name in record["required"] if name not in LATER]
    body = definitions.pop("Case")
    body["properties"] = {"schema": {"const": SCHEMA}, **body["properties"]}
    body["required"] = ["schema", *body["required"]]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": SCHEMA,
        "title": "Avow assurance case",
        **body,
        "$defs": dict(sorted(definitions.items())),
    }


def evidence_schema() -> dict[str, Any]:
    """The JSON schema (2020-12) of one line of the ledger."""
    definitions: dict[str, Any] = {}
    _schema(Evidence, definitions)
    record = definitions["Evidence"]
    record["required"] = [name for name in record["required"] if name not in LATER]
    mark = {"type": "string", "pattern": "^[0-9a-f]{64}$"}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "https://avow.invalid/schemas/evidence-1",
        "title": "A line of Avow's evidence ledger",
        "description": "hash: SHA-256 of the line's canonical JSON without it; prev: the hash of the line before.",
        "type": "object",
        "properties": {
            "evidence": {"$ref": "#/$defs/Evidence"},
            "hash": mark,
            "n": {"type": "integer", "minimum": 0},
            "prev": mark,
        },
        "required": ["evidence", "hash", "n", "prev"],
        "additionalProperties": False,
        "$defs": dict(sorted(definitions.items())),
    }


def _encode(value: object) -> Any:
    if isinstance(value, Evidence):
        return encode(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {name: _encode(getattr(value, name)) for name in _fields(type(value))}
    if isinstance(value, tuple):
        return [_encode(item) for item in value]
    return plain(value)


@cache
def _fields(kind: type) -> dict[str, Any]:
    hints = typing.get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


def _decode(kind: Any, data: Any, where: str) -> Any:
    if kind is Evidence:
        return decode_evidence(data)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        fields = _fields(kind)
        if not isinstance(data, dict) or data.keys() != fields.keys():
            odd = sorted(set(data) ^ set(fields)) if isinstance(data, dict) else "no object"
            raise Unreadable(f"{where}: not a {kind.__name__} ({odd})")
        return kind(**{name: _decode(hint, data[name], f"{where}.{name}") for name, hint in fields.items()})
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        return _decode_tuple(arguments, data, where)
    if origin is types.UnionType or origin is typing.Union:
        if data is None and type(None) in arguments:
            return None
        return _decode(next(a for a in arguments if a is not type(None)), data, where)
    if origin is Mapping or (isinstance(origin, type) and issubclass(origin, Mapping)):
        if not isinstance(data, dict):
            raise Unreadable(f"{where}: not an object")
        return {key: _decode(arguments[1], item, f"{where}.{key}") for key, item in data.items()}
    return _decode_plain(kind, data, where)


def _decode_tuple(arguments: tuple[Any, ...], data: Any, where: str) -> tuple[Any, ...]:
    if not isinstance(data, list):
        raise Unreadable(f"{where}: not a list")
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return tuple(_decode(arguments[0], item, f"{where}[{at}]") for at, item in enumerate(data))
    if len(data) != len(arguments):
        raise Unreadable(f"{where}: {len(arguments)} items are wanted")
    return tuple(
        _decode(kind, item, f"{where}[{at}]") for at, (kind, item) in enumerate(zip(arguments, data, strict=True))
    )


def _decode_plain(kind: Any, data: Any, where: str) -> Any:
    if kind is Any:
        return data
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        try:
            return kind(data)
        except ValueError as error:
            raise Unreadable(f"{where}: {error}") from error
    if kind is float and isinstance(data, int) and not isinstance(data, bool):
        return float(data)
    if kind in (str, int, float, bool) and type(data) is kind:
        return data
    raise Unreadable(f"{where}: not a {getattr(kind, '__name__', kind)}")


def _schema(kind: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        if kind.__name__ not in definitions:
            definitions[kind.__name__] = {}
            fields = _fields(kind)
            definitions[kind.__name__] = {
                "description": (kind.__doc__ or "").strip().split("\n\n")[0],
                "type": "object",
                "properties": {name: _schema(hint, definitions) for name, hint in fields.items()},
                "required": list(fields),
                "additionalProperties": False,
            }
        return {"$ref": f"#/$defs/{kind.__name__}"}
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is tuple:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return {"type": "array", "items": _schema(arguments[0], definitions)}
        items = [_schema(a, definitions) for a in arguments]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if origin is types.UnionType or origin is typing.Union:
        return {"anyOf": [_schema(a, definitions) for a in arguments]}
    if origin is Mapping or (isinstance(origin, type) and issubclass(origin, Mapping)):
        return {"type": "object", "additionalProperties": _schema(arguments[1], definitions)}
    if isinstance(kind, type) and issubclass(kind, StrEnum):
        return {"enum": [member.value for member in kind]}
    return dict(_PLAIN[kind])


_PLAIN: dict[Any, dict[str, Any]] = {
    Any: {},
    str: {"type": "string"},
    int: {"type": "integer"},
    float: {"type": "number"},
    bool: {"type": "boolean"},
    type(None): {"type": "null"},
}


def write_schemas(folder: Path) -> None:
    """Write the published schemas (``python -m avow.assurance.codec docs/schemas``)."""
    for name, schema in (("case", case_schema()), ("evidence", evidence_schema())):
        write(folder / f"{name}.schema.json", json.dumps(schema, indent=1) + "\n")


if __name__ == "__main__":
    write_schemas(Path(sys.argv[1]))

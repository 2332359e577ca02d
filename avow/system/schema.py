"""Checks a plan against its JSON schema; every fault is reported in words and with its place."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from avow.base.diagnostics import Diagnostic, Span
from avow.base.packaged import packaged
from avow.base.remembered import Shelf
from avow.base.suggestions import did_you_mean, nearest, suggest
from avow.base.tools import package_version
from avow.base.tuning.sizes import REPAIR_ROUNDS
from avow.system.pieces import Located, Piece


def plan_schema() -> dict[str, Any]:
    """The published schema of plan.yaml."""
    schema: dict[str, Any] = packaged("avow.system", "plan.schema.json")
    return schema


def check_shape(piece: Piece, shelf: Shelf | None = None) -> tuple[Diagnostic, ...]:
    """Every violation of the schema, in the order of the file. `shelf`: the cache of documents without violations."""
    return violations(piece.located(), plan_schema(), shelf=shelf)


def without_faults(root: Piece) -> tuple[Piece | None, frozenset[str]]:
    """The rest of a document without the pieces that violate the schema, and the words of those: for checking the rest,
    never for verifying. None if nothing is left."""
    dropped: set[str] = set()
    for _ in range(REPAIR_ROUNDS):  # dropping a piece may leave another without what it needs
        wrong = set(_wrong_places(root))
        if not wrong:
            return root, frozenset(dropped)
        if () in wrong:
            break
        for path in sorted(wrong, key=lambda path: (len(path), [str(step).zfill(9) for step in path]), reverse=True):
            root = _without(root, path, dropped)
    return None, frozenset(dropped)


def _wrong_places(root: Piece) -> Iterator[tuple[str | int, ...]]:
    for error in _validator()(plan_schema()).iter_errors(root.data):
        path = tuple(error.absolute_path)
        if "propertyNames" in error.absolute_schema_path:
            yield (*path, str(error.instance))
        elif error.validator == "additionalProperties":
            known = error.schema.get("properties", {})
            yield from ((*path, key) for key in (root.at(*path) or root).entries or {} if key not in known)
        else:
            yield path


def _without(piece: Piece, path: tuple[str | int, ...], dropped: set[str]) -> Piece:
    step, rest = path[0], path[1:]
    inner = piece.at(step)
    if inner is None:
        return piece
    kept = _without(inner, rest, dropped) if rest else None
    if kept is None:
        dropped.update(re.findall(r"\w+'*", f"{step} {inner.data}"))
    if piece.entries is not None:
        entries = {key: kept if key == step else value for key, value in piece.entries.items()}
        return replace(piece, entries={key: value for key, value in entries.items() if value is not None})
    items = [kept if at == step else value for at, value in enumerate(piece.items or [])]
    return replace(piece, items=[value for value in items if value is not None])


def violations(
    options: Located, schema: Mapping[str, Any], whole: str = "the plan", shelf: Shelf | None = None
) -> tuple[Diagnostic, ...]:
    """Every violation of a schema in a plan or a part of one, such as a method's options. `whole` is the name of that
    part; `shelf`: as for `check_shape`."""
    if shelf is None:
        return _departures(options, schema, whole)
    # the diagnostics of a value depend on its type, too, which JSON would not show
    told = (package_version("jsonschema"), json.dumps(schema, default=repr), repr(options.data))
    digest = shelf.digest("shape", *told)
    if shelf.knows(digest):
        return ()
    found = _departures(options, schema, whole)
    if not found:
        shelf.note(digest)
    return found


def _departures(options: Located, schema: Mapping[str, Any], whole: str) -> tuple[Diagnostic, ...]:
    found = [d for error in _validator()(schema).iter_errors(options.data) for d in _explain(error, options, whole)]
    # a value has one fault, whichever rules it breaks
    found = list(
        {(d.span, d.message.partition(": ")[0] if d.code == "PLAN105" else d.message): d for d in found}.values()
    )
    # the faults of what YAML repeats (`*name`) have one place, and the validator uses sets
    return tuple(sorted(found, key=lambda d: (d.span.line, d.span.column, d.message) if d.span else (0, 0, d.message)))


def _key_path(path: Iterable[str | int], whole: str = "the plan") -> str:
    """``connections[0].to``, for messages; `whole` if the path is empty."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else (f".{step}" if text else step)
    return text or whole


@cache
def _validator() -> Any:
    """The class of validators: creating one costs more than checking a plan."""
    from jsonschema import Draft202012Validator, validators  # slow to import

    return validators.extend(Draft202012Validator, {"pattern": _pattern})  # type: ignore[no-untyped-call]


def _pattern(validator: Any, pattern: str, instance: Any, schema: Any) -> Iterator[Any]:
    """As JSON schema has it, but ``$`` means the very end, not the end but for a newline."""
    from jsonschema.exceptions import ValidationError

    if isinstance(instance, str) and (not re.search(pattern, instance) or instance.endswith("\n")):
        yield ValidationError(f"{instance!r} does not match {pattern!r}")


def _explain(error: Any, options: Located, whole: str, also: Iterable[Any] = ()) -> Iterator[Diagnostic]:
    """`also`: the errors of other alternatives about the same value, which allow other words."""
    path: tuple[str | int, ...] = tuple(error.absolute_path)
    where = _key_path(path, whole)
    about = error.schema.get("description") if isinstance(error.schema, dict) else None
    wanted = f" (expected: {about})" if about else ""
    given = _show(error.instance)

    def fault(text: str, code: str = "PLAN105", at: Span | None = None, hint: str | None = None) -> Diagnostic:
        return Diagnostic(code, f"{where}: {text}", at or options.at(*path), hint=hint)

    if "propertyNames" in error.absolute_schema_path:
        name = str(error.instance)
        yield fault(f"the key {name!r} cannot be used here{wanted}", "PLAN103", options.key(*path, name))
        return
    match error.validator:
        case "additionalProperties":
            known = list(error.schema.get("properties", {}))
            for key in (key for key in error.instance if key not in known):
                empty = error.instance[key] is None and not did_you_mean(key, known)
                hint = f"a text with a comma needs quotes: “…, {key}”" if empty else suggest(key, known)
                yield fault(f"unknown key {key!r}", "PLAN103", options.key(*path, key), hint)
        case "required" | "dependentRequired":
            named = str(error.message).split("'")[1]
            unknown = (key for key in error.instance if key not in error.schema.get("properties", {key}))
            if any(nearest(key, error.schema["properties"])[:1] == [named] for key in unknown):
                return  # the fault is the misspelled key
            yield fault(f"the key {named!r} is missing", "PLAN104")
        case "uniqueItems":
            twice = next(item for at, item in enumerate(error.instance) if item in error.instance[:at])
            yield fault(f"{_show(twice)} is given twice")
        case "enum" | "const":
            allowed = [json.dumps(word).strip('"') for one in (error, *also) for word in _words(one)]
            if len(allowed) == 1:
                yield fault(f"{allowed[0]} is wanted, not {given}{wanted}", hint=f"write `{allowed[0]}`")
                return
            word = _VERSIONS.get(str(error.instance), error.instance)
            hint = (
                f"write `{word}`" if word in allowed else did_you_mean(word, allowed) if isinstance(word, str) else None
            )
            yield fault(f"{given} is not one of {', '.join(allowed)}", hint=hint)
        case "type":
            kinds = error.validator_value if isinstance(error.validator_value, list) else [error.validator_value]
            names = " or ".join(str(_KINDS.get(kind, kind)) for kind in kinds)
            hint = None
            if isinstance(error.instance, str) and "boolean" in kinds:
                hint = "write true or false (yes, no, on and off are plain words here)"
            elif isinstance(error.instance, int | float | bool) and "string" in kinds and "pattern" not in error.schema:
                hint = "put it in quotes"
            elif kinds == ["object"] and isinstance(error.instance, str) and (keys := error.schema.get("required")):
                hint = f"write `{{{', '.join(f'{key}: …' for key in keys)}}}`"
            elif kinds == ["array"]:
                hint = "write `- ` before each item"
            if "pattern" in error.schema and about:
                yield fault(f"{about} is wanted, not {given}")
                return
            yield fault(f"{names} is wanted, not {given}{wanted}", hint=hint)
        case "pattern":
            yield fault(f"{given} has not the right form{wanted}")
        case "minLength" | "minItems" | "minProperties":
            yield fault(f"must not be empty{wanted}")
        case "oneOf" | "anyOf":
            ways = _alternatives(error.validator_value)
            fitting = [e for e in error.context if not _another_kind(e, error)]
            fitting = _narrowed(fitting, error, "additionalProperties")
            closed = _closed(fitting, error)
            fitting = _narrowed(_narrowed(fitting, error, "const"), error, "required")
            several = len({_way(e, error) for e in fitting}) > 1
            if not error.context:
                yield fault(f"either {ways} is wanted, not both{wanted}")
            elif not fitting:
                yield fault(f"{ways} is wanted, not {given}{wanted}")
            elif closed:
                yield from _explain(closed[0], options, whole, closed[1:])
            elif several and all(e.validator == "required" and e.absolute_path == error.absolute_path for e in fitting):
                ways = _alternatives({"required": e.validator_value} for e in fitting)
                yield fault(f"{ways} is missing{wanted}", "PLAN104")
            else:
                for inner in fitting:
                    yield from _explain(inner, options, whole)
        case "maxProperties":
            yield fault(f"exactly one key is wanted{wanted}")
        case _:  # in the validator's words
            yield fault(f"{str(error.message)[:300]}{wanted}")


def _words(error: Any) -> list[Any]:
    """The values that an error's schema allows."""
    return [error.validator_value] if error.validator == "const" else error.validator_value


def _way(inner: Any, outer: Any) -> Any:
    """The alternative of an outer error that an inner one is about."""
    return list(inner.absolute_schema_path)[len(list(outer.absolute_schema_path))]


def _another_kind(inner: Any, outer: Any) -> bool:
    """Whether an alternative is out of the question: it requires a list, say, and the value is a text."""
    alternative = outer.validator_value[_way(inner, outer)]
    kinds = alternative.get("type", []) if isinstance(alternative, dict) else []
    return inner.validator == "type" and list(inner.absolute_path) == list(outer.absolute_path) and bool(kinds)


def _narrowed(errors: list[Any], outer: Any, validator: str) -> list[Any]:
    """The errors under the alternatives that do not fail like this at the value itself (for a word: at one of its
    keys), if there are such alternatives."""
    deep = len(outer.absolute_path) + (validator == "const")
    strange = {_way(e, outer) for e in errors if e.validator == validator and len(e.absolute_path) == deep}
    return [e for e in errors if _way(e, outer) not in strange] or errors


def _closed(errors: list[Any], outer: Any) -> list[Any]:
    """The errors about one value for which each of several alternatives has other words, if there is such a value."""
    words = [e for e in errors if e.validator in ("const", "enum")]
    ways = {_way(e, outer) for e in errors}
    same = ([e for e in words if e.absolute_path == one.absolute_path] for one in words)
    return next((found for found in same if len(ways) > 1 and {_way(e, outer) for e in found} == ways), [])


def _alternatives(schemas: Iterable[Any]) -> str:
    """What the alternatives accept: kinds of values, or keys that go together."""
    said: list[str] = []
    for schema in schemas:
        kinds = schema.get("type", [])
        words = [str(_KINDS.get(k, k)) for k in ([kinds] if isinstance(kinds, str) else kinds)]
        said += words or [" with ".join(repr(key) for key in schema.get("required", []))]
    return " or ".join(dict.fromkeys(said))


_VERSIONS = {"ros1": "rospy", "ros2": "rclpy"}
"""A version of ROS → its kind of class."""

_KINDS = {
    "object": "a mapping",
    "array": "a list",
    "string": "text",
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "null": "nothing",
}


def _show(value: Any) -> str:
    if isinstance(value, str):
        return repr(value if len(value) <= 60 else value[:57] + "…")
    if isinstance(value, bool):
        return "true" if value else "false"
    return {type(None): "nothing", dict: "a mapping", list: "a list"}.get(type(value), str(value))

"""The completions at a place of a plan, and the documentation of its keys: by the plan's schema, the backends' options,
and the names of the contract. It is based on lines, so that it works while a text is being typed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from avow.backend_kit.registry import backend, names
from avow.language.contract import Contract
from avow.lsp.completion import Offer
from avow.system.schema import plan_schema

_KEY = re.compile(r"^(?P<indent> *)(?P<dashes>(?:- +)*)(?P<key>[A-Za-z_][\w.]*)\s*:(?P<rest>.*)$")
_METHOD = re.compile(r"^ *(?:- +)+(?P<key>[A-Za-z_]\w*) *$")
"""A method without options."""
_TYPING = re.compile(r"^ *(?:- +)*[\w.]*$")
_NAMED = ("nodes", "compound", "external")


def plan_offers(text: str, contract: Contract, offset: int) -> tuple[Offer, ...]:
    """All completions at an offset of a plan.

    After ``node.`` its ports and guarantees; at the start of a line the keys of the schema, and nodes where these are
    keys; elsewhere nodes."""
    begin = text.rfind("\n", 0, offset) + 1
    line = text[begin:offset]
    if _in_comment(line):
        return ()
    owner = re.search(r"([A-Za-z_][A-Za-z0-9_']*)\.(?:(in|out)\.)?[A-Za-z0-9_']*$", line)
    if owner is not None:
        return tuple(_of_node(contract, owner[1], owner[2]))
    nodes = [Offer(node.name, "Class", "node") for node in contract.nodes]
    if not _TYPING.match(line):
        return tuple(nodes)
    path = _path(text[:begin].split("\n"), len(line) - len(line.lstrip(" -")))
    keys = [Offer(key, "Property", detail, f"{key}: ") for key, detail in _keys(path)]
    if path and path[-1] in _NAMED:
        keys += [Offer(node.name, "Class", "node", f"{node.name}:") for node in contract.nodes]
    return tuple(keys or nodes)


def _in_comment(line: str) -> bool:
    return bool(re.search(r"(^|\s)#", re.sub(r"\"[^\"]*\"|'[^']*'", "", line)))


def _of_node(contract: Contract, owner: str, role: str | None) -> Iterator[Offer]:
    for node in contract.nodes:
        if owner in ("in", "out") or node.name == owner:
            side = role or (owner if owner in ("in", "out") else None)
            for port in (*node.inputs, *node.outputs):
                if side is None or port.role == side:
                    yield Offer(port.name, "Field", port.type_name)
        if node.name == owner and role is None:
            yield from (Offer(c.name, "Method", c.sentence or "") for c in node.guarantees)


def _path(lines: Sequence[str], indent: int) -> tuple[str, ...]:
    """The keys around a line with this indentation, outermost first."""
    found: list[str] = []
    for line in reversed(lines):
        match = _KEY.match(line)
        if match is None:
            continue
        at = len(match["indent"]) + len(match["dashes"])
        if at < indent:
            found.append(match["key"])
            indent = len(match["indent"])
            if match["dashes"]:
                indent += 1  # the list's parent may be in the column of its dashes
    return tuple(reversed(found))


def about_key(text: str, offset: int) -> str | None:
    """Markdown about the key at an offset: the schema's description of it, or of a method, or of a method's option."""
    begin = text.rfind("\n", 0, offset) + 1
    line = text[begin:].split("\n", 1)[0]
    match = _KEY.match(line) or _METHOD.match(line)
    if match is None or not begin + match.start("key") <= offset <= begin + match.end("key"):
        return None
    key = match["key"]
    path = _path(text[:begin].split("\n"), match.start("key"))
    said = next((about for name, about in _keys(path) if name == key), "")
    return f"`{key}`: {said}" if said else None


def _keys(path: Sequence[str]) -> Iterator[tuple[str, str]]:
    """The keys that are allowed at a path, with their descriptions."""
    if _among_methods(path):
        yield from ((name, _about_backend(name)) for name in names())
    here: list[Mapping[str, Any]] = [plan_schema()]
    for at, key in enumerate(path):
        known = _among_methods(path[:at]) and key in names()
        here = [backend(key).options_schema] if known else [inner for s in here for inner in _under(s, key)]
    for schema in here:
        for key, inner in schema.get("properties", {}).items():
            yield key, str(inner.get("description", ""))


def _among_methods(path: Sequence[str]) -> bool:
    return len(path) == 3 and (path[0], path[2]) == ("nodes", "methods")


def _about_backend(name: str) -> str:
    options = ", ".join(f"`{option}`" for option in backend(name).options_schema.get("properties", {}))
    return f"{backend(name).title}\n\nIts options: {options}"


def _under(schema: Mapping[str, Any], key: str) -> Iterator[dict[str, Any]]:
    properties, other = schema.get("properties", {}), schema.get("additionalProperties")
    for inner in (properties[key],) if key in properties else (other,) if isinstance(other, dict) else ():
        yield from _resolved(inner)


def _resolved(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The schema, or those that it refers to, chooses among, or lists."""
    if "$ref" in schema:
        yield from _resolved(plan_schema()["$defs"][schema["$ref"].rsplit("/", 1)[-1]])
        return
    for inner in (*schema.get("anyOf", ()), *schema.get("oneOf", ())):
        yield from _resolved(inner)
    if isinstance(schema.get("items"), dict):
        yield from _resolved(schema["items"])
    yield schema

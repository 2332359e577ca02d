"""The form of the method's options in plan.yaml."""

from __future__ import annotations

from typing import Any

from avow.backend_kit.given import REASON, file, mapping, schema, text

_TEXT = {"type": "string"}
_RANGES: dict[str, Any] = {
    "type": "object",
    "additionalProperties": {
        "anyOf": [
            _TEXT,
            {"type": "integer"},
            {"type": "array", "items": {"type": ["integer", "string"]}, "minItems": 1},
        ]
    },
}
SCHEMA = schema(
    {
        "program": file("the Gwendolen program (.gwen)"),
        "agent": text("the agent's name, as the properties use it"),
        "environment": text("how percepts are drawn (YAML)"),
        "predicates": {
            "type": "object",
            "additionalProperties": _TEXT,
            "description": "RCL pattern → BDI formula; free variables of the pattern stand for terms",
        },
        "instances": {
            **_RANGES,
            "description": "index variable → its finite range: '1..12', 'table.column' or a list of numbers",
        },
        "variables": {
            "type": "object",
            "additionalProperties": {"enum": ["REAL", "NATURAL", "INTEGER", "BOOL", "STRING"]},
            "description": "sorts of pattern variables that the node's own clauses do not bind",
        },
        "properties": {
            "type": "object",
            "description": "further properties: PSL text, or a mapping that attaches one to a guarantee",
            "propertyNames": {"pattern": "^[A-Za-z][A-Za-z0-9_]*$"},
            "additionalProperties": {
                "anyOf": [
                    _TEXT,
                    mapping(
                        {
                            "psl": _TEXT,
                            "guarantee": text("whose verdict it belongs to"),
                            "counts": {"type": "boolean", "description": "false: listed only; default true"},
                            "instances": {**_RANGES, "description": "narrower ranges than the method's"},
                            "forbids": text("RCL pattern: what the guarantee forbids; this says when"),
                            "because": REASON,
                        },
                        "psl",
                    ),
                ]
            },
        },
        "semantics": {"enum": ["mcapl", "edge"], "description": "how percepts become events; default mcapl"},
        "engine": {"enum": ["auto", "builtin", "ajpf"], "description": "default auto"},
        "states": {"type": "integer", "minimum": 1, "description": "bound on the states explored"},
        "environment_class": {
            **_TEXT,
            "pattern": "^[A-Za-z_][A-Za-z0-9_.$]*$",
            "description": "AJPF only: the Java class of the environment",
        },
    },
    *("program", "environment", "predicates"),
)

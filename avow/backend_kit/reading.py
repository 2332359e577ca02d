"""JSON schema of the options that say how a node's messages are read and when they are judged: every method that
judges messages takes them."""

from __future__ import annotations

from typing import Any

from avow.backend_kit.given import mapping, text

PATH = text("a field of the message: pose.position.x, ranges[0]")
DURATION = {
    "type": "string",
    "pattern": "^[0-9]+([.][0-9]+)? ?(us|ms|s|min)$",
    "description": "a time with a unit, such as 50 ms",
}
_CELL = mapping(
    {
        "table": text("a table of the plan's scenario"),
        "key": text("the message's field that names the row"),
        "by": text("the table's column that the key is looked up in"),
        "column": text("the column of the value"),
        "as": text("the type in which the node holds the value: float64"),
    },
    *("table", "key", "by", "column"),
)
ARGUMENT = {"oneOf": [PATH, _CELL]}
_BECAUSE = {"because": {"type": "string", "minLength": 1}}
_PORTS = {"input": PATH, "output": PATH}
_LATENCY = {"by": {"const": "latency"}, "latency": DURATION, "jitter": DURATION, **_BECAUSE}
_ANSWERS = (
    mapping({"by": {"const": "arrival"}, **_BECAUSE}, "by", "because"),
    mapping({"by": {"const": "order"}, **_BECAUSE}, "by", "because"),
    mapping({"by": {"const": "call"}}, "by"),
    mapping({"by": {"const": "stamp"}, **_PORTS}, "by"),
    mapping({"by": {"const": "key"}, **_PORTS}, "by", "input", "output"),
    mapping(_LATENCY, "latency", "jitter", "because"),
)

READING: dict[str, Any] = {
    "when": {
        "enum": ["outputs", "any", "every"],
        "description": "judge a clause when each of its outputs has been published since it was last judged "
        "(default), when any of them is, or at every event that changes one of its variables",
    },
    "answers": {
        "description": "which input an answer answered: without it, verdicts are shown and are no evidence",
        "oneOf": [*_ANSWERS],
    },
    "mapping": {
        "type": "object",
        "description": "how messages become values of the node's variables (in.r, out.command)",
        "additionalProperties": {
            "oneOf": [
                PATH,
                {"type": "array", "items": PATH, "minItems": 1, "description": "the fields, in order"},
                {
                    "type": "object",
                    "properties": {
                        "topic": text("a topic's name, if not the contract's"),
                        "type": text("the topic's ROS type, if not in the contract"),
                        "field": PATH,
                        "fields": {"type": "array", "items": PATH, "minItems": 1},
                        "each": text("a field that holds a list of tuples"),
                        "hold": {
                            "enum": ["latest", "seen"],
                            "description": "a relation holds at the latest message's tuples (default), or at all "
                            "that were seen",
                        },
                        "values": {
                            "type": "object",
                            "additionalProperties": {"type": "string"},
                            "description": "a message's word: the contract's name",
                        },
                        "elsewhere": {
                            "description": "a function's value where no message has given one; of anything else, "
                            "the value where there is no reading"
                        },
                        "take": {"enum": ["min", "max", "count"], "description": "of the items of an array"},
                        "nan": {"const": "none", "description": "a NaN is no reading"},
                        "inf": {"const": "none", "description": "an infinity is no reading"},
                        "initial": {"description": "the value before the first message"},
                        "scenario": {"const": True, "description": "the plan's interpretation, at all times"},
                        "previous": text("an output's value of the step before"),
                        "constructor": text("the field that names the constructor"),
                        "arguments": {
                            "type": "object",
                            "additionalProperties": {"type": "array", "items": ARGUMENT},
                            "description": "constructor: the fields of its arguments (a constructor's name may "
                            "also stand beside `constructor` itself)",
                        },
                    },
                },
            ]
        },
    },
}
"""`when`, `answers`, `mapping`."""

"""JSON schema of the method's options in plan.yaml."""

from __future__ import annotations

from typing import Any

_PATH = {"type": "string", "description": "a field of the message: pose.position.x, ranges[0]"}
_DURATION = {
    "type": "string",
    "pattern": "^[0-9]+([.][0-9]+)? ?(us|ms|s|min)$",
    "description": "a time with a unit, such as 50 ms",
}
_ARGUMENT = {
    "oneOf": [
        _PATH,
        {
            "type": "object",
            "additionalProperties": False,
            "required": ["table", "key", "by", "column"],
            "properties": {
                "table": {"type": "string", "description": "a table of the plan's scenario"},
                "key": {"type": "string", "description": "the message's field that names the row"},
                "by": {"type": "string", "description": "the table's column that the key is looked up in"},
                "column": {"type": "string", "description": "the column of the value"},
                "as": {"type": "string", "description": "the type in which the node holds the value: float64"},
            },
        },
    ]
}

SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "traces": {
            "type": "array",
            "items": {"type": "string"},
            "description": "recorded runs, one by one: JSON lines (.jsonl), ROS 1 bags (.bag), ROS 2 bags (folders)",
        },
        "when": {
            "enum": ["outputs", "any", "every"],
            "description": "judge a clause when each of its outputs has been published since it was last judged "
            "(default), when any of them is, or at every event that changes one of its variables",
        },
        "answers": {
            "description": "which input an answer answered: without it, verdicts are shown and are no evidence",
            "oneOf": [
                {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["by", "because"],
                    "properties": {"by": {"const": "arrival"}, "because": {"type": "string", "minLength": 1}},
                },
                {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["by", "because"],
                    "properties": {"by": {"const": "order"}, "because": {"type": "string", "minLength": 1}},
                },
                {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["by"],
                    "properties": {"by": {"const": "call"}},
                },
                {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["by"],
                    "properties": {"by": {"const": "stamp"}, "input": _PATH, "output": _PATH},
                },
                {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["by", "input", "output"],
                    "properties": {"by": {"const": "key"}, "input": _PATH, "output": _PATH},
                },
                {
                    "type": "object",
                    "additionalProperties": False,
                    "required": ["latency", "jitter", "because"],
                    "properties": {
                        "by": {"const": "latency"},
                        "latency": _DURATION,
                        "jitter": _DURATION,
                        "because": {"type": "string", "minLength": 1},
                    },
                },
            ],
        },
        "fresh": {
            "type": "object",
            "additionalProperties": _DURATION,
            "description": "how long a variable may be silent: {in.r: 200 ms}",
        },
        "rate": {
            "type": "object",
            "additionalProperties": {
                "type": "string",
                "pattern": "^[0-9]+([.][0-9]+)? ?Hz ?(±|[+]/?-) ?[0-9]+([.][0-9]+)? ?%$",
                "description": "a frequency and how far it may be off",
            },
            "description": "how often a variable has to come: {in.r: 10 Hz ± 20 %}",
        },
        "max_age": {**_DURATION, "description": "how old an answer's inputs may be, for a run to be evidence"},
        "losses": {
            "type": "integer",
            "minimum": 0,
            "description": "how many messages may have been lost, by their numbers (header.seq), for a run to be "
            "evidence; messages without numbers are then no evidence",
        },
        "decided": {
            "type": "number",
            "exclusiveMinimum": 0,
            "maximum": 1,
            "description": "the share of what was published that has to be decided (default 1)",
        },
        "overhead": {
            "type": "array",
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["data", "how", "machine", "date"],
                "properties": {
                    "data": {
                        "type": "string",
                        "description": "a table (CSV) with a row for each run: its `monitors` (none, all, or a node's "
                        "name), and the seconds until the robot had reached each place",
                    },
                    "how": {"type": "string", "minLength": 1, "description": "what was measured, and how"},
                    "machine": {"type": "string", "minLength": 1, "description": "the machine that it was measured on"},
                    "date": {"type": "string", "pattern": "^[0-9]{4}-[0-9]{2}-[0-9]{2}$"},
                },
            },
            "description": "what monitors cost the running robot, as it was measured: shown with the evidence",
        },
        "grace": {**_DURATION, "description": "how long after a deadline silence is told (default 50 ms)"},
        "jitter": {
            **_DURATION,
            "description": "by how much times may go back, and regular steps come early or late (default 10 ms)",
        },
        "instances": {
            "type": "integer",
            "minimum": 1,
            "maximum": 100_000,
            "description": "values of a quantified variable for which something is remembered (default 1000)",
        },
        "ros_version": {"enum": ["ros1", "ros2"], "description": "for the generated configuration"},
        "silent": {"type": "boolean", "description": "whether the ROS monitor keeps its messages to itself"},
        "warning": {"type": "integer", "minimum": 0, "description": "the ROS monitor's warning level (default 1)"},
        "oracle": {
            "type": "object",
            "additionalProperties": False,
            "required": ["port"],
            "properties": {
                "url": {"type": "string", "pattern": "^[A-Za-z0-9.:_-]+$"},
                "port": {"type": "integer", "minimum": 1, "maximum": 65535},
                "action": {"enum": ["nothing"]},
                "timeout": {"type": "number", "exclusiveMinimum": 0},
            },
            "description": "where the online oracle listens; without it the monitor only writes its log",
        },
        "filter": {
            "type": "array",
            "items": {"type": "string"},
            "description": "outputs whose messages --enforce and the ROS monitor pass on only while nothing is broken",
        },
        "ordered": {**_DURATION, "description": "the ROS monitor sorts by time what comes within so long"},
        "package": {"type": "string", "description": "the ROS package of the node, for instrumentation"},
        "path": {"type": "string", "description": "the launch file of the node, for instrumentation"},
        "mapping": {
            "type": "object",
            "description": "how messages become values of the node's variables (in.r, out.command)",
            "additionalProperties": {
                "oneOf": [
                    _PATH,
                    {"type": "array", "items": _PATH, "minItems": 1, "description": "the fields, in order"},
                    {
                        "type": "object",
                        "properties": {
                            "topic": {"type": "string", "description": "a topic's name, if not the contract's"},
                            "type": {"type": "string", "description": "the topic's ROS type, if not in the contract"},
                            "field": _PATH,
                            "fields": {"type": "array", "items": _PATH, "minItems": 1},
                            "each": {"type": "string", "description": "a field that holds a list of tuples"},
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
                            "previous": {"type": "string", "description": "an output's value of the step before"},
                            "constructor": {"type": "string", "description": "the field that names the constructor"},
                            "arguments": {
                                "type": "object",
                                "additionalProperties": {"type": "array", "items": _ARGUMENT},
                                "description": "constructor: the fields of its arguments (a constructor's name may "
                                "also stand beside `constructor` itself)",
                            },
                        },
                    },
                ]
            },
        },
    },
}

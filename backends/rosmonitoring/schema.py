"""JSON schema of the method's options in plan.yaml."""

from __future__ import annotations

from avow.backend_kit.given import DURATION, READING, schema, text

SCHEMA = schema(
    {
        "traces": {
            "type": "array",
            "items": {
                "oneOf": [
                    {"type": "string"},
                    {
                        "type": "object",
                        "additionalProperties": False,
                        "required": ["path", "sha256"],
                        "properties": {
                            "path": {"type": "string"},
                            "sha256": {"type": "string", "pattern": "^[0-9a-f]{64}$"},
                        },
                        "description": "a recording that need not be here, and its digest",
                    },
                ]
            },
            "description": "recorded runs, one by one: JSON lines (.jsonl), ROS 1 bags (.bag), ROS 2 bags (folders)",
        },
        "fresh": {
            "type": "object",
            "additionalProperties": DURATION,
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
        "max_age": {**DURATION, "description": "how old an answer's inputs may be, for a run to be evidence"},
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
        "grace": {**DURATION, "description": "how long after a deadline silence is told (default 50 ms)"},
        "jitter": {
            **DURATION,
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
        "ordered": {**DURATION, "description": "the ROS monitor sorts by time what comes within so long"},
        "package": text("the ROS package of the node, for instrumentation"),
        "path": text("the launch file of the node, for instrumentation"),
        **READING,
    }
)

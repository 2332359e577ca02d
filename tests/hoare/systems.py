"""Small systems written to a folder, and the one job of their one method."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Job
from avow.pipeline.methods import method_job
from avow.system.load import load_system


def make_job(folder: Path, rcl: str, node: str, options: dict[str, Any], files: dict[str, str], backend: str) -> Job:
    """The job of the method `backend` with `options` for `node`; `files` are the system's models."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "system.rcl").write_text(rcl)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    plan = {
        "system": "sample",
        "title": "Sample",
        "contract": "system.rcl",
        "nodes": {node: {"methods": [{backend: options}]}},
    }
    (folder / "plan.yaml").write_text(json.dumps(plan))
    system = load_system(folder)
    return method_job(system, system.contract.node(node), system.plan.node(node).methods[0])


SENSOR = """
context {{ Colour : {{red, orange, green}}; Command : {{ move(REAL, REAL), inspect(NATURAL) }};
          Done : NATURAL --> BOOL; Orange = {orange}; Red = {red}; }}
node sensor {{
  inputs( r : REAL, command : Command, before : Done )
  outputs( colour : Colour, done : Done )
  topics( a/R r matches(in.r), a/C command matches(in.command), a/D done matches(out.done), a/S s matches(out.colour) )
  assume reading ( 0 <= in.r )
  guarantee marks ( forall(i in NATURAL | out.done(i) <=> (in.before(i) or in.command == inspect(i))) )
  guarantee low ( 0 <= in.r < Orange -> out.colour == green )
  guarantee medium ( Orange <= in.r < Red -> out.colour == orange )
  guarantee high ( Red <= in.r -> out.colour == red )
}}
"""


def sensor(orange: int = 120, red: int = 250) -> str:
    """A contract with thresholds."""
    return SENSOR.format(orange=orange, red=red)


def gate(guarantee: str) -> str:
    """A node that remembers: guarantees of each kind, and one more."""
    return f"""node gate {{
  inputs( request : BOOL, reading : REAL )
  outputs( open : BOOL, alarm : BOOL, n : NATURAL )
  topics()
  assume smooth ( abs(reading - previous(reading, reading)) <= 2 )
  guarantee still ( open and request -> open until not request )
  guarantee alarm ( alarm <=> held[2 steps](reading > 10) )
  guarantee count ( n == counted(reading > 10 since reading <= 10) )
  {guarantee}
}}
"""

"""A robot's software made at the size of Autoware: some 200 nodes in ten namespaces, started by one launch file.

    python benchmarks/graph.py FOLDER [NODES]        # writes FOLDER/contracts/made; default: 200

Each node reads the node before it in its namespace and publishes a value, whether it is well, and topics that no
contract speaks of: one for debugging, and the diagnostics of all. Every third node hears a node of the namespace
before, and the first of each namespace its last one. Each namespace is a subsystem; each node has a program and four
guarantees.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

NAMESPACES = (
    "vehicle", "sensing", "map", "localization", "perception", "prediction", "planning", "control", "monitoring", "api",
)  # fmt: skip
PROGRAM = "IF ({0}) THEN\n   y := x; ok := TRUE\nELSE\n   y := 0; ok := FALSE\n"


def read_by(place: int, k: int, size: int) -> Iterator[tuple[int, int]]:
    """The nodes that node k of a namespace hears, each as namespace and number."""
    if k:
        yield place, k - 1
    elif place:
        yield place - 1, size - 1
    if k % 3 == 1 and place:
        yield place - 1, k


def graph(folder: Path, nodes: int = 200) -> Path:
    """The system's folder."""
    size = nodes // len(NAMESPACES)
    (folder / "models").mkdir(parents=True)
    contract, launch, plan = [], ["<launch>\n"], []
    for place, namespace in enumerate(NAMESPACES):
        launch.append(f'  <group>\n    <push-ros-namespace namespace="{namespace}"/>\n')
        for k in range(size):
            name, heard = f"{namespace}_{k}", [*read_by(place, k, size)]
            ports = ["x", "z"][: max(1, len(heard))]
            met = " and ".join(f"in.{port} >= 0" for port in ports)
            inputs = ", ".join(f"{port} : INTEGER" for port in ports)
            topics = "".join(f"std_msgs/Int64 {port} matches(in.{port}), " for port in ports)
            assumed = "".join(f"  assume a{i} ( -1000 <= in.{port} )\n" for i, port in enumerate(ports))
            contract.append(
                f"node {name} {{\n  inputs( {inputs} )\n  outputs( y : INTEGER, ok : BOOL )\n"
                f"  topics( {topics}std_msgs/Int64 ~y matches(out.y), std_msgs/Bool ~ok matches(out.ok),\n"
                f"    std_msgs/Float64 ~debug/processing_time_ms, diagnostic_msgs/DiagnosticArray /diagnostics )\n"
                f"{assumed}  guarantee positive ( out.y >= 0 )\n  guarantee well ( ({met}) -> out.ok )\n"
                f"  guarantee passes ( ({met}) -> out.y == in.x )\n"
                f"  guarantee stops ( (not out.ok) -> out.y == 0 )\n}}\n"
            )
            (folder / "models" / f"{name}.imp").write_text(PROGRAM.format(met.replace("in.", "")))
            plan.append(f"  {name}: {{methods: [hoare: {{program: models/{name}.imp}}]}}\n")
            launch.append(f'    <node pkg="made" exec="{namespace}" name="{name}">\n')
            for port, (other, number) in zip(ports, heard, strict=False):
                whose = f"/{NAMESPACES[other]}/{NAMESPACES[other]}_{number}"
                launch.append(f'      <remap from="{port}" to="{whose}/y"/>\n')
            launch.append("    </node>\n")
        launch.append("  </group>\n")
    (folder / "system.rcl").write_text("".join(contract))
    (folder / "robot.launch.xml").write_text("".join([*launch, "</launch>\n"]))
    whole = "".join(f"  {n}: {{nodes: [{', '.join(f'{n}_{k}' for k in range(size))}]}}\n" for n in NAMESPACES)
    (folder / "plan.yaml").write_text(
        "system: made\ncontract: system.rcl\nlints_off: [RCL404]\nros: {distro: humble, launch: [robot.launch.xml]}\n"
        f"subsystems:\n{whole}nodes:\n{''.join(plan)}"
    )
    return folder


if __name__ == "__main__":
    graph(Path(sys.argv[1]) / "contracts" / "made", *map(int, sys.argv[2:]))

"""The options in plan.yaml: how ports are connected to the network's inputs and outputs; or all faults."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from avow.backend_kit.box import BOX, Box, read_box
from avow.backend_kit.given import existing_file
from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.packaged import packaged
from avow.base.suggestions import suggest
from avow.language.contract import Port
from avow.language.sorts import BOOL, REAL, EnumSort, Sort, TupleSort

from .reading import Network, read_network

SCHEMA = packaged("avow.backends.onnx", "options.json")


@dataclass(frozen=True, slots=True)
class Scaled:
    """An input of the network is `scale` times the port plus `offset`; a port is that of an output of the network."""

    index: int
    scale: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)


@dataclass(frozen=True, slots=True)
class Argmax:
    """The member whose output is the greatest; of equal ones the first."""

    members: tuple[str, ...]
    first: int


@dataclass(frozen=True, slots=True)
class Threshold:
    """TRUE if the output is at least `least`."""

    index: int
    least: Fraction


Output = Scaled | Argmax | Threshold


@dataclass(frozen=True, slots=True)
class Given:
    """The options, with the network. `inputs` and `outputs` are by qualified name."""

    network: Network
    inputs: Mapping[str, tuple[Scaled, ...]]
    outputs: Mapping[str, Output]
    box: Box
    one: Given | None = None
    """If `network` has two copies of a network and their rises, for two steps (`two_steps`): what is given of one."""


def read(job: Job) -> Given:
    """Raises Rejected with all faults."""
    faults: list[Diagnostic] = []
    network = None
    try:
        name = job.options.get("network", "")
        path = existing_file(job, "network", name, wrong="ONNX101", absent="ONNX102")
        network = read_network(path)
    except Rejected as rejected:
        faults += rejected.diagnostics
    inputs, used = dict[str, tuple[Scaled, ...]](), dict[int, str]()
    for at, (name, port, entry) in _entries(job, "inputs", job.node.inputs, faults):
        sorts = port.sort.items if isinstance(port.sort, TupleSort) else (port.sort,)
        each = entry if isinstance(entry, list) else [entry]
        if any(sort != REAL for sort in sorts) or len(each) != len(sorts):
            faults.append(_fault(job, at, f"{name} is no REAL, nor a tuple of {len(each)} of them"))
            continue
        inputs[name] = tuple(map(_scaled, each))
        for one in inputs[name]:
            if one.scale == 0 or one.index in used:
                why = f"input {one.index} is that of {used[one.index]} too" if one.scale else "its scale is 0"
                faults.append(_fault(job, at, f"{name}: {why}"))
            used[one.index] = name
    outputs = {}
    for at, (name, port, entry) in _entries(job, "outputs", job.node.outputs, faults):
        made = _output(entry, port.sort)
        if isinstance(made, str):
            faults.append(_fault(job, at, f"{name}: {made}"))
        else:
            outputs[name] = made
    if network is not None:
        faults += _indices(job, network, inputs, outputs)
    box, wrong = read_box(job.options.get(BOX, {}), job.node, job.root, "ONNX103", job.method.options.at(BOX))
    faults += wrong
    if faults or network is None:
        raise Rejected(*faults)
    return Given(network, inputs, outputs, box)


def _entries(
    job: Job, option: str, ports: Iterable[Port], faults: list[Diagnostic]
) -> Iterator[tuple[str, tuple[str, Port, Any]]]:
    """The option, and each entry with its port. An entry without a port is a fault."""
    known = {port.variable.qualified: port for port in ports}
    for name, entry in job.options.get(option, {}).items():
        if name in known:
            yield option, (name, known[name], entry)
        else:
            fixed = name in (port.variable.qualified for port in job.node.fixed)
            told = "the plan gives this parameter its value: leave it out here, or declare it without `parameter`"
            hint = told if fixed else suggest(name, known)
            faults.append(_fault(job, option, f"'{name}' is none of {', '.join(known)}", hint))


def _output(entry: Any, sort: Sort) -> Output | str:
    """What an entry says, or what is wrong with it."""
    match entry:
        case {"argmax": list() as members}:
            if not isinstance(sort, EnumSort) or sorted(members) != sorted(sort.members):
                return "'argmax' has all members of the port's enumeration, each once"
            return Argmax(tuple(members), entry.get("from", 0))
        case {"threshold": least}:
            return Threshold(entry["index"], _exact(least)) if sort == BOOL else "a threshold is for a BOOL"
    if sort == REAL:
        return _scaled(entry)
    return "an index is for a REAL; a BOOL has {index, threshold}, an enumeration {argmax}, other types are refused"


def indices(output: Output) -> range:
    """The outputs of the network that it reads."""
    match output:
        case Argmax(members=members, first=first):
            return range(first, first + len(members))
        case Scaled(index=index) | Threshold(index=index):
            return range(index, index + 1)


def _indices(
    job: Job, network: Network, inputs: Mapping[str, tuple[Scaled, ...]], outputs: Mapping[str, Output]
) -> Iterator[Diagnostic]:
    used = {one.index for each in inputs.values() for one in each}
    for index in sorted(used - set(range(network.inputs))):
        yield _fault(job, "inputs", f"the network has {network.inputs} inputs, and none of index {index}")
    if left := sorted(set(range(network.inputs)) - used):
        yield _fault(job, "inputs", f"no port gives the network's inputs {', '.join(map(str, left[:10]))}")
    for name, output in outputs.items():
        if indices(output).stop > len(network.outputs):
            message = f"{name}: the network has {len(network.outputs)} outputs, from 0 to {len(network.outputs) - 1}"
            yield _fault(job, "outputs", message)


def _scaled(entry: Any) -> Scaled:
    if isinstance(entry, int):
        return Scaled(entry)
    return Scaled(entry["index"], _exact(entry.get("scale", 1)), _exact(entry.get("offset", 0)))


def _exact(number: float) -> Fraction:
    """The decimal as the plan has it."""
    return Fraction(str(number))


def _fault(job: Job, option: str, message: str, hint: str | None = None) -> Diagnostic:
    return Diagnostic("ONNX103", message, job.method.options.at(option), hint=hint)

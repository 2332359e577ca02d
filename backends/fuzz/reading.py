"""The declared C++ source, read: its adapter header, the sources compiled with it, its parameters, its ports."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import inside, read_regular, read_text
from avow.base.graphs import reached
from avow.base.records import dataclass
from avow.formulas.formula import free_variables
from avow.language.contract import Node, Port
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort, SequenceSort, Sort
from avow.system.node_plan import parameters
from avow.system.plan import Numbers, Source

from .tuning import RUNS, STEPS

PLAIN = (BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort)


@dataclass(frozen=True, slots=True)
class Reading:
    """A job's source. All paths are absolute."""

    job: Job
    node: Node
    """The job's node, without the ports that are not machine values and occur in no clause."""
    source: Source
    adapter: Path
    sources: tuple[Path, ...]
    include: tuple[Path, ...]
    params: Mapping[str, Any]

    @property
    def memory(self) -> frozenset[str]:
        return frozenset(self.source.memory)

    @property
    def single(self) -> bool:
        """Whether a REAL is a float32."""
        return self.source.numbers is Numbers.FLOAT32

    @property
    def runs(self) -> int:
        return int(self.job.options.get("runs", RUNS))

    @property
    def steps(self) -> int:
        return int(self.job.options.get("steps", STEPS))

    @property
    def asked(self) -> tuple[Port, ...]:
        """The inputs that a step is given, in order; the others are memory."""
        return tuple(p for p in self.node.inputs if p.name not in self.memory)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Inputs that the program is not given."""
        return tuple(p.variable.qualified for p in self.job.node.inputs if p not in self.node.inputs)


def load(job: Job) -> Reading:
    """Raises Rejected with all problems of the declaration."""
    source = job.source
    if source is None or not source.cpp:
        message = f"{job.node.name} has no C++ source: the plan does not say which program it is"
        hint = "source: {cpp: src/node_avow.hpp}"
        raise Rejected(Diagnostic("FUZZ100", message, job.method.options.span, hint=hint))
    faults: list[Diagnostic] = []
    place = source.place.at("source", "cpp")
    adapter = inside(job.root, source.cpp)
    if adapter is None or not adapter.is_file():
        faults.append(Diagnostic("FUZZ100", f"there is no file `{source.cpp}` in the system's folder", place))
    if source.numbers is Numbers.EXACT:
        message = "a compiled program computes with machine numbers: numbers: float64 or float32"
        faults.append(Diagnostic("FUZZ102", message, source.place.at("numbers")))
    clauses = (*job.node.assumptions, *(job.clause(o) for o in job.obligations))
    spoken = {v.qualified for clause in clauses for v in free_variables(clause.formula)}
    odd_ports = [p for p in (*job.node.inputs, *job.node.outputs) if not isinstance(item_of(p.sort), PLAIN)]
    for port in odd_ports:
        if port.variable.qualified in spoken or port.name in source.memory:
            faults.append(Diagnostic("FUZZ102", f"no compiled step is given what {port.name} is", place))
    node = replace(
        job.node,
        inputs=tuple(p for p in job.node.inputs if p not in odd_ports),
        outputs=tuple(p for p in job.node.outputs if p not in odd_ports),
    )
    sources, wrong = _paths(job, "sources", Path.is_file)
    include, odd = _paths(job, "include", Path.is_dir)
    params, unclear = parameters(job.root, source, job.system.plan.ros.names.placed(job.node.name).name)
    faults += [*wrong, *odd, *unclear]
    if faults or adapter is None:
        raise Rejected(*faults)
    resolved = [path.resolve() for path in (adapter, *sources)]
    return Reading(
        job, node, source, resolved[0], tuple(resolved[1:]), tuple(dict.fromkeys(p.resolve() for p in include)), params
    )


def item_of(sort: Sort) -> Sort:
    """The element sort of a sequence; another sort itself."""
    return sort.item if isinstance(sort, SequenceSort) else sort


def _paths(job: Job, key: str, there: Any) -> tuple[list[Path], list[Diagnostic]]:
    found, wrong = [], []
    given = job.options.get(key, [])
    for name in given if isinstance(given, list) else [given]:
        path = inside(job.root, name) if isinstance(name, str) else None
        if path is None or not there(path):
            message = f"{key}: there is no `{name}` in the system's folder"
            wrong.append(Diagnostic("FUZZ101", message, job.method.options.at(key)))
        else:
            found.append(path)
    return found, wrong


_INCLUDED = re.compile(rb'^[ \t]*#[ \t]*include(?:_next)?[ \t]*["<]([^">\n]+)[">]', re.MULTILINE)


def files(job: Job) -> tuple[Path, ...]:
    """The source's files, even if missing, with the files that they include from the system's folder. The other files
    that a build reads are recorded with its answer."""
    source = job.source
    if source is None:
        return ()
    root = job.root.resolve()
    named = [source.cpp, source.parameters]
    extra = job.options.get("sources", [])
    named += extra if isinstance(extra, list) else [extra]
    found = [path for name in named if name and (path := inside(job.root, name)) is not None]
    folders = _paths(job, "include", Path.is_dir)[0]

    def included(file: Path) -> Iterator[Path]:
        return (beside for beside in _included(file, folders) if beside.resolve().is_relative_to(root))

    return tuple(reached(found, included))


def _included(file: Path, folders: list[Path]) -> Iterator[Path]:
    try:
        text = read_regular(file)
    except OSError:
        return
    for name in _INCLUDED.findall(text):
        for folder in (file.parent, *folders):
            path = folder / name.decode("utf-8", "replace")
            try:
                if path.is_file():
                    yield path
                    break
            except (OSError, ValueError):
                break


def texts(reading: Reading) -> str:
    """The texts of the source's files, for the numbers in them."""
    found = []
    for path in files(reading.job):
        try:
            found.append(read_text(path, "utf-8", errors="replace"))
        except OSError:
            continue
    return "\n".join(found)

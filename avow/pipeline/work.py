"""A system's jobs: every obligation, the method that discharges it, and what the answer depends on.

The core's own engines (language, sanity, calculus) and the backends have the same form here: a `Work` is one method
applied to its obligations, with a key for each. A record is current while its key is unchanged.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from avow.backend_kit.further import assumption
from avow.backend_kit.linked import beside
from avow.backend_kit.protocol import Backend, Job, Limits
from avow.base.diagnostics import Severity
from avow.base.files import digest_or_missing, sha256
from avow.base.records import dataclass
from avow.base.remembered import Shelf
from avow.base.tools import libraries
from avow.base.verdict import Object
from avow.calculus.composition import Composition, composed
from avow.calculus.obligations import all_tasks
from avow.calculus.variables import Frame
from avow.evidence.obligation import SYSTEM_LEVEL, Kind, Obligation
from avow.formulas.formula import node_digest, sort_digest
from avow.language.contract import Contract, Node
from avow.pipeline.blobs import encode
from avow.pipeline.engine_code import backend_digest, engine_digest
from avow.pipeline.evidence_keys import method_options, surroundings
from avow.pipeline.methods import Offered, guarantee, is_portable, method_backend, method_job, tool_identities
from avow.pipeline.settings import asked_seconds
from avow.pipeline.slices import MethodSlice, SanitySlice, Slice, compose_slice, method_slice, sanity_slice
from avow.sanity.claims import claims, node_key, recall
from avow.system.plan import Method, System

LANGUAGE = "language"
SANITY = "sanity"
COMPOSE = "compose"
ENGINES = (LANGUAGE, SANITY, COMPOSE)
"""The core's own engines; the plan cannot give a method one of these names."""


@dataclass(frozen=True, slots=True)
class Work:
    """One method and its obligations; `keys` maps an obligation's id to a digest of what its answer depends on."""

    system: System
    node: str
    method: str
    engine: str
    """A backend's name, or one of `ENGINES`."""
    obligations: tuple[Obligation, ...]
    keys: Mapping[str, str]
    limits: Limits = field(default_factory=Limits)
    cut: Callable[[], Slice] | None = field(default=None, compare=False, repr=False)
    """What the engine may see; none if no engine is needed."""
    shown: Callable[[], Slice] | None = field(default=None, compare=False, repr=False)
    """What a method's generated files show."""
    files: tuple[Path, ...] = field(default=(), compare=False, repr=False)
    """The plan's files that the answer depends on."""
    tools: tuple[tuple[str, str, str], ...] = field(default=(), compare=False, repr=False)
    """The identities of the outside tools that the answer depends on."""
    planned: tuple[Backend, Job] | None = field(default=None, compare=False, repr=False)
    """A method's backend, and the job that it gets; None for the core's own engines."""
    texts: str = field(default="", compare=False, repr=False)
    """The digest of the plan's and the contract's texts."""
    others: Mapping[str, tuple[Obligation, ...]] = field(default_factory=dict, compare=False, repr=False)
    """For a method that judges recorded data: claim that these may contradict → its obligations."""

    @property
    def name(self) -> str:
        """The method in the records of claims that it contradicts: other nodes may have one of the same id."""
        return f"{self.node}.{self.method}"

    def key_of(self, other: Obligation) -> str:
        """The key of a record that its data contradict another claim. The method's own keys cover that claim."""
        return sha256(json.dumps([other.id, other.digest, self.name, *sorted(self.keys.values())]))

    def changed(self) -> bool:
        """Whether contract or plan have changed since this job was made."""
        return bool(self.texts) and self.texts != texts_digest(self.system)

    @property
    def is_engine(self) -> bool:
        return self.planned is None

    @property
    def is_portable(self) -> bool:
        """Whether it can run on another machine."""
        return self.planned is None or is_portable(self.planned[0])


def _language_work(system: System) -> Work:
    """The contract parses and has types: loading it is the check."""
    contract = system.contract
    files = ", ".join(path.name for path in system.plan.contract_files)
    obligation = Obligation(
        system.name,
        SYSTEM_LEVEL,
        Kind.WELL_FORMED,
        "contract",
        f"{files} parses, and every formula in it is well-typed",
        "",
        _contract_digest(contract),
    )
    keys = _keys((obligation,), LANGUAGE, engine_digest())
    return Work(system, SYSTEM_LEVEL, LANGUAGE, LANGUAGE, (obligation,), keys)


def _sanity_work(whole: Frame, node: Node) -> Work:
    """Is this node's contract worth verifying? `whole` is its system's frame, made once for all nodes."""

    cut = sanity_slice(whole, node)
    obligations, keys = sanity_claims(cut)
    return Work(whole.system, node.name, SANITY, SANITY, obligations, keys, cut=lambda: cut)


def sanity_claims(cut: SanitySlice) -> tuple[tuple[Obligation, ...], Mapping[str, str]]:
    """The obligations of a slice, and their keys."""

    node, meaning = cut.node, node_key(cut.node)
    of_the_node = [(claim, meaning) for claim in claims(node)]
    of_its_providers = [(asked.claim, asked.digest) for asked in cut.linked]
    obligations = tuple(
        Obligation(
            cut.system,
            node.name,
            Kind.SANITY,
            claim.name,
            claim.sentence,
            claim.formula,
            digest,
            claim.clauses,
            claim.span,
            claim.severity is not Severity.ERROR,
        )
        for claim, digest in (*of_the_node, *of_its_providers)
    )
    scenario = encode(cut.given, Path()).decode() if cut.given else _no_values()
    return obligations, _keys(obligations, SANITY, engine_identity(), scenario)


@functools.cache
def _no_values() -> str:
    """A scenario's part for a node without values for its inputs."""

    return encode({}, Path()).decode()


def compose_work(composition: Composition) -> Work:
    """The calculus' side conditions, start-up and persistence, and the requirements that have a formula."""

    system = composition.frame.system
    tasks = all_tasks(composition)
    obligations = tuple(task.obligation for task in tasks)
    reasons = {task.obligation.id: task.because for task in tasks if task.because}
    keys = _keys(obligations, COMPOSE, engine_identity(), _scenario(system), reasons=reasons)
    return Work(system, SYSTEM_LEVEL, COMPOSE, COMPOSE, obligations, keys, cut=lambda: compose_slice(system))


def _method_works(system: System, offered: Offered = None) -> tuple[Work, ...]:
    """One for each method of each node of the plan. Raises Rejected for an unknown backend."""
    return tuple(
        method_work(system, system.contract.node(plan.node), method, offered)
        for plan in system.plan.nodes
        for method in plan.methods
        if method.guarantees  # otherwise no file is generated for the node
    )


def method_work(
    system: System, node: Node, method: Method, offered: Offered = None, cut: MethodSlice | None = None
) -> Work:
    """`offered`: the tools of the machines that jobs are sent to, if any. `cut`: as for `method_job`."""

    tool = method_backend(system, method)
    job = method_job(system, node, method, tool, cut)
    options = method.options.data if isinstance(method.options.data, Mapping) else {}
    told = method_options(method)
    tools = tool_identities(tool, offered)
    files = tool.files(job)
    parts = (
        tool.name,
        tool.version,
        backend_digest(tool),
        libraries(),
        json.dumps(tools),
        told,
        _files(files),
        surroundings(tool, job, told, files),
        *_compared(system, tool, job),
    )
    return Work(
        system,
        node.name,
        method.id,
        tool.name,
        job.every,
        _keys(job.every, method.id, *parts),
        _limits(options),
        cut=lambda: method_slice(tool, job, files),
        shown=lambda: method_slice(tool, job, files, sentences=True),
        files=files,
        tools=tools,
        planned=(tool, job),
    )


def _compared(system: System, compared: Backend, job: Job) -> tuple[str, ...]:
    """The methods beside the job's own (`beside`): their programs, files and options."""
    found = []
    for method in beside(compared, job):
        tool = method_backend(system, method)
        if tool.not_run:
            found.append([method.id, tool.not_run])
            continue
        other = replace(job, method=method, obligations=(), claims=())
        found.append(
            [
                method.id,
                tool.name,
                tool.version,
                backend_digest(tool),
                method_options(method),
                _files(tool.files(other)),
            ]
        )
    return (json.dumps(found),) if found else ()


def _limits(options: Mapping[str, Any]) -> Limits:
    """The plan's limits, whose range its schema gives."""
    kinds = {"seconds": float, "megabytes": int, "seed": int}
    return replace(Limits(), **{name: kind(options[name]) for name, kind in kinds.items() if name in options})


def programs(works: Iterable[Work]) -> tuple[str, ...]:
    """The paths of the outside tools that these jobs use."""
    used = (work.planned[0] for work in works if work.planned is not None)
    return tuple(dict.fromkeys(place for backend in used for tool in backend.tools() for place in tool.places))


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All obligations of a system, each once, and all jobs."""

    system: System
    obligations: tuple[Obligation, ...]
    works: tuple[Work, ...]

    def work(self, node: str, method: str) -> Work:
        """Raises KeyError."""
        for work in self.works:
            if (work.node, work.method) == (node, method):
                return work
        raise KeyError((node, method))


def engine_works(system: System) -> tuple[Work, ...]:
    """The works of the core's own engines."""
    composition = composed(system)
    return (
        _language_work(system),
        *(_sanity_work(composition.frame, node) for node in system.contract.nodes if not node.relay),
        compose_work(composition),
    )


def catalogue(system: System, offered: Offered = None, shelf: Shelf | None = None) -> Catalogue:
    """`offered`: as for `method_work`. `shelf`: a cache of what follows from the nodes' texts. Raises Rejected
    for an unknown backend, and where the plan's formulas are wrong."""

    if shelf is not None:
        recall(system.contract, shelf)
    texts = texts_digest(system)
    works = (*engine_works(system), *_method_works(system, offered))
    asked = asked_seconds()
    works = tuple(
        replace(work, texts=texts, limits=replace(work.limits, seconds=asked, asked=True) if asked else work.limits)
        for work in works
    )
    own = (node for node in system.contract.nodes if not node.relay)  # a relay is wiring, like a link
    guarantees = (guarantee(system, node, c.name) for node in own for c in node.guarantees)
    every = {o.id: o for work in works if work.is_engine for o in work.obligations}
    every |= {o.id: o for o in guarantees}
    every |= {o.id: o for work in works for o in work.obligations if o.kind is Kind.PROGRAM}
    others = _others(every.values())
    works = tuple(replace(work, others=others) if _judges_data(work) else work for work in works)
    return Catalogue(system, tuple(every.values()), works)


def _judges_data(work: Work) -> bool:
    return work.planned is not None and work.planned[0].of is Object.RECORDING


def _others(obligations: Iterable[Obligation]) -> dict[str, tuple[Obligation, ...]]:
    """The obligations by their names in `avow.backend_kit.further`. That an assumption holds in the system is what each
    of the composition's claims that discharge it says."""
    found: dict[str, tuple[Obligation, ...]] = {}
    for o in obligations:
        name = o.local_id
        if o.kind is Kind.COMPOSITION and o.clauses and o.name.endswith(f".{o.clauses[0]}"):
            name = assumption(*o.clauses[0].split("."))
        found[name] = (*found.get(name, ()), o)
    return found


def _keys(
    obligations: Iterable[Obligation], method: str, *parts: str, reasons: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Digests of ``[id, digest, method, *parts]`` as JSON, with the common part serialised once. `reasons`: further
    inputs of some, by id."""
    common, more = json.dumps([method, *parts])[1:], reasons or {}
    own = {o.id: [o.id, o.digest, *([more[o.id]] if o.id in more else [])] for o in obligations}
    return {name: sha256(f"{json.dumps(parts)[:-1]}, {common}") for name, parts in own.items()}


def _files(paths: Iterable[Path]) -> str:
    return json.dumps([[path.name, digest_or_missing(path)] for path in paths])


def texts_digest(system: System) -> str:
    """Digest of the files that contract and plan were read from: comments count."""
    plan = system.plan
    return sha256(json.dumps(list(map(digest_or_missing, (plan.path, *plan.contract_files, *plan.included)))))


def _contract_digest(contract: Contract) -> str:
    parts: list[list[str]] = [[name, sort_digest(sort)] for name, sort in contract.types]
    for node in contract.nodes:
        parts.append([node.name, *(f"{p.declared}:{sort_digest(p.sort)}" for p in node.inputs + node.outputs)])
        parts += [[node.name, c.kind, c.name, node_digest(node, c)] for c in node.clauses]
    return sha256(json.dumps(sorted(parts)))  # the order of declarations means nothing


def _scenario(system: System) -> str:
    """What the core's engines see of it. Only temporal requirements use its `steps`, and their digest has them."""
    return system.plan.scenario.content if system.plan.scenario else ""


@functools.cache
def engine_identity() -> str:
    """The core's engines with their solvers, in every key of theirs."""
    return f"avow {engine_digest()}, {libraries()}"

"""The facts of a case, before any conclusion: plain data, taken from a System or from a Case.

Because they can be taken from a finished case as well, ``avow report --check`` can conclude everything again.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from datetime import date
from pathlib import Path
from types import MappingProxyType

from avow.assurance.answers import EARLIER, Baseline
from avow.assurance.certification import KernelRun
from avow.assurance.history import kept_records
from avow.assurance.model import (
    Case,
    Derivation,
    EnvironmentView,
    MethodInfo,
    NodeView,
    RunInfo,
    SourceView,
    ToolInfo,
)
from avow.assurance.policy import Policy, read_policy
from avow.base.diagnostics import Span
from avow.base.plain import words_of
from avow.base.records import dataclass
from avow.evidence.audit import Discrepancy
from avow.evidence.ledger import GENESIS, Entry
from avow.evidence.obligation import Obligation
from avow.language.contract import Clause
from avow.system.graph import dataflow
from avow.system.names import ports_named
from avow.system.plan import Endpoint, Finding, Hazard, Plan, Requirement, Statement, System


@dataclass(frozen=True, slots=True)
class Facts:
    system: str
    title: str
    today: date
    run: RunInfo
    policy: Policy
    ledger_head: str
    digests: tuple[tuple[str, str], ...]
    requirements: tuple[Requirement, ...]
    nodes: tuple[NodeView, ...]
    environment: tuple[EnvironmentView, ...]
    expected: tuple[Finding, ...] | None
    accepted: tuple[Finding, ...]
    obligations: tuple[Obligation, ...]
    planned: Mapping[str, tuple[tuple[str, str], ...]]
    """Obligation id → (method, key) of every attempt that the plan asks for."""
    entries: tuple[Entry, ...]
    derivations: tuple[Derivation, ...]
    methods: tuple[MethodInfo, ...]
    tools: tuple[ToolInfo, ...]
    discrepancies: tuple[Discrepancy, ...] | None
    graph_svg: str
    sources: tuple[SourceView, ...] = ()
    statements: tuple[Statement, ...] = ()
    baseline: Baseline | None = None
    kernel: KernelRun = field(default_factory=KernelRun)
    earlier: bool = False
    left_out: int = 0
    hazards: tuple[Hazard, ...] = ()


def facts_of_system(
    system: System,
    obligations: Sequence[Obligation],
    records: Sequence[Entry],
    *,
    keys: Mapping[tuple[str, str], str],
    today: date,
    run: RunInfo,
    derivations: Sequence[Derivation] = (),
    methods: Sequence[MethodInfo] = (),
    tools: Sequence[ToolInfo] = (),
    discrepancies: Sequence[Discrepancy] | None = None,
    digests: Mapping[str, str] = MappingProxyType({}),
    ledger_head: str = GENESIS,
    graph_svg: str = "",
    sources: Mapping[str, str] = MappingProxyType({}),
    baseline: Baseline | None = None,
    discharging: Mapping[str, tuple[str, ...]] = MappingProxyType({}),
    kernel: KernelRun | None = None,
    recorded: Sequence[Entry] | None = None,
) -> Facts:
    """`sources` are the texts behind `digests`, by the same names; `discharging`: for each node the obligations that
    discharge its assumptions; `kernel`: what the kernel established in this run; `recorded`: the records as the ledger
    has them, if `records` are as they count now. Raises Rejected for an unusable policy."""
    plan = system.plan
    planned: dict[str, tuple[tuple[str, str], ...]] = {}
    for (obligation, method), key in sorted(keys.items()):
        planned[obligation] = (*planned.get(obligation, ()), (method, key))
    nodes = tuple(
        NodeView(
            node.name,
            plan.node(node.name).criticality,
            tuple((m.id, m.backend) for m in plan.node(node.name).methods),
            tuple((clause.name, _say(clause)) for clause in node.guarantees),
            tuple((clause.name, _say(clause)) for clause in node.assumptions),
            plan.node(node.name).title or words_of(node.name),
            discharging.get(node.name, ()),
            tuple((port.name, _feeds(system, node.name, port.name)) for port in node.inputs),
        )
        for node in system.contract.nodes
        if not node.relay
    )
    held = records if recorded is None else recorded
    kept = kept_records(held, obligations, keys)
    return Facts(
        system=plan.system,
        title=plan.title,
        today=today,
        run=run,
        policy=read_policy(plan.policy),
        ledger_head=ledger_head,
        digests=tuple(sorted(digests.items())),
        requirements=tuple(replace(r, span=_relative(r.span, plan)) for r in plan.requirements),
        nodes=nodes,
        environment=tuple(
            EnvironmentView(
                e.port,
                e.assume or "",
                e.because or "",
                e.constant,
                tuple(dict.fromkeys(node.name for node, _ in ports_named(e.port, system.contract.nodes))),
            )
            for e in plan.environment
        ),
        expected=plan.expected,
        accepted=plan.accepted,
        obligations=tuple({o.id: o.at(_relative(o.span, plan)) for o in obligations}.values()),
        planned=planned,
        entries=tuple(sorted((e for e in records if e.hash in kept), key=lambda e: (e.number, e.hash))),
        derivations=tuple(derivations),
        methods=tuple(sorted(methods, key=lambda m: m.name)),
        tools=tuple(sorted(tools, key=lambda t: (t.name, t.version or ""))),
        discrepancies=None if discrepancies is None else tuple(discrepancies),
        graph_svg=graph_svg,
        sources=tuple(
            sorted(
                (SourceView(path, text) for path, text in sources.items()), key=lambda s: (not s.is_contract, s.path)
            )
        ),
        statements=tuple(replace(s, span=_relative(s.span, plan)) for s in plan.statements),
        baseline=baseline,
        kernel=kernel or KernelRun(),
        left_out=sum(e.hash not in kept for e in held),
        hazards=tuple(replace(h, span=_relative(h.span, plan), mitigation_spans=()) for h in plan.hazards),
    )


def _feeds(system: System, node: str, port: str) -> str:
    edge = dataflow(system).by_target.get(Endpoint(node, port))
    return edge.source.node if edge else ""


def facts_of_case(case: Case) -> Facts:
    """The facts that the case was made from. Raises ValueError if `case.today` is no date."""
    entries = [*case.orphans, *(view.entry for o in case.obligations for view in o.evidence)]
    findings = [
        (
            f.how,
            Finding(
                f.pattern,
                f.verdict,
                f.reason or None,
                f.who or None,
                f.date or None,
                f.expires or None,
                f.method or None,
                matched=f.matched,
                found=f.found,
                says=f.says,
            ),
        )
        for f in case.findings
    ]
    expected = tuple(finding for how, finding in findings if how == "expected")
    return Facts(
        system=case.system,
        title=case.title.removeprefix(f"{EARLIER}: ") if case.earlier else case.title,
        today=date.fromisoformat(case.today),
        run=case.run,
        policy=case.policy,
        ledger_head=case.ledger_head,
        digests=case.digests,
        requirements=tuple(
            Requirement(
                r.id,
                r.text,
                r.formula or None,
                r.temporal or None,
                r.supported_by,
                r.span,
                validation=r.validation,
                linked=r.linked,
                source=r.source,
                probability=r.probability,
            )
            for r in case.requirements
        ),
        nodes=case.nodes,
        environment=case.environment,
        expected=expected if case.strict else None,
        accepted=tuple(finding for how, finding in findings if how == "accepted"),
        obligations=tuple(view.obligation for view in case.obligations),
        planned={view.id: view.planned for view in case.obligations},
        entries=tuple(sorted(entries, key=lambda e: (e.number, e.hash))),
        derivations=tuple(view.derivation for view in case.derivations),
        methods=case.methods,
        tools=case.tools,
        discrepancies=case.discrepancies if case.audited else None,
        graph_svg=case.graph_svg,
        sources=case.sources,
        statements=case.statements,
        baseline=case.baseline,
        kernel=case.kernel,
        earlier=case.earlier,
        left_out=case.left_out,
        hazards=tuple(view.hazard for view in case.hazards),
    )


def _relative(span: Span | None, plan: Plan) -> Span | None:
    """A position relative to the workspace (the folder above ``contracts/``): a report is the same on every machine."""
    if span is None:
        return None
    return Span(_place(span.file, plan.path), span.line, span.column, span.end_line, span.end_column)


@functools.lru_cache(maxsize=1000)
def _place(file: str, plan: Path) -> str:
    """As `_relative`, cached: many positions are in one file."""
    if not Path(file).is_absolute() or len(plan.resolve().parents) < 3:
        return file
    root, path = plan.resolve().parents[2], Path(file)
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else file


def _say(clause: Clause) -> str:
    return clause.sentence or clause.text or clause.name

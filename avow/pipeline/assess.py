"""The last stages: build the assurance case from the ledger, render it, and hold it against the policy's gates; then
one page over all systems."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from doit.exceptions import TaskError

from avow import __version__
from avow.assurance.case import as_of_earlier, conclude
from avow.assurance.certification import KernelRun
from avow.assurance.codec import SCHEMA, read_case
from avow.assurance.facts import facts_of_system
from avow.assurance.model import Case, Derivation, MethodInfo, RunInfo, SideCondition, ToolInfo
from avow.assurance.naming import short
from avow.assurance.signed import KEYS, newest_signed
from avow.backend_kit.registry import backend, names
from avow.base.diagnostics import Rejected, Span
from avow.base.files import digest_once, digest_or_missing, is_intact, read_regular, read_text, sha256, write
from avow.base.git import head
from avow.base.notes import read_note, write_note
from avow.base.records import dataclass
from avow.base.workspace import Workspace
from avow.calculus.composition import composed
from avow.calculus.notation import Written, write_goal
from avow.calculus.obligations import discharged_by
from avow.evidence.continuity import continuity
from avow.evidence.heads import index_path, read_index
from avow.evidence.ledger import Entry, Ledger, ledger_of
from avow.evidence.record import AGAINST, CASE, RETRY
from avow.evidence.signing import private_key
from avow.evidence.status import Status
from avow.pipeline import check as checking
from avow.pipeline.doctor import findings
from avow.pipeline.engine_code import report_digest
from avow.pipeline.integrity import acknowledge, confirm, discrepancies
from avow.pipeline.node_index import INDEX, write_indexes
from avow.pipeline.plan_check import left_out
from avow.pipeline.recheck import counting_now, kernel_run
from avow.pipeline.results import Result
from avow.pipeline.run_info import today
from avow.pipeline.settings import EXPLAIN, asked_seconds, signing_key
from avow.pipeline.state import State
from avow.pipeline.workload import LISTED, Survey, write_obligations
from avow.report import render_all, write_index
from avow.report.page import fill
from avow.report.parts import Parts
from avow.report.short import terminal_lines
from avow.report.wording import tally
from avow.system.folding import seen
from avow.system.graph import dataflow
from avow.system.graph_svg import sheet
from avow.system.plan import System


def _ledger(state: State, surveyed: Survey) -> Ledger:
    return ledger_of(state.workspace.ledger(surveyed.system.name))


def _stamp(state: State, surveyed: Survey) -> Path:
    return state.workspace.artifacts / surveyed.system.name / "report.json"


def is_settled(state: State) -> bool:
    """Whether a later run re-runs nothing: every answer may be reused."""
    for surveyed in state.surveyed:
        with (ledger := _ledger(state, surveyed)).still():
            found = (ledger.current(o.id, w.keys[o.id]) for w in surveyed.catalogue.works for o in w.obligations)
            if any(records and records[-1].evidence.details.get(RETRY) for records in found):
                return False
    return True


def render(state: State, surveyed: Survey) -> Result:
    """Build the case and write every format, unless the files in reports/ already say the same."""
    system, ledger = surveyed.system, _ledger(state, surveyed)
    acknowledge(state.workspace, ledger)
    basis = _basis(state, surveyed, ledger)
    key = _key(state, surveyed, basis)
    known = read_note(Rendering, _stamp(state, surveyed))
    root = state.workspace.root
    if known is not None and known.key == key and all(is_intact(root / p, sha) for p, sha in known.files.items()):
        result = known.result
    else:
        case = build(state, surveyed, basis)
        state.cases[surveyed.system.name] = case
        place = state.workspace.report(surveyed.system.name)
        parts = Parts(None if state.run.fresh else place, report_digest())
        written = render_all(case, place, signing_key(), parts)
        result = _summarise(state, surveyed, case)
        pages = write_indexes(state.workspace, surveyed.catalogue.works, case, parts)
        parts.keep()
        listed = state.workspace.artifacts / surveyed.system.name / LISTED
        made = {p: digest_once(p) for p in (*pages, *([listed] if listed.is_file() else []))}
        files = {state.workspace.relative(p): mark for p, mark in (written | made).items()}
        write_note(_stamp(state, surveyed), Rendering(key, files, result))
        state.changed.append(surveyed.system.name)
    confirm(state.workspace, ledger)
    plans = [(Path(d.span.file), f"{d.message} [{d.code}]") for d in left_out(system) if d.span]
    beside = ((state.workspace.relative(path), why) for path, why in plans)
    return replace(result, left_out=tuple(beside))


def certify(state: State, surveyed: Survey) -> KernelRun:
    """Let the kernel re-establish, in this run, what the calculus reported as proved: the report's grades."""
    workspace, system = state.workspace, surveyed.system
    ledger = ledger_of(workspace.ledger(system.name))
    entries = counting_now(ledger, workspace.root, system, state.run)
    found = kernel_run(entries, workspace.root, system, state.run)
    twice = sum(one.solvers > 1 for one in found.established)
    state.certified[system.name] = f"proofs established again: {len(found.established)}, by two solvers: {twice}"
    return found


def report(state: State, surveyed: Survey) -> bool:
    """Render the report, whatever the gates say."""
    return state.results.note(render(state, surveyed), gated=False)


def gate(state: State, surveyed: Survey) -> TaskError | bool:
    """Render the report and note whether the policy's gates pass: the run's exit code follows from all of them."""
    try:
        return state.results.note(render(state, surveyed), gated=True)
    except Rejected as rejected:
        return checking.refuse(rejected)
    except OSError as error:
        return TaskError(f"the report cannot be written: {error}")


def case_of(state: State, surveyed: Survey) -> Case:
    """The case of the report that this run wrote; otherwise a new one. Raises Rejected."""
    made = state.cases.get(surveyed.system.name)
    return made if made is not None else build(state, surveyed, _basis(state, surveyed, _ledger(state, surveyed)))


def as_it_is(surveyed: Survey, contracts: Workspace, ledger: Path) -> Case:
    """The case that a run would report if every answer were reused: contracts and plan in one place, and a ledger,
    which is not audited. Raises Rejected as `build` does."""
    state = State(contracts)
    return build(state, surveyed, _basis(state, surveyed, Ledger(ledger)), audited=False)


def build(state: State, surveyed: Survey, basis: _Basis, audited: bool = True) -> Case:
    """The case, from contract, plan and ledger. Raises Rejected for a policy that cannot be used."""
    system, workspace, ledger = surveyed.system, state.workspace, basis.ledger
    plan = system.plan
    # read once, so that the texts that the report shows are those whose digests it names
    named = (plan.root / node.source.parameters for node in plan.nodes if node.source and node.source.parameters)
    parameters = dict.fromkeys(path for path in named if path.is_file())
    files = (*plan.contract_files, plan.path, *plan.included, *parameters)
    texts = {workspace.relative(path): read_regular(path) for path in files}
    return conclude(
        facts_of_system(
            system,
            surveyed.catalogue.obligations,
            basis.entries,
            keys=basis.keys,
            today=today(),
            run=RunInfo(
                state.run.id,
                (datetime.now(UTC) - timedelta(seconds=state.run.seconds)).isoformat(timespec="seconds"),
                round(state.run.seconds, 1),
                __version__,
                state.run.fresh,
                f"doit verify:{system.name}",
                head(workspace.root),
                {"seconds for each tool": _seconds_in_words(), "seed": "0, unless the plan says otherwise"},
            ),
            derivations=_derivation_views(system),
            discharging=_discharging(system),
            methods=_methods(state, surveyed),
            tools=_tools(),
            discrepancies=discrepancies(workspace, ledger, surveyed) if audited else None,
            digests={path: sha256(data) for path, data in texts.items()},
            ledger_head=ledger.head,
            graph_svg=_picture(system),
            sources={path: data.decode("utf-8", "replace") for path, data in texts.items()},
            baseline=newest_signed(workspace.signed, system.name)[0],
            kernel=kernel_run(basis.entries, workspace.root, system, state.run),
            recorded=ledger.records(),
        )
    )


@dataclass(frozen=True, slots=True)
class _Basis:
    """What a report is made of besides the texts: the ledger's entries as they count now, and the keys asked for."""

    ledger: Ledger
    entries: tuple[Entry, ...]
    keys: Mapping[tuple[str, str], str]


def _basis(state: State, surveyed: Survey, ledger: Ledger) -> _Basis:
    root = state.workspace.root
    entries = counting_now(ledger, root, surveyed.system, state.run)
    return _Basis(
        ledger, entries, {**surveyed.keys, **_given_up(surveyed, entries, root), **_against(surveyed, entries)}
    )


def _against(surveyed: Survey, entries: Sequence[Entry]) -> dict[tuple[str, str], str]:
    """Refutations of claims by data that the plan names under other claims, as the data and these claims are now."""
    found: dict[tuple[str, str], str] = {}
    works = {work.name: work for work in surveyed.catalogue.works if work.others}
    now = {o.id: o for o in surveyed.catalogue.obligations}
    for record in (entry.evidence for entry in entries):
        work, other = works.get(str(record.details.get(AGAINST))), now.get(record.obligation)
        if work is not None and other is not None and work.key_of(other) == record.key:
            found[record.obligation, record.method] = record.key
    return found


def _given_up(surveyed: Survey, entries: Sequence[Entry], root: Path) -> dict[tuple[str, str], str]:
    """Refutations by a counterexample, of claims and files as they are now, by methods that the plan no longer has.
    Removing a method from the plan does not remove its refutation; repairing the program does."""
    found: dict[tuple[str, str], str] = {}
    planned, now = surveyed.keys, {o.id: o.digest for o in surveyed.catalogue.obligations}
    for entry in entries:
        record = entry.evidence
        pair = (record.obligation, record.method)
        refuted = CASE in record.details and now.get(record.obligation) == record.obligation_digest
        same = (digest_or_missing(root / path) == mark for path, mark in record.inputs.items())
        if refuted and pair not in planned and all(same):
            found[pair] = record.key
    return found


def _methods(state: State, surveyed: Survey) -> tuple[MethodInfo, ...]:
    system, found = surveyed.system, []
    sources = {node.node: node.source for node in system.plan.nodes}
    for name in names():
        tool = backend(name, system.plan.plugins)
        missing = [t for t in tool.tools() if not t.present and not t.optional]
        install, key = missing[0].install if missing else "", tool.needs_source
        lacking = {n.name for n in system.contract.nodes if key and not getattr(sources.get(n.name), key, "")}
        unsuited = tuple(n.name for n in system.contract.nodes if n.name in lacking or not tool.suits(n))
        words = tool.name, tool.title, tool.strength, tool.link, tool.green_means
        found.append(MethodInfo(*words, not missing, install, unsuited))
    return tuple(found)


def _tools() -> tuple[ToolInfo, ...]:
    return tuple({f.tool: ToolInfo(f.tool, f.version, f.install) for f in findings()}.values())


def _key(state: State, surveyed: Survey, basis: _Basis) -> str:
    """The report depends on the texts, the plan, all evidence, the day (reviews and accepted risks expire), and what is
    installed: a format that was left out is written once its tool is installed."""
    ledger, entries = basis.ledger, basis.entries
    keys = sorted((*pair, key) for pair, key in basis.keys.items())
    damage = [str(d) for d in (*ledger.damage, *continuity(ledger, read_index(index_path(ledger.path.parent))))]
    explain = os.environ.get(EXPLAIN, "")
    earlier = zip(ledger.records(), entries, strict=True)
    damage += [f"{old.number} is of an earlier state" for old, now in earlier if old is not now]
    signed = [digest_once(path) for path in _signatures(state, surveyed)]
    key = signing_key()
    signed += [private_key(key).public_key().public_bytes_raw().hex()] if key is not None else []
    kernel = kernel_run(entries, state.workspace.root, surveyed.system, state.run)
    graded = [kernel.parts, dict(kernel.solvers), [(one.obligation, one.solvers) for one in kernel.established]]
    tools = [[tool.name, tool.version, tool.install] for tool in _tools()]
    told = [
        SCHEMA,
        report_digest(),
        signed,
        graded,
        surveyed.digest,
        keys,
        ledger.head,
        damage,
        str(today()),
        __version__,
        explain,
    ]
    return sha256(json.dumps([*told, tools]))


def _seconds_in_words() -> str:
    asked = asked_seconds()
    return "60, unless the plan says otherwise" if asked is None else f"{asked:g}, as asked for this run"


def _signatures(state: State, surveyed: Survey) -> list[Path]:
    """The files that say which report was signed last."""
    signed = state.workspace.signed
    return [p for folder in (surveyed.system.name, KEYS) for p in sorted((signed / folder).glob("*")) if p.is_file()]


def _summarise(state: State, surveyed: Survey, case: Case) -> Result:
    explain = bool(os.environ.get(EXPLAIN))
    gates = []
    for g in case.gates:
        closes = [s.text for s in g.suggestions[:3]] if explain or not g.passed else []
        gates.append((g.title, g.passed, "; ".join([g.reason, *(f"next: {text}" for text in closes)])))
    spans = {view.id: view.obligation.span for view in case.obligations}
    failed = [
        f"{_place(state.workspace, spans.get(item.claim))}{short(item.claim)}: {item.text}"
        for item in case.open_items
        if item.kind == Status.ERROR.value
    ]
    index = state.workspace.relative(state.workspace.report(surveyed.system.name) / "index.html")
    counts = tally(view for view in case.obligations if not view.advice)
    return Result(
        case.system,
        case.exit_code,
        {word.value: number for word, number in counts.items()},
        index,
        tuple(gates),
        verdict=case.answers.told,
        tone=case.answers.tone.value,
        lines=tuple(terminal_lines(case)),
        failed=tuple(failed),
    )


def _place(workspace: Workspace, span: Span | None) -> str:
    return f"{workspace.relative(Path(span.file))}:{span.line}: " if span is not None else ""


@dataclass(frozen=True, slots=True)
class Rendering:
    """What was rendered last: from which inputs, which files with which digests, and what the terminal shows of it."""

    key: str
    files: Mapping[str, str]
    result: Result


def edited_pages(workspace: Workspace, surveyed: Survey) -> tuple[Path, ...]:
    """The nodes' pages and the list of obligations that differ from those of the last report, if this user wrote it.
    A list of what contract and plan ask today was written anew."""
    known = read_note(Rendering, workspace.artifacts / surveyed.system.name / "report.json")
    files = known.files if known is not None else {}
    made = {workspace.root / name: sha for name, sha in files.items() if Path(name).name in (INDEX, LISTED)}
    other = (path for path, sha in made.items() if path.is_file() and digest_once(path) != sha)
    current = write_obligations(workspace, surveyed, dry=True)
    return tuple(path for path in other if not (current and path.name == LISTED))


_OVERVIEW = ".overview.json"
"""Kept beside the artifacts: the digest of the page over all systems as written, and the systems whose reports are old.
"""


def earlier(state: State) -> tuple[str, ...]:
    """The systems that have a report and could not be read in this run: their reports show an earlier state. Empty for
    a run that read nothing."""
    if not state.read:
        return ()
    reports, read = state.workspace.reports, {s.system.name for s in state.surveyed}
    return tuple(sorted(p.parent.name for p in reports.glob("*/report.json") if p.parent.name not in read))


@dataclass(frozen=True, slots=True)
class _Overview:
    """The digest of the page as it was written, and the systems that it marks as of an earlier state."""

    sha256: str
    earlier: tuple[str, ...]


def index_is_due(state: State) -> bool:
    """Whether the page over all systems no longer shows what its systems' reports show."""
    known = read_note(_Overview, state.workspace.artifacts / _OVERVIEW) or _Overview("", ())
    if state.changed or earlier(state) != known.earlier:
        return True
    page = state.workspace.reports / "index.html"
    return bool(state.surveyed and state.results.all and not is_intact(page, known.sha256))


def write_overview(state: State) -> None:
    """Write reports/index.html over every system that has evidence. Raises OSError."""
    workspace, old = state.workspace, earlier(state)
    cases = [case_of(state, s) for s in state.surveyed if workspace.ledger(s.system.name).is_file()]
    if cases or old:
        write_index(cases, workspace.reports, old)
        page = digest_once(workspace.reports / "index.html")
        write_note(workspace.artifacts / _OVERVIEW, _Overview(page, old))


def mark_earlier(state: State) -> None:
    """Mark reports of an earlier state as such, in every format. Once the system can be read again, they differ from
    what was written and are therefore written again. Raises OSError."""
    for name in earlier(state):
        place = state.workspace.reports / name
        try:
            case = as_of_earlier(read_case(place))
        except (Rejected, ValueError, KeyError, OverflowError):
            _mark_pages(place)
        else:
            render_all(case, place, signing_key())


def _mark_pages(folder: Path) -> None:
    """If report.json is damaged, the pages that a person opens are marked as they are."""
    mark = fill("earlier.html.j2")
    for page in sorted(folder.glob("*.html")):
        before, body, after = read_text(page, "utf-8", errors="replace").partition("<body>")
        if body and not after.lstrip().startswith(mark):
            write(page, before + body + mark + after)


def _derivation_views(system: System) -> tuple[Derivation, ...]:
    """One for each goal of the plan, the whole system's last, with the rule instances that make it up."""
    return tuple(_view(system, write_goal(goal)) for goal in composed(system).goals)


def _discharging(system: System) -> dict[str, tuple[str, ...]]:
    """For each node the obligations (without the system) that discharge its assumptions."""
    found = discharged_by(composed(system))
    return {node: tuple(hypothesis.name for hypothesis in behind) for node, behind in found.items()}


def _picture(system: System) -> str:
    """The dataflow picture."""
    return sheet(seen(system, dataflow(system)))


def _view(system: System, written: Written) -> Derivation:
    wiring = {node.name for node in system.contract.nodes if node.relay}  # it has no claims
    return Derivation(
        written.name,
        written.rule,
        written.text,
        written.conclusion,
        tuple(name for name in written.premises if name not in wiring),
        tuple(
            SideCondition(c.text, f"{system.name}/{c.obligation}" if c.obligation else "")
            for c in written.side_conditions
        ),
        written.conditional,
    )

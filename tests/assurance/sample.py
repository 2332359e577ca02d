"""Hand-made systems, obligations and evidence for the tests of ledger, case and report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from avow.assurance.case import conclude
from avow.assurance.facts import facts_of_system
from avow.assurance.model import Case, Derivation, MethodInfo, RunInfo, SideCondition, ToolInfo
from avow.base.codec import canonical
from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.verdict import Counterexample, Link, Verdict
from avow.evidence.ledger import GENESIS, Entry, encode
from avow.evidence.obligation import SYSTEM_LEVEL, Kind, Obligation
from avow.evidence.record import Evidence
from avow.language.contract import Clause, ClauseKind, Contract, Node
from avow.language.terms import TRUE
from avow.system.plan import (
    EnvironmentInput,
    Finding,
    Hazard,
    Located,
    Method,
    NodePlan,
    Plan,
    Requirement,
    System,
    Validation,
)

TODAY = date(2026, 11, 21)
SPAN = Span("contracts/rover/plan.yaml", 1, 1, 1, 1)
PLAN_TEXT = "system: rover\n"
RCL_TEXT = "".join(f"// line {n} of the rover's contract\n" for n in range(1, 41))
RUN = RunInfo(
    "20261121T100000-1",
    "2026-11-21T10:00:00+00:00",
    41.5,
    "0.1.0",
    limits={"seed": "0", "seconds a tool": "60", "memory": "4096 MB"},
)
METHODS = (
    MethodInfo(
        "hoare",
        "Hoare triples by weakest preconditions and Z3",
        Verdict.PROVED,
        Link.GENERATED,
        "The program meets the triple for all inputs.",
    ),
    MethodInfo(
        "dafny",
        "A step in Dafny that refines the contract",
        Verdict.PROVED,
        Link.GENERATED,
        "Dafny proved the method.",
        False,
        "apt install dafny",
    ),
    MethodInfo(
        "ajpf",
        "Model checking of the agent program",
        Verdict.CHECKED,
        Link.MAPPED,
        "No run of the finite scenario violates the property.",
    ),
    MethodInfo(
        "hypothesis",
        "Property-based tests",
        Verdict.TESTED,
        Link.GENERATED,
        "No generated case violates the guarantee.",
    ),
    MethodInfo(
        "experiment",
        "Statistics of measured runs",
        Verdict.TESTED,
        Link.GUIDED,
        "The failure probability is bounded with the stated confidence.",
    ),
    MethodInfo("review", "A person's review", Verdict.REVIEWED, Link.GUIDED, "A named person read and concluded."),
)
BY_NAME = {m.name: m for m in METHODS}
TOOLS = (ToolInfo("z3", "5.4.0"), ToolInfo("dafny", None, "apt install dafny"), ToolInfo("python", "3.11.2"))


def clause(name: str, sentence: str | None = None, kind: ClauseKind = ClauseKind.GUARANTEE, line: int = 10) -> Clause:
    return Clause(kind, name, 1, TRUE, sentence, "TRUE", Span("contracts/rover/system.rcl", line, 5, line, 40))


def validated(requirement: Requirement) -> Requirement:
    """Read by somebody, as it is; one that says itself whether it was, as it stands."""
    if requirement.validation is not None:
        return requirement
    read = Validation("A. Reader", "2026-11-20", requirement.sentence_digest, requirement.formula_digest)
    return replace(requirement, validation=read)


def system(
    nodes: Mapping[str, Sequence[str]],
    *,
    name: str = "rover",
    plans: Sequence[NodePlan] = (),
    requirements: Sequence[Requirement] = (),
    policy: Any = None,
    expected: Sequence[Finding] | None = None,
    accepted: Sequence[Finding] = (),
    environment: Sequence[EnvironmentInput] = (),
    title: str = "A rover",
    hazards: Sequence[Hazard] = (),
) -> System:
    located = Located(policy, SPAN)
    return System(
        Plan(
            name,
            title,
            Path("contracts") / name / "plan.yaml",
            (),
            located,
            (),
            (),
            tuple(environment),
            None,
            tuple(map(validated, requirements)),
            (),
            tuple(plans),
            located,
            None if expected is None else tuple(expected),
            tuple(accepted),
            (),
            (),
            hazards=tuple(hazards),
        ),
        Contract((), (), (), tuple(Node(n, (), (), (), (), tuple(clause(g) for g in gs)) for n, gs in nodes.items())),
    )


def node_plan(name: str, criticality: str, *methods: str) -> NodePlan:
    return NodePlan(name, criticality, tuple(Method(m, m.split("-")[0], Located({}, SPAN), ()) for m in methods))


def obligation(
    node: str,
    kind: Kind,
    name: str,
    claim: str = "",
    formula: str = "",
    clauses: tuple[str, ...] = (),
    line: int = 10,
    of: str = "rover",
) -> Obligation:
    span = Span(f"contracts/{of}/system.rcl", line, 3, line + 1, 40)
    return Obligation(
        of, node, kind, name, claim or f"{node} meets {name}", formula, sha256(f"{node}{kind}{name}"), clauses, span
    )


def guarantee(
    node: str, name: str, claim: str = "", formula: str = "", line: int = 10, of: str = "rover"
) -> Obligation:
    return obligation(node, Kind.GUARANTEE, name, claim, formula, (f"{node}.{name}",), line, of)


def evidence(
    about: Obligation | str,
    verdict: Verdict = Verdict.PROVED,
    method: str = "hoare",
    *,
    strength: Verdict | None = None,
    link: Link | None = None,
    key: str | None = None,
    run: str = RUN.id,
    **others: Any,
) -> Evidence:
    target = about if isinstance(about, Obligation) else guarantee(*about.split("."))
    info = BY_NAME.get(method.split("-")[0])
    record = Evidence(
        obligation=target.id,
        obligation_digest=target.digest,
        key=key_of(target, method) if key is None else key,
        method=method,
        backend=method.split("-")[0],
        tool={"hoare": "z3", "sanity": "z3", "compose": "z3"}.get(method.split("-")[0], method.split("-")[0]),
        tool_version="1.0",
        command=("tool", "--seed", "0", "file name"),
        verdict=verdict,
        strength=strength or (info.strength if info else Verdict.PROVED),
        link=link or (info.link if info else Link.GENERATED),
        summary=f"{verdict} by {method}",
        started="2026-11-21T10:00:01+00:00",
        seconds=0.25,
        run=run,
    )
    return replace(record, **others)


def key_of(target: Obligation, method: str) -> str:
    return sha256(f"{target.id} {target.digest} {method}")


def chain(records: Sequence[Evidence]) -> tuple[Entry, ...]:
    """Entries as a ledger would make them."""
    entries, previous = [], GENESIS
    for number, record in enumerate(records):
        mark = sha256(canonical({"evidence": encode(record), "n": number, "prev": previous}))
        entries.append(Entry(number, previous, mark, record))
        previous = mark
    return tuple(entries)


def keys_of(records: Sequence[Evidence]) -> dict[tuple[str, str], str]:
    return {(r.obligation, r.method): r.key for r in records}


def case(
    subject: System,
    obligations: Sequence[Obligation],
    records: Sequence[Evidence],
    *,
    keys: Mapping[tuple[str, str], str] | None = None,
    run: RunInfo = RUN,
    **others: Any,
) -> Case:
    entries = chain(records)
    return conclude(
        facts_of_system(
            subject,
            obligations,
            entries,
            keys=keys_of(records) if keys is None else keys,
            today=TODAY,
            run=run,
            tools=TOOLS,
            ledger_head=entries[-1].hash if entries else GENESIS,
            **{"methods": METHODS, "discrepancies": (), **others},
        )
    )


# -- a case in which about everything happens -----------------------------------------------------------------------

G = guarantee
_NEXT_WAYPOINT = (
    "∀ x′, y′ ∈ ℝ, i ∈ ℕ · (in.at(x′, y′) ∧ in.wayP(x′, y′, i) ∧ in.inspected(i) ∧ in.radiationStatus ∉ {red, orange}) "
    "⇒ ∃ x, y ∈ ℝ · (in.wayP(x, y, i + 1) ∨ (in.wayP(x, y, 0) ∧ ¬(∃ x″, y″ ∈ ℝ · in.wayP(x″, y″, i + 1)))) "
    "∧ out.command = move(x, y)"
)
_NODES: dict[str, list[tuple[str, str, str]]] = {
    "localisation": [
        ("one_position", "The node outputs a unique (x, y) coordinate", "∃! x, y ∈ ℝ · out.position(x, y)")
    ],
    "navigation": [
        (
            "arrives",
            "If told to move to (x, y), then eventually the robot is at (x, y), to within the tolerance",
            "∀ x, y ∈ ℝ · in.command = move(x, y) ⇒ out.at(x, y)",
        ),
        (
            "stays",
            "While it inspects, the robot stays where it is",
            "∀ i ∈ ℕ · in.command = inspect(i) ⇒ ∀ x, y ∈ ℝ · (out.at(x, y) ⇔ in.last(x, y))",
        ),
    ],
    "agent": [
        (
            "next_waypoint",
            "At an inspected waypoint without danger it moves to the next one, or to the exit",
            _NEXT_WAYPOINT,
        ),
        (
            "inspect_here",
            "At an uninspected waypoint without danger it inspects it",
            "∀ x′, y′ ∈ ℝ, i ∈ ℕ · (in.at(x′, y′) ∧ in.wayP(x′, y′, i) ∧ ¬in.inspected(i)) ⇒ out.command = inspect(i)",
        ),
        (
            "exit_on_danger",
            "If the radiation is dangerous it moves to the exit",
            "in.radiationStatus ∈ {red, orange} ⇒ ∃ x, y ∈ ℝ · in.wayP(x, y, 0) ∧ out.command = move(x, y)",
        ),
    ],
    "radiationSensor": [
        ("low", "Low radiation is green", "0 ≤ in.r < 120 ⇒ out.radiationStatus = green"),
        ("medium", "Medium radiation is orange", "120 ≤ in.r < 250 ⇒ out.radiationStatus = orange"),
        ("high", "High radiation is red", "250 ≤ in.r ⇒ out.radiationStatus = red"),
        (
            "marks_inspected",
            "An inspected waypoint is marked as such; nothing else changes",
            "∀ i ∈ ℕ · (out.inspected(i) ⇔ (in.before(i) ∨ in.command = inspect(i)))",
        ),
    ],
}

D1_TEXT = """\
    A_L ⇒ ◇G_L      A_A ⇒ ◇G_A      (G_L ∧ G_A) ⇒ A_N
  ──────────────────────────────────────────────────── R3
              (A_L ∧ A_A) ⇒ ◇G_N"""


def rover_system(policy: Any = None) -> System:
    return system(
        {node: [g[0] for g in gs] for node, gs in _NODES.items()},
        title="Remote inspection of a store of nuclear waste",
        plans=[
            node_plan("localisation", "medium", "review"),
            node_plan("navigation", "medium", "experiment", "hypothesis"),
            node_plan("agent", "high", "ajpf", "dafny"),
            node_plan("radiationSensor", "high", "hoare", "hypothesis"),
        ],
        requirements=[
            Requirement(
                "REQ1",
                "The robot should inspect each waypoint, as long as the radiation allows it.",
                None,
                None,
                ("agent.next_waypoint", "agent.inspect_here", "D1"),
            ),
            Requirement(
                "REQ2", "The robot shall know what level of radiation surrounds it.", None, None, ("radiationSensor",)
            ),
            Requirement(
                "REQ3",
                "On dangerous radiation the robot shall leave.",
                "danger -> out.command == move(exit)",
                None,
                ("agent.exit_on_danger",),
            ),
            Requirement(
                "REQ4",
                "Eventually everything has been inspected, or the mission has ended.",
                None,
                "eventually (all_inspected or over)",
                (),
            ),
        ],
        policy=policy,
        environment=[
            EnvironmentInput(
                "in.wayP", "exists(x, y in REAL | in.wayP(x, y, 0))", "the map is loaded and checked before the start"
            ),
            EnvironmentInput("in.sensors", None, None),
        ],
        accepted=[
            Finding(
                "navigation/guarantee/arrives",
                "refuted",
                "one run of 47 missed by 18 cm; the store has 2 m of clearance",
                "R. Assessor",
                "2026-10-01",
                "2027-10-01",
            ),
            Finding(
                "localisation/guarantee/*",
                "missing",
                "bought component",
                "R. Assessor",
                "2025-01-01",
                "2026-01-01",
                matched=("localisation/guarantee/one_position",),
            ),
        ],
    )


def rover_parts() -> tuple[System, list[Obligation], list[Evidence], dict[tuple[str, str], str], dict[str, Any]]:
    obligations: list[Obligation] = [
        obligation(
            SYSTEM_LEVEL, Kind.WELL_FORMED, "contract", "system.rcl parses, and every formula in it is well-typed"
        )
    ]
    line = 20
    by_name: dict[str, Obligation] = {}
    for node, gs in _NODES.items():
        for name, claim in (
            ("assumptions-satisfiable", f"Some input meets every assumption of {node}"),
            ("consistent", f"The guarantees of {node} do not contradict each other"),
            ("realizable", f"For every input that {node} allows, some output meets every guarantee"),
        ):
            obligations.append(obligation(node, Kind.SANITY, name, claim, line=line))
        for name, claim, formula in gs:
            by_name[f"{node}.{name}"] = guarantee(node, name, claim, formula, line)
            obligations.append(by_name[f"{node}.{name}"])
            line += 3
    redundant = obligation("radiationSensor", Kind.SANITY, "not-redundant-high", "No guarantee follows from the others")
    side = obligation(
        SYSTEM_LEVEL,
        Kind.COMPOSITION,
        "D1-position",
        "What localisation guarantees implies what navigation assumes",
        "G_L ⇒ A_N",
    )
    persists = obligation(
        SYSTEM_LEVEL, Kind.COMPOSITION, "D1-persistence", "The command persists until navigation has read it"
    )
    requirement = obligation(
        SYSTEM_LEVEL, Kind.REQUIREMENT, "REQ3", "REQ3 follows from the contracts", clauses=("agent.exit_on_danger",)
    )
    temporal = obligation(SYSTEM_LEVEL, Kind.REQUIREMENT, "REQ4", "REQ4 holds of every run of the composed contracts")
    obligations += [redundant, side, persists, requirement, temporal]
    records = [evidence(obligations[0], method="language")]
    records += [evidence(o, method="sanity") for o in obligations if o.kind is Kind.SANITY and o is not redundant]
    records.append(evidence(redundant, Verdict.REFUTED, "sanity", summary="high follows from low and medium"))
    records += [
        evidence(side, method="compose"),
        evidence(
            persists,
            Verdict.JUSTIFIED,
            "compose",
            strength=Verdict.PROVED,
            summary="the planner is polled at 10 Hz and holds its last command",
        ),
    ]
    records.append(evidence(requirement, method="compose", hypotheses=("the environment keeps in.wayP as it is",)))
    run = tuple(
        (
            ("step", str(n)),
            ("at", f"({n}, 0)"),
            ("command", "move(1, 0)" if n % 2 else "inspect(1)"),
            ("inspected", "{1}"),
        )
        for n in range(4)
    )
    records.append(
        evidence(
            temporal,
            Verdict.REFUTED,
            "compose",
            counterexample=Counterexample((), "the robot goes to and fro and never inspects waypoint 2", run, 2),
            bound={"steps": 12, "waypoints": 3},
        )
    )
    for name in ("low", "medium", "high", "marks_inspected"):
        target = by_name[f"radiationSensor.{name}"]
        if name == "medium":
            at = Counterexample((("in.r", "120"), ("out.radiationStatus", "green")), "guarantee medium demands orange")
            records.append(evidence(target, Verdict.REFUTED, "hoare", counterexample=at))
        else:
            outline = "{0 ≤ r}\nif r < 120 then\n  {0 ≤ r < 120}\n  status := green\n{status = green}"
            records.append(evidence(target, details={"outline": outline} if name == "low" else {}))
        records.append(
            evidence(
                target,
                Verdict.TESTED,
                "hypothesis",
                bound={"cases": 2000, "seed": 0},
                details={"mutation": {"score": 0.92, "killed": 46, "mutants": 50}},
            )
        )
    no_dafny = "dafny is not installed; install it with: apt install dafny"
    records += [
        evidence(
            by_name["agent.next_waypoint"],
            Verdict.CHECKED,
            "ajpf",
            bound={"states": 55584, "waypoints": 13},
            hypotheses=("percepts are edge-triggered", "waypoints are those of waypoints.csv"),
        ),
        evidence(by_name["agent.next_waypoint"], Verdict.NOT_RUN, "dafny", summary=no_dafny),
        evidence(
            by_name["agent.inspect_here"],
            Verdict.CHECKED,
            "ajpf",
            vacuous=True,
            bound={"states": 55584, "waypoints": 13},
            summary="holds, but its trigger is never reached for waypoints 6 to 12",
        ),
        evidence(by_name["agent.inspect_here"], Verdict.NOT_RUN, "dafny", summary=no_dafny),
        evidence(by_name["agent.exit_on_danger"], Verdict.CHECKED, "ajpf", bound={"states": 55584, "waypoints": 13}),
        evidence(by_name["agent.exit_on_danger"], Verdict.NOT_RUN, "dafny", summary=no_dafny),
        evidence(
            by_name["navigation.arrives"],
            Verdict.REFUTED,
            "experiment",
            bound={"runs": 47, "confidence": 0.95},
            counterexample=Counterexample(
                (("run", "31"), ("distance_m", "0.43")), "outside of the tolerance of 0.25 m"
            ),
        ),
        evidence(by_name["navigation.stays"], Verdict.UNKNOWN, "hypothesis", summary="gave up after 60 s"),
        evidence(
            by_name["localisation.one_position"],
            Verdict.REVIEWED,
            "review",
            key="as it was",
            started="2025-03-01T09:00:00+00:00",
            details={"reviewers": ["R. Assessor"]},
        ),
    ]
    keys = keys_of(records)
    keys[by_name["localisation.one_position"].id, "review"] = "as it is now"
    extras = {
        "derivations": (
            Derivation(
                "D1",
                "R3",
                D1_TEXT,
                "(A_L ∧ A_A) ⇒ ◇G_N: given both, the robot eventually is where it was told to go",
                ("localisation", "agent"),
                (SideCondition("G_L ⇒ A_N.position", side.id), SideCondition("out.command persists", persists.id)),
                ("in.wayP is provided by the environment",),
            ),
        ),
        "digests": {"contracts/rover/plan.yaml": sha256(PLAN_TEXT), "contracts/rover/system.rcl": sha256(RCL_TEXT)},
        "sources": {"contracts/rover/plan.yaml": PLAN_TEXT, "contracts/rover/system.rcl": RCL_TEXT},
    }
    return rover_system(), obligations, records, keys, extras


def rover_case(**changes: Any) -> Case:
    subject, obligations, records, keys, extras = rover_parts()
    return case(changes.pop("system", subject), obligations, records, keys=keys, **{**extras, **changes})

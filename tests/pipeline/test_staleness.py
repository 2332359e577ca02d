"""Staleness by meaning: an edit that changes no meaning re-runs nothing, any other re-runs exactly its cone.

Keys are pure, so no tool runs here: a folder is surveyed before and after an edit, and the keys are compared.
"""

from __future__ import annotations

import random
import re
import shutil
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import pytest
from helpers import edit, some
from same_meaning import CONTRACT_EDITS, PLAN_EDITS

from avow.backend_kit.protocol import Backend, Job, Limits, Report
from avow.backend_kit.registry import backend, names
from avow.base.diagnostics import Rejected
from avow.calculus.composition import compose
from avow.calculus.discharge import Bounds
from avow.calculus.required import requirement_question
from avow.calculus.requirements import FormulaQuestion, TemporalQuestion
from avow.calculus.variables import frame
from avow.pipeline.evidence_keys import surroundings
from avow.pipeline.slices import compose_slice, method_slice, sanity_slice
from avow.pipeline.work import catalogue
from avow.pipeline.worker import discharge_sanity
from avow.pipeline.workload import survey
from avow.system.load import load_system
from avow.system.plan import NodePlan, Scenario, System

ROOT = Path(__file__).parents[2]
FERRY = ROOT / "tests" / "pipeline" / "fixtures" / "ferry"
SHIPPED = ROOT / "contracts" / "remote_inspection"

Keys = dict[tuple[str, str], str]


def keys(folder: Path) -> Keys:
    found = survey(folder)
    assert not isinstance(found, Rejected), [str(d) for d in found.diagnostics]
    return {(name.partition("/")[2], method): key for (name, method), key in found.keys.items()}


def copied(source: Path, place: Path) -> Path:
    target = place / "contracts" / source.name
    shutil.copytree(source, target)
    return target


def changed(before: Keys, after: Keys) -> set[tuple[str, str]]:
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}


@pytest.mark.parametrize("seed", some(range(8), 2, slow=2))
def test_edits_without_a_change_of_meaning_rerun_nothing(tmp_path: Path, seed: int) -> None:
    folder = copied(FERRY, tmp_path)
    before = keys(folder)
    rng = random.Random(seed)
    contract, plan = next(folder.glob("*.rcl")), folder / "plan.yaml"
    for _ in range(6):
        done: list[str] = []
        for _ in range(rng.randrange(1, 4)):
            path, edits = rng.choice([(contract, CONTRACT_EDITS), (plan, PLAN_EDITS)])
            change: Callable[[str, random.Random], str] = rng.choice(edits)  # type: ignore[assignment]
            path.write_text(change(path.read_text(encoding="utf-8"), rng), encoding="utf-8")
            done.append(change.__name__)
        assert changed(before, keys(folder)) == set(), (done, contract.read_text(), plan.read_text())


def test_the_generator_does_edit(tmp_path: Path) -> None:
    """A test that cannot fail is none: every edit changes the text that it is given, for some seed."""
    texts = {True: next(FERRY.glob("*.rcl")).read_text(), False: (FERRY / "plan.yaml").read_text()}
    for change in (*CONTRACT_EDITS, *PLAN_EDITS):
        text = texts[change in CONTRACT_EDITS]
        assert any(change(text, random.Random(seed)) != text for seed in range(9)), change.__name__


# -- edits that change a meaning --------------------------------

WHOLE = {("system/well-formed/contract", "language")}
TOGETHER = {(f"system/composition/chain.{part}", "compose") for part in ("persistence", "one-output")}
CHAIN = {("system/composition/chain.pilot.one_berth", "compose"), *TOGETHER}
SAFE = {("system/requirement/SAFE", "compose")}
# whether what the plan assumes leaves room for every guarantee
ROOM = {(f"system/composition/environment.{port}", "compose") for port in ("gauge.depth", "gauge.wet", "pilot.free")}


def guarantees(node: str, names: str, methods: str) -> set[tuple[str, str]]:
    return {(f"{node}/guarantee/{name}", method) for name in names.split() for method in methods.split()}


def sanity(before: Keys, node: str) -> set[tuple[str, str]]:
    return {name for name in before if name[0].startswith(f"{node}/sanity/")}


FERRY_EDITS: dict[str, tuple[str, tuple[str, str], Callable[[Keys], set[tuple[str, str]]], set[tuple[str, str]]]] = {
    # name: (file, edit, what must change, what may change too: derivations over the changed node)
    "a threshold": (
        "*.rcl",
        ("Minimum = 2.5;", "Minimum = 2.6;"),
        lambda k: guarantees("gauge", "shallow good deep", "hoare hypothesis") | sanity(k, "gauge") | WHOLE | SAFE,
        CHAIN | ROOM,
    ),
    "what a guarantee demands": (
        "*.rcl",
        ("in.depth < Minimum -> out.level == low", "in.depth < Minimum -> out.level == high"),
        lambda k: guarantees("gauge", "shallow", "hoare hypothesis") | sanity(k, "gauge") | WHOLE | SAFE,
        CHAIN | guarantees("gauge", "good deep", "hoare hypothesis"),
    ),
    "a flipped operator": (
        "*.rcl",
        ("in.depth > Maximum", "in.depth >= Maximum"),
        lambda k: guarantees("gauge", "shallow good deep", "hoare hypothesis") | sanity(k, "gauge") | WHOLE | SAFE,
        CHAIN | ROOM,
    ),
    "an assumption": (
        "*.rcl",
        ("assume wet ( in.depth >= 0 )", "assume wet ( in.depth >= 1 )"),
        lambda k: (
            guarantees("gauge", "shallow good deep", "hoare hypothesis")
            | sanity(k, "gauge")
            | WHOLE
            | SAFE
            | {("system/composition/environment.gauge.wet", "compose")}
        ),
        CHAIN | ROOM,
    ),
    "a guarantee of the last node": (
        "*.rcl",
        ("in.level != ok -> out.order == wait", "in.level == low -> out.order == wait"),
        lambda k: guarantees("pilot", "docks waits", "ajpf hypothesis") | sanity(k, "pilot") | WHOLE | SAFE,
        CHAIN | ROOM,
    ),
    "an option": (
        "plan.yaml",
        ('"models/harbour.py:gauge", cases: 200', '"models/harbour.py:gauge", cases: 201'),
        lambda k: guarantees("gauge", "shallow good deep", "hypothesis"),
        set(),
    ),
    "a mapping": (
        "plan.yaml",
        ('"out.order == wait": "D(skipper, hold)"', '"out.order == wait": "D(skipper, stay)"'),
        lambda k: guarantees("pilot", "docks waits", "ajpf"),
        set(),
    ),
    "a program": (
        "models/gauge.imp",
        ("\n", "\n\n"),  # the bytes count: whether a program's comment matters is for its own tool to say
        lambda k: guarantees("gauge", "shallow good deep", "hoare"),
        set(),
    ),
    "a function under test": (
        "models/harbour.py",
        ("\n", "\n\n"),
        lambda k: (
            guarantees("gauge", "shallow good deep", "hypothesis") | guarantees("pilot", "docks waits", "hypothesis")
        ),
        set(),
    ),
    "an environment assumption": (
        "plan.yaml",
        ('assume: "in.depth >= 0"', 'assume: "in.depth >= 0 and in.depth < 100"'),
        lambda k: SAFE | {("system/composition/environment.gauge.depth", "compose")},
        CHAIN | {(f"system/composition/environment.{n}", "compose") for n in ("gauge.wet", "pilot.free")},
    ),
    "a reason": (
        "plan.yaml",
        ("because: water has no negative depth", "because: the tank is a closed vessel"),
        lambda k: {("system/composition/environment.gauge.depth", "compose")},
        {(f"system/composition/environment.{n}", "compose") for n in ("gauge.wet",)},
    ),
    "a requirement": (
        "plan.yaml",
        ("gauge.depth < 2.5 ->", "gauge.depth < 2.4 ->"),
        lambda k: SAFE,
        set(),
    ),
    "a wire's topic, which no method here looks at": (
        "*.rcl",
        ("harbour_msgs/Depth depth", "harbour_msgs/Depth metres"),
        lambda k: set(),
        set(),
    ),
}


@pytest.mark.parametrize("name", FERRY_EDITS)
def test_an_edit_of_a_meaning_reruns_exactly_its_cone(tmp_path: Path, name: str) -> None:
    pattern, pair, must, may = FERRY_EDITS[name]
    folder = copied(FERRY, tmp_path)
    before = keys(folder)
    edit(next(folder.glob(pattern)), pair)
    moved = changed(before, keys(folder))
    assert moved >= must(before), sorted(must(before) - moved)
    assert moved <= must(before) | may, sorted(moved - must(before) - may)


def test_a_type_that_only_another_input_has_reruns_the_methods(tmp_path: Path) -> None:
    """A program runs on all its inputs: evidence for a clause that does not mention one of them depends on it too."""
    folder = copied(FERRY, tmp_path)
    contract = next(folder.glob("*.rcl"))
    edit(contract, ("  inputs( depth : REAL )", "  inputs( depth : REAL, spare : Level )"))
    before = keys(folder)
    edit(contract, ("spare : Level", "spare : REAL"))
    assert changed(before, keys(folder)) >= guarantees("gauge", "shallow good deep", "hoare hypothesis")


def test_a_constant_that_only_an_option_or_a_program_names_reruns_it(tmp_path: Path) -> None:
    folder = copied(FERRY, tmp_path)
    contract, program = next(folder.glob("*.rcl")), folder / "models" / "gauge.imp"
    edit(contract, ("  Maximum = 7;", "  Maximum = 7;\n  Spare = 1;"))
    unnamed = keys(folder)
    edit(contract, ("Spare = 1;", "Spare = 2;"))
    assert changed(unnamed, keys(folder)) == set()
    program.write_text(program.read_text() + "\n// Spare\n")
    named = keys(folder)
    edit(contract, ("Spare = 2;", "Spare = 3;"))
    assert changed(named, keys(folder)) == guarantees("gauge", "shallow good deep", "hoare")


@pytest.mark.slow
def test_a_row_of_the_scenario_reruns_what_looks_at_it(tmp_path: Path) -> None:
    folder = copied(SHIPPED, tmp_path)
    before = keys(folder)
    table = folder / "models" / "waypoints.csv"
    rows = table.read_text().splitlines()
    rows[2] = re.sub(r"-?\d+\.\d+", "1.25", rows[2], count=1)
    table.write_text("\n".join(rows) + "\n")
    moved = changed(before, keys(folder))
    methods = {method for name, method in moved if "/guarantee/" in name}
    # `driven` is hypothesis too; `fuzz` runs recorded steps, which the scenario may interpret
    assert methods == {"ajpf", "driven", "fuzz", "hypothesis", "rosmonitoring"}
    assert all((name, method) in moved for name, method in before if method in methods)
    assert {name for name, method in moved if name.startswith("system/requirement/")}, (
        "temporal requirements look at it"
    )


@pytest.mark.slow
def test_steps_of_the_scenario_re_ask_what_goes_so_far(tmp_path: Path) -> None:
    folder = copied(SHIPPED, tmp_path)
    before = keys(folder)
    for pair in (("  steps: 40\n", "  steps: 41\n"), ("  steps: 41\n", "")):
        edit(folder / "plan.yaml", pair)
        after = keys(folder)
        assert changed(before, after) == {("system/requirement/REQ4", "compose")}, "the one temporal requirement"
        before = after


class Watched(Scenario):
    """A scenario whose `steps` must not be read."""

    __slots__ = ()

    def __getattribute__(self, name: str) -> object:
        if name == "steps":
            raise AssertionError("it looks at the scenario's steps")
        return super().__getattribute__(name)


def watched(folder: Path) -> System:
    system = load_system(folder)
    given = system.plan.scenario
    assert given is not None
    scenario = Watched(given.tables, given.interpret, given.domains, given.steps, given.digest, given.content)
    return replace(system, plan=replace(system.plan, scenario=scenario))


@pytest.mark.parametrize(
    "method",
    [
        pytest.param("hypothesis", marks=pytest.mark.slow),
        pytest.param("rosmonitoring", marks=pytest.mark.slow),
        pytest.param("ajpf", marks=pytest.mark.nightly),
        "sanity",
    ],
)
def test_who_says_that_it_needs_no_steps_does_not_look_at_them(tmp_path: Path, method: str) -> None:
    folder = copied(SHIPPED, tmp_path)
    edit(folder / "plan.yaml", ("cases: 2000", "cases: 20"))
    system = watched(folder)
    work = catalogue(system).work("agent" if method != "sanity" else "radiationSensor", method)
    if method == "sanity":
        few = [o for o in work.obligations if o.name.startswith("consistent")] or work.obligations[:1]
        cut = sanity_slice(frame(system), system.contract.node("radiationSensor"))
        outcomes = discharge_sanity(cut, few, Limits(seconds=30)).outcomes
    else:
        assert work.planned is not None
        tool, job = work.planned
        assert not tool.uses_steps
        assert tool.check(job) is not None
        tool.export(job)
        outcomes = tool.discharge(job, tmp_path, Limits(seconds=60)).outcomes
    assert outcomes


@pytest.mark.slow
def test_temporal_requirements_look_at_the_steps_and_others_do_not(tmp_path: Path) -> None:
    system = watched(copied(SHIPPED, tmp_path))
    composition = compose(system)
    asked = {r.id: requirement_question(composition, r) for r in system.plan.requirements}
    temporal, formula = asked["REQ4"], asked["REQ3"]
    assert isinstance(temporal, TemporalQuestion)
    assert isinstance(formula, FormulaQuestion)
    formula.broken_by_a_run(composition, Bounds(effort=300))
    with pytest.raises(AssertionError, match="looks at the scenario's steps"):
        temporal(composition, Bounds(effort=300))


@pytest.mark.slow
def test_a_plug_in_is_taken_to_look_at_the_steps(tmp_path: Path) -> None:
    system = load_system(copied(SHIPPED, tmp_path))
    given = system.plan.scenario
    assert given is not None
    other = replace(system, plan=replace(system.plan, scenario=replace(given, steps=1, digest="other")))

    class Tool(Backend):
        name = "plugin"

        def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
            raise NotImplementedError

    class Short(Tool):
        uses_steps = False

    def key(tool: Backend, of: System) -> str:
        work = catalogue(system).work("agent", "hypothesis")
        assert work.planned is not None
        return surroundings(tool, replace(work.planned[1], system=of), "")

    assert key(Tool(), system) != key(Tool(), other)
    assert key(Short(), system) == key(Short(), other)


FILES: dict[str, tuple[str, str]] = {
    # file: (nodes, methods) that look at it; the rest is documentation of how data came about
    "data/navigation_runs.csv": ("navigation", "arrival standstill report-spread"),
    "models/agent.gwen": ("agent", "ajpf"),
    "models/agent.py": ("agent", "hypothesis"),
    "models/agent_environment.yaml": ("agent", "ajpf"),
    "models/agent_impl.dfy": ("agent", "dafny"),
    "models/localisation_node.py": ("localisation", "review"),
    "models/make_trace.py": ("", ""),
    "models/radiation_sensor.imp": ("radiationSensor", "hoare fuzz"),
    "models/radiation_sensor.py": ("radiationSensor", "hypothesis"),
    "models/radiation_sensor_impl.dfy": ("radiationSensor", "dafny"),
    "models/simulate_navigation.py": ("", ""),
    "robot/nodes/radiation_sensor.hpp": ("radiationSensor", "fuzz"),
    "robot/nodes/radiation_sensor.yaml": ("radiationSensor", "fuzz driven"),
    "reviews/localisation.yaml": ("localisation", "review"),
    "traces/nominal.jsonl": ("agent localisation navigation radiationSensor", "rosmonitoring fuzz"),
}


@pytest.mark.nightly
def test_each_file_of_the_case_study_reruns_who_looks_at_it(tmp_path: Path) -> None:
    """Programs, data of experiments, review records and what was reviewed, traces: each method of exactly those."""
    folder = copied(SHIPPED, tmp_path)
    before = keys(folder)
    for name, (nodes, methods) in FILES.items():
        path = folder / name
        text = path.read_bytes()
        path.write_bytes(text + b"\n\n")
        moved = changed(before, keys(folder))
        path.write_bytes(text)
        wanted = {(n, m) for n, m in before if n.split("/")[0] in nodes.split() and m in methods.split()}
        assert moved == wanted, name
        assert bool(wanted) == bool(nodes)


def test_the_order_of_nodes_and_the_names_of_files_mean_nothing(tmp_path: Path) -> None:
    folder = copied(FERRY, tmp_path)
    before = keys(folder)
    contract = next(folder.glob("*.rcl"))
    head, *nodes = re.split(r"^(?=node )", contract.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert len(nodes) > 1
    contract.unlink()
    (folder / "renamed.rcl").write_text(head + "".join(reversed(nodes)), encoding="utf-8")
    assert changed(before, keys(folder)) == set()


def test_another_backend_tool_or_solver_reruns_what_it_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from avow.backend_kit.registry import backend
    from avow.pipeline import work

    folder = copied(FERRY, tmp_path)
    before = keys(folder)
    hoare = type(backend("hoare", ()))
    with monkeypatch.context() as patch:
        patch.setattr(hoare, "version", "another", raising=False)
        assert {method for _, method in changed(before, keys(folder))} == {"hoare"}
    tools = hoare.tools
    with monkeypatch.context() as patch:
        patch.setattr(hoare, "tools", lambda self: tuple(replace(t, version="0.0") for t in tools(self)))
        assert {method for _, method in changed(before, keys(folder))} == {"hoare"}
    with monkeypatch.context() as patch:
        patch.setattr(work, "engine_identity", lambda: "another")
        assert {method for _, method in changed(before, keys(folder))} == {"sanity", "compose"}
    assert changed(before, keys(folder)) == set()


@pytest.mark.slow
def test_wiring_reruns_what_reads_messages_and_nothing_else(tmp_path: Path) -> None:
    folder = copied(SHIPPED, tmp_path)
    before = keys(folder)
    edit(folder / "system.rcl", ("gazebo_radiation_plugins/Snapshot r ", "gazebo_radiation_plugins/Snapshot dose "))
    moved = changed(before, keys(folder))
    assert moved, "monitors listen to topics"
    assert {method for _, method in moved} == {"rosmonitoring", "fuzz"}  # which runs what was recorded
    # a recording counts against each node whose messages it has, so that every node with recordings reads the wiring
    assert {name.split("/")[0] for name, _ in moved} == {"agent", "localisation", "navigation", "radiationSensor"}


@pytest.mark.parametrize(
    ("old", "new"),
    some([("Orange = 120;", "Orange = 121;"), ("out.radiationStatus == red", "out.radiationStatus == orange")], 1),
)
def test_a_change_in_one_node_of_the_case_study_leaves_the_others(tmp_path: Path, old: str, new: str) -> None:
    folder = copied(SHIPPED, tmp_path)
    before = keys(folder)
    edit(folder / "system.rcl", (old, new))
    moved = changed(before, keys(folder))
    others = {pair for pair in moved if pair[0].split("/")[0] not in ("radiationSensor", "system")}
    assert {method for _, method in others} <= {"rosmonitoring"}  # which follow a broken assumption up to there
    settled_together = {pair for pair in before if pair[0].startswith("radiationSensor/guarantee/")}
    assert settled_together <= moved


def test_keys_do_not_depend_on_where_the_workspace_is(tmp_path: Path) -> None:
    assert keys(copied(FERRY, tmp_path / "a")) == keys(copied(FERRY, tmp_path / "b"))


def test_an_experiment_is_judged_again_where_more_is_asked_of_its_node(tmp_path: Path) -> None:
    """Its least rate of success follows from the criticality: five runs that do at `low` show too little at `high`."""
    (tmp_path / "system.rcl").write_text(
        "node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee close( out.y - in.x <= 1 ) }"
    )
    (tmp_path / "runs.csv").write_text("run,x,y\n" + "".join(f"{k},1,1.{k}\n" for k in range(5)))
    (tmp_path / "plan.yaml").write_text(
        "system: s\ncontract: system.rcl\nnodes:\n  n:\n    criticality: low\n    methods:\n"
        "      - experiment: {data: runs.csv, mapping: {in.x: x, out.y: y}}\n"
        "      - hypothesis: {subject: 'n.py:step'}\n"
    )
    (tmp_path / "n.py").write_text("def step(x):\n    return {'y': x}\n")
    before = keys(tmp_path)
    edit(tmp_path / "plan.yaml", ("criticality: low", "criticality: high"))
    assert changed(before, keys(tmp_path)) == {("n/guarantee/close", "experiment")}


@pytest.mark.parametrize("name", names())
def test_no_backend_sees_a_criticality_that_is_in_no_key_of_its(name: str) -> None:
    tool = backend(name)
    system = load_system(FERRY)
    node = next(n for n in system.plan.nodes if n.criticality)
    method = replace(node.methods[0], backend=name)
    job = Job(system, system.contract.node(node.node), method, ())
    seen = method_slice(tool, job, ()).system.plan.node(node.node).criticality
    assert (seen == node.criticality) is tool.uses_criticality


# -- what an engine sees of a plan --------------------------------

KEYED = {
    "system": "the obligations' names",
    "path": "a place, of which no answer speaks",
    "connections": "the obligations' digests: what meets each assumption",
    "environment": "the obligations' digests",
    "scenario": "a part of its own",
    "requirements": "an obligation each, with the formula in its digest",
    "compose": "an obligation for each side condition",
    "nodes": "their names alone are left",
    "subsystems": "an obligation for each side condition",
    "ros": "the obligations' digests: what is linked",
}
"""Field of a plan that the calculus may see → where the key of its answers has it."""


class Opaque:
    """A value of which the slice can only pass on all or nothing."""


def test_what_the_calculus_sees_of_a_plan_is_in_its_key() -> None:
    """Whoever adds a field says here where the key has it, or leaves it out of the slice."""
    system = load_system(FERRY)
    seen = set()
    for field in fields(system.plan):
        value = Opaque()
        try:
            cut = compose_slice(replace(system, plan=replace(system.plan, **{field.name: value}))).system.plan
        except TypeError:  # it looks into it
            seen.add(field.name)
        else:
            seen |= {field.name} if getattr(cut, field.name) is value else set()
    assert seen == KEYED.keys(), "avow/pipeline/slices.py: leave it out there, or put it into a key and name it here"
    node = NodePlan(**{f.name: Opaque() for f in fields(NodePlan)})
    (left,) = compose_slice(replace(system, plan=replace(system.plan, nodes=(node,)))).system.plan.nodes
    kept = {f.name for f in fields(node) if getattr(left, f.name) is getattr(node, f.name)}
    assert kept == {"node", "span"}, "what else the plan says of a node is in no key of the calculus"


@pytest.mark.parametrize(
    ("reason", "claims"),
    [
        ("water has no negative depth", ["environment.gauge.depth", "environment.gauge.wet"]),
        ("the harbour repeats the level until it is another", ["chain.persistence"]),
        ("the skipper answers each level once", ["chain.one-output"]),
    ],
)
def test_a_reason_is_asked_for_again_and_is_no_part_of_its_claim(
    reason: str, claims: list[str], tmp_path: Path
) -> None:
    """What rests on a claim with a reason goes on to rest on it: its digest is the same."""
    folder = copied(FERRY, tmp_path)
    before, digests = keys(folder), {o.id: o.digest for o in catalogue(load_system(folder)).obligations}
    edit(folder / "plan.yaml", (reason, "somebody said so"))
    assert changed(before, keys(folder)) == {(f"system/composition/{claim}", "compose") for claim in claims}
    assert {o.id: o.digest for o in catalogue(load_system(folder)).obligations} == digests

"""`avow campaign`: drawn runs are evidence, chosen ones are regressions, and nothing else passes for a run."""

from __future__ import annotations

import importlib.util
import json
import shutil
import statistics
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import avow, edit

from avow.backend_kit.protocol import Job, Limits
from avow.backends.experiment import BACKEND
from avow.backends.experiment.profile import read_campaign
from avow.backends.experiment.searching import Cells, Searched, Tried, search
from avow.base.verdict import Object, Outcome, Verdict
from avow.isolation.tracing import traces
from avow.pipeline.methods import method_job
from avow.pipeline.work import method_work
from avow.system.load import load_system

RCL = """node brake {
  inputs( speed : REAL ) outputs( distance : REAL )
  topics( std_msgs/Float64 speed matches(in.speed), std_msgs/Float64 distance matches(out.distance) )
  assume slow ( in.speed <= 9 )
  guarantee stops ( in.speed >= 1 -> out.distance <= 4 )
}
"""
PLAN = """nodes:
  brake:
    methods:
      - rosmonitoring:
          answers: {by: arrival, because: one process writes the trace}
          mapping: {in.speed: data, out.distance: data}
      - experiment:
          data: data/runs.csv
          seed: 3
          seconds: 5
          campaign:
            command: [python3, world.py, "{trace}", "{speed}", "{grip}", "{floor}"]
            scenario: {speed: {from: 1, to: 5}, grip: {from: 0.1, to: 1, usual: 1}, floor: [dry, wet]}
            trace: run.jsonl
            runs: 20
"""
WORLD = """import json, sys, time
trace, speed, grip, floor = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
distance = speed * 0.5
with open(trace, "w") as file:
    for n, (topic, value) in enumerate([("speed", speed), ("distance", distance)]):
        print(json.dumps({"topic": topic, "time": n, "data": value}), file=file)
"""
FAULT = ("speed * 0.5\n", 'speed * 0.5 + max(0.0, (0.5 - grip) * 8) * (floor == "wet")\n')


def made(root: Path) -> Path:
    for name, text in (("system.rcl", RCL), ("plan.yaml", PLAN), ("world.py", WORLD)):
        root.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


def campaign(root: Path, *words: str, code: int = 0) -> str:
    done = avow("campaign", str(root), *words, cwd=root)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def job(root: Path) -> Job:
    system = load_system(root)
    (method,) = (m for m in system.plan.node("brake").methods if m.backend == "experiment")
    return method_job(system, system.contract.node("brake"), method)


def settle(root: Path, kept: Outcome | None = None) -> Outcome:
    asked = job(root)
    asked = replace(asked, kept={kept.obligation: [kept.details["case"]]}) if kept is not None else asked
    (outcome,) = BACKEND.discharge(asked, root, Limits()).outcomes
    return outcome


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = made(tmp_path_factory.mktemp("good"))
    campaign(root, "brake")
    return root


@pytest.fixture
def drawn(good: Path, tmp_path: Path) -> Path:
    return shutil.copytree(good, tmp_path / "drawn")


def test_drawn_runs_are_trials_up_to_the_number_needed(drawn: Path) -> None:
    outcome = settle(drawn)
    assert (outcome.verdict, outcome.of, outcome.vacuous) == (Verdict.TESTED, Object.MODEL, False)
    assert (
        outcome.summary == "14 runs, 0 failed: at most 19.3 % fail at 95 % confidence"
    )  # of the 20 that the plan allows
    assert [s["trial"] for s in outcome.details["strata"]] == ["run"]  # type: ignore[attr-defined]
    assert any("behaves as in the simulator" in text for text in outcome.hypotheses)
    assert not BACKEND.check(job(drawn))


def test_no_campaign_shows_a_probability_nor_says_so(tmp_path: Path) -> None:
    root = made(tmp_path / "chance")
    chance = "  guarantee often with probability >= 0.5 per run ( in.speed >= 1 -> out.distance <= 4 )\n}"
    edit(root / "system.rcl", ("4 )\n}", "4 )\n" + chance))
    edit(root / "plan.yaml", ("runs: 20", "runs: 14"))
    assert "brake.often: unknown: the monitors of a campaign judge no probability" in campaign(root, code=1)
    found = {o.obligation: o.verdict for o in BACKEND.discharge(job(root), root, Limits()).outcomes}
    assert [*found.values()] == [Verdict.TESTED, Verdict.UNKNOWN]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_table_also_in_parts(drawn: Path) -> None:
    table = (drawn / "data/runs.csv").read_text()
    shutil.rmtree(drawn / "data")
    assert "is not shown" in campaign(drawn, "--runs", "5", code=1)
    campaign(drawn)
    assert (drawn / "data/runs.csv").read_text() == table
    edit(drawn / "plan.yaml", ("seed: 3", "seed: 4"))
    campaign(drawn)
    assert (drawn / "data/runs.csv").read_text() != table


def first_row_twice(lines: list[str]) -> list[str]:
    return [*lines, f"{len(lines)}{lines[1][1:]}"]


EDITS: dict[str, Callable[[list[str]], list[str]]] = {
    "a chosen scenario": lambda lines: [lines[0], lines[1].replace("wet", "dry"), *lines[2:]],
    "another seed": lambda lines: [lines[0], ",".join(["1", "77", *lines[1].split(",")[2:]]), *lines[2:]],
    "a run twice": first_row_twice,
    "a run removed": lambda lines: [*lines[:5], *lines[6:]],
}


@pytest.mark.parametrize("name", EDITS)
def test_a_row_that_was_not_drawn_is_no_trial(name: str, drawn: Path) -> None:
    table = drawn / "data/runs.csv"
    lines = table.read_text().splitlines()
    table.write_text("\n".join(after := EDITS[name](lines)) + "\n")
    assert after != lines
    assert settle(drawn).verdict is Verdict.ERROR
    assert [d.code for d in BACKEND.check(job(drawn))] == ["EXP113"]


CHANGES = {
    "world.py": (("* 0.5", "* 0.6"), Verdict.UNKNOWN),
    "plan.yaml": (("to: 5", "to: 6"), Verdict.UNKNOWN),
    "data/runs/3.jsonl": (("distance", "nothing"), Verdict.NOT_RUN),
    "system.rcl": (("<= 4", "<= 1"), Verdict.REFUTED),
}


@pytest.mark.parametrize("name", CHANGES)
def test_what_a_run_depends_on_makes_it_stale(name: str, drawn: Path) -> None:
    change, verdict = CHANGES[name]
    edit(drawn / name, change)
    assert settle(drawn).verdict is verdict


def test_a_module_beside_the_script_is_part_of_the_simulator(drawn: Path) -> None:
    (drawn / "helper.py").write_text("CLOSE = 0.1\n")
    assert settle(drawn).verdict is Verdict.UNKNOWN


@pytest.mark.parametrize("change", [("in.speed: data", "in.speed: other"), ("by: arrival", "by: order")])
def test_the_key_covers_the_monitors(change: tuple[str, str], drawn: Path) -> None:
    def keys() -> object:
        asked = job(drawn)
        return method_work(asked.system, asked.node, asked.method).keys

    before = keys()
    edit(drawn / "plan.yaml", change)
    assert keys() != before


ENDS = {
    "exit code 1": "raise SystemExit('the world ended')",
    "timed out after 0.3 s": "time.sleep(60)",
    "no recording": "trace = '/dev/null'",
}


@pytest.mark.parametrize("how", ENDS)
def test_a_run_without_a_recording_fails_and_is_no_counterexample(how: str, tmp_path: Path) -> None:
    root = made(tmp_path)
    edit(root / "world.py", ("distance =", f"{ENDS[how]}\ndistance ="))
    edit(root / "plan.yaml", ("seconds: 5", "seconds: 0.3" if "time" in how else "seconds: 5"))
    assert how in campaign(root, code=1)
    outcome = settle(root)
    assert (outcome.verdict, outcome.counterexample) == (Verdict.ERROR, None)
    assert how in outcome.summary
    assert outcome.bound["failures"] == 1


def test_a_run_that_nobody_can_judge_ends_the_campaign_and_the_search(tmp_path: Path) -> None:
    root = made(tmp_path)
    edit(root / "world.py", ('("distance", distance)', '("distance", "far")'))
    assert campaign(root, code=1).count("undecided:") >= 2  # the run, and as a regression
    assert len((root / "data/runs.csv").read_text().splitlines()) == 2
    assert settle(root).verdict is Verdict.UNKNOWN
    assert "run 1 of the search failed" in campaign(root, "--search", code=1)


DIES = 'print(json.dumps({"topic": topic, "time": n, "data": value}), file=file)\n'


@pytest.mark.parametrize("early", [0.5, 2])
def test_a_node_that_dies_before_it_answers_a_condition_is_no_run_without_a_trial(early: float, tmp_path: Path) -> None:
    """An answer to an earlier input hides it only if that input met the condition, too."""
    root = made(tmp_path)
    edit(root / "world.py", ('[("speed", speed)', f'[("speed", {early}), ("distance", 0), ("speed", speed)'))
    edit(root / "world.py", (DIES, f"n == 3 and grip < 0.5 and sys.exit()\n        {DIES}"))
    said = campaign(root, code=1 if early < 1 else 0)
    assert ("undecided: the last inputs met a condition and had no answer" in said) is (early < 1)
    outcome = settle(root)
    assert outcome.verdict is (Verdict.UNKNOWN if early < 1 else Verdict.TESTED)
    assert any("in runs that end before it" in text for text in outcome.hypotheses) is (early > 1)


def test_equal_recordings_rest_on_an_assumption(tmp_path: Path) -> None:
    root = made(tmp_path)
    edit(root / "world.py", ("float(sys.argv[2])", "2"))
    assert "14 runs (13 recordings like an earlier one), 0 failed" in campaign(root)
    assert any("uses seed and scenario" in text for text in settle(root).hypotheses)


@pytest.mark.skipif(not traces(), reason="strace does not work here")
def test_a_file_that_the_simulator_reads_has_to_be_named(tmp_path: Path) -> None:
    root = made(tmp_path)
    (root / "grip.json").write_text("0.5")
    edit(root / "world.py", ("speed * 0.5", 'speed * json.load(open("grip.json"))'))
    assert "error[EXP107]: the simulator reads grip.json, which the plan does not name" in campaign(root, code=2)
    assert not (root / "data/runs.csv").exists()
    edit(root / "plan.yaml", ("runs: 20", "runs: 20\n            files: [grip.json]"))
    campaign(root)
    (root / "grip.json").write_text("0.4")
    assert settle(root).verdict is Verdict.UNKNOWN


@pytest.mark.skipif(not traces(), reason="strace does not work here")
def test_a_file_beside_the_systems_folder_has_to_be_copied_into_it(tmp_path: Path) -> None:
    """Systems of a workspace may share files; those of a Python environment in it are no part of the robot."""
    root = made(tmp_path / "contracts")
    (tmp_path / "dodo.py").touch()
    (tmp_path / "env").mkdir()
    (tmp_path / "env/pyvenv.cfg").touch()
    for name in ("env/grip.json", "grip.json"):
        (tmp_path / name).write_text("0.5")
    opened = f"json.load(open({str(tmp_path / 'env/grip.json')!r}))"
    edit(root / "world.py", ("speed * 0.5", f"speed * {opened}"))
    campaign(root)
    edit(root / "world.py", ("env/grip.json", "grip.json"))
    assert "into the system's folder" in campaign(root, code=2)


def test_a_run_that_breaks_an_assumption_is_no_trial(tmp_path: Path) -> None:
    root = made(tmp_path)
    edit(root / "system.rcl", ("<= 9", "<= 0.5"))
    assert "an assumption is broken" in campaign(root, "--runs", "2", code=1)
    assert settle(root).vacuous
    assert "3 runs of a search (3 broke an assumption)" in campaign(root, "--search", "--runs", "3", code=1)


@pytest.mark.slow
def test_a_failing_scenario_is_found_simplified_and_kept(drawn: Path) -> None:
    edit(drawn / "world.py", FAULT)
    table = (drawn / "data/runs.csv").read_text()
    found = json.loads(campaign(drawn, "--search", "--json", code=1))["campaigns"][0]
    assert (drawn / "data/runs.csv").read_text() == table, "a chosen run is no trial"
    (regression,) = found["regressions"]
    assert regression["floor"] == "wet"
    assert float(regression["grip"]) < 0.5
    assert not [*(drawn / "data/runs").glob("s*")]
    campaign(drawn, code=1)
    refuted = settle(drawn)
    assert refuted.verdict is Verdict.REFUTED
    edit(drawn / "world.py", FAULT[::-1])
    assert "`avow campaign drawn brake` makes the runs" in settle(drawn).summary
    campaign(drawn)
    mended = settle(drawn, refuted)
    assert (mended.verdict, mended.bound["triggered"]) == (Verdict.TESTED, 14)
    assert mended.summary.endswith("1 regression replayed, 0 failed")
    (drawn / "data/runs_regressions.csv").unlink()
    assert settle(drawn, refuted).verdict is Verdict.UNKNOWN, "a refutation does not vanish with its file"


@pytest.mark.slow
def test_a_removed_regression_is_missed_by_campaign_and_verify_alike(tmp_path: Path) -> None:
    root = made(tmp_path / "contracts/brakes")
    (tmp_path / "dodo.py").write_text("")
    edit(root / "world.py", FAULT)
    campaign(root, "--search", code=1)
    campaign(root, code=1)
    assert avow("verify", cwd=tmp_path).returncode == 1
    edit(root / "world.py", FAULT[::-1])
    assert "brake.stops: tested" in campaign(root)
    (root / "data/runs_regressions.csv").unlink()
    told = campaign(root, code=1)
    assert "brake.stops: unknown: runs that failed before are missing in the data" in told
    assert "put them back, or name them under 'left_out'" in told


@pytest.mark.slow
def test_a_claimed_rate_gets_every_run_of_the_plan(tmp_path: Path) -> None:
    root = made(tmp_path)
    edit(root / "plan.yaml", ("seconds: 5", "seconds: 5\n          at_least: 0.8"))
    campaign(root, "--runs", "19", code=1)
    assert "19 of 20 runs" in settle(root).summary
    campaign(root)
    assert settle(root).bound["runs"] == 20
    edit(root / "plan.yaml", ("runs: 20", "runs: 19"))
    assert settle(root).verdict is Verdict.UNKNOWN, "a number of runs that is chosen after the runs"


WRONG = [
    ("seed: 3", "seed: 3\n          strata: flor", "'flor' is no parameter"),
    ("seed: 3", "seed: 3\n          steps: true", "'steps' does not go with 'campaign'"),
    ('"{grip}"', '"{gripp}"', "{gripp} is no parameter"),
    ('"{floor}"', "dry", "no argument has {floor}"),
    ("to: 5", "to: 0.5", "'from' must be less than 'to'"),
    ("[dry, wet]", "[dry, dry]", "a value occurs twice"),
    ("run.jsonl", "../run.jsonl", "is no name of a file"),
    ("runs: 20", "files: [elsewhere]", "there is no 'elsewhere'"),
]


def test_all_faults_of_the_option_are_told_at_once(tmp_path: Path) -> None:
    root = made(tmp_path)
    for old, new, _ in WRONG:
        edit(root / "plan.yaml", (old, new))
    told = " ".join(campaign(root, code=2).split())
    assert [text for *_, text in WRONG if text not in told] == []
    assert "Traceback" not in told
    assert len(BACKEND.check(job(root))) >= len(WRONG)
    edit(made(tmp_path) / "plan.yaml", ("runs: 20", "runs: 0"))
    assert avow("check", str(root / "plan.yaml"), cwd=root).stdout.count("error[") == 1
    edit(root / "plan.yaml", ("runs: 0", "files: 3"))
    assert root / "world.py" in BACKEND.files(job(root))


def test_a_plan_without_campaign_monitors_or_program_is_told(tmp_path: Path) -> None:
    root = made(tmp_path / "a")
    assert "EXP104" in campaign(root, "brakes", code=2)
    edit(root / "plan.yaml", ("python3", "no-such-program"))
    assert "does not start" in campaign(root, code=3)
    text = (root / "plan.yaml").read_text()
    (root / "plan.yaml").write_text(text[: text.index("      - ros")] + text[text.index("      - exp") :])
    assert "has no monitors" in campaign(root, code=2)
    done = avow("check", str(root), cwd=root)
    assert done.returncode == 2
    assert "has no monitors" in done.stdout + done.stderr


# -- the rover of docs/examples: page 23's acceptance ------------------------------------------------------------------

ROVER = Path(__file__).parents[2] / "docs" / "examples" / "rover"


def rover() -> tuple[Callable[[int, Cells], float], Job]:
    """The clearance of the rover with the planted fault, less the 0.2 m of its guarantee."""
    spec = importlib.util.spec_from_file_location("world", ROVER / "models/world.py")
    assert spec is not None
    assert spec.loader is not None
    world = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(world)

    def margin(seed: int, cells: Cells) -> float:
        given = {name: float(value) for name, value in cells.items()}
        return float(min(clearance for _, clearance in world.drive(seed, **given, planted=True)) - 0.2)

    system = load_system(ROVER)
    method = next(m for m in system.plan.node("rover").methods if m.backend == "experiment")
    return margin, method_job(system, system.contract.node("rover"), method)


@pytest.mark.slow
def test_a_search_finds_the_planted_fault_of_the_rover_in_300_runs() -> None:
    margin, asked = rover()
    whole = read_campaign(asked, ROVER / "data/runs.csv")

    def found(seed: int) -> Searched:
        def attempt(cells: Cells) -> Tried:
            distance = margin(seed, cells)
            return Tried({"clear": distance}, distance < 0)

        return search(whole.parameters, attempt, 1000, seed)

    assert statistics.median(found(seed).runs for seed in range(10)) < 300


@pytest.mark.nightly
@pytest.mark.slow
def test_drawn_runs_seldom_find_it_in_3000() -> None:
    margin, asked = rover()
    whole = read_campaign(asked, ROVER / "data/runs.csv")
    late = 0
    for seed in range(10):
        runs = map(replace(whole, made_by=str(seed)).drawn, range(1, 3001))
        late += all(margin(run.seed, run.cells) >= 0 for run in runs)
    assert late >= 6

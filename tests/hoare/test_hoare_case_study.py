"""The case study's programs: the repaired system is proved, the paper's slips are found."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND
from avow.base.verdict import Outcome, Verdict
from hoare.systems import make_job

REPAIRED = "contracts/remote_inspection"
PUBLISHED = "contracts/remote_inspection_published"
PAPERS_TABLE = {
    "in.r": "radiation_at(i)",
    "in.command": "inspect(i)",
    "out.radiationStatus": "output",
    "out.inspected(i)": "input == radiation_at(i)",
}


def settle(
    folder: Path, root: Path, system: str, file: str, table: dict[str, str], old: str = "", new: str = ""
) -> dict[str, Outcome]:
    rcl = (root / system / "system.rcl").read_text()
    assert old in rcl
    options = {"program": f"models/{file}", "variables": table}
    files = {f"models/{file}": (root / system / "models" / file).read_text()}
    wanted = make_job(folder, rcl.replace(old, new), "radiationSensor", options, files, "hoare")
    assert not [d for d in BACKEND.check(wanted) if d.is_error]
    return {o.obligation.rpartition("/")[2]: o for o in BACKEND.discharge(wanted, folder, Limits()).outcomes}


def test_the_repaired_sensor_is_proved(tmp_path: Path, root: Path) -> None:
    found = settle(tmp_path, root, REPAIRED, "radiation_sensor.imp", {"out.radiationStatus": "output"})
    assert {name: o.verdict for name, o in found.items()} == dict.fromkeys(
        ("marks_inspected", "low", "medium", "high"), Verdict.PROVED
    )
    assert not any(o.vacuous for o in found.values())


def test_a_changed_threshold_in_the_contract_is_noticed(tmp_path: Path, root: Path) -> None:
    table = {"out.radiationStatus": "output"}
    found = settle(tmp_path, root, REPAIRED, "radiation_sensor.imp", table, "Orange = 120", "Orange = 130")
    assert {name for name, o in found.items() if o.verdict is Verdict.REFUTED} == {"low"}
    shown = found["low"].counterexample
    assert shown is not None
    assert dict(shown.values)["in.r"] == "125"


@pytest.mark.parametrize("file", ["radiation_sensor.imp", "radiation_sensor_listing.imp"])
def test_the_published_guarantee_is_a_tautology(tmp_path: Path, root: Path, file: str) -> None:
    """As typed it holds of any program: also of the appendix's one, whose thresholds are 10 and 20."""
    (outcome,) = settle(tmp_path, root, PUBLISHED, file, PAPERS_TABLE).values()
    assert (outcome.verdict, outcome.vacuous) == (Verdict.PROVED, True)


def test_numbers_that_are_not_the_contracts_are_told(tmp_path: Path, root: Path) -> None:
    """The published guarantee is a tautology, so that every program is proved: the numbers tell, where no proof can."""

    def told(system: str, file: str, table: dict[str, str], old: str = "", new: str = "") -> list[str]:
        rcl = (root / system / "system.rcl").read_text()
        text = (root / system / "models" / file).read_text()
        assert old in text
        options = {"program": f"models/{file}", "variables": table}
        files = {f"models/{file}": text.replace(old, new)}
        job = make_job(tmp_path, rcl, "radiationSensor", options, files, "hoare")
        return [f"{d.code} {d.message}" for d in BACKEND.check(job)]

    (appendix,) = told(PUBLISHED, "radiation_sensor.imp", PAPERS_TABLE)
    assert appendix.startswith("HOARE410 the program compares with 10, 20,")
    assert "the contract compares with 120, 250" in appendix
    assert told(PUBLISHED, "radiation_sensor_listing.imp", PAPERS_TABLE) == []
    table = {"out.radiationStatus": "output"}
    assert told(REPAIRED, "radiation_sensor.imp", table) == []
    (one,) = told(REPAIRED, "radiation_sensor.imp", table, old="250", new="255")
    assert "the program compares with 255," in one
    assert "the contract compares with 250," in one
    # a number more is no sign of anything
    assert told(REPAIRED, "radiation_sensor.imp", table, old="input < 120", new="input < 120 AND input < 200") == []

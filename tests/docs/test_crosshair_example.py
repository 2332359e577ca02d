"""The example of a third party's package: it passes the suite, and its verdicts are CPython's, judged exactly."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest
from python_backend.source_nodes import DEBOUNCER, LIMITER, NODES

from avow.backend_kit.protocol import Limits
from avow.base.verdict import Object, Outcome, Verdict
from avow.pipeline.methods import method_job

FOLDER = Path(__file__).parents[2] / "docs" / "examples" / "crosshair"

needs_crosshair = pytest.mark.skipif(
    importlib.util.find_spec("crosshair") is None, reason="crosshair is not here: pip install crosshair-tool"
)


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(FOLDER))
    import avow_crosshair

    return avow_crosshair


def outcomes(package: ModuleType, folder: Path, name: str, source: str) -> dict[str, Outcome]:
    job = replace(NODES[name], source=source).job(folder)
    made = method_job(job.system, job.node, job.method, package.BACKEND)
    return {o.obligation.rpartition("/")[2]: o for o in package.BACKEND.discharge(made, folder, Limits(120)).outcomes}


def test_it_is_a_package_with_an_entry_point() -> None:
    project = tomllib.loads((FOLDER / "pyproject.toml").read_text())
    assert project["project"]["entry-points"]["avow.backends"] == {"crosshair": "avow_crosshair:BACKEND"}
    assert all((FOLDER / f"{name}.py").is_file() for name in project["tool"]["setuptools"]["py-modules"])


@pytest.mark.slow
@needs_crosshair
def test_it_passes_the_suite(tmp_path: Path) -> None:
    shutil.copytree(FOLDER, tmp_path / "package", ignore=shutil.ignore_patterns("__pycache__"))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    done = subprocess.run(
        [*command, "test_avow_crosshair.py"],
        cwd=tmp_path / "package",
        capture_output=True,
        text=True,
        timeout=580,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]


def test_without_crosshair_it_is_not_run(package: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(package.importlib.util, "find_spec", lambda name: None)
    found = outcomes(package, tmp_path, "limiter", LIMITER)
    assert {o.verdict for o in found.values()} == {Verdict.NOT_RUN}
    assert "pip install crosshair-tool" in found["bounded"].summary


def test_what_is_printed_besides_counts_for_nothing(package: ModuleType, tmp_path: Path) -> None:
    text = "def guarantee_0(i0: float) -> None:\n    assert True\n"
    file = tmp_path / "harness.py"
    good = f"{file}:2: info: Confirmed over all paths.\n"
    assert package.answers(good, file, text) == {0: ("Confirmed over all paths.", None)}
    assert isinstance(package.answers(good + "hello\n", file, text), str)
    assert isinstance(package.answers(good + good, file, text), str)
    told = f"{file}:2: error: AssertionError:  when calling guarantee_0(-1.5) (which returns None)\n"
    assert package.answers(told, file, text)[0][1] == {"i0": -1.5}


@pytest.mark.slow
@needs_crosshair
def test_a_right_one_and_a_mutant(package: ModuleType, tmp_path: Path) -> None:
    right = outcomes(package, tmp_path / "right", "debouncer", DEBOUNCER)
    assert {o.verdict for o in right.values()} == {Verdict.CHECKED}, [o.summary for o in right.values()]
    assert {(o.of, o.numbers) for o in right.values()} == {(Object.SOURCE, "float64")}
    assert all("real numbers" in o.rests_on[0].text for o in right.values())
    wrong = outcomes(package, tmp_path / "wrong", "limiter", LIMITER.replace("v < -self.vmax", "v < 0"))
    assert wrong["same"].verdict is Verdict.REFUTED
    assert "CPython answers so" in wrong["same"].summary


@pytest.mark.nightly
@pytest.mark.slow
@needs_crosshair
@pytest.mark.parametrize("name", NODES)
def test_no_mutant_is_checked_throughout(package: ModuleType, name: str, tmp_path: Path) -> None:
    example = NODES[name]
    for k, (old, new) in enumerate(example.mutants):
        found = outcomes(package, tmp_path / str(k), name, example.source.replace(old, new, 1))
        assert not all(o.verdict is Verdict.CHECKED for o in found.values()), (name, k)

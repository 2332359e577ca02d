"""Fixtures and the rule for tests that need an outside tool."""

from __future__ import annotations

import functools
import gc
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

# The tests start some hundred Pythons: without byte code, each would compile the same modules again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@functools.cache
def _runs(*command: str) -> bool:
    """Whether a command ends well: what was installed by half is not there."""
    try:
        return subprocess.run(command, capture_output=True, check=False, timeout=60).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False


_NEEDS = {
    "needs_ajpf": lambda: "AJPF_HOME" in os.environ,
    "needs_chromium": lambda: any(map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))),
    "needs_cvc5": lambda: importlib.util.find_spec("cvc5") is not None,
    "needs_dafny": lambda: shutil.which("dafny") is not None,
    "needs_dds": lambda: all(map(importlib.util.find_spec, ("cyclonedds", "rosbags"))),
    "needs_dot": lambda: shutil.which("dot") is not None,
    "needs_motion": lambda: importlib.util.find_spec("codac") is not None,
    "needs_chance": lambda: importlib.util.find_spec("stormpy") is not None,
    "needs_perception": lambda: all(map(importlib.util.find_spec, ("maraboupy", "onnx", "onnxruntime"))),
    "needs_ros1": lambda: _runs("/usr/bin/python3", "-c", "import diagnostic_msgs, rosmaster, rospy"),
    "needs_roscpp": lambda: shutil.which("g++") is not None and _runs("pkg-config", "--exists", "roscpp"),
}


def pytest_configure() -> None:
    """Plans of the tests may name plug-ins of the tests; on a busy machine an example may take its time."""
    from hypothesis import HealthCheck, settings

    from avow.backend_kit.registry import trust_plugins

    trust_plugins()
    settings.register_profile("avow", deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.load_profile("avow")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """A test whose tool is missing is skipped, visibly. What only tests need that are left out is not looked for."""
    for item in items:
        for name in {mark.name for mark in item.iter_markers()} & _NEEDS.keys():
            if not _NEEDS[name]():
                item.add_marker(pytest.mark.skip(reason=f"{name}: not on this machine"))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What is collected stays: to look for garbage among it, again and again, takes a quarter of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_finish() -> None:
    """Thousands of collected tests stay till the end: the garbage collector need not walk them, not even once."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)


def pytest_sessionfinish() -> None:
    """pytest collects garbage five times when it ends, and would walk all that thousands of tests left."""
    gc.freeze()


@pytest.fixture
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """An empty workspace with the repository's dodo.py."""
    (tmp_path / "contracts").mkdir()
    shutil.copy(ROOT / "dodo.py", tmp_path)
    return tmp_path

"""Loads a generated test so that its import finds a stand-in for the unit under test."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from .export import ADVANCE

if TYPE_CHECKING:
    from .running import Bench


def loaded(bench: Bench) -> ModuleType:
    """The generated test, whose import finds the stand-in."""
    stem = bench.asked.subject.path.stem
    stand_in = ModuleType(stem)
    made = _stand_in(bench) if bench.asked.subject.driven else lambda **_: bench.outputs_here(bench.ask_here())
    called = (
        json.loads(bench.asked.subject.function)["class"]
        if bench.asked.subject.driven
        else bench.asked.subject.function
    )
    setattr(stand_in, called, made)
    spec = importlib.util.spec_from_file_location("generated", Path(bench.asked.test).resolve())
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(stem)
    sys.modules[stem] = stand_in
    spec.loader.exec_module(module)
    if before is None:
        del sys.modules[stem]
    else:
        sys.modules[stem] = before
    return module


def _stand_in(bench: Bench) -> type:
    """A class in place of the one under test, which is in its own process."""

    class StandIn:
        def __init__(self, *_: Any) -> None:
            bench.begin()

        def step(self, **_: Any) -> dict[str, Any]:
            return bench.outputs_here(bench.ask_here())

        def __getattr__(self, attribute: str) -> Any:
            ports = [port for port, held in bench.asked.subject.held.items() if held == attribute]
            known = bench.found or bench.memory
            values = [known[port] for port in ports if port in known]
            if not values:
                raise AttributeError(attribute)
            return bench.outputs_here({"": values[0]})[""]

    return StandIn


def observed(machine: Any, bench: Bench) -> Any:
    """The generated state machine; the bench judges each step."""

    class Observed(machine):  # type: ignore[misc]
        def __init__(self) -> None:
            if not bench.asked.subject.driven:
                bench.begin()
            super().__init__()

    def advance(self: Any, **drawn: Any) -> None:
        bench.case(drawn, lambda: getattr(super(Observed, self), ADVANCE)(**drawn))

    setattr(Observed, ADVANCE, advance)
    return Observed

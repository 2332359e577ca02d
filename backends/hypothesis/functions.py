"""Runs of a function that keeps nothing: it is asked at each step, and the contract's memory is the judge's alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from avow.formulas.values import Value
from avow.isolation.scout import Sight
from avow.isolation.subject import SubjectProcess
from avow.language.sorts import Sort

from .bench import Bench
from .convention import received, sent
from .generate import Inputs
from .sequences import SequenceBench


class FunctionBench(SequenceBench):
    """As `SequenceBench`, of a plain function. What it keeps all the same from one run to another shows where another
    process is asked again."""

    def begin(self, subject: SubjectProcess) -> dict[str, Value]:
        self.keeper.restart()
        return {}

    def advance(self, subject: SubjectProcess, inputs: Inputs) -> dict[str, Value]:
        return self.outputs_of(subject.ask(self.sent(inputs)))

    def looked(self, start: list[Inputs], cases: Sequence[Inputs], *, on: bool = False) -> list[tuple[Sight, ...]]:
        return Bench.looked(self, start, cases)

    def coded(self, value: Value) -> Any:
        return sent(value)

    def decoded(self, data: Any, sort: Sort, name: str) -> Value:
        return received(data, sort, name)

    def _wrong_first(self, inputs: Inputs, name: str, text: str) -> str:
        self.keeper.restart()
        return self._wrong_apart(self.subject, inputs, name, text)

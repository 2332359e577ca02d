"""The unit under test, in a process of its own: its inputs and answers, in the contract's values."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from avow.formulas.values import Value
from avow.isolation.subject import SubjectFailed, SubjectProcess

from .convention import EXACT, Inputs, Malformed, outputs, received, sent
from .exchange import Question
from .tuning import ASKED_AGAIN


class Unit:
    """A function, or an object of a driven class."""

    def __init__(self, asked: Question, patience: float) -> None:
        self.asked, self.patience = asked, patience
        self.process = SubjectProcess(asked.subject.path, asked.subject.function, patience, asked.root)
        self.inputs = {p.name: p.sort for p in asked.inputs}
        self.outputs = {p.name: p.sort for p in asked.outputs}
        self.doubles = asked.numbers != EXACT
        self.requests: list[tuple[Any, Any]] = []
        """The first requests, with the replies."""

    def begin(self) -> dict[str, Value]:
        """A new run of a new object; its memory. Raises SubjectFailed."""
        return self._held(self._drive({"steps": []})["held"]) if self.asked.subject.driven else {}

    def advance(self, inputs: Inputs, instead: Mapping[str, str] | None = None) -> dict[str, Value]:
        """One step's outputs, with memory among them; `instead`: floats for some inputs. Raises SubjectFailed."""
        step = self.step_of(inputs) | {n: {"f": text} for n, text in (instead or {}).items()}
        if not self.asked.subject.driven:
            return self.read(self.request(step))
        (answer,) = self._drive({"on": True, "steps": [step]})["steps"]
        if "error" in answer:
            raise SubjectFailed(f"the step raises {answer['why']}")
        returned = {n: s for n, s in self.outputs.items() if n not in self.asked.subject.held}
        unread = [name.removeprefix("out.") for name in self.asked.subject.left_out if name.startswith("out.")]
        try:
            found = outputs(answer["value"], returned, unread) if returned else {}
            held = {n: v for n, v in answer["memory"].items() if n in self.outputs}
            return found | {n: received(v, self.outputs[n], f"out.{n}") for n, v in held.items()}
        except (Malformed, ValueError, TypeError, KeyError) as error:
            raise SubjectFailed(str(error)) from error

    def memory(self, found: Mapping[str, Value]) -> dict[str, Value]:
        """Its memory after a step with these outputs."""
        names = [n for n in self.asked.subject.held if n in self.inputs]
        if all(n in found for n in names):
            return {n: found[n] for n in names}
        return self._held(self._drive({"on": True, "steps": []})["held"])

    def step_of(self, inputs: Inputs) -> dict[str, Any]:
        """The inputs that are passed, as data."""
        driven, accepted = self.asked.subject.driven, self.asked.subject.accepted
        passed = (
            inputs.keys() - self.asked.subject.held.keys() if driven or accepted is None else inputs.keys() & accepted
        )
        given = {**{n: v for n, v in inputs.items() if n in passed}, **self.asked.constants}
        return {n: sent(v, doubles=self.doubles, lists=driven) for n, v in given.items()}

    def request(self, request: Any) -> Any:
        """The reply to a request. Raises SubjectFailed."""
        reply: Any = self.process.ask_all([request])[0]
        if len(self.requests) < ASKED_AGAIN:
            self.requests.append((request, str(reply) if isinstance(reply, SubjectFailed) else reply))
        if isinstance(reply, SubjectFailed):
            raise reply
        return reply

    def read(self, reply: Any) -> dict[str, Value]:
        """A function's outputs. Raises SubjectFailed."""
        if isinstance(reply, SubjectFailed):
            raise reply
        try:
            return outputs(reply, self.outputs)
        except Malformed as error:
            raise SubjectFailed(str(error)) from error
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise SubjectFailed("the unit's answer cannot be read") from error

    def inputs_of(self, request: Mapping[str, Any]) -> Inputs:
        """The inputs in a request, as far as they can be read."""
        plain = request if not self.asked.subject.driven else (json.loads(request["case"])["steps"] or [{}])[0]
        found: Inputs = {}
        for name, data in plain.items():
            if name in self.asked.constants:
                continue
            try:
                found[name] = received(data, self.inputs[name], name)
            except (Malformed, ValueError):
                continue
        return found

    def differing(self, before: Sequence[tuple[Any, Any]]) -> Iterator[tuple[Inputs, Any]]:
        """The inputs of requests whose reply differs now, and the new reply."""
        again = self.process.ask_all([request for request, _ in before])
        for (request, reply), other in itertools.zip_longest(before, again):
            if other != reply and self.differ(reply, str(other) if isinstance(other, SubjectFailed) else other):
                yield self.inputs_of(request), other

    def differ(self, one: Any, other: Any) -> bool:
        """Whether two replies mean different outputs."""
        if self.asked.subject.driven or isinstance(one, str) or isinstance(other, str):
            return bool(one != other)
        try:
            return self.read(one) != self.read(other)
        except SubjectFailed:
            return True

    def _drive(self, case: Mapping[str, Any]) -> Any:
        """The answer of a class's driver."""
        reply = self.request({"case": json.dumps(case)})
        if not isinstance(reply, str):
            raise SubjectFailed("the class cannot be driven")
        return json.loads(reply)

    def _held(self, data: Mapping[str, Any]) -> dict[str, Value]:
        names = [n for n in self.asked.subject.held if n in self.inputs]
        try:
            return {n: received(data[n], self.inputs[n], f"in.{n}") for n in names}
        except Malformed as error:
            raise SubjectFailed(f"in memory, {error}") from error

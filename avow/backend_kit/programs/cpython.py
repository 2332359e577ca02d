"""Runs the declared class in isolation, by a process that the class cannot access.

As a script (``python cpython.py CHANNEL FILE``) it runs a class on the cases in a file and reports the replies.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from avow.base.codec import canonical, from_text, to_json
from avow.base.verdict import Isolation
from avow.drive.steps import coded
from avow.isolation import judge
from avow.isolation.observed import Observed


@dataclass(frozen=True, slots=True)
class Subject:
    """The class, and how it is made."""

    root: Path
    file: Path
    class_name: str
    params: Mapping[str, Any]
    memory: Mapping[str, str]
    attributes: tuple[str, ...]
    """The attributes whose values after `__init__` are requested."""
    ros: Mapping[str, Any] | None = None
    """For a callback class: the substitute for ROS (`avow.drive.callbacks`)."""

    @property
    def spec(self) -> str:
        spec: dict[str, Any] = {
            "class": self.class_name,
            "params": coded(dict(self.params)),
            "memory": dict(self.memory),
            "attributes": list(self.attributes),
        }
        if self.ros is not None:
            spec["ros"] = dict(self.ros)
        return json.dumps(spec)


@dataclass(frozen=True, slots=True)
class Question:
    """The request to the process, in a file."""

    root: str
    file: str
    spec: str
    cases: tuple[str, ...]
    seconds: float
    batch: int


@dataclass(frozen=True, slots=True)
class Replies:
    """The replies, one for each case (None: no reply), or a `fault`, in which case no reply counts."""

    replies: tuple[Any, ...]
    fault: str
    observed: tuple[Observed, ...]
    isolation: Isolation
    deed: bool = False
    """The program did something that invalidates its answers."""
    silent: bool = False
    """The fault is the machine's: wall-clock time, or a kill from outside. It is no fault of the class."""


def case_of(inputs: Mapping[str, Any], memory: Mapping[str, Any]) -> str:
    """One step from that state."""
    return json.dumps(
        {
            "memory": {name: coded(value) for name, value in memory.items()},
            "steps": [{name: coded(value) for name, value in inputs.items()}],
        }
    )


def ask(subject: Subject, cases: Sequence[str], *, seconds: float, megabytes: int) -> Replies:
    """Run the cases, each on an object of its own. Raises ToolMissing."""
    from avow.base.tuning.running import SUBJECT_BATCH

    with tempfile.TemporaryDirectory(prefix="avow-") as scratch:
        place = Path(scratch) / "cases.json"
        where = str(subject.root), str(subject.file), subject.spec
        question = Question(*where, tuple(cases), seconds, SUBJECT_BATCH)
        place.write_text(canonical(to_json(question)), encoding="utf-8")
        done, answer = judge.ask(
            Replies,
            str(Path(__file__).resolve()),
            [str(place)],
            cwd=Path(scratch),
            seconds=seconds,
            megabytes=megabytes,
            env={"PYTHONHASHSEED": "0"},
        )
    if answer is None:
        why = "took too long" if done.timed_out else f"ended without an answer (code {done.code})"
        last = done.stderr.strip().splitlines()[-1:]
        fault = f"running the class {why}{': ' + last[0][:200] if last else ''}"
        return Replies((), fault, (), Isolation.NONE, silent=True)
    return replace(answer, replies=tuple(json.loads(r) if isinstance(r, str) else r for r in answer.replies))


def main() -> None:
    from avow.base.process import adopt_orphans
    from avow.base.tuning.running import SUBJECT_PATIENCE
    from avow.isolation.subject import SubjectFailed, SubjectProcess

    channel = int(sys.argv[1])
    os.set_inheritable(channel, False)
    adopt_orphans()
    question = from_text(Question, Path(sys.argv[2]).read_bytes())
    patience = max(1.0, min(SUBJECT_PATIENCE, question.seconds / 3))
    process = SubjectProcess(Path(question.file), question.spec, patience, Path(question.root))
    replies: list[Any] = []
    fault = ""
    try:
        for at in range(0, len(question.cases), question.batch):
            found = process.ask_all([{"case": case} for case in question.cases[at : at + question.batch]])
            failed = [str(r) for r in found if isinstance(r, SubjectFailed)]
            if failed:
                fault = failed[0]
                break
            replies += found
    finally:
        fault = process.close() or fault
    made = Replies(
        tuple(replies), fault, process.observed(), process.isolation, bool(process.fault), bool(process.silent)
    )
    judge.say(channel, made)


if __name__ == "__main__":
    main()

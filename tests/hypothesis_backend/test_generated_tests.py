"""What a generated test says when it fails: enough to see it again. Hypothesis' own words for it are not told."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from avow.backend_kit.protocol import Job
from avow.backends.hypothesis import BACKEND
from avow.backends.hypothesis.bench import Bench
from avow.backends.hypothesis.export import DATA
from avow.backends.hypothesis.sequences import SequenceBench

from . import test_sequences as classes
from .test_hypothesis_backend import STEP, job


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (STEP.replace("r < 250", "r < 260"), r"\Ahigh is broken: .*in\.r = 25\d"),
        (STEP.replace("done = ", "assert r < 130\n    done = "), r"\Ahigh: .*AssertionError.*, of .*in\.r = 130"),
        (f"asked = []{STEP.replace('done = ', 'asked.append(r); assert len(asked) % 9; done = ')}", r"\Ahigh: "),
    ],
    ids=["is broken", "raises", "answers otherwise"],
)
def test_of_which_inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, said: str) -> None:
    fails(job(tmp_path, text), Bench, "high", said, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "said"),
    [
        ("return r + (self.n > 2)", r"\Ag is broken: {0}; then {0}; then {0}\Z"),
        ("return r + 0 / (self.n < 3)", r"\Ag: .*ZeroDivisionError.*, of {0}; then {0}; then in\.r = \S+\Z"),
    ],
    ids=["is broken", "raises"],
)
def test_by_which_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, said: str) -> None:
    text = f"r):\n        self.n += 1\n        {step}\n"
    wanted = classes.job(tmp_path, classes.REAL, classes.SAME, text)
    fails(wanted, SequenceBench, "g", said.format(r"in\.r = \S+, out\.u = \S+"), monkeypatch)


def fails(wanted: Job, kind: type[Bench], name: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = wanted.root / "exported"
    folder.mkdir()
    for made, text in BACKEND.export(wanted).items():
        (folder / made).write_text(text, encoding="utf-8")
    monkeypatch.setenv("AVOW_SYSTEM_ROOT", str(wanted.root))
    bench = kind.load(folder / DATA)
    with closing(bench.subject), closing(bench.scout), pytest.raises(AssertionError, match=said):
        bench.hold(name)

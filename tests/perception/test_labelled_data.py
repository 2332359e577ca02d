"""A network on labelled data: each row's verdict is that of the arithmetic that the network was made of."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import pytest
from perception.networks import network

from avow.backend_kit.protocol import Job, Limits
from avow.backends.experiment import BACKEND
from avow.backends.experiment import network as running
from avow.base.tools import Tool
from avow.base.verdict import Object, Outcome, Verdict
from avow.conformance.seeded import Seeded, settle

RCL = """node n {
  inputs( size : REAL, person : BOOL ) outputs( found : BOOL, score : REAL, kind : {cat, dog} ) topics()
  assume domain ( 0 <= in.size and in.size <= 10 )
  guarantee sees with probability >= 0.9 given ( in.person ) ( out.found )
  guarantee same ( out.score == 2 * in.size )
  guarantee kinds ( in.size > 5 -> out.kind == dog )
}
"""
OPTIONS = {
    "data": "d.csv",
    "network": {
        "file": "n.onnx",
        "inputs": ["size", {"column": "light", "scale": 0.5, "offset": 1}],
        "outputs": {"f": {"index": 0, "threshold": 4}, "s": 0, "k": {"argmax": ["cat", "dog"], "from": 1}},
    },
    "mapping": {"in.size": "size", "in.person": "person", "out.found": "f", "out.score": "s", "out.kind": "k"},
    "outside": {"domain": "larger ones were recorded, too"},
}


def made(scale: float) -> bytes:
    """(size, light) → (scale * size, 5, size)."""
    return network(([[scale, 0.0], [0.0, 0.0], [1.0, 0.0]], [0.0, 5.0, 0.0]))


def job_of(folder: Path, rows: list[tuple[str, str, str]], scale: float = 2.0, **options: object) -> Job:
    table = "run,size,light,person\n" + "".join(f"{n},{','.join(row)}\n" for n, row in enumerate(rows))
    wanted = dict.fromkeys(("sees", "same", "kinds"), Verdict.TESTED)
    case = Seeded("s", RCL, {**OPTIONS, **options}, wanted, {"d.csv": table, "n.onnx": made(scale)})
    return case.written(BACKEND, folder)


def judged(folder: Path, rows: list[tuple[str, str, str]], scale: float = 2.0, **options: object) -> dict[str, Outcome]:
    job = job_of(folder / "system", rows, scale, **options)
    assert not BACKEND.check(job) or options
    return {o.obligation.rpartition("/")[2]: o for o in settle(BACKEND, job, folder / "out", Limits()).outcomes}


def drawn(seed: int, least: int = 2) -> list[tuple[str, str, str]]:
    rng = random.Random(seed)
    return [(f"{rng.randint(least, 20) / 2:g}", rng.choice("012"), "yes") for _ in range(60)]


def test_the_network_decides(tmp_path: Path) -> None:
    good = judged(tmp_path / "a", [*drawn(1, 4), ("99", "1", "yes")])
    assert {name: (o.verdict, o.of) for name, o in good.items()} == dict.fromkeys(
        ("sees", "same", "kinds"), (Verdict.TESTED, Object.MODEL)
    )
    assert "1 broke an assumption" in good["sees"].summary
    blind = judged(tmp_path / "b", drawn(1, 4), scale=0.5)  # a mutant: sizes below 8 are not seen
    assert blind["sees"].verdict is Verdict.REFUTED
    assert blind["same"].verdict is Verdict.REFUTED
    assert blind["kinds"].verdict is Verdict.TESTED


def test_rows_that_failed_by_an_earlier_network_are_there_if_their_measurements_are(tmp_path: Path) -> None:
    rows = drawn(1, 4)
    blind = judged(tmp_path / "a", rows, scale=0.5)
    for folder, table, wanted in (("b", rows, Verdict.TESTED), ("c", rows[1:], Verdict.UNKNOWN)):
        again = job_of(tmp_path / folder, table)
        kept = {o.id: (blind[o.name].details["case"],) for o in again.obligations if "case" in blind[o.name].details}
        outcomes = settle(BACKEND, replace(again, kept=kept), tmp_path / f"{folder}-out", Limits()).outcomes
        assert {o.verdict for o in outcomes if o.obligation in kept} == {wanted}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"inputs": ["size"]}, "n.onnx has 2 inputs, and 1 are given"),
        ({"inputs": ["size", "person"]}, "'yes' in column 'person' is no number"),
        ({"outputs": {"f": {"index": 7, "threshold": 4}, "s": 0, "k": 1}}, "n.onnx has 3 outputs, from 0 to 2"),
        ({"inputs": ["size", "lihgt"]}, "there is no column 'lihgt'"),
        ({"outputs": {"size": 0}}, "the column 'size' is that of an output of the network, too"),
        ({"outputs": {**OPTIONS["network"]["outputs"], "z": 1}}, "no port is read from 'z', an output of the network"),  # type: ignore[index]
        ({"file": "m.onnx"}, "m.onnx"),
    ],
)
def test_faults_are_named(tmp_path: Path, change: dict[str, object], words: str) -> None:
    changed = {**OPTIONS["network"], **change}  # type: ignore[dict-item]
    found = judged(tmp_path, drawn(1), network=changed)
    assert all(o.verdict is Verdict.ERROR and words in o.summary for o in found.values()), found


def test_it_depends_on_the_network_and_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job = job_of(tmp_path, drawn(1))
    assert {path.name for path in BACKEND.files(job)} == {"d.csv", "n.onnx"}
    monkeypatch.setattr(running, "onnxruntime_tool", lambda: Tool("onnxruntime", None, None, "pip install it"))
    outcomes = BACKEND.discharge(job, tmp_path / "out", Limits()).outcomes
    assert all(o.verdict is Verdict.NOT_RUN and "pip install it" in o.summary for o in outcomes)
    assert not BACKEND.check(job)

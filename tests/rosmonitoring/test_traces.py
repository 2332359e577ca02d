"""Traces: JSON lines with located faults, bags of both ROS generations, digests."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import pytest

from avow.backends.rosmonitoring.traces import parse_event, read_lines, read_trace
from avow.backends.rosmonitoring.wires import NotANumber, exact
from avow.base.diagnostics import Rejected
from avow.ros.bags import digest_trace


def test_lines_are_counted_with_blank_ones() -> None:
    found = list(read_lines(['{"topic": "a", "time": 0}\n', "\n", '{"topic": "b", "x": 0.1, "time": 0.5}\n'], "t"))
    assert [(r.index, r.line, r.event["topic"]) for r in found] == [(1, 1, "a"), (2, 3, "b")]


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ('{"topic": "a", "time": 0}\n{"topic": }\n', 2, 11, "not JSON"),
        ("[1, 2]\n", 1, 1, "a JSON object"),
        ("3\n", 1, 1, "a JSON object"),
        ('{"a": 1} {"b": 2}\n', 1, 10, "not JSON"),
        ('{"topic": "a"', 1, 14, "not JSON: the line is cut off"),
        ('{"topic": "a", "b', 1, 16, "not JSON: the line is cut off"),
        ("time,speed\n", 1, 1, "not JSON (each line is one event"),
        ('[{"topic": "a", "time": 0}]', 1, 1, "without [ ]"),
        ("[" * 100_000 + "\n", 1, 1, "too deeply"),
        ('{"a": ' + "9" * 5000 + "}\n", 1, 1, "digits"),
        ('{"topic": "a", "time": 0}\n{"topic": "a"}\n', 2, 1, "no `time`"),
        ('{"topic": "a", "time": null}\n', 1, 16, "no `time`"),
        ('{"topic": "a", "time": "12.5"}\n', 1, 16, 'no number of seconds: "12.5"'),
        ('{"time": 1, "data": 5}\n', 1, 1, "no `topic`"),
        ('{"time": 1, "tpoic": "a"}\n', 1, 13, "no `topic`: a name (`tpoic`: did you mean `topic`?)"),
        ('{"topic": "a", "tiem": 1}\n', 1, 16, "(`tiem`: did you mean `time`?)"),
        ('{"time": 1, "topic": 5}\n', 1, 13, "no `topic`"),
        ('{"Topic": "a", "topic": null, "time": 1}\n', 1, 16, "no `topic`"),
        ('{"time": true, "topic": "a"}\n', 1, 2, "no number of seconds"),
        ('{"topic": "a", "time": {"secs": 1, "nsecs": 0}}\n', 1, 16, "no number of seconds"),
        ('{"topic": "a", "time": NaN}\n', 1, 16, "no number of seconds"),
        ('{"topic": "a", "time": Infinity}\n', 1, 16, "no number of seconds"),
        ('{"topic": "a", "time": 1e999999999}\n', 1, 16, "no number of seconds"),
        ('{"topic": "a", "time": -1}\n', 1, 16, "negative: -1"),
        ('{"topic": "a", "time": -0.25}\n', 1, 16, "negative: -0.25"),
    ],
)
def test_malformed_lines_are_located(tmp_path: Path, text: str, line: int, column: int, words: str) -> None:
    path = tmp_path / "t.jsonl"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(Rejected) as error:
        list(read_trace(path))
    (fault,) = error.value.diagnostics
    assert fault.span is not None
    assert (fault.span.line, fault.span.column) == (line, column)
    assert words in (f"{fault.message} ({fault.hint})" if fault.hint else fault.message)


@pytest.mark.parametrize("time", ["0", "-0.0", "12", "1763766000.123456789", "1.5e3", "0." + "1" * 50])
def test_times_are_numbers_from_0(time: str) -> None:
    (found,) = read_lines([f'{{"topic": "a", "time": {time}}}\n'], "t")
    assert found.line == 1


def test_files_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "t.jsonl"
    path.write_bytes(b'{"topic": "\xff\xfe"}\n')
    with pytest.raises(Rejected, match="UTF-8"):
        list(read_trace(path))
    with pytest.raises(Rejected, match="cannot read"):
        list(read_trace(tmp_path / "absent.jsonl"))


def test_numbers_are_exact() -> None:
    event = parse_event('{"a": 0.1, "b": 1e2, "c": 7, "d": 1e999999999}')
    assert (exact(event["a"]), exact(event["b"]), exact(event["c"])) == (Fraction(1, 10), 100, 7)
    for bad in (event["d"], float("nan"), float("inf"), True, "1", None, b"x"):
        with pytest.raises((NotANumber, ValueError)):
            exact(bad)


def test_what_is_no_bag(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    (tmp_path / "bad.bag").write_bytes(b"not a bag")
    (tmp_path / "folder").mkdir()
    for name in ("bad.bag", "folder"):
        with pytest.raises(Rejected):
            list(read_trace(tmp_path / name))


def test_digests_change_with_content_and_names(tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl"
    file.write_text(json.dumps({"topic": "a"}), encoding="utf-8")
    first = digest_trace(file)
    file.write_text(json.dumps({"topic": "b"}), encoding="utf-8")
    assert digest_trace(file) != first
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "x").write_text("1", encoding="utf-8")
    before = digest_trace(folder)
    (folder / "x").rename(folder / "y")
    assert digest_trace(folder) != before


def test_a_key_that_stands_twice_is_a_located_error(tmp_path: Path) -> None:
    trace = tmp_path / "t.jsonl"
    trace.write_text('{"topic": "y", "time": 0, "data": 1}\n{"topic": "x", "time": 1, "data": 4.0, "data": 8.0}\n')
    with pytest.raises(Rejected) as refused:
        list(read_trace(trace))
    (found,) = refused.value.diagnostics
    assert '"data" stands twice' in found.message
    assert found.span is not None
    assert found.span.line == 2

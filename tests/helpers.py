"""What several areas' tests need: `from helpers import edit`."""

from __future__ import annotations

import ast
import functools
import io
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from _pytest.mark import ParameterSet

from avow.assurance.model import Case
from avow.base.workspace import WRITTEN_ON_DEMAND
from avow.cli import main


def edit(path: Path, *pairs: tuple[str, str]) -> None:
    """Replace text in a file; what is to be replaced has to be there, else the test would test nothing."""
    text = path.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def every_text(case: Case) -> Iterator[tuple[str, str]]:
    """Every format of a report except the PDF, whenever it is written, by its file name."""
    from avow.report import formats
    from avow.report.on_demand import rendered

    yield from formats(case)
    for name in WRITTEN_ON_DEMAND:
        if name != "report.pdf":
            yield name, rendered(case, name).decode()


@functools.cache
def parsed(source: str) -> ast.Module:
    """A Python source's tree. Several tests look through all of Avow's own, which takes a second to read."""
    return ast.parse(source)


@functools.cache
def nodes(tree: ast.Module) -> tuple[ast.AST, ...]:
    """All that a tree is made of."""
    return tuple(ast.walk(tree))


def avow(*words: str, cwd: Path, stdin: str = "") -> subprocess.CompletedProcess[str]:
    """A command of Avow's through its real entry point, in this process: a new one costs half a second, and only a test
    of the process itself needs it."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
    given = io.TextIOWrapper(io.BytesIO(stdin.encode()), "utf-8")
    here, code = Path.cwd(), 0
    # commands set variables for the processes that they start, such as the one of --fresh
    streams = mock.patch.multiple(sys, stdout=out, stderr=err, stdin=given, argv=["avow", *words])
    with streams, mock.patch.dict(os.environ):
        os.chdir(cwd)
        try:
            main(list(words))
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else ended.code is not None
        finally:
            os.chdir(here)
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode())  # type: ignore[attr-defined]
    return subprocess.CompletedProcess(["avow", *words], code, *texts)


def keys_of(schema: Any) -> Iterator[str]:
    """Every key that a JSON schema allows by name, at any depth."""
    for part in schema if isinstance(schema, list) else ():
        yield from keys_of(part)
    for word, part in schema.items() if isinstance(schema, dict) else ():
        if word == "properties":
            yield from part
        yield from keys_of(list(part.values()) if word in ("properties", "$defs") else part)


def alive(pid: int) -> bool:
    """Whether a process runs: a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def command(pid: int | str) -> bytes:
    """A process's command line; nothing where it is gone."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def wait_for(happens: Callable[[], object], seconds: float = 150) -> None:
    """Wait till it does. It may take far longer than it needs: on a busy machine everything does."""
    end = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.01)


def calls(work: Callable[[], object]) -> int:
    """How many functions a work calls: its length, the same on every machine however busy."""
    found = 0

    def count(frame: object, event: str, argument: object) -> None:
        nonlocal found
        found += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        work()
    finally:
        sys.setprofile(before)
    return found


def some(cases: Iterable[Any], always: int, slow: int = 0) -> list[Any]:
    """Parameters of a test: so many of them, evenly spread, run always, so many more with `-m slow`, the others with
    `-m nightly`."""
    listed = list(cases)
    wanted = _spread(range(len(listed)), always + slow)
    ever = _spread(wanted, always)
    marks = {k: pytest.mark.slow if k in wanted else pytest.mark.nightly for k in range(len(listed)) if k not in ever}
    return [_marked(case, marks[k]) if k in marks else case for k, case in enumerate(listed)]


def _spread(places: Sequence[int], count: int) -> list[int]:
    """So many of the places, evenly spread."""
    return sorted({places[k * len(places) // count] for k in range(count)})


def _marked(case: Any, mark: pytest.MarkDecorator) -> Any:
    if isinstance(case, ParameterSet):
        return pytest.param(*case.values, marks=[*case.marks, mark], id=case.id)
    return pytest.param(*case if isinstance(case, tuple) else (case,), marks=mark)


def warehouse_bag(path: Path) -> None:
    """What a warehouse robot records in 20 seconds, with messages of its own: it is too fast between 0.5 and 1 m, and
    lifts as if its battery were full. The battery does not measure its charge, which is NaN."""
    import numpy
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, field in (("Clearance", "distance"), ("Command", "speed"), ("Lift", "force")):
        kind = f"warehouse_msgs/msg/{name}"
        store.register(get_types_from_msg(f"std_msgs/Header header\nfloat64 {field}\n", kind))
    made: Any = store.types
    topics = {
        "/clearance": "warehouse_msgs/msg/Clearance",
        "/battery": "sensor_msgs/msg/BatteryState",
        "/speed_limiter/command": "warehouse_msgs/msg/Command",
        "/lifter/force": "warehouse_msgs/msg/Lift",
    }
    empty = numpy.array([], dtype=numpy.float32)
    with Writer(path, version=9) as writer:
        opened = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in topics.items()}
        for k in range(400):
            sec, nanosec = divmod(10**9 + k * 50_000_000, 10**9)
            stamp = made["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
            header = made["std_msgs/msg/Header"](stamp=stamp, frame_id="base")
            distance = abs(10 - k % 20) / 4
            left = 1 - k / 800
            state = (24.0, 20.0, -2.0, math.nan, math.nan, 20.0, left, 2, 1, 2, True, empty, empty, "", "")
            values = ((distance,), state, (min(1.5, distance),), (0.0 if distance < 1 else 90.0,))
            for at, (topic, value) in enumerate(zip(topics, values, strict=True)):
                message = made[topics[topic]](header, *value)
                time = sec * 10**9 + nanosec + at * 1_000_000
                writer.write(opened[topic], time, store.serialize_cdr(message, topics[topic]))

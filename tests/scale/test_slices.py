"""A work sees its slice and nothing else, and its keys cover the slice."""

from __future__ import annotations

import dataclasses
import enum
import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.backend_kit.protocol import Limits
from avow.base.workspace import Workspace
from avow.language.terms import TRUE
from avow.pipeline.blobs import Garbled, decode, encode
from avow.pipeline.dispatch import request_of
from avow.pipeline.requests import Request, read_response, request_bytes, request_digest
from avow.pipeline.slices import MethodSlice
from avow.pipeline.work import Catalogue, Work, catalogue
from avow.pipeline.worker import Refused, keys_of
from avow.system.load import load_system

CONTRACT = """\
context {
  Light : {red, green};
  Speed : INTEGER;
}
node sensor {
  inputs( raw : INTEGER )
  outputs( speed : INTEGER )
  topics()
  assume known ( in.raw >= 0 )
  guarantee near "the speed is near" ( out.speed >= in.raw )
}
node light {
  inputs( speed : INTEGER )
  outputs( lamp : Light )
  topics()
  assume sane ( in.speed >= 0 )
  guarantee fast ( in.speed > 30 -> out.lamp == red )
  guarantee slow ( in.speed <= 30 -> out.lamp == green )
}
node other {
  inputs( lamp : Light )
  outputs( stop : BOOL )
  topics()
  guarantee stops ( out.stop <=> in.lamp == red )
}
"""
PLAN = """\
system: crossing
contract: system.rcl
environment: {in.raw: {assume: "in.raw >= 0", because: "a counter"}}
scenario:
  domains: {INTEGER: [0, 30, 31]}
nodes:
  light: {criticality: high, methods: [hoare: {program: models/light.imp}]}
  other: {criticality: low, methods: [hoare: {program: models/other.imp}]}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    root = tmp_path / "contracts" / "crossing"
    (root / "models").mkdir(parents=True)
    (root / "system.rcl").write_text(CONTRACT)
    (root / "plan.yaml").write_text(PLAN)
    (root / "models" / "light.imp").write_text("IF (speed > 30) THEN\n   lamp := red\nELSE\n   lamp := green\n")
    (root / "models" / "other.imp").write_text("IF (lamp == red) THEN\n   stop := TRUE\nELSE\n   stop := FALSE\n")
    return root


def listed(folder: Path) -> Catalogue:
    return catalogue(load_system(folder))


def works(folder: Path) -> list[Work]:
    return [work for work in listed(folder).works if work.cut is not None]


def request(work: Work, folder: Path) -> Request:
    return request_of(Workspace(folder.parent.parent), work, work.obligations, folder)


def test_what_no_slice_declares_is_not_sent(folder: Path) -> None:
    kinds = [dataclasses.make_dataclass("Stranger", []), dataclasses.make_dataclass("Not", [("body", object)])]
    for value in (kinds[0](), kinds[1](TRUE), enum.Enum("Builtin", ["A"]).A, {1}, b""):  # type: ignore[attr-defined]
        with pytest.raises(TypeError, match="is no data of a work"):
            encode(value, folder)


def test_a_slice_comes_back_as_it_was_sent_and_gives_the_same_keys(folder: Path) -> None:
    for work in works(folder):
        assert work.cut is not None
        sent = encode(work.cut(), folder)
        assert encode(decode(sent, folder), folder) == sent
        assert keys_of(decode(sent, folder)) == work.keys, work.method
        assert str(folder).encode() not in sent
        assert b"system.rcl" not in sent


SHIPPED = sorted(path.parent for path in Path("contracts").glob("*/plan.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("system", SHIPPED, ids=lambda path: path.name)
def test_what_is_sent_of_a_shipped_system_gives_the_same_keys(system: Path) -> None:
    """Also where a node feeds itself, and is told of by several methods."""
    place = system.absolute()
    for work in works(place):
        assert work.cut is not None
        assert keys_of(decode(encode(work.cut(), place), place)) == work.keys, work.method


_SHOWN = {
    *(("Clause", name) for name in ("sentence", "text", "position")),
    *(("Claim", name) for name in ("sentence", "formula", "severity", "clauses")),
    ("Port", "type_name"),
    ("Port", "unit"),  # the formulas' units are checked where the contract is loaded
    ("Literal", "unit"),
    ("EnumSort", "name"),
    *(("Plan", name) for name in ("system", "title")),
    *(("NodePlan", name) for name in ("criticality", "title")),
    ("Plan", "path"),
    ("EnvironmentInput", "taken_in"),
    ("MethodSlice", "node"),
    ("MethodSlice", "method"),
    ("Node", "relay"),  # how the graph was wired, which no engine of one node sees
}
"""What is only shown, or where the same fault is found in another way: no answer depends on it."""


def mutated(data: bytes) -> Iterator[tuple[tuple[str, str], bytes]]:
    """Every change of one text, number or truth value, with the class and the field that it is in."""
    said = json.loads(data)
    users: dict[int, set[tuple[str, str]]] = {}
    for entry in said["table"]:
        if isinstance(entry, dict):
            for name, value in entry.items():
                if type(value) is int:
                    users.setdefault(value, set()).add((entry[""], name))
    for number, entry in enumerate(said["table"]):
        if users.get(number, {("", "")}) <= _SHOWN:
            continue
        parts: dict[Any, Any] = entry if isinstance(entry, dict) else dict(enumerate(entry))
        kind = entry[""] if isinstance(entry, dict) else entry[0]
        for name, value in parts.items():
            if name in ("", 0) or not isinstance(value, str | bool):
                continue
            parts[name] = (not value) if isinstance(value, bool) else f"{value}1" if value.isdigit() else f"{value}~"
            changed: Any = parts if isinstance(entry, dict) else list(parts.values())
            table = [*said["table"][:number], changed, *said["table"][number + 1 :]]
            yield (kind, str(name)), json.dumps({**said, "table": table}).encode()
            parts[name] = value


def keys_or_refusal(data: bytes, folder: Path) -> Mapping[str, str] | None:
    try:
        return keys_of(decode(data, folder))
    except (Garbled, Refused):
        return None


def test_a_method_sees_of_the_other_guarantees_no_more_than_a_name_that_it_was_told(folder: Path) -> None:
    plan = (folder / "plan.yaml").read_text()
    (folder / "plan.yaml").write_text(plan.replace("light.imp}", "light.imp, guarantees: [fast]}"))
    work = next(w for w in works(folder) if w.engine == "hoare" and w.node == "light")
    assert work.cut is not None
    cut = work.cut()
    assert isinstance(cut, MethodSlice)
    assert [c.name for c in cut.system.contract.node("light").guarantees] == ["fast"]
    model = folder / "models" / "light.imp"
    model.write_text(model.read_text() + "// what is slow is green\n")
    named = next(w for w in works(folder) if w.engine == "hoare" and w.node == "light")
    assert named.cut is not None
    cut = named.cut()
    assert isinstance(cut, MethodSlice)
    assert [(c.name, c.formula == TRUE) for c in cut.system.contract.node("light").guarantees] == [
        ("fast", False),
        ("slow", True),
    ]
    (folder / "system.rcl").write_text(CONTRACT.replace("in.speed <= 30", "in.speed < 30"))
    assert next(w for w in works(folder) if w.engine == "hoare" and w.node == "light").keys == named.keys


def test_a_part_that_is_left_out_is_refused(folder: Path) -> None:
    for work in works(folder):
        assert work.cut is not None
        said = json.loads(encode(work.cut(), folder))
        for number, entry in enumerate(said["table"]):
            names = [n for n in entry if n] if isinstance(entry, dict) else []
            for name in names:
                less = {key: value for key, value in entry.items() if key != name}
                table = [*said["table"][:number], less, *said["table"][number + 1 :]]
                with pytest.raises(Garbled):
                    decode(json.dumps({**said, "table": table}).encode(), folder)


@pytest.mark.parametrize(
    ("edit", "asked_again"),
    [
        (("// nothing", "// nothing"), set()),
        (("guarantee slow ( in.speed <= 30", "guarantee slow ( in.speed <= 29"), {"light:sanity", "light:hoare"}),
        (("guarantee near", "// said\n  guarantee near"), set()),
        (("out.speed >= in.raw", "out.speed > in.raw"), {"sensor:sanity", "light:sanity"}),
        (("<=> in.lamp == red", "<=> in.lamp == green"), {"other:sanity", "other:hoare"}),
        (("  Speed : INTEGER;\n", ""), set()),
    ],
)
def test_an_edit_asks_again_what_sees_it(folder: Path, edit: tuple[str, str], asked_again: set[str]) -> None:
    before = {f"{w.node}:{w.method}": w.keys for w in works(folder)}
    (folder / "system.rcl").write_text((CONTRACT + "// nothing\n").replace(*edit))
    after = {f"{w.node}:{w.method}": w.keys for w in works(folder)}
    changed = {name for name, keys in after.items() if keys != before[name]}
    assert changed - {"system:compose"} == asked_again


_WATCHED = """
import sys
opened = []
sys.addaudithook(lambda event, a: opened.append(str(a[0])) if event in ("open", "os.listdir", "os.scandir") else None)
from pathlib import Path
from avow.pipeline.worker import answer
data = sys.stdin.buffer.read()
del opened[:]
said = answer(data)
assert not [path for path in opened if path.startswith(sys.argv[1])], opened
sys.stdout.buffer.write(said)
"""


@pytest.mark.slow
@pytest.mark.parametrize("engine", some(["sanity", "hoare", "compose"], 1))
def test_a_worker_reads_nothing_of_the_workspace(folder: Path, engine: str) -> None:
    work = next(w for w in works(folder) if w.engine == engine)
    asked = request_bytes(request(work, folder))
    contracts = str(folder.parent)
    done = subprocess.run([sys.executable, "-c", _WATCHED, contracts], input=asked, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    report = read_response(done.stdout, request_digest(asked)).report
    assert report is not None
    assert {o.obligation for o in report.outcomes} == set(work.keys)


def test_a_request_whose_keys_are_of_something_else_is_refused(folder: Path) -> None:
    from dataclasses import replace

    from avow.pipeline.worker import answer

    for work in works(folder):
        asked = request(work, folder)
        lying = replace(asked, keys=dict.fromkeys(asked.keys, "0" * 64), limits=Limits(seconds=5))
        said = read_response(answer(request_bytes(lying)), request_digest(request_bytes(lying)))
        assert said.report is None
        assert "not what its keys are of" in said.failure

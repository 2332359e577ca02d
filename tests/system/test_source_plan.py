"""`source`, `numbers` and `memory` of a node: what is wrong is told in one round, each with its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Diagnostic, Rejected
from avow.system import node_plan
from avow.system.faults import in_order
from avow.system.load import load_system
from avow.system.node_plan import never_read, parameters
from avow.system.plan import Numbers, Source

CONTRACT = """node watchdog { inputs( now : REAL, beat : BOOL, last : REAL, f : REAL --> REAL )
 outputs( stop : BOOL, last : REAL ) topics() guarantee g ( out.stop or not out.stop ) }"""


def load(folder: Path, node: str) -> Source | None:
    (folder / "src.py").write_text("class Watchdog: pass\n")
    (folder / "p.yaml").write_text("timeout: 0.5\n")
    (folder / "system.rcl").write_text(CONTRACT)
    (folder / "plan.yaml").write_text(f"nodes:\n  watchdog:\n{node}")
    return load_system(folder).plan.node("watchdog").source


def test_a_declaration(tmp_path: Path) -> None:
    found = load(
        tmp_path,
        "    source: {python: src.py, class: Watchdog, parameters: p.yaml}\n    memory: {last: self._last}\n",
    )
    assert found == Source("src.py", "Watchdog", "", "p.yaml", Numbers.FLOAT64, {"last": "_last"})


def test_every_fault_in_one_round(tmp_path: Path) -> None:
    with pytest.raises(Rejected) as caught:
        load(
            tmp_path,
            "    source: {python: nothing.py, class: Watchdog, parameters: ../p.yaml}\n"
            "    memory: {lost: self.a, f: self.b, last: self.b}\n",
        )
    absent = Diagnostic("HYPO101", "there is no file `nothing.py` in the system's folder")  # as a method finds it
    told = {(d.code, d.span.line if d.span else 0) for d in caught.value.diagnostics}
    assert {("PLAN107", 3), ("PLAN108", 3), ("PLAN106", 4), ("PLAN110", 4)} <= told
    assert [d.code for d in in_order([*caught.value.diagnostics, absent]) if "nothing.py" in d.message] == ["PLAN107"]
    text = " ".join(d.message for d in caught.value.diagnostics)
    assert "self.b stands there twice" in text
    assert "'lost' is no input of watchdog" in text
    assert "f is REAL --> REAL" in text


@pytest.mark.parametrize(
    ("node", "code", "words"),
    [
        ("    numbers: float64\n", "PLAN104", "'source' is missing"),
        ("    memory: {last: self.last}\n", "PLAN104", "'source' is missing"),
        ("    source: {python: src.py}\n", "PLAN104", "'class' is missing"),
        ("    source: {class: Watchdog}\n", "PLAN104", "'python' or 'cpp' is missing"),
        ("    source: {python: src.py, class: 'a b'}\n", "PLAN105", "class"),
        ("    source: {python: src.py, class: W}\n    numbers: float16\n", "PLAN105", "float16"),
        ("    source: {python: src.py, class: W}\n    memory: {last: last}\n", "PLAN105", "last"),
        ("    source: {python: src.py, class: W, parameter: p.yaml}\n", "PLAN103", "parameter"),
    ],
)
def test_faults(node: str, code: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(Rejected) as caught:
        load(tmp_path, node)
    assert any(d.code == code and words in d.message for d in caught.value.diagnostics), caught.value.diagnostics


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        ("[1, 2]\n", 1, 1),
        ("timeout: off\n", 1, 10),
        ("pid:\n  p: 1:30\n", 2, 6),
        ("1: a\n", 1, 1),
        ("/m:\n  ros__parameters: {t: off}\n/n:\n  ros__parameters: {t: off}\n", 4, 24),
        ("/m:\n  ros__parameters: {t: 1}\n", 1, 1),
        ("/n:\n  ros_parameters: {t: 1}\n", 2, 3),
        ("/n:\n  ros__parameters: {t: 1}\n  t: 2\n", 3, 3),
    ],
)
def test_parameters_that_are_no_plain_mapping(text: str, line: int, column: int, tmp_path: Path) -> None:
    """At the value in the parameter file."""
    (tmp_path / "p.yaml").write_text(text)
    _, faults = parameters(tmp_path, Source("src.py", "Watchdog", "", "p.yaml", Numbers.FLOAT64, {}), "/n")
    assert [(d.code, Path(d.span.file).name, d.span.line, d.span.column) for d in faults if d.span] == [
        ("PLAN130", "p.yaml", line, column)
    ]


@pytest.mark.parametrize("kind", ["", ", kind: rospy"])
@pytest.mark.parametrize(
    ("text", "lost"),
    [
        ("timeout: 0.5\n", []),
        ("timeout: 0.5\nlimt: 9\n", ["limt"]),
        ("n: {timeout: 9}\n", ["n"]),
        ("gains: {p: 1, q: 2}\n", ["q"]),
        ("elsewhere: 3\n", []),
    ],
)
def test_parameters_that_no_file_mentions(
    text: str, lost: list[str], kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[bytes] = []
    reader = node_plan.read_yaml
    monkeypatch.setattr(node_plan, "read_yaml", lambda data, file: (read.append(data), reader(data, file))[1])
    node = f"    source: {{python: src.py, class: Watchdog, parameters: p.yaml{kind}}}\n"
    load(tmp_path, node)
    (tmp_path / "src.py").write_text("class Watchdog:\n    USED = ('timeout', 'gains', 'p')\n")
    (tmp_path / "helper.py").write_text("def of(params):\n    return params['elsewhere']\n")
    (tmp_path / "p.yaml").write_text(text)
    plan = load_system(tmp_path).plan
    found = list(never_read(plan))
    assert list(never_read(plan)) == found
    assert len(read) <= 1, "a file that has not changed is read once"
    assert [d.message.rpartition("has ")[2] for d in found] == [f"`{name}`" for name in lost]
    assert {d.code for d in found} <= {"PLAN136"}
    assert not any(d.is_error for d in found)


def test_a_class_of_ros_2_declares_its_parameters(tmp_path: Path) -> None:
    load(tmp_path, "    source: {python: src.py, class: Watchdog, parameters: p.yaml, kind: rclpy}\n")
    assert not list(never_read(load_system(tmp_path).plan))

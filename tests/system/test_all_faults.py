"""One run tells every fault of contract, plan and YAML, each at its place, and nothing that only follows from one."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from click.testing import CliRunner
from helpers import some

from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.cli import command, main
from avow.pipeline.workload import survey
from avow.system.faults import without_followers
from avow.system.load import load_system

CONTRACT = """\
context { Mode : {heat, idle}; Low = 18; }

node thermometer {
  inputs( raw : REAL )
  outputs( temperature : REAL )
  topics( robot/Reading raw matches(in.raw), a/B temperature matches(out.temperature) )
  assume plausible ( -40 <= in.raw <= 85 )
  guarantee calibrated ( out.temperature == in.raw )
}

node thermostat {
  inputs( temperature : REAL )
  outputs( mode : Mode )
  topics( a/B temperature matches(in.temperature), a/B mode matches(out.mode) )
  assume in_range ( -50 <= in.temperature <= 100 )
  guarantee warms ( in.temperature < Low -> out.mode == heat )
}
"""
PLAN = """\
system: home
ros: {distro: noetic}
messages: [robot]
requirements:
  REQ1:
    text: A cold room is heated.
    formula: "thermometer.temperature < 18 -> thermostat.mode == heat"
    supported_by: [thermostat.warms]
  REQ2: {text: It is calibrated., supported_by: [thermometer.calibrated]}
environment:
  thermometer.raw: {assume: "-40 <= in.raw <= 85", because: the data sheet says so}
compose:
  D: {select: [thermometer, thermostat], rule: R1}
nodes:
  thermometer:
    criticality: low
    methods:
      - hypothesis: {subject: "read.py:read", cases: 50}
      - rosmonitoring: {traces: [run.jsonl], mapping: {in.raw: degrees, out.temperature: data}}
  thermostat:
    criticality: high
    methods:
      - hoare: {program: control.imp}
      - review: {record: review.yaml}
policy: default
"""
INPUTS = {
    "read.py": "def read(raw):\n    return {'temperature': raw}\n",
    "control.imp": "IF (temperature < 18) THEN\n   mode := heat\nELSE\n   mode := idle\n",
    "review.yaml": "format: 1\nnode: thermostat\nreviewer: A. Person\nrole: engineer\ndate: 2026-11-20\n"
    "read:\n  - {file: control.imp}\nchecklist:\n  - {question: Is it short, answer: yes}\nconclusion: accepted\n",
    "run.jsonl": '{"topic": "raw", "msg": {"degrees": 1.0}, "time": 1.0}\n',
    "robot/Reading.msg": "Header header\nfloat64 degrees\n",
    "robot.py": "import rclpy\n\n\nclass Robot(rclpy.node.Node):\n    pass\n",
}
"""What the methods read."""

FAULTS: dict[str, tuple[str, str, str, str]] = {
    # what is told → (file, text, text with the fault, code)
    "keyword as a name": ("system.rcl", "Low = 18;", "Low = 18; forall = 3;", "RCL"),
    "unknown port": ("system.rcl", "( out.temperature == in.raw )", "( out.temperatur == in.raw )", "RCL203"),
    "no term": ("system.rcl", "-50 <= in.temperature <= 100", "-50 <= in.temperature <= ", "RCL120"),
    "duplicate key": ("plan.yaml", "system: home", "system: home\nsystem: house", "PLAN102"),
    "unknown key": ("plan.yaml", "    supported_by: [thermostat.warms]", "    supports: [thermostat.warms]", "PLAN103"),
    "no such guarantee": ("plan.yaml", "[thermometer.calibrated]", "[thermometer.calibrates]", "PLAN106"),
    "no such guarantee of a method": ("plan.yaml", "cases: 50", "cases: 50, guarantees: [calibratd]", "PLAN106"),
    "no such node": ("plan.yaml", "[thermometer, thermostat]", "[thermometer, boiler]", "PLAN106"),
    "no such level": ("plan.yaml", "criticality: high", "criticality: huge", "PLAN105"),
    "no such distribution": ("plan.yaml", "distro: noetic", "distro: noetik", "PLAN105"),
    "no such kind": (
        "plan.yaml",
        "review.yaml}",
        "review.yaml}\n      - hypothesis\n    source: {python: robot.py, class: Robot, kind: ros2}",
        "PLAN105",
    ),
    "no such policy": ("plan.yaml", "policy: default", "policy: defalt", "POLICY001"),
    "no Python": ("read.py", "def read(raw):", "def read(raw:", "HYPO103"),
    "no program": ("control.imp", "THEN", "THAN", "HOARE100"),
    "no verdict of a review": ("review.yaml", "conclusion: accepted", "conclusion: maybe", "REV"),
    "wrong option": ("plan.yaml", "cases: 50", "cases: many", "PLAN105"),
    "wrong mapping": ("plan.yaml", "in.raw: degrees", "in.row: degrees", "MON101"),
    "no formula": ("plan.yaml", '"-40 <= in.raw <= 85"', '"-40 <= in.raw <="', "RCL120"),
}


def place(folder: Path, faults: list[str]) -> Path:
    texts = {"system.rcl": CONTRACT, "plan.yaml": PLAN, **INPUTS}
    for name in faults:
        file, good, bad, _ = FAULTS[name]
        assert good in texts[file]
        texts[file] = texts[file].replace(good, bad)
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in texts.items():
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).write_text(text)
    return folder


def check(folder: Path) -> list[tuple[str, str]]:
    done = CliRunner().invoke(command("check"), [str(folder), "--json"], standalone_mode=False)
    found = [d for d in json.loads(done.stdout)["diagnostics"] if d["severity"] == "error"]
    assert all(d["line"] for d in found)
    return sorted((Path(d["file"]).name, d["code"]) for d in found)


def surveyed(folder: Path) -> list[tuple[str, str]]:
    found = survey(folder)
    assert isinstance(found, Rejected)
    assert all(d.span for d in found.diagnostics)
    return sorted((Path(d.span.file).name, d.code) for d in found.diagnostics if d.span)


def expected(faults: list[str]) -> list[tuple[str, str]]:
    return sorted((FAULTS[name][0], FAULTS[name][3]) for name in faults)


def alike(found: list[tuple[str, str]], wanted: list[tuple[str, str]]) -> bool:
    return len(found) == len(wanted) and all(
        f[0] == w[0] and f[1].startswith(w[1]) for f, w in zip(found, wanted, strict=True)
    )


@pytest.mark.parametrize("ask", [check, surveyed])
def test_every_fault_is_told_in_one_round(ask: Callable[[Path], list[tuple[str, str]]], tmp_path: Path) -> None:
    found, wanted = ask(place(tmp_path, list(FAULTS))), expected(list(FAULTS))
    assert alike(found, wanted), (found, wanted)


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_alone_is_told_once(name: str, tmp_path: Path) -> None:
    found = check(place(tmp_path, [name]))
    assert alike(found, expected([name])), found


@pytest.mark.parametrize("others", ["latency: 3, because: measured", "latency: 3 ms, because: …"])
def test_the_rest_of_a_faulty_option_is_not_read_as_if_it_were_whole(others: str, tmp_path: Path) -> None:
    """Without `others`, an input's `initial` would have no effect."""
    mapping = "mapping: {in.raw: {field: degrees, initial: 1}, out.temperature: data}"
    answers = f"answers: {{by: call, others: {{{others}, jitter: 1 ms}}}}"
    plan = place(tmp_path, []) / "plan.yaml"
    plan.write_text(PLAN.replace("mapping: {in.raw: degrees, out.temperature: data}", f"{mapping}, {answers}"))
    assert check(tmp_path) == [("plan.yaml", "PLAN105")]


@pytest.mark.parametrize("seed", some(range(12), 6, slow=6))
def test_of_any_faults_all_are_told_and_nothing_else(seed: int, tmp_path: Path) -> None:
    chosen = Random(seed).sample(list(FAULTS), 4)
    found = check(place(tmp_path, chosen))
    assert alike(found, expected(chosen)), (chosen, found)


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("node thermostat {", "node thermo-stat {", "RCL113"),
        ("node thermostat {", "node thermometer {", "RCL219"),
        (CONTRACT, "", "RCL001"),
        ("Low = 18;", "Low = 18; // \udcff", "RCL004"),
    ],
)
def test_what_a_lost_declaration_takes_along_is_no_fault_of_the_plan(
    old: str, new: str, code: str, tmp_path: Path
) -> None:
    folder = place(tmp_path, [])
    (folder / "system.rcl").write_text(CONTRACT.replace(old, new), errors="surrogateescape")
    assert {told for _, told in check(folder)} == {code}


@pytest.mark.parametrize(
    ("inner", "support", "codes"),
    [
        ("out.y", "s_n.g", ["PLAN103"]),
        ("out.y", "s_n.typo", ["PLAN103", "PLAN106"]),
        ("out.yy", "s_n.g", ["PLAN103", "PLAN110", "RCL203"]),
    ],
)
def test_names_of_an_included_system_are_looked_up_beside_other_faults(
    inner: str, support: str, codes: list[str], tmp_path: Path
) -> None:
    plan = f"nods: 1\nsubsystems: {{s: {{system: ../in}}}}\nrequirements: {{R: {{text: t, supported_by: [{support}]}}}}"
    for folder, text, node, output in (("in", "{}", "n", inner), ("all", plan, "m", "out.y")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "plan.yaml").write_text(text)
        rcl = f"node {node} {{ inputs() outputs( y : BOOL ) topics() guarantee g ( {output} ) }}"
        (tmp_path / folder / "n.rcl").write_text(rcl)
    assert sorted(code for _, code in surveyed(tmp_path / "all")) == codes


@pytest.mark.parametrize("fault", ["out.sen", "out.seen or"])
def test_a_probability_that_cannot_be_read_is_not_missing(fault: str, tmp_path: Path) -> None:
    node = f"node n {{ inputs() outputs( seen : BOOL ) topics() guarantee g with probability >= 0.9 ( {fault} ) }}"
    (tmp_path / "n.rcl").write_text(node)
    requirement = "{text: t, formula: n.seen, probability: 0.8, supported_by: [n.g]}"
    (tmp_path / "plan.yaml").write_text(f"requirements: {{R: {requirement}}}\n")
    assert {code[:3] for _, code in surveyed(tmp_path)} == {"RCL"}


def test_without_faults_there_is_a_system(tmp_path: Path) -> None:
    assert load_system(place(tmp_path, [])).name == "home"
    assert check(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "hint"), [("system.rlc", "did you mean `system.rlc`?"), ("", "write one, or name it")]
)
def test_a_plan_without_a_contract_is_one_fault(name: str, hint: str, tmp_path: Path) -> None:
    """And not one for each name of the plan that it would declare."""
    folder = place(tmp_path, [])
    (folder / "system.rcl").rename(folder / (name or "a.txt"))
    assert check(folder) == [("plan.yaml", "PLAN107")]
    with pytest.raises(Rejected) as found:
        load_system(folder)
    assert [(d.code, hint in (d.hint or "")) for d in found.value.diagnostics] == [("PLAN107", True)]


@pytest.mark.parametrize(
    ("methods", "code", "hint"),
    [
        ("    source: {python: /x/y.py, class: A}\n    methods: [python]\n", "PLAN108", "a clone has all"),
        ("    methods: [{hoare: {program: gone/c.imp}}]\n", "HOARE400", "write it there, or correct the path"),
    ],
)
def test_a_program_that_is_elsewhere_is_one_fault(methods: str, code: str, hint: str, tmp_path: Path) -> None:
    folder = place(tmp_path, [])
    text, old = (folder / "plan.yaml").read_text(), "    methods:\n      - hoare: {program: control.imp}\n"
    assert old in text
    text = text.replace(old, methods).replace("      - review: {record: review.yaml}\n", "")
    (folder / "plan.yaml").write_text(text)
    printed = CliRunner().invoke(command("check"), [str(folder)]).output
    assert re.findall(r"error\[(\w+)\]", printed) == [code], printed
    assert hint in printed


def test_a_port_without_its_node_in_a_requirement_names_the_nodes_that_have_it(tmp_path: Path) -> None:
    folder = place(tmp_path, [])
    text = (folder / "plan.yaml").read_text()
    (folder / "plan.yaml").write_text(text.replace("thermometer.temperature <", "temperature <"))
    with pytest.raises(Rejected) as found:
        load_system(folder)
    (fault,) = found.value.diagnostics
    assert (fault.code, fault.hint) == ("RCL201", "write `thermometer.temperature` or `thermostat.temperature`")


def test_a_faulty_option_is_one_fault_and_no_warning_that_it_is_missing(tmp_path: Path) -> None:
    folder = place(tmp_path, [])
    text = (folder / "plan.yaml").read_text()
    (folder / "plan.yaml").write_text(
        text.replace("traces: [run.jsonl],", "traces: [run.jsonl], answers: {by: stamps},")
    )
    printed = CliRunner().invoke(command("check"), [str(folder)]).output
    assert "did you mean `stamp`?" in printed
    assert "cannot be monitored" not in printed


def test_a_plan_that_is_no_yaml_keeps_no_fault_of_the_contract_back(tmp_path: Path) -> None:
    folder = place(tmp_path, ["unknown port"])
    (folder / "plan.yaml").write_text(PLAN.replace("compose:", "compose:\n\t"))
    for ask in (check, surveyed):
        assert ask(folder) == [("plan.yaml", "PLAN101"), ("system.rcl", "RCL203")]
    text = "node n { inputs( a : REAL ) outputs( b : REAL ) topics( ) guarantee g ( out.b > 0 ) }"
    (folder / "system.rcl").write_text(text)  # no lint: the plan may have switched it off
    assert CliRunner().invoke(command("check"), [str(folder)]).output.endswith("1 file: 1 error\n")


@pytest.mark.parametrize(
    ("text", "said", "line"),
    [
        ("system: a\n\tb: c\n", "a tab stands where YAML wants spaces", 2),
        ("system: a: b\n", "a `:` stands where no key can be", 1),
        ("system: @home\n", "no plain text can begin with `@`", 1),
        ("system: [a, b\n", "the closing `]` is missing", 1),
        ("system: [a\nnodes: {}\n", "the closing `]` is missing", 1),
        ("nodes:\n  a\n  b: {}\n", "a `:` stands where no key can be", 3),
        ("nodes:\n  a:\n    b\n    c: {}\n  d: {}\n", "a `:` stands where no key can be", 4),
        ("system: a\nnodes\nros: {}\n", "a key without its `:`", 2),
        ("nodes:\n  a:\n    - b: {}\n     c: {}\n", "this line is indented as none above it", 4),
        ("nodes:\n  a:\n    b: {}\n    - c: {}\n", "this line begins no item of the list below", 3),
        ("nodes:\n  a: {b: }}\n", "a `}` closes no bracket", 2),
        ("nodes:\n     - a: {}\n    - b: {}\n", "this line is indented as none above it", 3),
        ('system: "home\n', 'begins with this " is closed only on a later line, or never', 1),
        ("nodes: {}\ntitle: 'home\nros: {}\n", "begins with this ' is closed only on a later line, or never", 2),
        ('title: "home\nros: {}\nsystem: "a"\n', 'begins with this " is closed only on a later line, or never', 1),
        ('ros: {a: "home}\nsystem: "a"\n', 'begins with this " is closed only on a later line, or never', 1),
        ('title: "on two\n  lines"\nsystem: [a\n', "the closing `]` is missing", 3),
        ("nodes:\n  a:b\n  c: {}\n", "a blank is missing after `a:`", 2),
        ("system: home\n nodes: {}\n", "a `:` stands where no key can be", 2),
        ("system: home\nnodes: [\n", "a quotation mark or a bracket is not closed", 3),
    ],
)
def test_what_is_no_yaml_is_told_in_words(text: str, said: str, line: int, tmp_path: Path) -> None:
    """Where it is: what is not ended, at its beginning; and where two lines disagree, the second names the first."""
    (tmp_path / "plan.yaml").write_text(text)
    with pytest.raises(Rejected) as found:
        load_system(tmp_path)
    (fault, *_) = found.value.diagnostics
    assert (fault.code, said in fault.message) == ("PLAN101", True), fault.message
    assert not re.search(r"token|scalar|flow|block|stream", fault.message)
    assert fault.span is not None
    assert fault.span.line == line
    assert "no key can be" not in fault.message or "the space after each `:`" in (fault.hint or "")
    assert "later line" not in fault.message or "close it" in (fault.hint or "")
    assert "indent" not in fault.message or "this line, or those above" in (fault.hint or "")


WIRED = """
node a { inputs( ) outputs( x : REAL ) topics( float64 t matches(out.x) ) guarantee g ( out.x >= 0 ) }
node b { inputs( y : REAL ) outputs( o : REAL ) topics( float32 t matches(in.y), float64 cmd matches(out.o) )
  guarantee g ( out.o >= in.y ) }
node c { inputs( ) outputs( p : REAL, q : REAL ) topics( float64 cmd matches(out.p), float64 cmd matches(out.q) )
  guarantee g ( out.p >= 0 and out.q >= 0 ) }
node d { inputs( v : REAL, u : REAL ) outputs( e : REAL )
  topics( float64 cmd matches(in.v), my/Speed /u matches(in.u) )
  guarantee g ( out.e >= in.v + in.u ) }
"""
WIRED_PLAN = """\
ros: {nodes: {e: {name: /e}, d: {remap: {cmd: "bad name"}}}}
connections: [{from: a.x, to: d.u}]
messages: [my]
"""


def test_wrong_types_remaps_and_publishers_are_told_by_check_in_one_round(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "my").mkdir()
    (tmp_path / "my/Sped.msg").write_text("float64 v\nfloat64\n", encoding="utf-8")
    (tmp_path / "system.rcl").write_text(WIRED, encoding="utf-8")
    (tmp_path / "plan.yaml").write_text(WIRED_PLAN, encoding="utf-8")
    with pytest.raises(SystemExit, match="2"):
        main(["check", str(tmp_path)])
    output = capsys.readouterr().out
    told = {
        code for code in ("PLAN105", "PLAN106", "ROS101", "ROS111", "ROS112", "ROS115") if f"error[{code}]" in output
    }
    assert told == {"PLAN105", "PLAN106", "ROS101", "ROS111", "ROS112", "ROS115"}


@pytest.mark.parametrize(
    ("cause", "follower", "kept"),
    [
        (("ROS101", "a/B: a .srv has 2 parts"), ("MON101", "nothing defines the messages a/B_Request of x"), False),
        (("ROS101", "a/B: a .srv has 2 parts"), ("MON101", "nothing defines the messages a/C of x"), True),
        (("ROS101", "a/B: a .srv has 2 parts"), ("MON101", "a/B has no field x"), True),
        (("ROS111", "/t is a/Bb at n, and a/B at m"), ("DRIVE101", "nothing defines a/Bb"), False),
        (("DRIVE101", "neither `messages` nor the distribution has the package a, of a/B"), ("DRIVE107", "a/C"), False),
        (("PLAN105", "ros.distro: 'humbel' is not one of"), ("DRIVE101", "neither `messages` nor a/B"), False),
        (("PLAN105", "answers.by: 'stmp' is not one of"), ("DRIVE101", "neither `messages` nor a/B"), True),
    ],
)
def test_what_a_faulty_definition_takes_along_is_one_error(
    cause: tuple[str, str], follower: tuple[str, str], kept: bool
) -> None:
    first, second = Diagnostic(*cause, severity=Severity.WARNING), Diagnostic(*follower)
    found = without_followers([second, first])
    assert found == ((second, first) if kept else (replace(first, severity=Severity.ERROR),))


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("my/Sped", ""),
        ("my/Speed", "nothing defines my/Speed"),
        ("my/Gear", "nothing defines my/Gear"),
        ("mine/Sped", "the package mine"),
        ("std_srvs/SetBool", "which part of a call"),
    ],
)
def test_types_that_nothing_defines(tmp_path: Path, kind: str, message: str) -> None:
    from avow.pipeline.plan_check import of_plan

    (tmp_path / "my").mkdir()
    (tmp_path / "my/Sped.msg").write_text("float64 v\n", encoding="utf-8")
    text = f"node a {{ inputs( ) outputs( x : REAL ) topics( {kind} t matches(out.x), {kind} u ) guarantee g (TRUE) }}"
    (tmp_path / "system.rcl").write_text(text, encoding="utf-8")
    (tmp_path / "plan.yaml").write_text("messages: [my]", encoding="utf-8")
    found = [d for d in of_plan(load_system(tmp_path)) if d.code == "ROS104"]
    twice = (
        1 if kind.startswith("mine/") else 2
    )  # a missing package is one warning, and a missing type one for each topic
    assert [message in d.message for d in found] == ([True] * twice if message else [])
    assert all("under `messages`" in str(d.hint) for d in found if "part of a call" not in message)
    meant = {"my/Speed": "did you mean `my/Sped`?", "my/Gear": "known: Sped", "mine/Sped": "did you mean `my/Sped`?"}
    assert all(meant.get(kind, "") in str(d.hint) for d in found)


def test_a_wrong_type_within_a_message_is_told_at_its_line(tmp_path: Path) -> None:
    """A word that is no type of ROS is an error, without followers; a type that nothing defines is a warning."""
    from avow.pipeline.plan_check import of_plan

    file = tmp_path / "my" / "Speed.msg"
    file.parent.mkdir()
    text = "node a { inputs( ) outputs( x : REAL ) topics( my/Speed t matches(out.x) ) guarantee g (TRUE) }"
    (tmp_path / "system.rcl").write_text(text, encoding="utf-8")
    (tmp_path / "plan.yaml").write_text("messages: [my]", encoding="utf-8")
    for line, code, hint in (
        ("float46 v", "ROS101", "did you mean `float64`?"),
        ("std_msgs/Boul v", "ROS104", "did you mean `std_msgs/Bool`?"),
        ("Twist[] v", "ROS104", "under `messages`"),
    ):
        file.write_text(f"# a speed\n{line}\n", encoding="utf-8")
        (found,) = of_plan(load_system(tmp_path))
        assert (found.code, found.is_error, hint in (found.hint or "")) == (code, code == "ROS101", True), found
        assert found.span is not None
        assert (found.span.file, found.span.line) == (str(file), 2)


def test_a_folder_of_messages_with_a_slip_in_its_name_is_told(tmp_path: Path) -> None:
    from avow.pipeline.plan_check import of_plan

    (tmp_path / "msg" / "rover_msg").mkdir(parents=True)
    (tmp_path / "msg" / "rover_msg" / "Zone.msg").write_text("uint8 zone\n", encoding="utf-8")
    text = "node a { inputs( ) outputs( x : REAL ) topics( rover_msgs/Zone t matches(out.x) ) guarantee g (TRUE) }"
    (tmp_path / "system.rcl").write_text(text, encoding="utf-8")
    (tmp_path / "plan.yaml").write_text("messages: [msg]\nros: {distro: humble}", encoding="utf-8")
    (found,) = (d for d in of_plan(load_system(tmp_path)) if d.code == "ROS104")
    assert "did you mean `rover_msg/Zone`?" in str(found.hint)
    assert not found.is_error
    (tmp_path / "n.py").write_text("class N: pass\n", encoding="utf-8")
    for ros in ("", "ros: {distro: humble}\n"):  # a driven class cannot run without its types
        source = "nodes: {a: {source: {python: n.py, class: N, kind: rclpy}}}"
        (tmp_path / "plan.yaml").write_text(ros + source, encoding="utf-8")
        (found,) = (d for d in of_plan(load_system(tmp_path)) if d.code == "DRIVE101")
        assert found.is_error
        assert "under `messages`" in str(found.hint)


@pytest.mark.parametrize(
    ("file", "good", "bad", "shown"),
    [
        ("plan.yaml", "cases: 50", "case: 50", "case"),
        ("plan.yaml", "in.raw: degrees", "in.row: degrees", "in.row"),
        ("plan.yaml", "- hoare:", "- hoar:", "hoar"),
        ("plan.yaml", "policy: default", "policy: {guarantee: {}}", "guarantee"),
        ("plan.yaml", '"thermometer.temperature', '"thermometer.temperatur', "thermometer.temperatur"),
        ("plan.yaml", "t.raw}", "t.rw}", "t.rw"),
        ("t.csv", "1,low", "x,low", "x,low"),
        ("t.csv", "1,low", "1", "1"),
    ],
)
def test_the_caret_is_under_what_is_wrong(file: str, good: str, bad: str, shown: str, tmp_path: Path) -> None:
    """A key, the text within quotation marks, the line of a table; one fault, and none that follows from it."""
    folder = place(tmp_path, [])
    plan = folder / "plan.yaml"
    plan.write_text(plan.read_text() + "scenario:\n  t: t.csv\n  domains: {in.raw: t.raw}\n")
    (folder / "t.csv").write_text("raw,name\n1,low\n")
    text = (folder / file).read_text()
    assert good in text
    (folder / file).write_text(text.replace(good, bad))
    done = CliRunner().invoke(command("check"), [str(folder), "--json"], standalone_mode=False)
    (found,) = (d for d in json.loads(done.stdout)["diagnostics"] if d["severity"] == "error")
    line = (folder / file).read_text().splitlines()[found["line"] - 1]
    end = found["end_column"] - 1 if found["end_line"] == found["line"] else None
    assert line[found["column"] - 1 : end] == shown

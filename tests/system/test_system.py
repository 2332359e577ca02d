"""Graphs, names, temporal properties and ROS graphs: from a plan and a contract to a system."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from avow.base.codes import sections
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.graphs import components, cycles_in
from avow.pipeline.plan_check import of_plan
from avow.system.graph import dataflow
from avow.system.load import load_bare, load_path, load_system
from avow.system.plan import Endpoint, System
from avow.system.rosgraph import account, read_ros_graph
from avow.system.temporal import Operator, State, Temporal, parse_property, show_property

ROOT = Path(__file__).parents[2]


def node(name: str, inputs: str = "", outputs: str = "", guarantee: str = "TRUE") -> str:
    return f"node {name} {{ inputs( {inputs} ) outputs( {outputs} ) topics() guarantee g1 ( {guarantee} ) }}\n"


A = node("a", "r : REAL", "x : REAL")
B = node("b", "x : REAL", "y : REAL")


def make(folder: Path, rcl: str, plan: str = "{}") -> System:
    folder.mkdir(exist_ok=True)
    (folder / "system.rcl").write_text(rcl)
    (folder / "plan.yaml").write_text(plan)
    return load_system(folder)


def faults(folder: Path, rcl: str, plan: str) -> tuple[Diagnostic, ...]:
    with pytest.raises(Rejected) as rejected:
        make(folder, rcl, plan)
    return rejected.value.diagnostics


# -- loading -----------------------------------------------------------------------------------------------------------


def test_a_plan_is_loaded_with_its_contract(tmp_path: Path) -> None:
    system = make(tmp_path, A + B, "nodes: {a: {methods: [review, {hoare: {guarantees: [g1]}}]}}")
    assert system.name == re.sub(r"\W", "_", tmp_path.name)
    assert [method.guarantees for method in system.plan.node("a").methods] == [("g1",), ("g1",)]
    assert system.plan.node("b").criticality == "medium"


def test_without_a_plan_names_link(tmp_path: Path) -> None:
    (tmp_path / "one.rcl").write_text(A)
    (tmp_path / "two.rcl").write_text(B)
    for system in (load_bare([tmp_path / "one.rcl", tmp_path / "two.rcl"]), load_system(tmp_path), load_path(tmp_path)):
        assert [str(edge) for edge in dataflow(system).edges] == ["a.x → b.x"]


@pytest.mark.parametrize("name", ["nowhere", "empty"])
def test_a_folder_without_a_system(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(Rejected) as rejected:
        load_system(tmp_path / name)
    assert [d.code for d in rejected.value.diagnostics] == ["PLAN100"]


def test_faults_of_plan_and_contract_come_together(tmp_path: Path) -> None:
    found = faults(tmp_path, A.replace("REAL", "REEL"), "connections: [{from: a.x, to: a.r, initial: 3}]")
    assert {d.code[:3] for d in found} == {"PLA", "RCL"}


@pytest.mark.parametrize(
    ("plan", "code", "line", "words", "hint"),
    [
        ("connections: [{from: a.z, to: b.x}]", "PLAN106", 1, "a.z", "`a.x`"),
        ("connections: [{from: c.x, to: b.x}]", "PLAN106", 1, "'c'", "known: a, b"),
        ("connections: [{from: b.x, to: b.x}]", "PLAN106", 1, "output 'b.x'", "b.y"),
        ("environment: {in.rr: {because: x}}", "PLAN106", 1, "in.rr", "`in.r`"),
        ("environment: {b.x: {because: x}}", "PLAN113", 1, "a.x provides it", ""),
        ("environment:\n  in.r: {assume: in.r > q, because: x}", "RCL201", 2, "q", ""),
        ("environment: {in.r: {assume: out.x > 1, because: x}}", "PLAN113", 1, "out.x", "no node provides"),
        ("requirements: {R: {text: t, supported_by: [a.g2]}}", "PLAN106", 1, "a.g2", "a.g1"),
        ("requirements: {R: {text: t, supported_by: [aa.g1]}}", "PLAN106", 1, "aa.g1", "`a.g1`"),
        ("requirements: {R: {text: t, formula: a.q > 1}}", "RCL203", 1, "q", ""),
        (
            "requirements: {R: {text: t, temporal: always b.y > 1) until (b.y > 2}}",
            "RCL120",
            1,
            "this `)` closes nothing",
            "",
        ),
        ("compose: {D: {select: [a, bb]}}", "PLAN106", 1, "'bb'", "`b`"),
        ("compose: {D: {select: [a, a]}}", "PLAN105", 1, "twice", ""),
        ("nodes: {aa: {}}", "PLAN106", 1, "'aa'", "`a`"),
        ("nodes:\n  a:\n    methods: [{hoare: {guarantees: [g9]}}]", "PLAN106", 3, "g9", "g1"),
        ("nodes: {a: {methods: [{hoare: {id: x}}, {dafny: {id: x}}]}}", "PLAN110", 1, "used twice", ""),
        ("model: {compound: {navi: [x]}}", "PLAN106", 1, "navi", ""),
        ("scenario: {t: [{v: 1}], interpret: {in.r: t(v)}}", "PLAN109", 1, "function or relation", "domains"),
        ("scenario: {domains: {in.r: [1, 1/3, blue]}}", "PLAN109", 1, "'blue' is no value of REAL", ""),
        ("scenario: {domains: {in.r: [1e400000000]}}", "PLAN109", 1, "'1e400000000' is no value of REAL", ""),
        ("scenario: {domains: {NATURAL: [0, -1]}}", "PLAN109", 1, "it is negative", ""),
        ("scenario: {domains: {INTEGER: [-1, 1.5]}}", "PLAN109", 1, "it is not whole", ""),
        ("scenario: {domains: {in.r: 0..100000000000}}", "PLAN109", 1, "more than 100000 values", ""),
        ("scenario: {domains: {REALS: 1}}", "PLAN106", 1, "REALS", "`REAL`"),
        ("expected: [{obligation: c/sanity/x, verdict: refuted}]", "PLAN106", 1, "'c'", "a, b, system"),
        ("expected: [{obligation: a.g1, verdict: refuted}]", "PLAN106", 1, "a.g1", "a/guarantee/g1"),
        ("expected: [{obligation: a/guarantee/g11, verdict: refuted}]", "PLAN106", 1, "g11", "a/guarantee/g1"),
        ("expected: [{obligation: a/guarante/g1, verdict: refuted}]", "PLAN106", 1, "guarante/", "a/guarantee/g1"),
        ("expected: [{obligation: system/requirement/R, verdict: refuted}]", "PLAN106", 1, "requirement/R", ""),
        ("connections: [{from: a.x, to: b.x, delayed: true, initial: blue}]", "PLAN112", 1, "blue", ""),
        ("connections: [{from: a.x, to: b.x, delayed: true, initial: out.x > in.q}]", "PLAN112", 1, "is no value", ""),
        ("connections: [{from: a.x, to: b.x, delayed: true, initial: out.x > in.r}]", "PLAN112", 1, "of in.r", ""),
    ],
)
def test_names_and_formulas_of_a_plan(tmp_path: Path, plan: str, code: str, line: int, words: str, hint: str) -> None:
    found = faults(tmp_path, A + B, plan)
    match = [d for d in found if d.code == code and words in d.message]
    assert match, found
    assert match[0].span is not None
    assert match[0].span.line == line
    assert Path(match[0].span.file).name == "plan.yaml"
    assert hint in (match[0].hint or "")


@pytest.mark.parametrize(("sort", "initial", "hint"), [("BOOL", "0", "`false`"), ("Mode", "idel", "`idle`")])
def test_an_initial_value_of_another_type(tmp_path: Path, sort: str, initial: str, hint: str) -> None:
    rcl = "context { Mode : {idle, busy}; }" + node("a", "", f"x : {sort}") + node("b", f"x : {sort}", "y : REAL")
    plan = f"connections: [{{from: a.x, to: b.x, delayed: true, initial: {initial}}}]"
    (found,) = [d for d in faults(tmp_path, rcl, plan) if d.code == "PLAN112"]
    assert hint in (found.hint or "")


def test_units_of_links_and_formulas(tmp_path: Path) -> None:
    rcl = """
node a { inputs( t : REAL in s ) outputs( x : REAL in m, y : REAL ) topics() guarantee ( x > 0 and y > t ) }
node b { inputs( x : REAL in m/s, y, z : REAL in m ) outputs( o : BOOL ) topics() guarantee ( o <=> x > 0 or y > z ) }
"""
    plan = """
environment: {b.z: {assume: in.z > 0, because: x}, in.t: {assume: in.t > 3, because: x}}
requirements:
  R: {text: a, formula: "a.x > b.z", supported_by: [a]}
  S: {text: a, formula: "a.t > b.z", supported_by: [a]}
"""
    assert sorted(d.message for d in faults(tmp_path, rcl, plan) if d.code == "PLAN140") == [
        "a.x is in m, and b.x, which it feeds, in m/s",
        "requirements.S: `a.in.t` is in s and `b.in.z` is in m",
    ]
    assert make(tmp_path, rcl.replace("m/s", "m"), plan.replace("a.t >", "a.y >"))


def test_units_of_a_topic_with_several_publishers(tmp_path: Path) -> None:
    node = "node {} {{ inputs() outputs( x : REAL in {} ) topics( float64 t matches(out.x) ) guarantee ( x > 0 ) }}\n"
    hears = "inputs( x : REAL in m ) outputs( o : BOOL ) topics( float64 t matches(in.x) ) guarantee ( o <=> x > 0 ) }"
    rcl = node.format("a", "m") + node.format("b", "{}") + "node c { " + hears
    (found,) = faults(tmp_path, rcl.replace("{}", "s"), "{}")
    assert (found.code, found.message) == ("PLAN140", "b.x is in s, and topic_t.b_x, which it feeds, in m")
    assert make(tmp_path, rcl.replace("{}", "m"), "{}")


def test_every_code_is_declared_and_triggered() -> None:
    sources = [*(ROOT / "avow/system").glob("*.py"), *(ROOT / "avow/calculus").glob("*.py")]
    used = {code for path in sources for code in re.findall(r"PLAN\d{3}", path.read_text())}
    declared = sections()["Plans and systems"]
    assert used == set(declared)
    tests = "".join(
        path.read_text() for folder in ("system", "calculus") for path in (ROOT / "tests" / folder).glob("*.py")
    )
    indirectly = {"PLAN101", "PLAN102", "PLAN103", "PLAN104", "PLAN105", "PLAN107"}  # by their words, in test_plan_yaml
    assert {code for code in declared if code not in tests} <= indirectly | {"PLAN126"}


def test_no_proof_may_use_a_guarantee_with_a_probability(tmp_path: Path) -> None:
    rcl = "node n { inputs( p : BOOL ) outputs( d : BOOL ) topics()\n guarantee g with probability >= 0.9 ( out.d ) }"
    argued, proved = "R: {text: t, supported_by: [n.g]}", "R: {text: t, formula: n.d, supported_by: [n.g]}"
    make(tmp_path, rcl, f"requirements: {{{argued}}}")
    (found,) = faults(tmp_path, rcl, f"requirements: {{{proved}}}")
    assert (found.code, found.span and found.span.column) == ("PLAN141", proved.index("n.g") + 16)


# -- graphs ------------------------------------------------------------------------------------------------------------


def test_the_graph(tmp_path: Path) -> None:
    graph = dataflow(make(tmp_path, A + B))
    assert graph.environment == (Endpoint("a", "r"),)
    assert graph.dangling == (Endpoint("b", "y"),)
    assert graph.providers("b") == ("a",)
    assert not graph.deadlocks


def test_a_connection_renames_and_takes_the_inputs_place(tmp_path: Path) -> None:
    text = A + node("c", "", "x2 : REAL") + B
    graph = dataflow(make(tmp_path, text, "connections: [{from: c.x2, to: b.x}]"))
    assert [str(edge) for edge in graph.edges] == ["c.x2 → b.x"]


def test_several_providers_need_a_choice(tmp_path: Path) -> None:
    text = A + node("c", "", "x : REAL") + B
    (fault,) = faults(tmp_path / "two", text, "{}")
    assert fault.code == "PLAN122"
    assert "a.x, c.x" in fault.message
    graph = dataflow(make(tmp_path / "chosen", text, "connections: [{from: c.x, to: b.x}]"))
    assert [str(edge) for edge in graph.edges] == ["c.x → b.x"]
    (fault,) = faults(tmp_path / "both", text, "connections: [{from: c.x, to: b.x}, {from: a.x, to: b.x}]")
    assert fault.code == "PLAN122"


def test_types_clash(tmp_path: Path) -> None:
    text = A + node("b", "x : INTEGER", "y : REAL")
    graph = dataflow(make(tmp_path / "names", text))
    assert [finding.code for finding in graph.findings] == ["PLAN121"]
    assert Endpoint("b", "x") in graph.environment
    (fault,) = faults(tmp_path / "declared", text, "connections: [{from: a.x, to: b.x}]")
    assert fault.code == "PLAN121"


def test_naturals_fit_integers_and_not_the_other_way(tmp_path: Path) -> None:
    fits = node("a", "", "x : NATURAL") + node("b", "x : INTEGER", "")
    assert len(dataflow(make(tmp_path / "fits", fits)).edges) == 1
    not_ = node("a", "", "x : INTEGER") + node("b", "x : NATURAL", "")
    assert not dataflow(make(tmp_path / "not", not_)).edges


def test_a_node_feeds_itself_only_by_a_connection(tmp_path: Path) -> None:
    text = node("a", "x : REAL", "x : REAL")
    graph = dataflow(make(tmp_path / "names", text))
    assert not graph.edges
    assert [finding.code for finding in graph.findings] == ["PLAN124"]
    graph = dataflow(make(tmp_path / "memory", text, "connections: [{from: a.x, to: a.x, delayed: true, initial: 0}]"))
    assert [str(edge) for edge in graph.edges] == ["a.x → a.x (delayed)"]
    assert not graph.findings


LOOP = node("a", "y : REAL", "x : REAL") + node("b", "x : REAL", "y : REAL")


@pytest.mark.parametrize(
    ("plan", "deadlocks"),
    [
        ("{}", 1),
        ("connections: [{from: b.y, to: a.y, delayed: true}]", 1),
        ("connections: [{from: b.y, to: a.y, delayed: true, initial: 0}]", 0),
    ],
)
def test_start_up_deadlock(tmp_path: Path, plan: str, deadlocks: int) -> None:
    system = make(tmp_path, LOOP, plan)
    graph = dataflow(system)
    assert len(graph.deadlocks) == deadlocks
    assert [finding.code for finding in graph.findings] == ["PLAN123"] * deadlocks
    assert [d.code for d in of_plan(system)] == ["PLAN123"] * deadlocks


def test_a_method_that_nobody_knows_has_its_place_and_the_nearest_name(tmp_path: Path) -> None:
    plan = "nodes: {a: {methods: [{hypotesis: {}}]}}"
    (found,) = (d for d in of_plan(make(tmp_path, A + B, plan)) if d.is_error)
    assert (found.code, found.hint, found.span and found.span.column) == (
        "BACKEND002",
        "did you mean `hypothesis`?",
        plan.index("hypotesis") + 1,
    )


def test_one_output_has_one_first_value(tmp_path: Path) -> None:
    text = A + B + node("c", "x : REAL", "")
    plan = """connections:
  - {from: a.x, to: b.x, delayed: true, initial: 0}
  - {from: a.x, to: c.x, delayed: true, initial: 1}
"""
    (fault,) = faults(tmp_path, text, plan)
    assert fault.code == "PLAN112"
    assert "more than one initial value" in fault.message


def test_components_and_cycles() -> None:
    arcs = [("a", "b"), ("b", "c"), ("c", "b"), ("c", "d"), ("d", "d")]
    assert components("abcd", arcs) == (("a",), ("b", "c"), ("d",))
    assert cycles_in(("b", "c"), arcs) == (("b", "c"),)
    assert cycles_in(("d",), arcs) == (("d",),)
    deep = [(k, k + 1) for k in range(20_000)]
    assert len(components(range(20_001), deep)) == 20_001


# -- temporal properties -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("eventually (b.y > 1 or a.x == 0)", "eventually (b.y > 1 or a.x == 0)"),
        ("((eventually ((b.y > 1))))", "eventually (b.y > 1)"),
        ("always b.y > 1 -> eventually a.x == 0", "(always (b.y > 1)) -> (eventually (a.x == 0))"),
        ("b.y > 1 until a.x == 0 and always b.y > 2", "((b.y > 1) until (a.x == 0)) and (always (b.y > 2))"),
        ("not eventually always b.y > 1", "not (eventually (always (b.y > 1)))"),
        ("always (b.y > 1 -> next (b.y > 2 until b.y > 3))", None),
        ("b.y > 1 until b.y > 2 until b.y > 3", "(b.y > 1) until ((b.y > 2) until (b.y > 3))"),
    ],
)
def test_properties(tmp_path: Path, text: str, shown: str | None) -> None:
    contract = make(tmp_path, A + B).contract
    found = parse_property(text, contract)
    if shown is not None:
        assert show_property(found) == shown
    again = parse_property(show_property(found), contract)
    assert show_property(again) == show_property(found)


def test_words_that_only_look_like_operators(tmp_path: Path) -> None:
    text = "context { T : {next, eventually, always}; }\n" + node("a", "", "t : T, next : BOOL")
    contract = make(tmp_path, text).contract
    assert isinstance(parse_property("a.t == next", contract), State)
    found = parse_property("next a.next", contract)
    assert isinstance(found, Temporal)
    assert found.operator is Operator.NEXT
    assert isinstance(parse_property("a.t == always and a.t in {next, always}", contract), State)
    found = parse_property("eventually a.next and a.t == next", contract)  # what comes later is no part of it
    assert show_property(found) == "(eventually a.next) and (a.t == next)"


def test_every_fault_of_a_property_is_told_at_its_place(tmp_path: Path) -> None:
    contract = make(tmp_path, A + B).contract
    with pytest.raises(Rejected) as told:
        parse_property(
            "always b.q > 1 and eventually forall(i in NATURAL | next b.y > i)", contract, Span("p", 3, 10, 3, 9)
        )
    found = [(d.code, d.span and (d.span.line, d.span.column)) for d in told.value.diagnostics]
    assert found == [("RCL203", (3, 17)), ("PLAN114", (3, 40))]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "always",
        "always (b.y > 1",
        "forall(i in NATURAL | eventually b.y > i)",
        "b.y > 1) until (a.x > 0",
        "b.q > 1 until b.y > 2",
        "always " * 500 + "b.y > 1",
        "b.y > 1 -> " * 500 + "always b.y > 1",
    ],
)
def test_what_is_no_property(tmp_path: Path, text: str) -> None:
    contract = make(tmp_path, A + B).contract
    with pytest.raises(Rejected):
        parse_property(text, contract)


def test_the_output_is_meant_where_both_exist(tmp_path: Path) -> None:
    contract = make(tmp_path, node("a", "x : REAL", "x : REAL")).contract
    found = parse_property("always a.x > 1", contract)
    assert isinstance(found, Temporal)
    (state,) = found.parts
    assert isinstance(state, State)
    assert "out" in repr(state.term)
    with pytest.raises(Rejected):
        parse_property("always a.x > a.in.x", contract)


# -- ROS graphs --------------------------------------------------------------------------------------------------------

DOT = """digraph graphname {
  graph [bb="0,0,1,1"]; node [label="\\N"];
  n___talker [label="/talker", shape=ellipse]; n___listener [label="/listener", shape=ellipse];
  n___rviz [label="/rviz"];
  t___chatter [label="/chatter", shape=box];  // a topic
  n___talker -> t___chatter -> n___listener; t___chatter -> n___rviz;
}
"""
INFO = """/talker
  Subscribers:
    /clock: rosgraph_msgs/msg/Clock
  Publishers:
    /chatter: std_msgs/msg/String
  Service Servers:
    /talker/describe_parameters: rcl_interfaces/srv/DescribeParameters
/listener
  Subscribers:
    /chatter: std_msgs/msg/String
/rviz
  Subscribers:
    /chatter: std_msgs/msg/String
"""
INFO1 = """--------------------------------------------------------------------------------
Node [/talker]
Publications:
 * /chatter [std_msgs/String]

Subscriptions: None

Node [/listener]
Publications: None
Subscriptions:
 * /chatter [std_msgs/String]
Node [/rviz]
Subscriptions:
 * /chatter [std_msgs/String]
"""
LINES = "# by hand\n/talker -> /listener : /chatter\ntalker -> rviz : /chatter\n"


@pytest.mark.parametrize("text", [DOT, INFO, INFO1, LINES])
def test_ros_graphs(tmp_path: Path, text: str) -> None:
    (tmp_path / "graph").write_text(text)
    graph = read_ros_graph(tmp_path / "graph")
    assert set(graph.nodes) == {"talker", "listener", "rviz"}
    assert set(graph.arcs) == {("talker", "listener", "/chatter"), ("talker", "rviz", "/chatter")}


def test_what_is_no_ros_graph(tmp_path: Path) -> None:
    (tmp_path / "graph").write_text("once upon a time\n")
    with pytest.raises(Rejected) as rejected:
        read_ros_graph(tmp_path / "graph")
    assert rejected.value.diagnostics[0].code == "PLAN127"


def test_every_ros_node_is_accounted_for(tmp_path: Path) -> None:
    (tmp_path / "graph.dot").write_text(DOT)
    text = node("a", "", "x : REAL") + node("b", "x : REAL", "") + node("brain", "", "z : REAL")
    plan = """model:
  graph: graph.dot
  dropped: {%s: display only}
  compound: {a: [talker], b: [listener]}
  external: {brain: a program}
"""
    good = make(tmp_path, text, plan % "rviz")
    told = account(good, dataflow(good))
    assert told is not None
    assert told.findings == ()
    assert told.home == {"talker": "a", "listener": "b"}
    bad = make(
        tmp_path, text, plan.replace("listener", "listner").replace("  external: {brain: a program}\n", "") % "rviz"
    )
    told = account(bad, dataflow(bad))
    assert told is not None
    messages = " / ".join(finding.message for finding in told.findings)
    assert "'listner' is not on the ROS graph" in messages
    assert "nor part of a node of the model: listener" in messages
    assert "brain is not on the ROS graph" in messages
    unlinked = make(
        tmp_path, node("a", "", "q : REAL") + node("b", "x : REAL", "") + node("brain", "", "z : REAL"), plan % "rviz"
    )
    told = account(unlinked, dataflow(unlinked))
    assert told is not None
    assert "ROS sends /chatter from a to b; the contracts connect nothing there" in [f.message for f in told.findings]
    (tmp_path / "graph.dot").write_text("talker -> listener : /parameter_events\ntalker -> rviz : /chatter\n")
    told = account(unlinked, dataflow(unlinked))
    assert told is not None
    assert told.findings == ()  # ROS's own business is no node's


def test_a_sentence_that_was_changed_is_a_warning_with_what_to_write(tmp_path: Path) -> None:
    from avow.system.statements import not_validated

    entry = "validation: {{who: A. P., date: 2026-01-01, sentence: '{1}', formula: '{2}'}}"
    plan = "requirements: {{R: {{text: {0}, supported_by: [a], " + entry + "}}}}"
    system = make(tmp_path / "a", A, plan.format("It does", "?", "?"))
    (first,) = not_validated(system)
    assert first.code == "PLAN129"
    assert first.span is not None
    (asked,) = system.plan.requirements
    read = asked.sentence_digest, asked.formula_digest
    assert list(not_validated(make(tmp_path / "b", A, plan.format("It does", *read)))) == []
    changed = make(tmp_path / "c", A, plan.format("It does not", *read))
    assert [d.code for d in not_validated(changed)] == ["PLAN129"]
    assert changed.plan.requirements[0].outdated
    wrong = faults(tmp_path / "d", A, plan.format("It does", *read).replace("2026-01-01", "2026-02-30"))
    assert [d.code for d in wrong] == ["PLAN105"]
    (to_come,) = faults(tmp_path / "f", A, plan.format("It does", *read).replace("2026-01-01", "2999-01-01"))
    assert "in the future" in to_come.message
    listed = "expected: [{obligation: a/guarantee/g1, verdict: refuted, matched: [a/guarantee/g1]}]"
    assert [d.code for d in faults(tmp_path / "e", A, listed)] == ["PLAN110"]

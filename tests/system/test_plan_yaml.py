"""Strict YAML and the plan's shape: what is refused, and where it is said to be."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from helpers import keys_of

from avow.backend_kit import given
from avow.backend_kit.registry import backend, names
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.remembered import Shelf
from avow.system import schema
from avow.system.plan import Located
from avow.system.plan_file import read_plan
from avow.system.schema import check_shape, plan_schema, violations
from avow.system.strict_yaml import read_yaml, scalar


def faults(folder: Path, text: str | bytes) -> tuple[Diagnostic, ...]:
    """What reading the plan complains of."""
    path = folder / "plan.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    (folder / "a.rcl").write_text("node a { inputs() outputs() topics() guarantee(TRUE) }")
    try:
        return read_plan(path)[2]
    except Rejected as rejected:
        return rejected.diagnostics


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("off", "off"),
        ("yes", "yes"),
        ("1:30", "1:30"),
        ("010", "010"),
        ("0x1F", "0x1F"),
        ("2026-11-21", "2026-11-21"),
        ("1_000", "1_000"),
        (".inf", ".inf"),
        ("1e999", "1e999"),
        ("true", True),
        ("12", 12),
        ("-0.5", -0.5),
        ("~", None),
    ],
)
def test_scalars_are_never_guessed(text: str, value: object) -> None:
    found = scalar(text)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("text", "line", "column", "words"),
    [
        ("system: a\nsystem: b\n", 2, 1, "given twice"),
        ("system: a\n\ttitle: b\n", 2, 1, "a tab stands where YAML wants spaces"),
        ("titel: x\n", 1, 1, "unknown key 'titel'"),
        ("system: [a]\n", 1, 9, "first a letter is wanted, not"),
        ("system: 'a/../b'\n", 1, 9, "right form (expected: a name of letters, digits, `_` and `-`, first a letter)"),
        ('system: "a\\n"\n', 1, 9, "right form"),
        ("connections:\n  - {from: a.x, to: b.x, delayed: yes}\n", 2, 35, "true or false is wanted"),
        ("connections:\n  - {from: a.x, to: b.x, delayed: yes, initial: 0}\n", 2, 35, "true or false is wanted"),
        ("connections:\n  - {from: a, to: b.x}\n", 2, 12, "node.port"),
        ("connections:\n  - {to: b.x}\n", 2, 5, "'from' is missing"),
        ("connections:\n  - {from: a.x, to: b.x, initial: 3}\n", 2, 5, "the key 'delayed' is missing"),
        ("nodes: {a: {methods: {hoare: {}}}}\n", 1, 22, "a list is wanted, not a mapping"),
        ("compose: {D1: {rule: R7}}\n", 1, 22, "not one of R1, R2, R3, R4"),
        ("compose: {start: {}}\n", 1, 11, "cannot be used here"),
        ("compose: {D.1: {}}\n", 1, 11, "cannot be used here"),
        ("nodes: {a: {criticality: hihg}}\n", 1, 26, "not one of low, medium, high"),
        ("contract: ../x.rcl\n", 1, 11, "out of the system's folder"),
        ("contract: /etc/passwd\n", 1, 11, "out of the system's folder"),
        ("contract: nothere.rcl\n", 1, 11, "no file"),
        ("policy: !!python/object:os.system {}\n", 1, 9, "tag"),
        ("a: &x {b: 1}\n<<: *x\n", 2, 1, "merge keys"),
        ("---\n{}\n---\n{}\n", 3, 1, "second document"),
        ("title: *nowhere\n", 1, 8, "without its anchor"),
        ("title: &a x\nsystem: &a y\n", 2, 9, "this anchor is given twice"),
        ("title: &a [*a]\n", 1, 8, "an alias stands in what it repeats"),
        ("? [a]\n: b\n", 1, 3, "key must be plain text"),
        ("", 1, 1, "empty"),
        (b"title: \xff\n", 1, 8, "UTF-8"),
        (b"title: a\x00b\n", 1, 9, "U+0000"),
        (
            "accepted: [{obligation: a/b, verdict: unknown, reason: r, who: w, expires: 2027-01-01, date: 2026-02-30}]",
            1,
            94,
            "calendar",
        ),
        ("scenario:\n  t: [{a: 1}, {b: 2}]\n", 2, 15, "odd: a, b"),
        ("scenario:\n  t: [{a: 1}]\n  interpret: {in.x: t(b)}\n", 3, 21, "no column 'b'"),
        ("scenario:\n  interpret: {in.x: u(b)}\n", 2, 21, "no table 'u'"),
        ("scenario:\n  domains: {REAL: 5..1}\n", 2, 19, "empty"),
        ("scenario:\n  steps: 0\n", 2, 10, "minimum"),
        ("requirements: {R1: {text: a, formula: b, temporal: c}}\n", 1, 52, "not both"),
    ],
)
def test_faults_are_located(tmp_path: Path, text: str | bytes, line: int, column: int, words: str) -> None:
    found = faults(tmp_path, text)
    assert any(words in d.message or words in (d.hint or "") for d in found), found
    fault = next(d for d in found if words in d.message)
    assert fault.span is not None
    assert (fault.span.line, fault.span.column) == (line, column), fault


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nodes: {n: {methods: [{hoare: {guarantees: []}}]}}", "hoare.guarantees: must not be empty"),
        ("nodes: {n: {methods: [{hoare: {guarantees: }}]}}", "hoare.guarantees: text or a list is wanted"),
        ("nodes: {n: {methods: [{hoare: {guarantees: [[g]]}}]}}", "guarantees[0]: text is wanted"),
        ("nodes: {n: {methods: [{hoare: {guarantees: {g: 1}}}]}}", "guarantees: text or a list is wanted"),
        ("nodes: {n: {methods: [{hoare: {guarantees: [g, g]}}]}}", "'g' is given twice"),
        ("compose: {D1: {select: []}}", "compose.D1.select: must not be empty"),
    ],
)
def test_an_empty_choice_is_not_everything(tmp_path: Path, text: str, words: str) -> None:
    (fault,) = faults(tmp_path, text + "\n")
    assert words in fault.message
    assert fault.code == "PLAN105"
    assert fault.span is not None
    assert fault.span.column > 10


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"a": 5}, "n: tool: the key 'b' is missing"),
        ({"b": 5}, "b: text or a list is wanted, not 5"),
        ({"b": [5]}, "b[0]: text is wanted, not 5"),
        ({"b": "x", "c": 1, "d": 2}, "n: tool: either 'c' or 'd' is wanted, not both"),
        ({"b": "x", "e": 1}, "n: tool: 'c' or 'd' is missing"),
    ],
)
def test_options_that_depart_from_a_schema_are_told_in_words(options: dict[str, object], message: str) -> None:
    schema = {
        "type": "object",
        "properties": {"b": {"oneOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}},
        "required": ["b"],
        "oneOf": [{"required": ["c"]}, {"required": ["d"]}],
    }
    if "e" not in options and "d" not in options:
        del schema["oneOf"]
    found = violations(Located(options, Span("plan.yaml", 1, 1, 1, 2)), schema, "n: tool")
    assert [d.message for d in found] == [message]


@pytest.mark.parametrize(
    ("options", "message", "hint"),
    [
        (
            {"answers": {"by": "stmap"}},
            "answers.by: 'stmap' is not one of arrival, order, call, stamp, key, latency",
            "did you mean `stamp`?",
        ),
        ({"answers": {"by": "key", "input": "a"}}, "answers: the key 'output' is missing", None),
        ({"answers": {"by": "stamp", "inputs": "a"}}, "answers: unknown key 'inputs'", "did you mean `input`?"),
        ({"mapping": {"in.r": {"nan": "nil"}}}, "mapping.in.r.nan: none is wanted, not 'nil' (", "write `none`"),
    ],
)
def test_a_slip_in_one_of_several_forms_is_one_fault(options: dict[str, Any], message: str, hint: str | None) -> None:
    (found,) = violations(Located(options, Span("plan.yaml", 1, 1, 1, 2)), given.schema(given.READING))
    assert found.message.startswith(message)
    assert found.hint == hint


def test_an_alias_without_its_anchor_has_a_remedy(tmp_path: Path) -> None:
    assert [d.hint for d in faults(tmp_path, "title: *run\n")] == ["write the value here, or its anchor above"]


def test_did_you_mean(tmp_path: Path) -> None:
    (fault,) = faults(tmp_path, "conections: []\n")
    assert fault.hint == "did you mean `connections`?"
    source = "nodes: {n: {source: {python: n.py, class: N, kind: KIND}}}"
    for kind, hint in (("ros2", "write `rclpy`"), ("ros1", "write `rospy`"), ("rclpi", "did you mean `rclpy`?")):
        assert faults(tmp_path, source.replace("KIND", kind))[0].hint == hint


def test_nesting_without_end_is_a_fault() -> None:
    with pytest.raises(Rejected, match="nested too deeply"):
        read_yaml(b"[" * 5000, "plan.yaml")


def test_every_pattern_of_a_schema_is_described() -> None:
    """The message says what is expected, and people do not read patterns."""
    schemas = [plan_schema(), *(backend(name).options_schema for name in names())]
    bare: list[str] = []

    def walk(part: Any) -> None:
        for inner in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
            walk(inner)
        if isinstance(part, dict) and isinstance(part.get("pattern"), str) and "description" not in part:
            bare.append(part["pattern"])

    walk(schemas)
    assert bare == []


def test_faults_of_what_is_repeated_have_an_order(tmp_path: Path) -> None:
    """They stand at one place, and are told in the same order by every process."""
    said = "{says: 7, because: it is so, who: A. Person, until: 2030-01-01}"
    goals = [f"  g{n}: {{select: [a], persistence: {'*p' if n else f'&p {said}'}}}\n" for n in range(7)]
    found = [d.message for d in faults(tmp_path, f"compose:\n{''.join(goals)}")]
    assert [message.partition(":")[0] for message in found] == [f"compose.g{n}.persistence.says" for n in range(7)]


def test_aliases_work() -> None:
    piece, problems = read_yaml(b"a: &x {n: 1}\nb: *x\n", "plan.yaml")
    assert not problems
    assert piece.data == {"a": {"n": 1}, "b": {"n": 1}}


def test_every_place_is_known(tmp_path: Path) -> None:
    piece, _ = read_yaml("nodes:\n  a:\n    methods:\n      - hoare: {v: [1, é, x]}\n".encode(), "plan.yaml")
    located = piece.located()
    assert located.at("nodes", "a", "methods", 0, "hoare", "v", 2).column == 27
    assert located.at("nodes", "a", "nothing").line == 3


def test_methods(tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text("nodes: {a: {methods: [{hoare: {x: 1}}, {hoare: {}}, review, {ajpf: {id: edge, guarantees: G1}}]}}")
    (tmp_path / "a.rcl").write_text("")
    plan, _, problems = read_plan(path)
    assert not problems
    methods = plan.node("a").methods
    assert [m.id for m in methods] == ["hoare", "hoare-2", "review", "edge"]
    assert methods[3].guarantees == ("G1",)
    assert methods[0].options.data == {"x": 1}


def test_scenario_tables(tmp_path: Path) -> None:
    (tmp_path / "a.rcl").write_text("")
    (tmp_path / "w.csv").write_text("id,x\n0,2.30\n1,-4\n")
    text = "scenario: {w: w.csv, v: [{r: 030}], domains: {NATURAL: w.id, REAL: [1.50], INTEGER: 2..4}, steps: 7}"
    (tmp_path / "plan.yaml").write_text(text)
    plan, _, problems = read_plan(tmp_path / "plan.yaml")
    assert not problems
    assert plan.scenario is not None
    assert plan.scenario.table("w").column("x") == ("2.30", "-4")
    assert plan.scenario.table("v").rows == (("030",),)
    assert plan.scenario.domains == {"NATURAL": ("0", "1"), "REAL": ("1.50",), "INTEGER": ("2", "3", "4")}
    digest = plan.scenario.digest
    (tmp_path / "w.csv").write_text("id,x\n0,2.31\n1,-4\n")
    again, _, _ = read_plan(tmp_path / "plan.yaml")
    assert again.scenario is not None
    assert again.scenario.digest != digest


@pytest.mark.parametrize("text", ["id,x\n0\n", "id,id\n0,1\n", "", 'id\n"a\n'])
def test_bad_csv_is_a_located_fault(tmp_path: Path, text: str) -> None:
    (tmp_path / "w.csv").write_text(text)
    found = faults(tmp_path, "scenario: {w: w.csv}\n")
    assert [d.code for d in found] == ["PLAN109"]


def test_a_link_out_of_the_folder_is_refused(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.csv").write_text("a\n1\n")
    (inner / "w.csv").symlink_to(tmp_path / "secret.csv")
    assert [d.code for d in faults(inner, "scenario: {w: w.csv}\n")] == ["PLAN108"]


def test_published_schema_is_the_one_in_use() -> None:
    import json

    published = Path(__file__).parents[2] / "docs/schemas/plan.schema.json"
    assert json.loads(published.read_text()) == plan_schema(), f"copy avow/system/plan.schema.json to {published}"


def test_every_key_is_read_and_described() -> None:
    root = Path(__file__).parents[2]
    pages = "".join((root / "docs" / name).read_text("utf-8") for name in ("plan.md", "policy.md"))
    code = "".join(
        p.read_text("utf-8")
        for room in ("system", "assurance", "backend_kit", "ros")
        for p in (root / "avow" / room).glob("*.py")
    )
    found = set(keys_of(plan_schema()))
    assert len(found) > 60
    assert {key for key in found if not re.search(rf"\b{key}\b", pages)} == set(), "docs/plan.md says what it is"
    assert {key for key in found if f'"{key}"' not in code} == set(), "avow/system/plan_file.py reads it"


@pytest.mark.parametrize("path", ["x" * 300, "a/" * 3000 + "b", "x" * 70_000 + ".csv"])
@pytest.mark.parametrize(
    "form", ["contract: {}\n", "scenario: {{tables: {{t: {}}}}}\n", "plugins: []\nmodel: {{ros_graph: {}}}\n"]
)
def test_a_path_that_no_file_can_have(tmp_path: Path, form: str, path: str) -> None:
    found = faults(tmp_path, form.format(path))
    assert found
    assert all(len(d.message) < 1000 for d in found)


SAYS = "environment:\n  in.a: {{assume: 'TRUE', because: b, {0}}}\n"


@pytest.mark.parametrize(
    ("entry", "code", "words"),
    [
        (
            "says: one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen",
            "PLAN115",
            "15",
        ),
        ("says: what agent.wayP gives", "PLAN115", "agent.wayP"),
        ("says: what wayP gives", "PLAN115", "wayP"),
        ("until: 2026-02-30", "PLAN105", "calendar"),
        ("until: tomorrow", "PLAN105", "right form"),
        ("date: 2026-02-30", "PLAN105", "calendar"),
        ("date: 2999-01-01", "PLAN105", "in the future"),
        ("date: 1026-11-21", "PLAN105", "too early for any contract"),
        ("until: 1026-11-21", "PLAN105", "too early for any contract"),
        ("who: ''", "PLAN105", "empty"),
        ("who: '?'", "PLAN105", "names no person"),
        ("who: TBD", "PLAN105", "names no person"),
        ("who: Ada L\u200bovelace", "PLAN101", "invisible character"),
    ],
)
def test_plain_words_owners_and_dates_are_checked(tmp_path: Path, entry: str, code: str, words: str) -> None:
    (fault,) = faults(tmp_path, SAYS.format(entry))
    assert (fault.code, words in fault.message) == (code, True), fault
    assert fault.span is not None
    assert fault.span.line == 2


def test_an_accepted_assumption_has_plain_words(tmp_path: Path) -> None:
    text = "accepted:\n  - {obligation: a/assumption/b, verdict: missing, reason: r, who: A. Person, date: 2026-11-20, "
    text += "expires: 2030-01-01, says: what in.x gives}\n"
    (fault,) = faults(tmp_path, text)
    assert (fault.code, "in.x" in fault.message) == ("PLAN115", True), fault


ACCEPTED = {"reason": "a spare brake", "who": "A. Person", "date": "2026-11-20", "expires": "2030-01-01"}
VALIDATION = {"who": "A. Person", "date": "2026-11-20"}
SIGNED: dict[str, tuple[str, dict[str, str]]] = {
    # what a person signs by name: where it stands, and what it has to hold
    "accepted": ("accepted:\n  - obligation: a/b/c\n    verdict: unknown\n{}", ACCEPTED),
    "validation": ("requirements:\n  R:\n    text: t\n    validation:\n      says: It does\n{}", VALIDATION),
}
BAD_TEXTS = {
    "blank": '" "',
    "empty": "''",
    "nothing": "",
    "of no width": '"\u200b"',
    "punctuation": '"…"',
    "a mark of direction": '"A. \\u202enosreP"',
    "a mark of direction, as itself": '"A. Person\u200f"',
    "a control character": '"A. Person\\u0007"',
    "padded by what is not seen": '"\ufeffA. Person"',
}
BAD_DAYS = {
    "blank": '" "',
    "of no calendar": "2026-02-30",
    "padded": '" 2026-11-20"',
    "padded by what is not seen": '"2026-11-20\u200b"',
    "a line more": '"2026-11-20\\n"',
    "other digits": '"٢٠٢٦-11-20"',
}


def signed(name: str, **given: str | None) -> str:
    """A plan whose one entry is whole, but for what is given; None: left out."""
    text, keys = SIGNED[name]
    indent = " " * (6 if name != "accepted" else 4)
    lines = [f"{indent}{key}: {value}\n" for key, value in {**keys, **given}.items() if value is not None]
    return text.format("".join(lines))


def test_entries_that_are_whole_are_right(tmp_path: Path) -> None:
    assert not [f for name in SIGNED for f in faults(tmp_path, signed(name))]
    persian = "درست است\u200cها"  # letters are parted by a mark of no width
    assert not faults(tmp_path, signed("validation", because=persian, who="O'Neill-Łuk Ånström"))
    assert not faults(tmp_path, signed("accepted", who='"  A.   Person  "'))


@pytest.mark.parametrize("key", [(name, key) for name, (_, keys) in SIGNED.items() for key in keys])
def test_what_a_person_signs_is_whole(tmp_path: Path, key: tuple[str, str]) -> None:
    """Person, reason, date and last day: missing, blank, or not what it looks like, each is told at its place."""
    name, field = key
    assert [f.code for f in faults(tmp_path, signed(name, **{field: None}))] == ["PLAN104"]
    for what, value in (BAD_DAYS if field in ("date", "on", "expires", "until") else BAD_TEXTS).items():
        text = signed(name, **{field: value})
        found = faults(tmp_path, text)
        line = next(k for k, said in enumerate(text.split("\n"), 1) if said.strip().startswith(f"{field}:"))
        assert {f.span.line for f in found if f.span is not None} == {line}, (field, what, found)


@pytest.mark.parametrize("key", [("accepted", "date"), ("validation", "date")])
def test_nobody_signs_tomorrow_nor_what_has_ended_before(tmp_path: Path, key: tuple[str, str]) -> None:
    name, field = key
    ends = [end for end in ("expires", "until") if end in SIGNED[name][1]]
    (fault,) = faults(tmp_path, signed(name, **{field: "2999-01-01", **dict.fromkeys(ends, "2999-12-31")}))
    assert "in the future" in fault.message
    for end in ends:
        (fault,) = faults(tmp_path, signed(name, **{end: "2026-11-19"}))
        assert "before" in fault.message


def test_what_nobody_sees_stands_nowhere_in_a_plan(tmp_path: Path) -> None:
    """A pattern or a name that is not what it looks like would match something else, or nothing."""
    for text in ('title: "a\u200bb"\n', 'lints_off: ["RCL\u200f401"]\n', '"no\u2066des": {}\n'):
        assert "PLAN101" in [f.code for f in faults(tmp_path, text)], text


def test_statements_of_a_plan(tmp_path: Path) -> None:
    text = (
        "compose: {D: {persistence: {because: b, says: It stays, who: W, date: 2026-11-20, until: 2030-01-01},"
        " entered: {because: e}}}\n"
        "assumptions: {hoare.map: {says: The map fits}}\n"
        "requirements: {R: {text: t, validation: {because: it does, who: W, date: 2026-11-20, until: 2030-01-01}}}\n"
        "nodes: {a: {title: the first, methods: [hoare: {}]}}\n"
    )
    (tmp_path / "plan.yaml").write_text(text)
    (tmp_path / "a.rcl").write_text("node a { inputs() outputs() topics() guarantee(TRUE) }")
    plan, _, faults_ = read_plan(tmp_path / "plan.yaml")
    assert faults_ == ()
    assert [(s.place, s.says, s.because, s.who, s.until, s.date) for s in plan.statements] == [
        ("D.persistence", "It stays", "b", "W", "2030-01-01", "2026-11-20"),
        ("D.entered", "", "e", "", "", ""),
        ("assumptions.hoare.map", "The map fits", "", "", "", ""),
        ("requirements.R.validation", "", "it does", "W", "2030-01-01", "2026-11-20"),
    ]
    assert plan.node("a").title == "the first"


def test_a_right_shape_is_found_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    real = schema._departures

    def departures(*given: Any) -> tuple[Diagnostic, ...]:
        asked.append(given)
        return real(*given)

    monkeypatch.setattr(schema, "_departures", departures)
    texts = ("system: s\n", "system: s # a remark\n", "system: 1\n", "system: '1'\n", "system: 1\n", "system: s\n")
    for text, times in zip(texts, (1, 1, 2, 3, 4, 4), strict=True):
        piece = read_yaml(f"{text}contract: c.rcl\n".encode(), "plan.yaml")[0]
        shelf = Shelf(tmp_path, "code")
        found = check_shape(piece, shelf)
        shelf.keep()
        assert len(asked) == times, text
        assert found == real(piece.located(), plan_schema(), "the plan")

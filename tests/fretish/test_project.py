"""Files of sentences as contracts, and contracts as sentences."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from helpers import avow

from avow.base.diagnostics import Rejected
from avow.fretish.project import nodes, read
from avow.fretish.sentence import Unreadable, parse
from avow.fretish.writing import to_fretish
from avow.language.contract import Contract
from avow.language.load import check_text


def contract(text: str) -> Contract:
    found, diagnostics = check_text(text, "x.rcl")
    assert found is not None, [d.message for d in diagnostics]
    return found


def made(tmp_path: Path, text: str, outputs: str = "") -> str:
    path = tmp_path / "sentences.txt"
    path.write_text(text, encoding="utf-8")
    found = nodes(read(path), frozenset(filter(None, outputs.split(","))))
    assert not [fault for fault in found.faults if fault.is_error], found.faults
    return found.text


@pytest.mark.parametrize(
    ("sentence", "clause"),
    [
        ("the pump shall always satisfy level < 3.5", "level < 3.5"),
        ("When hot, the pump shall immediately satisfy off.", "rose(in.hot) -> off"),
        ("whenever hot and if wet is false the pump shall satisfy off", "in.hot and (not in.wet) -> eventually(off)"),
        ("Pump shall within 2 seconds satisfy off", "rose(TRUE) -> within[2 s](off)"),
        ("in idle mode the pump shall always satisfy off", "in.idle -> off"),
        ("the pump shall always satisfy FTP | level < preReal(0, level)", "rose(TRUE) or level < previous(level, 0)"),
        (
            "upon b & !FTP the pump shall at the next timepoint satisfy off",
            "rose(in.b and not rose(TRUE)) -> next(off)",
        ),
        ("while a | b, upon c unless d shall the pump for 5 ticks satisfy off", None),
        ("pump shall until x = y satisfy (if a then preBool(false, b) & persisted(3, c))", None),
        ("pump shall never satisfy absReal(x - 1) > 2 mod 3 xor !off <=> true", None),
    ],
)
def test_sentences_become_clauses_that_mean_the_same_again(tmp_path: Path, sentence: str, clause: str | None) -> None:
    first = made(tmp_path, f"R-1: {sentence}")
    formula = contract(first).nodes[0].guarantees[0].formula
    if clause is not None:
        (port,) = contract(first).nodes[0].outputs
        ports = ", ".join(f"{p.name} : {p.type_name}" for p in contract(first).nodes[0].inputs) or "z : BOOL"
        head = f"node pump {{ inputs( {ports} ) outputs( {port.name} : {port.type_name} ) topics()"
        alone = f"{head} guarantee ( {clause} ) }}"
        assert contract(alone).nodes[0].guarantees[0].formula == formula
    written = to_fretish(contract(first))
    if written.missing:  # what has a scope is `since` something, which sentences say by their scope
        assert "since" in written.missing[0].message
        return
    outputs = ",".join(p.name for p in contract(first).nodes[0].outputs)
    again = contract(made(tmp_path, written.text, outputs)).nodes[0]
    assert [c.formula for c in again.clauses] == [c.formula for c in contract(first).nodes[0].clauses]


@pytest.mark.parametrize(
    ("sentence", "column"),
    [
        ("the pump shall satisfy", 23),
        ("pump satisfy off", 6),
        ("the pump shall within satisfy off", 23),
        ("not in filling mode the pump shall satisfy off", 1),
        ("the pump shall satisfy at the next occurrence of p, q", 24),
        ("pump shall satisfy " + "!" * 35_000 + "p", 1),
        ("", 1),
    ],
)
def test_what_is_no_sentence_has_its_place(sentence: str, column: int) -> None:
    with pytest.raises(Unreadable) as told:
        parse(sentence)
    assert told.value.column == column


def export(tmp_path: Path) -> Path:
    """As FRET exports them."""
    path = tmp_path / "export.json"
    texts = {
        "T-1": "When on the tank shall within 2 ticks satisfy valve = open_",
        "T-2-assumption": "the tank shall always satisfy level >= 0",
        "T-3": "the tank shall always satisfy safe => sqrt(level) < 3",
        "T-4": "the tank shall satisfy it somehow",
        "T-5": "in filling mode the tank shall at the next timepoint satisfy valve = open_",
        "T-6": 'the tank shall always satisfy safe """ ) } node evil { ',
    }
    kinds = {
        "on": ("Input", "boolean", ""),
        "level": ("Input", "double", ""),
        "valve": ("Output", "integer", ""),
        "open_": ("Internal", "integer", "1"),
        "safe": ("Internal", "boolean", "(level < 10 and not on) or level < 5"),
        "filling": ("Mode", "boolean", "level < 4"),
    }
    variables = [
        {
            "component_name": "tank",
            "variable_name": name,
            "idType": kind,
            "dataType": of,
            "assignment": "" if kind == "Mode" else means,
            "modeRequirement": means if kind == "Mode" else "",
        }
        for name, (kind, of, means) in kinds.items()
    ]
    listed = [{"reqid": name, "fulltext": text, "project": "P"} for name, text in texts.items()]
    path.write_text(json.dumps({"requirements": listed, "variables": variables}), encoding="utf-8")
    return path


@pytest.mark.slow
def test_an_export_with_variables(tmp_path: Path) -> None:
    path = export(tmp_path)
    done = avow("fretish", str(path), cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    node = contract(done.stdout).nodes[0]
    assert {p.name: p.type_name for p in node.inputs} == {"on": "BOOL", "level": "REAL"}
    assert {p.name: p.type_name for p in node.outputs} == {"valve": "INTEGER"}
    assert [c.name for c in node.assumptions] == ["T_2_assumption"]
    assert [c.name for c in node.guarantees] == ["T_1", "T_5"]
    for code in ("FRET002", "FRET003", "FRET004", "T-3", "T-4", "T-6", "sqrt", "help: a sentence is"):
        assert code in done.stderr, code
    for place in ("export.json:1:",):
        assert place in done.stderr
    there = avow("fretish", str(path), "-o", "tank.rcl", "--json", cwd=tmp_path)
    assert (there.returncode, len(json.loads(there.stdout)["left_out"])) == (1, 3)
    checked = avow("check", "tank.rcl", cwd=tmp_path)
    assert checked.returncode == 0, checked.stderr
    back = avow("translate", "--to", "fretish", "tank.rcl", cwd=tmp_path)
    assert back.returncode == 0, back.stderr
    assert "T_1: upon on the tank shall within 2 ticks satisfy (valve = 1)\n" in back.stdout


@pytest.mark.parametrize(
    "content", [b"{", b"[1]", b'{"requirements": 3}', b"\xff\xfe", b"[" * 100_000, b"", b"nothing here\n"]
)
def test_what_is_no_file_of_requirements_is_code_2(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.json").write_bytes(content)
    done = avow("fretish", "x.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr
    assert done.stderr.strip()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"requirements": [{"reqid": "A"}, {"fulltext": 3}]}, "requirements[0]: fields missing"),
        ({"requirements": [{"fulltext": "a"}, {"fulltext": 3}]}, "[1].fulltext: not"),
        ({"requirements": {}}, "requirements: not a list"),
        ({"requirements": [], "variables": [{"variable_name": []}]}, "['component_name']"),
        ('{"requirements": [], "requirements": []}', "stands twice"),
        ('[{"fulltext": NaN}]', "NaN"),
        (f'[{{"fulltext": {"9" * 5000}}}]', "limit"),
        ("[" * 100_000, "too deeply"),
    ],
)
def test_what_is_wrong_with_an_export_is_told(tmp_path: Path, change: object, said: str) -> None:
    path = tmp_path / "x.json"
    path.write_text(change if isinstance(change, str) else json.dumps(change))
    with pytest.raises(Rejected) as told:
        read(path)
    (found,) = told.value.diagnostics
    assert found.code == "FRET001"
    assert said in found.message


def test_half_a_character_of_an_export_is_shown_as_unreadable(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text('[{"fulltext": "the n shall always satisfy \\ud800", "reqid": "\\udfff"}]')
    done = avow("fretish", "x.json", "--json", cwd=tmp_path)
    assert "Traceback" not in done.stderr
    assert "FRET" in done.stdout + done.stderr


def test_what_fretish_cannot_say_is_told_by_name() -> None:
    text = """
    context { T : {a, b}; }
    node n {
      inputs( s : NATURAL --> NATURAL, x : REAL, mode : T, True : BOOL, n : NATURAL )
      outputs( x : REAL, t : T, y : NATURAL ) topics()
      guarantee g1 ( forall(i in NATURAL | in.s(i) > 0) )
      guarantee g2 ( out.x > in.x )
      guarantee g3 ( out.t == a -> within[200 ms](out.t == b) )
      guarantee g4 ( counted(TRUE since out.t == a) < 3 )
      guarantee g5 ( in.mode == a -> out.t == b )
      guarantee g6 ( in.True -> out.t == b )
      guarantee g7 ( out.y == max(in.n, 3, min(in.n, 4)) )
      guarantee g8 ( out.y == div(in.n, 2) )
      guarantee g9 ( out.y == (if in.n > 3 then 1 else 2) )
    }"""
    found = to_fretish(contract(text))
    assert found.text == (
        "g3: whenever (t = a) the n shall within 200 milliseconds satisfy (t = b)\n"
        "g7: the n shall always satisfy (y = max(max(n, 3), min(n, 4)))\n"
    )
    told = " ".join(d.message for d in found.missing)
    for word in ("g1", "g2", "both called `x`", "`counted`", "`mode`", "`True`", "n.g8", "a conditional (NATURAL)"):
        assert word in told, told


@pytest.mark.parametrize(
    ("sentences", "left_out"),
    [
        (["the n shall always satisfy a.b => x", "the n shall always satisfy a_b => y"], "`a.b` and `a_b`"),
        (["when a.b the n shall immediately satisfy x", "the n shall always satisfy a_b"], "`a.b` and `a_b`"),
        (["the m shall always satisfy a.b", "the n shall always satisfy a_b => y"], "`a.b` and `a_b`"),
        (["the n shall always satisfy rose => x", "the n shall always satisfy rose_ => y"], "`rose` and `rose_`"),
        (["the a.b shall always satisfy x > 3", "the a_b shall always satisfy x < 3"], "`a.b` and `a_b`"),
        (["the n shall always satisfy x", "the n shall always satisfy x => y => z"], "a chain of arrows"),
        (["the n shall always satisfy x", "the n shall always satisfy x <=> y => z"], "a chain of arrows"),
        (["the n shall always satisfy x", "the n shall always satisfy x => y => if z then w"], "a chain of arrows"),
        (
            ["the n shall always satisfy x", "in m the n shall always satisfy persisted(2, x)"],
            "looks back to the scope",
        ),
        (["the n shall always satisfy x", "in m when occurred(2, y) the n shall satisfy x"], "looks back to the scope"),
    ],
)
def test_what_would_become_another_claim_is_left_out(tmp_path: Path, sentences: list[str], left_out: str) -> None:
    """Two names of FRET's never become one of RCL's, and what is read in two ways is not read."""
    path = tmp_path / "x.txt"
    path.write_text("\n".join(sentences))
    found = nodes(read(path))
    (fault,) = [fault for fault in found.faults if fault.is_error]
    assert left_out in fault.message
    assert fault.span is not None
    assert fault.span.line == 2
    assert [c.name for node in contract(found.text).nodes for c in node.clauses] == ["R1"]


@pytest.mark.parametrize(
    ("means", "left_out"),
    [
        ("false -> level > 3", "speaks of the first step"),
        ("level > 3 -- 4", "begins a comment"),
        ("a => b => level > 3", "a chain of arrows"),
        ("level > 3", ""),
        ("(a <-> b) or a => (b => level - -3 > 2)", ""),
    ],
)
def test_what_a_name_stands_for_is_read_as_lustre(tmp_path: Path, means: str, left_out: str) -> None:
    path = tmp_path / "x.json"
    listed = [{"reqid": "R", "fulltext": "the n shall always satisfy high => x"}]
    high = {"component_name": "n", "variable_name": "high", "idType": "Internal", "assignment": means}
    path.write_text(json.dumps({"requirements": listed, "variables": [high]}))
    found = nodes(read(path))
    assert bool(found.text) is (not left_out)
    assert [left_out in fault.message for fault in found.faults] == [True] * bool(left_out)


@pytest.mark.parametrize("means", ["a{0} and a{0}", "!a{0}", "a{0} + a{0} + a{0} > 1"])
def test_definitions_without_end_are_told(tmp_path: Path, means: str) -> None:
    path = tmp_path / "x.json"
    listed = [{"reqid": "R", "fulltext": "the n shall always satisfy a999 => x"}]
    names = [
        {"component_name": "n", "variable_name": f"a{k}", "idType": "Internal", "assignment": means.format(k - 1)}
        for k in range(1, 1000)
    ]
    path.write_text(json.dumps({"requirements": listed, "variables": names}))
    (fault,) = nodes(read(path)).faults
    assert "defined through more than" in fault.message


def test_two_projects_in_a_file_are_not_mixed(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    listed = [{"reqid": p, "project": p, "fulltext": f"the n{p} shall always satisfy c > 1"} for p in "PQ"]
    constant = {"variable_name": "c", "idType": "Internal", "dataType": "integer"}

    def write(one: str, other: str) -> None:
        both = [
            {**constant, "project": p, "component_name": f"n{p}", "assignment": v}
            for p, v in zip("PQ", (one, other), strict=True)
        ]
        path.write_text(json.dumps({"requirements": listed, "variables": both}))

    write("1", "2")
    assert "c > 1" in (text := nodes(read(path)).text)
    assert "(2) > 1" in text
    listed[1]["fulltext"] = "the nP shall always satisfy y"
    write("1", "2")
    assert "export one project" in nodes(read(path)).faults[0].message
    twice = [{**constant, "component_name": "nP", "assignment": v} for v in "12"]
    path.write_text(json.dumps({"requirements": listed, "variables": twice}))
    with pytest.raises(Rejected, match="two different variables `c`"):
        nodes(read(path))


def test_a_sentence_s_name_tells_assumptions_from_guarantees() -> None:
    text = """node n { inputs( a : BOOL ) outputs( x : BOOL ) topics()
      assume A1 ( in.a ) assume assumed ( in.a ) guarantee G1 ( out.x ) guarantee presumably_assumed ( out.x ) }"""
    found = to_fretish(contract(text))
    assert [line.partition(":")[0] for line in found.text.splitlines()] == ["A1_assumption", "assumed", "G1"]
    assert "presumably_assumed" in found.missing[0].message


def test_a_fault_of_json_has_its_line_and_column(tmp_path: Path) -> None:
    file = tmp_path / "f.json"
    file.write_text('[{"reqid": "R1",\n "fulltext" "x"}]\n', "utf-8")
    with pytest.raises(Rejected) as caught:
        read(file)
    (found,) = caught.value.diagnostics
    assert (found.code, found.span and (found.span.line, found.span.column)) == ("FRET001", (2, 13))

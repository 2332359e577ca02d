"""Files of sentences as contracts, and contracts as sentences."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from avow.fretish.project import nodes, read
from avow.fretish.sentence import Unreadable, parse
from avow.fretish.writing import to_fretish
from avow.language.contract import Contract
from avow.language.load import check_text


def avow(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "avow", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False, timeout=120)


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
        ("the pump shall satisfy at the next occurrence of p, q", 24),
        ("x " * 3_000, 1),
        ("pump shall satisfy " + "(" * 500, 1),
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


def test_an_export_with_variables(tmp_path: Path) -> None:
    path = export(tmp_path)
    done = avow("fretish", str(path), cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    node = contract(done.stdout).nodes[0]
    assert {p.name: p.type_name for p in node.inputs} == {"on": "BOOL", "level": "REAL"}
    assert {p.name: p.type_name for p in node.outputs} == {"valve": "INTEGER"}
    assert [c.name for c in node.assumptions] == ["T_2_assumption"]
    assert [c.name for c in node.guarantees] == ["T_1", "T_5"]
    for code in ("FRET002", "FRET003", "FRET004", "T-3", "T-4", "T-6", "sqrt"):
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


def test_what_fretish_cannot_say_is_told_by_name() -> None:
    text = """
    context { T : {a, b}; }
    node n {
      inputs( s : NATURAL --> NATURAL, x : REAL ) outputs( x : REAL, t : T ) topics()
      guarantee g1 ( forall(i in NATURAL | in.s(i) > 0) )
      guarantee g2 ( out.x > in.x )
      guarantee g3 ( out.t == a -> within[200 ms](out.t == b) )
      guarantee g4 ( counted(TRUE since out.t == a) < 3 )
    }"""
    found = to_fretish(contract(text))
    assert found.text == "g3: whenever (t = a) the n shall within 200 milliseconds satisfy (t = b)\n"
    told = " ".join(d.message for d in found.missing)
    for word in ("g1", "g2", "both called `x`", "`counted`"):
        assert word in told, told

"""Requirements from CSV and ReqIF; refused with a place where they are not usable."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from avow.assurance.requirements_import import plan_section, read_csv, read_reqif, read_requirements
from avow.base.diagnostics import Rejected

REQIF = b"""<?xml version="1.0" encoding="UTF-8"?>
<REQ-IF xmlns="http://www.omg.org/spec/ReqIF/20110401/reqif.xsd"><CORE-CONTENT><REQ-IF-CONTENT>
<SPEC-TYPES><SPEC-OBJECT-TYPE IDENTIFIER="t"><SPEC-ATTRIBUTES>
<ATTRIBUTE-DEFINITION-STRING IDENTIFIER="a-id" LONG-NAME="ReqIF.ForeignID"/>
<ATTRIBUTE-DEFINITION-XHTML IDENTIFIER="a-text" LONG-NAME="ReqIF.Text"/>
</SPEC-ATTRIBUTES></SPEC-OBJECT-TYPE></SPEC-TYPES>
<SPEC-OBJECTS>
<SPEC-OBJECT IDENTIFIER="_1"><VALUES>
<ATTRIBUTE-VALUE-STRING THE-VALUE="SYS-1"><DEFINITION>
<ATTRIBUTE-DEFINITION-STRING-REF>a-id</ATTRIBUTE-DEFINITION-STRING-REF></DEFINITION></ATTRIBUTE-VALUE-STRING>
<ATTRIBUTE-VALUE-XHTML><DEFINITION><ATTRIBUTE-DEFINITION-XHTML-REF>a-text</ATTRIBUTE-DEFINITION-XHTML-REF></DEFINITION>
<THE-VALUE><div xmlns="http://www.w3.org/1999/xhtml">The rover <b>shall</b> stop: &lt;now&gt;.</div></THE-VALUE>
</ATTRIBUTE-VALUE-XHTML>
</VALUES></SPEC-OBJECT>
</SPEC-OBJECTS></REQ-IF-CONTENT></CORE-CONTENT></REQ-IF>"""


def test_csv_with_its_own_words_for_the_columns() -> None:
    found = read_csv('Identifier;Statement;Guarantees\r\nR 1;"Two\nlines; one cell";a.b, c\r\n\r\nR2;x;\r\n', "r.csv")
    assert [(r.id, r.text, r.supported_by) for r in found] == [
        ("R_1", "Two lines; one cell", ("a.b", "c")),
        ("R2", "x", ()),
    ]


def test_the_public_requirements_of_the_rover_are_read() -> None:
    path = Path("/work/shared/data/nasa_rover_requirements.csv")
    if not path.exists():
        pytest.skip("the data is not here")
    assert len(read_requirements(path)) > 10


def test_reqif() -> None:
    (found,) = read_reqif(REQIF, "r.reqif")
    assert (found.id, found.text) == ("SYS-1", "The rover shall stop: <now>.")


def test_the_section_is_yaml_that_says_the_same(tmp_path: Path) -> None:
    nasty = 'a: "quoted", {braces}, # hash, - dash, \\ and ∀ 𝔹\u2028'
    path = tmp_path / "r.csv"
    path.write_text('id,text\nR1,"' + nasty.replace('"', '""') + '"\nyes,on\n', encoding="utf-8")
    data = yaml.safe_load(plan_section(read_requirements(path)))
    assert data["requirements"]["R1"]["text"] == " ".join(nasty.split())
    assert data["requirements"]["yes"] == {"text": "on", "supported_by": []}


@pytest.mark.parametrize(
    ("text", "word", "line"),
    [
        ("", "empty", 1),
        ("a,b\n1,2\n", "no column", 1),
        ("id,text\nR1,x\nR1,y\n", "two requirements", 3),
        ("id,text\nR1,\n", "no text", 2),
        ("id,text\n\n", "no requirement below its header", 1),
        ("id,text\nR1," + "x" * 200_000 + "\n", "no CSV", 2),
    ],
)
def test_bad_csv_is_located(text: str, word: str, line: int) -> None:
    with pytest.raises(Rejected) as caught:
        read_csv(text, "r.csv")
    fault = caught.value.diagnostics[0]
    assert word in fault.message
    assert fault.span is not None
    assert fault.span.line == line


@pytest.mark.parametrize(
    "data",
    [
        b"<x",
        b"<x/>",
        b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><x>&b;</x>',
        b'<?xml version="1.0" encoding="nonsense"?><x/>',
        b"\xff\xfe\x00",
    ],
)
def test_bad_reqif_is_refused(data: bytes) -> None:
    with pytest.raises(Rejected):
        read_reqif(data, "r.reqif")


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_bytes(b"id,text\nR1,\xff\n")
    for path in (tmp_path / "r.csv", tmp_path / "none.csv", tmp_path):
        with pytest.raises(Rejected, match="export it as CSV" if path.name == "r.csv" else "cannot be read"):
            read_requirements(path)


@pytest.mark.parametrize("quoted", [lambda text: text, lambda text: f"'{text}'", lambda text: '""'])
def test_a_section_that_does_not_read_back_is_refused(
    quoted: Callable[[str], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("avow.assurance.requirements_import._quoted", quoted)
    with pytest.raises(Rejected, match="does not read back"):
        plan_section(read_csv('id,text\nR1,"it\'s: # so"\n', "f.csv"))

"""ReqIF as tools export it, and as an enemy would write it."""

from __future__ import annotations

import io
import random
import zipfile
from pathlib import Path

import pytest
from helpers import some

from avow.assurance import reqif
from avow.assurance.requirements_import import read_reqif, read_requirements
from avow.base.diagnostics import Rejected

NAMESPACES = 'xmlns="http://www.omg.org/spec/ReqIF/20110401/reqif.xsd" xmlns:xhtml="http://www.w3.org/1999/xhtml"'


def value(kind: str, definition: str, inner: str = "", the_value: str | None = None) -> str:
    attribute = f' THE-VALUE="{the_value}"' if the_value is not None else ""
    reference = (
        f"<DEFINITION><ATTRIBUTE-DEFINITION-{kind}-REF>{definition}</ATTRIBUTE-DEFINITION-{kind}-REF></DEFINITION>"
    )
    return f"<ATTRIBUTE-VALUE-{kind}{attribute}>{reference}{inner}</ATTRIBUTE-VALUE-{kind}>"


def xhtml(body: str) -> str:
    return f"<THE-VALUE>{body}</THE-VALUE>"


def thing(identifier: str, *values: str, kind: str = "type-requirement") -> str:
    return (
        f'<SPEC-OBJECT IDENTIFIER="{identifier}" LAST-CHANGE="2026-01-01T00:00:00+01:00">'
        f"<TYPE><SPEC-OBJECT-TYPE-REF>{kind}</SPEC-OBJECT-TYPE-REF></TYPE><VALUES>{''.join(values)}</VALUES></SPEC-OBJECT>"
    )


def hierarchy(target: str, *below: str) -> str:
    children = f"<CHILDREN>{''.join(below)}</CHILDREN>" if below else ""
    return (
        f'<SPEC-HIERARCHY IDENTIFIER="h-{target}"><OBJECT><SPEC-OBJECT-REF>{target}</SPEC-OBJECT-REF></OBJECT>'
        f"{children}</SPEC-HIERARCHY>"
    )


DEFINITIONS = """<DATATYPES><DATATYPE-DEFINITION-ENUMERATION IDENTIFIER="dt-asil" LONG-NAME="Levels"><SPECIFIED-VALUES>
<ENUM-VALUE IDENTIFIER="ev-b" LONG-NAME="agent.g2"/><ENUM-VALUE IDENTIFIER="ev-a" LONG-NAME="agent.g1"/>
</SPECIFIED-VALUES></DATATYPE-DEFINITION-ENUMERATION></DATATYPES>
<SPEC-TYPES><SPEC-OBJECT-TYPE IDENTIFIER="type-requirement" LONG-NAME="Requirement Type"><SPEC-ATTRIBUTES>
<ATTRIBUTE-DEFINITION-INTEGER IDENTIFIER="d-id" LONG-NAME="ReqIF.ForeignID"/>
<ATTRIBUTE-DEFINITION-XHTML IDENTIFIER="d-text" LONG-NAME="ReqIF.Text"/>
<ATTRIBUTE-DEFINITION-XHTML IDENTIFIER="d-chapter" LONG-NAME="ReqIF.ChapterName"/>
<ATTRIBUTE-DEFINITION-ENUMERATION IDENTIFIER="d-alloc" LONG-NAME="Allocated  To" MULTI-VALUED="true"><DEFAULT-VALUE>
<ATTRIBUTE-VALUE-ENUMERATION><DEFINITION><ATTRIBUTE-DEFINITION-ENUMERATION-REF>d-alloc</ATTRIBUTE-DEFINITION-ENUMERATION-REF>
</DEFINITION><VALUES><ENUM-VALUE-REF>ev-b</ENUM-VALUE-REF></VALUES></ATTRIBUTE-VALUE-ENUMERATION></DEFAULT-VALUE>
</ATTRIBUTE-DEFINITION-ENUMERATION>
</SPEC-ATTRIBUTES></SPEC-OBJECT-TYPE><SPEC-OBJECT-TYPE IDENTIFIER="type-heading" LONG-NAME="Heading"/>
<SPECIFICATION-TYPE IDENTIFIER="type-spec" LONG-NAME="Document"/></SPEC-TYPES>"""
ALLOCATION = "<VALUES><ENUM-VALUE-REF>ev-a</ENUM-VALUE-REF><ENUM-VALUE-REF>ev-b</ENUM-VALUE-REF></VALUES>"


def document(objects: str, hierarchies: str = "") -> str:
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<REQ-IF {NAMESPACES}><THE-HEADER><REQ-IF-HEADER IDENTIFIER="x">'
        "<COMMENT>an export</COMMENT><REQ-IF-VERSION>1.0</REQ-IF-VERSION></REQ-IF-HEADER></THE-HEADER>"
        f"<CORE-CONTENT><REQ-IF-CONTENT>{DEFINITIONS}<SPEC-OBJECTS>{objects}</SPEC-OBJECTS>"
        '<SPECIFICATIONS><SPECIFICATION IDENTIFIER="s">'
        "<TYPE><SPECIFICATION-TYPE-REF>type-spec</SPECIFICATION-TYPE-REF></TYPE>"
        f"<CHILDREN>{hierarchies}</CHILDREN></SPECIFICATION></SPECIFICATIONS></REQ-IF-CONTENT></CORE-CONTENT></REQ-IF>"
    )


EXPORT = document(
    thing(
        "_b",
        value("INTEGER", "d-id", the_value="12"),
        value(
            "XHTML",
            "d-text",
            xhtml(
                "<xhtml:div>The rover <xhtml:b>shall</xhtml:b> stop:<xhtml:ul><xhtml:li>at once</xhtml:li>"
                "<xhtml:li>if r &gt;= 250</xhtml:li></xhtml:ul><xhtml:br/>See ü &amp; ∀.</xhtml:div>"
            )
            + "<THE-ORIGINAL-VALUE><xhtml:p>old text</xhtml:p></THE-ORIGINAL-VALUE>",
        ),
        value("ENUMERATION", "d-alloc", ALLOCATION),
    )
    + thing("_h", value("XHTML", "d-chapter", xhtml("<xhtml:p>1 Safety</xhtml:p>")))
    + thing("_h2", value("XHTML", "d-text", xhtml("<xhtml:p>2 Other</xhtml:p>")), kind="type-heading")
    + thing("_c", value("XHTML", "d-text", xhtml('<xhtml:p><xhtml:object data="a.png" type="image/png"/></xhtml:p>')))
    + thing(
        "_a", value("INTEGER", "d-id", the_value="11"), value("XHTML", "d-text", xhtml("<p>first</p><p>second</p>"))
    ),
    hierarchy("_h", hierarchy("_a"), hierarchy("_h2", hierarchy("_b"))),
)


def test_an_export_is_read_in_the_order_of_its_chapters() -> None:
    found = read_reqif(EXPORT.encode(), "r.reqif")
    assert [(r.id, r.text) for r in found] == [
        ("R11", "first second"),
        ("R12", "The rover shall stop: at once if r >= 250 See ü & ∀."),
        ("c", "[a picture or embedded object]"),
    ]
    assert found[0].supported_by == ("agent.g2",), "the default of the attribute's definition"
    assert found[1].supported_by == ("agent.g1", "agent.g2")
    assert found[2].span is not None
    assert found[2].span.line > 1


LABELS = {"utf-8-sig": "utf-8", "utf-16-be": "UTF-16BE"}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
def test_other_encodings(encoding: str) -> None:
    text = EXPORT.replace("∀", "A").replace('encoding="UTF-8"', f'encoding="{LABELS.get(encoding, encoding)}"')
    assert read_reqif(text.encode(encoding), "r.reqif")[1].text.endswith("See ü & A.")


def test_an_archive_of_several_files(tmp_path: Path) -> None:
    path = tmp_path / "r.reqifz"
    other = document(thing("_z", value("XHTML", "d-text", xhtml("<p>another</p>"))))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.reqif", EXPORT)
        archive.writestr("files/a.png", b"\x89PNG")
        archive.writestr("b.reqif", other)
    assert [r.id for r in read_requirements(path)] == ["R11", "R12", "c", "z"]


def refused(data: bytes, word: str, file: str = "r.reqif") -> None:
    with pytest.raises(Rejected) as caught:
        read_reqif(data, file)
    assert word in caught.value.diagnostics[0].message, caught.value.diagnostics[0].message


LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]>'
EXTERNAL = '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
PARAMETER = '<!DOCTYPE x [<!ENTITY % p SYSTEM "http://127.0.0.1/x.dtd"> %p;]>'
OUTSIDE = '<!DOCTYPE x SYSTEM "http://127.0.0.1/x.dtd">'


@pytest.mark.parametrize("doctype", [LAUGHS, EXTERNAL, PARAMETER, OUTSIDE])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-be"])
@pytest.mark.parametrize("padding", [0, 300_000])
def test_document_types_are_refused_in_any_encoding_and_at_any_place(doctype: str, encoding: str, padding: int) -> None:
    head, body = EXPORT.replace('encoding="UTF-8"', f'encoding="{LABELS.get(encoding, encoding)}"').split("\n", 1)
    text = f"{head}\n<!-- {'x' * padding} -->{doctype}{body.replace('first', '&e;')}"
    refused(text.encode(encoding), "document type")


def test_undeclared_entities_are_refused_and_depth_does_no_harm() -> None:
    refused(EXPORT.replace("first", "&nbsp;").encode(), "not XML")
    assert read_reqif(EXPORT.replace("first", "<p>" * 100_000 + "first" + "</p>" * 100_000).encode(), "r.reqif")
    refused(("<a>" * 1_000_000).encode(), "not XML")
    refused(b"<a>\n<b>\n</c>\n</a>", "<b> of line 2 is not closed before this")


def test_archives_that_lie_or_burst_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reqif, "REQIF_BYTES", 1_000_000)
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a.reqif", "w") as stream:
        stream.write(b" " * 1_100_000)
    refused(bomb.getvalue(), "unpacks to more")
    refused(b"PK\x03\x04 not really", "no archive")
    empty = io.BytesIO()
    with zipfile.ZipFile(empty, "w") as archive:
        archive.writestr("../../etc/readme.txt", "x")
    refused(empty.getvalue(), "no .reqif")


def test_what_cannot_be_used_is_said_with_its_place() -> None:
    refused(document(thing("_1") + thing("_1")).encode(), "two objects")
    nameless = document(thing("_1", value("XHTML", "d-chapter", xhtml("<p>only a heading</p>"))))
    refused(nameless.encode(), "but for headings")
    textless = EXPORT.replace("ReqIF.Text", "Prose")
    refused(textless.encode(), "no attribute with the requirements' text; its attributes: ")
    twice = EXPORT.replace('THE-VALUE="12"', 'THE-VALUE="11"')
    with pytest.raises(Rejected) as caught:
        read_reqif(twice.encode(), "r.reqif")
    assert caught.value.diagnostics[0].span is not None


@pytest.mark.parametrize("seed", some(range(300), 60, slow=240))
def test_mutated_exports_are_read_or_refused(seed: int) -> None:
    rng = random.Random(seed)
    data = bytearray(EXPORT.encode())
    for _ in range(rng.randrange(1, 6)):
        at = rng.randrange(len(data))
        match rng.randrange(3):
            case 0:
                data[at] = rng.randrange(256)
            case 1:
                del data[at : at + rng.randrange(60)]
            case _:
                piece = rng.choice(
                    [b"<", b">", b"&", b"</THE-VALUE>", b"<THE-VALUE>", b"<SPEC-OBJECT>", b"\x00", b"-REF"]
                )
                data[at:at] = piece
    try:
        found = read_reqif(bytes(data), "r.reqif")
    except Rejected as rejected:
        codes = {d.code for d in rejected.diagnostics}
    else:
        codes = set()
        assert all(r.id and r.text for r in found)
    assert all(code.startswith("REQS") for code in codes)

"""ReqIF 1.x files (and .reqifz archives of them) as rows of cells, for the import of requirements.

Reads the exports of tools: attribute values by the long names of their definitions, XHTML as text with its blocks
separated, enumerations by their values' names, defaults if an object has no value of its own; in the order of the
specifications' hierarchies. Chapter headings are no requirements. A document type is refused: nothing is
fetched, nothing is expanded. Errors are diagnostics with a position.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Mapping
from typing import NoReturn
from xml.etree import ElementTree as ET
from xml.parsers import expat

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.malformed import xml_fault
from avow.base.plain import bare
from avow.base.tuning.sizes import REQIF_BYTES

_BLOCKS = frozenset(
    ("p", "div", "br", "hr", "li", "ul", "ol", "dl", "dt", "dd", "table", "caption", "tr", "td", "th", "pre")
) | {"blockquote", *(f"h{n}" for n in range(1, 7))}
"""XHTML elements that separate words."""
_OBJECT = " [a picture or embedded object] "
"""The text in place of an object that is no text: a requirement must not vanish because it is a picture."""
_VALUE, _DEFINITION = "ATTRIBUTE-VALUE-", "ATTRIBUTE-DEFINITION-"
_HEADING = ("reqif.chaptername", "chaptername", "heading")
_HEADING_TYPES = ("heading", "chapter", "headline")
_LINE = "line"
"""An attribute that `_parse` gives each element: the line where it begins."""

_Object = tuple[int, str, dict[str, str]]
"""Line, name (or identifier), and the values by the attributes' long names, in small letters, with single blanks."""


def read_objects(data: bytes, file: str) -> Iterator[_Object]:
    """Every object that is no heading. Raises Rejected."""
    for name, content in _documents(data, file):
        root = _parse(content, name)
        things: dict[str, ET.Element] = {}
        for thing in root.iter("SPEC-OBJECT"):
            if (key := thing.get("IDENTIFIER", "")) in things:
                raise Rejected(
                    Diagnostic("REQS003", f"{name}: two objects have the identifier '{key}'", _at(name, thing))
                )
            things[key] = thing
        if not things:
            raise Rejected(Diagnostic("REQS002", f"{name} holds no SPEC-OBJECT", Span(name, 1, 1, 1, 1)))
        definitions = [e for e in root.iter() if e.tag.startswith(_DEFINITION) and not e.tag.endswith("-REF")]
        names = {e.get("IDENTIFIER", ""): bare(e.get("LONG-NAME", "")) for e in definitions}
        enumerated = {e.get("IDENTIFIER", ""): e.get("LONG-NAME", "") for e in root.iter("ENUM-VALUE")}
        types = {e.get("IDENTIFIER", ""): e for e in root.iter("SPEC-OBJECT-TYPE")}
        order = [_text(ref) for part in root.iter("SPEC-HIERARCHY") for ref in part.findall("OBJECT/SPEC-OBJECT-REF")]
        for thing in dict.fromkeys([*(things[key] for key in order if key in things), *things.values()]):
            kind = types.get(next(map(_text, thing.iter("SPEC-OBJECT-TYPE-REF")), ""), ET.Element("none"))
            found = {**_values(kind, enumerated), **_values(thing, enumerated)}
            named = {names.get(key, ""): value for key, value in found.items()}
            if not _is_heading(named, bare(kind.get("LONG-NAME", ""))):
                shown = thing.get("LONG-NAME", "") or thing.get("IDENTIFIER", "")
                yield _at(name, thing).line, shown, named


def _values(holder: ET.Element, enumerated: Mapping[str, str]) -> dict[str, str]:
    """Definition → value, of an object, or of the defaults of a type's definitions."""
    found = {}
    for value in (e for e in holder.iter() if e.tag.startswith(_VALUE)):
        text = value.find("THE-VALUE")
        parts = [value.get("THE-VALUE", "") if text is None else "".join(text.itertext())]
        parts += [enumerated.get(mark, mark) for mark in map(_text, value.iter("ENUM-VALUE-REF"))]
        definition = next((_text(ref) for part in value.findall("DEFINITION") for ref in part), "")
        found[definition] = " ".join(", ".join(filter(None, parts)).split())
    return found


def _text(element: ET.Element) -> str:
    return (element.text or "").strip()


def _at(file: str, element: ET.Element) -> Span:
    line = int(element.get(_LINE, "1"))
    return Span(file, line, 1, line, 1)


def _is_heading(values: Mapping[str, str], kind: str) -> bool:
    """A chapter's title is for readers, and no requirement."""
    if any(word in kind for word in _HEADING_TYPES):
        return True
    texts = [v for name, v in values.items() if "text" in name or name in ("description", "statement")]
    return any(values.get(name) for name in _HEADING) and not any(texts)


def _parse(data: bytes, file: str) -> ET.Element:
    """The tree, with names without their namespaces, and blanks where XHTML's blocks begin and end."""
    builder, parser = ET.TreeBuilder(), expat.ParserCreate(namespace_separator="}")

    def refuse(*_: object) -> NoReturn:
        line = parser.CurrentLineNumber
        message = f"{file} declares a document type or entities: that is not accepted"
        raise Rejected(Diagnostic("REQS003", message, Span(file, line, 1, line, 1)))

    def start(name: str, attributes: dict[str, str]) -> None:
        tag = name.rpartition("}")[2]
        builder.data(" " if tag.lower() in _BLOCKS else _OBJECT if tag.lower() == "object" else "")
        builder.start(tag, {**attributes, _LINE: str(parser.CurrentLineNumber)})

    def end(name: str) -> None:
        tag = name.rpartition("}")[2]
        builder.end(tag)
        builder.data(" " if tag.lower() in _BLOCKS else "")

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, builder.data
    try:
        parser.Parse(data, True)
        return builder.close()
    except expat.ExpatError as error:
        wrong = xml_fault(data, error)
        where = Span(file, wrong.line, wrong.column, wrong.line, wrong.column)
        raise Rejected(Diagnostic("REQS003", str(wrong), where, hint=wrong.hint)) from None
    except (ValueError, LookupError) as error:  # an encoding that Python does not know
        raise Rejected(Diagnostic("REQS003", f"this is not XML: {error}", Span(file, 1, 1, 1, 1))) from None


def _documents(data: bytes, file: str) -> Iterator[tuple[str, bytes]]:
    """The file, or the .reqif files within an archive; nothing is unpacked to the disk."""
    if not data.startswith(b"PK\x03\x04"):
        yield file, data
        return
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            inside = [i for i in archive.infolist() if i.filename.lower().endswith((".reqif", ".xml"))]
            if sum(i.file_size for i in inside) > REQIF_BYTES:
                raise Rejected(Diagnostic("REQS001", f"{file} unpacks to more than {REQIF_BYTES // 1_000_000} MB"))
            found = [(f"{file}:{item.filename}", archive.read(item)) for item in inside]
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError, EOFError, ValueError) as error:
        raise Rejected(Diagnostic("REQS001", f"{file} is no archive that can be read: {error}")) from None
    if not found:
        raise Rejected(Diagnostic("REQS002", f"{file} holds no .reqif file"))
    yield from found

"""ReqIF 1.x files (and .reqifz archives of them) as rows of cells, for the import of requirements.

Reads the exports of tools: attribute values by the long names of their definitions, XHTML as text with its blocks
separated, enumerations by their values' names, defaults if an object has no value of its own; in the order of the
specifications' hierarchies. Chapter headings are no requirements. A document type is refused when it begins, in any
encoding: nothing is fetched, nothing is expanded. Errors are diagnostics with a position.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NoReturn
from xml.parsers import expat

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.plain import bare
from avow.base.tuning.sizes import REQIF_BYTES, REQIF_DEPTH

_BLOCKS = frozenset(
    ("p", "div", "br", "hr", "li", "ul", "ol", "dl", "dt", "dd", "table", "caption", "tr", "td", "th", "pre")
) | {"blockquote", *(f"h{n}" for n in range(1, 7))}
"""XHTML elements that separate words."""
_OBJECT = " [a picture or embedded object] "
"""The text in place of an object that is no text: a requirement must not vanish because it is a picture."""
_VALUE, _DEFINITION = "ATTRIBUTE-VALUE-", "ATTRIBUTE-DEFINITION-"
_HEADING = ("reqif.chaptername", "chaptername", "heading")
_HEADING_TYPES = ("heading", "chapter", "headline")


@dataclass(slots=True)
class Thing:
    """A SPEC-OBJECT: its values by the definitions' identifiers, and its line."""

    line: int
    identifier: str
    name: str
    kind: str = ""
    values: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class _ReqifReader:
    """Builds no tree: values are recorded while the file is read."""

    file: str
    parser: expat.XMLParserType
    path: list[str] = field(default_factory=list)
    things: dict[str, Thing] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)
    """Definition → long name."""
    defaults: dict[str, dict[str, str]] = field(default_factory=dict)
    """Object type → definition → default value."""
    types: dict[str, str] = field(default_factory=dict)
    """Object type → long name."""
    enumerated: dict[str, str] = field(default_factory=dict)
    order: dict[str, None] = field(default_factory=dict)
    """Objects in the order of the hierarchies."""
    thing: Thing | None = None
    type: str = ""
    definition: str = ""
    """The attribute definition that is being read, for its default."""
    value: str = ""
    """The text of the attribute value that is being read."""
    reference: str = ""
    text: list[str] = field(default_factory=list)
    in_text: int = 0
    """The depth within the value's XHTML."""

    def start(self, name: str, attributes: dict[str, str]) -> None:
        tag = name.rpartition("}")[2]
        if len(self.path) >= REQIF_DEPTH:
            raise Rejected(Diagnostic("REQS003", f"{self.file}: elements nest too deeply", self.at()))
        self.path.append(tag)
        if self.in_text:
            self.in_text += 1
            if tag.lower() in _BLOCKS:
                self.text.append(" ")
            elif tag.lower() == "object":
                self.text.append(_OBJECT)
        elif tag == "THE-VALUE":
            self.in_text, self.text = 1, []
        elif tag == "SPEC-OBJECT":
            self.thing = Thing(self.at().line, attributes.get("IDENTIFIER", ""), attributes.get("LONG-NAME", ""))
        elif tag in ("SPEC-OBJECT-TYPE", "SPECIFICATION-TYPE", "SPEC-RELATION-TYPE"):
            self.type = attributes.get("IDENTIFIER", "")
            self.types[self.type] = attributes.get("LONG-NAME", "")
        elif tag == "ENUM-VALUE":
            self.enumerated[attributes.get("IDENTIFIER", "")] = attributes.get("LONG-NAME", "")
        elif tag.startswith(_VALUE):
            self.value, self.reference = attributes.get("THE-VALUE", ""), ""
        elif tag.startswith(_DEFINITION) and not tag.endswith("-REF"):
            self.definition = attributes.get("IDENTIFIER", "")
            self.names[self.definition] = attributes.get("LONG-NAME", "")
        elif tag.endswith("-REF"):
            self.text = []

    def data(self, data: str) -> None:
        if self.in_text or (self.path and self.path[-1].endswith("-REF")):
            self.text.append(data)

    def end(self, name: str) -> None:
        tag = self.path.pop()
        if self.in_text:
            self.in_text -= 1
            if self.in_text:
                if tag.lower() in _BLOCKS:
                    self.text.append(" ")
            else:
                self.value = "".join(self.text)
        elif tag.endswith("-REF"):
            self.refer(tag, "".join(self.text).strip())
        elif tag.startswith(_VALUE):
            self.settle()
        elif tag == "SPEC-OBJECT" and self.thing is not None:
            if self.thing.identifier in self.things:
                message = f"{self.file}: two objects have the identifier '{self.thing.identifier}'"
                raise Rejected(Diagnostic("REQS003", message, self.at()))
            self.things[self.thing.identifier] = self.thing
            self.thing = None

    def refer(self, tag: str, target: str) -> None:
        if tag.startswith(_DEFINITION):
            self.reference = target
        elif tag == "ENUM-VALUE-REF":
            self.value = f"{self.value}\x00{target}"  # its name may come later in the file
        elif tag == "SPEC-OBJECT-TYPE-REF" and self.thing is not None:
            self.thing.kind = target
        elif tag == "SPEC-OBJECT-REF" and "SPEC-HIERARCHY" in self.path:
            self.order.setdefault(target)

    def settle(self) -> None:
        """Stores a value as an object's, or as the default in a definition."""
        if self.thing is not None:
            self.thing.values[self.reference] = self.value
        elif "DEFAULT-VALUE" in self.path and self.type:
            self.defaults.setdefault(self.type, {})[self.reference or self.definition] = self.value
        self.value = ""

    def at(self) -> Span:
        line, column = self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1
        return Span(self.file, line, column, line, column)


def read_objects(data: bytes, file: str) -> Iterator[tuple[Thing, dict[str, str]]]:
    """Every object that is no heading, with its values by the attributes' long names (in small letters, single blanks).
    Raises Rejected."""
    for name, content in _documents(data, file):
        reader = _parse(content, name)
        if not reader.things:
            raise Rejected(Diagnostic("REQS002", f"{name} holds no SPEC-OBJECT", Span(name, 1, 1, 1, 1)))
        listed = [reader.things[key] for key in reader.order if key in reader.things]
        listed += [thing for key, thing in reader.things.items() if key not in reader.order]
        for thing in listed:
            values = {**reader.defaults.get(thing.kind, {}), **thing.values}
            named = {bare(reader.names.get(key, "")): _plain(v, reader.enumerated) for key, v in values.items()}
            if not _is_heading(named, bare(reader.types.get(thing.kind, ""))):
                yield thing, named


def _is_heading(values: Mapping[str, str], kind: str) -> bool:
    """A chapter's title is for readers, and no requirement."""
    if any(word in kind for word in _HEADING_TYPES):
        return True
    texts = [v for name, v in values.items() if "text" in name or name in ("description", "statement")]
    return any(values.get(name) for name in _HEADING) and not any(texts)


def _plain(value: str, enumerated: Mapping[str, str]) -> str:
    first, *marks = value.split("\x00")
    return " ".join(", ".join([*([first] if first else []), *(enumerated.get(m, m) for m in marks)]).split())


def _parse(data: bytes, file: str) -> _ReqifReader:
    parser = expat.ParserCreate(namespace_separator="}")
    reader = _ReqifReader(file, parser)

    def refuse(*_: object) -> NoReturn:
        message = f"{file} declares a document type or entities: that is not accepted"
        raise Rejected(Diagnostic("REQS003", message, reader.at()))

    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.data
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        where = Span(file, error.lineno, error.offset + 1, error.lineno, error.offset + 1)
        raise Rejected(Diagnostic("REQS003", f"{file} is no XML: {expat.ErrorString(error.code)}", where)) from None
    except (ValueError, LookupError) as error:  # an encoding that Python does not know
        raise Rejected(Diagnostic("REQS003", f"{file} is no XML: {error}", Span(file, 1, 1, 1, 1))) from None
    return reader


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
            found = []
            for item in inside:
                with archive.open(item) as stream:  # no more than the stated size: an archive may lie about its sizes
                    found.append((f"{file}:{item.filename}", stream.read(item.file_size + 1)))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError, EOFError, ValueError) as error:
        raise Rejected(Diagnostic("REQS001", f"{file} is no archive that can be read: {error}")) from None
    if not found:
        raise Rejected(Diagnostic("REQS002", f"{file} holds no .reqif file"))
    yield from found

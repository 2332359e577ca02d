"""`avow check --sarif` through an independent reader, `--json` against its published schema: every severity, and paths
that a careless writer would get wrong."""

from __future__ import annotations

import json
import os
from pathlib import Path
from urllib.parse import unquote_to_bytes

import jsonschema
import pytest
from sarif import loader

from avow.base.codec import to_json
from avow.base.codes import LANGUAGE, sections
from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.rendering import to_sarif, told
from avow.cli import main
from avow.language.load import check_text

ROOT = Path(__file__).parents[2]
SCHEMA = json.loads((ROOT / "docs" / "schemas" / "check.schema.json").read_text("utf-8"))
SARIF = json.loads((ROOT / "tests" / "report" / "sarif.subset.schema.json").read_text("utf-8"))
# What the report's logs do not have, as SARIF 2.1.0 defines it (3.49.9, 3.27.22).
_RUN, _RESULT = SARIF["$defs"]["run"]["properties"], SARIF["$defs"]["result"]["properties"]
_RUN["tool"]["properties"]["driver"]["properties"]["rules"]["items"]["properties"]["fullDescription"] = {
    "$ref": "#/$defs/message"
}
_PLACE = {**_RESULT["locations"]["items"]["properties"], "id": {"type": "integer", "minimum": 0}}
_PLACE["message"] = {"$ref": "#/$defs/message"}
_PLACE["physicalLocation"]["properties"]["artifactLocation"]["properties"]["uri"]["pattern"] = (
    "^(file://)?[A-Za-z0-9/._~%-]+$"
)
_RESULT["relatedLocations"] = {
    "type": "array",
    "items": {"type": "object", "additionalProperties": False, "properties": _PLACE},
}
BAD = """\
context { S : {red, green}; }
node n {
  inputs( a : BOOL, b : BOOL, s : S )
  outputs( é : BOOL, o : S )
  topics()
  guarantee( in.a and in.b -> out.o == gren )
}
"""
NAMES = (
    "plain.rcl",
    "with space.rcl",
    "100%.rcl",
    "a%20b.rcl",
    "#hash?query.rcl",
    "é∀🤖.rcl",
    "back\\slash.rcl",
    "a&b;'\".rcl",
)


def wide(names: tuple[str, ...] = NAMES) -> list[Diagnostic]:
    """Every code with its greatest severity, and notes, in every file."""
    found = []
    for i, code in enumerate(sections()[LANGUAGE].values()):
        name = names[i % len(names)]
        note = (("see here", Span(name, 1, 2, 1, 3)), ("and mind", None))
        found.append(
            Diagnostic(code.code, f"message {i} `{name}`", Span(name, i + 1, 2, i + 2, 3), code.severity, "do", note)
        )
    found.append(Diagnostic("RCL405", "a note", Span(names[0], 1, 1, 1, 1), Severity.NOTE))
    found.append(Diagnostic("RCL002", "no place at all"))
    return found


def read(folder: Path, log: dict[str, object]):  # type: ignore[no-untyped-def]
    path = folder / "check.sarif"
    path.write_text(json.dumps(log), "utf-8")
    return loader.load_sarif_file(str(path))


def test_sarif_tools_reads_every_severity_and_path(tmp_path: Path) -> None:
    found = wide()
    log = to_sarif(found, version="1")
    jsonschema.validate(log, SARIF)
    file = read(tmp_path, log)
    assert file.get_result_count() == len(found)
    records = file.get_records()
    assert {r["Severity"] for r in records} == {"error", "warning", "note"}
    for diagnostic, record in zip(found, records, strict=True):
        assert record["Severity"] == str(diagnostic.severity)
        assert record["Code"] == diagnostic.code
        assert diagnostic.message in record["Description"]
        if diagnostic.span is not None:
            assert unquote_to_bytes(record["Location"]) == diagnostic.span.file.encode()
            assert record["Line"] == diagnostic.span.line
    assert file.get_distinct_tool_names() == ["avow"]
    assert set(file.get_report().get_issue_type_histogram_for_severity("note")) == {"RCL405 a note"}


def test_json_keeps_to_its_schema() -> None:
    for found in (wide(), [], list(check_text(BAD, "é %.rcl")[1])):
        document = to_json(told(found))
        jsonschema.validate(document, SCHEMA)
        assert len(json.loads(json.dumps(document))["diagnostics"]) == len(found)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"diagnostics": [{"file": None}]}, SCHEMA)


@pytest.mark.parametrize("name", [*NAMES, "sub folder/é.rcl"])
def test_the_command_on_files_so_called(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(BAD, "utf-8")
    with pytest.raises(SystemExit):
        main(["check", "--sarif", name])
    log = json.loads(capsys.readouterr().out)
    jsonschema.validate(log, SARIF)
    records = read(tmp_path, log).get_records()
    assert {unquote_to_bytes(r["Location"]) for r in records} == {os.fsencode(name)}
    with pytest.raises(SystemExit):
        main(["check", "--json", str(path)])
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, SCHEMA)
    assert [d["code"] for d in document["diagnostics"]] == [r["Code"] for r in records]
    assert {d["file"] for d in document["diagnostics"]} == {str(path)}
    assert {"RCL107", "RCL201"} <= {d["code"] for d in document["diagnostics"]}


def test_an_absolute_path_is_a_file_uri(tmp_path: Path) -> None:
    absolute = str(tmp_path / "a b%.rcl")
    (result,) = to_sarif([Diagnostic("RCL001", "m", Span(absolute, 1, 1, 1, 1))])["runs"][0]["results"]
    uri = result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    assert uri.startswith("file:///")
    assert uri.endswith("a%20b%25.rcl")

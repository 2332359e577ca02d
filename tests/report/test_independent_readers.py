"""SARIF and in-toto statements through the readers that others use."""

from __future__ import annotations

from pathlib import Path

import pytest
from assurance.sample import rover_case
from google.protobuf import json_format
from helpers import every_text
from in_toto_attestation.v1 import statement_pb2
from in_toto_attestation.v1.statement import Statement
from sarif import loader

from report.hostile import hostile_case

CASES = {"rover": rover_case, "hostile": hostile_case}


@pytest.mark.parametrize("name", list(CASES))
def test_sarif_tools_reads_both_profiles(name: str, tmp_path: Path) -> None:
    case = CASES[name]()
    texts = dict(every_text(case))
    counts = {}
    for profile in ("report.sarif", "findings.sarif"):
        (tmp_path / profile).write_text(str(texts[profile]), encoding="utf-8")
        counts[profile] = loader.load_sarif_file(str(tmp_path / profile)).get_result_count()
    assert counts["report.sarif"] >= len(case.obligations)
    assert 0 < counts["findings.sarif"] < counts["report.sarif"]


@pytest.mark.parametrize("name", list(CASES))
def test_in_toto_validates_every_statement(name: str) -> None:
    case = CASES[name]()
    lines = str(dict(every_text(case))["attestation.jsonl"]).splitlines()
    assert lines
    for line in lines:
        message = statement_pb2.Statement()
        json_format.Parse(line, message)
        Statement.copy_from_pb(message).validate()


def test_a_broken_statement_is_refused() -> None:
    line = str(dict(every_text(rover_case()))["attestation.jsonl"]).splitlines()[0]
    message = statement_pb2.Statement()
    json_format.Parse(line.replace("https://in-toto.io/Statement/v1", "https://in-toto.io/Statement/v9"), message)
    with pytest.raises(ValueError, match="type"):
        Statement.copy_from_pb(message).validate()

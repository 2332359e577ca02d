"""Names of persons in a plan can be read, wherever they stand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from avow.base.diagnostics import Rejected
from avow.system.load import load_system

RCL = "node made { inputs( r : REAL ) outputs( u : REAL ) topics() guarantee g ( out.u == in.r ) }"


@pytest.mark.parametrize("who", ["Ada L\u200bovelace", "?", "TBD"])
@pytest.mark.parametrize(
    "place",
    [
        {"environment": {"in.r": {"assume": "in.r > 0", "because": "so it is", "who": "…"}}},
        {"assumptions": {"hoare.x": {"says": "it is so", "because": "so it is", "who": "…"}}},
        {
            "requirements": {
                "R": {
                    "text": "It is.",
                    "supported_by": ["made"],
                    "validation": {"who": "…", "date": "2026-01-01", "sentence": "0"},
                }
            }
        },
        {
            "accepted": [
                {
                    "obligation": "made/guarantee/g",
                    "verdict": "refuted",
                    "reason": "r",
                    "who": "…",
                    "date": "2026-01-01",
                    "expires": "2027-01-01",
                }
            ],
        },
    ],
    ids=["environment", "assumptions", "validation", "accepted"],
)
def test_a_name_that_nobody_can_read_signs_nothing(tmp_path: Path, who: str, place: dict[str, Any]) -> None:
    (tmp_path / "system.rcl").write_text(RCL)
    plan = tmp_path / "plan.yaml"
    plan.write_text(json.dumps(place).replace("\\u2026", "A. Person"))
    assert not [text for text in _told(tmp_path) if "names no person" in text]
    plan.write_text(json.dumps(place).replace("\\u2026", json.dumps(who)[1:-1]))
    assert len([text for text in _told(tmp_path) if "names no person" in text]) == 1


def _told(folder: Path) -> list[str]:
    try:
        load_system(folder)
    except Rejected as rejected:
        return [d.message for d in rejected.diagnostics]
    return []

"""The page's example is valid, and its claims about options are complete."""

from __future__ import annotations

import re
from pathlib import Path

import jsonschema
import yaml

from avow.backends.rosmonitoring import BACKEND

PAGE = (Path(__file__).parents[2] / "docs" / "backends" / "rosmonitoring.md").read_text(encoding="utf-8")


def test_the_example_is_valid() -> None:
    blocks = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
    assert blocks
    for block in blocks:
        ((name, options),) = yaml.safe_load(block)[0].items()
        assert name == "rosmonitoring"
        jsonschema.validate(options, dict(BACKEND.options_schema))


def test_every_option_is_documented() -> None:
    for option in BACKEND.options_schema["properties"]:
        assert f"`{option}`" in PAGE or option in ("id", "guarantees"), option
    rule = BACKEND.options_schema["properties"]["mapping"]["additionalProperties"]["oneOf"][2]
    for key in rule["properties"]:
        assert re.search(rf"`?\b{key}\b:?", PAGE), key

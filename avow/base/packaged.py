"""Data files of Avow's own packages."""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any


@cache
def packaged(package: str, name: str) -> Any:
    """What a .json or .yaml file in a package says. It is read once: do not change what is returned."""
    text = resources.files(package).joinpath(name).read_text(encoding="utf-8")
    if name.endswith(".json"):
        return json.loads(text)
    import yaml  # slow, and not needed to import a backend

    return yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))

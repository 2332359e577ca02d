"""Parsers of Lark's, whose tables are kept between runs: to build them costs more than to parse most texts."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from avow.base.files import sha256


def lark_of(grammar: Path, name: str, **options: Any) -> Any:
    """Lark's parser of a grammar's file. `name`: with which that of the file in which its tables are kept begins."""
    from lark import Lark

    text = grammar.read_text("utf-8")
    cache = _cache_file(f"{name}-{sha256(text)[:12]}")  # two versions on one machine keep their own
    if cache is not None:
        try:
            return Lark(text, cache=str(cache), **options)
        except (OSError, ValueError, EOFError, AttributeError, KeyError):
            pass
    return Lark(text, **options)


def _cache_file(name: str) -> Path | None:
    """A file in a folder of the user's own, since Lark's cache is a pickle."""
    try:
        base = os.environ.get("XDG_CACHE_HOME")
        folder = (Path(base) if base else Path.home() / ".cache") / "avow"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.stat().st_uid != os.getuid() or not os.access(folder, os.W_OK):
            return None
    except (OSError, AttributeError, RuntimeError):
        return None
    return folder / f"{name}-{sys.version_info.major}{sys.version_info.minor}.lark"

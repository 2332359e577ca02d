"""Parsers of Lark's, whose tables are kept between runs: to build them costs more than to parse most texts."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from avow.base.files import digest_file, sha256
from avow.base.notes import cache_folder, read_note, write_note


@functools.cache
def lark_of(
    grammar: Path, name: str, start: tuple[str, ...], build: Callable[[], object] | None = None, **options: Any
) -> Any:
    """Lark's LALR parser of a grammar's file, made once. `name`: with which that of the file in which its tables are
    kept begins. `build` makes what is called for each rule."""
    from lark import Lark

    options |= {"parser": "lalr", "start": list(start), "lexer": options.get("lexer", "basic")}
    if build is not None:
        options["transformer"] = build()
    text = grammar.read_text("utf-8")
    cache = _cache_file(f"{name}-{sha256(text)[:12]}")  # two versions on one machine keep their own
    if cache is None:
        return Lark(text, **options)
    note = cache.with_suffix(".json")
    try:
        written = digest_file(cache)
        known = (read_note(dict[str, str], note) or {}).get("digest") == written
        if not known:
            cache.unlink()
    except FileNotFoundError:
        known = False
    except OSError:
        return Lark(text, **options)
    try:
        parser = Lark(text, cache=str(cache), **options)
    except (OSError, ValueError, EOFError, AttributeError, KeyError):
        return Lark(text, **options)
    if not known:
        with contextlib.suppress(OSError):
            write_note(note, {"digest": digest_file(cache)})
    return parser


def _cache_file(name: str) -> Path | None:
    """A file in a folder of the user's own, since Lark's cache is a pickle: it is read only where this user's Avow
    wrote it, byte for byte. Tables that somebody else put there would execute, or make `<=` of `<`."""
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.stat().st_uid != os.getuid() or not os.access(folder, os.W_OK):
            return None
    except (OSError, AttributeError, RuntimeError):
        return None
    return folder / f"{name}-{sys.version_info.major}{sys.version_info.minor}.lark"

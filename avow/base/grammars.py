"""Lark parsers with tables cached between runs: building them costs more than parsing most texts."""

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
    """Lark's LALR parser of a grammar's file, made once. `name`: the prefix of the cache file's name. `build` makes the
    callbacks of the rules."""
    from lark import Lark

    options |= {"parser": "lalr", "start": list(start), "lexer": options.get("lexer", "basic")}
    if build is not None:
        options["transformer"] = build()
    text = grammar.read_text("utf-8")
    cache = _cache_file(f"{name}-{sha256(text)[:12]}")  # each version on a machine has its own
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


def misfit(error: Any, text: str) -> tuple[str, int]:
    """The word at which Lark could not continue, and its offset; an empty word at the end of the text."""
    ended = getattr(getattr(error, "token", None), "type", "") == "$END"
    at = len(text) if ended else error.pos_in_stream or 0
    return next(iter(text[at:].split(maxsplit=1)), ""), at


def _cache_file(name: str) -> Path | None:
    """A file in the user's own folder, since Lark's cache is a pickle: it is read only if this user's Avow wrote it,
    byte for byte. Other content could execute code or turn `<` into `<=`."""
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if folder.stat().st_uid != os.getuid() or not os.access(folder, os.W_OK):
            return None
    except (OSError, AttributeError, RuntimeError):
        return None
    return folder / f"{name}-{sys.version_info.major}{sys.version_info.minor}.lark"

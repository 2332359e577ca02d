"""AJPF's answers, and what AIL told of runs, kept: one property takes seconds to hours, and the same files have the
same answer.

Only what it decided is kept, with all that it printed, under a digest of everything that it was given: program,
environment, property, MCAPL's own files, Java. The note is bound to this user (`notes`): an edited one is none.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

from avow.base.notes import cache_folder, read_note, write_note
from avow.isolation.observed import Observed, look

from .ajpf_tool import Answer, Said

K = TypeVar("K", "_Kept", "_Told")
_FORM = 3
"""Of what is asked and how answers are read: another number, and nothing that was kept counts."""


def key(files: Mapping[str, str], formula: str, mark: str) -> str:
    """Of one question to one installation (`Installation.mark`)."""
    asked = {name: text for name, text in files.items() if not name.endswith(".psl")}
    return sha256(json.dumps([_FORM, asked, formula, mark], sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class _Kept:
    """What AJPF decided (`Answer`); `observed` in both, of what it looked at besides its files."""

    said: Said
    path: tuple[int, ...]
    log: str
    framework: str
    observed: tuple[Observed, ...]


@dataclass(frozen=True, slots=True)
class _Told:
    """What AIL printed."""

    told: str
    observed: tuple[Observed, ...]


def recall(key: str) -> Answer | None:
    kept = _as_it_was(_Kept, key)
    if kept is None or kept.said not in (Said.HOLDS, Said.VIOLATED):
        return None
    return Answer(kept.said, "", kept.path, kept.log, kept.framework, kept=True, observed=kept.observed)


def keep(key: str, answer: Answer) -> None:
    """Where it cannot be written, it will be asked again."""
    if answer.said not in (Said.HOLDS, Said.VIOLATED):
        return
    with suppress(OSError):
        write_note(_path(key), _Kept(answer.said, answer.path, answer.log, answer.framework, answer.observed))


def told(key: str) -> tuple[str, tuple[Observed, ...]] | None:
    """What AIL printed in a run with these files, and what it looked at, where that was kept."""
    kept = _as_it_was(_Told, key)
    return (kept.told, kept.observed) if kept is not None else None


def keep_told(key: str, text: str, observed: tuple[Observed, ...]) -> None:
    """Where it cannot be written, the run will be done again."""
    with suppress(OSError):
        write_note(_path(key), _Told(text, observed))


def _as_it_was(kind: type[K], key: str) -> K | None:
    """What was kept, where all that was looked at is as it was."""
    kept = read_note(kind, _path(key))
    return kept if kept is not None and all(look(o.kind, o.path) == o.digest for o in kept.observed) else None


def _path(key: str) -> Path:
    return cache_folder() / "ajpf" / f"{key}.json"

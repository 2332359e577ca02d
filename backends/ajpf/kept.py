"""AJPF's answers, and what AIL told of runs, kept: one property takes seconds to hours, and the same files have the
same answer.

Only what it decided is kept, with all that it printed, under a digest of everything that it was given: program,
environment, property, MCAPL's own files, Java. The note is bound to this user (`notes`): an edited one is none.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from avow.base.notes import cache_folder, read_note, write_note

from .ajpf_tool import Answer, Said

_FORM = 1
"""Of what is asked and how answers are read: another number, and nothing that was kept counts."""


def key(files: Mapping[str, str], formula: str, mark: str) -> str:
    """Of one question to one installation (`Installation.mark`)."""
    asked = {name: text for name, text in files.items() if not name.endswith(".psl")}
    return sha256(json.dumps([_FORM, asked, formula, mark], sort_keys=True).encode()).hexdigest()


def recall(key: str) -> Answer | None:
    data = read_note(_path(key))
    if data is None or data.get("said") not in (Said.HOLDS, Said.VIOLATED):
        return None
    return Answer(Said(data["said"]), path=tuple(data["path"]), log=data["log"], framework=data["framework"], kept=True)


def keep(key: str, answer: Answer) -> None:
    """Where it cannot be written, it will be asked again."""
    if answer.said not in (Said.HOLDS, Said.VIOLATED):
        return
    said = {"said": str(answer.said), "path": list(answer.path), "log": answer.log, "framework": answer.framework}
    with suppress(OSError):
        write_note(_path(key), said)


def told(key: str) -> str | None:
    """What AIL printed in a run with these files, where that was kept."""
    data = read_note(_path(key))
    text = None if data is None else data.get("told")
    return text if isinstance(text, str) else None


def keep_told(key: str, text: str) -> None:
    """Where it cannot be written, the run will be done again."""
    with suppress(OSError):
        write_note(_path(key), {"told": text})


def _path(key: str) -> Path:
    return cache_folder() / "ajpf" / f"{key}.json"

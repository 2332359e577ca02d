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
from typing import Any

from avow.base.codec import Unreadable, from_json, to_json
from avow.base.notes import cache_folder, read_note, write_note
from avow.evidence.record import OBSERVED
from avow.isolation.observed import Observed, look

from .ajpf_tool import Answer, Said

_FORM = 3
"""Of what is asked and how answers are read: another number, and nothing that was kept counts."""


def key(files: Mapping[str, str], formula: str, mark: str) -> str:
    """Of one question to one installation (`Installation.mark`)."""
    asked = {name: text for name, text in files.items() if not name.endswith(".psl")}
    return sha256(json.dumps([_FORM, asked, formula, mark], sort_keys=True).encode()).hexdigest()


def recall(key: str) -> Answer | None:
    data = read_note(_path(key))
    if data is None or data.get("said") not in (Said.HOLDS, Said.VIOLATED):
        return None
    said, observed = Said(data["said"]), _as_it_was(data)
    if observed is None:
        return None
    return Answer(said, "", tuple(data["path"]), data["log"], data["framework"], kept=True, observed=observed)


def keep(key: str, answer: Answer) -> None:
    """Where it cannot be written, it will be asked again."""
    if answer.said not in (Said.HOLDS, Said.VIOLATED):
        return
    said = {"said": str(answer.said), "path": list(answer.path), "log": answer.log, "framework": answer.framework}
    said[OBSERVED] = to_json(answer.observed)
    with suppress(OSError):
        write_note(_path(key), said)


def told(key: str) -> tuple[str, tuple[Observed, ...]] | None:
    """What AIL printed in a run with these files, and what it looked at, where that was kept."""
    data = read_note(_path(key))
    text, observed = (data.get("told"), _as_it_was(data)) if data is not None else (None, None)
    return (text, observed) if isinstance(text, str) and observed is not None else None


def keep_told(key: str, text: str, observed: tuple[Observed, ...]) -> None:
    """Where it cannot be written, the run will be done again."""
    with suppress(OSError):
        write_note(_path(key), {"told": text, OBSERVED: to_json(observed)})


def _as_it_was(data: Mapping[str, Any]) -> tuple[Observed, ...] | None:
    """What was looked at, where all of it is as it was."""
    try:
        observed = from_json(tuple[Observed, ...], data.get(OBSERVED, []))
    except Unreadable:
        return None
    return observed if all(look(o.kind, o.path) == o.digest for o in observed) else None


def _path(key: str) -> Path:
    return cache_folder() / "ajpf" / f"{key}.json"

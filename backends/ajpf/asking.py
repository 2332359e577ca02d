"""AJPF run for all properties of an agent: in a folder of our own, several at a time, each with its own limit.

One property takes seconds to hours, and the same files have the same answer: decisive answers are cached, with all
output, under a digest of all inputs: program, environment, property, MCAPL's own files, Java. The note is bound to this
user (`notes`): an edited one is ignored.
"""

from __future__ import annotations

import json
import os
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from math import ceil
from pathlib import Path

from avow.base.files import sha256
from avow.base.notes import cache_folder, read_note, write_note
from avow.isolation.observed import look
from avow.isolation.outside import Outside

from . import psl
from .ajpf_tool import AjpfResult, Answer, Installation, check, prepare
from .checker import Property
from .files import psl_file, system_files
from .java import CLASS
from .options import Setup

_FORM = 4
"""The version of the requests and of the reading of answers: changing it invalidates the cache."""
_DECIDED = (AjpfResult.HOLDS, AjpfResult.VIOLATED)


def key(files: Mapping[str, str], formula: str, mark: str) -> str:
    """The cache key of one request to one installation (`Installation.mark`)."""
    asked = {name: text for name, text in files.items() if not name.endswith(".psl")}
    return sha256(json.dumps([_FORM, asked, formula, mark], sort_keys=True))


def recall(key: str) -> Answer | None:
    """The cached answer, if all files that it depends on are unchanged."""
    kept = read_note(Answer, _path(key))
    if kept is None or kept.said not in _DECIDED or any(look(o.kind, o.path) != o.digest for o in kept.observed):
        return None
    return replace(kept, kept=True)


def keep(key: str, answer: Answer) -> None:
    """An answer that decides nothing, or cannot be written, is not cached: the request will be re-run."""
    if answer.said in _DECIDED and not answer.kept:
        with suppress(OSError):
            write_note(_path(key), answer)


def _path(key: str) -> Path:
    return cache_folder() / "ajpf" / f"{key}.json"


def ask(
    installation: Installation, setup: Setup, properties: Sequence[Property], seconds: float, megabytes: int
) -> dict[str, Answer]:
    """An answer for each property, by its key. Cached answers are not re-run. The rest of `seconds` is shared among the
    remaining properties, so that one that never ends costs the others nothing."""
    given = {**system_files(setup, "agent"), "agent.psl": psl_file(properties)}
    keys: dict[str, str] = {}
    if setup.environment_class:  # for a class that the plan gives, only the name is known
        del given[f"{CLASS}.java"]
    else:
        mark = installation.mark()
        keys = {p.key: key(given, psl.show(p.formula), mark) for p in properties}
    answers = {name: answer for name, of in keys.items() if (answer := recall(of)) is not None}
    asked = [p for p in properties if p.key not in answers]
    for name, answer in _asked(installation, given, asked, seconds, megabytes).items():
        answers[name] = answer
        if name in keys:
            keep(keys[name], answer)
    return answers


def _asked(
    installation: Installation,
    given: Mapping[str, str],
    properties: Sequence[Property],
    seconds: float,
    megabytes: int,
) -> dict[str, Answer]:
    deadline = time.monotonic() + seconds
    if not properties:
        return {}
    workers = max(1, min(len(properties), os.cpu_count() or 1))
    waiting, lock = len(properties), threading.Lock()
    with tempfile.TemporaryDirectory(prefix="avow-ajpf-") as temporary:
        folder = Path(temporary)
        outside = Outside((installation.tool,))
        wrong = prepare(installation, folder, given, outside)
        if wrong is not None:
            return {p.key: Answer(AjpfResult.ERROR, wrong, observed=outside.observed()) for p in properties}

        def one(p: Property) -> Answer:
            nonlocal waiting
            with lock:
                limit = (deadline - time.monotonic()) / ceil(waiting / workers)
                waiting -= 1
            if limit <= 1:
                return Answer(AjpfResult.TIMEOUT, "no time left")
            return check(installation, folder, p.key, limit, max(256, megabytes // workers), outside)

        with ThreadPoolExecutor(workers) as pool:
            answers = dict(zip([p.key for p in properties], pool.map(one, properties), strict=True))
        observed = outside.observed()
        return {key: replace(answer, observed=observed) for key, answer in answers.items()}

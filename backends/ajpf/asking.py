"""AJPF asked for all properties of an agent: in a folder of our own, several at a time, each with its own limit."""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import ceil
from pathlib import Path

from avow.isolation.outside import Outside

from . import kept, psl
from .ajpf_tool import Answer, Installation, Said, check, prepare
from .checker import Property
from .files import ail_file, psl_file
from .java import CLASS, environment_class
from .options import Setup
from .printer import program_text


def files(setup: Setup, properties: Sequence[Property]) -> Mapping[str, str]:
    """What AJPF needs of one agent, under names that it can read whatever the plan's are called."""
    made = {
        "agent.gwen": program_text(setup.programs),
        "agent.psl": psl_file(properties),
        "agent.ail": ail_file(setup, "agent.gwen"),
    }
    if not setup.environment_class:
        made[f"{CLASS}.java"] = environment_class(setup.environment, agents=len(setup.programs))
    return made


def ask(
    installation: Installation, setup: Setup, properties: Sequence[Property], seconds: float, megabytes: int
) -> dict[str, Answer]:
    """An answer for each property, by its key. What was answered before is not asked again (`kept`). What is left of
    `seconds` is shared out among those still to come, so that one that takes for ever costs the others nothing."""
    given = files(setup, properties)
    mark = installation.mark()
    # Of a class that the plan gives, only the name is known.
    keys = {p.key: kept.key(given, psl.show(p.formula), mark) for p in properties if not setup.environment_class}
    answers = {p: answer for p, key in keys.items() if (answer := kept.recall(key)) is not None}
    asked = [p for p in properties if p.key not in answers]
    for key, answer in _asked(installation, given, asked, seconds, megabytes).items():
        answers[key] = answer
        if key in keys:
            kept.keep(keys[key], answer)
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
            return {p.key: Answer(Said.ERROR, wrong) for p in properties}

        def one(p: Property) -> Answer:
            nonlocal waiting
            with lock:
                limit = (deadline - time.monotonic()) / ceil(waiting / workers)
                waiting -= 1
            if limit <= 1:
                return Answer(Said.TIMEOUT, "no time left")
            return check(installation, folder, p.key, limit, max(256, megabytes // workers), outside)

        with ThreadPoolExecutor(workers) as pool:
            answers = dict(zip([p.key for p in properties], pool.map(one, properties), strict=True))
        observed = outside.observed()
        return {key: replace(answer, observed=observed) for key, answer in answers.items()}

"""Whatever the text: diagnostics and no exception, in bounded time and memory; what is accepted means the same after
`fmt` and `translate --to rcl`. AVOW_FUZZ=200000 makes it a long run, and AVOW_FUZZ_SEED another one; longer ones are
`cd tests; python -m language.fuzzing`.
"""

from __future__ import annotations

import contextlib
import os
import random
from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.language.load import check_text, parse_formula

from . import fuzzing
from .test_printer import LOADED, NODE

ROUNDS = int(os.environ.get("AVOW_FUZZ", "300"))
SEED = int(os.environ.get("AVOW_FUZZ_SEED", "20261121"))


@pytest.mark.nightly
def test_texts_of_every_kind(root: Path) -> None:
    before, sound = fuzzing.memory(), 0
    for text in fuzzing.texts(root, SEED, ROUNDS):
        sound += fuzzing.examine(text) is not None
    assert 0 < sound < ROUNDS
    assert fuzzing.memory() - before < fuzzing.MEGABYTES


def test_the_fuzzer_notices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seeded faults: a formatter that loses a clause, one that is not idempotent, a span outside the file, a hang."""
    right = fuzzing.format_text
    assert fuzzing.examine(fuzzing.FIRST) is not None
    monkeypatch.setattr(fuzzing, "format_text", lambda text, file: right(text, file).replace("x < 120", "x < 12"))
    with pytest.raises(AssertionError):
        fuzzing.examine(fuzzing.FIRST)
    monkeypatch.setattr(fuzzing, "format_text", lambda text, file: right(text, file) + " " * len(text))
    with pytest.raises(AssertionError):
        fuzzing.examine(fuzzing.FIRST.replace("120", "q"))
    monkeypatch.setattr(fuzzing, "format_text", right)
    monkeypatch.setattr(fuzzing, "check_text", lambda text, file: check_text("\n" * 40 + text, file))
    with pytest.raises(AssertionError):
        fuzzing.examine(fuzzing.FIRST.replace("120", "q"))

    def endless(text: str, file: str) -> None:
        while True:
            pass

    monkeypatch.setattr(fuzzing, "check_text", endless)
    monkeypatch.setattr(fuzzing, "SECONDS", 0.2)
    with pytest.raises(fuzzing.Slow):
        fuzzing.examine("x")


def test_damaged_formulas() -> None:
    source = random.Random(SEED + 1)
    for _ in range(ROUNDS // 4):
        text = fuzzing.damaged(
            "forall(x in REAL, y in NATURAL | in.m(x, y) and x < 3.5 -> c == move(x, y)) <=> st in Q", source
        )
        with contextlib.suppress(Rejected), fuzzing.at_most(fuzzing.SECONDS):
            parse_formula(text, NODE, LOADED)

"""Whatever the text: diagnostics and no exception, in bounded time. AVOW_FUZZ=200000 makes it a long run."""

from __future__ import annotations

import contextlib
import os
import random
import time
from pathlib import Path

import pytest

from avow.diagnostics import Rejected
from avow.language.format import format_text
from avow.language.load import check_text, parse_formula
from avow.rendering import render, to_json, to_sarif

from .generate import CONTRACT, damaged
from .test_printer import LOADED, NODE

ROUNDS = int(os.environ.get("AVOW_FUZZ", "250"))


def test_damaged_contracts(root: Path) -> None:
    source = random.Random(20261121)
    texts = [CONTRACT, *(p.read_text("utf-8") for p in sorted(root.glob("contracts/*/*.rcl")))]
    sound = 0
    for _ in range(ROUNDS):
        text = damaged(source.choice(texts), source)
        began = time.process_time()
        contract, found = check_text(text, "f")
        shown = render(found, {"f": text})
        assert time.process_time() - began < 5, text
        assert (contract is None) == any(d.is_error for d in found)
        assert all(d.span is not None and d.span.line >= 1 and d.span.column >= 1 for d in found)
        assert not any(c in shown for c in "\x00\x1b\u202e")
        to_json(found), to_sarif(found)
        if contract is not None:
            sound += 1
            formatted = format_text(text, "f")
            assert format_text(formatted, "f") == formatted
            again = check_text(formatted, "f")[0]
            assert again == contract
    assert 0 < sound < ROUNDS


def test_damaged_formulas() -> None:
    source = random.Random(1)
    for _ in range(ROUNDS // 4):
        text = damaged(
            "forall(x in REAL, y in NATURAL | in.m(x, y) and x < 3.5 -> c == move(x, y)) <=> st in Q", source
        )
        with contextlib.suppress(Rejected):
            parse_formula(text, NODE, LOADED)


@pytest.mark.parametrize("seed", range(3))
def test_random_bytes(seed: int) -> None:
    source = random.Random(seed)
    for _ in range(60):
        text = "".join(chr(source.choice((source.randrange(128), source.randrange(0x11000)))) for _ in range(300))
        contract, found = check_text(text, "f")
        assert contract is None
        assert found

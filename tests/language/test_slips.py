"""What robotics engineers write who know another language better: one message for one mistake, at its place, with what
to write instead. The wording stands in golden/slips.txt, to be read; AVOW_REFRESH=1 renews it."""

from __future__ import annotations

import functools
import os
from pathlib import Path

import pytest

from avow.base.diagnostics import Diagnostic
from avow.language.load import check_text, decode
from avow.language.source import Source

FORMULA = """\
context { Stat : {red, green}; Cmd : {move(REAL, REAL), stop}; At : REAL x REAL --> BOOL; Pose : (REAL, REAL); }
node n {
  inputs( at : At, r : REAL, k : NATURAL, both : BOOL, sq : <REAL>, pose : Pose, wp : REAL x REAL --> NATURAL, \
msg : STRING )
  outputs( stat : Stat, cmd : Cmd, both : BOOL )
  topics()
  guarantee( % )
}
"""
INPUTS = "node n { inputs( % ) outputs( o : BOOL ) topics() guarantee( o ) }\n"
TOPICS = "node n { inputs( a : REAL ) outputs( o : BOOL ) topics( % ) guarantee( o ) }\n"
CONTEXT = "context { % }\nnode n { inputs() outputs( o : BOOL ) topics() guarantee( o ) }\n"
FRAMES = {"formula": FORMULA, "inputs": INPUTS, "topics": TOPICS, "context": CONTEXT, "file": "%"}
GOLDEN = Path(__file__).with_name("golden") / "slips.txt"


def slips() -> list[tuple[str, str]]:
    """(frame, text): the lines of the golden file that begin with the name of a frame."""
    found = (line.partition(": ") for line in GOLDEN.read_text("utf-8").splitlines() if line[:1].strip())
    return [(frame, text) for frame, _, text in found]


@functools.cache
def errors(frame: str, text: str) -> list[Diagnostic]:
    text = text.replace("\\n", "\n").replace("\\t", "\t")
    for character in ("\u00a0", "\u200b", "\ufeff"):
        text = text.replace(f"\\u{ord(character):04x}", character)
    whole = FRAMES[frame].replace("%", text) if frame != "file" else text
    contract, found = check_text(whole, "f")
    wrong = [d for d in found if d.is_error]
    assert (contract is None) == bool(wrong)
    return wrong


def shown(frame: str, text: str) -> str:
    lines = [f"{frame}: {text}"]
    for error in errors(frame, text):
        assert error.span is not None
        place = f"{error.span.line}:{error.span.column}-{error.span.end_column}"
        lines.append(f"    {error.code} {place} {error.message}" + (f" [{error.hint}]" if error.hint else ""))
    return "\n".join(lines)


def test_wording() -> None:
    now = "\n".join(shown(frame, text) for frame, text in slips()) + "\n"
    if os.environ.get("AVOW_REFRESH"):
        GOLDEN.write_text(now, "utf-8")
    assert now == GOLDEN.read_text("utf-8")


def test_one_message_for_one_mistake() -> None:
    """(One line may have several mistakes; the golden file shows them. Most have one.)"""
    counts = [len(errors(frame, text)) for frame, text in slips()]
    assert all(counts), "each is a mistake"
    assert max(counts) <= 5
    assert sum(c == 1 for c in counts) > 0.8 * len(counts) > 150


def test_most_messages_say_what_to_write() -> None:
    found = [e for frame, text in slips() for e in errors(frame, text)]
    assert sum(e.hint is not None for e in found) > 0.85 * len(found)


@pytest.mark.parametrize("sign", ["§", "?", "#", "$", "☃", "\u200b", "]"])
def test_what_was_left_out_hides_only_its_own_part(sign: str) -> None:
    """The rest of the clause may be a consequence and is not spoken of; the rest of the file is."""
    text = FORMULA.replace("%", f"stat == gren {sign} ) guarantee( stat == gren") + "node m { }"
    said = [d for d in check_text(text, "f")[1] if d.is_error]
    assert [d.code for d in said] == ["RCL107" if sign in "§$☃\u200b" else "RCL101", "RCL201", *["RCL118"] * 4]


def test_carriage_returns_end_lines() -> None:
    text = "// old Mac\rcontext { A : {a}; }\r\nnode n {\n  inputs()\routputs( b : BOLL ) topics() guarantee( b ) }"
    (error,) = [d for d in check_text(text, "f")[1] if d.is_error]
    assert error.span is not None
    assert (error.code, error.span.line, error.span.column) == ("RCL208", 5, 14)


def test_names_in_messages_are_cut() -> None:
    (error,) = errors("formula", "x" * 100_000)
    assert error.code == "RCL201"
    assert len(error.message) < 200


def test_a_program_is_no_text() -> None:
    found = decode(b"\x7fELF\x02\x01\x01\x00\x00\xb0", "f")
    assert not isinstance(found, Source)
    assert found.code == "RCL005"
    assert not isinstance(decode("node n".encode("utf-16"), "f"), Source)

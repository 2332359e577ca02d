"""Any text gives diagnostics and no exception; an accepted one means the same after `fmt` and `translate --to rcl`."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from drawn.contracts import CONTRACT, Strange
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.base.codec import to_json
from avow.base.codes import LANGUAGE, sections
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.rendering import render, to_sarif, told
from avow.base.tuning.shown import DIAGNOSTICS
from avow.formulas.formula import node_digest
from avow.language import format as layout
from avow.language.contract import Contract
from avow.language.load import check_text, parse_formula
from avow.language.translate import to_json as contract_to_json
from avow.language.translate import to_rcl, to_unicode
from avow.solving.smtlib import to_smtlib

from .test_printer import LOADED, NODE

FIRST = """\
context { Wayp = {wayA, wayB, origin}; Limit = 120; T : (REAL, <NATURAL>); U : {}; F : REAL x REAL --> NATURAL; }
node a { inputs( f : F, t : T ) outputs( w : Wayp, u : U ) topics( pkg/msg/T w matches(out.w), int16 f )
A( forall(x, y in REAL; in.f(x, y) < Limit) )
guarantee exit_on_danger "Go to the exit on dangerous radiation" ( exists_unique(x, y in REAL, i in NATURAL |
  in.f(x, y) == i + 1 and 0 <= x < 120) -> out.w in {wayA, wayB} or out.w !in Wayp ) }
node b{
inputs( r : REAL, s : <REAL>, st : {stop, go}, n : NATURAL ) outputs( c : { move(REAL, REAL), halt } ) topics()
assume( 0 <= in.r )
G( (in.r >= 2.5 <=> in.st == go) and in.s == <0.5, r> )
G( n in <1 upto length(s)> -> out.c == move(in.r, -1 / 2) or not c == halt ) }
"""
SEEDS = [FIRST, CONTRACT, *(p.read_text("utf-8") for p in sorted(Path(__file__).parents[2].glob("contracts/*/*.rcl")))]
TOKEN = re.compile(r"in\.|out\.|-->|<=>|->|==|!=|<=|>=|!in\b|<>|[A-Za-z_][\w']*|\d+(?:\.\d+)?|\s+|.", re.DOTALL)
WORDS = st.sampled_from((
    *("context", "node", "inputs", "outputs", "topics", "matches", "assume", "guarantee", "forall", "exists", "in"),
    *("exists_unique", "upto", "length", "TRUE", "REAL", "STRING", "A", "G", "x", "not", "!in", "out", ".", "1.5"),
    *("<", ">", "<>", "<=>", "->", "-->", "--", "==", "=", "{", "}", "(", ")", "|", ";", "//", "/*", "*/", '"', "\n"),
    *("and", "or", "if", "then", "else", "[", "]", "once[2 s](", "define", "steps", "\r", "&&", "∀", "é", "\x00", "\\"),
    *("9" * 600, "'", "\ufeff", "\u202e", "(" * 200, "not " * 200, " and b" * 200),
))  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn, seeds: Sequence[str] = tuple(SEEDS)) -> str:
    """A contract of which a few tokens are replaced, left out, doubled or swapped, or a part of one."""
    parts = TOKEN.findall(draw(st.sampled_from(seeds)))
    for _ in range(draw(st.integers(0, 8))):
        at = draw(st.integers(0, max(len(parts) - 1, 0)))
        match draw(st.sampled_from(("replace", "drop", "insert", "double", "swap", "cut"))):
            case "replace":
                parts[at : at + 1] = [draw(WORDS)]
            case "drop":
                del parts[at : at + draw(st.integers(1, 20))]
            case "insert":
                parts.insert(at, draw(WORDS | st.text(max_size=5)))
            case "double":
                parts[at:at] = parts[at : at + 30]
            case "swap":
                parts[at : at + 3] = reversed(parts[at : at + 3])
            case _:
                parts = parts[at : at + 400]
    return "".join(parts)


def examine(text: str) -> Contract | None:
    """Checks all that must hold of any text."""
    contract, found = check_text(text, "f")
    assert (contract is None) == any(d.is_error for d in found)
    assert len(found) <= DIAGNOSTICS + 1
    lines = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for diagnostic in found:
        assert diagnostic.code in sections()[LANGUAGE]
        assert all(_inside(span, lines) for span in _spans(diagnostic)), (diagnostic, len(lines))
    shown = render(found, {"f": text})
    assert not any(c in shown for c in "\x00\x1b\u202e\x7f\x85\u2028")
    to_json(told(found)), to_sarif(found)
    try:
        formatted = layout.format_text(text, "f")
    except Rejected as rejected:
        assert contract is None
        assert rejected.diagnostics  # noqa: PT017
        return None
    assert layout.format_text(formatted, "f") == formatted
    if contract is not None:
        _accepted(contract, formatted)
    return contract


def _spans(diagnostic: Diagnostic) -> list[Span]:
    assert diagnostic.span is not None
    return [diagnostic.span, *(span for _, span in diagnostic.notes if span is not None)]


def _inside(span: Span, lines: Sequence[str]) -> bool:
    return (
        1 <= span.line <= span.end_line <= len(lines)
        and 1 <= span.column <= len(lines[span.line - 1]) + 1
        and 1 <= span.end_column <= len(lines[span.end_line - 1]) + 1
        and (span.line, span.column) <= (span.end_line, span.end_column)
    )


def _accepted(contract: Contract, formatted: str) -> None:
    again = check_text(formatted, "f")[0]
    assert again == contract
    assert _digests(again) == _digests(contract)
    with contextlib.suppress(Rejected):
        assert check_text(to_rcl(contract), "f")[0] == contract
    for translate in (to_unicode, contract_to_json):
        assert translate(contract).encode("utf-8", "surrogatepass")
    found = to_smtlib(contract)
    assert bool(found.text) or bool(found.missing) or not any(node.clauses for node in contract.nodes)


def _digests(contract: Contract) -> list[str]:
    return [node_digest(node, clause) for node in contract.nodes for clause in node.clauses]


@pytest.mark.nightly
@given(st.integers(0, 100_000))
def test_contracts_made_from_their_types(seed: int) -> None:
    """Names that are words of other languages, nested types, constants of every kind, comments anywhere."""
    source = Strange(seed)
    text = source.text()
    if examine(text) is None:  # the generator does not see every rule of types
        assert {d.code for d in check_text(text, "f")[1] if d.is_error} <= {"RCL220", "RCL302", "RCL303"}
    laid_out = " ".join(layout.format_text(text, "f").split())
    assert all(" ".join(comment.split()) in laid_out for comment in source.comments)


@given(damaged())
def test_damaged_contracts(text: str) -> None:
    examine(text)


@pytest.mark.nightly
@settings(max_examples=3000)
@given(damaged() | st.text())
def test_texts_of_every_kind(text: str) -> None:
    examine(text)


@given(damaged(("forall(x in REAL, y in NATURAL | in.m(x, y) and x < 3.5 -> c == move(x, y)) <=> st in Q",)))
def test_damaged_formulas(text: str) -> None:
    with contextlib.suppress(Rejected):
        parse_formula(text, NODE, LOADED)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("loses", lambda text, right: right(text).replace("x < 120", "x < 12")),
        ("is not idempotent", lambda text, right: right(text) + " " * len(text)),
    ],
)
def test_a_wrong_layout_is_noticed(name: str, wrong, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    right = layout.format_text
    assert examine(FIRST) is not None
    monkeypatch.setattr(layout, "format_text", lambda text, file: wrong(text, lambda t: right(t, file)))
    with pytest.raises(AssertionError):
        examine(FIRST)

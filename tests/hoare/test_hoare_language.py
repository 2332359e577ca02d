"""The imperative language: how programs are read, and what is said of bad ones."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import pytest

from avow.backends.hoare import syntax
from avow.backends.hoare.parser import parse_program
from avow.backends.hoare.tuning import NESTING
from avow.base.diagnostics import Diagnostic, Rejected
from avow.language.lexer import Token
from avow.language.syntax import Connective, Sign

PAPER = """input := radiation_at(i)
IF (input < 120) THEN 
   output := green 
ELSE
   IF (input < 250) THEN 
      output := orange 
   ELSE
      output := red
"""  # noqa: W291 - as the paper prints it


def parse(text: str) -> syntax.ProgramText:
    return parse_program(text, "p.imp")


def fault(text: str) -> Diagnostic:
    with pytest.raises(Rejected) as raised:
        parse(text)
    (diagnostic,) = raised.value.diagnostics
    return diagnostic


def placeless(part: Any) -> Any:
    """Statements without the places of their expressions."""
    if isinstance(part, tuple):
        return part if isinstance(part, Token) else tuple(map(placeless, part))
    if not is_dataclass(part):
        return part
    named = {f.name: getattr(part, f.name) for f in fields(part) if f.name not in ("start", "end", "span")}
    return type(part), {name: placeless(value) for name, value in named.items()}


def test_the_papers_listing_parses_as_printed() -> None:
    assign, branch = parse(PAPER).body
    assert isinstance(assign, syntax.Assign)
    assert isinstance(branch, syntax.If)
    (inner,) = branch.otherwise
    assert isinstance(inner, syntax.If)
    assert placeless(inner.otherwise) == placeless(parse("output := red").body)


def test_equals_in_place_of_assignment_is_told_with_its_cure() -> None:
    said = fault(PAPER.replace("output := red", "output = red"))
    assert (said.span.line, said.span.column) == (8, 14) if said.span else False
    assert "`:=`" in (said.hint or "")


@pytest.mark.parametrize(
    "text",
    [
        "IF a THEN\n  x := 1\nELSE\n  y := 2\nz := 3",
        "IF a THEN x := 1 ELSE y := 2 ENDIF; z := 3",
        "IF a THEN\nx := 1\nELSE\ny := 2\nENDIF\nz := 3",
        "IF a THEN x := 1\nELSE y := 2\nz := 3",
        "IF (a) THEN // first\n  x :=\n    1\nELSE /* then */ y := 2\nz := 3",
    ],
)
def test_layouts_of_one_program(text: str) -> None:
    assert placeless(parse(text).body) == placeless(parse("IF a THEN\n  x := 1\nELSE\n  y := 2\nz := 3").body)


def test_else_belongs_to_the_if_of_its_column() -> None:
    outer = parse("IF a THEN\n  IF b THEN\n    x := 1\nELSE\n  y := 2").body[0]
    inner = parse("IF a THEN\n  IF b THEN\n    x := 1\n  ELSE\n    y := 2").body[0]
    assert isinstance(outer, syntax.If)
    assert isinstance(inner, syntax.If)
    assert outer.otherwise
    assert not inner.otherwise


def test_a_chain_of_else_if() -> None:
    body = parse("IF a THEN\n  x := 1\nELSE IF b THEN\n  x := 2\nELSE\n  x := 3\ny := 4").body
    assert len(body) == 2
    first = body[0]
    assert isinstance(first, syntax.If)
    second = first.otherwise[0]
    assert isinstance(second, syntax.If)
    assert second.otherwise


def test_a_long_chain_of_else_if() -> None:
    text = "IF a < 0 THEN\n  x := 0\n" + "".join(f"ELSE IF a < {k} THEN\n  x := {k}\n" for k in range(1, 20))
    body = parse(text + "ELSE\n  x := 99\nz := 1").body
    assert len(body) == 2
    depth, at = 0, body[0]
    while isinstance(at, syntax.If):
        depth, at = depth + 1, at.otherwise[0]
    assert depth == 20


def test_match_while_maps_and_declarations() -> None:
    source = parse(
        "VAR n : NATURAL; GIVEN f : NATURAL x REAL --> REAL;\nm[n] := TRUE\n"
        "MATCH c WITH move(a, b) THEN SKIP ELSE SKIP\n"
        "WHILE n < 3 INVARIANT forall(k in NATURAL | f(k, 0) >= 0.5) VARIANT 3 - n DO\n  n := n + 1"
    )
    assert [d.is_input for d in source.declarations] == [False, True]
    assert source.declarations[1].parameters == ("NATURAL", "REAL")
    match, loop = source.body[1:]
    assert isinstance(match, syntax.Match)
    assert [v.name for v in match.variables] == ["a", "b"]
    assert isinstance(loop, syntax.While)
    assert loop.variant is not None


def test_precedence() -> None:
    (statement,) = parse("x := a + 2.50 * b < c and not d or e").body
    assert isinstance(statement, syntax.Assign)
    assert isinstance(statement.value, Connective)
    assert statement.value.sign is Sign.OR


@pytest.mark.parametrize(
    ("text", "line", "column", "part"),
    [
        ("x := (1 + ) 2", 1, 11, "did not expect"),
        ("x := 1\n  y := 2", 2, 3, "did not expect"),
        ("if a THEN x := 1", 1, 4, "did not expect"),
        ("ELSE", 1, 1, "belongs to no open"),
        ("x := ¤", 1, 6, "no meaning"),
        ("IF a THEN", 1, 6, "ends where the branch"),
        ("IF a THEN\nx := 1", 1, 1, "indented"),
        ("WHILE a DO SKIP", 1, 9, "did not expect"),
        ("x := {{%s}}", 1, 6, "did not expect"),
        ("VAR x : A B;\nx := 1", 1, 1, "type"),
    ],
)
def test_faults_have_a_place(text: str, line: int, column: int, part: str) -> None:
    said = fault(text)
    assert said.span is not None
    assert (said.span.line, said.span.column) == (line, column)
    assert part in said.message


@pytest.mark.parametrize("text", ["-" * 5000 + "1", "not " * 5000 + "a", "+".join(["a"] * 5000)])
def test_depth_is_refused_not_a_crash(text: str) -> None:
    assert str(NESTING) in fault(f"x := {text}").message


def test_deeply_nested_branches_are_refused() -> None:
    text = "".join(" " * k + "IF a THEN\n" for k in range(3000)) + " " * 3000 + "SKIP"
    assert str(NESTING) in fault(text).message


def test_a_program_may_be_long() -> None:
    assert len(parse("x := 1\n" * 3000).body) == 3000

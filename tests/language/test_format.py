"""avow fmt: idempotent, comments kept, meaning unchanged."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner

from avow.base.diagnostics import Rejected
from avow.cli.fmt import command
from avow.language.flat import flat
from avow.language.format import WIDTH, format_text
from avow.language.lexer import Token, tokens
from avow.language.load import check_text
from avow.language.source import Reports, Source

BEFORE = """\
// head

context{A:{a,b};F:A x REAL-->BOOL;/*why*/N=1.5;// the limit
S : {one /* first */, two}; }
/* about n */ node n{inputs(x:A,f:F)outputs(y:A)topics(bool y matches( out . y ),pkg/T x matches(in.x))
A(x==a)// it is a
G g "said"(forall(v,w in REAL,u in A;in.f(u,v)and w<v->not y==b))
// before the second

guarantee(
  y == a // trailing
  or y == b )
}
// end"""
AFTER = """\
// head

context {
  A : {a, b};
  F : A x REAL --> BOOL;  /*why*/
  N = 1.5;  // the limit
  S : {one /* first */, two};
}

/* about n */
node n {
  inputs( x : A, f : F )
  outputs( y : A )
  topics( bool y matches(out.y), pkg/T x matches(in.x) )
  assume( x == a )  // it is a
  guarantee g "said"
    ( forall(v, w in REAL, u in A | in.f(u, v) and w < v -> not y == b) )
  // before the second

  guarantee(
    y == a // trailing
    or y == b )
}
// end
"""


def test_layout() -> None:
    assert format_text(BEFORE, "f") == AFTER
    assert format_text(AFTER, "f") == AFTER


def words(text: str) -> tuple[list[str], list[str]]:
    """The tokens (a quantifier's `;` and A, G as `fmt` writes them) and the comments, without white space."""
    reports, comments = Reports(Source("f", text)), list[Token]()
    spelled = {"A": "assume", "G": "guarantee", ";": "|"}
    found = [spelled.get(t.text, "".join(t.text.split())) for t in tokens(reports, comments)]
    return found, [" ".join(c.text.split()) for c in comments]


_SPACES = (
    *(" // c\n", " /* d */ ", " /* d\n   e\n f */ ", "\n\n\n", "\n", "\t"),
    *(" /* g */ // h\n", "\n// own\n", "\n /* i\nj*/\n\n"),
)


@pytest.mark.nightly
def test_comments_anywhere(root: Path) -> None:
    source = random.Random(7)
    texts = [p.read_text("utf-8") for p in sorted(root.glob("contracts/*/*.rcl"))] + [BEFORE]
    for _ in range(40):
        text = source.choice(texts)
        comments: list[Token] = []
        found = tokens(Reports(Source("f", text)), comments)
        density = source.choice((0.0, 0.02, 0.2))
        pieces = []
        for token in sorted(found + comments, key=lambda t: t.start):
            pieces.append(token.text)
            pieces.append("\n" if token.type == "COMMENT" else " ")
            if source.random() < density:
                pieces.append(source.choice(_SPACES))
        mangled = "".join(pieces)
        formatted = format_text(mangled, "f")
        assert words(formatted) == words(mangled)
        assert format_text(formatted, "f") == formatted
        assert check_text(formatted, "f")[0] == check_text(mangled, "f")[0] is not None


def test_long_formulas_are_broken_at_their_operators() -> None:
    long = " and ".join(f"in.some_rather_long_name{i} < {i}" for i in range(8))
    ports = ", ".join(f"some_rather_long_name{i} : REAL" for i in range(8))
    text = f"node n {{ inputs({ports}) outputs(b : BOOL) topics() "
    text += f"guarantee(({long}) -> (out.b <=> exists(x in REAL | {long} or not ({long})))) }}"
    formatted = format_text(text, "f")
    assert max(map(len, formatted.splitlines())) <= WIDTH
    assert check_text(formatted, "f")[0] == check_text(text, "f")[0] is not None
    assert formatted.count("and in.some_rather_long_name1 < 1\n") == 3


def test_a_text_with_syntax_errors_is_refused() -> None:
    with pytest.raises(Rejected):
        format_text("node n { inputs( }", "f")
    badly_typed = "node n { inputs() outputs(b : BOOL) topics() guarantee(q) }"
    assert "guarantee( q )" in format_text(badly_typed, "f")


def _with(before: str, after: str) -> Callable[[Sequence[Token]], str]:
    return lambda found: flat(found).replace(before, after)


@pytest.mark.parametrize(
    "printer",
    [
        repr,
        _with(" and ", " or "),
        _with("not ", ""),
        _with("<", "<="),
        _with("(", ""),
        _with("REAL", "INTEGER"),
        _with("forall", "exists"),
        _with("x", "y"),
        _with("in.f", "out.f"),
        _with("1.5", "1.50"),
        lambda found: "",
    ],
)
def test_a_layout_that_says_something_else_is_never_written(
    printer: Callable[[Sequence[Token]], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "f.rcl"
    file.write_text(BEFORE)
    monkeypatch.setattr("avow.language.format.flat", printer)
    result = CliRunner().invoke(command, [str(file)], standalone_mode=False)
    assert result.return_value == 2
    assert "RCL007" in result.stderr
    assert f"{file}:" in result.stderr  # it is located
    assert file.read_text() == BEFORE


def test_a_lost_comment_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("avow.language.format._Layout.flush", lambda *_, **__: None)
    with pytest.raises(Rejected, match="would not read back"):
        format_text(BEFORE, "f")

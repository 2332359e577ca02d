"""What a piece of syntax is made of: every kind, every field that holds trees, in reading order."""

from __future__ import annotations

from itertools import count
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import pytest

from avow.language import syntax
from avow.language.lexer import Token, tokens
from avow.language.load import syntax_of
from avow.language.outline import read
from avow.language.source import Reports, Source
from avow.system.temporal import _marked

KINDS = get_args(syntax.Syntax)


def made(hint: Any, marks: Any) -> tuple[Any, list[syntax.Name]]:
    """A value of a type with a tree of its own wherever it may hold one, and these trees."""
    if get_origin(hint) is UnionType:
        return max((made(each, marks) for each in get_args(hint)), key=lambda found: len(found[1]))
    if get_origin(hint) in (tuple, list):
        inner = [part for part in get_args(hint) if part is not Ellipsis]
        found = [made(part, marks) for part in (inner * 2 if len(inner) == 1 else inner)]
        return get_origin(hint)(value for value, _ in found), [tree for _, trees in found for tree in trees]
    if isinstance(hint, type) and issubclass(hint, syntax._Placed):
        mark = syntax.Name(next(marks), 0, 1, "mark")
        return mark, [mark]
    return None, []


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_kind_is_made_of_is_every_tree_in_its_fields(kind: type) -> None:
    marks, hints = count(), get_type_hints(kind)
    values = [made(hints[name], marks) for name in kind.__match_args__[3:]]  # type: ignore[attr-defined]
    tree = kind(0, 0, 1, *(value for value, _ in values))
    assert syntax.children(tree) == tuple(each for _, trees in values for each in trees)


CONTRACT = """
context {
  Colour : {red, green}; Order : {go(REAL, (NATURAL, BOOL)), stop}; Rows : REAL x NATURAL --> BOOL; Any : {};
  Speeds : <REAL>; Place : [x, y : REAL, c : Colour];
  LIMIT = 3 + 4 * -LENGTH; NAMES = {"a", "b"};
  define hot(i, j : NATURAL, c : Colour) = in.temp(i) > 80;
  define plain = TRUE;
}
node agent {
  inputs( temp : Rows, p, q : Place )
  outputs( speeds : Speeds )
  topics( geometry/msg/Twist /cmd matches(out.speeds), std/Bool b, std/Bool other matches(q) )
  guarantee G ( TRUE )
}
"""
FORMULAS = (
    "(a and not b or c <=> d -> e) and f(x, y) < 1 + 2 - 3 and in.p.x <= agent.command and agent.in.phase in {a, b}",
    "forall(x, y in REAL, z in <1 upto n> | (x, y) == <z, 1> and x !in NATURAL) or exists(b in BOOL | b)",
    "(if a then 200 ms else in.r.s.t) == once[<= 5 steps](F, G) and x since[n] y and (x since y) and (in.p)(1) == f",
    'steps(every 20 ms) == "text" and once[n steps](x)',
)
TEMPORAL = "always a.x until eventually (b.y and b.z)"


def trees() -> list[syntax.Syntax]:
    """All that stands in these texts."""
    reports = Reports(Source("test.rcl", CONTRACT))
    file = read(tokens(reports), reports)
    [node] = file.nodes
    roots: list[syntax.Syntax | None] = [*file.declarations, node.inputs, node.outputs, node.topics]
    for text in FORMULAS:
        tree, faults = syntax_of(text, None)
        assert not faults.failed, faults.found
        roots.append(tree)
    roots.append(syntax_of(TEMPORAL, None, _marked)[0])
    assert not reports.failed, reports.found
    return [tree for root in roots if root is not None for tree in syntax.walk(root)]


def test_the_fields_of_every_kind_stand_in_reading_order() -> None:
    found = trees()
    assert {type(tree) for tree in found} >= {*KINDS}
    for tree in found:
        parts = syntax.children(tree)
        assert [part.start for part in parts] == sorted(part.start for part in parts), tree
        assert all(tree.start <= part.start and part.end <= tree.end for part in parts), tree
        assert all(part.depth < tree.depth for part in parts), tree
        signs = [getattr(tree, name) for name in type(tree).__match_args__[3:]]
        words = [each for sign in signs if isinstance(sign, tuple) for each in sign if isinstance(each, Token)]
        assert all(tree.start <= word.start < tree.end for word in words), tree

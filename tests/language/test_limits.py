"""A few lines can stand for a term that no machine could finish with: refused where it is declared."""

from __future__ import annotations

import pytest
from helpers import calls

from avow.base.diagnostics import Diagnostic
from avow.formulas.formula import node_digest
from avow.language.contract import Contract
from avow.language.format import format_text
from avow.language.load import check_text
from avow.language.translate import to_json, to_unicode

NODE = "node n { inputs( i : %s ) outputs( o : BOOL ) topics() guarantee( %s ) }"


def codes(text: str) -> list[str]:
    read: list[tuple[Contract | None, tuple[Diagnostic, ...]]] = []
    assert calls(lambda: read.append(check_text(text, "f"))) < 5_000_000, "a second or two"
    ((contract, found),) = read
    assert (contract is None) == any(d.is_error for d in found)
    assert all(d.span is not None for d in found)
    return [d.code for d in found if d.is_error]


def row(count: int, first: str, form: str, last: str = "") -> str:
    """A context in which each declaration is made from its neighbour: `{0}` is its number, `{1}` the one before it."""
    return "context { " + first + " ".join(form.format(i, i - 1) for i in range(1, count)) + last + " }\n"


@pytest.mark.parametrize(
    ("context", "sort", "formula"),
    [
        (row(4000, "", "C{1} = C{0} + 1;", "C3999 = 1;"), "REAL", "o or C0 > 1"),
        (row(4000, "", "T{1} : T{0};", "T3999 : REAL;"), "T0", "o"),
    ],
)
def test_what_is_too_large_is_refused(context: str, sort: str, formula: str) -> None:
    assert codes(context + NODE % (sort, formula)) == ["RCL110"]


def test_declarations_in_a_moderate_row_are_accepted_whatever_their_order() -> None:
    count = 50
    assert codes(row(count, "", "T{1} : T{0};", f"T{count - 1} : REAL;") + NODE % ("T0", "o and i > 0")) == []
    assert codes(row(2000, "T0 : REAL;", "T{0} : T{1};") + NODE % ("T1999", "o and i > 0")) == []


def _nested(before: str, after: str, count: int, core: str = "o") -> str:
    return "".join(before.format(k) for k in range(count)) + core + after * count


@pytest.mark.parametrize(
    "formula",
    [
        _nested("forall(x{0} in <1 upto 3> | ", ")", 74),
        _nested("exists_unique(x{0} in REAL | ", ")", 74),
        _nested("(", ")", 148),
        _nested("not ", "", 148),
        _nested("<", ">", 140, "i") + " == " + _nested("<", ">", 140, "i"),
        _nested("(", ", 1)", 140, "i") + " == " + _nested("(", ", 1)", 140, "i"),
        _nested("(1 + ", ")", 72, "i") + " > 1",
        _nested("(o and (o or ", "))", 36),
        _nested("(i in {{1}} and ", ")", 48),
        _nested("(", ") -> o", 72),
    ],
    ids=lambda text: text[:16],
)
def test_what_is_as_deep_as_may_be_breaks_nothing(formula: str) -> None:
    """No pass may recurse more than Python allows on what the checker has accepted."""
    text = NODE % ("INTEGER", formula)
    contract, found = check_text(text, "f")
    assert contract is not None, [d.message for d in found if d.is_error]
    assert check_text(format_text(text, "f"), "f")[0] == contract
    assert to_unicode(contract)
    assert to_json(contract)
    assert node_digest(contract.nodes[0], contract.nodes[0].guarantees[0])
    assert hash(contract.nodes[0].guarantees[0].formula)

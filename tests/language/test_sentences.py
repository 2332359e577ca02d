"""Sentences beside formulas that say something else, and total functions that are looked up by their value."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from avow.base.diagnostics import Diagnostic
from avow.language.load import check_paths, check_text
from avow.language.sentences import both_ways, comparisons, is_one_way, mentions

ROOT = Path(__file__).parents[2]
NODE = """\
context {{ Light : {{red, amber, green}}; Order : {{ go(REAL), stop }}; Limit = 250; Margin = 0.95; }}
node n {{
  inputs( r : REAL, k : NATURAL, b : BOOL, c : BOOL, light : Light )
  outputs( light : Light, order : Order, ok : BOOL )
  topics()
  {}
  guarantee( r < 1 and k < 1 and b and c -> (in.light == out.light and order == stop and ok) )
}}
"""
OURS = {"RCL412", "RCL413", "RCL414", "RCL415"}


def found(clause: str) -> list[Diagnostic]:
    contract, diagnostics = check_text(NODE.format(clause), "f")
    assert contract is not None, [f"{d.span}: {d.message}" for d in diagnostics if d.is_error]
    return [d for d in diagnostics if d.code in OURS]


COMPARED = [
    # the other way round
    ("The reading is less than or equal to 0", "0 <= in.r", "greater than or equal to 0"),
    ("The reading is at most 5", "in.r >= 5", "greater than or equal to 5"),
    ("It is never above 250", "in.r >= Limit", "greater than or equal to 250"),
    ("The reading must not exceed 250", "250 < in.r", "greater than 250"),
    ("The reading is at least zero", "in.r <= 0", "less than or equal to 0"),
    # the boundary
    ("The reading is greater than 250", "in.r >= Limit", "greater than or equal to 250"),
    ("The reading is below 250", "in.r <= 250", "less than or equal to 250"),
    # another number
    ("The reading is below 25", "in.r < 250", "the formula has `250`"),
    ("Fewer than 12 of them", "in.k < 13", "the formula has `13`"),
    ("Between 120 and 205", "120 <= in.r < 250", "the formula has `120`, `250`"),
    ("A reading above 3.5", "in.b", "the formula has no number"),
    # other words
    ("It must not come closer than 30 cm", "in.r <= 0.3", "less than or equal to 0.3"),
]
AGREE = [
    ("The reading is greater than or equal to 0", "0 <= in.r"),
    ("The reading is no less than 0", "0 <= in.r"),
    ("It is never above 250", "in.r <= Limit"),
    ("It does not get over 250", "in.r <= 250"),
    ("Between 120 and 250", "120 <= in.r < 250"),
    ("Between 120 and 250", "120 < in.r and in.r <= 250"),
    ("Within 25 cm", "in.r <= 0.25"),
    ("Within -20 °C and 60 °C", "-20 <= in.r <= 60"),
    ("Within 25 cm", "-0.25 < in.r and in.r < 0.25"),
    ("At most 2 minutes", "in.r <= 120"),
    ("Below 5 %", "in.r < 0.05"),
    ("It keeps at least 95 %", "in.r * Margin <= in.r"),  # the number is there, though not as a bound
    ("A reading below 250 is fine", "in.r >= 250 or out.ok"),  # a condition, turned round
    ("A reading below 250 is fine", "in.r < 250 -> out.ok"),
    ("Unless the reading is above 250 it is fine", "in.r <= 250 -> out.ok"),
    ("There is at most one", "in.b"),  # a count, not a number in the formula
    ("It is at no more than 1 place", "in.b"),
    ("See section 3.2, step 4 of the handbook", "in.r < 250"),  # no comparison
    ("Over the whole range", "in.r < 250"),
    ("More than version 1.2.3", "in.r < 250"),
    ("It never drives faster than 1.5 m/s", "in.r <= 1.5"),
    ("It answers faster than 2 s", "in.r < 2"),
    ("It answers no slower than 2 s", "in.r <= 2"),
    ("It answers after 100 ms or faster", "in.r <= 100"),
    ("When b it may go faster than 2 m/s", "in.b or in.r <= 2"),
    ("It does not move under 250", "in.r < 250 -> in.b"),
    ("At 80 degrees or more it is ok", "in.r >= 80 -> in.b"),
]


@pytest.mark.parametrize(("sentence", "formula", "said"), COMPARED)
def test_comparisons_that_differ(sentence: str, formula: str, said: str) -> None:
    (one,) = found(f'assume reading "{sentence}" ( {formula} )')
    assert one.code == "RCL413"
    assert said in one.message
    assert one.span is not None
    assert (one.span.line, one.span.column) == (6, 18)


@pytest.mark.parametrize(("sentence", "formula"), AGREE)
def test_comparisons_that_agree(sentence: str, formula: str) -> None:
    assert found(f'guarantee reading "{sentence}" ( {formula} )') == []


@pytest.mark.parametrize(
    ("sentence", "formula", "code"),
    [
        ("If b then it is ok", "in.b <=> out.ok", "RCL414"),
        ("When b, it is ok", "forall(i in NATURAL | forall(j in NATURAL | (i < j and in.b) <=> out.ok))", "RCL414"),
        ("It is ok if and only if b", "in.b -> out.ok", "RCL414"),
        ("It is ok exactly when b", "in.b == TRUE -> out.ok == TRUE", "RCL414"),
        ("If b then it is ok", "in.b -> out.ok", None),
        ("If b then it is ok, otherwise not", "in.b <=> out.ok", None),
        ("It is ok only if b", "in.b <=> out.ok", None),
        ("If b it is ok; nothing else makes it so, and no other input", "in.b <=> out.ok", None),
        ("It is ok exactly when b", "in.b <=> out.ok", None),
        ("It is ok when and only when b", "in.b -> out.ok", "RCL414"),
        ("It is ok if, and only if, b", "in.b -> out.ok", "RCL414"),
        ("It is ok exactly when b", "in.c -> (in.b == out.ok)", None),
        ("If it is certain, then it is ok exactly when b", "in.c -> (in.b <=> out.ok)", None),
        ("Ok as b", "in.b <=> out.ok", None),
        ("If b then it is ok", "in.c -> (in.b <=> out.ok)", None),
        ("It stops", "in.b -> out.order == stop", None),
        ("If b then it stops", "in.b -> out.light == green", "RCL415"),
        ("If b then the light is RED", "in.b -> out.light == amber", "RCL415"),
        ("If b then it is going", "in.b -> out.order == stop", None),  # two letters say nothing
        ("If b then it is stopped", "in.b -> out.order == stop", None),
        ("If b then it is stopping", "in.b -> out.light == green", "RCL415"),
        ("If b then the light is neither red nor amber", "in.b -> out.light == green", None),
        ("If b then the light is not red", "in.b -> out.light == green", None),
        ("Reddish light is fine", "in.b -> out.light == green", None),
        ("If b then it greens the road", "in.b -> out.light == amber", None),  # a verb, not the element
        ("Nothing is stopped beyond b", "in.b -> out.light == green", None),
    ],
)
def test_directions_and_elements(sentence: str, formula: str, code: str | None) -> None:
    assert [d.code for d in found(f'guarantee g "{sentence}" ( {formula} )')] == ([code] if code else [])


def test_without_a_sentence_there_is_nothing_to_compare() -> None:
    assert found("guarantee( in.b <=> out.ok )") == []


@pytest.mark.slow
def test_sentences_of_any_kind_are_read_quickly() -> None:
    for sentence in (
        "less than " * 30_000,
        "between 1 and " * 20_000,
        "not " * 60_000 + "above 3",
        "9" * 100_000,
        "½ < ٣",
    ):
        assert all(d.code == "RCL413" for d in found(f'guarantee g "{sentence}" ( in.b )'))


def test_the_language_of_sentences() -> None:
    (one,) = comparisons("the level must not be above −2.50 m/s, then")
    assert (one.signs, one.number, one.unit) == ({">", "<="}, Fraction(-5, 2), "m/s")
    low, high = comparisons("between 3 and 4")
    assert (low.signs, low.number, high.signs, high.number) == ({">", ">="}, 3, {"<", "<="}, 4)
    assert not list(comparisons("between them and us, under no condition, less than 3D"))
    assert is_one_way("It stops while the door is open")
    assert not is_one_way("It stops only while the door is open")
    assert both_ways("ok IFF ready") == "IFF"
    assert both_ways("ok if ready") is None
    names = {"moves": "move", "moving": "move", "stopped": "STOP", "stopping": "STOP", "on": "on"}
    assert list(mentions("It moves on, Stopped or moving; not stopping, never removed", names)) == [
        ("moves", "move"),
        ("Stopped", "STOP"),
        ("moving", "move"),
    ]


# --- total functions -------------------------------------------------------------------------------------------------


MAP = """\
context {{ Map : {sort}; }}
node n {{
  inputs( map : Map, i : NATURAL, r : REAL )
  outputs( ok : BOOL )
  topics()
  guarantee( {formula} -> (out.ok and in.i < 3 and in.r < 3) )
}}
"""


def looked_up(formula: str, sort: str = "REAL x REAL --> NATURAL") -> bool:
    contract, diagnostics = check_text(MAP.format(sort=sort, formula=formula), "f")
    assert contract is not None, [f"{d.span}: {d.message}" for d in diagnostics if d.is_error]
    return "RCL412" in {d.code for d in diagnostics}


@pytest.mark.parametrize(
    ("formula", "sort"),
    [
        ("exists(x, y in REAL | in.map(x, y) == in.i)", "REAL x REAL --> NATURAL"),
        ("not exists(x, y in REAL | in.i + 1 == in.map(y, x))", "REAL x REAL --> NATURAL"),
        ("forall(x, y in REAL | in.map(x, y) != 0)", "REAL x REAL --> NATURAL"),
        ("forall(x, y in REAL | not in.map(x, y) == 0)", "REAL x REAL --> NATURAL"),
        ("exists(x, y in REAL | in.map(x, y) == in.i and in.r > 2)", "REAL x REAL --> NATURAL"),
        ("exists_unique(x in NATURAL | in.map(x) == in.i)", "NATURAL --> NATURAL"),
        ("exists(s in STRING | in.map(s) == in.i)", "STRING --> INTEGER"),
    ],
)
def test_lookups(formula: str, sort: str) -> None:
    assert looked_up(formula, sort)


@pytest.mark.parametrize(
    ("formula", "sort"),
    [
        ("exists(x, y in REAL | in.map(x, y) == in.i and x < y)", "REAL x REAL --> NATURAL"),  # knows what it does
        ("forall(x, y in REAL | in.map(x, y) == 0)", "REAL x REAL --> NATURAL"),  # all of them
        ("exists(x, y in REAL | in.map(x, y) != 0)", "REAL x REAL --> NATURAL"),
        ("exists(x in REAL | in.map(x, in.r) == in.i)", "REAL x REAL --> NATURAL"),
        ("exists(x, y in REAL | in.map(x, y) < in.i)", "REAL x REAL --> NATURAL"),
        ("exists(x in NATURAL | in.map(x) == 0)", "NATURAL --> NATURAL"),  # a history
        ("exists(x in REAL | in.map(x) == in.r)", "REAL --> REAL"),  # a measure
        ("exists(x in BOOL | in.map(x) == in.i)", "BOOL --> NATURAL"),  # finitely many
        ("exists(x, y in REAL, n in NATURAL | in.map(x, y, n))", "REAL x REAL x NATURAL --> BOOL"),  # a relation
    ],
)
def test_other_uses_of_functions(formula: str, sort: str) -> None:
    assert not looked_up(formula, sort)


def test_one_warning_for_each_function_and_a_comment_allows_it() -> None:
    formula = "exists(x, y in REAL | in.map(x, y) == in.i) and exists(x, y in REAL | in.map(x, y) == 0)"
    text = MAP.format(sort="REAL x REAL --> NATURAL", formula=f"({formula})")
    codes = [d.code for d in check_text(text, "f")[1]]
    assert codes.count("RCL412") == 1
    allowed = text.replace("r : REAL )", "r : REAL )  // avow: allow RCL412")
    assert "RCL412" not in [d.code for d in check_text(allowed, "f")[1]]


# --- the shipped systems ---------------------------------------------------------------------------------------------


def test_what_the_published_contracts_say_otherwise_than_their_tables() -> None:
    _, diagnostics = check_paths([ROOT / "contracts" / "remote_inspection_published" / "system.rcl"])
    told = {d.code: d.message for d in diagnostics if d.code in OURS}
    assert set(told) == OURS
    assert "`in.wayP` gives a value to all arguments" in told["RCL412"]
    assert "“less than or equal to 0”, the formula `0 <= in.r`" in told["RCL413"]
    assert "one way" in told["RCL414"]
    assert "“inspects”" in told["RCL415"]


@pytest.mark.parametrize("system", ["remote_inspection", "nasa_rover"])
def test_the_repaired_contracts_say_what_their_sentences_say(system: str) -> None:
    _, diagnostics = check_paths([ROOT / "contracts" / system / "system.rcl"])
    assert not {d.code for d in diagnostics} & OURS

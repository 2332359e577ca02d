"""What an editor offers and says of local definitions and records."""

from __future__ import annotations

import pytest

pytest.importorskip("pygls")

from avow.lsp.completion import offers
from avow.lsp.features import analyse, definition, hover, references
from avow.lsp.plan_keys import about_key, plan_offers
from avow.lsp.protocol import Lines, outline

TEXT = """\
context { define far(r : REAL) = r > 9; }
node n {
  inputs( x : REAL )
  outputs( y : BOOL )
  topics()
  define beyond(a, b : REAL) = far(a) and b < in.x;
  guarantee g "It *is* far" ( beyond(1, 2) -> y )
}
"""


def test_it_knows_them() -> None:
    document = analyse(TEXT, "n.rcl")
    assert [d for d in document.diagnostics if d.is_error] == []
    use = TEXT.index("beyond(1")
    assert hover(document, use) == "`define beyond(a, b : REAL) = far(a) and b < in.x`"
    assert hover(document, TEXT.index("far(a)")) == "`define far(r : REAL) = r > 9`"
    assert [TEXT[o.start - 7 : o.end] for o in definition(document, use)] == ["define beyond"]
    assert [o.start for o in references(document, use)] == [TEXT.index("beyond"), use]
    far, node = outline(document, Lines(document.text))
    assert [far.name, node.name] == ["far", "n"]
    assert [(s.name, s.detail) for s in node.children or ()] == [("beyond", "definition"), ("g", "It *is* far")]


def test_it_completes_them() -> None:
    document = analyse(TEXT, "n.rcl")

    def offered(before: str) -> dict[str, str]:
        at = TEXT.index(before) + len(before)
        return {o.label: o.kind for o in offers(document.taken_apart, document.project.contract, at)}

    in_clause = offered('far" ( ')
    assert (in_clause["beyond"], in_clause["far"]) == ("Function", "Function")
    in_body = offered("define beyond(a, b : REAL) = ")
    assert (in_body["far"], in_body["a"], in_body["in.x"]) == ("Function", "Variable", "Field")
    assert "far" not in offered("topics()\n  ")
    assert "define" in offered("topics()\n  ")


RECORDS = """\
context { Pose : [px, py : REAL]; Both : [one : Pose, id : NATURAL]; }
node n { inputs( at : Both ) outputs( to : Pose ) topics()
  guarantee g ( in.at.one.px == to.px and forall(p in Pose | p.py != 1 or p == to) ) }
"""


def test_it_knows_fields() -> None:
    document = analyse(RECORDS, "n.rcl")
    assert [d for d in document.diagnostics if d.is_error] == []
    use = RECORDS.index("px == to")
    assert [o.start for o in references(document, use)] == [
        *(RECORDS.index("px, py"), use, RECORDS.index("px and")),
    ]
    assert hover(document, use) == "field `px` of a record"

    def offered(before: str) -> list[str]:
        at = RECORDS.index(before) + len(before)
        return [o.label for o in offers(document.taken_apart, document.project.contract, at)]

    assert offered("in.at.") == ["one", "id"]
    assert offered("in.at.one.") == ["px", "py"]
    assert set(offered("| p.")) == {"px", "py", "one", "id"}


def test_an_enumeration_declared_as_a_constant_is_one_thing() -> None:
    """Its name stands for a type and for the set of its elements: a type of a port did not lead to its declaration."""
    text = (
        "context { Mode = {slow, fast}; }\n"
        "node n { inputs( m : Mode ) outputs( y : BOOL ) topics() guarantee( y <=> m in Mode ) }\n"
    )
    document = analyse(text, "n.rcl")
    places = [at for at in range(len(text)) if text.startswith("Mode", at)]
    assert all([o.start for o in definition(document, at)] == places[:1] for at in places)
    assert [o.start for o in references(document, places[1])] == places


TYPED = """\
context { Mode : {idle, drive}; Level : {low, high}; Limit = 2; }
node n {
  inputs( mode : Mode, last : Mode, at : [x : REAL, level : Level], on : BOOL, r : REAL )
  outputs( said : Mode )
  topics( )
  guarantee g ( HERE )
}
"""


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("in.mode == ", {"idle", "drive", "in.mode", "in.last", "out.said"}),
        ("in.mode != ", {"idle", "drive", "in.mode", "in.last", "out.said"}),
        ("in.mode == i", {"idle", "drive", "in.mode", "in.last", "out.said"}),
        ("in.at.level == ", {"low", "high"}),
        ("in.on == ", {"TRUE", "FALSE", "in.on"}),
    ],
)
def test_after_a_comparison_what_may_be_equal_is_offered(typed: str, offered: set[str]) -> None:
    contract = analyse(TYPED.replace("HERE", "TRUE"), "n.rcl").project.contract
    document = analyse(TYPED.replace("HERE", typed), "n.rcl")
    at = document.text.index(typed) + len(typed)
    assert {o.label for o in offers(document.taken_apart, contract, at)} == offered
    numbers = document.text.replace(typed, "in.r == ")
    every = offers(analyse(numbers, "n.rcl").taken_apart, contract, numbers.index("in.r == ") + 8)
    assert {"in.r", "Limit", "min"} <= {o.label for o in every}


PLAN = """\
system: x
nodes:
  n:
    criticality: high
    methods:
      - hypothesis:
          cases: 100
      - rosmonitoring: {decided: 0.9}
      - hoare
"""


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("hypothesis", "Its options: "),
        ("cases", "`cases`: "),
        ("rosmonitoring", "`mapping`"),
        ("hoare", "`program`"),
    ],
)
def test_a_plans_methods_and_options_are_explained(key: str, told: str) -> None:
    said = about_key(PLAN, PLAN.index(key) + 1)
    assert said is not None
    assert told in said
    assert about_key(PLAN, PLAN.index("100")) is None
    labels = [o.label for o in plan_offers(PLAN + "      - ", analyse("", "n.rcl").project.contract, len(PLAN) + 8)]
    assert key in labels or key == "cases"

"""Counterexamples on the plan's map: the right places are marked, and no text of a plan or a tool is markup."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from avow.assurance.model import MapView
from avow.base.diagnostics import Rejected
from avow.base.verdict import Counterexample
from avow.report.maps import draw_map
from avow.system.load import load_system

MAP = MapView("waypoint", (("0", "0", "0"), ("2.50", "-1", "1"), ("4", "3", "2")), ("inspect",))


def kinds(example: Counterexample, view: MapView = MAP) -> list[str]:
    text = str(draw_map(view, example))
    if not text:
        return []
    root = ET.fromstring(text)
    return [e.get("class", "") for e in root.iter() if e.get("class") in ("hit", "spot", "off", "way")]


def test_places_are_found_by_their_coordinates_exactly() -> None:
    found = str(draw_map(MAP, Counterexample((("in.at", "{(5/2, -1)}"), ("out.command", "move(4, 3)")))))
    assert found.count('class="hit"') == 2
    assert found.count('class="spot"') == 1
    assert "in.at: waypoint 1; out.command: waypoint 2" in found


def test_a_place_that_is_in_no_row_is_marked_as_such() -> None:
    assert kinds(Counterexample((("in.at", "{(2, 2)}"),))) == ["spot", "spot", "spot", "off"]
    assert "which is no waypoint" in str(draw_map(MAP, Counterexample((("in.at", "{(2, 2)}"),))))


def test_a_far_away_place_is_told_but_does_not_shrink_the_map() -> None:
    assert kinds(Counterexample((("in.at", "{(1000000, 2)}"),))) == ["spot", "spot", "spot"]


def test_labels_count_only_in_the_calls_that_the_plan_names() -> None:
    assert kinds(Counterexample((("x", "inspect(2)"),))).count("hit") == 1
    assert kinds(Counterexample((("x", "movebase(2)"),))) == []


def test_pairs_that_are_no_values_of_a_port_are_no_places() -> None:
    assert kinds(Counterexample((("perceives", "result(0, 0)"),))) == []


def test_a_trace_is_a_path() -> None:
    trace = tuple((("in.at", f"{{({x}, {y})}}"),) for x, y in ((0, 0), (0, 0), (4, 3)))
    text = str(draw_map(MAP, Counterexample((), trace=trace)))
    assert "step 0: waypoint 0; step 2: waypoint 2" in text
    assert text.count("polyline") == 1


def test_one_place_or_rows_without_numbers_draw_without_fault() -> None:
    assert kinds(Counterexample((("a.b", "(0, 0)"),)), MapView("m", (("0", "0", ""),))) == ["hit"]
    assert kinds(Counterexample((("a.b", "(0, 0)"),)), MapView("m", (("zero", "0", ""),))) == []
    assert kinds(Counterexample((("a.b", "(1/0, 0)"),))) == []


def test_hostile_texts_stay_text() -> None:
    evil = "</svg><script>alert(1)</script>\"'"
    view = MapView(evil, (("0", "0", evil), ("1", "1", "b")), (evil,))
    text = str(draw_map(view, Counterexample(((f"a.b{evil}", f"(0, 0){evil}"),))))
    assert "<script" not in text
    ET.fromstring(text)


@pytest.mark.parametrize(
    ("picture", "told"),
    [
        ("{table: nowhere, x: x, y: y}", "no table 'nowhere'"),
        ("{table: spots, x: x, y: height}", "no column 'height'"),
        ("{table: spots, x: x}", "'y'"),
        ("{table: spots, x: x, y: y, colour: red}", "colour"),
    ],
)
def test_a_wrong_picture_is_told_at_its_place(tmp_path: Path, picture: str, told: str) -> None:
    (tmp_path / "s.rcl").write_text("node n ( inputs( ) outputs( o : BOOL ) guarantee( out.o == TRUE ) )\n")
    (tmp_path / "plan.yaml").write_text(f"scenario:\n  spots: [{{x: 1, y: 2}}]\npictures:\n  spot: {picture}\n")
    with pytest.raises(Rejected) as caught:
        load_system(tmp_path)
    places = {d.span.line for d in caught.value.diagnostics if told in d.message and d.span is not None}
    assert places == {4}, caught.value.diagnostics

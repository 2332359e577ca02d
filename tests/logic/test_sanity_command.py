"""``avow sanity``: what people see, what machines read, and the exit codes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from click.testing import CliRunner, Result

from avow.base.diagnostics import Rejected
from avow.cli.sanity import command
from avow.solving import second

GOOD = """node n { inputs(r : REAL) outputs(v : REAL) topics() assume(in.r >= 0)
  guarantee low (in.r < 5 -> out.v == 1) guarantee high (in.r >= 5 -> out.v == in.r) }"""

BAD = GOOD.replace("in.r >= 5 ->", "in.r >= 4 ->")


def run(tmp_path: Path, text: str, *options: str) -> tuple[Result, int]:
    path = tmp_path / "system.rcl"
    path.write_text(text)
    result = CliRunner().invoke(command, [str(path), *options], standalone_mode=False)
    if result.exception:
        raise result.exception
    code = result.return_value
    assert isinstance(code, int)
    return result, code


def as_json(tmp_path: Path, text: str, root: Path) -> dict[str, Any]:
    result, _ = run(tmp_path, text, "--json")
    found = json.loads(result.stdout)
    jsonschema.validate(found, json.loads((root / "docs/schemas/sanity.schema.json").read_text()))
    return {r["name"]: r for r in found["results"]}


def test_a_good_contract(tmp_path: Path, root: Path) -> None:
    result, code = run(tmp_path, GOOD)
    assert code == 0
    assert "0 of them errors" in result.stdout
    found = as_json(tmp_path, GOOD, root)
    assert found["realizable"]["verdict"] == "proved"
    assert found["not-vacuous-low"]["verdict"] == "proved"
    assert found["not-vacuous-low"]["place"]["line"] == 2


def test_a_bad_contract(tmp_path: Path, root: Path) -> None:
    result, code = run(tmp_path, BAD)
    assert code == 1
    assert "realizable" in result.stdout
    found = as_json(tmp_path, BAD, root)
    answer = found["realizable"]
    assert answer["verdict"] == "refuted"
    assert answer["clauses"] == ["low", "high"]
    assert 4 <= float(answer["counterexample"]["values"]["in.r"]) < 5
    assert "guarantee low demands out.v = 1" in answer["counterexample"]["text"]
    assert answer["conflicts"][0]["clauses"] == ["low", "high"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "claim"),
    [
        (GOOD.replace("assume(in.r >= 0)", "assume(in.r > 0 and in.r < 0)"), "assumptions-satisfiable"),
        (GOOD.replace("in.r >= 5 ->", "").replace("in.r < 5 -> out.v == 1", "out.v == in.r + 1"), "consistent"),
        (GOOD.replace("in.r < 5 ->", "in.r < -1 ->"), "not-vacuous-low"),
        (GOOD.replace("out.v == 1", "out.v == out.v"), "not-tautological-low"),
        (GOOD.replace("low (", "more ( in.r > 6 -> out.v == in.r ) guarantee low ("), "not-redundant-more"),
        (GOOD, "determined-v"),
        (
            "context { T : {}; } node n { inputs( a : T ) outputs( b : T ) topics() guarantee( out.b != in.a ) }",
            "consistent",
        ),
        (GOOD.replace("in.r < 5 ->", "previous(in.r, 0) < 0 and in.r < -1 ->"), "not-vacuous-low"),
    ],
)
def test_what_two_solvers_do_not_agree_on_is_an_error(
    tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch, text: str, claim: str
) -> None:
    monkeypatch.setattr(second.importlib.util, "find_spec", lambda _: object())
    monkeypatch.setattr(second.smtlib, "ask_cvc5", lambda *_, **__: "unknown")
    agreed = as_json(tmp_path, text, root)
    assert agreed[claim]["verdict"] in ("refuted", "proved")
    monkeypatch.setattr(second.smtlib, "ask_cvc5", lambda *_, **__: "sat")
    found = as_json(tmp_path, text, root)
    assert found[claim]["verdict"] == "error"
    assert found[claim]["explanation"] == second.CONTRADICTED
    result, code = run(tmp_path, text)
    assert code == 1
    assert "two solvers contradict each other" in result.stdout


def test_a_contract_that_may_be_empty_is_not_realizable_for_want_of_inputs(
    tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(second.importlib.util, "find_spec", lambda _: object())
    monkeypatch.setattr(second.smtlib, "ask_cvc5", lambda *_, **__: "sat")
    found = as_json(tmp_path, GOOD.replace("assume(in.r >= 0)", "assume(in.r > 0 and in.r < 0)"), root)
    assert {found[name]["verdict"] for name in ("assumptions-satisfiable", "consistent", "realizable")} == {"error"}


def test_every_property_has_its_words_in_the_schema(root: Path) -> None:
    from avow.sanity.claims import Property

    schema = json.loads((root / "docs/schemas/sanity.schema.json").read_text())
    described = schema["$defs"]["Result"]
    assert set(described["properties"]["property"]["enum"]) == {str(p) for p in Property}
    assert all(f"{p}:" in described["description"] for p in Property)
    page = (root / "docs/sanity.md").read_text()
    assert all(re.search(rf"`{p}[-`]", page) for p in Property)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("node n {", ()),
        (GOOD, ("--node", "m")),
        ("\x00", ()),
    ],
)
def test_bad_input_is_a_diagnostic(tmp_path: Path, text: str, options: tuple[str, ...]) -> None:
    with pytest.raises(Rejected):
        run(tmp_path, text, *options)


def test_a_missing_file_is_a_diagnostic(tmp_path: Path) -> None:
    result = CliRunner().invoke(command, [str(tmp_path / "none.rcl")], standalone_mode=False)
    assert isinstance(result.exception, Rejected)


def test_markup_in_a_contract_is_text(tmp_path: Path) -> None:
    text = BAD.replace("r : REAL", "r : REAL, s : STRING").replace(
        "in.r < 5 ->", 'in.r < 5 and in.s == "[red]x[/red]" ->'
    )
    result, code = run(tmp_path, text)
    assert code == 1
    assert "[red]x[/red]" in "".join(result.stdout.split())


def test_deep_nesting_is_no_crash(tmp_path: Path) -> None:
    deep = "not (" * 60 + "in.r < 5" + ")" * 60
    result, code = run(tmp_path, GOOD.replace("in.r < 5 ->", f"{deep} ->"))
    assert code == 0
    assert "refuted" not in result.stdout.splitlines()[0]

"""avow compose, simulate and refines, as users meet them; the proofs; and that it scales."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

from avow import api
from avow.api import load, settle
from avow.base.diagnostics import Rejected
from avow.base.process import run
from avow.cli.compose import _tell
from avow.cli.compose import command as compose_command
from avow.cli.graph import command as graph_command
from avow.cli.refines import command as refines_command
from avow.cli.simulate import command as simulate_command
from avow.system.graph import dataflow
from avow.system.graph_svg import sheet
from avow.system.wiring import wiring

from .make import make, node

PROOFS = Path(__file__).parents[2] / "avow/calculus/proofs"

GOOD = node("a", "", "x : REAL", "G: out.x < 1") + node("b", "x : REAL", "y : REAL", "A: in.x < 2", "G: out.y == 0")


def invoke(command: object, *arguments: str) -> tuple[object, str]:
    result = CliRunner().invoke(command, list(arguments), standalone_mode=False)  # type: ignore[arg-type]
    if result.exception is not None:
        raise result.exception
    return result.return_value, result.output


def test_compose_prints_and_decides(tmp_path: Path) -> None:
    make(tmp_path, GOOD)
    code, output = invoke(compose_command, str(tmp_path))
    assert code == 0
    assert "R1 (whole)" in output
    assert "follows from a.G1" in output
    (tmp_path / "system.rcl").write_text(GOOD.replace("< 2", "< 0"))
    code, output = invoke(compose_command, str(tmp_path / "system.rcl"))
    assert code == 1
    assert "a.x = " in output


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("goal", [(), ("--goal", "whole")])
def test_nothing_is_proved_from_an_environment_that_cannot_be(tmp_path: Path, goal: tuple[str, ...]) -> None:
    plan = 'environment: {in.u: {assume: "in.u > 5 and in.u < previous(in.u, 9) - 1", because: test}}\n'
    plan += "requirements: {R: {text: t, formula: a.x > 0, supported_by: [a]}}"
    text = node("a", "u : REAL", "x : REAL", "G: out.x == in.u") + node("b", "x : REAL", "y : REAL", "A: in.x > 0")
    code, out = invoke(compose_command, str(make(tmp_path, text, plan).plan.root), *goal)
    assert code == 1
    assert "rests on what is vacuous: environment.in.u" in out
    assert "proved   " not in out


def test_compose_tells_a_terminal_each_answer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    make(tmp_path, GOOD)
    for terminal, told in ((Terminal(), True), (io.StringIO(), False)):
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stderr", terminal)
            _tell("whole.b.A1\x1b[2J", "proved")
        assert ("… whole.b.A1�[2J proved" in terminal.getvalue()) == told
        assert "\x1b" not in terminal.getvalue()
    assert "…" not in invoke(compose_command, str(tmp_path))[1]


def test_compose_json(tmp_path: Path) -> None:
    make(tmp_path, GOOD)
    code, output = invoke(compose_command, str(tmp_path), "--json", "--goal", "whole")
    assert code == 0
    document = json.loads(output)
    schema = json.loads((PROOFS.parents[2] / "docs/schemas/compose.schema.json").read_text())
    assert not list(Draft202012Validator(schema).iter_errors(document))
    assert document["derivations"][0]["rule"] == "R1"
    (side,) = [o for o in document["obligations"] if o["id"] == "system/composition/whole.b.A1"]
    assert side["verdict"] == "proved"
    assert side["details"]["needed"] == ["a.G1"]


def test_compose_other_outputs(tmp_path: Path) -> None:
    make(tmp_path, GOOD)
    assert "a.x → b.x" in invoke(graph_command, str(tmp_path))[1]
    assert "guarantee b_G1" in invoke(compose_command, str(tmp_path), "--rcl")[1]


def test_no_contract_is_derived_of_nodes_that_remember(tmp_path: Path) -> None:
    make(tmp_path, node("a", "e : BOOL", "x : BOOL", "G: out.x == previous(in.e, FALSE)"))
    with pytest.raises(Rejected) as told:
        invoke(compose_command, str(tmp_path), "--rcl")
    (fault,) = told.value.diagnostics
    assert (fault.code, fault.message.split(" (")[0]) == ("PLAN135", "a.G1 speaks of other steps")


def test_simulate(tmp_path: Path) -> None:
    text_ = node("a", "e : BOOL", "x : BOOL", "G: out.x == in.e")
    make(tmp_path, text_, "scenario: {steps: 3}")
    code, output = invoke(simulate_command, str(tmp_path), "--seed", "1")
    assert code == 0
    assert output.count("step ") == 3
    code, output = invoke(simulate_command, str(tmp_path), "--json", "--steps", "2")
    assert [json.loads(line)["step"] for line in output.splitlines()] == [1, 2]
    make(tmp_path, text_.replace("out.x == in.e", "out.x and not out.x"), "scenario: {}")
    code, output = invoke(simulate_command, str(tmp_path))
    assert code == 1
    assert "stuck: no output of a meets G1" in output


def test_refines(tmp_path: Path) -> None:
    one, other = tmp_path / "one.rcl", tmp_path / "other.rcl"
    one.write_text(GOOD.replace("< 1", "< 0"))
    other.write_text(GOOD)
    assert invoke(refines_command, str(one), str(other))[0] == 0
    code, output = invoke(refines_command, str(other), str(one), "--json")
    assert code == 1
    assert json.loads(output)["nodes"][0]["clauses"][0]["counterexample"] == {"out.x": "0"}
    with pytest.raises(Rejected, match="there is no system 'two'"):
        invoke(refines_command, str(one), "two")


@pytest.mark.nightly
@pytest.mark.needs_dafny
@pytest.mark.parametrize(
    "name",
    ["relational", "steps", "calculus", "r4"],
)
def test_the_rules_are_proved(tmp_path: Path, name: str) -> None:
    completed = run(["dafny", "/compile:0", str(PROOFS / f"{name}.dfy")], seconds=120)
    assert " verified, 0 errors" in completed.stdout
    assert " with 0 verified" not in completed.stdout


@pytest.mark.needs_dafny
@pytest.mark.nightly
def test_dafny_would_notice(tmp_path: Path) -> None:
    """The same proof without its persistence premise does not verify."""
    source = (PROOFS / "calculus.dfy").read_text()
    broken = source.replace("requires forall k: nat :: k < |G| ==> Persists(G[k])       //", "//")
    assert broken != source
    (tmp_path / "broken.dfy").write_text(broken)
    completed = run(["dafny", "/compile:0", str(tmp_path / "broken.dfy")], seconds=120)
    assert ", 0 errors" not in completed.stdout


def test_names_are_escaped_everywhere(tmp_path: Path) -> None:
    system = make(tmp_path, node("a_1", "", "x' : REAL") + node("b", "x' : REAL", "", "A low_: in.x' < 1"))
    ElementTree.fromstring(sheet([("", dataflow(system))]))


def test_pictures(tmp_path: Path) -> None:
    plan = "connections: [{from: b.y, to: b.last, delayed: true, initial: 1}]"
    system = make(
        tmp_path, GOOD.replace("x : REAL )\n  outputs( y", "x : REAL, last : REAL, e : REAL )\n  outputs( y"), plan
    )
    picture = sheet([("", dataflow(system))])
    assert ElementTree.fromstring(picture).tag.endswith("svg")
    assert picture.count("<rect") == 2
    assert picture.count("stroke-dasharray") == 1
    drawn = wiring(system, dataflow(system)).text()
    assert "b.y → b.last, one step later" in drawn
    assert "b.e" in drawn


def test_requirements_have_their_verdicts_in_json_and_in_the_api(tmp_path: Path) -> None:
    make(tmp_path, GOOD, "requirements: {R: {text: t, formula: b.y == b.y}, S: {text: t, formula: not b.y == b.y}}")
    code, output = invoke(compose_command, str(tmp_path), "--json")
    assert code == 1
    found = {o["id"]: o["verdict"] for o in json.loads(output)["obligations"]}
    assert (found["system/requirement/R"], found["system/requirement/S"]) == ("proved", "refuted")
    settled = settle(api.compose(load(tmp_path)))
    assert {name.partition("/")[2]: str(outcome.verdict) for name, outcome in settled.items()} == found

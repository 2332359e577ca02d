"""`avow translate --to rml|dafny`: the notations of backends, found without the core knowing one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from oracle.rml_reader import read

from avow.backend_kit import registry
from avow.backend_kit.registry import translators
from avow.base.diagnostics import Rejected
from avow.cli import main

RCL = """\
node n {
  inputs( a : REAL, word : STRING )
  outputs( b : BOOL )
  topics( p/A a matches(in.a), p/W word matches(in.word), p/B b matches(out.b) )
  guarantee positive ( b <=> a > 0 )
  guarantee said ( word == "go" -> b )
}
node m { inputs( a : REAL ) outputs( c : BOOL ) topics() guarantee( c <=> a > 0 ) }
"""
PLAN = """\
contract: system.rcl
nodes:
  n: {methods: [{rosmonitoring: {mapping: {in.a: data, in.word: data, out.b: data}}}]}
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "system.rcl").write_text(RCL)
    (tmp_path / "s" / "plan.yaml").write_text(PLAN)
    return tmp_path


def run(arguments: str, capsys: pytest.CaptureFixture[str]) -> tuple[object, str, str]:
    with pytest.raises(SystemExit) as leave:
        main(arguments.split())
    said = capsys.readouterr()
    return leave.value.code, said.out, said.err


def test_rml_with_the_plans_mapping(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What RML cannot say is named, with its place, and the exit code is 1; what it can is well-formed."""
    code, text, said = run("translate --to rml --node n s", capsys)
    assert code == 1
    assert "warning[MON105]: n.said" in said
    assert "s/system.rcl:6:3" in said
    assert "Positive<" in text
    assert text.startswith("//")
    read(text)
    code, text, said = run("translate --to rml s", capsys)
    assert code == 1
    assert "warning[MON105]: m.G1" in said, "nothing of that node can be translated, but of others"
    assert "the plan has no method rosmonitoring for node m" in said
    assert "for node n" not in said
    assert "error" not in said
    assert "m.rml" not in text
    code, text, said = run("translate --to rml --node m s", capsys)
    assert (code, text) == (2, "")
    assert "error[MON105]: m.G1" in said, "nothing at all can be"


def test_a_wrong_mapping_stays_an_error(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "s" / "plan.yaml").write_text(PLAN + "  m: {methods: [{rosmonitoring: {mapping: {in.b: data}}}]}\n")
    code, text, said = run("translate --to rml s", capsys)
    assert "Positive<" in text
    assert code == 1
    assert "error[MON101]" in said


def test_rml_without_a_plan_says_what_it_lacks(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text, said = run("translate --to rml s/system.rcl", capsys)
    assert (code, text) == (2, "")
    assert "nothing defines the messages p/A" in said


def test_files_go_into_a_folder(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text, _ = run("translate --to dafny s -o out", capsys)
    assert code == 0, text
    found = sorted(str(p.relative_to(place / "out")) for p in (place / "out").rglob("*.dfy"))
    assert "n/n_spec.dfy" in found
    assert "m/types.dfy" in found
    assert all(f"wrote out/{name}" in text for name in found)
    assert run("translate --to dafny s -o s/plan.yaml", capsys)[0] == 2
    assert (place / "s" / "plan.yaml").read_text() == PLAN


@pytest.mark.needs_dafny
def test_dafny_accepts_what_is_written(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("translate --to dafny s -o out", capsys)
    command = ["dafny", "/compile:0", "/dafnyVerify:0", "/nologo", str(place / "out" / "n" / "n_spec.dfy")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout


def test_wrong_notations_and_nodes(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, said = run("translate --to coq s", capsys)
    assert code == 2
    assert "known: dafny, fretish, json, rcl, rml, smtlib, unicode" in said
    for notation in ("rml", "unicode"):
        code, _, said = run(f"translate --to {notation} --node q s", capsys)
        assert code == 2
        assert "CLI003" in said
    code, text, _ = run("translate --to unicode --node m s", capsys)
    assert code == 0
    assert "Node m" in text
    assert "Node n" not in text


def test_a_plugin_of_the_plan_may_offer_a_notation(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (place / "shouting.py").write_text(
        "from avow.backend_kit.protocol import Backend, Translated\n"
        "from avow.base.verdict import Link, Verdict\n"
        "class Shouting(Backend):\n"
        "    name, title, version, green_means = 'shouting', 'loud', '1', ''\n"
        "    strength, link, options_schema = Verdict.TESTED, Link.GUIDED, {}\n"
        "    translations = {'loud': 'in capitals', 'escape': 'outside'}\n"
        "    def translate(self, notation, system, node):\n"
        "        name = '../../escaped' if notation == 'escape' else 'a.txt'\n"
        "        return Translated({name: node.name.upper() + '\\n', 'b.txt': ''})\n"
        "    def discharge(self, job, folder, limits): raise NotImplementedError\n"
        "BACKEND = Shouting()\n"
    )
    monkeypatch.syspath_prepend(str(place))
    (place / "s" / "plan.yaml").write_text("plugins: [shouting]\n" + PLAN)
    code, text, _ = run("translate --to loud --node n s", capsys)
    assert code == 0
    assert "// ---- n/a.txt\nN\n" in text
    assert run("translate --to escape s -o out", capsys)[0] == 2
    assert not (place.parent / "escaped").exists()
    assert not (place / "escaped").exists()
    sys.modules.pop("shouting", None)


def test_a_backend_that_does_not_load_is_no_obstacle(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = registry.backend

    def broken(name: str, plugins: tuple[str, ...] = ()):  # type: ignore[no-untyped-def]
        if name == "dafny":
            raise Rejected()
        return whole(name, plugins)

    assert {"dafny", "rml"} <= set(translators())
    monkeypatch.setattr(registry, "backend", broken)
    assert "rml" in translators()
    assert "dafny" not in translators()

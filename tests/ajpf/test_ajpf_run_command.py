"""`avow agent run`: one run, told; the interpreter is the one whose every run is checked."""

from __future__ import annotations

import json

import pytest

from avow.cli import main

PROGRAM = """\
GWENDOLEN
:name: ag
:Initial Beliefs:
:Initial Goals:
go [perform]
:Plans:
+!go [perform] : { True } <- +!sub [perform], act(X);
+warn : { ~B calm } <- shout, +calm;
"""
DRAWS = "draws: {at_quiescence: once}\npercepts: {w: [warn, nothing]}\n"


def told(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        main(["agent", "run", *map(str, arguments)])
    captured = capsys.readouterr()
    return left.value.code, captured.out, captured.err


@pytest.fixture
def files(tmp_path):
    (tmp_path / "ag.gwen").write_text(PROGRAM)
    (tmp_path / "e.yaml").write_text(DRAWS)
    return tmp_path / "ag.gwen", tmp_path / "e.yaml"


def test_a_run_is_told_and_the_same_seed_tells_it_again(files, capsys):
    program, draws = files
    said = {seed: told(capsys, program, "--environment", draws, "--seed", seed) for seed in range(6)}
    assert all(code == 0 for code, _, _ in said.values())
    assert said[3] == told(capsys, program, "--environment", draws, "--seed", 3)
    assert any("does shout" in out and "believes calm" in out for _, out, _ in said.values())
    assert any("does shout" not in out for _, out, _ in said.values())
    assert "has no plan for -!sub [perform]: it stands still" in said[0][1]
    assert not any("^" in out for _, out, _ in said.values())


def test_without_an_environment_there_is_nothing_to_perceive(files, capsys):
    code, out, _ = told(capsys, files[0], "--json", "--steps", 40)
    steps = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert [step["step"] for step in steps] == list(range(1, len(steps) + 1))
    assert all(not step["offered"] for step in steps)


def test_what_goes_wrong_is_said(files, tmp_path, capsys):
    code, _, err = told(capsys, tmp_path / "nowhere.gwen")
    assert code == 2
    assert "AJPF101" in err
    code, _, err = told(capsys, files[0], "--environment", files[0])
    assert code == 2
    assert "ag.gwen:2:6" in err
    files[0].write_text(PROGRAM.replace("act(X)", "sum(a, 1, X)").replace("+!sub [perform], ", ""))
    code, _, err = told(capsys, files[0])
    assert code == 1
    assert "sum(a,1" in err

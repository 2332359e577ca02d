"""AIL's second opinion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from small_agents import case

from avow.backend_kit.protocol import Limits
from avow.backends.ajpf import BACKEND, ajpf_tool, files, replay
from avow.backends.ajpf.checker import Checker, Property
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.files import program_text
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.java import environment_class
from avow.backends.ajpf.options import Setup
from avow.backends.ajpf.parser import parse_system
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system
from avow.backends.ajpf.terms import Struct
from avow.base.verdict import Verdict
from avow.isolation.outside import Outside
from avow.isolation.tracing import traces

MCAPL = {"semantics": "mcapl"}


def _installed(tmp_path: Path, monkeypatch, answer: str) -> None:
    """A stand-in for a Java with AJPF, which always prints the same."""
    home = tmp_path / "mcapl"
    (home / "bin").mkdir(parents=True)
    (home / "lib" / "3rdparty").mkdir(parents=True)
    (tmp_path / "answer").write_text(answer)
    java = tmp_path / "java"
    java.write_text(
        "#!/bin/sh\n"
        'if [ "$1" = -version ]; then echo \'openjdk version "11.0.13"\' >&2; exit 0; fi\n'
        'for last; do :; done; test -f "$last" || exit 3; echo "$last" >> "${0%/*}/asked"\n'
        'cat "${0%/*}/answer"\n'
    )
    java.chmod(0o755)
    monkeypatch.setenv("AJPF_HOME", str(home))
    monkeypatch.setenv("AVOW_AJPF_JAVA", str(java))


def test_a_substitute_is_never_called_ajpf(lift, tmp_path, monkeypatch):
    monkeypatch.delenv("AJPF_HOME", raising=False)
    report = BACKEND.discharge(lift(), tmp_path, Limits(seconds=60))
    said = " ".join([report.tool, *(o.summary for o in report.outcomes), str([o.details for o in report.outcomes])])
    assert "AJPF" not in said


@pytest.mark.skipif(not traces(), reason="strace is not here")
def test_what_was_read_for_an_environment_that_does_not_compile_is_an_input(lift, tmp_path, monkeypatch):
    """Once that is another, it may."""
    _installed(tmp_path, monkeypatch, "")
    settings = tmp_path / "settings"
    settings.write_text("1")
    (tmp_path / "javac").write_text('#!/bin/sh\ncat "${0%/*}/settings"\nexit 1\n')
    (tmp_path / "javac").chmod(0o755)
    report = BACKEND.discharge(lift(MCAPL), tmp_path, Limits(seconds=60))
    assert "does not compile" in str(report.outcomes[0].bound)
    assert str(settings) in {o.path for o in report.observed}


@pytest.mark.skipif(not traces(), reason="strace is not here")
def test_a_replay_that_differs_is_an_error_and_what_it_read_is_an_input(lift, tmp_path, monkeypatch):
    """With a stand-in for AIL, which tells nothing."""
    _installed(tmp_path, monkeypatch, "\n".join(f"avow: run {at}.txt\nnothing" for at in range(20)))
    (tmp_path / "javac").write_text("#!/bin/sh\ntrue\n")
    (tmp_path / "javac").chmod(0o755)

    def answers():
        report = BACKEND.discharge(lift(MCAPL), tmp_path, Limits(seconds=60))
        assert str(tmp_path / "answer") in {o.path for o in report.observed}
        (found,) = [o for o in report.outcomes if o.obligation.endswith("answers")]
        return found

    first = answers()
    assert first.verdict is Verdict.ERROR
    assert "our run has 'start, believing " in first.summary
    monkeypatch.setattr(replay, "_difference", lambda moments, output: None)
    found = answers()
    assert found.verdict is Verdict.REFUTED
    assert "does the same run" in str(found.details["properties"])


@pytest.mark.needs_ajpf
def test_a_run_that_refutes_is_done_again_by_ail(lift, tmp_path):
    report = BACKEND.discharge(lift(MCAPL), tmp_path, Limits(seconds=120))
    (answers,) = [o for o in report.outcomes if o.obligation.endswith("answers")]
    assert answers.verdict is Verdict.REFUTED
    assert "does the same run" in str(answers.details["properties"])
    assert "runs as the checker does" in str(answers.bound["replay"])


@pytest.mark.needs_ajpf
def test_a_run_that_ail_does_not_do_is_no_refutation(lift, tmp_path, monkeypatch):
    """A seeded fault: our interpreter takes initial beliefs for granted that AIL does not have."""
    monkeypatch.setattr(
        files, "program_text", lambda agents: program_text([replace(agent, beliefs=()) for agent in agents])
    )
    report = BACKEND.discharge(lift(MCAPL), tmp_path, Limits(seconds=120))
    (answers,) = [o for o in report.outcomes if o.obligation.endswith("answers")]
    assert answers.verdict is Verdict.ERROR
    assert "contradictory" in answers.summary
    assert answers.counterexample is None


def test_what_a_run_tells(tmp_path):
    """The moments of a lasso, its loop gone through twice; and the class that repeats its draws compiles from them."""
    (tmp_path / "e.yaml").write_text("draws: {at_quiescence: repeatedly}\npercepts: {w: [warn, nothing]}\n")
    draws = read_environment(tmp_path / "e.yaml")
    program = parse_system(
        "GWENDOLEN\n:name: ag\n:Initial Beliefs:\nb\n:Initial Goals:\n:Plans:\n+warn : { True } <- shout;\n", "ag.gwen"
    )
    wanted = Property("f", instantiate(parse_psl("[] (~D(ag, shout))"), {}))
    checker = Checker(explore(system(program, draws, Semantics.MCAPL)), (wanted,))
    lasso = checker.lasso(wanted)
    assert lasso is not None
    moments, script = replay.expected(checker.graph, lasso)
    assert moments[0].text() == "start\tb"
    assert any(moment.text().startswith("shout\tb; warn") for moment in moments)
    assert len(script.draws) >= len(moments) - 1
    assert script.text().startswith(f"draw {script.draws[0][0]}\n")
    assert "readAllLines" in environment_class(draws, scripted=True)
    assert "readAllLines" not in environment_class(draws)


@pytest.mark.needs_ajpf
@pytest.mark.parametrize("seed", [0, 1, 3])  # in 2 nothing happens
def test_ail_does_sampled_runs_as_our_interpreter_does(tmp_path, seed):
    """And not those of another program: a seeded fault that no property need meet."""
    made = case(seed)
    (tmp_path / "e.yaml").write_text(made.environment)
    programs, draws = parse_system(made.program, "ag.gwen"), read_environment(tmp_path / "e.yaml")
    setup = Setup(programs, programs[0].name, draws, tmp_path, (), {}, (), Semantics.MCAPL, 5_000)
    for faulty in (False, True):
        ours = [replace(p, beliefs=(*p.beliefs, Struct("unheard_of"))) if faulty else p for p in programs]
        graph = explore(system(ours, draws, Semantics.MCAPL), states=5_000)
        runs = [(graph, lasso) for lasso in replay.sampled(graph, 5)]
        installation = ajpf_tool.find()
        folder = tmp_path / str(faulty)
        folder.mkdir()
        answers = replay.replay(installation, setup, runs, folder, Outside((installation.tool,)))
        assert not any(a.fault for a in answers)
        assert all((a.difference is not None) is faulty for a in answers)

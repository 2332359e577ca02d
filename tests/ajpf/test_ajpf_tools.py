"""AJPF: how its answers are read, and its second opinion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from helpers import some
from small_agents import case

from avow.backend_kit.protocol import Limits
from avow.backends.ajpf import BACKEND, ajpf_tool, files, replay
from avow.backends.ajpf.ajpf_tool import AjpfResult, judge
from avow.backends.ajpf.asking import ask, keep, recall
from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts
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
from avow.base import tools
from avow.base.process import Completed
from avow.base.verdict import Verdict
from avow.isolation.outside import Outside
from avow.isolation.tracing import traces

RESULTS = "====================================================== results\n"
HOLDS = RESULTS + "no errors detected\n"
VIOLATED = RESULTS + 'error #1: ajpf.MCAPLListener "An Accepting Path has been found: …"\n'
PATH = "[MS: 0, BS: 1, UN: 0], [MS: 4, BS: 2, UN: 0], [MS: 4, BS: 2, UN: 1]"


def completed(stdout="", stderr="", code=0):
    return Completed(("java",), code, stdout, stderr, 1.0)


@pytest.mark.parametrize(
    ("done", "said"),
    [
        (completed(HOLDS), AjpfResult.HOLDS),
        (completed(VIOLATED, PATH), AjpfResult.VIOLATED),
        (completed(""), AjpfResult.ERROR),
        (completed("no errors detected"), AjpfResult.ERROR),
        (completed(HOLDS + VIOLATED), AjpfResult.ERROR),
        (completed(HOLDS + "[an agent printed that]\n" + HOLDS), AjpfResult.ERROR),
        (completed(HOLDS + RESULTS), AjpfResult.ERROR),
        (completed(RESULTS + "error #1: gov.nasa.jpf.vm.NoUncaughtExceptionsProperty"), AjpfResult.ERROR),
        (completed(HOLDS + "error #1: gov.nasa.jpf.vm.NoUncaughtExceptionsProperty"), AjpfResult.ERROR),
        (completed(HOLDS, "line 1:14 mismatched input '<>' expecting '('"), AjpfResult.ERROR),
        (completed(HOLDS, "line 1:3 extraneous input ')'"), AjpfResult.ERROR),
        (completed(HOLDS, "line 13:0 missing RR_NEWLINE at ':Initial Goals:'"), AjpfResult.HOLDS),
        (completed("search constraint: depth\n" + HOLDS), AjpfResult.INCONCLUSIVE),
        (completed(HOLDS, code=None), AjpfResult.TIMEOUT),
        (completed("Exception in thread main", code=0), AjpfResult.ERROR),
    ],
)
def test_answers_are_read_from_the_text_never_from_the_exit_code(done, said):
    assert judge(done).said is said


def _installed(tmp_path: Path, monkeypatch, answer: str) -> None:
    """A stand-in for a Java with AJPF; it answers the same to every property."""
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


@pytest.mark.parametrize(
    ("answer", "verdict"),
    some(
        [
            (HOLDS, Verdict.CHECKED),
            (VIOLATED, Verdict.REFUTED),
            ("crash", Verdict.ERROR),
            ("search constraint", Verdict.UNKNOWN),
        ],
        1,
    ),
)
def test_ajpf_as_the_engine(lift, tmp_path, monkeypatch, answer, verdict):
    _installed(tmp_path, monkeypatch, answer)
    job = lift({"engine": "ajpf", "environment_class": "lift.Env", "semantics": "mcapl"})
    folder = tmp_path / "out"
    for name, text in BACKEND.export(job).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    report = BACKEND.discharge(job, folder, Limits(seconds=60))
    assert {o.verdict for o in report.outcomes} == {verdict}
    assert report.tool == "AJPF"
    assert len((tmp_path / "asked").read_text().splitlines()) == 3
    assert "env = lift.Env" in (folder / "cabin.ail").read_text()
    assert "MCAPL without a version, Java 11.0.13" in report.outcomes[0].bound["ajpf"]


def test_ajpf_missing_is_not_run_and_says_how_to_get_it(lift, tmp_path, monkeypatch):
    monkeypatch.delenv("AJPF_HOME", raising=False)
    assert ajpf_tool.tool().present is False
    job = lift({"engine": "ajpf", "environment_class": "lift.Env", "semantics": "mcapl"})
    report = BACKEND.discharge(job, tmp_path, Limits(seconds=60))
    assert {o.verdict for o in report.outcomes} == {Verdict.NOT_RUN}
    assert "AJPF_HOME" in report.outcomes[0].summary


@pytest.mark.slow
def test_answers_are_kept_and_asked_again_when_anything_changes(lift, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    _installed(tmp_path, monkeypatch, HOLDS)
    javac = tmp_path / "javac"
    javac.write_text("#!/bin/sh\ntrue\n")
    javac.chmod(0o755)

    def asked(options=None, files=None):
        (tmp_path / "asked").write_text("")
        (tmp_path / "out").mkdir(exist_ok=True)
        options = {"engine": "ajpf", "semantics": "mcapl", **(options or {})}
        report = BACKEND.discharge(lift(options, files), tmp_path / "out", Limits(seconds=60))
        assert {o.verdict for o in report.outcomes} == {Verdict.CHECKED}
        return (tmp_path / "asked").read_text().count(".jpf"), report.outcomes[0].bound["ajpf"]

    assert asked()[0] == 3
    again, said = asked()
    assert again == 0
    assert "3 of 3 answers kept" in said
    assert asked({"properties": {"more": "[] (~D(cabin, go(9)))"}})[0] == 1, "only what is new"
    program = lift({"engine": "ajpf", "semantics": "mcapl"}).options["program"]
    text = (lift().root / program).read_text()
    assert asked(files={program: text + "+new : { True } <- act;\n"})[0] == 3, "another program"
    (tmp_path / "mcapl" / "bin" / "a.class").write_text("another build")
    ajpf_tool._find.cache_clear()
    tools.program_files.cache_clear()
    assert asked()[0] == 3, "another MCAPL"
    for note in (tmp_path / "cache" / "avow" / "ajpf").glob("*.json"):
        old = note.read_text()
        note.write_text(old.replace('"framework": "', '"framework": "another '))
        assert note.read_text() != old
    assert asked()[0] == 3, "an edited note is none"


def test_what_ajpf_did_not_decide_is_not_kept(lift, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for answer in ("crash", "search constraint"):
        keep("k", replace(judge(completed(answer))))
        assert recall("k") is None


def test_a_substitute_is_never_called_ajpf(lift, tmp_path, monkeypatch):
    monkeypatch.delenv("AJPF_HOME", raising=False)
    report = BACKEND.discharge(lift(), tmp_path, Limits(seconds=60))
    said = " ".join([report.tool, *(o.summary for o in report.outcomes), str([o.details for o in report.outcomes])])
    assert "AJPF" not in said


@pytest.mark.skipif(not traces(), reason="strace is not here")
@pytest.mark.parametrize("engine", ["auto", "ajpf"])
def test_what_was_read_for_an_environment_that_does_not_compile_is_an_input(lift, tmp_path, monkeypatch, engine):
    """Once that is another, it may: of a replay, and of AJPF's own answers."""
    _installed(tmp_path, monkeypatch, HOLDS)
    settings = tmp_path / "settings"
    settings.write_text("1")
    (tmp_path / "javac").write_text('#!/bin/sh\ncat "${0%/*}/settings"\nexit 1\n')
    (tmp_path / "javac").chmod(0o755)
    report = BACKEND.discharge(lift({"engine": engine, "semantics": "mcapl"}), tmp_path, Limits(seconds=60))
    assert "does not compile" in " ".join([*(o.summary for o in report.outcomes), str(report.outcomes[0].bound)])
    assert str(settings) in {o.path for o in report.observed}


@pytest.mark.skipif(not traces(), reason="strace is not here")
def test_what_a_replay_told_is_kept_and_what_it_read_is_an_input(lift, tmp_path, monkeypatch):
    """With a stand-in for AIL, which tells nothing: a run is kept where it agrees with ours, and only there."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    _installed(tmp_path, monkeypatch, "\n".join(f"avow: run {at}.txt\nnothing" for at in range(20)))
    (tmp_path / "javac").write_text("#!/bin/sh\ntrue\n")
    (tmp_path / "javac").chmod(0o755)

    def answers():
        report = BACKEND.discharge(lift({"engine": "auto", "semantics": "mcapl"}), tmp_path, Limits(seconds=60))
        assert str(tmp_path / "answer") in {o.path for o in report.observed}
        (found,) = [o for o in report.outcomes if o.obligation.endswith("answers")]
        return found, (tmp_path / "asked").read_text().count(".txt")

    first, asked = answers()
    assert first.verdict is Verdict.ERROR
    assert "our run has 'start, believing " in first.summary
    monkeypatch.setattr(replay, "_difference", lambda moments, output: None)
    for _ in range(2):
        found, again = answers()
        assert found.verdict is Verdict.REFUTED
        assert "does the same run" in str(found.details["properties"])
        assert again == asked + 1, "AIL was asked once more, as it had told another run, and then no more"


@pytest.mark.needs_ajpf
@pytest.mark.parametrize("seed", range(3))
def test_ajpf_agrees_on_small_agents(tmp_path, seed):
    """Programs printed anew, environments generated: AJPF runs them, and says what we say."""
    made = case(seed)
    (tmp_path / "e.yaml").write_text(made.environment)
    program, draws = parse_system(made.program, "ag.gwen"), read_environment(tmp_path / "e.yaml")
    wanted = [Property(f"f{n}", instantiate(parse_psl(text), {})) for n, text in enumerate(made.formulas)]
    setup = Setup(
        program,
        program[0].name,
        draws,
        tmp_path,
        (),
        {},
        (),
        Semantics.MCAPL,
        "ajpf",
        5_000,
        environment_class=None,
    )
    installation = ajpf_tool.find()
    assert installation is not None
    answers = ask(installation, setup, wanted, seconds=240, megabytes=2_000)
    for p in wanted:
        graph = explore(system(program, draws, Semantics.MCAPL, probed=asks_for_percepts(p)), states=5_000)
        assert graph.unfinished is None
        expected = AjpfResult.HOLDS if Checker(graph, (p,)).check(p).holds else AjpfResult.VIOLATED
        assert answers[p.key].said is expected, answers[p.key].log
        assert answers[p.key].framework


@pytest.mark.needs_ajpf
def test_a_run_that_refutes_is_done_again_by_ail(lift, tmp_path, monkeypatch):
    job = lift({"engine": "auto", "semantics": "mcapl"})
    report = BACKEND.discharge(job, tmp_path, Limits(seconds=120))
    (answers,) = [o for o in report.outcomes if o.obligation.endswith("answers")]
    assert answers.verdict is Verdict.REFUTED
    assert "does the same run" in str(answers.details["properties"])
    assert "runs as the checker does" in str(answers.bound["replay"])
    monkeypatch.setattr(replay, "_run", lambda *a, **k: pytest.fail("what AIL told was not kept"))
    (again,) = [o for o in BACKEND.discharge(job, tmp_path, Limits(seconds=120)).outcomes if o == answers]
    assert "does the same run" in str(again.details["properties"])


@pytest.mark.needs_ajpf
def test_a_run_that_ail_does_not_do_is_no_refutation(lift, tmp_path, monkeypatch):
    """A seeded fault: our interpreter takes initial beliefs for granted that AIL does not have."""
    monkeypatch.setattr(
        files, "program_text", lambda agents: program_text([replace(agent, beliefs=()) for agent in agents])
    )
    report = BACKEND.discharge(lift({"engine": "auto", "semantics": "mcapl"}), tmp_path, Limits(seconds=120))
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
    setup = Setup(
        programs, programs[0].name, draws, tmp_path, (), {}, (), Semantics.MCAPL, "auto", 5_000, environment_class=None
    )
    for faulty in (False, True):
        ours = [replace(p, beliefs=(*p.beliefs, Struct("unheard_of"))) if faulty else p for p in programs]
        graph = explore(system(ours, draws, Semantics.MCAPL), states=5_000)
        runs = [(graph, lasso) for lasso in replay.sampled(graph, 5)]
        installation = ajpf_tool.find()
        folder = tmp_path / str(faulty)
        folder.mkdir()
        answers = replay.replay(installation, setup, runs, folder, Outside((installation.tool,)))
        assert {a.said for a in answers} == ({AjpfResult.VIOLATED} if faulty else {AjpfResult.HOLDS}), [
            a.reason for a in answers
        ]

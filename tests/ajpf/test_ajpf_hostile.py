"""Programs and systems that mean no good: an answer in bounded time, or a located refusal; never a false good one."""

from __future__ import annotations

import time

import pytest

from avow.backend_kit.protocol import Limits
from avow.backends.ajpf import BACKEND
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import parse_system
from avow.backends.ajpf.society import system
from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict

PING = """
:name: {name}
:Initial Beliefs:
:Initial Goals:
{goals}
:Plans:
+!go [perform] : {{ True }} <- .send({other}, :tell, n(0));
+.received(:tell, n(X)) : {{ B n(Y) }} <- -n(Y), +n(X), .send(From, :tell, n((X + 1)));
+.received(:tell, n(X)) : {{ True }} <- +n(X), .send(From, :tell, n((X + 1)));
"""


def explored(text: str, tmp_path, **bounds):
    (tmp_path / "e.yaml").write_text("draws: {quiet: [send]}\npercepts: {x: [nothing]}\n")
    programs = parse_system(text, "s.gwen")
    return explore(system(programs, read_environment(tmp_path / "e.yaml"), Semantics.MCAPL), **bounds)


def test_agents_that_count_for_ever_are_unfinished_not_checked(tmp_path):
    one, two = (
        PING.format(name="one", other="two", goals="go [perform]"),
        PING.format(name="two", other="one", goals=""),
    )
    graph = explored(f"GWENDOLEN\n{one}{two}", tmp_path, states=2_000)
    assert "more than 2000 states" in (graph.unfinished or "")


@pytest.mark.slow
def test_a_message_that_grows_is_unfinished(tmp_path):
    plans = "+.received(:tell, B) : { True } <- .send(From, :tell, s(B));"
    head = ":name: {}\n:Initial Beliefs:\n:Initial Goals:\n{}\n:Plans:\n"
    text = "GWENDOLEN\n" + head.format("one", "g [perform]") + "+!g [perform] : { True } <- .send(two, :tell, a);\n"
    graph = explored(f"{text}{plans}\n{head.format('two', '')}{plans}\n", tmp_path, states=20_000, seconds=20)
    assert graph.unfinished is not None


def test_a_message_that_is_only_a_variable_is_no_good_answer(tmp_path):
    head = ":name: {}\n:Initial Beliefs:\n:Initial Goals:\n{}\n:Plans:\n"
    text = "GWENDOLEN\n" + head.format("one", "g [perform]") + "+!g [perform] : { True } <- .send(two, :perform, X);\n"
    heard = "+.received(:perform, G) : { True } <- +!G [perform];\n"
    graph = explored(text + head.format("two", "") + heard, tmp_path, states=2_000)
    assert graph.unfinished is not None
    assert "error of its own" in graph.unfinished


@pytest.mark.parametrize("many", [40, 200])
def test_many_agents_are_read_and_bounded(tmp_path, many):
    head = ":name: a{}\n:Initial Beliefs:\n:Initial Goals:\ng [perform]\n:Plans:\n+!g [perform] : {{ True }} <- act;\n"
    started = time.monotonic()
    graph = explored("GWENDOLEN\n" + "".join(map(head.format, range(many))), tmp_path, states=500, seconds=20)
    assert graph.unfinished is not None
    assert time.monotonic() - started < 60


def test_agents_with_names_that_psl_has_are_refused(lift):
    job = lift()
    program = job.options["program"]
    text = (job.root / program).read_text()
    second = ":name: {}\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n"
    for name, code in (("U", "AJPF104"), ("Other", "AJPF104"), ("cabin", "AJPF104")):
        wrong = lift({}, {program: text + second.format(name) + "+p : { True } <- act;\n"})
        assert [d.code for d in BACKEND.check(wrong) if d.is_error] == [code]


def test_a_third_of_an_agent_is_located():
    with pytest.raises(Rejected) as caught:
        parse_system(
            "GWENDOLEN\n:name: a\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n+p : { True };\n:name: b\n", "s.gwen"
        )
    assert caught.value.diagnostics[0].span.line == 8


def test_a_force_that_there_is_not_is_told():
    with pytest.raises(Rejected) as caught:
        parse_system(
            "GWENDOLEN\n:name: a\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n+p : { True } <- .send(b, :shout, x);",
            "f",
        )
    assert caught.value.diagnostics[0].hint == "expected ':tell', ':perform' or ':achieve'"


def test_a_machine_without_java_gives_the_same_verdicts(lift, tmp_path, monkeypatch):
    """What is installed adds second opinions; it changes no verdict."""
    with_tools = BACKEND.discharge(lift(), tmp_path, Limits(seconds=120))
    monkeypatch.delenv("AJPF_HOME", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    without = BACKEND.discharge(lift(), tmp_path, Limits(seconds=120))
    assert {o.obligation: o.verdict for o in without.outcomes} == {o.obligation: o.verdict for o in with_tools.outcomes}
    assert {o.verdict for o in without.outcomes} == {Verdict.CHECKED}


@pytest.mark.slow
def test_a_rule_that_asks_for_too_much_ends_the_search(tmp_path):
    """Six of forty beliefs, in every way: 4,096,000,000 of them."""
    beliefs = "\n".join(f"n({k})" for k in range(40))
    rule = "big :- n(A), n(B), n(C), n(D), n(E), n(F), never;"
    text = (
        f"GWENDOLEN\n:name: ag\n:Initial Beliefs:\n{beliefs}\n:Reasoning Rules:\n{rule}\n:Initial Goals:\ng [perform]\n"
        ":Plans:\n+!g [perform] : { B big } <- act;\n"
    )
    (tmp_path / "e.yaml").write_text("percepts: {x: [nothing]}\n")
    found = explore(system(parse_system(text, "a.gwen"), read_environment(tmp_path / "e.yaml"), Semantics.MCAPL))
    assert "ask for too much" in str(found.unfinished)

"""Several agents in one system: messages, and the turns that agents take."""

from __future__ import annotations

import pytest
from small_societies import society

from avow.backend_kit.protocol import Limits
from avow.backends.ajpf import BACKEND
from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts
from avow.backends.ajpf.environment import read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.files import program_text
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.parser import parse_system
from avow.backends.ajpf.psl_parser import instantiate, parse_psl
from avow.backends.ajpf.society import system
from avow.base.verdict import Verdict

QUIET = "draws: {at_start: true, at_quiescence: once, quiet: [send]}\npercepts: {x: [nothing]}\n"


def agent(name: str, plans: str, goals: str = "", beliefs: str = "") -> str:
    return f":name: {name}\n:Initial Beliefs:\n{beliefs}\n:Initial Goals:\n{goals}\n:Plans:\n{plans}\n"


@pytest.fixture
def holds(tmp_path):
    def check(formula: str, *agents: str, environment: str = QUIET) -> bool:
        (tmp_path / "e.yaml").write_text(environment)
        programs = parse_system("GWENDOLEN\n" + "".join(agents), "s.gwen")
        wanted = Property("f", instantiate(parse_psl(formula), {}))
        agents = system(
            programs, read_environment(tmp_path / "e.yaml"), Semantics.MCAPL, probed=asks_for_percepts(wanted)
        )
        graph = explore(agents, states=20_000)
        assert graph.unfinished is None
        return Checker(graph, (wanted,)).check(wanted).holds

    return check


GREETER = agent("one", "+!greet [perform] : { True } <- .send(two, :tell, hello);", "greet [perform]")


def test_a_message_is_answered_by_a_plan_that_knows_the_sender(holds):
    two = agent("two", "+.received(:tell, B) : { True } <- +B, +from(From), .send(From, :tell, back);")
    assert holds("<> (B(two, hello) & B(two, from(one)))", GREETER, two)
    answering = GREETER.rstrip() + "\n+.received(:tell, B) : { True } <- +B;\n"
    assert holds("<> B(one, back)", answering, two)
    assert not holds("<> B(two, back)", answering, two)


def test_a_message_of_another_force_or_content_is_not_answered(holds):
    for trigger in ("+.received(:achieve, G)", "+.received(:tell, bye)"):
        assert holds("[] (~B(two, heard))", GREETER, agent("two", f"{trigger} : {{ True }} <- +heard;"))


def test_a_sender_in_the_content_must_be_the_sender(holds):
    """AIL calls the sender `From`: the same variable in the content is the same name."""
    for name, heard in (("one", True), ("two", False)):
        one = agent("one", f"+!g [perform] : {{ True }} <- .send(two, :tell, bid(5, {name}));", "g [perform]")
        two = agent("two", "+.received(:tell, bid(D, From)) : { True } <- +bid(From, D);")
        assert holds("<> B(two, bid(one, 5))", one, two) is heard


def test_messages_that_wait_are_read_by_their_texts_and_the_same_one_once(holds):
    one = agent(
        "one",
        "+!g [perform] : { True } <- +.lock, .send(two, :tell, b), .send(two, :tell, a), .send(two, :tell, a), -.lock;",
        "g [perform]",
    )
    two = agent(
        "two", "+.received(:tell, a) : { ~B b } <- first; +.received(:tell, B) : { True } <- +B, +n;", beliefs="asleep"
    )
    assert not holds("<> D(two, first)", one, two), "two may read each message as it comes"
    assert not holds("[] (~D(two, first))", one, two), "and b after a, if both wait"


def test_the_last_action_is_the_systems(holds):
    one = agent("one", "+!g [perform] : { True } <- act;", "g [perform]")
    two = agent("two", "+!g [perform] : { True } <- other;", "g [perform]")
    assert holds("[] ((~D(one, act)) || (~D(two, other)))", one, two)
    assert not holds("<> ([] D(one, act))", one, two)
    assert not holds("<> ([] D(two, other))", one, two)
    assert holds("<> (D(one, act) || D(two, other))", one, two)


def test_percepts_wake_all_and_a_message_its_receiver(holds):
    draws = "draws: {at_start: false, at_quiescence: never, quiet: [send]}\npercepts: {x: [p]}\n"
    one = agent("one", "+!g [perform] : { True } <- .send(two, :tell, go);", "g [perform]")
    two = agent("two", "+.received(:tell, go) : { True } <- act; +p : { True } <- +seen;")
    three = agent("three", "+p : { True } <- +seen;")
    assert holds("<> (B(two, seen) & B(three, seen))", one, two, three, environment=draws)
    silent = agent("two", "+.received(:tell, go) : { True } <- +heard;")
    assert holds("[] (~B(three, seen))", one, silent, three, environment=draws)
    assert holds("<> B(two, heard)", one, silent, three, environment=draws)


def test_a_message_for_nobody_is_lost(holds):
    one = agent("one", "+!g [perform] : { True } <- .send(nobody, :tell, a), +done;", "g [perform]")
    assert holds("<> B(one, done)", one, agent("two", "+.received(:tell, B) : { True } <- +B;"))


def test_what_one_sends_itself_comes(holds):
    one = agent(
        "one",
        "+!g [perform] : { True } <- .send(one, :perform, h); +.received(:perform, G) : { True } <- +!G [perform];"
        "+!h [perform] : { True } <- +done;",
        "g [perform]",
    )
    assert holds("<> B(one, done)", one, agent("two", "+a : { True } <- act;"))


def test_arithmetic_in_a_message_is_computed(holds):
    one = agent(
        "one", "+!g [perform] : { B cash(C) } <- .send(two, :tell, bid((C + 3), one));", "g [perform]", "cash(5)"
    )
    two = agent("two", "+.received(:tell, bid(X, A)) : { True } <- +bid(X);")
    assert holds("<> (B(two, bid(8)) & D(one, send(bid(8, one), two)))", one, two)


def test_a_name_that_comes_from_what_was_sent_is_a_text(holds):
    """AJPF's answer: the variable of `.sent` is bound to a text, which no belief about the agent has."""
    plans = (
        "+!g [perform] : { True } <- .send(two, :tell, hello), +!h [perform];"
        "+!h [perform] : { .sent(Ag, :tell, hello), B friend(Ag) } <- +known;"
        "+!h [perform] : { .sent(Ag, :tell, hello) } <- +stranger, .send(Ag, :tell, again);"
    )
    one, two = agent("one", plans, "g [perform]", "friend(two)"), agent("two", "+.received(:tell, B) : { True } <- +B;")
    assert holds("<> (B(one, stranger) & B(two, again))", one, two)
    assert holds("[] ((~B(one, known)) & (~D(one, send(again, two))))", one, two)


@pytest.mark.parametrize(("percepts", "at_once"), [("[p]", True), ("[p, nothing]", False)])
def test_what_there_is_to_perceive_before_the_first_turn(holds, percepts, at_once):
    """AJPF's answer: it looks before the first turn, and sees the first draw at once if there is no choice in it."""
    draws = f"draws: {{at_start: true, at_quiescence: never}}\npercepts: {{x: {percepts}}}\n"
    agents = [agent(name, "+p : { True } <- +seen;") for name in ("one", "two")]
    assert holds("P(p)", *agents, environment=draws) is at_once


@pytest.mark.parametrize("agents", [1, 2])
def test_a_run_that_ended_draws_no_more_and_so_is_fair(holds, agents):
    """Its last draw may have been of nothing: "if percepts are drawn for ever" says nothing of it."""
    draws = "draws: {at_start: true, at_quiescence: once}\npercepts: {x: [p, nothing]}\n"
    fair = draws + "fair: [{percept: p, because: it comes}]\n"
    system = [agent("one", "+p : { True } <- act;"), agent("two", "+q : { True } <- act;")][:agents]
    assert not holds("<> B(one, p)", *system, environment=fair)
    assert holds("<> B(one, p)", *system, environment=fair.replace("once", "repeatedly"))


def test_programs_are_printed_and_read_again():
    for seed in range(20):
        once = program_text(parse_system(society(seed).program, "s.gwen"))
        assert program_text(parse_system(once, "s.gwen")) == once


def test_a_system_is_checked_as_a_nodes_method(lift, tmp_path, monkeypatch):
    """The lift's cabin, with a second agent that it tells what it does."""
    job = lift()
    path = job.root / job.options["program"]
    text = path.read_text() + agent("log", "+.received(:tell, B) : { True } <- +B;")
    job = lift({"properties": {"never": "[] (~B(log, told))"}}, {path.name: text})
    assert not [d for d in BACKEND.check(job) if d.is_error]
    report = BACKEND.discharge(job, tmp_path, Limits(seconds=120))
    assert {o.verdict for o in report.outcomes} <= {Verdict.CHECKED, Verdict.REFUTED, Verdict.UNKNOWN}
    assert all(any("take turns" in h.text for h in o.rests_on) for o in report.outcomes if o.rests_on)
    exported = BACKEND.export(job)
    assert "SingleAgentScheduler()" not in exported["AvowEnvironment.java"]
    wrong = lift({"properties": {"never": "[] (~B(nobody, told))"}}, {path.name: text})
    (fault,) = [d for d in BACKEND.check(wrong) if d.is_error]
    assert fault.code == "AJPF121"
    assert "'log'" in fault.message

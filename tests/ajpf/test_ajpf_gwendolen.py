"""Gwendolen: the parser, and the reasoning cycle step by step."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_agents import case

from avow.backends.ajpf.checker import Checker, Property, asks_for_percepts
from avow.backends.ajpf.environment import Environment, read_environment
from avow.backends.ajpf.explore import explore
from avow.backends.ajpf.files import program_text
from avow.backends.ajpf.interpreter import Semantics
from avow.backends.ajpf.mind import NONE
from avow.backends.ajpf.parser import parse_fact, parse_system
from avow.backends.ajpf.psl_parser import Malformed, parse_psl
from avow.backends.ajpf.society import system
from avow.backends.ajpf.syntax import show_deed, show_event
from avow.backends.ajpf.terms import show
from avow.base.diagnostics import Rejected


def program(plans: str, beliefs: str = "", rules: str = "", goals: str = ""):
    rules = f":Reasoning Rules:\n{rules}\n" if rules else ""
    text = f"GWENDOLEN\n:name: ag\n:Initial Beliefs:\n{beliefs}\n{rules}:Initial Goals:\n{goals}\n:Plans:\n{plans}\n"
    return parse_system(text, "ag.gwen")


def environment(*groups, at_quiescence="never", at_start=True):
    named = tuple(
        (f"g{n}", tuple(None if w is None else parse_fact(w) for w in group)) for n, group in enumerate(groups)
    )
    return Environment(named, {}, {}, frozenset({"print"}), at_start, at_quiescence, ())


def run(plans, *groups, semantics=Semantics.MCAPL, at_quiescence="never", **sections):
    """The states of the only run, as (beliefs, last action), without repetitions."""
    agent = system(program(plans, **sections), environment(*groups, at_quiescence=at_quiescence), semantics)
    graph = explore(agent, states=1000)
    assert graph.unfinished is None
    state, seen, said = graph.initial[0], set(), []
    while state not in seen:
        seen.add(state)
        targets = set(graph.targets[graph.offsets[state] : graph.offsets[state + 1]])
        now = agent.core(graph.states[state])
        beliefs, last = agent.beliefs.all[now.beliefs], now.last
        shown = (
            sorted(show(b) for b in beliefs.own | beliefs.perceived),
            "" if last == NONE else show(agent.actions.all[last]),
        )
        if not said or said[-1] != shown:
            said.append(shown)
        assert len(targets) == 1, "the run branches"
        state = targets.pop()
    return said


def actions(said):
    return [last for at, (_, last) in enumerate(said) if last and (at == 0 or said[at - 1][1] != last)]


def test_it_reads_the_subset():
    (made,) = program(
        '+!go(X) [perform] : { B p, ~G q(_) [achieve], True } <- +b(X, -2.50), *w, -!g(X) [achieve], act("a, b"); //\n'
        "-p : { True };",
        beliefs="p f(a, 1.0) /* c */ q(f(-3))",
        rules="r(X) :- p, ~s(X);",
        goals="go(1) [perform]\nh [achieve]",
    )
    assert [show(b) for b in made.beliefs] == ["p", "f(a, 1)", "q(f(-3))"]
    assert [show_event(p.event) for p in made.plans] == ["+!go(X) [perform]", "-p"]
    assert [show_deed(d) for d in made.plans[0].deeds] == ["+b(X, -2.5)", "*w", "-!g(X) [achieve]", 'act("a, b")']
    assert made.plans[0].span.line == 11


CUT = "one(X) :- v(X), !, ~bad(X); one(9);"
EVERYTHING = """\
GWENDOLEN

:name: ag

:Initial Beliefs:

p
arm.at(-1.5, "x y")
route([a, b(1), []])

:Reasoning Rules:

free :- ~(square(X, Y), ~empty(X, Y));
full :- load(X), limit(Y), !, ~[X < Y];
known;

:Initial Goals:

go(1) [perform]

:Plans:

+!go(N) [perform] : { ~N < 3, B full, ~.sent(boss, :tell, done) } <- .send(boss, :tell, at(N)), *~p;
+p : { M == 2, ~B G } <- +!G [achieve], +m((M + 1));
+.received(:perform, G) : { True } <- +!G [perform], -G;
-!go(N) [achieve] : { G go(M) [perform], B route([H|T]) } <- +.lock, +route(T), -.lock;
"""


def test_what_is_read_is_printed_as_it_was():
    """But for the order of a guard that starts with a denial: it is printed as it is tried."""
    printed = program_text(parse_system(EVERYTHING, "ag.gwen"))
    assert printed == EVERYTHING.replace("{ ~N < 3, B full,", "{ B full, ~N < 3,")
    for seed in range(40):
        once = program_text(parse_system(case(seed).program, "ag.gwen"))
        assert program_text(parse_system(once, "ag.gwen")) == once


@pytest.mark.parametrize(
    ("plans", "beliefs", "rules", "expected"),
    [
        ("+p : { B n(X), X < 3, Y == X } <- a((Y + 10));", "n(5) n(2)", "", "a(12)"),
        ("+p : { B one(X) } <- a(X); +p : { True } <- none;", "v(1) v(2) bad(1)", CUT, "none"),
        ("+p : { B one(X) } <- a(X); +p : { True } <- none;", "v(1) v(2)", CUT, "none"),  # AIL's cuts derive nothing
        ("+p : { B one(X) } <- a(X);", "v(1)", "one(X) :- v(X), v(2), !; one(X) :- v(X);", "a(1)"),
        ("+p : { B one(X) } <- a(X); +p : { True } <- none;", "v(1)", "one(X) :- v(X), !; one(X) :- v(X);", "none"),
        ("+p : { B idle } <- rest; +p : { True } <- work;", "job(1)", "idle :- ~(job(X), ~done(X));", "work"),
        ("+p : { B far(X) } <- a(X);", "at(7)", "far(X) :- at(X), [5 < X];", "a(7)"),
    ],
)
def test_comparisons_bind_and_rules_cut(plans, beliefs, rules, expected):
    assert actions(run(plans, ["p"], beliefs=beliefs, rules=rules)) == [expected]


@pytest.mark.parametrize(
    ("goal", "trigger", "answered"),
    [
        ("k(1) [achieve]", "k(1) [perform]", False),
        ("k(1) [achieve]", "k(X) [perform]", True),
        ("k(1) [perform]", "k(X) [achieve]", True),
        ("k(1) [perform]", "k(X)", True),
    ],
)
def test_kinds_of_goals_count_where_the_trigger_has_no_variable(goal, trigger, answered):
    """AJPF's answers: it matches a goal without variables term by term."""
    said = run(f"+!{trigger} : {{ True }} <- act, done;", goals=goal)
    assert ("done" in actions(said)) is answered


def test_lists_unify_by_head_and_tail():
    plans = "+p : { B route([H|T]) } <- -route(_), +route(T), go(H); +route([X|R]) : { B p } <- then(X);"
    assert "then(b)" in actions(run(plans, ["p"], beliefs="route([a, b])"))


def test_what_was_sent_is_remembered():
    plans = "+p : { ~.sent(boss, :tell, hi) } <- .send(boss, :tell, hi); +p : { True } <- again;"
    assert actions(run(plans, ["p"]))[:2] == ["send(hi, boss)", "again"]


def test_what_is_not_run_is_refused_with_the_reason():
    head = "GWENDOLEN\n:name: a\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n"
    for text, code, reason in (
        (f"{head}+p : {{ True }};\n{head}+p : {{ True }};", "AJPF104", "two agents called 'a'"),
        (f"{head}+!G [perform] : {{ True }};", "AJPF103", "any goal at all"),
    ):
        with pytest.raises(Rejected) as caught:
            parse_system(text, "a.gwen")
        assert caught.value.diagnostics[0].code == code
        assert reason in caught.value.diagnostics[0].message


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        ("", 1, 1),
        ("GWENDOLEN\n:name: ag\n:Initial Beliefs:\np(\n", 5, 1),
        ("GWENDOLEN\n:name: ag\n:Initial Beliefs:\np(X)\n:Initial Goals:\n:Plans:\n+a : { True };", 4, 1),
        ("GWENDOLEN\n:name: ag\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n+a : { B b <- c;", 6, 12),
        ("GWENDOLEN\n:name: ag\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n+a : {} <- c;", 6, 7),
        ("GWENDOLEN\n:name: ag\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n+a : { True } <- c", 6, 19),
        ("GWENDOLEN\n:name: ag\n:Initial Beliefs:\n\u2028\n:Initial Goals:\n:Plans:\n", 4, 1),
    ],
)
def test_bad_programs_are_located(text, line, column):
    with pytest.raises(Rejected) as caught:
        parse_system(text, "bad.gwen")
    span = caught.value.diagnostics[0].span
    assert (span.file, span.line, span.column) == ("bad.gwen", line, column)


@settings(max_examples=150, deadline=None)
@given(st.text(alphabet=st.sampled_from("GWENDOLEN:name Iitalbefsgop{}()<->+!*~,;.\"'/\n_X1é\x00"), max_size=120))
def test_any_text_is_a_program_or_rejected(text):
    for whole in (text, f"GWENDOLEN\n:name: ag\n:Initial Beliefs:\n{text}\n:Initial Goals:\n:Plans:\n{text}"):
        try:
            parse_system(whole, "f")
        except Rejected as error:
            located = error.diagnostics[0].span is not None
        else:
            located = True
        assert located


def test_terms_that_nest_too_deeply_are_refused():
    deep = "f(" * 20_000 + "a" + ")" * 20_000
    with pytest.raises(Rejected, match="nested too deeply"):
        program("+p : { True } <- a;", beliefs=deep)


def test_the_first_plan_whose_guard_holds_is_taken():
    plans = "+p : { B no } <- a; +p : { ~B no, B v(X) } <- b(X); +p : { True } <- c;"
    assert actions(run(plans, ["p"], beliefs="v(7)")) == ["b(7)"]


def test_negated_guards_come_after_positive_ones_wherever_they_stand():
    plans = "+p : { ~B w(X), B v(X) } <- a(X);"
    assert actions(run(plans, ["p"], beliefs="v(1) v(2) w(1)")) == ["a(2)"]


def test_one_deed_a_cycle_first_in_first_out_unfinished_ones_to_the_back():
    plans = "+p : { True } <- +p1, +p2; +q : { True } <- +q1, +q2;"
    said = run(plans, ["p"], ["q"], semantics=Semantics.EDGE)
    order = [next(iter(set(after) - set(before))) for (before, _), (after, _) in pairwise(said[1:])]
    assert order == ["p1", "q1", "p2", "q2"]


def test_a_refresh_of_percepts_has_a_gap():
    """The first percepts are read twice: what was believed of the first reading is dropped and added again."""
    believed = ["p" in beliefs for beliefs, _ in run("+q : { True } <- a;", ["p"])]
    assert believed == [False, True, False, True]


def test_adding_a_belief_posts_an_event_only_if_it_is_new():
    plans = "+p : { True } <- +b, +b; +b : { B n(X) } <- -n(X), +m(X);"
    said = run(plans, ["p"], beliefs="n(1) n(2)")
    assert sum(b.startswith("m(") for b in said[-1][0]) == 1


@pytest.mark.parametrize(
    ("added", "seen"), [("v(1)", True), ("v(f(1))", True), ("v(X)", False), ("v(f(X))", False), ("v(_)", False)]
)
def test_adding_a_belief_with_a_free_variable_wakes_no_plan(added: str, seen: bool):
    """As in AIL; it holds for every value all the same."""
    plans = f"+p : {{ True }} <- +{added}, after; +v(Y) : {{ True }} <- other; +q : {{ B v(Z) }} <- believed;"
    done = actions(run(plans, ["p"], ["q"], semantics=Semantics.EDGE))
    assert "after" in done
    assert "believed" in done
    assert ("other" in done) is seen


def test_dropping_a_belief_drops_all_that_unify():
    said = run("+p : { True } <- -n(X, 1);", ["p"], beliefs="n(1, 1) n(2, 1) n(3, 2)")
    assert said[-1][0] == ["n(3, 2)", "p"]


def test_reasoning_rules():
    plans = "+p : { B safe(X) } <- a(X);"
    assert actions(run(plans, ["p"], beliefs="v(1) v(2) hot(1)", rules="safe(X) :- v(X), ~hot(X);")) == ["a(2)"]


def test_subgoals_and_their_bindings():
    plans = "+!top [perform] : { B v(X) } <- +!sub(X) [perform], done(X);+!sub(Y) [perform] : { B w(Y, X) } <- act(X);"
    assert actions(run(plans, [None], beliefs="v(1) w(1, 9)", goals="top [perform]")) == ["act(9)", "done(1)"]


def test_achieve_goals_are_tried_until_believed():
    plans = "+!g [achieve] : { ~B half } <- +half; +!g [achieve] : { B half } <- +g; "
    said = run(plans, [None], goals="g [achieve]")
    assert said[-1][0] == ["g", "half"]


def test_goals_in_guards_and_dropped_goals():
    """What is dropped by a deed posts no event: plans for ``-!g`` are for goals that no plan takes up."""
    plans = (
        "+!g [perform] : { True } <- *never, bad;"
        "+p : { G g [perform] } <- -!g [perform], after;"
        "-!g [perform] : { True } <- dropped;"
    )
    assert set(actions(run(plans, ["p"], goals="g [perform]"))) == {"after"}
    assert actions(run("-!g [perform] : { True } <- failed;", ["p"], goals="g [perform]")) == ["failed"]


@pytest.mark.parametrize(("semantics", "expected"), [(Semantics.MCAPL, ["go"]), (Semantics.EDGE, ["go", "on"])])
def test_waiting_for_something_derived(semantics, expected):
    """MCAPL wakes a waiting intention only for a belief that unifies with what it waits for; a rule's head is none."""
    plans = "+!g [perform] : { True } <- *safe, on; +p : { True } <- go, -danger;"
    found = actions(
        run(plans, ["p"], beliefs="danger", rules="safe :- ~danger;", goals="g [perform]", semantics=semantics)
    )
    assert found == expected


@pytest.mark.parametrize("semantics", list(Semantics))
def test_waiting_for_a_belief(semantics):
    plans = "+!g [perform] : { True } <- *ready(X), on(X); +p : { True } <- +ready(3);"
    assert actions(run(plans, ["p"], goals="g [perform]", semantics=semantics)) == ["on(3)"]


@pytest.mark.parametrize(("semantics", "expected"), [(Semantics.MCAPL, 2), (Semantics.EDGE, 1)])
def test_percepts_that_persist(semantics, expected):
    """At each draw MCAPL drops and adds them again, so that their events fire again."""
    plans = "+p : { B n(X) } <- -n(X), look;"
    said = run(plans, ["p"], beliefs="n(1) n(2)", semantics=semantics)
    assert 2 - sum(b.startswith("n(") for b in said[-1][0]) == expected


def test_print_is_no_action_and_draws_nothing():
    said = run('+p : { True } <- print("x"), act;', ["p"])
    assert actions(said) == ["act"]


def test_draws_branch_and_quiescence():
    agent = system(program("+p : { True } <- act;"), environment(["p", None], at_quiescence="once"), Semantics.MCAPL)
    graph = explore(agent)
    assert len(graph.initial) == 1
    assert max(graph.offsets[s + 1] - graph.offsets[s] for s in range(len(graph))) == 2
    assert all(graph.offsets[s + 1] > graph.offsets[s] for s in range(len(graph)))


def test_percepts_are_believed_no_longer_than_they_are_drawn():
    agent = system(program("+p : { True } <- act;"), environment(["p", None]), Semantics.EDGE)
    graph = explore(agent)
    for state in map(agent.core, graph.states):
        beliefs = agent.beliefs.all[state.beliefs]
        if not state.drawn:
            assert set(agent.world.drawn(state.choice)) == set(beliefs.perceived)


def holds(plans, formula, *groups, **sections):
    graph_program = program(plans, **sections)
    wanted = Property("p", parse_psl(formula))
    agent = system(graph_program, environment(*groups), Semantics.MCAPL, probed=asks_for_percepts(wanted))
    return Checker(explore(agent), [wanted]).check(wanted).holds


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("G(ag, g(1))", False),
        ("<> G(ag, g(1))", True),
        ("[] G(ag, g(1))", False),
        ("<> I(ag, g(_))", True),
        ("I(ag, g(1))", False),
        ("<> I(ag, h)", False),
        ("[] (~G(ag, h))", False),
        ("<> ItD(ag, act(1))", True),
        ("(~D(ag, act(_))) U ItD(ag, act(1))", True),
        ("<> ItD(ag, act(2))", False),
        ("P(p)", False),
        ("<> P(p)", True),
        ("[] (P(p) -> D(ag, act(1)))", True),
        ("B(ag, p)", False),
        ("<> B(ag, p)", True),
        ("<> ([] D(ag, act(_)))", True),
        ("D(ag, _)", None),
    ],
)
def test_what_a_property_may_look_at(formula, expected):
    plans = "+!g(X) [perform] : { B v(X) } <- act(X), +!h [perform];"
    if expected is None:
        with pytest.raises(Malformed):
            parse_psl(formula)
    else:
        assert holds(plans, formula, ["p"], beliefs="v(1)", goals="g(1) [perform]") is expected


def test_an_agent_that_falls_behind_its_percepts_is_told():
    """Each draw brings an event, each answer to it an action, and each action a draw: intentions pile up."""
    plans = "+p(X) : { True } <- go(X), rest(X), turn(X);"
    draws = environment(("p(0)", "p(1)"), at_quiescence="repeatedly")
    hasty = explore(system(program(plans), draws, Semantics.MCAPL), states=2_000)
    assert "intentions at once" in hasty.unfinished
    assert "keep" in hasty.unfinished
    counting = explore(system(program("+p(X) : { True } <- +seen(X);"), draws, Semantics.MCAPL), states=2)
    assert counting.unfinished == "more than 2 states"


def test_what_actions_leave_as_it_was_is_one_sentence(tmp_path):
    path = tmp_path / "e.yaml"
    after = "{zone: [keep], tank: [keep]}"
    path.write_text(
        "draws: {at_quiescence: repeatedly}\npercepts: {zone: [in, out, nothing], tank: [dry, nothing]}\n"
        f"after: {{park: {after}, spray: {after}, move: {{zone: [in, keep]}}}}\n"
    )
    said = [line for line in read_environment(path).describe() if line.startswith("after")]
    assert said == ["after park or spray, zone and tank are as before", "after move, zone is in or as before"]


def test_the_small_agent_of_the_documentation_does_what_is_said(root, tmp_path):
    page = (root / "docs/backends/ajpf.md").read_text()
    text = page.partition("```gwendolen\n")[2].partition("```")[0]
    drawn = page.partition("```yaml environment\n")[2].partition("```")[0]
    (tmp_path / "e.yaml").write_text(drawn)
    program, draws = parse_system(text, "warden.gwen"), read_environment(tmp_path / "e.yaml")
    graph = explore(system(program, draws, Semantics.EDGE), states=20_000)
    assert graph.unfinished is None
    parks = Property("p", parse_psl("[] (B(warden, outside) -> (<> D(warden, park)))"))
    sprays = Property("s", parse_psl("[] (B(warden, outside) -> (<> D(warden, spray)))"))
    checker = Checker(graph, (parks, sprays))
    assert checker.check(parks).holds
    assert not checker.check(sprays).holds
    assert explore(system(program, draws, Semantics.MCAPL), states=20_000).unfinished is None

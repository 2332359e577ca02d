"""Questions and answers: what is proved is true, what is refuted is false, and the rest is unknown."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction

import pytest

from avow.base.verdict import Verdict
from avow.formulas.values import FunctionValue
from avow.formulas.written import show_values
from avow.language.sorts import BOOL, STRING, OpaqueSort
from avow.language.terms import Compare, Literal, Not, Quantified, Quantifier, Role, Term, Variable
from avow.solving import questions
from avow.solving.questions import Entailment, entails, solve
from avow.solving.replay import replay

from .contracts import contract, formula

CONTRACT = contract(
    """context { Colour : {red, green}; Command : {move(REAL, REAL), inspect(NATURAL)}; }
    node n {
      inputs( r : REAL, n : NATURAL, k : INTEGER, b : BOOL, s : STRING, cmd : Command,
              at : REAL x REAL --> BOOL, id : REAL --> NATURAL, c : Colour, done : NATURAL --> BOOL,
              other : NATURAL --> BOOL, m : Command )
      outputs( o : REAL ) topics() guarantee( out.o == in.r ) }"""
)
NODE = CONTRACT.nodes[0]


def say(text: str) -> Term:
    return formula(text, NODE, CONTRACT)


def ask(hypothesis: str, goal: str, *, whether: bool = False) -> Entailment:
    return entails({"H": say(hypothesis)}, say(goal), effort=10_000, whether=whether)


TRUE_ALWAYS = [
    ("TRUE", "0 <= in.n"),
    ("in.r > 3.65", "in.r > 3"),
    ("in.k > 0", "in.k >= 1"),
    ("in.c != red", "in.c == green"),
    ("TRUE", "forall(x in REAL | 0 <= in.id(x))"),
    ("in.cmd == inspect(in.n)", "in.n >= 0"),
    ("TRUE", "forall(x, y in REAL, i in NATURAL | move(x, y) != inspect(i))"),
    ("move(in.r, 1) == move(2, out.o)", "in.r == 2 and out.o == 1"),
    ("forall(i in NATURAL | in.done(i) <=> in.other(i))", "in.done(in.n) == in.other(in.n)"),
    ("exists_unique(x, y in REAL | in.at(x, y))", "exists(x, y in REAL | in.at(x, y))"),
    ("exists_unique(x, y in REAL | in.at(x, y)) and in.at(1, 2)", "not in.at(2, 1)"),
    ("TRUE", "exists(i in NATURAL | i > in.n)"),
    ("TRUE", "forall(i in NATURAL | i + 1 != 0)"),
    ("TRUE", "in.r in {1, 2} -> in.r < 3"),
    ("in.r * in.r == 2", "in.r != 1"),
]

FALSE_SOMEWHERE = [
    ("TRUE", "0 <= in.k"),
    ("in.r > 3", "in.r > 3.65"),
    ("in.r > 0", "in.r >= 1"),
    ("TRUE", "in.cmd == in.m"),
    ("exists(x, y in REAL | in.at(x, y))", "exists_unique(x, y in REAL | in.at(x, y))"),
    ("forall(x in REAL | in.at(x, x))", "forall(x, y in REAL | in.at(x, y))"),
    ("exists(x in REAL | in.id(x) == 0)", "forall(x in REAL | in.id(x) == 0)"),
    ("in.b -> in.c == red", "in.c == red -> in.b"),
    ("forall(i in NATURAL | in.done(i) -> in.other(i))", "forall(i in NATURAL | in.other(i) -> in.done(i))"),
    ("in.r * in.r == 4", "in.r == 2"),
]


@pytest.mark.parametrize(("hypothesis", "goal"), TRUE_ALWAYS)
def test_proved(hypothesis: str, goal: str) -> None:
    assert ask(hypothesis, goal).verdict is Verdict.PROVED


@pytest.mark.parametrize(("hypothesis", "goal"), FALSE_SOMEWHERE)
def test_refuted_by_values_that_are_a_counterexample(hypothesis: str, goal: str) -> None:
    answer = ask(hypothesis, goal)
    assert answer.verdict is Verdict.REFUTED
    assert replay([say(hypothesis), Not(say(goal))], answer.values) is True
    assert replay([say(hypothesis), say(goal)], answer.values) is False


@pytest.mark.parametrize("goal", ["in.r / in.r == 1", "1 / in.r != 5 or in.r == 0.2"])
def test_division_by_zero_never_helps_a_proof(goal: str) -> None:
    assert ask("TRUE", goal).verdict is not Verdict.PROVED


def test_division_by_zero_never_makes_a_counterexample() -> None:
    # false only under some interpretations of 1 / 0: nobody can show values for that
    assert ask("in.r == 0", "1 / in.r == 5").verdict is Verdict.UNKNOWN
    assert ask("in.r != 0", "in.r / in.r == 1").verdict is Verdict.PROVED


@pytest.mark.parametrize(("hypothesis", "goal"), [*TRUE_ALWAYS, *FALSE_SOMEWHERE])
def test_whether_something_follows_takes_no_model(hypothesis: str, goal: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = ask(hypothesis, goal)
    monkeypatch.setattr(questions, "replay", None)  # where it is called, it fails
    told = ask(hypothesis, goal, whether=True)
    assert (told.verdict, told.needed, told.counterexample) == (found.verdict, found.needed, None)


def test_needed_hypotheses_and_vacuity() -> None:
    hypotheses = {name: say(text) for name, text in {"A": "in.r > 1", "B": "in.b", "C": "in.r > 2"}.items()}
    answer = entails(hypotheses, say("in.r > 1.5"))
    assert (answer.verdict, answer.needed, answer.vacuous) == (Verdict.PROVED, ("C",), False)
    assert entails(hypotheses, say("in.r > in.r or in.k == in.k")).needed == ()
    contradictory = {**hypotheses, "D": say("not in.b")}
    answer = entails(contradictory, say("in.k == 7"))
    assert (answer.needed, answer.vacuous) == (("B", "D"), True)


def test_cores_are_minimal() -> None:
    texts = {"a": "in.r > 1", "b": "in.r < 5", "c": "in.r > 7", "d": "in.b", "e": "in.r > 2"}
    answer = solve({name: say(text) for name, text in texts.items()})
    assert answer.status == "unsat"
    assert answer.core == ("b", "c")


def test_values_in_the_contract_s_words() -> None:
    answer = solve(
        [
            say(text)
            for text in ("in.r == 0.5", "in.at(1, 2)", "in.c == green", "in.cmd == inspect(3)", 'in.s == "a\\"b"')
        ]
    )
    shown = dict(show_values(answer.values))
    assert shown["in.r"] == "0.5"
    assert shown["in.at"] == "{(1, 2)}"
    assert shown["in.c"] == "green"
    assert shown["in.cmd"] == "inspect(3)"


@pytest.mark.parametrize("text", ["\\u{41}", "}\n*/ \"'", "ünï→😀", "\x00\x07", "'; (check-sat)", "|"])
def test_strings_are_data(text: str) -> None:
    s = Variable(Role.INPUT, "s", STRING)
    answer = solve([Compare("==", s, Literal(text, STRING))])
    assert answer.values[s] == text
    assert solve([Compare("==", Literal("\\u{41}", STRING), Literal("A", STRING))]).status == "unsat"


def test_an_unspecified_sort_is_not_empty() -> None:
    sort = OpaqueSort("Sensors")
    x, y = Variable(Role.BOUND, "x", sort), Variable(Role.BOUND, "y", sort)
    some = Quantified(Quantifier.EXISTS, (x,), Compare("==", x, x))
    assert entails({}, some).verdict is Verdict.PROVED
    all_equal = Quantified(Quantifier.FORALL, (x, y), Compare("==", x, y))
    assert solve([all_equal]).status == "sat"
    a, b = Variable(Role.INPUT, "a", sort), Variable(Role.INPUT, "b", sort)
    answer = solve([Not(Compare("==", a, b))])
    assert answer.status == "sat"
    assert answer.values[a] != answer.values[b]


def test_functions_are_compared_on_their_domain() -> None:
    done, other = NODE.input("done").variable, NODE.input("other").variable
    same = say("forall(i in NATURAL | in.done(i) <=> in.other(i))")
    assert entails({"H": same}, Compare("==", done, other)).verdict is Verdict.PROVED
    answer = solve([Not(Compare("==", done, other))])
    assert answer.status == "sat"
    assert answer.values[done] != answer.values[other]


def test_what_is_given_stays() -> None:
    done = NODE.input("done").variable
    given = {done: FunctionValue({(3,): True}, False)}
    assert solve([say("in.done(in.n)")], given=given).values[NODE.input("n").variable] == 3
    assert solve([say("in.done(4)")], given=given).status == "unsat"


def test_no_time_is_unknown() -> None:
    hard: Term = say(
        "forall(x, y in REAL | exists(u, v in REAL | in.at(x * u + v, y * v - u) and in.id(x * y) > in.id(u * u * v)))"
    )
    answer = entails({"H": hard}, say("in.id(in.r * in.r * in.r) > in.n"), effort=50)
    assert answer.verdict in {Verdict.UNKNOWN, Verdict.REFUTED}


def test_one_and_the_same_answer_every_time() -> None:
    answers = {str(ask("in.r > 3", "in.r > 3.65").values) for _ in range(3)}
    assert len(answers) == 1


def test_threads_do_not_meet() -> None:
    from concurrent.futures import ThreadPoolExecutor

    questions = [(TRUE_ALWAYS if k % 2 else FALSE_SOMEWHERE)[k % 6] for k in range(12)]
    asked = [(say(hypothesis), say(goal)) for hypothesis, goal in questions]

    def work(number: int) -> Verdict:
        hypothesis, goal = asked[number]
        return entails([hypothesis], goal).verdict

    with ThreadPoolExecutor(4) as pool:
        verdicts = list(pool.map(work, range(12)))
    assert verdicts == [Verdict.PROVED if k % 2 else Verdict.REFUTED for k in range(12)]


def test_z3_is_imported_only_when_asked() -> None:
    code = "import sys, avow.solving, avow.cli.sanity, avow.sanity.claims; sys.exit('z3' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_fractions_are_exact() -> None:
    answer = solve([say("3 * in.r == 1")])
    assert answer.values[NODE.input("r").variable] == Fraction(1, 3)
    assert NODE.input("b").sort == BOOL


@pytest.mark.nightly
@pytest.mark.needs_cvc5
def test_another_solver_helps_where_z3_gives_up() -> None:
    answer = entails([], say("exists(i in NATURAL | i > in.r)"), effort=5_000)
    assert answer.verdict is Verdict.PROVED

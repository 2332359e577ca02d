"""The backend on a small lift: mapping, semantics, diagnostics, hostile input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from avow.backend_kit.protocol import Backend, Limits
from avow.backends.ajpf import BACKEND
from avow.base.diagnostics import Severity
from avow.base.verdict import Link, Verdict

FIXTURES = Path(__file__).parent / "fixtures"


def settle(job, tmp_path):
    report = BACKEND.discharge(job, tmp_path, Limits(seconds=30))
    return {outcome.obligation.rpartition("/")[2]: outcome for outcome in report.outcomes}


def test_it_is_a_backend():
    assert isinstance(BACKEND, Backend)
    assert {tool.name for tool in BACKEND.tools()} == {"AJPF"}


def test_another_agent_with_other_names(lift, tmp_path):
    job = lift()
    assert BACKEND.check(job) == ()
    outcomes = settle(job, tmp_path)
    assert {name: o.verdict for name, o in outcomes.items()} == {"answers": Verdict.CHECKED, "halts": Verdict.CHECKED}
    assert outcomes["answers"].link is Link.MAPPED
    assert outcomes["answers"].bound["states"] > 0
    assert any("percepts are drawn" in h.text for h in outcomes["answers"].rests_on)


def test_the_exported_program_is_the_plans_byte_for_byte(lift):
    """Comments, layout and line ends, which no printer would keep."""
    job = lift()
    (path,) = (p for p in BACKEND.files(job) if p.suffix == ".gwen")
    path.write_bytes(b"// a comment\r\n" + path.read_bytes() + b"\n\n")
    (exported,) = (text for name, text in BACKEND.export(job).items() if name.endswith(".gwen"))
    assert exported.encode() == path.read_bytes()


def test_the_percept_semantics_change_the_verdict_and_are_named(lift, tmp_path):
    """A door that stays open is perceived anew at each draw, or is no event any more."""
    plans = "+open : { B seen } <- halt(0);\n+open : { ~B seen } <- +seen;"
    files = {
        "cabin.yaml": "draws: {at_quiescence: repeatedly}\npercepts: {door: [open], c: [call(1), nothing]}\n",
        "cabin.gwen": (FIXTURES / "lift" / "cabin.gwen").read_text().replace("+open : { True } <- halt(0);", plans),
    }
    assert settle(lift({"semantics": "mcapl"}, files), tmp_path)["halts"].verdict is Verdict.CHECKED
    outcome = settle(lift({"semantics": "edge"}, files), tmp_path)["halts"]
    assert outcome.verdict is Verdict.REFUTED
    assert "edge percepts" in outcome.summary
    assert outcome.counterexample.trace


def test_the_exported_files(lift):
    files = BACKEND.export(lift())
    assert files["cabin.psl"].splitlines() == [
        "# answers_1: f = 1",
        "answers_1: [] ((B(cabin, call(1)) & B(cabin, shut)) -> (<> D(cabin, go(1))))",
        "# answers_2: f = 2",
        "answers_2: [] ((B(cabin, call(2)) & B(cabin, shut)) -> (<> D(cabin, go(2))))",
        "halts: [] (B(cabin, open) -> (<> D(cabin, halt(_))))",
    ]
    assert "mas.file = cabin.gwen" in files["cabin.ail"]
    assert "target.args = cabin.ail,cabin.psl,halts" in files["jpf/halts.jpf"]
    claims = json.loads(files["claims.json"])
    assert claims["guarantees"]["answers"]["properties"]["answers_2"]["instance"] == "f = 2"
    assert claims["table"]["out.motion == go(f)"] == "D(cabin, go(f))"


def test_what_no_row_covers_is_said_and_unknown(lift, tmp_path):
    job = lift()
    rows = dict(job.options["predicates"])
    del rows["in.door == shut"]
    job = lift({"predicates": rows})
    found = [d for d in BACKEND.check(job) if d.code == "AJPF130"]
    assert len(found) == 1
    assert found[0].severity is Severity.WARNING
    assert found[0].span.file.endswith("system.rcl")
    assert "door" in found[0].message
    outcomes = settle(job, tmp_path)
    assert outcomes["answers"].verdict is Verdict.UNKNOWN
    assert outcomes["answers"].summary.startswith("not covered: no mapping for")
    assert outcomes["halts"].verdict is Verdict.CHECKED


def test_without_instances_a_number_has_no_finite_range(lift, tmp_path):
    outcome = settle(lift({"instances": None}), tmp_path)["answers"]
    assert outcome.verdict is Verdict.UNKNOWN
    assert "f has no finite range" in outcome.summary


def test_written_forms_do_not_matter(lift, tmp_path):
    rows = {
        "TRUE == in.call(g)": "B(cabin, call(g))",
        "not in.door != shut": "B(cabin, shut)",
        "in.door in {open}": "B(cabin, open)",
        "go(g) == out.motion": "D(cabin, go(g))",
        "not forall(k in NATURAL | halt(k) != out.motion)": "D(cabin, halt(_))",
    }
    job = lift({"predicates": rows, "variables": {"g": "NATURAL", "k": "NATURAL"}})
    outcomes = settle(job, tmp_path)
    assert outcomes["answers"].verdict is Verdict.CHECKED
    assert "no mapping" in outcomes["halts"].summary  # `in {open}` is another formula than `== open`


def test_a_row_for_both_conjuncts_comes_before_rows_for_one(lift):
    rows = {
        "in.call(f)": "B(cabin, wrong)",
        "in.door == shut and in.call(f)": "B(cabin, ready(f))",
        "in.door == open": "B(cabin, open)",
        "out.motion == go(f)": "D(cabin, go(f))",
        "exists(n in NATURAL | out.motion == halt(n))": "D(cabin, halt(_))",
    }
    text = BACKEND.export(lift({"predicates": rows}))["cabin.psl"]
    assert "answers_1: [] (B(cabin, ready(1)) -> (<> D(cabin, go(1))))" in text
    assert "wrong" not in text


def test_an_unused_row_is_pointed_out(lift):
    job = lift()
    job = lift({"predicates": {**job.options["predicates"], "out.motion == go(f + 1)": "D(cabin, go(f))"}})
    # the earlier row covers it first
    assert [d.code for d in BACKEND.check(job)] == ["AJPF131"]


def test_vacuity(lift, tmp_path):
    job = lift(files={"cabin.yaml": "percepts: {panel: [open, nothing]}\n"})
    outcomes = settle(job, tmp_path)
    assert outcomes["answers"].verdict is Verdict.CHECKED
    assert outcomes["answers"].vacuous
    assert "no trigger is ever met" in outcomes["answers"].summary
    assert not outcomes["halts"].vacuous


def test_some_instances_vacuous(lift, tmp_path):
    job = lift(files={"cabin.yaml": "percepts: {panel: [open, call(1), nothing]}\n"})
    outcome = settle(job, tmp_path)["answers"]
    assert not outcome.vacuous
    assert "for f = 2 is never met" in outcome.summary


def test_further_properties(lift, tmp_path):
    extra = {
        "listed": "[] (~D(cabin, go(f)))",
        "counted": {"psl": "[] (B(cabin, floor(f)))", "guarantee": "halts"},
        "refuting": {"psl": "<> D(cabin, go(1))", "guarantee": "answers", "because": "it must move"},
    }
    outcomes = settle(lift({"properties": extra}), tmp_path)
    assert outcomes["halts"].verdict is Verdict.CHECKED
    assert "'listed' (listed, not counted) fails for f = 1, 2" in outcomes["halts"].summary
    assert outcomes["answers"].verdict is Verdict.REFUTED
    assert outcomes["answers"].counterexample is not None


def test_fairness_must_be_stated_and_then_helps(lift, tmp_path):
    extra = {"moves": {"psl": "<> D(cabin, go(1))", "guarantee": "answers"}}
    environment = (
        "draws: {at_quiescence: repeatedly}\npercepts: {calls: [call(1), nothing]}\n"
        "fair: [{percept: call(1), because: somebody always calls}]\n"
    )
    outcome = settle(lift({"properties": extra}, {"cabin.yaml": environment}), tmp_path)["answers"]
    assert outcome.verdict is Verdict.CHECKED
    assert any("somebody always calls" in h.text for h in outcome.rests_on)
    unfair = environment.split("fair:")[0]
    assert settle(lift({"properties": extra}, {"cabin.yaml": unfair}), tmp_path)["answers"].verdict is Verdict.REFUTED


def test_fairness_that_some_state_cannot_keep_shows_nothing(lift, tmp_path):
    """The cabin hears a call, and goes round and round: the fair draw is not offered any more."""
    program = (
        "GWENDOLEN\n:name: cabin\n:Initial Beliefs:\n:Reasoning Rules:\n:Initial Goals:\n:Plans:\n"
        "+!round [achieve] : {True} <- turn;\n+call(1) : {True} <- +!round [achieve];\n+call(2) : {True} <- go(1);\n"
    )
    environment = (
        "draws: {at_quiescence: repeatedly}\npercepts: {calls: [call(1), call(2), nothing]}\n"
        "after: {turn: {calls: [keep]}}\nfair: [{percept: call(2), because: somebody always calls}]\n"
    )
    extra = {"moves": {"psl": "<> D(cabin, go(1))", "guarantee": "answers"}}
    files = {"cabin.gwen": program, "cabin.yaml": environment}
    outcome = settle(lift({"properties": extra}, files), tmp_path)["answers"]
    assert outcome.verdict is Verdict.UNKNOWN
    assert "no fair run goes on" in outcome.summary
    offered = {**files, "cabin.yaml": environment.replace("calls: [keep]", "calls: [keep, call(2)]")}
    assert "no fair run goes on" not in settle(lift({"properties": extra}, offered), tmp_path)["answers"].summary


BAD_OPTIONS = {
    "no program": ({"program": "nothing.gwen"}, "there is no file"),
    "outside": ({"program": "../../../etc/passwd"}, "is not a file in the system's folder"),
    "other agent": ({"agent": "lorry"}, "called 'cabin'"),
    "agent in a row": ({"predicates": {"in.call(f)": "B(lorry, call(f))"}}, "there is no agent 'lorry'"),
    "keyword as agent": ({"predicates": {"in.call(f)": "B(U, call(f))"}}, "cannot be an agent's name"),
    "not a port": ({"predicates": {"in.bell(f)": "B(cabin, bell)"}}, "bell"),
    "loose variable": ({"predicates": {"in.door == shut": "B(cabin, call(f))"}}, "is no variable of the pattern"),
    "lost operator": ({"properties": {"p": "<>[] B(cabin, shut)"}}, "loses an operator"),
    "trailing": ({"properties": {"p": "B(cabin, shut) B(cabin, open)"}}, "would ignore the rest"),
    "named variable": ({"properties": {"p": "B(cabin, call(X))"}}, "no named variables"),
    "negative": ({"properties": {"p": "B(cabin, call(-1))"}}, "no negative numbers"),
    "negative instance": ({"properties": {"p": "B(cabin, call(f - 2))"}}, "becomes -1"),
    "no such guarantee": ({"properties": {"p": {"psl": "T", "guarantee": "x"}}}, "no guarantee 'x'"),
    "empty range": ({"instances": {"f": "3..1"}}, "empty"),
    "no numbers": ({"instances": {"f": ["one"]}}, "natural numbers"),
}


@pytest.mark.parametrize("case", BAD_OPTIONS)
def test_bad_options_are_located_and_never_raise(lift, tmp_path, case):
    options, message = BAD_OPTIONS[case]
    job = lift(options)
    errors = [d for d in BACKEND.check(job) if d.is_error]
    assert errors
    assert any(message in d.message for d in errors), errors
    assert all(d.span is not None for d in errors)
    assert {o.verdict for o in settle(job, tmp_path).values()} == {Verdict.ERROR}


@pytest.mark.parametrize("name", ["A", "E", "U", "R", "B", "G", "F", "I", "D", "P", "T", "ItD", "Lorry"])
def test_agents_that_ajpf_cannot_name_are_refused(lift, name):
    program = f"GWENDOLEN\n:name: {name}\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n+open : {{ True }} <- halt(0);\n"
    errors = [d for d in BACKEND.check(lift({"agent": name}, {"cabin.gwen": program})) if d.code == "AJPF104"]
    assert errors
    assert errors[0].span.line == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("percepts: {door: ['open(', shut]}", "is no percept"),
        ("percepts: {door: ['open(X)']}", "is no percept"),
        ("percepts: {door: [open]}\nfair: [{percept: shut, because: x}]", "in no group"),
        ("percepts: {door: [open]}\nstart: {window: [open]}", "no group 'window'"),
        ("percepts: {door: [open]}\nafter: {go: {door: [ajar]}}", "no alternative"),
        ("percepts: {door: [open]}\ndraws: {at_quiescence: often}", "often"),
        ("percept: {}", "percept"),
        ("percepts: {a: [x, y], a: [z]}", "a"),
        ("- 1", "environment"),
        ("{", ""),
    ],
)
def test_bad_environments_are_located(lift, text, message):
    errors = [d for d in BACKEND.check(lift(files={"cabin.yaml": text})) if d.is_error]
    assert errors
    assert any(message in d.message for d in errors)
    assert all(d.span is not None and d.span.file.endswith("cabin.yaml") for d in errors)


def test_a_bad_program_is_located(lift):
    job = lift(
        files={
            "cabin.gwen": "GWENDOLEN\n:name: cabin\n:Initial Beliefs:\n:Initial Goals:\n:Plans:\n+a : { B b } <- ;\n"
        }
    )
    (error,) = [d for d in BACKEND.check(job) if d.is_error]
    assert (error.span.line, error.span.column) == (6, 17)


def test_endless_reasoning_is_unknown(lift, tmp_path):
    program = (
        "GWENDOLEN\n:name: cabin\n:Initial Beliefs:\n:Reasoning Rules:\np :- q;\nq :- p;\n"
        ":Initial Goals:\n:Plans:\n+open : { B p } <- halt(0);\n"
    )
    outcome = settle(lift(files={"cabin.gwen": program}), tmp_path)["halts"]
    assert outcome.verdict is Verdict.UNKNOWN
    assert "too deeply" in outcome.summary


def test_a_program_that_grows_for_ever_is_unknown(lift, tmp_path):
    program = (
        "GWENDOLEN\n:name: cabin\n:Initial Beliefs:\n:Initial Goals:\ncount(z) [perform]\n:Plans:\n"
        "+!count(N) : { True } <- +number(N), +!count(s(N)) [perform];\n"
    )
    outcome = settle(lift({"states": 300}, {"cabin.gwen": program}), tmp_path)["halts"]
    assert outcome.verdict is Verdict.UNKNOWN

"""The kernel: what it establishes, that mutated certificates pass for nothing else, and that its text says what
`avow.solving` says."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from calculus.make import make, node, outcomes

from avow.base.codec import Unreadable, canonical, from_json, to_json
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates
from avow.calculus.composition import compose
from avow.calculus.discharge import Bounds
from avow.calculus.finder import Hint
from avow.kernel.certificate import Certificate, Entry, How, Question, Use
from avow.kernel.check import Established, Kernel, Refused
from avow.kernel.solvers import BUDGET, Reply, Solvers, ask_z3
from avow.kernel.statements import Claimed
from avow.kernel.text import Text
from avow.language.load import check_text
from avow.language.terms import Builtin
from avow.solving.questions import entails
from avow.solving.smtlib import formulas_script

LOOP = (
    node(
        "a", "z : INTEGER, e : INTEGER", "x : INTEGER", "A low: in.z > 0", "A env: in.e >= 0", "G: out.x >= in.z + in.e"
    )
    + node("b", "x : INTEGER", "y : INTEGER", "A: in.x > 0", "G: out.y == in.x", "G other: out.y < 99")
    + node("c", "y : INTEGER", "z : INTEGER", "A: in.y > 0", "G: out.z == in.y + 1")
)
PLAN = "connections: [{from: c.z, to: a.z, delayed: true, initial: '1'}]\n"
PLAN += "environment: {in.e: {assume: 'in.e >= 0', because: it counts}}\n"
PLAN += "requirements: {R: {text: t, formula: 'c.z > 1', supported_by: [c]}}\n"


def made(folder: Path, text: str = LOOP, plan: str = PLAN) -> tuple[Certificates, Certificate]:
    certificates = compose(make(folder, text, plan)).certificates
    found = certificates.requirement("R", Hint(()), Bounds())
    assert found is not None
    return certificates, certificates.made["requirement R"]


def established(certificates: Certificates, certificate: Certificate) -> Established:
    """The requirement, from a certificate. Raises Refused."""
    claim = certificates.claim(Claimed.REQUIREMENT, "R")
    assert claim is not None
    kernel = Kernel(certificates.known, certificate, certificates.solvers)
    wanted = (How.SHOWN, "", claim.digest)
    at = next((i for i, e in enumerate(certificate.entries) if (e.how, e.node, e.digest) == wanted), None)
    if at is None:
        raise Refused("no entry")
    return kernel.establish(at)


def test_hypotheses_are_computed(tmp_path: Path) -> None:
    certificates, certificate = made(tmp_path)
    found = established(certificates, certificate)
    names = {(n.kind, n.node) for n in found.hypotheses}
    assert {(How.GUARANTEE, "a"), (How.GUARANTEE, "b"), (How.GUARANTEE, "c"), (How.TOGETHER, "")} <= names
    assert any(kind is How.ENVIRONMENT for kind, _ in names)
    assert not found.vacuous
    again = from_json(Certificate, json.loads(canonical(to_json(certificate))))
    assert established(certificates, again) == found


def mutants(certificate: Certificate) -> Iterator[Certificate]:
    """Certificates that are wrong in one place."""
    entries = certificate.entries
    for i, entry in enumerate(entries):

        def put(changed: Entry, i: int = i) -> Certificate:
            return replace(certificate, entries=(*entries[:i], changed, *entries[i + 1 :]))

        for at in range(len(entry.conds)):
            yield put(replace(entry, conds=entry.conds[:at] + entry.conds[at + 1 :]))
        questions: tuple[Question, ...] = (*entry.base, *((entry.step,) if entry.step else ()))
        for q, question in enumerate(questions):

            def asked(other: Question, q: int = q, entry: Entry = entry) -> Entry:
                if q < len(entry.base):
                    return replace(entry, base=(*entry.base[:q], other, *entry.base[q + 1 :]))
                return replace(entry, step=other)

            for at, use in enumerate(question.uses):
                yield put(asked(replace(question, uses=question.uses[:at] + question.uses[at + 1 :])))
                for other in (
                    Use(use.entry, use.back + 1),
                    Use(i, use.back),
                    Use((use.entry + 1) % len(entries), use.back),
                ):
                    yield put(asked(replace(question, uses=(*question.uses[:at], other, *question.uses[at + 1 :]))))
            if question.initials:
                yield put(asked(replace(question, initials=())))
                yield put(asked(replace(question, initials=("0" * 64,))))
            else:
                yield put(asked(replace(question, initials=("0" * 64,))))
        for how in How:
            if how is not entry.how:
                yield put(replace(entry, how=how))
        yield put(replace(entry, node="a" if entry.node != "a" else "b"))
    for i in range(len(entries) - 1):
        yield replace(certificate, entries=(*entries[:i], entries[i + 1], entries[i], *entries[i + 2 :]))


def test_mutants_pass_for_nothing_else(tmp_path: Path) -> None:
    certificates, certificate = made(tmp_path)
    good = established(certificates, certificate)
    refused = passed = 0
    for mutant in mutants(certificate):
        try:
            found = established(certificates, mutant)
        except Refused:
            refused += 1
            continue
        passed += 1
        # what still stands is another proof of the same claim: its key says so, and its hypotheses are true ones
        assert found.goal == good.goal
        assert found.key != good.key or found.hypotheses == good.hypotheses
        assert all(need.kind is not How.OPEN for need in found.hypotheses)
    assert refused > 5 * passed > 0


def test_an_edit_makes_stale_what_used_it_and_nothing_else(tmp_path: Path) -> None:
    _, certificate = made(tmp_path / "before")
    unused = compose(make(tmp_path / "unused", LOOP.replace("out.y < 99", "out.y < 98"), PLAN)).certificates
    established(unused, certificate)
    used = compose(make(tmp_path / "used", LOOP.replace("out.z == in.y + 1", "out.z == in.y + 2"), PLAN)).certificates
    with pytest.raises(Refused, match="stale"):
        established(used, certificate)
    rewired = PLAN.replace("'1'", "'2'")
    with pytest.raises(Refused, match="stale"):
        established(compose(make(tmp_path / "initial", LOOP, rewired)).certificates, certificate)


@pytest.mark.slow
def test_where_the_second_solver_says_the_opposite_nothing_is_established(tmp_path: Path) -> None:
    certificates, certificate = made(tmp_path)
    certificates.solvers = Solvers(second=lambda script: ask_z3(script, BUDGET))
    assert established(certificates, certificate).solvers == 2
    for said in (Reply.UNKNOWN, Reply.LATE):
        certificates.solvers = Solvers(second=lambda _, said=said: said)  # type: ignore[misc]
        assert established(certificates, certificate).solvers == 1
    certificates.solvers = Solvers(second=lambda _: Reply.SAT)
    with pytest.raises(Refused, match="does not follow: sat"):
        established(certificates, certificate)


def test_what_the_clock_has_ended_is_an_error_that_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not `unknown`, which would be another answer on a quicker machine."""
    monkeypatch.setattr("avow.calculus.composition.ask_once", lambda *_: Reply.LATE)
    found = outcomes(make(tmp_path, LOOP, PLAN))
    for name in ("whole.a.low", "R"):
        assert found[name].verdict is Verdict.ERROR
        assert "a question to Z3 ran out of time" in found[name].summary
    assert Verdict.PROVED not in {outcome.verdict for outcome in found.values()}


def test_the_environment_is_what_no_node_provides(tmp_path: Path) -> None:
    certificates, _ = made(tmp_path)
    claim = certificates.claim(Claimed.ASSUMPTION, "a.low")
    assert claim is not None
    forged = Certificate("forged", (Entry(How.ENVIRONMENT, "a", claim.digest),))
    with pytest.raises(Refused, match="a node provides"):
        Kernel(certificates.known, forged, Solvers()).establish(0)


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"format": "avow/certificate/0", "scope": "", "entries": []},
        {"format": "avow/certificate/2", "scope": "", "entries": [{"how": "shown"}]},
        {"format": "avow/certificate/2", "scope": "", "entries": [{"how": "open", "node": "a", "digest": "x", "y": 1}]},
    ],
)
def test_what_is_no_certificate_is_refused(data: object) -> None:
    with pytest.raises(Unreadable):
        from_json(Certificate, data)


def test_json_there_and_back(tmp_path: Path) -> None:
    _, certificate = made(tmp_path)
    assert from_json(Certificate, to_json(certificate)) == certificate


FORMULAS = (
    "exists_unique(i in NATURAL | TRUE)",
    "exists_unique(i in NATURAL | i < 1)",
    "forall(i in NATURAL | 0 <= i)",
    "exists(x in REAL | x * 2 == 1)",
    "forall(i in NATURAL | in.f(i) >= 0)",
    "in.n + in.k >= in.k",
    "in.k - in.n <= in.k",
    "abs(in.k) >= 0 and min(in.k, 3) <= 3 and max(in.k, 3) >= in.k",
    "mod(in.k, 3) < 3 and div(in.k, 3) * 3 <= in.k",
    "(if in.k > 0 then in.k else 0) >= 0",
    "in.c in {red, green}",
    "in.c == red or in.c == green or in.c == blue",
    "in.t == move(in.k, in.n) -> exists(a in INTEGER, b in NATURAL | in.t == move(a, b))",
    "forall(a in INTEGER, b in NATURAL | in.t == move(a, b) -> b >= 0)",
    "length(in.s) >= 0",
    "2 in in.s -> length(in.s) > 0",
    "in.k in <1 upto 3> -> in.k < 4",
    "not xor(in.k > 1, in.k > 1)",
    "in.k > 0 -> in.n > 0",
    "in.k / 2 > 1 -> in.k > 2",
)
CONTEXT = """context {
  Colour : {red, green, blue};
  Task : {move(INTEGER, NATURAL), rest};
  F : NATURAL --> NATURAL;
}
"""


@pytest.mark.parametrize("formula", FORMULAS)
def test_its_text_says_what_the_other_translation_says(formula: str) -> None:
    """Both have the same truth: each is equivalent to the other as Z3 reads them."""
    ports = "k : INTEGER, n : NATURAL, f : F, c : Colour, t : Task, s : <INTEGER>"
    text = f"{CONTEXT}node a {{ inputs( {ports} ) outputs( o : BOOL ) topics()\n guarantee g ( {formula} ) }}\n"
    contract, found = check_text(text, "a.rcl")
    assert contract is not None, [str(d) for d in found]
    term = contract.nodes[0].clause("g").formula
    written = Text()
    body = written.formula(term, lambda v: (f"|{v.name}~0|", v.sort))
    script = written.script([f"(not {body})"])
    mine, theirs = ask_z3(script, BUDGET), entails({}, term, effort=5_000).verdict
    assert {"proved": Reply.UNSAT, "refuted": Reply.SAT}.get(theirs, mine) is mine, formulas_script([term])


CIRCLE = node(
    "a", "y : INTEGER", "x : INTEGER, m : INTEGER", "A: in.y > 0", "G: in.y > 2 -> out.x > 0", "G up: out.m > 0"
) + node("b", "m : INTEGER", "y : INTEGER", "A: in.m > 0", "G: out.y > in.m")


def test_what_is_possible_has_a_certificate_of_its_own(tmp_path: Path) -> None:
    """An example is looked for; that all values are so shows nothing of the kind, nor does an example show that."""
    certificates = compose(make(tmp_path, LOOP, PLAN.replace("'c.z > 1'", "'c.z == 1'"))).certificates
    found = certificates.existence("start.a-b-c")
    assert found is not None
    (entry,) = certificates.made["existence start.a-b-c"].entries
    assert entry.how is How.POSSIBLE
    requirement = certificates.claim(Claimed.REQUIREMENT, "R")
    assert requirement is not None
    assert requirement.digest != entry.digest, "c.z == 1, before the first step and at every one"
    for how, digest in ((How.SHOWN, entry.digest), (How.POSSIBLE, requirement.digest)):
        wrong = Certificate("R", (Entry(how, "", digest, step=Question()),))
        with pytest.raises(Refused, match="stale"):
            Kernel(certificates.known, wrong, Solvers()).establish(0)
    used = (entry, Entry(How.SHOWN, "", requirement.digest, step=Question((Use(0),))))
    with pytest.raises(Refused, match="no premise"):
        Kernel(certificates.known, Certificate("R", used), Solvers()).establish(1)


def test_no_first_value_is_no_beginning(tmp_path: Path) -> None:
    plan = PLAN.replace("'1'", "'out.z > 1 and out.z < 2'")
    certificates = compose(make(tmp_path, LOOP, plan)).certificates
    assert certificates.existence("start.a-b-c") is None
    assert certificates.requirement("R", Hint(()), Bounds()) is None


MEMORY = node("mem", "last : REAL, home : REAL", "m : REAL", "A: in.last <= 10", "G: out.m in {in.last, in.home}")
EDGE = 'connections: [{from: mem.m, to: mem.last, delayed: true, initial: "%s"}]\n'
HOME = 'environment: {in.home: {assume: "in.home <= 10", because: it is near, constant: true}}\n'


def test_a_beginning_that_hinges_on_the_environment_rests_on_it(tmp_path: Path) -> None:
    """First values have to be there whatever the constant inputs are; where only for some, that these are meant is a
    hypothesis, also when the claim is established again, and a certificate without it shows nothing."""
    for at, (initial, needs) in enumerate([("out.m <= in.home", False), ("out.m <= 10 and in.home <= 10", True)]):
        certificates = compose(make(tmp_path / str(at), MEMORY, EDGE % initial + HOME)).certificates
        (found,) = certificates.existence("start.mem") or [None]
        assert found is not None
        assert [need.kind for need in found.hypotheses] == [How.ENVIRONMENT] * needs
        again = Certificates(certificates.composition, kept=dict(certificates.made))
        assert again.existing(again.kept.get("existence start.mem"), "start.mem") == [found]
        bare = Entry(How.POSSIBLE, "", certificates.made["existence start.mem"].entries[-1].digest)
        kernel = Kernel(certificates.known, Certificate("existence start.mem", (bare,)), Solvers())
        if needs:
            with pytest.raises(Refused, match="constant"):
                kernel.establish(0)
        else:
            assert kernel.establish(0).hypotheses == ()
    none = compose(make(tmp_path / "none", MEMORY, EDGE % "out.m == 1 and in.home == 2" + HOME)).certificates
    assert none.existence("start.mem") is None


def test_room_in_a_circle(tmp_path: Path) -> None:
    certificates = compose(make(tmp_path / "room", CIRCLE)).certificates
    assert certificates.existence("joint.a.G1") is not None
    crowded = CIRCLE.replace("out.y > in.m", "out.y == 1 and in.m > 0")
    assert compose(make(tmp_path / "none", crowded)).certificates.existence("joint.a.G1") is None
    own = CIRCLE.replace("G: in.y > 2", "G: in.y < 0").replace("in.y > 2 ->", "in.y < 0 ->")
    assert compose(make(tmp_path / "own", own)).certificates.existence("joint.a.G1") is not None


def test_it_is_small_and_stands_by_itself() -> None:
    """To be read in an hour: under 965 lines but for a line an operator, with nothing of Avow but the term language and
    `avow.base`."""
    texts = [file.read_text("utf-8") for file in sorted((Path(__file__).parents[2] / "avow/kernel").glob("*.py"))]
    assert len(texts) > 4
    assert sum(text.count("\n") for text in texts) < 965 + len(Builtin), "make room in avow/kernel for what is new"
    imported = {name for text in texts for name in re.findall(r"^\s*(?:from|import) (avow\.\w+)", text, re.M)}
    assert imported == {"avow.base", "avow.kernel", "avow.language"}

"""An initial condition says what an output is at first, and nothing of the environment's constant inputs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from calculus.make import make, node, outcomes
from helpers import some

from avow.base.verdict import Verdict
from avow.calculus.composition import compose
from avow.kernel.certificate import Certificate, Entry, How, Question, Use
from avow.kernel.check import Established, Kernel, Refused
from avow.kernel.statements import Claimed


def system(
    folder: Path, initial: str, claim: str, k: str, y: str, *, assume: str = "", promise: str = "out.y == out.y"
) -> Path:
    text = node("n", f"k : {k}", f"y : {y}", f"G: {promise}") + node("m", f"u : {y}", f"z : {y}", "G: out.z == in.u")
    assumed = f", assume: '{assume}'" if assume else ""
    plan = f"connections: [{{from: n.y, to: m.u, delayed: true, initial: '{initial}'}}]\n"
    plan += f"environment: {{n.k: {{constant: true, because: a setting{assumed}}}}}\n"
    plan += f"requirements: {{R: {{text: t, formula: '{claim}', supported_by: [n]}}}}\n"
    return make(folder, text, plan)


def by_hand(path: Path) -> Established:
    """The claim, from a certificate that names every initial condition, and the environment. Raises Refused."""
    certificates = compose(path).certificates
    claim = certificates.claim(Claimed.REQUIREMENT, "R")
    assert claim is not None
    every = certificates.known.every
    given = [s for s in every if s.kind is Claimed.ENVIRONMENT]
    initials = tuple(s.digest for s in every if s.kind is Claimed.INITIAL)
    assert initials
    at = len(given)
    uses = tuple(Use(k) for k in range(at))
    shown = Entry(How.SHOWN, "", claim.digest, (), (Question(uses, initials),), Question((Use(at, 1),)))
    entries = (*(Entry(How.ENVIRONMENT, s.node, s.digest) for s in given), shown)
    return Kernel(certificates.known, Certificate("requirement R", entries), certificates.solvers).establish(at)


@pytest.mark.parametrize(
    ("initial", "claim", "k", "y"),
    some(
        [
            ("out.y == in.k and in.k > 5", "n.k > 5", "REAL", "REAL"),
            ("out.y == in.k", "n.k >= 0", "INTEGER", "NATURAL"),
            ("in.k * out.y == 5", "n.k != 0", "REAL", "REAL"),
            ("out.y == 1 and in.k > 5", "n.k > 5", "REAL", "REAL"),
            ("out.y > in.k and out.y < 3", "n.k < 3", "REAL", "REAL"),
            ("out.y + out.y == in.k", "mod(n.k, 2) == 0", "INTEGER", "INTEGER"),
            ("in.k -> out.y != out.y", "not n.k", "BOOL", "REAL"),
            ("exists(x in REAL | x * x == in.k) and out.y == 0", "n.k >= 0", "REAL", "REAL"),
        ],
        3,
        slow=5,
    ),
)
def test_it_cannot_make_a_claim_of_the_environment_true(
    tmp_path: Path, initial: str, claim: str, k: str, y: str
) -> None:
    path = system(tmp_path, initial, claim, k, y)
    assert outcomes(path)["R"].verdict is not Verdict.PROVED
    with pytest.raises(Refused, match="first value"):
        by_hand(path)


def test_what_the_environment_is_assumed_to_be_makes_room_for_it_and_is_a_hypothesis(tmp_path: Path) -> None:
    path = system(tmp_path, "out.y == in.k", "n.k >= 0", "INTEGER", "NATURAL", assume="in.k >= 0")
    assert by_hand(path).hypotheses
    certificates = compose(path).certificates
    # the initial condition alone would show it: it may not, without the hypothesis
    claim = certificates.claim(Claimed.REQUIREMENT, "R")
    initial = next(s for s in certificates.known.every if s.kind is Claimed.INITIAL)
    assert claim is not None
    entry = Entry(How.SHOWN, "", claim.digest, (), (Question((), (initial.digest,)),), Question((Use(0, 1),)))
    with pytest.raises(Refused, match="first value"):
        Kernel(certificates.known, Certificate("requirement R", (entry,)), certificates.solvers).establish(0)


@pytest.mark.parametrize("initial", ["out.y == in.k", "out.y > in.k", "out.y >= in.k and out.y <= in.k + 1"])
def test_one_that_leaves_every_setting_possible_is_used(tmp_path: Path, initial: str) -> None:
    path = system(tmp_path, initial, "m.z >= n.k", "REAL", "REAL", promise="out.y >= in.k")
    assert outcomes(path)["R"].verdict is Verdict.PROVED


def test_two_of_one_output_are_taken_together(tmp_path: Path) -> None:
    """The plan's reader allows one for each output; the kernel does not rely on that."""
    certificates = compose(system(tmp_path, "out.y == in.k", "n.k == 1", "REAL", "REAL")).certificates
    other = compose(system(tmp_path / "other", "out.y == 1", "n.k == 1", "REAL", "REAL")).certificates.known
    known = replace(
        certificates.known, every=(*certificates.known.every, *(s for s in other.every if s.kind is Claimed.INITIAL))
    )
    claim = certificates.claim(Claimed.REQUIREMENT, "R")
    assert claim is not None
    marks = tuple(s.digest for s in known.every if s.kind is Claimed.INITIAL)
    assert len(marks) == 2
    entry = Entry(How.SHOWN, "", claim.digest, (), (Question((), marks),), Question((Use(0, 1),)))
    with pytest.raises(Refused, match="first value"):
        Kernel(known, Certificate("requirement R", (entry,)), certificates.solvers).establish(0)


@pytest.mark.parametrize(
    ("initial", "assume", "verdict"),
    [
        ("out.d < in.k", "", Verdict.UNKNOWN),
        ("out.d < in.k", "in.k > 0", Verdict.PROVED),
        ("out.d == in.k", "", Verdict.PROVED),
    ],
)
def test_a_loop_starts_whatever_the_constants_are(tmp_path: Path, initial: str, assume: str, verdict: Verdict) -> None:
    text = node("n", "k : NATURAL, u : NATURAL", "d : NATURAL", "G: out.d == in.u")
    plan = f"connections: [{{from: n.d, to: n.u, delayed: true, initial: '{initial}'}}]\n"
    assumed = f", assume: '{assume}'" if assume else ""
    plan += f"environment: {{n.k: {{constant: true, because: a setting{assumed}}}}}\n"
    found = outcomes(make(tmp_path, text, plan))["start.n"]
    assert found.verdict is verdict
    assert bool(found.rests_on) is bool(assume)

"""Guarantees about steps to come, as temporal properties; what has none is refused by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from avow.backend_kit import one_step
from avow.backend_kit.protocol import Job, Limits
from avow.backends.ajpf import BACKEND
from avow.backends.ajpf.instances import instances
from avow.backends.ajpf.options import read
from avow.backends.ajpf.psl import show
from avow.base.verdict import Outcome, Verdict

FIXTURES = Path(__file__).parent / "fixtures"
MakeJob = Callable[..., Job]
RCL = (FIXTURES / "lift" / "system.rcl").read_text()
HALTS = "in.door == open -> exists(n in NATURAL | out.motion == halt(n))"
HALT = "exists(n in NATURAL | out.motion == halt(n))"


def asked(lift: MakeJob, formula: str, program: str | None = None, **options: object) -> Job:
    start = RCL.index("  guarantee halts")
    rcl = RCL[:start] + f"  guarantee g ( {formula} )\n}}\n"
    files = {"system.rcl": rcl} | ({"cabin.gwen": program} if program is not None else {})
    return lift(options or None, files)


def settle(job: Job, folder: Path) -> Outcome:
    found = one_step.discharge(BACKEND, job, folder, Limits()).outcomes
    return next(o for o in found if o.obligation.endswith("/g"))


@pytest.mark.parametrize(
    ("formula", "psl"),
    [
        (f"in.door == open -> eventually({HALT})", "[] (B(cabin, open) -> (<> D(cabin, halt(_))))"),
        (f"in.door == open -> within[3 steps]({HALT})", "[] (B(cabin, open) -> (<> D(cabin, halt(_))))"),
        (f"in.door == open -> next({HALT})", "[] (B(cabin, open) -> (<> D(cabin, halt(_))))"),
        (
            f"{HALT} -> {HALT} until in.door == shut",
            "[] (D(cabin, halt(_)) -> (B(cabin, shut) R (D(cabin, halt(_)) || B(cabin, shut))))",
        ),
        (
            "forall(f in NATURAL | in.call(f) -> eventually(out.motion == go(f)))",
            "[] (B(cabin, call(1)) -> (<> D(cabin, go(1))))",
        ),
    ],
)
def test_the_properties(formula: str, psl: str, lift: MakeJob) -> None:
    job = asked(lift, formula)
    claim = instances(job, read(job)).claims[-1]
    assert claim.not_covered is None
    assert show(claim.properties[0].formula) == psl


def test_what_is_eventually_so_is_judged_as_what_a_step_demands(lift: MakeJob, tmp_path: Path) -> None:
    """The plain guarantee, `eventually` and `within` have one verdict; what is not shown of the last is told."""
    plain = settle(asked(lift, HALTS), tmp_path)
    ever = settle(asked(lift, f"in.door == open -> eventually({HALT})"), tmp_path)
    soon = settle(asked(lift, f"in.door == open -> within[3 steps]({HALT})"), tmp_path)
    assert plain.verdict is ever.verdict is soon.verdict is Verdict.CHECKED, (plain.summary, ever.summary, soon.summary)
    late = "that it comes within 3 steps: it was shown to come at some time"
    assert late in soon.hypotheses
    assert any("within 3 steps" in b.text for b in soon.rests_on)
    assert not any("at some time" in text for text in ever.hypotheses)


@pytest.mark.parametrize("word", ["eventually", "within[3 steps]", "next"])
def test_a_seeded_fault_is_refuted(word: str, lift: MakeJob, tmp_path: Path) -> None:
    idle = (FIXTURES / "lift" / "cabin.gwen").read_text().replace("<- halt(0)", "<- print(no)")
    found = settle(asked(lift, f"in.door == open -> {word}({HALT})", idle), tmp_path)
    assert found.verdict is Verdict.REFUTED, found.summary


def test_until_is_checked_or_not_known(lift: MakeJob, tmp_path: Path) -> None:
    """The agent goes on as it was until a call comes, and not until the door is open."""
    kept = settle(asked(lift, f"{HALT} -> {HALT} until in.door == shut"), tmp_path)
    assert kept.verdict is Verdict.CHECKED, kept.summary
    left = settle(asked(lift, f"in.door == open -> in.door == open until {HALT}"), tmp_path)
    assert left.verdict in (Verdict.CHECKED, Verdict.UNKNOWN)
    broken = settle(asked(lift, f"in.door == shut -> in.door == shut until {HALT}"), tmp_path)
    assert broken.verdict is Verdict.UNKNOWN
    assert "refutes nothing" in broken.summary


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        (f"in.door == open -> for[3 steps]({HALT})", "`for`"),
        (f"in.door == open -> within[200 ms]({HALT})", "`within` with a limit in seconds"),
        (f"rose(in.door == open) -> eventually({HALT})", "`rose`"),
        (f"once(in.door == open) -> {HALT}", "`once`"),
        ("in.door == open -> eventually(in.door == shut)", "`eventually` of an input (in.door)"),
    ],
)
def test_what_cannot_be_said_is_refused_by_name(formula: str, said: str, lift: MakeJob, tmp_path: Path) -> None:
    job = asked(lift, formula)
    found = settle(job, tmp_path)
    assert found.verdict is Verdict.UNKNOWN
    assert said in found.summary
    assert "BACKEND006" in [d.code for d in one_step.check(BACKEND, job)]


def test_what_is_forbidden_at_some_time_has_no_property(lift: MakeJob, tmp_path: Path) -> None:
    found = settle(asked(lift, f"in.door == open -> next(not {HALT})"), tmp_path)
    assert found.verdict is Verdict.UNKNOWN
    assert "`next` of what is forbidden" in found.summary

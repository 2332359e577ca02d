"""Random small agents: what their claims and their denials come to."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import pytest
import yaml
from helpers import some

from avow.backend_kit.protocol import Job, Limits
from avow.backends.ajpf import BACKEND
from avow.base.verdict import Verdict
from avow.pipeline.methods import method_job
from avow.system.load import load_system

RCL = """
node ag {
  inputs( p : BOOL, q : BOOL ) outputs( o : {one, two} ) topics()
  guarantee first ( in.p -> out.o == one )
  guarantee second ( (in.q and not in.p) -> out.o == two )
  guarantee denied ( in.p -> out.o != one )
}
"""
STATES = 4000
TABLE = {"in.p": "B(ag, p)", "in.q": "B(ag, q)", "out.o == one": "D(ag, one)", "out.o == two": "D(ag, two)"}


def program(rng: random.Random) -> str:
    def guard() -> str:
        wanted = rng.sample(("B a", "~B a", "B b", "~B b", "~B p", "B q"), rng.randint(0, 2))
        return ", ".join(wanted) or "True"

    def deeds(trigger: str) -> str:
        known = ["one", "two", "+a", "-a", "+b", "-b"]
        if trigger in ("+p", "+q", "-q"):  # a goal that sets itself again, or is set by what it believes, never ends
            known.append("+!g [perform]")
        return ", ".join(rng.choice(known) for _ in range(rng.randint(1, 3)))

    triggers = ("+p", "+q", "-q", "+a", "+!g [perform]")
    plans = "\n".join(
        f"{trigger} : {{ {guard()} }} <- {deeds(trigger)};" for trigger in rng.choices(triggers, k=rng.randint(2, 4))
    )
    goals = "g [perform]" if rng.random() < 0.5 else ""
    return f"GWENDOLEN\n\n:name: ag\n\n:Initial Beliefs:\n\nready\n\n:Initial Goals:\n\n{goals}\n\n:Plans:\n\n{plans}\n"


def environment(rng: random.Random) -> str:
    draws = rng.choice(("once", "repeatedly", "never"))
    groups = rng.choice(("{x: [p, nothing], y: [q, nothing]}", "{x: [p, q, nothing]}", "{x: [p, q]}"))
    return f"about: anything\ndraws: {{at_start: true, at_quiescence: {draws}}}\npercepts: {groups}\n"


def random_job(folder: Path, rng: random.Random) -> Job:
    (folder / "system.rcl").write_text(RCL)
    (folder / "ag.gwen").write_text(program(rng))
    (folder / "env.yaml").write_text(environment(rng))
    options = {
        "program": "ag.gwen",
        "environment": "env.yaml",
        "agent": "ag",
        "states": STATES,
        "predicates": TABLE,
        "semantics": rng.choice(("mcapl", "edge")),
    }
    plan = {"system": "s", "title": "S", "contract": "system.rcl", "nodes": {"ag": {"methods": [{"ajpf": options}]}}}
    (folder / "plan.yaml").write_text(yaml.safe_dump(plan, sort_keys=False))
    system = load_system(folder)
    return method_job(system, system.contract.node("ag"), system.plan.node("ag").methods[0])


@pytest.mark.parametrize("seeds", some([range(15), range(15, 30)], 1))
def test_no_agent_meets_a_claim_and_its_denial(tmp_path: Path, seeds: range) -> None:
    """Under "eventually" for the one and "eventually not" for the other, most agents would meet both."""
    told = Counter()
    for seed in seeds:
        job = random_job(tmp_path, random.Random(seed))
        outcomes = {o.obligation.rpartition("/")[2]: o for o in BACKEND.discharge(job, tmp_path, Limits(60)).outcomes}
        claim, denial = outcomes["first"], outcomes["denied"]
        told[str(claim.verdict), str(denial.verdict), denial.vacuous] += 1
        if claim.verdict is Verdict.CHECKED and not claim.vacuous:
            assert denial.verdict in (Verdict.REFUTED, Verdict.UNKNOWN)
        if denial.verdict is Verdict.REFUTED:
            assert "forbidden comes in step" in denial.counterexample.text()
        if denial.verdict is Verdict.CHECKED and not denial.vacuous:
            assert claim.verdict is Verdict.REFUTED
    assert {("checked", "refuted", False), ("refuted", "checked", False)} <= set(told), told

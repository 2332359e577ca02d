"""Every rule of the policy and every word about a hazard is compared; what it means that one moved."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from avow.assurance.changes import compare, is_worse
from avow.assurance.model import Case
from avow.assurance.policy import Demand, Policy
from avow.assurance.state import state_of
from avow.base.verdict import Isolation, Link, Object, Verdict
from avow.evidence.status import Status
from avow.system.plan import Hazard, Numbers, Requirement

from .sample import case, evidence, guarantee, system

SOME, MORE = (Status.PROVED,), (Status.PROVED, Status.JUSTIFIED)
DEMANDS: dict[str, tuple[Any, Any]] = {  # what asks less, and what asks more
    "one_of": (MORE, SOME),
    "methods": (1, 2),
    "independent": (False, True),
    "max_age_days": ((("reviewed", 900),), (("reviewed", 90),)),
    "reviewers": (1, 2),
    "links": ((), (Link.GENERATED,)),
    "unconditional": (False, True),
    "isolation": (Isolation.NONE, Isolation.SEALED),
    "of": ((Object.SOURCE, Object.MODEL), (Object.SOURCE,)),
    "numbers": ((), (Numbers.EXACT,)),
    "cases": (1, 20),
}
RULES: dict[str, tuple[Any, Any]] = {
    **dict.fromkeys(("sanity", "composition", "requirements", "programs"), (MORE, SOME)),
    "reviewers": ((), ("A. Person",)),
    "certified": (False, True),
    "proved": (False, True),
    "max_failure_rate": ((), (("high", "0.01"),)),
    "standard": ("", "do178c"),
    "level": ("", "b"),
}
G = guarantee("n", "g")
FIRE = Hazard("H1", "It burns", "critical", "remote", "p. 1", "safety", ("heat",), ("loss",), ("R", "n.g"))
HAZARDS: dict[str, Any] = {
    "text": "It burns at 900",
    "severity": "marginal",
    "exposure": "frequent",
    "kind": "security",
    "causes": (),
    "consequences": ("none",),
    "mitigated_by": ("R",),
}


def made(hazard: Hazard = FIRE) -> Case:
    asked = [Requirement("R", "It is safe.", None, None, ("n.g",))]
    return case(system({"n": ["g"]}, requirements=asked, hazards=[hazard]), [G], [evidence(G)])


def demand(rule: str, value: Any) -> Demand:
    return replace(Demand(SOME), **{rule: value})


def kinds(old: Case, new: Case, about: str) -> list[tuple[str, bool]]:
    return [(c.kind, is_worse(c)) for c in compare(state_of(old), state_of(new)) if c.about == about]


@pytest.mark.parametrize("name", [*DEMANDS, *(f"policy {name}" for name in RULES)])
def test_a_policy_that_asks_less_is_told_whatever_passes(name: str) -> None:
    of, _, rule = name.rpartition(" ")
    made_of = made().policy
    policies = [
        replace(made_of, **{rule: value}) if of else replace(made_of, guarantees=(("high", demand(rule, value)),))
        for value in (RULES if of else DEMANDS)[rule]
    ]
    less, more = (replace(made(), policy=policy) for policy in policies)
    assert kinds(more, less, "policy") == [("demand", True)]
    assert kinds(less, more, "policy") == [("better", False)]


def test_no_rule_is_left_out() -> None:
    assert DEMANDS.keys() == {f.name for f in fields(Demand)}
    assert RULES.keys() == {f.name for f in fields(Policy)} - {"name", "title", "about", "guarantees"}
    assert HAZARDS.keys() == {f.name for f in fields(Hazard) if f.compare} - {"id", "source"}


@pytest.mark.parametrize("name", HAZARDS)
def test_a_hazard_that_is_judged_otherwise_has_a_line_for_each_word(name: str) -> None:
    other = made(replace(FIRE, **{name: HAZARDS[name]}))
    assert kinds(made(), other, "hazard") == [("gone" if name == "mitigated_by" else "demand", True)]
    both = made(replace(FIRE, text="Another text", **{name: HAZARDS[name]} if name != "text" else {"source": "p. 2"}))
    assert len(kinds(made(), both, "hazard")) == 2


def test_a_hazard_that_is_judged_worse_is_no_loss() -> None:
    assert kinds(made(replace(FIRE, severity="marginal")), made(), "hazard") == [("meaning", False)]
    assert kinds(made(replace(FIRE, mitigated_by=("R",))), made(), "hazard") == [("new", False)]


def test_the_worst_comes_first() -> None:
    """A refuted hazard, the most severe first, before what is not shown."""
    names = ("a", "b", "c")
    claims = [guarantee("n", name) for name in names]
    hazards = [Hazard(f"H{at}", "x", s, mitigated_by=("n.a",)) for at, s in enumerate(("marginal", "catastrophic"))]
    hazards.append(Hazard("H2", "x", "catastrophic", mitigated_by=("n.b",)))
    asked = [Requirement(f"R{at}", "x", None, None, (f"n.{name}",)) for at, name in enumerate(names)]
    subject = system({"n": list(names)}, requirements=asked, hazards=hazards)
    old = case(subject, claims, [evidence(c) for c in claims])
    new = case(subject, claims, [evidence(claims[0], Verdict.REFUTED), evidence(claims[2])])
    found = [c for c in compare(state_of(old), state_of(new)) if c.about in ("hazard", "requirement")]
    assert [c.subject for c in found] == ["H1", "H0", "H2", "R0", "R1"]

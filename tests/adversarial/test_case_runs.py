"""Random systems through edits, renamed derivations, accepted findings and cached answers, up to what the case says: no
requirement is supported that some run breaks, and none by what was kept that is not supported afresh.

The methods of the nodes are taken at their word: some guarantees are refuted (and the plan may accept that), all others
proved. A node keeps what is proved of it, as long as its assumptions have held. What nodes assume of an input that the
plan has a reason for is supposed, and the case says so.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from assurance.sample import RUN, TODAY, chain, evidence
from calculus.make import Limits, settle_all

from avow.assurance.case import conclude
from avow.assurance.facts import facts_of_system
from avow.assurance.model import Case
from avow.base.diagnostics import Rejected
from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.calculus.composition import compose
from avow.evidence.obligation import Kind
from avow.evidence.record import Evidence
from avow.pipeline import recheck
from avow.pipeline.assess import _derivation_views, _discharging
from avow.pipeline.run_info import Run
from avow.pipeline.work import COMPOSE, catalogue, compose_work
from avow.system.load import load_system

from .drawn import Formula, System, formula, says

REASONS = "persistence: {because: latched}, one_output: {because: one each}"


class Judged(System):
    """A random system, some of whose guarantees are refuted; what the plan accepts of them; and names for people."""

    def __init__(self, seed: int, *, rich: bool = False) -> None:
        self.chance = Random(seed)
        super().__init__(seed, rich=rich)
        if not rich:  # most of what is random is broken: some of it is made likelier
            for n in self.nodes:
                if self.chance.random() < 0.6:
                    self.promised[n][0] = formula(self.chance, [f"out.o{n}"], 0)
        outputs = [f"{n}.o{n}" for n in self.nodes]
        self.required = [
            Formula(f"({formula(self.chance, outputs, 1).text}) or ({self.most(outputs).text})") for _ in self.required
        ]
        if not rich:  # a requirement that says what one node promises is neither a tautology nor out of reach
            name = self.chance.choice(self.nodes)
            said = self.promised[name][0].text.replace(f"out.o{name}", f"{name}.o{name}")
            self.required[0] = Formula(said) if "in." not in said else self.required[0]
        self.text, self.plan = self.written(), self.planned(self.chance)
        often = 0.05 if rich else 0.15
        self.refuted = {
            (n, k) for n in self.nodes for k in range(len(self.promised[n])) if self.chance.random() < often
        }
        self.told()

    def most(self, outputs: Sequence[str]) -> Formula:
        """Of this step alone, as all that is required here."""
        if not self.usual:
            return formula(self.chance, outputs, 1)
        name = self.chance.choice(self.nodes)
        return says(self.chance, f"{name}.o{name}", self.usual[name])

    def told(self) -> None:
        """The plan with reasons, another name for its derivation, and some refutations accepted."""
        name = self.chance.choice(["D", "E", "whole_of_it"])
        start = f"compose: {{whole: {{{REASONS}}}, {name}: {{"
        lines = self.plan.replace("compose: {D: {", f"{start}{REASONS}, ").splitlines()
        if not any(line.startswith("compose:") for line in lines):
            lines.insert(0, f"{start}select: [{', '.join(self.nodes)}], {REASONS}}}}}")
        accepted = [
            f"  - {{obligation: {n}/guarantee/{self.names[k]}, verdict: refuted, reason: known, who: A. Person, "
            f"date: {TODAY.isoformat()}, expires: {TODAY.isoformat()}}}"
            for n, k in sorted(self.refuted)
            if k < len(self.promised[n]) and self.chance.random() < 0.7
        ]
        self.plan = "\n".join([*lines, *(["accepted:", *accepted] if accepted else []), ""])

    def edited(self, random: Random) -> None:
        super().edited(random)
        self.told()

    def kept_word(self) -> System:
        """The system whose nodes keep what is proved of them."""
        found = object.__new__(System)
        found.__dict__.update(self.__dict__)
        found.promised = {
            n: [p for k, p in enumerate(each) if (n, k) not in self.refuted] for n, each in self.promised.items()
        }
        return found


def concluded(root: Path, made: Judged, kept: Sequence[Evidence]) -> tuple[Case, list[Evidence]]:
    """The case of a system as it is now, and all records. What was kept is asked again only where it no longer counts.
    Raises Rejected for a plan that is wrong."""
    folder = root / "contracts" / "s"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "system.rcl").write_text(made.text)
    (folder / "plan.yaml").write_text(f"system: s\ntitle: S\ncontract: system.rcl\n{made.plan}")
    system = load_system(folder)
    composition = compose(system)
    work = compose_work(composition)
    run = Run("now", False)
    good = [r for r in kept if r.key == work.keys.get(r.obligation) and recheck.still_counts(r, root, system, run)]
    todo = [o for o in work.obligations if o.id not in {r.obligation for r in good}]
    outcomes = settle_all(composition, todo, Limits())
    text = recheck.written(composition.certificates)
    path = f"artifacts/s/{sha256(text)[:12]}/{recheck.FILE}"
    (root / path).parent.mkdir(parents=True, exist_ok=True)
    (root / path).write_text(text)
    records = list(good)
    for o, outcome in zip(todo, outcomes, strict=True):
        about = replace(
            evidence(o, outcome.verdict, COMPOSE, key=work.keys[o.id]), counterexample=outcome.counterexample
        )
        details = json.loads(json.dumps(outcome.details, default=str))
        about = replace(about, details=details, rests_on=outcome.rests_on, vacuous=outcome.vacuous)
        records.append(replace(about, outputs={path: sha256(text)}))
    calculus = list(records)
    numbers = {name: k for k, name in enumerate(made.names)}
    for o in catalogue(system).obligations:
        if o.kind is Kind.GUARANTEE:
            bad = (o.node, numbers[o.name]) in made.refuted
            records.append(evidence(o, Verdict.REFUTED if bad else Verdict.PROVED))
        elif o.kind is Kind.SANITY:
            records.append(evidence(o, Verdict.PROVED, "sanity"))
    case = conclude(
        facts_of_system(
            system,
            catalogue(system).obligations,
            chain(records),
            keys={(r.obligation, r.method): r.key for r in records},
            today=TODAY,
            run=RUN,
            derivations=_derivation_views(system),
            discharging=_discharging(system),
        )
    )
    return case, [*calculus, *(r for r in kept if r not in good)]


def told(folder: Path, seed: int, edits: int = 3, *, rich: bool = False) -> int:
    """How many requirements are supported, over all edits."""
    made, count = Judged(seed, rich=rich), 0
    kept: list[Evidence] = []
    for edit in range(edits):
        try:
            case, kept = concluded(folder / str(seed), made, kept)
        except Rejected:
            return count
        fresh, _ = concluded(folder / f"{seed}-{edit}", made, ())
        good = {r.id for r in case.requirements if r.status.supports}
        assert good <= {r.id for r in fresh.requirements if r.status.supports}, (seed, edit)
        count += len(good)
        if good:
            for now, _, _ in made.kept_word().steps(argued=True):
                for k, holds in enumerate(made.required):
                    values = {f"{n}.o{n}": value for n, value in now.items()}
                    assert f"R{k}" not in good or holds(values), (seed, edit, k, now)
        made.edited(made.chance)
    return count


@pytest.mark.slow
@pytest.mark.parametrize("rich", [False, True])
def test_no_case_says_what_some_run_breaks(tmp_path: Path, rich: bool) -> None:
    """The seeds are of systems that mostly support some requirement, so that there is something to find."""
    said = [told(tmp_path, seed, rich=rich) for seed in ((100, 101, 102, 107) if rich else (0, 1, 26, 51))]
    assert sum(map(bool, said)) >= 2


@pytest.mark.nightly
@pytest.mark.parametrize("rich", [False, True])
@pytest.mark.parametrize("start", range(100, 250, 25))
def test_no_case_says_what_some_run_breaks_at_length(tmp_path: Path, rich: bool, start: int) -> None:
    assert sum(bool(told(tmp_path, seed, rich=rich)) for seed in range(start, start + 25)) >= (5 if rich else 0)

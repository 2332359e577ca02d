"""From the cases of each guarantee to its verdict."""

from __future__ import annotations

import contextlib
import random
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from avow.backend_kit.given import file_path
from avow.backend_kit.programs.judging import Formula
from avow.backend_kit.protocol import Job, Limits
from avow.base.plain import count, decimal, listed
from avow.base.tuning.effort import JUDGE_EFFORT
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evidence.obligation import Obligation
from avow.evidence.record import CASE
from avow.formulas.conditions import conditions
from avow.formulas.values import Binary, show
from avow.language.terms import FALSE, Term
from avow.solving.questions import solve

from .cases import Box, Case, NotLinear, box, denials, is_empty
from .intervals import bounds, excluded
from .marabou import SAT, UNSAT, ask
from .options import Given
from .running import Point, Runtime, corners, nearest, sides
from .tuning import MARGIN, SAMPLES
from .two_steps import Claim, claims, excluded_by_slopes


@dataclass(slots=True)
class _Found:
    """What was found about one guarantee."""

    broken: Counterexample | None = None
    point: Point = ()
    by_intervals: int = 0
    by_marabou: int = 0
    open: str = ""
    """Why a case is left."""
    log: list[str] = field(default_factory=list)


def settle(job: Job, given: Given, limits: Limits) -> tuple[tuple[Outcome, ...], Mapping[str, str]]:
    """One outcome for each obligation, and logs."""
    path = file_path(job, "network")
    assert path is not None
    try:
        runtime = Runtime(path, given)
    except Exception as error:  # onnxruntime has a class of its own for each kind of fault
        why = f"onnxruntime does not accept the network: {error}".replace("\n", " ")
        return tuple(Outcome(o.id, Verdict.ERROR, why) for o in job.obligations), {}
    work = _Work(job, given, runtime, time.monotonic() + limits.seconds, random.Random(limits.seed))
    if why := work.compare():
        return tuple(Outcome(o.id, Verdict.ERROR, why) for o in job.obligations), {}
    found = [(o, work.outcome(o)) for o in job.obligations]
    return tuple(outcome for _, (outcome, _) in found), {f"{o.name}.log": log for o, (_, log) in found}


@dataclass(frozen=True, slots=True)
class _Work:
    job: Job
    given: Given
    runtime: Runtime
    end: float
    draw: random.Random

    def outcome(self, obligation: Obligation) -> tuple[Outcome, str]:
        clause = self.job.clause(obligation)
        assumed = {**{c.name: c.formula for c in self.job.node.assumptions}, **dict(_named(self.given.box.terms))}
        found, count, left = _Found(), 0, list[Term]()
        each = claims(clause.formula, assumed, self.given)
        for claim in each:
            try:
                cases, unused = denials(claim.formula, claim.assumed.values(), claim.given)
            except NotLinear as part:
                why = f"{part} is not linear over connected ports: connect its ports, or write sums"
                return Outcome(obligation.id, Verdict.UNKNOWN, why), ""
            count, left = count + len(cases), [*left, *unused]
            replace(self, given=claim.given).search(obligation, claim, cases, found)
            if found.broken:
                break
        hypotheses = [f"not linear, and not used: assumption {name}" for name, term in assumed.items() if term in left]
        return self.verdict(obligation, each[-1], count, found, hypotheses), "\n".join(found.log) + "\n"

    def search(self, obligation: Obligation, claim: Claim, cases: tuple[Case, ...], found: _Found) -> None:
        holds = Formula.made(self.job.clause(obligation).name, claim.formula)
        allowed = tuple(Formula.made(name, term) for name, term in claim.assumed.items())
        for point in self.job.kept.get(obligation.id, ()):
            if len(point) == self.given.network.inputs and self.breaks(tuple(point), holds, allowed, found):
                return
        for number, case in enumerate(cases, 1):
            why = self.case(case, holds, allowed, found, max(10, SAMPLES // len(cases)))
            found.log.append(f"case {number}: {why}")
            if found.broken:
                return
            if why not in (_INTERVALS, UNSAT):
                found.open = found.open or why

    def case(self, case: Case, holds: Formula, allowed: tuple[Formula, ...], found: _Found, samples: int) -> str:
        """What became of a case: `_INTERVALS`, Marabou's `unsat`, or why it is open."""
        network = self.given.network
        within = box(case, network.inputs)
        if is_empty(within):
            found.by_intervals += 1
            return _INTERVALS
        unbounded = [name for name, each in self.given.inputs.items() if any(None in within[one.index] for one in each)]
        if unbounded:
            return f"{listed(unbounded)} has no bounds: assume some in the contract, or name them under 'box'"
        known = bounds(network, within)
        if excluded(case, network, known):
            found.by_intervals += 1
            return _INTERVALS
        if self.given.one is not None and excluded_by_slopes(case, self.given, within, self.end):
            found.by_intervals += 1
            return _INTERVALS
        single = sides(within)
        for point in corners(single, self.draw, samples) if single else ():
            if time.monotonic() > self.end:
                return _TIME
            if self.breaks(point, holds, allowed, found):
                return "a point that was drawn is a counterexample"
        if self.given.one is not None:
            return "bounds of slopes do not exclude it, nor do points that were drawn show it"
        return self.asked(case, known, single, holds, allowed, found)

    def asked(
        self, case: Case, known: Any, single: Any, holds: Formula, allowed: tuple[Formula, ...], found: _Found
    ) -> str:
        for margin in (0.0, MARGIN):
            word, point = ask(self.given.network, case, known, self.end - time.monotonic(), margin)
            if word == UNSAT and not margin:
                found.by_marabou += 1
                return UNSAT
            if word == SAT and single and self.breaks(nearest(point, single), holds, allowed, found):
                return "Marabou's counterexample was replayed"
            if word != SAT:
                break
        if word == UNSAT:
            return f"Marabou excludes all but the boundary, where strict inequalities hold by less than {MARGIN}"
        if word == SAT:
            return "Marabou has a counterexample that onnxruntime does not confirm"
        return _TIME if word == "TIMEOUT" else f"Marabou answered {word}"

    def breaks(self, point: Point, holds: Formula, allowed: tuple[Formula, ...], found: _Found) -> bool:
        """Whether the network, run at this point, denies the guarantee under the assumptions."""
        read = self.runtime.ports if self.given.one is None else self.runtime.two
        ports = read(self.job.node, point)
        if ports is None or not all(each.holds(ports) is True for each in allowed) or holds.holds(ports) is not False:
            return False
        # digits of a float32 are shown unless the guarantee holds of what they say
        rounded = {n: Fraction(v.digits) if isinstance(v, Binary) else v for n, v in ports.items()}
        exact = holds.holds(rounded) is not False
        shown = tuple(
            (n, (decimal(Fraction(v)) if exact and isinstance(v, Binary) else None) or show(v))
            for n, v in ports.items()
        )
        found.broken = Counterexample(shown, f"guarantee {holds.name} does not hold of the network in onnxruntime")
        found.point = point
        return True

    def verdict(
        self, obligation: Obligation, claim: Claim, cases: int, found: _Found, hypotheses: list[str]
    ) -> Outcome:
        details: dict[str, object] = {"cases": cases}
        if found.broken is not None:
            kept = {**details, CASE: list(found.point)}
            return Outcome(obligation.id, Verdict.REFUTED, found.broken.text(), found.broken, details=kept)
        done = found.by_intervals + found.by_marabou
        if found.open:
            why = f"{done} of {count(cases, 'case')} settled: {found.open}"
            return Outcome(obligation.id, Verdict.UNKNOWN, why, details=details)
        details |= {"by interval bounds": found.by_intervals, "by Marabou": found.by_marabou}
        summary = (
            f"proved of the network in exact reals: {count(cases, 'case')} of its denial, {found.by_intervals} "
            f"excluded by interval bounds and {found.by_marabou} by Marabou"
        )
        return Outcome(
            obligation.id,
            Verdict.PROVED,
            summary,
            hypotheses=(*hypotheses, *self.supposed(found)),
            details=details,
            vacuous=_vacuous(claim),
            rests_on=self.given.box.hypotheses(self.job.node.name),
        )

    def supposed(self, found: _Found) -> Iterable[str]:
        points = self.runtime.points
        yield (
            "what runs computes in float32, which breaks no guarantee proved in reals: the outputs differed by at most "
            f"{self.runtime.difference:.2g} at {count(points, 'sampled point')}"
        )
        if found.by_marabou:
            yield "Marabou computes in floating point with a tolerance of 1e-6: no such error hides a counterexample"

    def compare(self) -> str:
        """Runs the network within what the assumptions say (else near zero). Why no proof would count, if so."""
        network, boxes = self.given.network, list[Box]()
        with contextlib.suppress(NotLinear):
            cases, _ = denials(
                FALSE, [c.formula for c in self.job.node.assumptions] + [*self.given.box.terms], self.given
            )
            boxes = [box(case, network.inputs) for case in cases]
        known = [found for each in boxes if all(None not in pair for pair in each) and (found := sides(each))]
        for within in known or [((-1.0, 1.0),) * network.inputs]:
            for point in corners(within, self.draw, max(3, SAMPLES // len(known or "1"))):
                if not self.runtime.compare(point):
                    return f"onnxruntime has other outputs than the network as read: {self.runtime.outputs(point)}"
                if time.monotonic() > self.end and self.runtime.points >= 3:
                    return ""
        return ""


_INTERVALS = "excluded by interval bounds"
_TIME = "the time is over"


def _named(terms: Iterable[Term]) -> Iterable[tuple[str, Term]]:
    return ((f"box {k}", term) for k, term in enumerate(terms, 1))


def _vacuous(claim: Claim) -> bool:
    """Whether no input meets the assumptions and a condition of the guarantee."""
    whens = [each.formula for each in conditions(claim.formula)]
    asked = [{**claim.assumed, "when": when} for when in whens] or [{**claim.assumed}]
    return all(solve(each, effort=JUDGE_EFFORT, values="unused").status == "unsat" for each in asked)

"""From judged runs to a verdict and its text.

Deleting the rows of failing runs would remove a refutation. So failing runs are kept in the ledger
(`avow.evidence.record.CASE`), and a plan that leaves one out has to give a reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from avow.base.percent import at_most
from avow.base.plain import count, decimal, listed
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evidence.record import CASE, RATE
from avow.formulas.values import show
from avow.kernel.rates import Stratum, Trial, shows

from .binding import Unfit
from .judging import Claim, Judged, judged
from .options import Experiment, Run
from .statistics import runs_needed, upper_bound
from .tuning import FAILURES_KEPT, FAILURES_SHOWN


@dataclass(frozen=True, slots=True)
class _Sample:
    """The runs that met the guarantee's condition, in strata: each condition under each value of the column `strata`.
    A run that violates an assumption is not included."""

    strata: tuple[Stratum, ...]
    triggered: int
    failed: tuple[tuple[Run, Judged], ...]
    excused: int

    @property
    def worst(self) -> Stratum:
        return max(self.strata, key=lambda stratum: Fraction(stratum.bound))

    @property
    def bound(self) -> Fraction:
        return Fraction(self.worst.bound)

    def refutes(self, least: Fraction) -> bool:
        """Whether some stratum shows, at its confidence, that the probability of success is at most `least`."""
        return any(shows(s.trials - s.failures, s.trials, least, Fraction(s.confidence)) for s in self.strata)


def settle(name: str, experiment: Experiment, kept: Iterable[Sequence[Mapping[str, Any]]]) -> tuple[Outcome, str]:
    """The outcome for a guarantee, without its obligation, and the result of each run, as tab-separated lines. `kept`:
    runs that failed before."""
    claim = experiment.claims[name]
    found = [(run, run.verdicts.get(name) or judged(claim, run.steps)) for run in experiment.runs]
    log = "".join(f"{run.name}\t{_word(claim, one)}\n" for run, one in found)
    outcome = _replayed(_outcome(claim, found, experiment), name, claim, experiment)
    return _held_against(outcome, claim, experiment, kept), f"run\tverdict\n{log}"


def _outcome(claim: Claim, found: Sequence[tuple[Run, Judged]], experiment: Experiment) -> Outcome:
    sample = _sample(claim, found, experiment)
    details: dict[str, object] = {"protocol": experiment.protocol} if experiment.protocol else {}
    bound: dict[str, object] = {"runs": len(found), "confidence": float(experiment.confidence)}
    if sample.excused:
        bound["runs that break an assumption"] = sample.excused
    if unfinished := [run.name for run, one in found if one.open]:
        bound["runs that end before an answer"] = len(unfinished)
    outcome = Outcome("", Verdict.UNKNOWN, "", bound=bound, details=details)
    details["strata"] = [_row(stratum) for stratum in sample.strata]
    bound["triggered"], bound["failures"] = sample.triggered, len(sample.failed)
    if len(sample.strata) > 1:
        bound["worst stratum"] = f"{sample.worst.name}, {sample.worst.failures} of {sample.worst.trials} failed"
    bound["failure probability at most"] = float(sample.bound)
    alike = f"{count(experiment.alike, 'recording')} like an earlier one" if experiment.alike else ""
    seen = _seen(sample, len(found), alike)
    text = f"{seen}: {_most(sample, experiment)}"
    at_least, chance = experiment.at_least, claim.chance
    if chance is not None:
        at_least = chance.least
        if why := _MONITORS if experiment.replayed is not None else _unlike(claim, experiment):
            return replace(outcome, summary=why)
    claimed = at_least is not None and sample.bound <= 1 - at_least
    if sample.failed and not claimed and (chance is None or sample.refutes(chance.least)):
        return _failed(replace(outcome, summary=seen), claim, sample.failed)
    if undecided := [(run, one) for run, one in found if one.undecided and not one.excused]:
        run, one = undecided[0]
        return replace(outcome, summary=f"run {run.name} is undecided: {one.undecided}")
    if why := _unmet(claim, found):
        return replace(outcome, verdict=Verdict.TESTED, vacuous=True, summary=why)
    asked = at_least or experiment.floor
    if sample.bound > 1 - asked:
        return replace(outcome, summary=_too_few(text, sample, claim, experiment, asked))
    details[RATE] = [_row(stratum) for stratum in sample.strata]
    rests = [_DRAWN if experiment.replayed is None else _SIMULATED, *claim.interpreted]
    if claim.unseen:
        rests.append(f"each run meets the assumptions {', '.join(claim.unseen)}: their inputs are not in the data")
    if alike:
        rests.append(f"the simulator uses seed and scenario, although it made {alike}")
    if unfinished:
        names = listed(unfinished, FAILURES_SHOWN)
        rests.append(f"an answer would be in time and right in runs that end before it: {names}")
    if sample.failed:
        details["failing runs"] = counterexample(claim, sample.failed).explanation
        if chance is None:
            rests.append(f"the guarantee is meant statistically: in at least {_percent(asked)} of runs")
    return replace(outcome, verdict=Verdict.TESTED, summary=text, hypotheses=tuple(rests))


def _unlike(claim: Claim, experiment: Experiment) -> str:
    """Why the trials of the data are not what the guarantee gives a probability of; empty if they are."""
    if claim.trial in (None, experiment.trial):
        return ""
    if experiment.trial is Trial.RUN:
        return (
            "the guarantee has a probability per step, and the data's trials are runs: leave 'steps' out, one row a run"
        )
    return "the guarantee has a probability per run, and each row is one step: the rows of a run need 'steps: true'"


_MONITORS = "the monitors of a campaign judge no probability: give a table of steps under 'data', without 'campaign'"
_DRAWN = "the runs are independent and drawn as the robot will be used"
_SIMULATED = "the robot is used as the campaign's scenario says, and behaves as in the simulator"


def _failed(outcome: Outcome, claim: Claim, failed: Sequence[tuple[Run, Judged]]) -> Outcome:
    """Refuted by the runs that break the guarantee; an error if the simulator only ended without recordings."""
    if not (broken := [(run, one) for run, one in failed if not one.lost]):
        run, one = failed[0]
        text = f"{outcome.summary}: run {run.name} has no recording ({one.lost})"
        return replace(outcome, verdict=Verdict.ERROR, summary=text, hypotheses=())
    kept = [{"run": run.name, "rows": list(run.rows)} for run, _ in broken[:FAILURES_KEPT]]
    details, shown = {**outcome.details, CASE: kept}, counterexample(claim, broken)
    outcome = replace(outcome, hypotheses=(), vacuous=False)
    return replace(outcome, verdict=Verdict.REFUTED, counterexample=shown, details=details)


def _replayed(outcome: Outcome, name: str, claim: Claim, experiment: Experiment) -> Outcome:
    """With a campaign's regressions, which count for no rate: a failing one refutes, unless a rate is claimed."""
    if not experiment.replayed or outcome.verdict is Verdict.REFUTED:
        return outcome
    found = [(run, run.verdicts[name]) for run in experiment.replayed]
    text = f"{outcome.summary}; {count(len(found), 'regression')} replayed"
    if failed := [(run, one) for run, one in found if one.broken is not None]:
        names = listed([run.name for run, _ in failed], FAILURES_SHOWN)
        outcome = replace(outcome, summary=f"{text}, {len(failed)} failed: {names}")
        if experiment.at_least is None and claim.chance is None:
            return _failed(outcome, claim, failed)
        rests = f"the guarantee is meant statistically: it fails in the regressions {names}"
        return replace(outcome, hypotheses=(*outcome.hypotheses, rests))
    if undecided := next((run.name for run, one in found if one.undecided and not one.excused), ""):
        return replace(outcome, verdict=Verdict.UNKNOWN, summary=f"{text}, {undecided} undecided", hypotheses=())
    return replace(outcome, summary=f"{text}, 0 failed")


def _sample(claim: Claim, found: Sequence[tuple[Run, Judged]], experiment: Experiment) -> _Sample:
    among = sorted({run.stratum for run, _ in found})
    conditions = range(len(claim.conditions)) if claim.conditions else (None,)
    counts = {(stratum, n): [0, 0] for stratum in among for n in conditions}
    for run, one in found:
        if not one.excused:
            for n in conditions:
                # a violation counts under every condition if none is known to be met
                if (n is None and one.asked) or n in one.met or (one.broken is not None and not one.met):
                    counts[run.stratum, n][0] += 1
                    counts[run.stratum, n][1] += one.broken is not None
    shared = 1 - (1 - experiment.confidence) / len(counts)
    each = Fraction(-(-shared * 10**12 // 1), 10**12)  # a decimal, rounded up
    strata = []
    for (stratum, n), (trials, failures) in counts.items():
        bound, name = upper_bound(failures, trials, each), _name(claim, experiment, stratum, n)
        strata.append(Stratum(name, trials, failures, _decimal(bound), _decimal(each), experiment.trial))
    counted = [(run, one) for run, one in found if not one.excused]
    return _Sample(
        tuple(strata),
        sum(1 for _, one in counted if one.broken is not None or (one.met if claim.conditions else one.asked)),
        tuple((run, one) for run, one in counted if one.broken is not None),
        len(found) - len(counted),
    )


def _name(claim: Claim, experiment: Experiment, stratum: str, condition: int | None) -> str:
    parts = [f"{experiment.strata} = {stratum}"] if experiment.strata else []
    if condition is not None and len(claim.conditions) > 1:
        parts.append(claim.conditions[condition].name)
    return ", ".join(parts)


def _unmet(claim: Claim, found: Sequence[tuple[Run, Judged]]) -> str:
    """Why the runs show nothing; empty if each condition was met in some of them."""
    runs, counted = count(len(found), "run"), [one for _, one in found if not one.excused]
    if not counted:
        return f"no run counts: {runs}, and each breaks an assumption"
    if not claim.conditions and not any(one.asked for one in counted):
        return f"the guarantee demands nothing in any of {runs}"
    met = {n for one in counted for n in one.met}
    within = {n for one in counted for n in one.within}
    unmet = [formula.name for n, formula in enumerate(claim.conditions) if n not in met]
    unmet += [formula.name for n, formula in enumerate(claim.within) if n not in within]
    return f"in none of {runs} was its condition met: {unmet[0]}" if unmet else ""


def _seen(sample: _Sample, runs: int, alike: str) -> str:
    """``17 triggered runs of 105 (3 recordings like an earlier one), 0 failed``."""
    triggered = count(sample.triggered, "triggered run")
    of = count(runs, "run") if sample.triggered == runs else f"{triggered} of {runs}"
    aside = ", ".join(filter(None, (f"{sample.excused} broke an assumption" if sample.excused else "", alike)))
    return f"{of}{f' ({aside})' if aside else ''}, {len(sample.failed)} failed"


def _most(sample: _Sample, experiment: Experiment) -> str:
    """``at most 16.2 % fail at 95 % confidence``."""
    most = f"at most {at_most(sample.bound)} fail at {_percent(experiment.confidence)} confidence"
    if len(sample.strata) == 1:
        return most
    worst = sample.worst
    which = f"worst of {len(sample.strata)} strata, which share the confidence: {worst.name}"
    return f"{most} ({which}, {worst.failures} of {worst.trials} failed)"


def _too_few(text: str, sample: _Sample, claim: Claim, experiment: Experiment, asked: Fraction) -> str:
    needed = runs_needed(1 - asked, Fraction(sample.worst.confidence))
    claimed = claim.chance is not None or experiment.at_least is not None
    what = "the claim" if claimed else "the least that this criticality asks for"
    where = " in each stratum" if len(sample.strata) > 1 else ""
    enough = f"{needed} runs without a failure{where} would" if needed is not None else "very many runs would"
    return f"{text}; success in {_percent(asked)} of runs, {what}, is not shown: {enough}"


def counterexample(claim: Claim, failed: Sequence[tuple[Run, Judged]]) -> Counterexample:
    run, one = failed[0]
    if run.verdicts:
        about = (("run", run.name), *run.rows[0].items(), *one.shown)
        return Counterexample(about, f"guarantee {claim.holds.name} does not hold in this simulated run: {one.why}")
    steps = [tuple((_port(name), show(value)) for name, value in step.items()) for step in run.steps]
    at = one.broken or 0
    names = listed([run.name for run, _ in failed], FAILURES_SHOWN)
    explanation = f"guarantee {claim.holds.name} does not hold in run {names}"
    return Counterexample((("run", run.name), *steps[at]), explanation, tuple(steps[: at + 1]) if at else ())


def _port(name: str) -> str:
    return name.removeprefix("in.column ").removeprefix("out.column ")


def _word(claim: Claim, one: Judged) -> str:
    if one.excused:
        return "breaks an assumption"
    if one.broken is not None:
        return one.lost or "failed"
    if one.undecided:
        return "undecided"
    if one.open:
        return "ends before an answer"
    return "ok" if (one.met if claim.conditions else one.asked) else "not triggered"


def _row(stratum: Stratum) -> dict[str, Any]:
    return {
        "name": stratum.name,
        "trials": stratum.trials,
        "failures": stratum.failures,
        "bound": stratum.bound,
        "confidence": stratum.confidence,
        "trial": stratum.trial.value,
    }


# -- runs that failed before ------------------------------------------------------------------------------------------


def _held_against(
    outcome: Outcome, claim: Claim, experiment: Experiment, kept: Iterable[Sequence[Mapping[str, Any]]]
) -> Outcome:
    """The outcome, but `unknown` if runs that failed before are missing, unless the plan gives a reason for leaving
    each out. That is then an assumption."""
    if outcome.verdict in (Verdict.REFUTED, Verdict.ERROR):
        return outcome
    missing = dict.fromkeys(
        run["run"] for case in kept for run in case if _fails(run, claim, experiment) and not _is_there(run, experiment)
    )
    if not missing:
        return outcome
    if left := [name for name in missing if name not in experiment.left_out]:
        shown = listed(left, FAILURES_SHOWN)
        why = f"runs that failed before are missing in the data: {shown}; put them back, or name them under 'left_out'"
        return replace(outcome, verdict=Verdict.UNKNOWN, summary=why, hypotheses=(), vacuous=False)
    text = f"that run {listed(list(missing), FAILURES_SHOWN)} failed does not count: {experiment.because}"
    return replace(outcome, hypotheses=(*outcome.hypotheses, text))


def _fails(run: Mapping[str, Any], claim: Claim, experiment: Experiment) -> bool:
    """Whether a kept run violates the guarantee as it is now; so does one whose cells give no values, or that has to be
    simulated again."""
    try:
        return experiment.replayed is not None or judged(claim, experiment.values(run["rows"])).broken is not None
    except (Unfit, KeyError):
        return True


def _is_there(kept: Mapping[str, Any], experiment: Experiment) -> bool:
    """Whether a kept run is among the data, under its name and with the same measurements; in a campaign, with the same
    seed and scenario."""
    own = experiment.replayed is not None
    runs = (*experiment.runs, *(experiment.replayed or ()))
    return any(
        (own or run.name == kept["run"]) and _same(kept.get("rows", ()), run.rows, experiment.computed) for run in runs
    )


def _same(before: Sequence[Mapping[str, str]], now: Sequence[Mapping[str, str]], computed: frozenset[str]) -> bool:
    return len(before) == len(now) and all(
        all(one[column] == other[column] for column in one.keys() & other.keys() - computed)
        for one, other in zip(before, now, strict=True)
    )


# -- numbers for people -----------------------------------------------------------------------------------------------


def _decimal(value: Fraction) -> str:
    text = decimal(value)
    assert text is not None  # bounds and confidences are decimals
    return text


def _percent(value: Fraction) -> str:
    """Four decimals, never rounded up."""
    return f"{decimal(Fraction(value * 10**6 // 1, 10**4))} %"

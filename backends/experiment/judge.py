"""From runs, or from printed figures, to a verdict, and the words for it: an outcome, without its obligation.

A refutation by data is forgotten by deleting their lines. So failing runs are kept in the ledger
(`avow.evidence.record.CASE`), and who leaves one out has to say why.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from avow.base.plain import listed
from avow.base.verdict import Counterexample, Outcome, Verdict

from .figures import Figures, contradictions, failures
from .options import Experiment
from .quantity import decimal, show
from .runs import Run
from .statistics import justified, lower_bound, root, runs_needed, upper_bound
from .tuning import FAILURES_KEPT, FAILURES_SHOWN


def judge_runs(runs: Sequence[Run], experiment: Experiment) -> Outcome:
    """Whether the runs show the claim: no failure at all, or (with `at_least`) few enough of them."""
    failed = [run for run in runs if exceeds(run, experiment)]
    runs = _counted(runs, experiment)
    undecided = [run for run in runs if not exceeds(run, experiment) and not _within(run, experiment)]
    details = _statistics(runs, experiment)
    if undecided:
        why = f"run {undecided[0].name} is too close to the tolerance to compare"
        return _unknown(why, _bound(len(failed), len(runs), experiment), details)
    return _verdict(len(failed), len(runs), experiment, details, _counterexample(failed, experiment))


def exceeds(run: Run, experiment: Experiment) -> bool:
    """Whether a run certainly fails: beyond the tolerance, or at it where the guarantee is strict."""
    return run.measure.low > experiment.within or (experiment.strict and run.measure.low == experiment.within)


def _within(run: Run, experiment: Experiment) -> bool:
    return run.measure.high < experiment.within or (not experiment.strict and run.measure.high == experiment.within)


def _counted(runs: Sequence[Run], experiment: Experiment) -> tuple[Run, ...]:
    """Every failing run, and of the others those that measured something new: a copied line shows nothing, whatever its
    other cells say."""
    new: dict[object, Run] = {}
    for run in runs:
        new.setdefault(run.line if exceeds(run, experiment) else run.measured, run)
    return tuple(new.values())


def judge_figures(figures: Figures, experiment: Experiment) -> Outcome:
    """Whether printed figures are possible at all, and whether they show the claim."""
    wrong = contradictions(figures)
    fewest, most = failures(figures, experiment.within, experiment.strict)
    unit = _unit(figures.unit)
    tolerance = f"{show(experiment.within)}{unit}"
    details: dict[str, object] = {"figures": dict(figures.printed), "contradictions": list(wrong)}
    if figures.source:
        details["source"] = figures.source
    if experiment.protocol:
        details["protocol"] = experiment.protocol
    details["failures"] = {"at least": fewest, "at most": most}
    bound = _bound(fewest, figures.runs, experiment)
    if fewest and _claim_fails(fewest, figures.runs, experiment):
        why = _why_failed(figures, fewest, most, tolerance)
        explanation = "; ".join((why, *(f"the figures also contradict each other: {w}" for w in wrong)))
        values = tuple(
            (name, text if not text[-1:].isdigit() else f"{text}{unit}") for name, text in figures.printed.items()
        )
        example = Counterexample((("n", str(figures.runs)), *values), explanation)
        return Outcome("", Verdict.REFUTED, why, example, bound=bound, details=details)
    if wrong:
        why = f"the figures cannot all be true: {'; '.join(wrong)}"
        return Outcome("", Verdict.ERROR, why, bound=bound, details=details)
    rests = ("the printed figures are true: the runs themselves were not examined",)
    if most > fewest:
        why = f"the figures leave open how many of the {figures.runs} runs exceeded {tolerance}: {fewest} to {most}"
        return replace(_unknown(why, bound, details), hypotheses=rests)
    judged = _verdict(fewest, figures.runs, experiment, details, None)
    return replace(judged, hypotheses=rests + judged.hypotheses)


def _unknown(why: str, bound: dict[str, object], details: dict[str, object]) -> Outcome:
    return Outcome("", Verdict.UNKNOWN, why, bound=bound, details=details)


def _verdict(
    failed: int, runs: int, experiment: Experiment, details: dict[str, object], example: Counterexample | None
) -> Outcome:
    bound = _bound(failed, runs, experiment)
    tolerance = f"{show(experiment.within)}{_unit(experiment.unit)}"
    good = f"{runs - failed} of {runs} runs within {tolerance}"
    most = _percent_up(upper_bound(failed, runs, experiment.confidence))
    shown = f"failure probability at most {most} at {_percent(experiment.confidence)} confidence"
    if failed and _claim_fails(failed, runs, experiment):
        why = f"{failed} of {runs} runs exceeded {tolerance}"
        return Outcome("", Verdict.REFUTED, why, example, bound=bound, details=details)
    claim = experiment.at_least
    needed = runs_needed(1 - (claim or experiment.floor), experiment.confidence)
    if claim is None and not justified(0, runs, 1 - experiment.floor, experiment.confidence):
        least = f"success in {_percent(experiment.floor)} of runs, the least that this criticality asks for"
        return _unknown(f"{good}, but so few runs do not even show {least}: {needed} are needed", bound, details)
    if claim is not None and not justified(failed, runs, 1 - claim, experiment.confidence):
        why = f"which does not show success in {_percent(claim)} of runs; {needed} runs without a failure would"
        return _unknown(f"{good}: {shown}, {why}", bound, details)
    rests = ["the runs are independent and drawn as the robot will be used"]
    if experiment.supposed:
        rests.append(experiment.supposed)
    if failed:
        details["failing runs"] = example.explanation if example else f"{failed}"
        rests.append(f"the guarantee is meant statistically: in at least {_percent(claim or Fraction(0))} of runs")
    return Outcome("", Verdict.TESTED, f"{good}: {shown}", None, tuple(rests), bound, details)


def _claim_fails(failed: int, runs: int, experiment: Experiment) -> bool:
    """Failures refute the guarantee, unless the plan claims a rate of success and the runs show that rate."""
    return failed > 0 and (
        experiment.at_least is None or not justified(failed, runs, 1 - experiment.at_least, experiment.confidence)
    )


def _bound(failed: int, runs: int, experiment: Experiment) -> dict[str, object]:
    return {
        "runs": runs,
        "failures": failed,
        "confidence": float(experiment.confidence),
        "failure probability at most": _rounded_up(upper_bound(failed, runs, experiment.confidence)),
        "failure probability at least": float(
            int(lower_bound(failed, runs, experiment.confidence) * 100_000) / 100_000
        ),
        "within": f"{show(experiment.within, 9)}{_unit(experiment.unit)}",
    } | ({"claimed success": float(experiment.at_least)} if experiment.at_least is not None else {})


def _statistics(runs: Sequence[Run], experiment: Experiment) -> dict[str, object]:
    """Figures of the measure; roots are taken to 12 digits."""
    values = [run.measure.low for run in runs]
    n = len(values)
    mean = sum(values, Fraction(0)) / n
    squares = sum(((v - mean) ** 2 for v in values), Fraction(0))
    ordered = sorted(values)
    median = (ordered[(n - 1) // 2] + ordered[n // 2]) / 2
    details: dict[str, object] = {
        "measure": experiment.measure.text if experiment.measure else "",
        "unit": experiment.unit,
        "n": n,
        "mean": show(mean),
        "median": show(median),
        "min": show(min(values)),
        "max": show(max(values)),
        "sd": show(root(squares / (n - 1))[0]) if n > 1 else "",
    }
    if experiment.protocol:
        details["protocol"] = experiment.protocol
    return details


def _counterexample(failed: Sequence[Run], experiment: Experiment) -> Counterexample | None:
    if not failed:
        return None
    worst = max(failed, key=lambda run: run.measure.low)
    unit = _unit(experiment.unit)
    runs = listed([f"{run.name} ({show(run.measure.low)}{unit})" for run in failed], FAILURES_SHOWN)
    explanation = f"beyond {show(experiment.within, 9)}{unit} in run {runs}"
    measure = (experiment.measure.text if experiment.measure else "measure", f"{show(worst.measure.low, 6)}{unit}")
    pairs = (("run", worst.name), *worst.values, measure)
    return Counterexample(tuple(dict(pairs).items()), explanation)


def _why_failed(figures: Figures, fewest: int, most: int, tolerance: str) -> str:
    unit = _unit(figures.unit)
    count = f"at least {fewest}" if most > fewest else str(fewest)
    worst = f": the worst is printed as {figures.printed['max']}{unit}" if "max" in figures.printed else ""
    if "max" in figures.printed and not figures.printed["max"][-1:].isdigit():
        worst = f": the worst is printed as {figures.printed['max']}"
    return f"{count} of {figures.runs} runs exceeded {tolerance}{worst}"


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _percent(value: Fraction) -> str:
    return f"{show(value * 100, 3)} %"


def _percent_up(value: Fraction) -> str:
    """One decimal, never rounded down."""
    return f"{show(Fraction(-(-value * 1000 // 1), 10), 1)} %"


def _rounded_up(value: Fraction) -> float:
    return float(-(-value * 100_000 // 1)) / 100_000


# Runs that failed once


def failing(runs: Sequence[Run], experiment: Experiment) -> list[dict[str, Any]]:
    """The runs that failed, as they are kept; of very many the first."""
    failed = [run for run in runs if exceeds(run, experiment)][:FAILURES_KEPT]
    return [
        {"run": r.name, "cells": dict(r.values), "measure": str(r.measure.low), "unit": experiment.unit} for r in failed
    ]


def held_against(
    judged: Outcome, runs: Sequence[Run], experiment: Experiment, kept: Iterable[Sequence[dict[str, Any]]]
) -> Outcome:
    """What is judged of the data as they are, where runs that failed before are missing: `unknown`, unless the plan
    says of each why it is left out, for which somebody has to stand."""
    missing: dict[str, None] = {}
    for case in kept:
        for run in case:
            if _fails(run, experiment) and not any(_is(run, other) for other in runs):
                missing[run["run"]] = None
    if not missing or judged.verdict in (Verdict.REFUTED, Verdict.ERROR):
        return judged
    named = set(experiment.left_out)
    if left := [name for name in missing if name not in named]:
        shown = listed(left, FAILURES_SHOWN)
        why = (
            f"runs that failed before are no longer among the data: {shown}; put them back, or say under 'left_out' "
            "which are left out and why"
        )
        return replace(judged, verdict=Verdict.UNKNOWN, summary=why, hypotheses=())
    said = f"that run {listed(list(missing), FAILURES_SHOWN)} failed does not count: {experiment.because}"
    return replace(judged, hypotheses=(*judged.hypotheses, said))


def _fails(run: dict[str, Any], experiment: Experiment) -> bool:
    """Whether a kept run fails by the tolerance of today; measured in another unit: yes."""
    low = Fraction(run["measure"])
    beyond = low > experiment.within or (experiment.strict and low == experiment.within)
    return beyond or run["unit"] != experiment.unit


def _is(kept: dict[str, Any], run: Run) -> bool:
    """Whether it is this run: the same was measured; where the measure reads other columns now, the same in those that
    it read before, under the same name."""
    before, now = kept["cells"], dict(run.values)
    common = before.keys() & now.keys()
    same = bool(common) and all(decimal(before[column]) == decimal(now[column]) for column in common)
    return same and (before.keys() == now.keys() or kept["run"] == run.name)

"""From runs, or from printed figures, to a verdict, and the words for it."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from avow.base.plain import listed
from avow.base.records import dataclass
from avow.base.verdict import Counterexample, Verdict

from .figures import Figures, contradictions, failures
from .options import Experiment
from .quantity import show
from .runs import Run
from .statistics import justified, lower_bound, root, runs_needed, upper_bound
from .tuning import FAILURES_SHOWN


@dataclass(frozen=True, slots=True)
class Judgement:
    verdict: Verdict
    summary: str
    bound: dict[str, object]
    details: dict[str, object]
    counterexample: Counterexample | None = None
    hypotheses: tuple[str, ...] = ()


def judge_runs(runs: Sequence[Run], experiment: Experiment) -> Judgement:
    """Whether the runs show the claim: no failure at all, or (with `at_least`) few enough of them."""
    failed = [run for run in runs if exceeds(run, experiment)]
    runs = _counted(runs, experiment)
    undecided = [run for run in runs if not exceeds(run, experiment) and not _within(run, experiment)]
    details = _statistics(runs, experiment)
    if undecided:
        return Judgement(
            Verdict.UNKNOWN,
            f"run {undecided[0].name} is too close to the tolerance to compare",
            _bound(len(failed), len(runs), experiment),
            details,
        )
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


def judge_figures(figures: Figures, experiment: Experiment) -> Judgement:
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
        return Judgement(
            Verdict.REFUTED, why, bound, details, Counterexample((("n", str(figures.runs)), *values), explanation)
        )
    if wrong:
        return Judgement(Verdict.ERROR, f"the figures cannot all be true: {'; '.join(wrong)}", bound, details)
    rests = ("the printed figures are true: the runs themselves were not examined",)
    if most > fewest:
        return Judgement(
            Verdict.UNKNOWN,
            f"the figures leave open how many of the {figures.runs} runs exceeded {tolerance}: {fewest} to {most}",
            bound,
            details,
            hypotheses=rests,
        )
    judged = _verdict(fewest, figures.runs, experiment, details, None)
    return Judgement(
        judged.verdict, judged.summary, judged.bound, judged.details, judged.counterexample, rests + judged.hypotheses
    )


def _verdict(
    failed: int, runs: int, experiment: Experiment, details: dict[str, object], example: Counterexample | None
) -> Judgement:
    bound = _bound(failed, runs, experiment)
    tolerance = f"{show(experiment.within)}{_unit(experiment.unit)}"
    good = f"{runs - failed} of {runs} runs within {tolerance}"
    confidence = _percent(experiment.confidence)
    shown = f"failure probability at most {_percent_up(_upper(failed, runs, experiment))} at {confidence} confidence"
    if failed and _claim_fails(failed, runs, experiment):
        return Judgement(Verdict.REFUTED, f"{failed} of {runs} runs exceeded {tolerance}", bound, details, example)
    claim = experiment.at_least
    needed = runs_needed(1 - (claim or experiment.floor), experiment.confidence)
    if claim is None and not justified(0, runs, 1 - experiment.floor, experiment.confidence):
        return Judgement(
            Verdict.UNKNOWN,
            f"{good}, but so few runs do not even show success in {_percent(experiment.floor)} of runs, the least that "
            f"this criticality asks for: {needed} are needed",
            bound,
            details,
        )
    if claim is not None and not justified(failed, runs, 1 - claim, experiment.confidence):
        return Judgement(
            Verdict.UNKNOWN,
            f"{good}: {shown}, which does not show success in {_percent(claim)} of runs; "
            f"{needed} runs without a failure would",
            bound,
            details,
        )
    rests = ["the runs are independent and drawn as the robot will be used"]
    if experiment.supposed:
        rests.append(experiment.supposed)
    if failed:
        details["failing runs"] = example.explanation if example else f"{failed}"
        rests.append(f"the guarantee is meant statistically: in at least {_percent(claim or Fraction(0))} of runs")
    return Judgement(Verdict.TESTED, f"{good}: {shown}", bound, details, hypotheses=tuple(rests))


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
        "failure probability at most": _rounded_up(_upper(failed, runs, experiment)),
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


def _upper(failed: int, runs: int, experiment: Experiment) -> Fraction:
    return upper_bound(failed, runs, experiment.confidence)


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def _percent(value: Fraction) -> str:
    return f"{show(value * 100, 3)} %"


def _percent_up(value: Fraction) -> str:
    """One decimal, never rounded down."""
    return f"{show(Fraction(-(-value * 1000 // 1), 10), 1)} %"


def _rounded_up(value: Fraction) -> float:
    return float(-(-value * 100_000 // 1)) / 100_000

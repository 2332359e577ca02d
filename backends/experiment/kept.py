"""Runs that failed once and are no longer among the data. A refutation by data is forgotten by deleting their lines, so
failing runs are kept in the ledger (`avow.evidence.record.CASE`), and who leaves one out has to say why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from avow.base.plain import listed
from avow.base.verdict import Verdict

from .judge import Judgement, exceeds
from .options import Experiment
from .quantity import decimal
from .runs import Run
from .tuning import FAILURES_KEPT, FAILURES_SHOWN


def failing(runs: Sequence[Run], experiment: Experiment) -> list[dict[str, Any]]:
    """The runs that failed, as they are kept; of very many the first."""
    failed = [run for run in runs if exceeds(run, experiment)][:FAILURES_KEPT]
    return [
        {"run": r.name, "cells": dict(r.values), "measure": str(r.measure.low), "unit": experiment.unit} for r in failed
    ]


def held_against(
    judged: Judgement, runs: Sequence[Run], experiment: Experiment, kept: Iterable[Sequence[dict[str, Any]]]
) -> Judgement:
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

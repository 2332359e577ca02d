"""The experiment backend: measured runs, or the printed figures of an experiment, as evidence for a guarantee."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from avow.backend_kit.given import file_path, told
from avow.backend_kit.protocol import Backend, Job, Limits, Report
from avow.base.codec import document
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.verdict import Link, Object, Outcome, Verdict
from avow.evidence.record import CASE

from .codes import CODES
from .figures import Figures, read_figures
from .judge import exceeds, failing, held_against, judge_figures, judge_runs
from .options import SCHEMA, Experiment, read
from .quantity import show
from .runs import Run, Runs, read_runs


class ExperimentBackend(Backend):
    """See `docs/backends/experiment.md`."""

    name = "experiment"
    title = "measured runs, judged by exact binomial statistics"
    version = "4"
    strength = Verdict.TESTED
    uses_scenario = False
    uses_criticality = True
    uses_wiring = False
    link = Link.GUIDED
    of = Object.RECORDING
    options_schema = SCHEMA
    codes = CODES
    green_means = (
        "The runs in the data set stayed within the stated tolerance, often enough for the stated confidence. "
        "It shows nothing of other conditions; that the measure is what the guarantee means is a person's judgement."
    )

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        experiment, problems = read(job)
        if experiment is None:
            return problems
        try:
            material = _material(experiment)
        except Rejected as error:
            return error.diagnostics
        return material.warnings if isinstance(material, Runs) else ()

    def files(self, job: Job) -> tuple[Path, ...]:
        """Whatever the options name, also where they are not in order."""
        return tuple(path for key in ("data", "summary") if (path := file_path(job, key)) is not None)

    def export(self, job: Job) -> Mapping[str, str]:
        """The claim as it will be judged, in exact numbers."""
        experiment, problems = read(job)
        if experiment is None:
            raise Rejected(*problems)
        source = experiment.data or experiment.summary
        claim = {
            "guarantees": {o.name: o.formula for o in job.obligations},
            "source": source.relative_to(job.root.resolve()).as_posix() if source else "",
            "measure": experiment.measure.text if experiment.measure else "",
            "within": str(experiment.within),
            "strict": experiment.strict,
            "unit": experiment.unit,
            "confidence": str(experiment.confidence),
            "at_least": str(experiment.at_least) if experiment.at_least is not None else None,
            "floor": str(experiment.floor),
            "supposed": experiment.supposed,
            "protocol": experiment.protocol,
        }
        return {"claim.json": document(claim) + "\n"}

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        experiment, problems = read(job)
        found, runs, logs = _settle(job, experiment, problems)
        outcomes = []
        for o in job.obligations:
            kept = job.kept.get(o.id, ())
            judged = held_against(found, runs, experiment, kept) if experiment is not None else found
            outcomes.append(replace(judged, obligation=o.id, link=self.link))
        return Report(tuple(outcomes), "avow experiment", self.version, logs=logs)


def _settle(
    job: Job, experiment: Experiment | None, problems: tuple[Diagnostic, ...]
) -> tuple[Outcome, tuple[Run, ...], dict[str, str]]:
    try:
        if experiment is None:
            raise Rejected(*problems)
        material = _material(experiment)
    except Rejected as error:
        why = f"the experiment cannot be judged: {told(job, error.diagnostics)}"
        return Outcome("", Verdict.ERROR, why), (), {}
    if isinstance(material, Figures):
        return judge_figures(material, experiment), (), {}
    judgement = judge_runs(material.runs, experiment)
    if judgement.verdict is Verdict.REFUTED:
        judgement.details[CASE] = failing(material.runs, experiment)
    if material.warnings:
        judgement.details["warnings"] = [told(job, [d]) for d in material.warnings[:20]]
    lines = [
        f"{run.name}\t{show(run.measure.low, 9)}\t{'failed' if exceeds(run, experiment) else 'ok'}"
        for run in material.runs
    ]
    return judgement, material.runs, {"measures.tsv": "\n".join(["run\tmeasure\tverdict", *lines]) + "\n"}


def _material(experiment: Experiment) -> Runs | Figures:
    if experiment.data is not None and experiment.measure is not None:
        return read_runs(experiment.data, experiment.measure, experiment.id_column)
    assert experiment.summary is not None
    return read_figures(experiment.summary, experiment.unit)

"""The experiment backend: recorded runs as evidence, each judged by the guarantee's own formula."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from avow.backend_kit.given import file_path, summarized
from avow.backend_kit.one_step import unsaid
from avow.backend_kit.protocol import Backend, Job, Limits, Opens, Report, Tool
from avow.base.codec import document
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import inside
from avow.base.tools import onnxruntime_tool
from avow.base.verdict import Link, Object, Verdict
from avow.language.contract import Clause, Node

from .campaign import NotMade, drawn, experiment, monitored, recorded, regressions
from .further import contradictions, of_campaign
from .network import Missing
from .options import SCHEMA, read
from .profile import Campaign, command_files, read_campaign, regressions_of
from .verdict import settle


class ExperimentBackend(Backend):
    """See `docs/backends/experiment.md`."""

    name = "experiment"
    title = "recorded runs, judged by the guarantee and exact binomial statistics"
    version = "13"
    strength = Verdict.TESTED
    remembers = True
    chances = True
    uses_scenario = False
    uses_criticality = True
    uses_wiring = False
    link = Link.MAPPED
    of = Object.RECORDING
    campaigns = "campaign"
    options_schema = SCHEMA
    codes = Catalogue("avow.backends.experiment")
    green_means = (
        "The runs in the data that met the guarantee's condition met the guarantee, often enough for the stated "
        "confidence. It shows nothing of other conditions, and that the columns are the ports is a person's word."
    )

    def unsaid(self, node: Node, clause: Clause) -> str | None:
        return unsaid(self.name, node, clause)

    def opens(self, job: Job) -> Opens:
        return Opens.ANY

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        try:
            if (campaign := _campaign(job)) is None:
                read(job)
            else:
                monitored(job, campaign)
                experiment(job, (), ())  # the options of the claim
                regressions(campaign)
                drawn(campaign)
        except Rejected as error:
            return error.diagnostics
        except NotMade:  # the verdict says so
            pass
        return ()

    def tools(self) -> tuple[Tool, ...]:
        return (onnxruntime_tool(),)

    def files(self, job: Job) -> tuple[Path, ...]:
        path, network = file_path(job, "data"), job.options.get("network", {})
        if path is None or "campaign" not in job.options:
            named = inside(job.root, str(network["file"])) if isinstance(network, dict) and "file" in network else None
            return tuple(each for each in (path, named) if each is not None)
        recordings = path.with_suffix("")
        made = (p for p in sorted(recordings.rglob("*")) if p.is_file()) if recordings.is_dir() else ()
        return (path, regressions_of(path), *command_files(job), *made)

    def export(self, job: Job) -> Mapping[str, str]:
        """The claim as it will be judged; empty if options or data have errors."""
        try:
            if _campaign(job) is not None:
                return {"claim.json": document(_claim(job)) + "\n"}
            found = read(job)
        except Rejected:
            return {}
        chances = {o.name: str(c.least) for o in job.obligations if (c := job.clause(o).chance) is not None}
        claim = (
            _claim(job)
            | ({"probabilities": chances} if chances else {})
            | {
                "conditions": {name: [c.name for c in claim.conditions] for name, claim in found.claims.items()},
                "least success rate": str(found.at_least or found.floor),
            }
        )
        return {"claim.json": document(claim) + "\n"}

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        try:
            campaign = _campaign(job)
            found = read(job, run=True) if campaign is None else recorded(job, campaign)
        except Missing as missing:
            return Report.alike(job, Verdict.NOT_RUN, str(missing), "avow experiment", self.version)
        except NotMade as state:
            verdict, why = state.args
            why = f"{why}: `avow campaign {job.system.name} {job.node.name}` makes the runs"
            return Report.alike(job, verdict, why, "avow experiment", self.version)
        except Rejected as error:
            why = f"the experiment cannot be judged: {summarized(job, error.diagnostics)}"
            return Report.alike(job, Verdict.ERROR, why, "avow experiment", self.version)
        outcomes, logs = [], {}
        for o in job.obligations:
            outcome, logs[f"{o.name}.tsv"] = settle(o.name, found, job.kept.get(o.id, ()))
            # the meaning of a part of the contract in terms of columns is a person's judgement
            link = Link.GUIDED if found.claims[o.name].interpreted else self.link
            of = self.of if campaign is None and "network" not in job.options else Object.MODEL
            outcomes.append(replace(outcome, obligation=o.id, link=link, of=of))
        beyond = contradictions(job, found) if campaign is None else of_campaign(job, campaign, found)
        return Report(tuple(outcomes), "avow experiment", self.version, logs=logs, contradicted=tuple(beyond))


def _campaign(job: Job) -> Campaign | None:
    """Raises Rejected."""
    return read_campaign(job, file_path(job, "data")) if "campaign" in job.options else None


def _claim(job: Job) -> dict[str, object]:
    return {"guarantees": {o.name: o.formula for o in job.obligations}, "options": job.options}

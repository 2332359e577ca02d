"""A backend of a third party: recorded answers of a node, a row each, held against its guarantees.

`rows: {answers: answers.csv}` names a file with a column for each input and output (``in.r``, ``out.high``); a row is a
case.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

from avow.backend_kit.given import existing_file, file_path, summarized
from avow.backend_kit.protocol import Backend, Job, Limits, Report
from avow.base.codes import declare, register
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.verdict import Counterexample, Link, Outcome, Verdict
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Value

CODES = register(
    declare(
        "ROWS101", "no rows", "The plan names no file of the system's folder.", "Add `rows: {answers: answers.csv}`."
    ),
    declare("ROWS102", "unreadable rows", "The file is not there, or is no table of this node.", "See its first line."),
)
WORDS: Mapping[str, Value] = {"true": True, "false": False}


class Rows(Backend):
    """A claim is `tested` where every row meets it, and `refuted` by the first row that does not."""

    name = "rows"
    title = "recorded answers, a row each"
    version = "1"
    strength = Verdict.TESTED
    link = Link.GUIDED
    codes = CODES
    uses_scenario = False
    uses_wiring = False
    options_schema = {
        "type": "object",
        "properties": {"answers": {"type": "string"}},
        "required": ["answers"],
        "additionalProperties": False,
    }
    green_means = (
        "The guarantee holds in every recorded row that meets the assumptions. It says nothing of other inputs."
    )

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        try:
            read(job)
        except Rejected as rejected:
            return rejected.diagnostics
        return ()

    def files(self, job: Job) -> tuple[Path, ...]:
        path = file_path(job, "answers")
        return (path,) if path is not None else ()

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        try:
            rows = read(job)
        except Rejected as rejected:
            return Report.alike(job, Verdict.ERROR, summarized(job, rejected.diagnostics), "rows", self.version)
        try:
            allowed = [row for row in rows if all(evaluate(a.formula, row) is True for a in job.node.assumptions)]
            outcomes = tuple(judged(job, o.id, o.name, allowed) for o in job.obligations)
        except NotEvaluable as problem:
            return Report.alike(job, Verdict.UNKNOWN, f"a row cannot be judged: {problem}", "rows", self.version)
        return Report(outcomes, "rows", self.version)


def read(job: Job) -> list[dict[str, Value]]:
    """The rows, as values of the node's ports. Raises Rejected."""
    path = existing_file(job, "answers", str(job.options.get("answers") or ""), wrong="ROWS101", absent="ROWS102")
    names = [port.variable.qualified for port in (*job.node.inputs, *job.node.outputs)]
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return [{name: value(row[name]) for name in names} for row in csv.DictReader(file, strict=True)]
    except (OSError, ValueError, KeyError, AttributeError, ZeroDivisionError, csv.Error) as error:
        place = job.method.options.at("answers")
        raise Rejected(Diagnostic("ROWS102", f"{path.name} is no table of {job.node.name}: {error}", place)) from None


def value(text: str) -> Value:
    """A cell: a truth value or a number. Raises ValueError."""
    word = text.strip().lower()
    return WORDS[word] if word in WORDS else Fraction(word)


def judged(job: Job, obligation: str, name: str, rows: list[dict[str, Value]]) -> Outcome:
    formula = job.node.clause(name).formula
    for number, row in enumerate(rows, start=1):
        if evaluate(formula, row) is not True:
            shown = Counterexample(tuple((k, str(v)) for k, v in row.items()), f"row {number} breaks {name}")
            return Outcome(obligation, Verdict.REFUTED, shown.text(), shown, bound={"cases": len(rows)})
    if not rows:
        return Outcome(obligation, Verdict.UNKNOWN, "no row meets the assumptions")
    return Outcome(obligation, Verdict.TESTED, f"{len(rows)} rows meet it", bound={"cases": len(rows)})


BACKEND = Rows()

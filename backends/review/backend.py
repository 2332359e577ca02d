"""The review backend: a person's recorded review as evidence, as long as nothing that was reviewed has changed."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from avow.backend_kit.given import existing_file, file, schema, summarized
from avow.backend_kit.protocol import Backend, Job, Limits, Opens, Report
from avow.base.codec import document
from avow.base.codes import Catalogue
from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.files import inside
from avow.base.suggestions import suggest
from avow.base.verdict import Counterexample, Link, Outcome, Verdict
from avow.evidence.envelope import Opened
from avow.evidence.obligation import Obligation
from avow.evidence.record import SIGNED_BY
from avow.evidence.signing import signature_path

from .record import CONCLUSIONS, Judged, Record, current_meaning, read_record, stale_clause, stale_files
from .signature import signed

_KEY = {
    "type": ["string", "array"],
    "items": {"type": "string"},
    "minItems": 1,
    "description": "public keys (PEM, in the system's folder), one of which has to have signed the record",
}


class ReviewBackend(Backend):
    """See `docs/backends/review.md`."""

    name = "review"
    title = "a person's recorded review, stale as soon as what was read changes"
    version = "1"
    strength = Verdict.REVIEWED
    uses_scenario = False
    uses_wiring = False
    portable = True
    remembers = True  # a person judges; no formula is read
    link = Link.GUIDED
    options_schema = schema(
        {"record": file("YAML record of the review"), "key": _KEY},
        "record",
        type=["object", "string"],
        description="the record's path, or the record's path under the key 'record'",
    )
    codes = Catalogue("avow.backends.review")
    green_means = (
        "A named person read exactly these files, answered every question of the checklist and accepted this "
        "guarantee in exactly this meaning. It shows what that person saw, no more."
    )

    def opens(self, job: Job) -> Opens:
        return Opens.ANY

    def check(self, job: Job) -> tuple[Diagnostic, ...]:
        try:
            record, path = _read(job)
            signature = signed(path, record, _keys(job))
        except Rejected as error:
            return error.diagnostics
        if not isinstance(signature, str):
            return ()
        return (Diagnostic("REV104", f"the review does not count: {signature}", record.span, Severity.WARNING),)

    def files(self, job: Job) -> tuple[Path, ...]:
        """The record, its signature, the keys that may have signed it, and all files that were read."""
        name = record_name(job)
        path = inside(job.root, name) if name else None
        if path is None:
            return ()
        others = [inside(job.root, key) for key in _key_names(job)]
        with contextlib.suppress(Rejected):
            others += [inside(job.root, r.file) for r in read_record(path).read if r.file]
        others += [place for place in (signature_path(path),) if place.exists() or _key_names(job)]
        return tuple(dict.fromkeys((path, *(p for p in others if p is not None))))

    def export(self, job: Job) -> Mapping[str, str]:
        """The guarantees that a reviewer has to judge, each with the digest of its meaning."""
        claims = {
            o.name: {"claim": o.claim, "formula": o.formula, "meaning": current_meaning(job.node, o.name)}
            for o in job.obligations
        }
        return {"to-review.json": document({"clauses": claims}) + "\n"}

    def discharge(self, job: Job, folder: Path, limits: Limits) -> Report:
        try:
            record, path = _read(job)
            signature = signed(path, record, _keys(job))
        except Rejected as error:
            why = f"the review cannot be used: {summarized(job, error.diagnostics)}"
            return Report.alike(job, Verdict.ERROR, why, "avow review", self.version)
        return Report(tuple(_settle(job, record, signature, o) for o in job.obligations), "avow review", self.version)


def record_name(job: Job) -> str | None:
    """The record that the plan names, in either spelling of the options."""
    data = job.method.options.data
    name = data.get("record") if isinstance(data, Mapping) else data
    return name if isinstance(name, str) and name else None


def _key_names(job: Job) -> tuple[str, ...]:
    data = job.method.options.data
    given = data.get("key", ()) if isinstance(data, Mapping) else ()
    return tuple(name for name in ([given] if isinstance(given, str) else given) if isinstance(name, str))


def _keys(job: Job) -> tuple[Path, ...]:
    """The public keys that the plan names. Raises Rejected."""
    return tuple(existing_file(job, "key", name, wrong="REV101", absent="REV102") for name in _key_names(job))


def _read(job: Job) -> tuple[Record, Path]:
    """The record, checked against plan and contract, and its path. Raises Rejected."""
    problems = []
    path = existing_file(job, "record", record_name(job) or "", wrong="REV101", absent="REV102")
    record = read_record(path)
    if record.node and record.node != job.node.name:
        message = f"this is a review of node '{record.node}', not of '{job.node.name}'"
        problems.append(Diagnostic("REV103", message, record.span))
    if record.system and record.system != job.system.name:
        message = f"this is a review for system '{record.system}', not for '{job.system.name}'"
        problems.append(Diagnostic("REV103", message, record.span))
    known = [clause.name for clause in job.node.guarantees]
    for judged in record.clauses:
        if judged.clause not in known:
            message = f"node '{job.node.name}' has no guarantee '{judged.clause}'"
            problems.append(Diagnostic("REV103", message, judged.span, hint=suggest(judged.clause, known)))
    for reading in record.read:
        if reading.file is not None and inside(job.root, reading.file) is None:
            problems.append(
                Diagnostic("REV114", f"'{reading.file}' is not a file in the system's folder", reading.span)
            )
    if problems:
        raise Rejected(*problems)
    return record, path


def _settle(job: Job, record: Record, signature: Opened | str | None, obligation: Obligation) -> Outcome:
    judged = next((j for j in record.clauses if j.clause == obligation.name), None)
    # A guarantee's own conclusion can only be worse than the review's: a rejected review accepts nothing.
    own = judged.conclusion if judged and judged.conclusion else record.conclusion
    conclusion = max(own, record.conclusion, key=CONCLUSIONS.index)
    stale = list(stale_files(record, job.root))
    moved = stale_clause(record, job.node, obligation.name)
    if moved is not None:
        stale.append(moved)
    details = _details(record, judged)
    who = f"{record.reviewer} ({record.role}), {record.date}"
    if isinstance(signature, Opened):
        who += f", signed {signature.checked}"
        details[SIGNED_BY] = signature.key
    elsewhere = tuple(
        f"'{r.material}' was read and is not kept here: no change in it would be noticed"
        for r in record.read
        if r.material
    )
    verdict, summary = Verdict.REVIEWED, f"accepted by {who}"
    hypotheses = elsewhere
    example = None
    if stale:
        verdict, summary = Verdict.UNKNOWN, f"stale: {'; '.join(stale)}; read it again and date the record anew"
        if conclusion == "rejected":
            summary += " (it had been rejected)"
        details["stale"] = stale
        hypotheses = ()
    elif isinstance(signature, str) and conclusion != "rejected":  # a rejection counts without a signature
        verdict, summary, hypotheses = Verdict.UNKNOWN, f"the review does not count: {signature}", ()
    elif conclusion == "rejected":
        why = (judged.remark if judged else "") or record.remarks or _against(record)
        verdict, summary = Verdict.REFUTED, f"rejected by {who}"
        example = Counterexample((), why or "the reviewer gives no reason")
    elif conclusion == "conditional":
        summary = f"accepted on conditions by {who}"
        hypotheses = record.conditions + elsewhere
    return Outcome(obligation.id, verdict, summary, example, hypotheses, {}, details, Link.GUIDED)


def _details(record: Record, judged: Judged | None) -> dict[str, object]:
    details: dict[str, object] = {
        "reviewer": record.reviewer,
        "role": record.role,
        "date": record.date,
        "read": [{"file": r.file, "sha256": r.sha256} if r.file else {"material": r.material} for r in record.read],
        "checklist": [
            {"question": q.question, "answer": q.answer} | ({"note": q.note} if q.note else {})
            for q in record.checklist
        ],
        "conclusion": record.conclusion,
    }
    optional = {
        "valid_until": record.valid_until,
        "conditions": list(record.conditions),
        "remarks": record.remarks,
        "remark": judged.remark if judged else "",
    }
    return details | {key: value for key, value in optional.items() if value}


def _against(record: Record) -> str:
    return "; ".join(f"{q.question} {q.answer}: {q.note}" for q in record.checklist if not q.good)

"""The case for other programs: JSON, JUnit XML, SARIF 2.1.0, in-toto statements, gsn2x YAML."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any
from urllib.parse import quote

from avow.assurance.answers import EARLIER, Level
from avow.assurance.codec import to_json
from avow.assurance.model import Case, Gate, ObligationView, RequirementView
from avow.assurance.naming import sanity_property, short
from avow.assurance.summary import decisive
from avow.base import codec
from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.rendering import sarif_place
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.report.layout import Written, json_pieces, json_text
from avow.report.page import fill
from avow.report.parts import NOTHING_KEPT, Parts
from avow.report.wording import banner_tone, of_nodes, proof_runs, tone


def render_json(case: Case, parts: Parts = NOTHING_KEPT) -> bytes:
    """The whole case (schema: docs/schemas/case.schema.json)."""
    whole, begun = to_json(replace(case, obligations=(), proofs=())), Counter[str]()
    whole["proofs"] = [Written(parts.text(node, f"json {n}", _lines, run)) for node, n, run in proof_runs(case)]
    whole["obligations"] = []
    for node, run in groupby(case.obligations, key=lambda view: view.obligation.node):
        begin, end = begun[node], begun[node] + len(list(run))
        text = parts.text(node, f"json {begin}", _lines, of_nodes(case)[node], begin, end)
        whole["obligations"].append(Written(text))
        begun[node] = end
    return b"".join(piece.encode() for piece in (*json_pieces(whole), "\n"))


def _lines(items: Sequence[object], begin: int = 0, end: int | None = None) -> str:
    """Items of a list, as `json_pieces` has them."""
    return ",\n  ".join(json.dumps(codec.to_json(item)) for item in items[begin:end])


def _result_of(case: Case) -> str:
    """``PASSED``, ``WARNED`` or ``FAILED``. Known-bad material that is as bad as expected passes its gates and supports
    nothing: it must not count as ``PASSED``."""
    return "FAILED" if not case.good else "WARNED" if banner_tone(case) == "open" else "PASSED"


def _fails(view: ObligationView) -> bool:
    """Whether a claim is refuted, and the plan says nothing of it."""
    return tone(view.standing) == "bad" and not view.handled


# -- JUnit XML ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Row:
    """A test case of a suite; `outcome` is ``failure``, ``error``, ``skipped`` or empty: it passes."""

    group: str
    name: str
    outcome: str
    message: str = ""
    type: str = ""
    seconds: float = 0.0


def render_junit(case: Case, parts: Parts = NOTHING_KEPT) -> str:
    """A suite for the gates, one for the requirements, and one for each node. Refuted claims fail; claims that are not
    shown are skipped, never passed: the gates decide whether that matters."""
    groups = [("gates", list(map(_of_gate, case.gates)))]
    if case.requirements:
        groups.append(("requirements", [_of_requirement(r, case) for r in case.requirements]))
    properties = {"result": _result_of(case), "verdict": case.answers.told}
    suites = [_suite(case.system, name, rows, {} if at else properties) for at, (name, rows) in enumerate(groups)]
    suites += [parts.text(node, "junit", _of_node, case.system, own) for node, own in of_nodes(case).items()]
    outcomes = [*(row.outcome for _, rows in groups for row in rows), *map(_outcome, case.obligations)]
    return fill("junit.xml.j2", system=case.system, outcomes=outcomes, suites=suites)


def _of_node(system: str, views: Sequence[ObligationView]) -> str:
    return _suite(system, views[0].obligation.node, list(map(_of_claim, views)), {})


def _suite(system: str, name: str, rows: Sequence[_Row], properties: Mapping[str, str]) -> str:
    outcomes = [row.outcome for row in rows]
    return fill("suite.xml.j2", system=system, name=name, rows=rows, outcomes=outcomes, properties=properties)


def _of_gate(gate: Gate) -> _Row:
    if not gate.passed:
        return _Row("gates", gate.title, "failure", gate.reason, "gate")
    if gate.idle:
        return _Row("gates", gate.title, "skipped", "the policy asks nothing here")
    return _Row("gates", gate.title, "", gate.reason)


def _of_requirement(requirement: RequirementView, case: Case) -> _Row:
    message = f"{requirement.stands}: {requirement.answer}"
    if requirement.level is Level.REFUTED and not case.strict:
        return _Row("requirements", requirement.id, "failure", message, "refuted")
    return _Row("requirements", requirement.id, "" if requirement.level.holds else "skipped", message)


def _of_claim(view: ObligationView) -> _Row:
    o, message = view.obligation, f"{view.word}: {decisive(view)}"
    row = _Row(f"{o.node}.{o.kind}", o.name, _outcome(view), seconds=sum(r.seconds for r in view.records))
    match row.outcome:
        case "failure" | "error":
            return replace(row, message=message, type=view.standing.value)
        case "skipped":
            return replace(row, message=f"{view.handled}; {message}" if view.handled else message)
    return row


def _outcome(view: ObligationView) -> str:
    if _fails(view) and not view.advice:
        return "failure"
    return "error" if view.standing is Status.ERROR else "" if view.passes else "skipped"


# -- SARIF ----------------------------------------------------------------------------------------------------------


def render_sarif(case: Case, *, findings_only: bool = False) -> str:
    """SARIF 2.1.0, with locations in the contract. `findings_only` leaves out claims that hold."""
    views = [v for v in case.obligations if not findings_only or not v.standing.supports]
    rules = {_rule(view): _rule_text(view) for view in views}
    names = list(rules)
    run = {
        "tool": {
            "driver": {
                "name": "Avow",
                "version": case.run.avow_version,
                "informationUri": "https://avow.invalid/",
                "rules": [
                    {"id": name, "shortDescription": {"text": text}, "defaultConfiguration": {"level": "error"}}
                    for name, text in rules.items()
                ],
            }
        },
        "automationDetails": {"id": f"avow/{quote(case.system)}/{quote(case.run.id)}"},
        "columnKind": "unicodeCodePoints",
        "invocations": [{"executionSuccessful": case.exit_code != 3, "exitCode": case.exit_code}],
        "results": [_result(view, case, names) for view in views],
        "properties": {
            "system": case.system,
            "result": _result_of(case),
            "verdict": case.answers.told,
            "title": case.title,
            "proofs": case.grade.word,
            "ledgerHead": case.ledger_head,
        },
    }
    schema = "https://json.schemastore.org/sarif-2.1.0.json"
    return json_text({"$schema": schema, "version": "2.1.0", "runs": [run]}, depth=4)


def _rule(view: ObligationView) -> str:
    o = view.obligation
    return f"{o.kind}/{sanity_property(o)}" if o.kind is Kind.SANITY else o.kind.value


def _rule_text(view: ObligationView) -> str:
    texts = {
        Kind.WELL_FORMED: "The contract parses and is well-typed",
        Kind.SANITY: f"The contract is worth verifying: {sanity_property(view.obligation)}",
        Kind.COMPOSITION: "The nodes' contracts may be composed",
        Kind.GUARANTEE: "The node meets its guarantee",
        Kind.REQUIREMENT: "The system meets its requirement",
        Kind.PROGRAM: f"The node's program {view.obligation.name.replace('-', ' ')}",
    }
    return texts[view.obligation.kind]


def _result(view: ObligationView, case: Case, rules: list[str]) -> dict[str, Any]:
    o = view.obligation
    kind, level = _sarif_level(view)
    result: dict[str, Any] = {
        "ruleId": _rule(view),
        "ruleIndex": rules.index(_rule(view)),
        "kind": kind,
        "level": level,
        "message": {"text": f"{short(o.id)} is {view.word}. {o.claim.rstrip('.')}. {decisive(view)}"},
        "partialFingerprints": {"avowObligation/v1": sha256(o.id)},
        "properties": {
            "obligation": o.id,
            "digest": o.digest,
            "status": view.standing.value,
        },
    }
    location: dict[str, Any] = {"logicalLocations": [{"fullyQualifiedName": o.id, "kind": "declaration"}]}
    if o.span:
        location["physicalLocation"] = sarif_place(o.span)
    result["locations"] = [location]
    if view.handled:
        finding = next(f for f in case.findings if view.id in f.obligations and f.how == view.handled and not f.expired)
        said = f"{finding.how}: {finding.reason or finding.pattern}" + (f" ({finding.who})" if finding.who else "")
        result["suppressions"] = [{"kind": "external", "status": "accepted", "justification": said}]
    return result


def _sarif_level(view: ObligationView) -> tuple[str, str]:
    if view.standing.supports:
        return ("pass" if view.passes else "open"), "none"
    if view.advice:
        return "informational", "none"
    if tone(view.standing) == "bad":
        return "fail", "error"
    if view.standing in (Status.VACUOUS, Status.ERROR, Status.UNSUPPORTED):
        return "fail", "warning"
    return "open", "none"


# -- in-toto --------------------------------------------------------------------------------------------------------


def render_attestation(case: Case) -> str:
    """in-toto statements (v1) with test-result predicates (v0.1): one for the system, then one for each node."""
    every = [_statement(case, "", list(case.obligations), _result_of(case))]
    for node, own in of_nodes(case).items():
        views = [view for view in own if not view.advice]
        good = all(view.passes for view in views)
        bad = any(map(_fails, views))
        every.append(
            _statement(case, node, views, "FAILED" if bad else "PASSED" if good and not case.earlier else "WARNED")
        )
    return "".join(json.dumps(statement, ensure_ascii=True, sort_keys=True) + "\n" for statement in every)


def _statement(case: Case, node: str, views: list[ObligationView], result: str) -> dict[str, Any]:
    subjects = dict(case.digests)
    for record in (record for view in views for record in view.records):
        subjects |= record.inputs  # the programs and data that were verified, besides contract and plan
    if not subjects:
        subjects = {f"ledger/{case.system}": case.ledger_head}
    groups: dict[str, list[str]] = {"passedTests": [], "warnedTests": [], "failedTests": []}
    for view in views:
        bad = _fails(view) and not view.advice
        groups["passedTests" if view.passes else "failedTests" if bad else "warnedTests"].append(view.id)
    return {
        "_type": "https://in-toto.io/Statement/v1",
        "subject": [{"name": name, "digest": {"sha256": mark}} for name, mark in sorted(subjects.items())],
        "predicateType": "https://in-toto.io/attestation/test-result/v0.1",
        "predicate": {
            "result": result,
            **({} if node else {"verdict": case.answers.told}),
            **({"state": EARLIER} if case.earlier else {}),
            "configuration": [{"name": f"ledger/{case.system}", "digest": {"sha256": case.ledger_head}}],
            **groups,
        },
    }

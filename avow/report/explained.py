"""The meaning of a report's names and marks, in a few lines each: requirements, assumptions, nodes, gates, deficits,
derivations and words; elements of the argument, digests, files, runs, codes, ports, methods. `avow.report.terminal`
explains obligations."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from avow.assurance import answers
from avow.assurance.changes import baseline_of
from avow.assurance.model import Case
from avow.assurance.naming import short
from avow.base.files import sha256
from avow.base.plain import listed
from avow.base.tuning.shown import RECORDS
from avow.evidence.ledger import Entry
from avow.evidence.status import Status
from avow.report.answers_page import WORDS, full_reason
from avow.report.exchange import render_json
from avow.report.goals import argument
from avow.report.modules import requirement_modules
from avow.report.wording import MEANINGS


def explained(case: Case, name: str) -> Iterator[tuple[str, list[str]]]:
    """(heading, lines) of everything in the case that has the name, except obligations."""
    for module in requirement_modules(case):
        r = module.requirement
        if r.id == name:
            lines = [r.words, module.because]
            lines += [f"formula: {r.formal}"] if r.formal else []
            weakest = r.weakest_evidence
            lines += [f"weakest evidence: {weakest.title}, {weakest.words} ({short(weakest.claim)})"] if weakest else []
            lines += [f"rests on {title}: {words}" for _, title, words in module.away]
            lines += [f"composition: {module.conditions}"] if module.conditions else []
            lines += [f"assumes {', '.join(module.supposes)}"] if module.supposes else []
            lines += [f"not shown, because of: {listed([short(n) for n in module.failing])}"] if module.failing else []
            yield f"requirement {r.id}", lines
    for s in case.assumptions:
        if name in (s.number, s.key):
            lines = [s.words, full_reason(s), s.term, f"needed by {listed(s.needing)}", f"from {listed(s.where)}"]
            yield f"assumption {s.number} ({s.sort}), {s.key}", [line for line in lines if line]
    for node in case.nodes:
        if name in (node.name, node.title, f"{case.system}/{node.name}"):
            basis = next((b for b in case.answers.bases if b.node == node.name), None)
            lines = [f"criticality {node.criticality}", f"guarantees: {basis.words if basis else 'none'}"]
            lines += [f"assumes {clause}: {said}" for clause, said in node.assumptions]
            lines += [f"guarantees {clause}: {said}" for clause, said in node.guarantees]
            lines += [f"method {method} ({backend})" for method, backend in node.methods]
            yield f"node {node.name}", lines
    for gate in case.gates:
        if name in (gate.id, gate.title):
            lines = [f"{gate.state}: {gate.reason}", *(f"next: {s.text}" for s in gate.suggestions[:3])]
            yield f"gate {gate.id}: {gate.title}", lines
    for w in case.deficits:
        if name in (w.key, w.words):
            yield f"deficit {w.key}: {w.count} {w.words}", [w.why, listed([short(claim) for claim in w.claims], 20)]
    for d in case.derivations:
        if d.derivation.name == name:
            lines = [*d.derivation.text.splitlines(), f"{d.status.value}: {d.derivation.conclusion}"]
            yield f"derivation {name} (rule {d.derivation.rule})", lines
    words = [(word, meaning) for word, meaning in WORDS if name.casefold() in word.split(", ")]
    for word, meaning in words:
        yield f"the word {word}", [meaning]
    yield from (told for told in identified(case, name) if not (words and told[0].startswith("the word ")))


Explanation = tuple[str, list[str]]

_DIGEST = re.compile(r"[0-9a-f]{12,64}\Z")
_CODE = re.compile(r"[A-Z]{2,9}[0-9]{3}\Z")
_SHAPES = {"G": "goal", "S": "strategy", "Sn": "solution", "C": "context", "A": "assumption", "J": "justification"}
"""GSN's kinds of element, by the letters before their numbers."""
_PLACE = re.compile(r"(?P<path>[^:]+):(?P<line>[0-9]+)\Z")


def identified(case: Case, name: str) -> Iterator[Explanation]:
    """(heading, lines) of everything in the case that has the mark."""
    if _DIGEST.match(name):
        yield from _of_digest(case, name)
    if _CODE.match(name):
        yield from _of_code(name)
    yield from _of_argument(case, name)
    yield from _of_files(case, name)
    yield from _of_contract(case, name)
    yield from _of_methods(case, name)
    if name == case.run.id:
        yield f"run {name}", [f"begun {case.run.started}, {case.run.seconds:g} s, Avow {case.run.avow_version}"]
    if name == case.system:
        yield f"system {name}", [case.title, case.answers.told, case.answers.beside]
    words = {s.value: MEANINGS[s] for s in Status} | {str(level): told for level, told in answers.MEANINGS.items()}
    if name in words:
        yield f"the word {name}", [words[name]]


def entries(case: Case) -> Iterator[Entry]:
    yield from (item.entry for view in case.obligations for item in view.evidence)
    yield from case.orphans


def left_out(case: Case, records: Iterable[Entry], name: str) -> Iterator[Explanation]:
    """(heading, lines) of the ledger's records with that hash that the report does not quote: only the ledger has
    them."""
    if _DIGEST.match(name):
        kept = {entry.hash for entry in entries(case)}
        for entry in records:
            if entry.hash.startswith(name) and entry.hash not in kept:
                heading, lines = _of_record(entry)
                yield (
                    heading,
                    [*lines, "left out of the report: what it says is of an earlier state, or said again since"],
                )


def _of_record(entry: Entry) -> Explanation:
    return f"record {entry.number + 1} of the ledger", [_line(entry), entry.evidence.summary]


def _line(entry: Entry) -> str:
    e = entry.evidence
    return f"record {entry.number + 1}: {short(e.obligation)} {Status(e.verdict).value} by {e.method}, {e.started[:16]}"


def _of_digest(case: Case, name: str) -> Iterator[Explanation]:
    yield from (_of_record(entry) for entry in entries(case) if entry.hash.startswith(name))
    for view in case.obligations:
        if view.obligation.digest.startswith(name):
            yield f"the meaning of {short(view.id)}", [view.obligation.formula or view.obligation.claim]
    for proof in case.proofs:
        if proof.key and proof.key.startswith(name):
            yield f"the certificate of {short(proof.obligation)}", [f"{proof.grade}: what it rests on has this key"]
    for part in case.trusted:
        if part.which.startswith(name):
            yield f"trusted: {part.what}", ["the digest of this part, on which proofs by certificate rest"]
    if len(name) == 64 and sha256(render_json(case)) == name:
        yield "report.json", ["the digest of this report's data, from which every other format is rendered"]
    if case.ledger_head.startswith(name):
        yield "the head of the ledger", ["the digest of its last record, which is chained to all before it"]
    if baseline_of(case).content.startswith(name):
        yield "what is signed", ["the digest of everything that this case claims (`avow sign`)"]
    paths = {path for path, mark in case.digests if mark.startswith(name)}
    for entry in entries(case):
        known = {**entry.evidence.inputs, **entry.evidence.outputs}
        paths |= {path for path, mark in known.items() if mark.startswith(name)}
    for path in sorted(paths):
        yield f"the content of {path}", list(_read_by(case, path))


def _of_code(name: str) -> Iterator[Explanation]:
    from avow.backend_kit.registry import every_code

    known = every_code().get(name)
    if known is not None:
        yield f"{name}: {known.title}", [line for line in (known.explanation, known.remedy) if line]


def _of_argument(case: Case, name: str) -> Iterator[Explanation]:
    kind = _SHAPES.get(name.rstrip("0123456789"))
    for module in argument(case) if kind is not None else ():
        for element in module.elements:
            if element.name == name:
                lines = [element.label, element.text, *element.text_of_defeaters()]
                yield f"{kind} {name} of the argument, {module.name}", [line for line in lines if line]


def _of_files(case: Case, name: str) -> Iterator[Explanation]:
    found = _PLACE.match(name)
    path = found["path"] if found else name
    read = list(_read_by(case, path))
    if read or path in {path for path, _ in case.digests}:
        yield f"the file {path}", read or ["of contract and plan: the case was made of it"]


def _read_by(case: Case, path: str) -> Iterator[str]:
    inside = path.rpartition("/contracts/")[2]
    for how, found in (
        ("read", [e for e in entries(case) if path in e.evidence.inputs or inside in e.evidence.inputs]),
        ("left", [e for e in entries(case) if path in e.evidence.outputs]),
    ):
        for entry in found[:RECORDS]:
            yield f"{how} for {_line(entry)}"
        if len(found) > RECORDS:
            yield f"{how} for {len(found) - RECORDS} more records"


def _of_contract(case: Case, name: str) -> Iterator[Explanation]:
    for node in case.nodes:
        for clause, said in node.assumptions:
            if name in (f"{node.name}.{clause}", clause):
                yield f"assumption {clause} of {node.name}", [said]
        for clause, said in node.guarantees:
            if name == clause:
                yield f"guarantee {clause} of {node.name}", [said]
    for given in case.environment:
        if name in (given.port, given.port.partition(".")[2]):
            lines = [f"assumed: {given.assume}" if given.assume else "nothing is assumed of it", given.because]
            yield f"{given.port}, from the environment", [line for line in lines if line]


def _of_methods(case: Case, name: str) -> Iterator[Explanation]:
    for method in case.methods:
        if method.name == name:
            state = "" if method.available else f"its tool is missing: {method.install}"
            lines = [method.title, f"at best {Status(method.strength).value}: {method.green_means}", state]
            yield f"method {name}", [line for line in lines if line]
    for tool in case.tools:
        if tool.name == name:
            yield f"tool {name}", [tool.version or f"missing: {tool.install}"]

"""The meaning of a report's names and marks, in a few lines each. `avow.report.terminal` explains obligations."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import islice

from avow.assurance import answers
from avow.assurance.codec import to_json
from avow.assurance.model import Case
from avow.assurance.naming import short
from avow.assurance.state import baseline_of
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

Explanation = tuple[str, list[str]]
"""A heading, and lines."""

_DIGEST = re.compile(r"[0-9a-f]{12,64}\Z")
_MARK = re.compile(rf"{_DIGEST.pattern}|.*[./]")
"""A digest, or the name of a file."""
_CODE = re.compile(r"[A-Z]{2,9}[0-9]{3}\Z")


def explained(case: Case, name: str) -> Iterator[Explanation]:
    """Everything in the case that has the name, except obligations; for a digest or a file where report.json has it."""
    found = [(heading, lines) for heading, names, lines in named(case) if name in names]
    if _CODE.match(name):
        found += _of_code(name)
    if _MARK.match(name) and not found and all(view.id != name for view in case.obligations):
        found += [_of_record(entry) for entry in _entries(case) if entry.hash.startswith(name)]
        claimed = any(short(view.id) == name for view in case.obligations)
        if not found and not claimed and (places := list(islice(_places(to_json(case), name), RECORDS))):
            found.append((f"{name} in report.json", places))
        if sha256(render_json(case)) == name:
            found.append(("report.json", ["the digest of this report's data, from which every format is rendered"]))
        if baseline_of(case).content.startswith(name):
            found.append(("what is signed", ["the digest of everything that this case claims (`avow sign`)"]))
    for heading, lines in found:
        yield heading, [line for line in lines if line]


def left_out(case: Case, records: Iterable[Entry], name: str) -> Iterator[Explanation]:
    """The ledger's records with that hash that the report does not quote: only the ledger has them."""
    if len(name) < 12:
        return
    kept = {entry.hash for entry in _entries(case)}
    why = "left out of the report: what it says is of an earlier state, or said again since"
    for entry in records:
        if entry.hash.startswith(name) and entry.hash not in kept:
            heading, lines = _of_record(entry)
            yield heading, [*lines, why]


def named(case: Case) -> Iterator[tuple[str, tuple[str, ...], list[str]]]:
    """(heading, its names, lines) of everything that has a name of its own."""
    yield f"system {case.system}", (case.system,), [case.title, case.answers.told, case.answers.beside]
    ran = f"begun {case.run.started}, {case.run.seconds:g} s, Avow {case.run.avow_version}"
    yield f"run {case.run.id}", (case.run.id,), [ran]
    for module in requirement_modules(case):
        r, weakest = module.requirement, module.requirement.weakest_evidence
        lines = [r.words, module.because, r.formal and f"formula: {r.formal}"]
        lines += [f"weakest evidence: {weakest.title}, {weakest.words} ({short(weakest.claim)})"] if weakest else []
        lines += [f"rests on {title}: {words}" for _, title, words in module.away]
        lines += [module.conditions and f"composition: {module.conditions}"]
        lines += [f"assumes {', '.join(module.supposes)}"] if module.supposes else []
        lines += [f"not shown, because of: {listed([short(n) for n in module.failing])}"] if module.failing else []
        yield f"requirement {r.id}", (r.id,), lines
    for s in case.assumptions:
        lines = [s.words, full_reason(s), s.term, f"needed by {listed(s.needing)}", f"from {listed(s.where)}"]
        yield f"assumption {s.number} ({s.sort}), {s.key}", (s.number, s.key), lines
    for node in case.nodes:
        basis = next((b for b in case.answers.bases if b.node == node.name), None)
        lines = [f"criticality {node.criticality}", f"guarantees: {basis.words if basis else 'none'}"]
        lines += [f"assumes {clause}: {said}" for clause, said in node.assumptions]
        lines += [f"guarantees {clause}: {said}" for clause, said in node.guarantees]
        lines += [f"method {method} ({backend})" for method, backend in node.methods]
        yield f"node {node.name}", (node.name, node.title, f"{case.system}/{node.name}"), lines
    for gate in case.gates:
        lines = [f"{gate.state}: {gate.reason}", *(f"next: {s.text}" for s in gate.suggestions[:3])]
        yield f"gate {gate.id}: {gate.title}", (gate.id, gate.title), lines
    for w in case.deficits:
        claims = listed([short(claim) for claim in w.claims], 20)
        yield f"deficit {w.key}: {w.count} {w.words}", (w.key, w.words), [w.why, claims]
    for d in case.derivations:
        lines = [*d.derivation.text.splitlines(), f"{d.status.value}: {d.derivation.conclusion}"]
        yield f"derivation {d.derivation.name} (rule {d.derivation.rule})", (d.derivation.name,), lines
    for given in case.environment:
        lines = [f"assumed: {given.assume}" if given.assume else "nothing is assumed of it", given.because]
        yield f"{given.port}, from the environment", (given.port,), lines
    for m in case.methods:
        state = "" if m.available else f"its tool is missing: {m.install}"
        lines = [m.title, f"at best {Status(m.strength).value}: {m.green_means}", state]
        yield f"method {m.name}", (m.name,), lines
    for argued in argument(case):
        for e in argued.elements:
            lines = [e.label, e.text, *e.text_of_defeaters()]
            yield f"{e.sort.name.lower()} {e.name} of the argument, {argued.name}", (e.name,), lines
    meanings = {s.value: MEANINGS[s] for s in Status} | {level.value: told for level, told in answers.MEANINGS.items()}
    meanings |= dict(WORDS)
    for word, meaning in meanings.items():
        yield f"the word {word}", (word, *word.split(", ")), [meaning]


def _places(value: object, name: str, path: str = "") -> Iterator[str]:
    """Where plain data has a text that is the name, or begins with it: a digest's first digits, or whole words."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key == name:
                yield f"{path}.{key}: {item}"[1:]
            if key != "previous":  # the chain of the ledger
                yield from _places(item, name, f"{path}.{key}")
    elif isinstance(value, list):
        for at, item in enumerate(value):
            yield from _places(item, name, f"{path}[{at}]")
    elif isinstance(value, str) and (value == name or (len(name) >= 12 and _begins(value, name))):
        yield f"{path}: {value}"[1:]


def _begins(value: str, name: str) -> bool:
    return value.startswith(name) and (_DIGEST.match(name) is not None or not re.match(r"\w", value[len(name) :]))


def _entries(case: Case) -> Iterator[Entry]:
    yield from (item.entry for view in case.obligations for item in view.evidence)
    yield from case.orphans


def _of_record(entry: Entry) -> Explanation:
    e, name = entry.evidence, f"record {entry.number + 1}"
    line = f"{name}: {short(e.obligation)} {Status(e.verdict).value} by {e.method}, {e.started[:16]}"
    return f"{name} of the ledger", [line, e.summary]


def _of_code(name: str) -> Iterator[Explanation]:
    from avow.backend_kit.registry import every_code

    known = every_code().get(name)
    if known is not None:
        yield f"{name}: {known.title}", [known.explanation or "", known.remedy or ""]

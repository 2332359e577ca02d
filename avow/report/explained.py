"""What a report's other names mean, in a few lines each: requirements, suppositions, nodes, gates, weakenings,
derivations and words; `avow.report.identified` tells marks, and `avow.report.terminal` obligations."""

from __future__ import annotations

from collections.abc import Iterator

from avow.assurance.model import Case
from avow.assurance.modules import requirement_modules
from avow.assurance.naming import short
from avow.base.plain import listed
from avow.report.answers_page import WORDS, full_reason
from avow.report.identified import identified


def explained(case: Case, name: str) -> Iterator[tuple[str, list[str]]]:
    """(heading, lines) of everything in the case that bears the name, obligations apart."""
    for module in requirement_modules(case):
        r = module.requirement
        if r.id == name:
            lines = [r.words, f"{r.how}. {module.because}"]
            lines += [f"formula: {r.formal}"] if r.formal else []
            weakest = r.weakest_evidence
            lines += [f"weakest evidence: {weakest.title}, {weakest.words} ({short(weakest.claim)})"] if weakest else []
            lines += [f"rests on {title}: {words}" for _, title, words in module.away]
            lines += [f"composition: {module.conditions}"] if module.conditions else []
            lines += [f"supposes {', '.join(module.supposes)}"] if module.supposes else []
            lines += [f"not shown, because of: {listed([short(n) for n in module.failing])}"] if module.failing else []
            yield f"requirement {r.id}", lines
    for s in case.suppositions:
        if name in (s.number, s.key):
            lines = [s.words, full_reason(s), s.term, f"needed by {listed(s.needing)}", f"from {listed(s.where)}"]
            yield f"supposition {s.number} ({s.sort}), {s.key}", [line for line in lines if line]
    for node in case.nodes:
        if name in (node.name, node.title):
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
    for w in case.weakenings:
        if name in (w.key, w.words):
            yield f"weakening {w.key}: {w.count} {w.words}", [w.why, listed([short(claim) for claim in w.claims], 20)]
    for d in case.derivations:
        if d.derivation.name == name:
            lines = [*d.derivation.text.splitlines(), f"{d.status.word}: {d.derivation.conclusion}"]
            yield f"derivation {name} (rule {d.derivation.rule})", lines
    words = [(word, meaning) for word, meaning in WORDS if name.casefold() in word.split(", ")]
    for word, meaning in words:
        yield f"the word {word}", [meaning]
    yield from (told for told in identified(case, name) if not (words and told[0].startswith("the word ")))

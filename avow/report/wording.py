"""Words, marks and names that all formats share, so that a claim looks and reads the same in every format."""

from __future__ import annotations

import functools
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from typing import Any
from urllib.parse import quote

import yaml

from avow.assurance import naming
from avow.assurance.answers import Deficit, Level, Tone
from avow.assurance.certification import ProofView
from avow.assurance.hazards import WORST_FIRST
from avow.assurance.model import Case, EvidenceView, ObligationView, RequirementView
from avow.assurance.naming import cut
from avow.base.codec import plain
from avow.base.files import sha256
from avow.base.percent import at_most
from avow.base.plain import count, listed
from avow.base.remembered import by_identity
from avow.base.tuning.shown import DETAILS, FORMULA_COLUMNS, HAZARD_CHARACTERS
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.evidence.record import RETRY, Evidence
from avow.evidence.status import Status, weigh

_SHOWN = {
    Status.PROVED: ("✔", "good", "for all behaviours and inputs, by a sound method"),
    Status.CHECKED: ("✔", "good", "exhaustively, within a finite scenario"),
    Status.TESTED: ("◐", "fair", "on a number of cases"),
    Status.MONITORED: ("◐", "fair", "on a recorded or live trace"),
    Status.REVIEWED: ("◔", "fair", "by a person who said what was read and concluded"),
    Status.JUSTIFIED: ("◔", "fair", "a person's dated reason, in place of evidence"),
    Status.ARGUED: ("↳", "fair", "a person says that what stands below it, which holds, amounts to it"),
    Status.PARTIAL: (
        "◑",
        "open",
        "partial correctness: proved of every run that ends; that all of them do is not shown",
    ),
    Status.UNWRITTEN: ("✎", "open", "a draft's placeholder: what the node promises is still to be written"),
    Status.VACUOUS: ("∅", "open", "it passed and says nothing: its trigger was never met, or every design meets it"),
    Status.UNKNOWN: ("?", "open", "the method gave no verdict: time, memory, or a question that it cannot decide"),
    Status.NOT_RUN: ("–", "open", "the tool is missing on this machine"),
    Status.ERROR: ("!", "open", "the tool failed, or its answer could not be read"),
    Status.STALE: ("⟲", "open", "the claim, an input, an option or a tool has changed since the evidence was made"),
    Status.MISSING: ("·", "open", "nobody has tried"),
    Status.UNSUPPORTED: ("▽", "open", "nothing speaks against it, but something that it rests on is not shown"),
    Status.CIRCULAR: ("↻", "bad", "it would support itself: refused"),
    Status.REFUTED: ("✘", "bad", "false: there is a counterexample"),
    Status.CONTRADICTORY: (
        "⚡",
        "bad",
        "one tool proves it, another refutes it: one of them is wrong, or they were shown different things",
    ),
}
"""For each status its mark (colour is never the only sign), its colour, and its meaning."""

MARKS = {status: mark for status, (mark, _, _) in _SHOWN.items()}
MEANINGS = {status: meaning for status, (_, _, meaning) in _SHOWN.items()}

_DIGEST = re.compile(r"[0-9a-f]{64}\Z")


def tone(word: Status | Level) -> str:
    """``good``, ``fair``, ``open`` or ``bad``: the four colours."""
    match word:
        case Status():
            return _SHOWN[word][1]
        case Level.SHOWN:
            return "good"
        case Level.REFUTED:
            return "bad"
        case _:  # every other level
            return "fair" if word.holds else "open"


def tally(views: Iterable[ObligationView]) -> dict[Status | Level, int]:
    """How many claims stand how, best first, each in the word of its own line: every format counts like this."""
    order = (*Status, *Level)
    return dict(sorted(Counter(view.word for view in views).items(), key=lambda found: order.index(found[0])))


def anchor(claim: str) -> str:
    """A fragment for a claim: readable, and safe in an attribute whatever the claim's name is."""
    return quote(claim, safe="/._-", errors="replace")


@functools.cache
def page_of(node: str) -> str:
    """The page with all of a node's claims; for claims of no single node, the whole system's page."""
    if node == SYSTEM_LEVEL:
        return "system.html"
    return f"node-{node if re.fullmatch('[A-Za-z0-9_.-]+', node) else sha256(node)[:16]}.html"


def rerun(view: ObligationView, evidence: Evidence) -> str:
    """The command that re-runs this method, from the workspace's folder."""
    return naming.rerun(view.obligation, evidence.method)


def tool_command(evidence: Evidence) -> str:
    """The command that was run, quoted for a shell; empty if the method runs within Avow.

    A tool runs in a copy of the folder with the method's exported files: the command for a guarantee begins with the
    path from the workspace's folder to that folder, so that it can be run as printed.
    """
    command = shlex.join(evidence.command)
    match evidence.obligation.split("/", 3):
        case [system, node, Kind.GUARANTEE, _] if command:
            return f"(cd {shlex.quote(f'artifacts/{system}/{node}/{evidence.method}')} && {command})"
        case _:  # not a method's tool: it runs in the run's working folder
            return command


def worth(evidence: Evidence) -> Status:
    """The status that a record counts as: a pass whose trigger was never met is vacuous, whatever verdict the tool
    gave."""
    return weigh(evidence).status


def gate_line(reason: str, most: int = 200) -> str:
    """A gate's reason in a line: as many whole parts as fit, and the number left out; JSON has all of it."""
    if len(reason) <= most:
        return reason
    first, *parts = reason.split("; ")
    shown = first if len(first) <= most else first[: most - 1].rstrip() + "…"
    while parts and len(shown) + len(parts[0]) + 2 <= most:
        shown += f"; {parts.pop(0)}"
    return f"{shown}; and {len(parts)} more" if parts else shown


def within(view: ObligationView, status: Status, most: int = 160) -> str:
    """The bounds of the evidence that gives a claim this status: "tested" means nothing without its number of cases."""
    records = view.records
    texts = [bound_text(e.bound) for e in records if e.bound and worth(e) is status]
    text = "; ".join(dict.fromkeys(texts))
    return text if len(text) <= most else text[: most - 1] + "…"


def protocol(evidence: Evidence) -> str:
    """How measured runs were made, in the plan's words; empty if nothing was measured."""
    return _text(evidence, "protocol")


def overhead(evidence: Evidence) -> str:
    """The method's cost for the running robot, as measured; empty if it was not measured."""
    return _text(evidence, "overhead")


def _text(evidence: Evidence, key: str) -> str:
    match evidence.details.get(key):
        case str(text):
            return " ".join(text.split())
    return ""


@by_identity(1)
def of_nodes(case: Case) -> Mapping[str, tuple[ObligationView, ...]]:
    """The claims of each node, in the case's order."""
    found: dict[str, list[ObligationView]] = {}
    for view in case.obligations:
        found.setdefault(view.obligation.node, []).append(view)
    return {node: tuple(views) for node, views in found.items()}


def proof_runs(case: Case) -> Iterator[tuple[str, str, tuple[ProofView, ...]]]:
    """Consecutive proofs about one node: the node, the run's name among the node's parts, and the proofs."""
    begun = Counter[str]()
    for node, run in groupby(case.proofs, key=lambda proof: proof.obligation.partition("/")[2].partition("/")[0]):
        begun[node] += 1
        yield node, f"proofs {begun[node]}", tuple(run)


def where(view: ObligationView) -> str:
    span = view.obligation.span
    return f"{span.file}:{span.line}" if span else ""


_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def clean(text: str) -> str:
    """The text without characters that XML cannot hold (a counterexample's string may have any)."""
    return _NO_XML.sub("\ufffd", text)


def open_line(case: Case) -> str:
    """How many failures and gaps the plan expects or accepts; empty if it does so of none."""
    said = sum(bool(i.handled) and not i.advice for i in case.open_items)
    rest = sum(not i.handled and not i.advice for i in case.open_items)
    return f"The plan expects or accepts {said} of them; of {rest or 'none'} it says nothing." if said else ""


def remark_line(case: Case) -> str:
    """The number of remarks, as the first screen has it, and of those that the plan handles."""
    said = [bool(i.handled) for i in case.open_items if i.advice]
    handled = f", and {sum(said)} that the plan expects or accepts" if any(said) else ""
    return f"{count(len(said) - sum(said), 'open remark')}{handled}: no gate fails for them."


def banner_tone(case: Case) -> str:
    """Green is for a case whose requirements are shown, not for known-bad material, expected or accepted, and not for a
    plan without a requirement."""
    if not case.good:
        return "bad"
    return "good" if case.answers.headline.holds and not case.answers.warned else "open"


_CONNECTIVES = ("→↔⇒⇔", "∨", "∧")
"""Weakest first."""


def in_lines(formula: str, margin: str = "") -> str:
    """A long formula broken before its connectives, the weakest outermost; only blanks are changed."""
    if len(margin + formula) <= FORMULA_COLUMNS or "\n" in formula:
        return margin + formula
    for kind in _CONNECTIVES:
        first, *rest = _parts(formula, kind)
        if rest:
            return "\n".join([in_lines(first, margin), *(in_lines(part, f"{margin}  ") for part in rest)])
    return margin + formula


def _parts(text: str, kind: str) -> list[str]:
    """The text cut before the connectives of a kind that are outside parentheses."""
    parts, depth, start = [], 0, 0
    for at, c in enumerate(text):
        depth += (c in "([{") - (c in ")]}")
        if depth == 0 and c in kind and at > start + 1 and text[at - 1] == text[at + 1 : at + 2] == " ":
            parts.append(text[start:at].rstrip())
            start = at
    return [*parts, text[start:]]


def numbered(case: Case) -> dict[str, str]:
    """The number of the assumption that has a record's hypothesis."""
    return {text: s.number for s in case.assumptions for text in s.text.split("\n")}


def bound_text(bound: Mapping[str, Any]) -> str:
    """``cases 2000, seed 0``; for a state space ``every state explored, for each i in 0…12, 25 properties``."""
    return ", ".join(_one_bound(name, value) for name, value in bound.items() if value not in ([], (), {}, ""))


def _one_bound(name: str, value: Any) -> str:
    match name, value:
        case "exhaustive", bool():
            return "every state explored" if value else "not every state explored"
        case "indices", [_, *_] as names:
            return f"for each {' and '.join(map(str, names))}"
        case "properties" | "states" | "transitions", int() if not isinstance(value, bool):
            return f"{_plain(value)} {name if value != 1 else _SINGULAR[name]}"
        case str(), float() if "failure" in name:
            return f"{name.replace('_', ' ')} {at_most(value)}"
        case _:  # bounds of any method, by the method's name for them
            return f"{name.replace('_', ' ')} {_plain(value)}"


_SINGULAR = {"properties": "property", "states": "state", "transitions": "transition"}


def mutation(evidence: Evidence) -> str:
    """The mutation score, if measured (details: ``mutation``): ``46 of 50 mutants killed``, and the changes in the
    mutants that survived or could not be judged."""
    match evidence.details.get("mutation"):
        case {"killed": int(killed), "mutants": int(mutants), **more}:
            parts = [f"{killed} of {mutants} mutants killed"]
            for key, words in (("survivors", "not noticed"), ("unjudged", "not judged")):
                match more.get(key):
                    case [_, *_] as listed:
                        parts.append(f"{words}: {', '.join(map(str, listed))}")
            match more.get("differences"):
                case [_, *_] as differences:
                    parts += [_difference(found) for found in differences if isinstance(found, dict)]
            return "; ".join(parts)
        case {"score": int() | float() as score}:
            return f"mutation score {score:.0%}"
        case int() | float() as score if not isinstance(score, bool):
            return f"mutation score {score:.0%}"
        case str(text):
            return text
    return ""


def _difference(found: dict[str, Any]) -> str:
    return f"of “{found.get('mutant')}” {found.get('why')}"


def outline(evidence: Evidence) -> str:
    """A proof outline, if the method left one (details: ``outline`` or ``proof_outline``, or ``triples``)."""
    for key in ("outline", "proof_outline"):
        match evidence.details.get(key):
            case str(text):
                return text
            case list() as lines if all(isinstance(line, str) for line in lines):
                return "\n".join(lines)
    match evidence.details.get("triples"):
        case list() as triples if all(isinstance(t, dict) for t in triples):
            return "\n".join(
                f"{{ {t.get('pre')} }}  …  {{ {t.get('post')} }}   {t.get('verdict', '')}" for t in triples
            )
    return ""


def details_text(evidence: Evidence) -> str:
    """Everything else in a method's details, as indented text."""
    shown = {"outline", "proof_outline", "triples", "mutation", RETRY, "protocol", "overhead", "timeline"}
    rest = {
        key: value for key, value in evidence.details.items() if key not in shown and value not in ("", [], {}, None)
    }
    fast = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    text = yaml.dump(plain(rest), Dumper=fast, sort_keys=False, allow_unicode=True).strip() if rest else ""
    return text if len(text) <= DETAILS else text[:DETAILS] + "\n… (all of it is in report.json)"


def history(view: ObligationView) -> tuple[EvidenceView, ...]:
    """Evidence that no longer counts, newest first."""
    return tuple(item for item in reversed(view.evidence) if not item.counts)


def _plain(value: object) -> str:
    match value:
        case bool():
            return "yes" if value else "no"
        case int() if abs(value) >= 10_000:
            return f"{value:,}".replace(",", " ")
        case float():
            return f"{value:.4g}"
        case dict():
            return ", ".join(map(str, value))
        case list() | tuple():
            return ", ".join(map(_plain, value))
        case str() if _DIGEST.match(value):
            return value[:12]
        case _:  # shown as it is
            return str(value)


def weakest(requirement: RequirementView) -> str:
    """The weakest evidence of a requirement: ``tested: navigation, bound 13 %``. For a sentence without a formula it is
    a person's word that the guarantees amount to it."""
    if requirement.level is Level.ARGUED and not requirement.formal:
        return "argued: a person's word"
    found = requirement.weakest_evidence
    if found is None:
        return "none"
    return f"{found.status}: {found.title}" + (f", {found.bound}" if found.bound else "")


def dangers(case: Case) -> list[tuple[Tone, Level, str]]:
    """(colour, level, ``H1 The robot burns (critical), H3 It drifts (marginal)``) of the hazards, the least mitigated
    first."""
    found: list[tuple[Tone, Level, str]] = []
    for level in WORST_FIRST:
        if own := [view for view in case.hazards if view.level is level]:
            names = [f"{h.id} {cut(h.text, HAZARD_CHARACTERS)} ({h.severity})" for h in (view.hazard for view in own)]
            found.append((min((view.tone for view in own), key=lambda tone: tone.rank), level, listed(names, 3)))
    return found


def hazard_rows(case: Case) -> list[tuple[str, str, str, str]]:
    """(id, what may happen, severity and exposure, how far it is mitigated) of each hazard."""
    return [
        (
            view.hazard.id,
            view.hazard.text,
            ", ".join(filter(None, (view.hazard.severity, view.hazard.exposure))),
            f"{view.tone.mark} {view.stands}",
        )
        for view in case.hazards
    ]


NO_HAZARD = "No hazard is declared in the plan: nothing shows that the requirements cover what may do harm."


NOT_SHOWN = (
    "A proof or check is about the program or model that it was given, and not about the software and hardware in use.",
    "That the contracts say what was meant, and that the requirements are the right ones, is for people to judge.",
)
"""What no report shows."""


def by_claim(deficit: Deficit) -> str:
    """The claims, or other names, that a deficit is about."""
    return listed([naming.short(claim) for claim in deficit.claims], 12)


def not_shown(deficit: Deficit) -> str:
    """A deficit with its claims and its meaning, as a sentence."""
    return f"{deficit.count} {deficit.words}: {by_claim(deficit)}. {deficit.why}"

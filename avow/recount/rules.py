"""Which number on the page is recomputed how. A rule applies in one section, or in all of them.

Its pattern finds a phrase; its function says, from the facts, what the groups of the match have to be. None: the phrase
is of another kind, and other rules see it.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from avow.recount.facts import HOLDS, SUPPORTS, Facts
from avow.recount.page import CELL, Block

_Numbers = tuple[str | None, ...] | None
_WORST = ("refuted", "not shown", *reversed(HOLDS))
HAZARD = 120
"""Characters of a hazard's text on the first screen."""
_SORTS = {
    "the world": "the world",
    "the platform": "the platform",
    "models": "models",
    "samples": "sampling",
    "meaning": "meaning",
    "trusted tools": "tools",
}
_DEFICITS = {
    "guarantees? without support": "open",
    "premises? of the composition without support": "premises",
    "argued, not derived": "argued",
    "sentences? without a validation": "unvalidated",
    "guarantees? shown of a model only": "models",
    "requirements? within bounds only": "bounded",
    "assumptions? without owner or end": "unowned",
    "assumptions? without a reason": "bare",
    "assumptions? without plain words": "wordless",
    "claims? sampled, not proved": "sampled",
    "claims? with unanswered inputs": "unanswered",
    "claims? broken by NaN or infinity": "nan",
    "guarantees? on a person's reading only": "read",
    "guarantees? with one method only": "single",
    "guarantees? serving no requirement": "idle",
    "guarantees? of lower criticality than a hazard's severity": "underrated",
    "guarantees? translated by a person for the tool": "tied",
    "planned methods? without an answer": "unrun",
    "claims? about a node's program not run": "programs",
    "refutations? by what the plan no longer uses": "withdrawn",
    "open remarks?": "advice",
    "findings? accepted by a person": "excused",
}


@dataclass(frozen=True)
class Rule:
    section: str
    """Empty: everywhere."""
    pattern: re.Pattern[str]
    numbers: Callable[[Facts, re.Match[str], Block], _Numbers]


def _rule(section: str, pattern: str, numbers: Callable[[Facts, re.Match[str], Block], _Numbers]) -> Rule:
    return Rule(section, re.compile(pattern), numbers)


def _gates(facts: Facts, _match: re.Match[str], _block: Block) -> _Numbers:
    idle = len(facts.case["gates"]) - len(facts.gates)
    relaxed = sum(bool(g.get("relaxed")) for g in facts.gates)
    some = tuple(str(number) if number else None for number in (relaxed, idle))
    return str(sum(g["passed"] for g in facts.gates)), str(len(facts.gates)), *some


def _level(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    return str(len(facts.level(match[2]))), match[2]


KINDS_SHOWN = 6
"""Kinds of deficit that the first screen lists."""


def _kinds(facts: Facts) -> int:
    return sum((facts.deficit(d["key"]) or (0, 1))[1] > 0 for d in facts.case["deficits"])


def _deficit(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    key = next(key for words, key in _DEFICITS.items() if re.fullmatch(words, match[2]))
    told = next((len(set(d["claims"])) for d in facts.case["deficits"] if d["key"] == key), 0)
    least, most = facts.deficit(key) or (told, told)
    return str(min(max(told, least), most)), match[2]


def _basis(facts: Facts, match: re.Match[str], block: Block) -> _Numbers:
    """``5 proved (model)``, in the row of a node: between the fewest and the most that its records can mean, and all
    numbers of the row together as many as the node has guarantees."""
    title = _cells(block.text)[0]
    node = next((n["name"] for n in facts.case["nodes"] if (n["title"] or n["name"]) == title), "")
    after = re.search(r"\((model|source|binary|recordings)?", match.string[match.end() :].split(";")[0])
    what = {"recordings": "recording"}.get(after[1] or "", after[1] or "") if after else ""
    least, most = facts.stands(node, match[2], what)
    shown = [int(n) for n, _ in re.findall(rf"(\d+) ({_STATUS})\b", block.text.partition(title)[2])]
    own = sum(v["obligation"]["node"] == node for v in facts.guarantees)
    if sum(shown) != own:
        return f"{own} in all", match[2]
    return str(min(max(int(match[1]), least), most)), match[2]


def _sort(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    return str(len(facts.numbers(_SORTS[match[2]]))), match[2]


def _others(facts: Facts, match: re.Match[str], block: Block) -> _Numbers:
    """``A1 …, also A3 to A6``: with the first one in the row, all of a sort."""
    about = re.search(rf"\d+ about ({'|'.join(_SORTS)})", block.text)
    first = re.search(r"\bA(\d+) ", block.text)
    ranges = re.findall(r"A(\d+)(?: to A(\d+))?", match[1])
    named = [n for low, high in ranges for n in range(int(low), int(high or low) + 1)]
    if about is None or first is None:
        return None
    of_sort = facts.numbers(_SORTS[about[1]])
    return (match[1],) if sorted([*named, int(first[1])]) == of_sort else (", ".join(f"A{n}" for n in of_sort),)


def _cells(text: str) -> list[str]:
    return [cell.strip() for cell in text.strip().strip(CELL.strip()).split(CELL)]


def _row(facts: Facts, match: re.Match[str], block: Block) -> _Numbers:
    """A requirement's row: its sentence beside its name, and how many assumptions it needs."""
    name, words, *_ = _cells(block.text)
    found = next((r for r in facts.requirements if " ".join(r["id"].split()) == name), None)
    texts = [] if found is None else [found["text"], found["formula"], found.get("temporal") or ""]
    if found is None or words not in [" ".join(text.split()) for text in texts]:
        return f"the requirement that says “{words}”", None
    return match[1], str(facts.supposed(found["id"]))


def _named(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """The requirements of a level, where there are too many for a row each."""
    found = facts.level(match[2])
    return str(len(found)), match[2], " ".join(" ".join(name.split()) for name in found)


def _hazard(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """A hazard's row: its name beside its text, its mitigations, and the weakest evidence beneath them; of one that is
    not mitigated, a claim that fails, or a mitigation."""
    hazard = next((h for h in facts.hazards if " ".join(h["hazard"]["text"].split()) == match[2]), None)
    if hazard is None:
        return None
    said = facts.fails(hazard["closure"])
    if hazard["level"] in HOLDS:
        said = facts.weakest(hazard["closure"])
    worst = min((_WORST.index(m["level"]) for m in hazard["mitigations"]), default=0)
    said = said or [m["name"] for m in hazard["mitigations"] if m["level"] == _WORST[worst]]
    shown = match[3] if match[3] in said else "; ".join(said)
    return hazard["hazard"]["id"], match[2], shown, ", ".join(hazard["hazard"]["mitigated_by"])


def _bound(facts: Facts, match: re.Match[str], block: Block) -> _Numbers:
    """The bound of the weakest evidence in a requirement's row."""
    own = next((r for r in facts.requirements if " ".join(r["id"].split()) == _cells(block.text)[0]), None)
    found = [told.rpartition(", ")[2] for told in facts.weakest(own["closure"])] if own else []
    return (match[1] if match[1] in found else "; ".join(found) or "no such requirement",)


def _other_tools(facts: Facts, _match: re.Match[str], _block: Block) -> _Numbers:
    """The answers of the tools that are not named, and how many tools these are: all but the three with the most."""
    left = sorted(facts.tools().values(), reverse=True)[3:]
    return str(sum(left)), str(len(left))


def _confirmed(facts: Facts, _match: re.Match[str], _block: Block) -> _Numbers:
    """The guarantees that hold, and those of them that a second method shows: not those of the deficit."""
    shown = sum(v["status"] in SUPPORTS for v in facts.guarantees)
    told = next((d["count"] for d in facts.case["deficits"] if d["key"] == "single"), 0)
    least, most = facts.deficit("single") or (told, told)
    return str(shown - min(max(told, least), most)), str(shown)


def _dangers(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """The hazards of each level, and how many of it are not named; then, of many requirements, how many are not."""
    told = []
    for level in _WORST:
        own = [h["hazard"] for h in facts.hazards if h["level"] == level]
        texts = [h["text"] if len(h["text"]) <= HAZARD else h["text"][: HAZARD - 1].rstrip() + "…" for h in own]
        names = [f"{h['id']} {text} ({h['severity']})" for h, text in zip(own[:3], texts, strict=False)]
        more = f" and {len(own) - 3} more" if own[3:] else ""
        told += [" ".join(f"mitigation {level} {', '.join(names)}{more}".split())] if own else []
    true = f"{'; '.join(told)}." if told else "none is declared."
    left = re.findall(r"\d+", match[1].removeprefix(true))
    return match.groups() if match[1].startswith(true) and left in ([], [str(len(facts.requirements) - 3)]) else (true,)


def _seen(facts: Facts, match: re.Match[str], block: Block) -> _Numbers:
    """What was seen, with its bound: as a record says of the claim that is quoted before it; in the row of a
    requirement, of its own formula."""
    before = match.string[: match.start()]
    told = facts.searched(_cells(block.text)[0]) if block.section == "q1" else facts.seen(before)
    words = match[1][:1].lower() + match[1][1:]
    return (match[1],) if words in told else ("; ".join(sorted(told)) or "nothing",)


def _owners(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    who = Counter(a["who"] for a in facts.owned_ones())
    return match[1], str(who[match[1].strip()])


def _reasons(facts: Facts, match: re.Match[str], block: Block) -> _Numbers:
    """Why a gate fails: its reasons in their order, and how many are not told (``…; and 6 more``)."""
    titles = [gate for gate in facts.failing if " ".join(gate["title"].split()) in block.text]
    gate = max(titles, key=lambda gate: len(gate["title"]), default=None)
    if gate is None:
        return None
    shown = match[1].split("; ")
    parts = [" ".join(part.split()) for part in re.sub("`([^`]+)`", r"\1", gate["reason"]).split("; ")]
    told = [
        part[: len(said) - 1] + "…" if said.endswith("…") else part for said, part in zip(shown, parts, strict=False)
    ]
    left = len(parts) - len(shown)
    return "; ".join(told), str(left) if left else None


def _listed(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """``REQ1, REQ2 and 3 more``: requirements that do not hold, or that need the weakest evidence."""
    shown = len(match[1].split(", "))
    of = [r["id"] for r in facts.requirements if r["level"] not in HOLDS]
    if match.group().startswith("On it"):
        claim = facts.case["answers"]["weakest"]["claim"]
        of = [r["id"] for r in facts.requirements if claim in r.get("closure", ())]
        of += [h["hazard"]["id"] for h in facts.hazards if claim in h.get("closure", ())]
    elif "efuted" in match.group():
        of = facts.level("refuted")
    elif match.group().startswith("Requirements"):
        of = facts.level("not shown")
    names = ", ".join(" ".join(name.split()) for name in of[:shown])
    return names, str(len(of) - shown) if len(of) > shown else None


def _felled(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """A claim that is called refuted."""
    claims = {" ".join(v["obligation"]["claim"].rstrip(".").split()) for v in facts.wrong()}
    return (match[1] if " ".join(match[1].split()) in claims else "no such refuted claim",)


def _days(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    own = facts.owned_ones()
    made, ends = sorted(a.get("date", "") for a in own), sorted(a["until"] for a in own if a["until"])
    if match.re.pattern.startswith("assumed"):
        return made[0], made[-1] if made[-1] != made[0] else None
    return (ends[0],)


def _says(facts: Facts, match: re.Match[str], block: Block) -> _Numbers:
    """``A7 The map does not change``: the number of that assumption, if it has words."""
    after = match.string[match.end() :].strip()
    fits = [a for a in facts.assumptions if after.startswith(" ".join(a["says"].split())) and a["says"]]
    fits = [a for a in fits if a["number"][1:] == match[1]] or fits
    if after.startswith("(no plain words yet"):
        once = block.text.count(f" A{match[1]} (no plain") == 1
        fits = [a for a in facts.assumptions if not a["says"] and f"A{match[1]}" == a["number"] and once]
    return (fits[0]["number"][1:] if fits else "none with these words",)


def _accepted(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """An assumption's words, and if its owner or end is missing or past, who and until when."""
    a = next((a for a in facts.assumptions if a["number"] == f"A{match[1]}"), facts.assumptions[0])
    last = "until a text changes" if a["sort"] == "meaning" and a["who"] else "no last day"
    last = f"{'expired' if a['expired'] else 'until'} {a['until']}" if a["until"] else last
    term = ", ".join(part for part in (a["who"] or "no owner", a.get("date", ""), last) if part)
    bad = a["expired"] or a not in facts.owned_ones()
    return a["number"][1:], *(" ".join(text.split()) for text in (a["says"] or a["text"], term * bad))


def _place(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """Where the plan's words for an assumption belong."""
    return match.groups() if any(a["key"].startswith(f"{match[1]}:") for a in facts.assumptions) else ("no such place",)


def _objectives(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    found = Counter(o["state"] for o in facts.case["standard"]["objectives"])
    return str(found[match[2]]), match[2]


def _change(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """A row of the changes: an entry's kind, its words, claim and edits, and its state before and after."""
    row = [cell.strip() for cell in match.groups()]
    for e in facts.changes:
        claim = re.sub(r".*?/(.*)/guarantee/(.*)", r"\1.\2", e["subject"])
        texts = {" ".join(filter(None, (e["words"], name, *e.get("edits", ())))) for name in ("", claim)}
        if row[1] in texts and [row[0], *row[2:]] == [e["kind"], e["before"], e["after"]]:
            least, most = (e["kind"] == "deficit" and facts.deficit(e["subject"])) or (0, math.inf)
            items = facts.case["baseline"]["items"]
            signed = next(
                (int(value[0]) for kind, key, _, value in items if (kind, key) == ("deficit", e["subject"])), 0
            )
            if e["kind"] != "deficit" or (int(row[2] or 0) == signed and least <= int(row[3]) <= most):
                return match.groups()
    return "no such change", *match.groups()[1:]


def _rest(facts: Facts, _match: re.Match[str], _block: Block) -> _Numbers:
    """The changes that the screen counts only: the first edit and the next worst change are in words."""
    edits = [e for e in facts.changes if e["kind"] in ("edit", "meaning")][:1]
    left = [e for e in facts.changes if e not in edits][2 - len(edits) :]
    better = sum(e["kind"] == "better" for e in left)
    return str(len(left)), str(better) if better else None


def _since(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """The files that were edited since the signature, by their names."""
    edits = [str(e["subject"]) for e in facts.changes if e["kind"] == "edit"]
    names = list(dict.fromkeys(name.rpartition("/")[2].partition(":")[0] for name in edits))
    shown = len(match[1].split(", "))
    return ", ".join(names[:shown]), str(len(names) - shown) if len(names) > shown else None


def _policy(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    """A demand's own numbers: the policy's."""
    asked = [str(gate["asks"]) for gate in facts.case["gates"]]
    return match.groups() if any(match[1] in text for text in asked) else ("what the policy asks",)


def _bare(facts: Facts, match: re.Match[str], _block: Block) -> _Numbers:
    own = [a["number"] for a in facts.owned_ones()]
    bare = [a["number"] for a in facts.assumptions if a["number"] not in own]
    shown = len(match[1].split(", "))
    return ", ".join(bare[:shown]), str(len(bare) - shown) if len(bare) > shown else None


def _whole(number: Callable[[Facts], int]) -> Callable[[Facts, re.Match[str], Block], _Numbers]:
    return lambda facts, _match, _block: (str(number(facts)),)


_LEVELS = "|".join((*reversed(HOLDS), "not shown", "refuted"))
_STATUS = "proved|checked|tested|monitored|reviewed|justified|argued|partial|unwritten|vacuous|unknown|not-run|error"
_STATUS += "|stale|missing|unsupported|circular|refuted|contradictory"
_BOUND = r"(?:, with no bound on failures| \([^()]*: at most [\d.]+ %(?: of (?:cases|runs) drawn like these)? fail\))?"
_SEEN = r"[Oo]bserved \d+ times?(?: on \d+ recorded runs?)?, none against it"
_SEEN += rf"|(?:[Oo]nly )?\d+ of \d+ cases? met its condition, none failed{_BOUND}|\d+ cases?, none failed{_BOUND}"
_SEEN += r"|searched to step \d+, not exhaustively"
_SEEN += r"|[Ee]very (?:case|run) [^;,␟]* was looked at, with \d+ (?:states?|kinds? of steps)"
_SEEN += rf"|\d+ (?:triggered )?runs?(?: of \d+)?, \d+ failed(?:; the worst stratum: [^()]*[^() ])?{_BOUND}"

_WHY = r"fails\. (.*?)(?:; and (\d+) more)?(?=\.? Next:|\.? $)"
_DAY = r"(\d{4}-\d\d-\d\d)"

RULES = (
    _rule("head", _WHY, _reasons),  # first: a reason is compared as a whole, with the numbers in it
    _rule("gates", _WHY, _reasons),
    _rule("signature", r"^ (By signing .*) $", lambda f, m, _: m.groups() if m[1] == f.signed() else None),
    _rule("q5", r"^ (.*) $", lambda f, m, _: m.groups() if m[1] in [e["words"] for e in f.changes] else None),
    _rule("changes", r"^ ␟([^␟]*)␟([^␟]*)␟([^␟]*)␟([^␟]*)$", _change),
    _rule("", rf"\b({_SEEN})", _seen),
    _rule("", r"\b(at most [\d.]+ % of (?:steps|runs) fail, at [\d.]+ %) confidence", lambda f, m, _: (f.rate(m[1]),)),
    _rule("", r"Not shown: (\d+) of (\d+) requirements? not validated", lambda f, _m, _b: _unread(f)),
    _rule("", r"Not shown: (\d+) of (\d+) requirements?", lambda f, _m, _b: (str(f.lost()), str(len(f.requirements)))),
    _rule("", r"Not shown: (\d+) gates? fails?", _whole(lambda f: len(f.failing))),
    _rule("", r"(\d+) claims? about programs not run", lambda f, _m, _b: (str((f.deficit("programs") or (0, 0))[1]),)),
    _rule("", r"(\d+) findings? against it, which the plan lists: ([\w, -]*\w)", lambda f, _m, _b: f.known()),
    _rule("", r"(\d+) kinds? of assurance deficit", _whole(_kinds)),
    _rule("head", r"Refuted: ([^␟]*?)(?: and (\d+) more)?(?=; | $| · |[ ,] ?\d)", _listed),
    _rule("head", r"; since then: ([^␟]*?)(?: and (\d+) more)?(?= ␟| $)", _since),
    _rule("q6", r"All (\d+) kinds?", _whole(_kinds)),
    _rule("q6", r"and (\d+) more kinds?", _whole(lambda f: _kinds(f) - KINDS_SHOWN)),
    _rule(
        "head",
        r"policy: (\d+) of (\d+) gates? pass(?:es)?(?:, (\d+) relaxed by the plan)?"
        r"(?:, (\d+) do(?:es)? not apply)?",
        _gates,
    ),
    _rule("head", rf"(\d+) ({_LEVELS})(?= [·␟]|, | $)", _level),
    _rule("q1", rf"^ ␟ (\d+) ({_LEVELS}) ␟ (.*?) $", _named),
    _rule("q1", r", (bound [\d.]+ %)(?= ␟)", _bound),
    _rule("q1", r"^ (␟ .* ␟ )(\d+) $", _row),
    _rule("q1", r"^ Hazards: (.*) $", _dangers),
    _rule("q2", rf"(\d+) ({_STATUS})\b", _basis),
    _rule("q2", r"and (\d+) nodes? on no less", _whole(lambda f: len(f.case["nodes"]) - 8)),
    _rule("q3", r"and (\d+) more claims?", _whole(lambda f: len(f.wrong()) - min(3, f.wronged()))),
    _rule("q3", r"(\d+) in all", _whole(lambda f: len(f.wrong()))),
    _rule("q3", r"(\d+) guarantees? needed by no requirement or hazard", _whole(Facts.unneeded)),
    _rule("q3", r"(?:Refuted: |; )[^“”]*: “([^”]*\d[^”]*)” \(", _felled),
    _rule("q3", r"On it rests? ([^␟;]*?)(?: and (\d+) more)?(?=\.? $|;)", _listed),
    _rule("q3", r"Requirements (?:refuted|not shown): ([^␟]*?)(?: and (\d+) more)?(?=\. )", _listed),
    _rule("q4", r"also ((?:A\d+(?: to A\d+)?(?:, )?)+)", _others),
    _rule("q4", rf"(\d+) about ({'|'.join(_SORTS)})\b", _sort),
    _rule("q4", r"(\d+)(?= of \d+ with an owner and an end)", _whole(lambda f: len(f.owned_ones()))),
    _rule("q4", r"of (\d+) with an owner and an end", _whole(lambda f: len(f.assumptions))),
    _rule("q4", r"([^,:]+?) \((\d+)\)(?=[,;.]| and )", _owners),
    _rule("q4", r"(\d+) ends? when a text changes", _whole(lambda f: sum(not a["until"] for a in f.owned_ones()))),
    _rule("q4", r"(\d+) needed by no requirement", _whole(lambda f: sum(not a["needed_by"] for a in f.assumptions))),
    _rule("q4", rf"assumed since {_DAY}(?: to {_DAY})?", _days),
    _rule("q4", rf"(?:until|the first ends) {_DAY}", _days),
    _rule("assumptions", r"^ ␟ A(\d+) ␟ (.*) ␟ ?(.*?) $", _accepted),
    _rule("q4", r"\bA(\d+)(?= )", _says),
    _rule("q4", r"under (assumptions\.[\w-]+)\.WORD", _place),
    _rule("q5", r" all (\d+)(?= $)", _whole(lambda f: len(f.changes))),
    _rule("q5", r"^ (\d+) more(?:, (\d+) of them better)? $", _rest),
    _rule("q5", r"re-run: (\d+) guarantees?, same answer", _whole(lambda f: f.case["changes"]["again"])),
    _rule("q6", rf"(\d+) ({'|'.join(_DEFICITS)})(?= $|; |, up to)", _deficit),
    _rule("deficits", rf"(\d+) ␟ ({'|'.join(_DEFICITS)})(?= ␟|, up to)", _deficit),
    _rule("", r", up to (\d+) % of them", _whole(Facts.unanswered)),
    _rule(
        "q7",
        r"(\d+) of (\d+) proofs? re-established in this run",
        lambda f, _m, _b: (str(f.proofs("certified-1", "certified-2")), str(f.proofs())),
    ),
    _rule("q7", r"\((\d+) proofs?\)", _whole(lambda f: f.proofs())),
    _rule(
        "q7",
        r"(\d+) of (\d+) answered by two solvers",
        lambda f, _m, _b: (str(f.proofs("certified-2")), str(f.proofs("certified-1", "certified-2"))),
    ),
    _rule(
        "q7",
        r"(?:[(,] ?)(\d+)(?: answers?)? of (?!\d+ other tool)([^(),]+)(?=[,)])",
        lambda f, m, _b: (str(f.tools()[m[2].strip()]), m[2]),
    ),
    _rule("q7", r"(\d+) of (\d+) guarantees? that hold", _confirmed),
    _rule("q7", r"(\d+) of (\d+) other tools?\)", _other_tools),
    _rule("q7", r"without an owner \((.*?)(?: and (\d+) more)?\)", _bare),
    _rule("signature", r"assumptions (A\d+ to A\d+)", lambda f, _m, _b: (f"A1 to A{len(f.assumptions)}",)),
    _rule("signature", r"assumption A(\d+)\b", _whole(lambda f: len(f.assumptions))),
    _rule(
        "signature", r"the digest ([0-9a-f]+)…", lambda _f, m, _b: m.groups()
    ),  # `avow sign` and the audit compute it
    _rule("head", r"(\d+) answers? from earlier runs", _whole(Facts.old)),
    _rule("head", r"SHA-(256)", lambda _f, m, _b: m.groups()),
    # a digest, or its first characters, may be digits only
    _rule("head", r"git HEAD (\d+)(?=,)", lambda f, _m, _b: (str(f.case["run"].get("revision")),)),
    _rule("head", r"ledger (\d+)(?=,)", lambda f, _m, _b: (str(f.case["ledger_head"]),)),
    _rule("gates", r"\(([^()]*\d[^()]*)\)(?=: )", _policy),
    _rule("hazards", r"^ ␟ (.*?) ␟ (.*?)(?: \(security\))? ␟ .*? ␟ .*? weakest: (.*?); (.*?) $", _hazard),
    _rule("standard", r"(\d+) (served|partly served|open|outside)\b", _objectives),
)


def _unread(facts: Facts) -> _Numbers:
    return str(sum(r["level"] not in HOLDS for r in facts.requirements)), str(len(facts.requirements))

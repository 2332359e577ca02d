"""The five answers in few words: for a terminal of 24 lines, and as a comment of 150 words."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from avow.assurance.model import Case, RequirementView
from avow.base.plain import listed
from avow.report.wording import clean, weakest

LINES, WIDTH, WORDS = 24, 80, 150
_MARKDOWN = re.compile(r"([\\`*_{}\[\]#|<>~&$])")


def terminal_lines(case: Case) -> list[str]:
    """At most 24 lines of 80 columns, in the order of the first page; the last names the next step."""
    a = case.answers
    verdict = f": {a.verdict}"
    title = _cut(f"{a.tone.mark} {case.title}", WIDTH - len(verdict))
    lines = [title + verdict]
    if len(lines[0]) > WIDTH:
        lines = [_cut(f"{a.tone.mark} {case.title}:"), *_cut_lines(a.verdict, 2)]
    lines += _cut_lines(a.beside, 3)
    lines += ["1 Claimed"]
    lines += [_cut(f"  {r.tone.mark} {r.id} {_standing(r)}: {_one(r)}") for r in case.listed]
    if len(case.listed) < len(case.requirements):
        lines += [f"  the worst of {len(case.requirements)}"]
    shown = a.based_on[:4]
    more = f"; and {len(a.bases) - len(shown)} more nodes" if len(a.bases) > len(shown) else ""
    lines += ["2 Based on", *_cut_lines("; ".join(f"{b.title} {b.words}" for b in shown) + more, 2)]
    lines += ["3 Weakest evidence", *_cut_lines(weakest_words(case), 3)]
    lines += [f"4 Assumed{f' ({a.owned} with an owner and an end)' if a.owned else ': nothing'}"]
    lines += [_cut(f"  {line.about}: {line.says}") for line in a.supposed]
    head = f" {a.changed_against[:1].lower()}{a.changed_against[1:]}"
    lines += [_cut(f"5 Changed{head.removesuffix(':')}")]
    lines += [_cut(f"  {mark} {words}".rstrip()) for mark, words in a.changed]
    known = _cut_lines(f"deficit: {a.weakened_by}", 3) if a.weakened_by else []
    if len(lines) + len(known) < LINES:
        at = next(n for n, line in enumerate(lines) if line.startswith("4 Assumed"))
        lines = [*lines[:at], *known, *lines[at:]]
    over = len(lines) - (LINES - 1)
    if over > 0:  # drops one or two sorts of assumptions, which the verdict counts
        at = next(n for n, line in enumerate(lines) if line.startswith("5 Changed"))
        lines = [*lines[: at - over - 1], "  …", *lines[at:]]
    return [*lines, _cut(f"next: {_next(case)}")]


def comment(case: Case) -> str:
    """A comment for a change under review: at most 150 words outside its fold. Its first line identifies it for
    updates."""
    a = case.answers
    was = f"{case.baseline.verdict} → " if case.baseline else ""
    lines = [
        f"<!-- avow {escaped(case.system)} -->",
        f"**{a.tone.mark} {escaped(case.title)}: {escaped(was + a.verdict)}**",
        escaped(a.beside),
        escaped(a.changed_against) or "No report has been signed yet.",
        "\n".join(f"- {mark} {escaped(_few(words))}" for mark, words in a.changed if mark),
        f"Weakest evidence: {escaped(_few(weakest_words(case)))}",
        "Hazards: " + (listed([f"{escaped(h.hazard.id)} mitigation {h.level}" for h in case.hazards], 6) or "none"),
        "<details><summary>Requirements and assumptions</summary>",
        "\n".join(
            f"- {r.tone.mark} **{escaped(r.id)}** {r.stands}: {escaped(_one(r))}" for r in case.requirements[:40]
        ),
        "\n".join(f"- {s.number} {escaped(s.words)}" for s in case.assumptions[:40]),
        "</details>",
    ]
    return "\n\n".join(line for line in lines if line) + "\n"


def _standing(r: RequirementView) -> str:
    """For a short line: the rate, if there is one, else the weakest evidence."""
    return r.stands if r.rate and r.rate.bound else f"{r.level}, {weakest(r)}"


def weakest_words(case: Case) -> str:
    """The weakest evidence of the case, or what refutes it, in a sentence or two."""
    a = case.answers
    if a.refuted:
        return a.refuted
    if a.weakest is None:
        return "There is none."
    rest = f"Needed by {listed(a.weakest.needed_by)}" if a.weakest.needed_by else ""
    following = f"Next weakest: {a.next_weakest}" * bool(a.next_weakest)
    said = (f"{a.weakest.title}: “{a.weakest.quote}”: {a.weakest.words}", rest, following, a.unneeded)
    return " ".join(f"{part}." for part in said if part)


def _next(case: Case) -> str:
    failing = [gate for gate in case.gates if not gate.passed]
    steps = [s.text for gate in failing for s in gate.suggestions]
    if steps:
        return steps[0]
    return f"open reports/{case.system}/index.html"


def _one(r: RequirementView) -> str:
    return " ".join(r.words.split())


def _cut(line: str, most: int = WIDTH) -> str:
    margin = "  " if line.startswith("  ") else ""
    line = margin + " ".join(clean(line).split())
    return line if len(line) <= most else line[: most - 1] + "…"


def _cut_lines(text: str, most: int) -> list[str]:
    lines = textwrap.wrap(" ".join(clean(text).split()), WIDTH - 2, initial_indent="  ", subsequent_indent="  ") or [
        "  –"
    ]
    return lines if len(lines) <= most else [*lines[: most - 1], _cut(lines[most - 1][: WIDTH - 1] + "…")]


def _few(text: str, most: int = 24) -> str:
    words: Sequence[str] = text.split()
    return " ".join(words) if len(words) <= most else " ".join(words[:most]) + " …"


def escaped(text: str) -> str:
    """Any text as one line of Markdown."""
    return _MARKDOWN.sub(r"\\\1", " ".join(clean(text).split()))

"""Edits of the ferry's files that change no meaning, drawn by chance."""

from __future__ import annotations

import random
import re


def comment(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    lines.insert(rng.randrange(len(lines)), f"   // {rng.choice(['note', 'node x (', '⊕ ∀'])} {rng.random()}")
    return "\n".join(lines)


def blank(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    lines.insert(rng.randrange(len(lines)), " " * rng.randrange(5))
    return "\n".join(lines)


def spaces(text: str, rng: random.Random) -> str:
    places = [m.start() for m in re.finditer(r" (?=[(|]| *->|and )", text)]
    at = rng.choice(places)
    return text[:at] + " " * rng.randrange(1, 4) + ("\n" if rng.random() < 0.3 else "") + text[at:]


_CLAUSES = re.compile(r"(?:^  (?:assume|guarantee) .*\n(?:^    .*\n)*)+", re.MULTILINE)


_CLAUSE = re.compile(r"^  (?:assume|guarantee) .*\n(?:^    .*\n)*", re.MULTILINE)


def reorder_clauses(text: str, rng: random.Random) -> str:
    block = rng.choice(list(_CLAUSES.finditer(text)))
    clauses = _CLAUSE.findall(block.group())
    ordered = sorted(clauses, key=lambda c: (c.lstrip().startswith("guarantee"), rng.random()))
    return text[: block.start()] + "".join(ordered) + text[block.end() :]


def reorder_conjuncts(text: str, rng: random.Random) -> str:
    pairs = [
        ("in.free(b) and in.level == ok", "in.level == ok and in.free(b)"),
        ("in.free(a) and in.free(b)", "in.free(b) and in.free(a)"),
    ]
    old, new = rng.choice(pairs)
    return text.replace(old, new) if old in text else text.replace(new, old)


def rename_bound(text: str, rng: random.Random) -> str:
    name = rng.choice(["k", "left'", "z2"])
    found = re.search(r"forall\((\S+), (\S+) in NATURAL \| \(in\.free\(", text)
    if found is None:
        return text
    head, tail = text[: found.start()], text[found.start() :]
    end = tail.index("\n")
    formula = re.sub(rf"(?<![\w.]){re.escape(found.group(1))}(?![\w'])", name, tail[:end])
    return head + formula + tail[end:]


def rename_sentence(text: str, rng: random.Random) -> str:
    return text.replace('"Else it waits"', f'"Otherwise it waits {rng.random()}"')


def equal_number(text: str, rng: random.Random) -> str:
    return re.sub(r"Minimum = [\d.]+;", f"Minimum = {rng.choice(['2.5', '2.50', '2.5000'])};", text)


CONTRACT_EDITS = (
    comment,
    blank,
    spaces,
    reorder_clauses,
    reorder_conjuncts,
    rename_bound,
    rename_sentence,
    equal_number,
)


def plan_comment(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    lines.insert(rng.randrange(len(lines)), f"{' ' * rng.randrange(4)}# {rng.choice(['why', 'a: b', '{}'])}")
    return "\n".join(lines)


def plan_blank(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    lines.insert(rng.randrange(len(lines)), "")
    return "\n".join(lines)


def plan_sections(text: str, rng: random.Random) -> str:
    parts = re.split(r"^(?=[a-z]+:)", text, flags=re.MULTILINE)
    head, sections = parts[0], [p if p.endswith("\n") else p + "\n" for p in parts[1:]]
    rng.shuffle(sections)
    return head + "".join(sections)


def plan_title(text: str, rng: random.Random) -> str:
    return re.sub(r"^title: .*$", f"title: A ferry {rng.randrange(99)}", text, flags=re.MULTILINE)


def plan_quotes(text: str, rng: random.Random) -> str:
    return re.sub(r"cases: +200", f"cases:{' ' * rng.randrange(1, 6)}200", text, count=1)


def plan_policy(text: str, rng: random.Random) -> str:
    return re.sub(r"policy: \w+", f"policy: {rng.choice(['default', 'sil1', 'sil2'])}", text)


def plan_criticality(text: str, rng: random.Random) -> str:
    return text.replace("criticality: high", f"criticality: {rng.choice(['low', 'medium', 'high'])}", 1)


PLAN_EDITS = (plan_comment, plan_blank, plan_sections, plan_title, plan_quotes, plan_policy, plan_criticality)

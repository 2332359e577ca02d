"""Names that are nearly the same."""

from __future__ import annotations

import re
from collections.abc import Sequence

from avow.base.persons import distance

_DIGITS = re.compile(r"[0-9]+|'+$")


def similar(names: Sequence[str]) -> list[tuple[str, str]]:
    """The pairs (earlier, later) of names that look like two spellings of one.

    Names of five letters and more that differ by one letter, of nine and more also by two, or only in capitals and
    underscores. Names that differ only in numbers or primes (``arm1``, ``arm2``; ``x``, ``x'``) are meant to differ.
    Time grows linearly with the number of names: candidates share what is left of them without one or two letters.
    """
    buckets: dict[str, list[int]] = {}
    found: dict[tuple[int, int], None] = {}
    for i, name in enumerate(names):
        if len(name) > 80:
            continue
        folded = name.replace("_", "").casefold()
        for key in _deletions(folded):
            for j in buckets.setdefault(key, [])[-20:]:
                if (j, i) not in found and _one_thing(names[j], name):
                    found[(j, i)] = None
            buckets[key].append(i)
    return [(names[i], names[j]) for i, j in found]


def _one_thing(one: str, other: str) -> bool:
    if _DIGITS.sub("", one) == _DIGITS.sub("", other):
        return False
    a, b = one.replace("_", "").casefold(), other.replace("_", "").casefold()
    if a == b:
        return len(a) > 1
    shorter = min(len(a), len(b))
    limit = 0 if shorter < 5 else 1 if shorter < 9 else 2
    return distance(a, b, limit) <= limit


def _deletions(name: str) -> set[str]:
    """The name, and what is left of it without one letter (without two, for long names)."""
    if len(name) < 5:
        return {name}
    once = {name[:i] + name[i + 1 :] for i in range(len(name))}
    found = {name, *once}
    if len(name) + 2 >= 9 and len(name) <= 40:
        found.update(part[:i] + part[i + 1 :] for part in once for i in range(len(part)))
    return found

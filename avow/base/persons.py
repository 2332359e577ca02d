"""Names of persons: which cannot be told from another by reading, and which two may be one person's."""

from __future__ import annotations

import re
import unicodedata

from avow.base.plain import invisible

_FOLDED = str.maketrans({"æ": "a", "œ": "o", "ø": "o", "đ": "d", "ð": "d", "þ": "t", "ł": "l", "ı": "i", "ħ": "h"})
_TITLES = frozenset(
    [
        "mr",
        "mrs",
        "ms",
        "miss",
        "mx",
        "dr",
        "prof",
        "professor",
        "doctor",
        "sir",
        "dame",
        "herr",
        "frau",
        "ing",
        "dipl",
        "msc",
        "bsc",
        "ba",
        "ma",
        "mba",
        "phd",
        "md",
        "jr",
        "sr",
        "junior",
        "senior",
        "esq",
        "ii",
        "iii",
        "iv",
        "ceng",
        "rer",
        "nat",
    ]
)
_ONE_SCRIPT = frozenset(("CJK", "HIRAGANA", "KATAKANA", "KATAKANA-HIRAGANA"))
_BESIDE = re.compile(r"\([^)]*\)|<[^>]*>|@\S+")


def unreadable(name: str) -> str | None:
    """Why a name may look like another's: an invisible or control character, or letters of several scripts."""
    if unseen := invisible(name, allowed=""):
        return f"it holds the invisible character {unseen}"
    for char in name:
        if "FILLER" in unicodedata.name(char, "") or "VARIATION SELECTOR" in unicodedata.name(char, ""):
            return f"it holds the invisible character U+{ord(char):04X}"
    letters = [c for c in _plain(name) if c.isalpha()]
    scripts = {unicodedata.name(c, "?").split()[0] for c in letters}
    scripts = {"CJK" if script in _ONE_SCRIPT else script for script in scripts}
    if len(scripts) > 1:
        return f"it mixes letters of {' and '.join(sorted(scripts))}"
    strange = [c for c in letters if scripts == {"LATIN"} and not c.isascii()]
    return f"'{strange[0]}' is no letter of a name" if strange else None if letters else "it has no letters"


def one_person(first: str, second: str) -> bool:
    """Whether two names may be one person's: titles, accents, case, order and what stands in brackets aside, each word
    of the one is a word of the other or its initial; or they share two words, or an initial and the family name."""
    a, b = _words(first), _words(second)
    if "".join(a) == "".join(b) or _contained(a, b) or _contained(b, a):
        return True
    shared = {word for word in a if len(word) > 1} & {*b}
    return len(shared) > 1 or (a[-1] == b[-1] and a[0][0] == b[0][0])


def _contained(words: list[str], others: list[str]) -> bool:
    return all(any(_alike(word, other) for other in others) for word in words)


def _alike(word: str, other: str) -> bool:
    return word == other or (min(len(word), len(other)) == 1 and word[0] == other[0])


def _plain(name: str) -> str:
    decomposed = unicodedata.normalize("NFKD", unicodedata.normalize("NFKD", name).casefold())
    return "".join(c for c in decomposed if not unicodedata.combining(c)).translate(_FOLDED)


def _words(name: str) -> list[str]:
    """The words of a name, the family name last; with `ae`, `oe`, `ue` as the letter that they stand for."""
    plain = _plain(name)
    plain = _BESIDE.sub(" ", plain) if re.search(r"[^\W\d_]", _BESIDE.sub(" ", plain)) else plain
    family, comma, given = plain.partition(",")
    found = re.findall(r"[^\W\d_]+", re.sub("([aou])e", r"\1", f"{given} {family}" if comma else plain))
    return [word for word in found if word not in _TITLES] or found

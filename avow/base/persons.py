"""What people write of themselves: names, which cannot be told from another by reading, and which two may be one
person's; days, in the past where they say what was done."""

from __future__ import annotations

import re
import unicodedata
from datetime import UTC, date, datetime, timedelta

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
_NOBODY = frozenset(["tbd", "tba", "todo", "unknown", "nobody", "noone", "none", "anonymous", "someone", "somebody"])
"""What stands in the place of a name that somebody has yet to give."""
_ONE_SCRIPT = frozenset(("CJK", "HIRAGANA", "KATAKANA", "KATAKANA-HIRAGANA"))
_BESIDE = re.compile(r"\([^)]*\)|<[^>]*>|@\S+")


def unreadable(name: str) -> str | None:
    """Why a name may look like another's, or is nobody's: an invisible or control character, letters of several
    scripts, no letters, a word in the place of a name."""
    if unseen := invisible(name, allowed=""):
        return f"it holds the invisible character {unseen}"
    for char in name:
        if "FILLER" in unicodedata.name(char, "") or "VARIATION SELECTOR" in unicodedata.name(char, ""):
            return f"it holds the invisible character U+{ord(char):04X}"
    letters = [c for c in _folded(name) if c.isalpha()]
    scripts = {unicodedata.name(c, "?").split()[0] for c in letters}
    scripts = {"CJK" if script in _ONE_SCRIPT else script for script in scripts}
    if len(scripts) > 1:
        return f"it mixes letters of {' and '.join(sorted(scripts))}"
    strange = [c for c in letters if scripts == {"LATIN"} and not c.isascii()]
    if strange:
        return f"'{strange[0]}' is no letter of a name"
    if digit := re.search(r"\d(?=[^\W\d_])", _without_address(name)):
        return f"the digit {digit[0]} stands before a letter"
    if "".join(letters) in _NOBODY:
        return "it names nobody"
    return None if letters else "it has no letters"


def one_person(first: str, second: str) -> bool:
    """Whether two names may be one person's: titles, accents, alphabets, case, order and what stands in brackets aside,
    each word of the one is a word of the other or its initial; or they share two words, or an initial and the family
    name; or one is the other as a user's name, or with a letter mistaken."""
    a, b = _words(first), _words(second)
    if "".join(a) == "".join(b) or _contained(a, b) or _contained(b, a) or _user(a, b) or _user(b, a):
        return True
    shared = {word for word in a if len(word) > 1} & {*b}
    family = a[-1] == b[-1] or (min(len(a), len(b)) > 1 and _mistaken(a[-1], b[-1]))
    return len(shared) > 1 or (family and a[0][0] == b[0][0])


def _user(one: list[str], other: list[str]) -> bool:
    """Whether one word is what another's name is shortened to for a machine: ``alovelace``, ``adal``, ``al``."""
    if len(one) != 1 or len(other) < 2:
        return False
    first, last = other[0], other[-1]
    made = {first[:1] + last, last + first[:1], first + last[:1], last[:1] + first, "".join(word[0] for word in other)}
    return one[0] in made or _mistaken(one[0], first + last) or _mistaken(one[0], last + first)


def _mistaken(one: str, other: str) -> bool:
    """Whether two words are one, a letter aside."""
    return distance(one, other, 1) <= (min(len(one), len(other)) > 3)


def distance(one: str, other: str, limit: int) -> int:
    """How many letters to insert, delete, change or swap with the next; more than `limit` is not counted exactly."""
    if abs(len(one) - len(other)) > limit:
        return limit + 1
    before: list[int] = []
    row = list(range(len(other) + 1))
    for i, a in enumerate(one, 1):
        older, before, row = before, row, [i]
        for j, b in enumerate(other, 1):
            cost = min(before[j] + 1, row[j - 1] + 1, before[j - 1] + (a != b))
            if i > 1 and j > 1 and a == other[j - 2] and one[i - 2] == b:
                cost = min(cost, older[j - 2] + 1)
            row.append(cost)
    return row[-1]


def _contained(words: list[str], others: list[str]) -> bool:
    """Whether each word is one of the others, one of them perhaps with a letter mistaken."""
    left = [word for word in words if not any(_alike(word, other) for other in others)]
    return not left or (len(left) == 1 < len(words) and any(_mistaken(left[0], other) for other in others))


def _alike(word: str, other: str) -> bool:
    return word == other or (min(len(word), len(other)) == 1 and word[0] == other[0])


def _folded(name: str) -> str:
    decomposed = unicodedata.normalize("NFKD", unicodedata.normalize("NFKD", name).casefold())
    return "".join(c for c in decomposed if not unicodedata.combining(c)).translate(_FOLDED)


def _plain(name: str) -> str:
    """In Latin letters, as far as an alphabet has letters that are named by their sound; two that look like one are
    that one, and two by which a letter with marks is written (ä, å, ö, ü) are the letter without."""
    plain = "".join(_sound(c) for c in _folded(name)).replace("rn", "m").replace("vv", "w")
    return plain.replace("ae", "a").replace("aa", "a").replace("oe", "o").replace("ue", "u")


def _sound(letter: str) -> str:
    alphabet, _, called = unicodedata.name(letter, "").partition(" SMALL LETTER ")
    match alphabet:
        case "CYRILLIC":
            return _CYRILLIC.get(called, called[1:] if re.fullmatch("E[^AEIOU]", called) else called[:1]).lower()
        case "GREEK":
            return _GREEK.get(called.removeprefix("FINAL "), called[:1]).lower()
        case _:  # letters of other alphabets, signs, digits: as they stand
            return letter


_CYRILLIC = {
    **{name: name for name in ("TS", "CH", "SH", "ZH", "KH", "YU", "YA", "YI", "YO")},
    "TSE": "TS",
    "CHE": "CH",
    "SHA": "SH",
    "SHCHA": "SHCH",
    "ZHE": "ZH",
    "HA": "KH",
    "IE": "E",
    "SHORT I": "Y",
    "HARD SIGN": "",
    "SOFT SIGN": "",
    "YERU": "Y",
    "UKRAINIAN IE": "E",
    "BYELORUSSIAN-UKRAINIAN I": "I",
    "E": "E",
}
_GREEK = {"THETA": "TH", "CHI": "CH", "PSI": "PS", "PHI": "PH", "XI": "X", "ETA": "I", "UPSILON": "Y"}
"""Letters that sound otherwise than their names begin."""


def _without_address(name: str) -> str:
    plain = _BESIDE.sub(" ", name)
    return plain if re.search(r"[^\W\d_]", plain) else name


def _words(name: str) -> list[str]:
    """The words of a name, the family name last; with `ae`, `oe`, `ue` as the letter that they stand for."""
    plain = _without_address(_plain(name))
    family, comma, given = plain.partition(",")
    found = re.findall(r"[^\W\d_]+", re.sub("([aou])e", r"\1", f"{given} {family}" if comma else plain))
    return [word for word in found if word not in _TITLES] or found


# -- days --------------------------------------------------------------------------------------------------------------

EARLIEST = date(2000, 1, 1)
"""Years before ROS, and before anything that a contract is of: an earlier day is a slip of the pen."""
_DAY = re.compile(r"\d{4}-\d{2}-\d{2}", re.ASCII)


def wrong_day(text: str, *, past: bool = True) -> str:
    """What is wrong with a day such as 2026-11-21, in words; empty: nothing. With `past` it says when something was
    done, and is not still to come anywhere on earth."""
    try:
        if not _DAY.fullmatch(text):  # the standard has other forms, which do not sort as texts
            raise ValueError
        day = date.fromisoformat(text)
    except ValueError:
        return f"{text!r} is no date of the calendar such as 2026-11-21"
    if day < EARLIEST:
        return f"{text} is long before any contract"
    latest = datetime.now(UTC).date() + timedelta(days=1)  # somewhere it may be tomorrow already
    return f"{text} is still to come" if past and day > latest else ""

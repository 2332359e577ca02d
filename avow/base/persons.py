"""Names and dates that people write: names of reviewers, and the days of their work."""

from __future__ import annotations

import re
import unicodedata
from datetime import UTC, date, datetime, timedelta

from avow.base.plain import invisible

_WITHOUT_ACCENTS = str.maketrans({"æ": "a", "œ": "o", "ø": "o", "đ": "d", "ð": "d", "þ": "t", "ł": "l", "ı": "i"})
"""Letters that Unicode does not decompose."""
_TITLES = frozenset(
    (
        *("mr", "mrs", "ms", "miss", "mx", "dr", "prof", "professor", "sir", "dame", "ing", "dipl"),
        *("msc", "bsc", "ba", "ma", "mba", "phd", "md", "jr", "sr", "ii", "iii"),
    )
)
_PLACEHOLDERS = frozenset(
    ("tbd", "tba", "todo", "unknown", "nobody", "noone", "none", "anonymous", "someone", "somebody")
)
_ADDRESS = re.compile(r"\([^)]*\)|<[^>]*>|@\S+")


def unreadable(name: str) -> str | None:
    """Why a text cannot be a person's name: an invisible character, no letters, a placeholder. None: it can."""
    if unseen := invisible(name, allowed=""):
        return f"it holds the invisible character {unseen}"
    letters = "".join(c for c in _folded(name) if c.isalpha())
    if letters in _PLACEHOLDERS:
        return "it names nobody"
    return None if letters else "it has no letters"


def one_person(first: str, second: str) -> bool:
    """Whether two names may be one person's: apart from titles, accents, case and order, each word of one is a word of
    the other or its initial, or the first initial and the family name are the same."""
    a, b = _words(first), _words(second)
    if "".join(a) == "".join(b) or _contained(a, b) or _contained(b, a):
        return True
    return len({word for word in a if len(word) > 1} & {*b}) > 1 or (a[-1] == b[-1] and a[0][0] == b[0][0])


def _contained(words: list[str], others: list[str]) -> bool:
    return all(any(_alike(word, other) for other in others) for word in words)


def _alike(word: str, other: str) -> bool:
    return word == other or (min(len(word), len(other)) == 1 and word[0] == other[0])


def _folded(name: str) -> str:
    decomposed = unicodedata.normalize("NFKD", name.casefold())
    return "".join(c for c in decomposed if not unicodedata.combining(c)).translate(_WITHOUT_ACCENTS)


def _words(name: str) -> list[str]:
    """The words of a name, the family name last. `ae`, `oe` and `ue` are read as the letter that they stand for."""
    plain = re.sub("([aou])e", r"\1", _ADDRESS.sub(" ", _folded(name))).replace("aa", "a")
    family, comma, given = plain.partition(",")
    found = re.findall(r"[^\W\d_]+", f"{given} {family}" if comma else plain)
    return [word for word in found if word not in _TITLES] or found or [plain]


EARLIEST = date(2000, 1, 1)
"""Before ROS: an earlier day is a typing error."""
_DAY = re.compile(r"\d{4}-\d{2}-\d{2}", re.ASCII)


def wrong_day(text: str, *, past: bool = True) -> str:
    """What is wrong with a day such as 2026-11-21, in words; empty if nothing is. With `past` the day must not be in
    the future in any time zone."""
    try:
        if not _DAY.fullmatch(text):  # other forms of ISO 8601 do not sort as texts
            raise ValueError
        day = date.fromisoformat(text)
    except ValueError:
        return f"{text!r} is not a date of the calendar such as 2026-11-21"
    if day < EARLIEST:
        return f"{text} is too early for any contract"
    latest = datetime.now(UTC).date() + timedelta(days=1)  # in some time zone it may be tomorrow already
    return f"{text} is in the future" if past and day > latest else ""

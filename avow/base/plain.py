"""Plain words: identifiers as words for readers who do not know the contract; numbers as people write them; texts that
look alike."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from typing import TYPE_CHECKING

from avow.base.tuning.sizes import DIGITS

if TYPE_CHECKING:
    from fractions import Fraction

_IDENTIFIER = re.compile(
    r"""[A-Za-z]\w*\.[A-Za-z_]\w*      # node.port
      | \b\w*[^\W_]_\w+                # snake_case
      | \b[A-Za-z]\w*/[A-Za-z]\w*      # path/to
      | \b[a-z]+[A-Z]\w*               # camelCase
      | \b(?=\w*\d)[0-9a-f]{12,}\b     # a digest
    """,
    re.VERBOSE,
)
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|_+|-+")


ALLOWS_MORE = "`seconds:` in the plan, or `--seconds`, allows more"
"""What a person can do if a limit ended something."""


def identifiers(text: str) -> tuple[str, ...]:
    """What in a text looks like a name from a contract, a path or a digest."""
    return tuple(found.group() for found in _IDENTIFIER.finditer(text))


def words_of(name: str) -> str:
    """A name as words: ``batteryMonitor`` is *battery monitor*; a name in capitals stays as it is."""
    parts = [part for part in _HUMP.split(name) if part]
    return (
        " ".join(
            part if part.isupper() or (len(parts) == 1 and not part[:1].isupper()) else part[:1].lower() + part[1:]
            for part in parts
        )
        or name
    )


def invisible(text: str, *, allowed: str = "\n\t\u200c\u200d") -> str:
    """The first invisible character that may change the reading (a control character, a mark of the writing direction,
    a zero-width space), as ``U+202E``; empty if none. Joiners and non-joiners of letters are allowed."""
    odd = (char for char in text if char not in allowed and unicodedata.category(char) in _UNSEEN)
    return next((f"U+{ord(char):04X}" for char in odd), "")


def is_blank(text: str) -> bool:
    """Whether a text has no visible letter or digit."""
    return not any(char.isalnum() and "FILLER" not in unicodedata.name(char, "") for char in text)


_UNSEEN = frozenset(("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"))


def bare(name: str) -> str:
    """A heading in the form that is compared: in lower case, with single blanks."""
    return " ".join(name.lower().split())


def as_identifier(name: str) -> str:
    """A name from outside as part of an identifier or of a file's name; the real one is data."""
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in name)


def one_line(text: str) -> str:
    """Text of a contract within a line, such as a comment: no line break may end it early."""
    return "".join(c if c.isprintable() else " " for c in text)


def count(number: int, one: str, many: str = "") -> str:
    """``1 gate``, ``3 gates``."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def listed(items: Sequence[str], most: int = 8) -> str:
    """At most so many items, and the number of the others: ``a, b and 3 more``."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more


def circle(names: Sequence[str], most: int = 12) -> str:
    """Names around a circle, at most so many: ``a → b → a``."""
    more = (f"… {len(names) - most} more …",) if len(names) > most else ()
    return " → ".join((*names[:most], *more, names[0]))


def exact(text: str) -> Fraction:
    """A number of a table or a plan (``2.5``, ``1/3``, ``1e-3``), exactly. Raises ValueError for any other text, and
    for a number that has more digits, written out, than one in a contract may have."""
    from fractions import Fraction

    if not text.isascii() or "_" in text:  # Python's own `int` and `Fraction` accept these
        raise ValueError(text)
    if len(text) > DIGITS or abs(int(text.lower().partition("e")[2] or 0)) > DIGITS:
        raise ValueError(text)
    try:
        return Fraction(text)
    except ZeroDivisionError:
        raise ValueError(text) from None


def decimal(value: Fraction) -> str | None:
    """The number with all its decimals (``-2.5``, ``3``); None if they do not end."""
    digits, rest = 0, value.denominator
    for prime in (2, 5):
        power = 0
        while rest % prime == 0:
            rest, power = rest // prime, power + 1
        digits = max(digits, power)
    if rest != 1:
        return None
    if not digits:
        return str(value.numerator)
    whole = f"{abs(value.numerator) * 10**digits // value.denominator:0{digits + 1}d}"
    return f"{'-' if value < 0 else ''}{whole[:-digits]}.{whole[-digits:]}"


# -- texts that look alike: other forms and cases, invisible characters, similar letters -----------------------------

LOOK = str.maketrans(
    "aceiopsxyABCEHIKMOPSTX",
    "\u0430\u0441\u0435\u0456\u043e\u0440\u0455\u0445\u0443"
    "\u0410\u0412\u0421\u0415\u041d\u0406\u041a\u041c\u041e\u0420\u0405\u0422\u0425",
)
"""Latin letters → those of another alphabet that look the same."""

SEEN_AS = {
    **{other: chr(letter) for letter, other in LOOK.items()},
    **dict(zip(map(ord, "αινορυχ\u03f2ΑΒΕΖΗΙΚΜΝΟΡΤΥΧ"), "aivopuxcABEZHIKMNOPTYX", strict=True)),
    **dict(
        zip(map(ord, "\u0501\u0261\u04bb\u0458\u051b\u051d\u0131\u2212\u2010\u2011\u2013"), "dghjqwi----", strict=True)
    ),
}
"""Letters and signs → those of ASCII that look the same."""


def alike(text: str) -> str:
    """A key that is equal for texts that look the same or differ in case only."""
    plain = unicodedata.normalize("NFKC", text.translate(SEEN_AS))
    seen = "".join(c for c in plain if unicodedata.category(c) not in ("Cc", "Cf"))
    return " ".join(seen.casefold().split())

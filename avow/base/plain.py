"""Plain words: texts that a reader meets before any contract hold no identifiers."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

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
"""What a person can do where a limit ended something."""


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
    """The first character that nobody sees, though it may change what is read (a control character, a mark of the
    direction of writing, a space of no width), as ``U+202E``; empty: none. What joins or parts letters may
    stand there."""
    odd = (char for char in text if char not in allowed and unicodedata.category(char) in _UNSEEN)
    return next((f"U+{ord(char):04X}" for char in odd), "")


def is_blank(text: str) -> bool:
    """Whether a text has neither a letter nor a digit that can be seen."""
    return not any(char.isalnum() and "FILLER" not in unicodedata.name(char, "") for char in text)


_UNSEEN = frozenset(("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"))


def bare(name: str) -> str:
    """A heading as it is compared: in small letters, with single blanks."""
    return " ".join(name.lower().split())


def as_identifier(name: str) -> str:
    """A name from outside as part of an identifier or of a file's name; the real one is data."""
    return "".join(c if c.isascii() and c.isalnum() else "_" for c in name)


def one_line(text: str) -> str:
    """Text of a contract within a line, such as a comment: no line break may end it early."""
    return "".join(c if c.isprintable() else " " for c in text)


def count(number: int, one: str, many: str = "") -> str:
    """``1 gate``, ``3 gates``."""
    return f"{number:,} {one if number == 1 else many or one + 's'}".replace(",", " ")


def listed(items: Sequence[str], most: int = 8) -> str:
    """So many items at most, and how many more there are: ``a, b and 3 more``."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more

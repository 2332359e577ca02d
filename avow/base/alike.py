"""Texts that people take for one another: in other forms and cases, with signs that are not seen, of letters of another
alphabet that look the same."""

from __future__ import annotations

import unicodedata

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
    """The same for all texts that look the same, or differ in case only."""
    plain = unicodedata.normalize("NFKC", text.translate(SEEN_AS))
    seen = "".join(c for c in plain if unicodedata.category(c) not in ("Cc", "Cf"))
    return " ".join(seen.casefold().split())

"""Signs and words of other notations (mathematics, programming languages), each with its RCL equivalent.

A foreign sign is an error whose hint says what to write. If it has only one possible meaning, it is read as that, so
that it causes no further errors.
"""

from __future__ import annotations

import unicodedata
from typing import NamedTuple


class Foreign(NamedTuple):
    """A foreign sign: what to write instead, and the token (type and text) that it is read as; None: it is skipped."""

    hint: str
    token: tuple[str, str] | None = None


def _as(kind: str, text: str, *signs: str, hint: str | None = None) -> dict[str, Foreign]:
    return dict.fromkeys(signs, Foreign(hint or f"write `{text}`", (kind, text)))


def _hint(hint: str, *signs: str) -> dict[str, Foreign]:
    return dict.fromkeys(signs, Foreign(hint))


_QUANTIFIER = "write `{0}(x in S | …)`"
_QUOTES = 'write texts as `"…"`, and the elements of types without quotation marks'
_ONE_STEP = "properties of whole runs stand in the plan; `previous`, `once` and their like speak of earlier steps"

SIGNS: dict[str, Foreign] = {
    **_as("IFF", "<=>", "<->", "<==>", "↔", "⇔", "⟺", "⟷", "≡"),
    **_as("IMPLIES", "->", "==>", "⇒", "⟹", "⊃"),
    **_as("IMPLIES", "->", "=>", hint="write `->` (if … then), or `>=` (at least)"),
    **_as("IMPLIES", "->", "→", "⟶", hint="write `->`; in the type of a function `-->`"),
    **_as("AND", "and", "&&", "&", "∧", "/\\"),
    **_as("OR", "or", "||", "∨", "\\/"),
    **_as("NOT", "not", "!", "¬", "~"),
    **_as("EQ", "==", "===", "≔"),
    **_as("EQ", "==", ":=", hint="write `==` for equality, `=` for a constant"),
    **_as("NE", "!=", "/=", "=/=", "!==", "~=", "≠"),
    **_as("LE", "<=", "=<", "≤", "⩽", "≦"),
    **_as("GE", ">=", "≥", "⩾", "≧"),
    **_as("IN", "in", "∈"),
    **_as("NOT_IN", "!in", "∉"),
    **_as("UNIQUE", "exists_unique", "∃!", "exists!", hint=_QUANTIFIER.format("exists_unique")),
    **_as("FORALL", "forall", "∀", hint=_QUANTIFIER.format("forall")),
    **_as("EXISTS", "exists", "∃", hint=_QUANTIFIER.format("exists")),
    **_as("TRUE", "TRUE", "⊤"),
    **_as("FALSE", "FALSE", "⊥"),
    **_as("STAR", "*", "·", "⋅", "•", "∗"),
    **_as("STAR", "*", "^", "**", hint="RCL has no powers: write `x * x`"),
    **_as("STAR", "*", "%", hint="write `mod(a, 3)` for a remainder, 0.9 for 90 percent"),
    **_as("SLASH", "/", "÷", "∕"),
    **_as("MINUS", "-", "−", "–", "—"),
    **_as("NAME", "x", "×", hint="write `x` between types, `*` between numbers"),
    **_as("BAR", "|", "∣", "❘"),
    **_as("BUILTIN", "REAL", "ℝ"),
    **_as("BUILTIN", "INTEGER", "ℤ"),
    **_as("BUILTIN", "NATURAL", "ℕ"),
    **_as("BUILTIN", "BOOL", "𝔹"),
    **_as("LT", "<", "⟨", "〈", hint="write sequences as `<a, b>`"),
    **_as("GT", ">", "⟩", "〉", hint="write sequences as `<a, b>`"),
    **_as("UPTO", "upto", "...", "..", "…", hint="write a range as `<a upto b>`"),
    **_as("SLASH", "/", "::", hint="write `package/Type` (a ROS type), `in.v`, or `|` after a quantifier's variables"),
    **_hint("RCL has no inverse functions: write `exists(x in REAL | f(x) == y and …)`", "^-1", "⁻¹"),
    **_hint("write `x in A and x in B`, `forall(x in A | x in B)`", "∪", "∩", "⊆", "⊂", "⊇", "∖"),
    **_hint("write the empty set as `{}`", "∅"),
    **_hint("RCL has no powers: write `x * x`", "²", "³"),
    **_hint("write `if c then a else b`", "?"),
    **_hint("write operators as words: `in`, `and`, `or`, `not`, `forall`, `exists`", "\\"),
    **_hint("write the length of a sequence as `length(s)`; a comment begins with `//`", "#"),
    **_hint(_QUOTES, "'", "`", "“", "”", "„", "’", "′", "‘"),
    **_hint(_ONE_STEP, "@", "□", "◇", "◊", "◯"),
}
"""Foreign signs by their text."""


def foreign(sign: str) -> Foreign:
    """The entry for a sign that the lexer classified as foreign."""
    return SIGNS.get(sign, SIGNS["\\"])


def invisible(character: str) -> str | None:
    """The name of an invisible character, such as a no-break space; None for any other."""
    if unicodedata.category(character) not in ("Cf", "Zs", "Zl", "Zp"):
        return None
    return f"U+{ord(character):04X} ({unicodedata.name(character, 'without a name').lower()})"


FIELDS = "give the variable the type of that field; the plan says which field of the message it is"
APART = "take a tuple apart by its items, `exists(a, b in REAL | in.pair == (a, b) and …)`, or make it a record"

_HINTS = {
    "write `TRUE`": "true",
    "write `FALSE`": "false",
    _ONE_STEP: "always globally finally previously old pre prev last",
    "RCL has `+ - * /`, `abs`, `min`, `max`, `mod`, `div`, `sqrt`, `sin`, `cos`, `atan2`; no other functions": "tan "
    "asin acos pow exp log floor ceil round fabs minimum maximum remainder quotient",
    "write `sqrt(r)`, `norm(x, y)`, `dot(v, w)`": "sqrt norm dot hypot dist distance magnitude scalar",
    "write the length of a sequence as `length(s)`": "len size count card length",
    "write a range as `<a upto b>`, both ends included": "range seq to",
    "write `a and b`, `a or b`, `not a`, `a -> b`, `a <=> b`, `xor(a, b)`": "and or not implies then iff equiv xor",
    "write `forall(x in S | …)` or `exists(x in S | …)`": "forall exists for all such st where with",
    "write `x in S`, `x !in S`": "in notin nin contains has includes",
    "write `==`, `!=`, `<`, `<=`, `>`, `>=`": "is equals eq less greater more bigger smaller",
    "write `low <= x <= high`": "between",
    "write `mod(a, 3)`, `div(a, 3)`": "mod modulo rem div",
    "write `abs(a)`, `min(a, b)`, `max(a, b)`": "abs min max",
    "write `if c then a else b`, or `A -> B` for: if A then B": "if ite cond when whenever unless otherwise elif",
    "write `exists(x in REAL | c == f(x))` where any value will do": "_",
    "every variable has a value of its type, and a REAL is finite": "none null nullptr nil nan inf infinity",
}
WORDS = {word: hint for hint, words in _HINTS.items() for word in words.split()}
"""Other languages' names of values, functions and operators, in lower case, with the text to write instead."""

FOREIGN_TYPES = {
    **dict.fromkeys(("string", "str", "text"), "STRING"),
    **dict.fromkeys(("bool", "boolean"), "BOOL"),
    **dict.fromkeys(("int", "integer", "ints", "long", "z", "int8", "int16", "int32", "int64"), "INTEGER"),
    **dict.fromkeys(("nat", "natural", "unsigned", "n", "uint", "uint8", "uint16", "uint32", "uint64"), "NATURAL"),
    **dict.fromkeys(("float", "double", "real", "number", "decimal", "r", "float32", "float64"), "REAL"),
}
"""Other languages' names of the built-in types, in lower case."""

"""What other notations write (mathematics, programming languages, other specification languages), and what RCL does.

A foreign sign is an error that says what to write. Where it can mean one thing only, it is read as that thing, so that
nothing else is reported because of it.
"""

from __future__ import annotations

import unicodedata
from typing import NamedTuple


class Foreign(NamedTuple):
    """A foreign sign: what to write instead, and the token (type and text) that it is read as; None: it is left out."""

    hint: str
    token: tuple[str, str] | None = None


def _as(kind: str, text: str, *signs: str, hint: str | None = None) -> dict[str, Foreign]:
    return dict.fromkeys(signs, Foreign(hint or f"write `{text}`", (kind, text)))


def _hint(hint: str, *signs: str) -> dict[str, Foreign]:
    return dict.fromkeys(signs, Foreign(hint))


_COLLECTIONS = "write sets as `{a, b}` and sequences as `<a, b>`"
_QUANTIFIER = "write `{0}(x in S | …)`"
_SET_OPERATORS = "RCL has no operators on sets: write `x in A and x in B`, `forall(x in A | x in B)`"

SIGNS: dict[str, Foreign] = {
    **_as("IFF", "<=>", "<->", "<==>", "↔", "⇔", "⟺", "⟷", "≡"),
    **_as("IMPLIES", "->", "==>", "⇒", "⟹", "⊃"),
    **_as("IMPLIES", "->", "=>", hint="write `->` (if … then), or `>=` (at least)"),
    **_as("IMPLIES", "->", "→", "⟶", hint="write `->`; in the type of a function `-->`"),
    **_as("AND", "and", "&&", "&", "∧", "/\\"),
    **_as("OR", "or", "||", "∨", "\\/"),
    **_as("NOT", "not", "!", "¬"),
    **_as("NOT", "not", "~", hint="write `not`"),
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
    **_as("STAR", "*", "·", "⋅", "•", "∗", hint="write `*`; after the variables of a quantifier `|`"),
    **_as("STAR", "*", "^", "**", hint="RCL has no powers: write `x * x`"),
    **_as("STAR", "*", "%", hint="RCL has no remainder"),
    **_as("SLASH", "/", "÷", "∕"),
    **_as("MINUS", "-", "−", "–", "—", hint="write the plain minus `-`"),
    **_as("NAME", "x", "×", hint="write `x` between types, `*` between numbers"),
    **_as("BAR", "|", "∣", "❘"),
    **_as("BUILTIN", "REAL", "ℝ"),
    **_as("BUILTIN", "INTEGER", "ℤ"),
    **_as("BUILTIN", "NATURAL", "ℕ"),
    **_as("BUILTIN", "BOOL", "𝔹"),
    **_as("LT", "<", "⟨", "〈", hint="write sequences as `<a, b>`"),
    **_as("GT", ">", "⟩", "〉", hint="write sequences as `<a, b>`"),
    **_as("UPTO", "upto", "...", "..", "…", hint="write a range as `<a upto b>`"),
    **_hint(
        "RCL has no inverse functions: say which values are meant, `exists(x in REAL | f(x) == y and …)`", "^-1", "⁻¹"
    ),
    **_hint("write `REAL`: reals are exact", "ℚ"),
    **_hint(_SET_OPERATORS, "∪", "∩", "⊆", "⊂", "⊇", "∖"),
    **_hint("the empty set is written `{}`", "∅"),
    **_hint("RCL has no powers: write `x * x`", "²", "³"),
    **_hint("RCL has no roots: say what its square is", "√"),
    **_hint("write `if c then a else b`", "?"),
    **_as("SLASH", "/", "::", hint="write `package/Type` (a ROS type), `in.v`, or `|` after a quantifier's variables"),
    **_hint("write operators as words: `in`, `and`, `or`, `not`, `forall`, `exists`", "\\"),
    **_hint("the length of a sequence is written `length(s)`; a comment begins with `//`", "#"),
    **_hint('write texts as `"…"`, and the elements of types without quotation marks', "'", "`"),
    **_hint("RCL speaks of one step: there is no earlier or later value", "@"),
    **_hint("a contract speaks of one step; properties of whole runs stand in the plan", "□", "◇", "◊", "◯"),
    **_hint('write the straight quotation mark `"`', "“", "”", "„"),
    **_hint("write the straight quote `'`", "’", "′", "‘"),
}
"""Signs, by what they look like."""

_COMMANDS = {
    **dict.fromkeys(("forall", "A"), "∀"),
    **dict.fromkeys(("exists", "E"), "∃"),
    **dict.fromkeys(("in", "isin"), "∈"),
    "notin": "∉",
    **dict.fromkeys(("land", "wedge", "and"), "∧"),
    **dict.fromkeys(("lor", "vee", "or"), "∨"),
    **dict.fromkeys(("lnot", "neg", "not"), "¬"),
    **dict.fromkeys(("Rightarrow", "implies", "Longrightarrow"), "⇒"),
    **dict.fromkeys(("to", "rightarrow", "longrightarrow"), "→"),
    **dict.fromkeys(("iff", "Leftrightarrow", "leftrightarrow", "equiv"), "⇔"),
    **dict.fromkeys(("le", "leq", "leqslant"), "≤"),
    **dict.fromkeys(("ge", "geq", "geqslant"), "≥"),
    **dict.fromkeys(("ne", "neq"), "≠"),
    **dict.fromkeys(("times", "X"), "×"),
    "cdot": "·",
    **dict.fromkeys(("mid", "vert"), "∣"),
    **dict.fromkeys(("top", "true"), "⊤"),
    **dict.fromkeys(("bot", "false"), "⊥"),
    **dict.fromkeys(("cup", "union", "cap", "intersect", "subseteq", "subset", "setminus"), "∪"),
    **dict.fromkeys(("emptyset", "varnothing"), "∅"),
    **dict.fromkeys(("ldots", "dots"), "…"),
}
"""LaTeX's and TLA+'s words after a backslash, by the sign that they stand for."""


def foreign(sign: str) -> Foreign:
    """What is known of a sign that the lexer took for foreign."""
    if sign in SIGNS:
        return SIGNS[sign]
    if sign.startswith("\\"):
        return SIGNS[_COMMANDS.get(sign[1:], "\\")]
    return Foreign(_COLLECTIONS)


def wide(sign: str) -> str | None:
    """The plain ASCII sign that a full-width one (of an East Asian keyboard) stands for."""
    plain = {"。": ".", "、": ","}.get(sign) or unicodedata.normalize("NFKC", sign)
    return plain if "\uff01" <= sign <= "\uff5e" or sign in "。、" else None


def invisible(character: str) -> str | None:
    """The name of a character that nobody sees, such as a no-break space; None for any other."""
    if unicodedata.category(character) not in ("Cf", "Zs", "Zl", "Zp"):
        return None
    return f"U+{ord(character):04X} ({unicodedata.name(character, 'without a name').lower()})"


FIELDS = "give the variable the type of the field that is meant; the plan says which field of the message it is"
_ONE_STEP = "a contract speaks of one step; properties of whole runs stand in the plan"
_CONDITIONAL = "write `if c then a else b`"
_ARITHMETIC = "RCL has `+ - * /`, `abs`, `min`, `max`, `mod`, `div`, and no other functions of numbers: compare them"

FOREIGN_NAMES = {
    **dict.fromkeys(("true", "True"), "write `TRUE`"),
    **dict.fromkeys(("false", "False"), "write `FALSE`"),
    **dict.fromkeys(("EmptySet", "emptyset"), "the empty set is written `{}`"),
    **dict.fromkeys(("always", "globally", "eventually", "finally", "next", "until", "once"), _ONE_STEP),
    **dict.fromkeys(("historically", "previously", "since", "G", "F", "X", "old", "pre", "post"), _ONE_STEP),
    **dict.fromkeys(("prev", "previous", "last"), _ONE_STEP),
    **dict.fromkeys(("Abs", "ABS", "magnitude"), "write `abs(r)`"),
    **dict.fromkeys(("fabs", "sqrt", "sin", "cos", "tan", "atan2", "pow", "exp", "log", "floor", "ceil"), _ARITHMETIC),
    **dict.fromkeys(("round", "norm", "hypot", "dist", "distance"), _ARITHMETIC),
    **{word: f"write `{word.lower()[:3]}(a, b)`" for word in ("Min", "MIN", "minimum", "Max", "MAX", "maximum")},
    **dict.fromkeys(("modulo", "remainder", "rem", "quotient"), "write `mod(n, 3)` and `div(n, 3)`"),
    **dict.fromkeys(("len", "size", "count", "card"), "the length of a sequence is written `length(s)`"),
    **dict.fromkeys(("range", "Range", "seq"), "write a range as `<a upto b>`, both ends included"),
    **dict.fromkeys(("And", "Or", "Not", "Implies", "Iff", "Xor"), "write `a and b`, `a or b`, `not a`, `a -> b`"),
    **dict.fromkeys(("ForAll", "Forall", "forAll"), _QUANTIFIER.format("forall")),
    **dict.fromkeys(("Exists", "exist"), _QUANTIFIER.format("exists")),
    "_": "where any value will do, say that there is one: `exists(x in REAL | c == f(x))`",
    **dict.fromkeys(("ite", "cond", "If", "IF"), _CONDITIONAL),
    **{word: f"directly before a parenthesis it is an operator: `{word}(a, b)`" for word in ("xor", "mod", "div")},
    **{word: f"directly before a parenthesis it is an operator: `{word}(…)`" for word in ("abs", "min", "max")},
    **dict.fromkeys(("None", "null", "nullptr", "NULL", "nil", "NaN", "nan"), "every variable has a value of its type"),
    **dict.fromkeys(("inf", "Inf", "INFINITY", "infinity"), "a REAL is finite"),
}
"""Names that other languages give to values and functions, with what to write."""

OPERATORS = {
    **dict.fromkeys(("true", "True"), "write `TRUE`"),
    **dict.fromkeys(("false", "False"), "write `FALSE`"),
    **dict.fromkeys(("implies", "THEN", "IMPLIES", "Implies"), "write `->`"),
    **dict.fromkeys(("iff", "IFF", "equiv"), "write `<=>`"),
    **{w: f"write `{w.lower()}`" for w in ("AND", "OR", "NOT", "IN", "FORALL", "EXISTS", "And", "Or", "Not")},
    "is": "write `==` (or `!=`, `<`, `<=`, `>`, `>=`)",
    **dict.fromkeys(("equals", "eq"), "write `==`"),
    **dict.fromkeys(("xor", "XOR", "Xor"), "write `xor(a, b)` for: either a or b"),
    **dict.fromkeys(("mod", "rem", "modulo"), "write `mod(a, 3)`"),
    "div": "write `div(a, 3)`",
    "unless": "write `not B -> A` for: A unless B",
    "between": "write `low <= x <= high`",
    "to": "write a range as `<a upto b>`, both ends included",
    **dict.fromkeys(("notin", "nin"), "write `!in`"),
    **dict.fromkeys(("such", "st", "where", "with", "suchthat"), "write `|` between the variables and the formula"),
    "for": "write `forall(x in S | …)` or `exists(x in S | …)`",
    **dict.fromkeys(("contains", "has", "includes"), "write `x in S`"),
    **dict.fromkeys(("less", "greater", "more", "bigger", "smaller"), "write `<`, `<=`, `>` or `>=`"),
    **dict.fromkeys(("otherwise", "ELSE", "elif", "IF", "If"), _CONDITIONAL),
    **dict.fromkeys(("if", "when", "whenever"), "write `A -> B` for: if A then B, `A <=> B` for: A if and only if B"),
    "let": "RCL has no `let`: write the term itself, or `forall(x in REAL | x == … -> …)`",
    "as": "RCL converts whole numbers to reals by itself, and nothing else",
}
"""Words that stand where an operator should, with what to write."""

FOREIGN_TYPES = {
    **dict.fromkeys(("string", "str", "text"), "STRING"),
    **dict.fromkeys(("bool", "boolean"), "BOOL"),
    **dict.fromkeys(("int", "integer", "ints", "long", "z", "int8", "int16", "int32", "int64"), "INTEGER"),
    **dict.fromkeys(("nat", "natural", "unsigned", "n", "uint", "uint8", "uint16", "uint32", "uint64"), "NATURAL"),
    **dict.fromkeys(("float", "double", "real", "number", "decimal", "r", "float32", "float64"), "REAL"),
}
"""Other languages' names of the built-in types, in small letters."""

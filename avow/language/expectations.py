"""What to say where the parser met a token that cannot stand there."""

from __future__ import annotations

from collections.abc import Sequence

from avow.language.foreign import FIELDS, FOREIGN_TYPES, OPERATORS
from avow.language.lexer import KEYWORDS, SYMBOLS, Token
from avow.language.source import Reports

_WORDS = {
    **{kind: f"`{sign}`" for sign, kind in SYMBOLS.items()},
    "NAME": "a name",
    "NUMBER": "a number",
    "STRING": "a string",
    "BUILTIN": "a built-in type",
    "EMPTY_SEQUENCE": "`<>`",
    "NOT_IN": "`!in`",
    "IN": "`in`",
    "OUT": "`out`",
    "MATCHES": "`matches`",
    "UPTO": "`upto`",
    "THEN": "`then`",
    "ELSE": "`else`",
}
_TERM = frozenset(("NAME", "NUMBER", "LBRACE", "LPAR"))


def explain(
    start: str, tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str], reports: Reports
) -> None:
    """Report the token `found`, which is at that position and where one of `expected` (terminals) should stand."""
    if expected == {"COLON", "COMMA"}:  # after a port's name, most need its type
        expected = frozenset({"COLON"})
    if expected == {"NAME", "DEFINE"}:  # where a declaration begins, most want the name
        expected = frozenset({"NAME"})
    hint = _hint(start, tokens, at, found, expected)
    if found.type == "$END" and tokens:
        last = tokens[-1]
        message = f"{_expected(start, expected)} is missing after `{last.text[:40]}`"
        reports.error("RCL120", message, last.start, last.end, hint=hint)
        return
    message = f"expected {_expected(start, expected)} and not `{found.text[:40]}`"
    if found.type == "RPAR" and start == "formula" and "$END" in expected:
        message = "this `)` closes nothing"
    reports.error("RCL120", message, found.start, found.end, hint=hint)


def _expected(start: str, expected: frozenset[str]) -> str:
    if expected >= _TERM:
        return "a formula" if "NOT" in expected else "a term"
    if start in ("declaration", "ports") and {"NAME", "BUILTIN"} <= expected:
        return "a type"
    end = {"declaration": "`;`"}.get(start, "`)`")
    ending = {end} if "$END" in expected else set()
    if {"AND", "OR", "IMPLIES", "PLUS"} & expected:
        closing = ending | {_WORDS[k] for k in expected & {"COMMA", "RPAR", "BAR", "RBRACE", "UPTO", "THEN", "ELSE"}}
        if "GT" in expected and "EQ" not in expected:
            closing.add("`>`")
        return " or ".join(["an operator", *sorted(closing)])
    words = {kind: _WORDS.get(kind, f"`{kind.lower()}`") for kind in expected - {"$END"}}
    if "ARROW" in expected and "NAME" in words:
        words["NAME"] = "`x`"
    named = sorted(ending | set(words.values()))
    if len(named) > 6:
        named = [*named[:6], "…"]
    return ", ".join(named[:-1]) + (" or " if len(named) > 1 else "") + named[-1] if named else "nothing more"


def _hint(start: str, tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str]) -> str | None:
    before = tokens[at - 1] if at else None
    after = tokens[at + 1] if at + 1 < len(tokens) else None
    if before is not None and before.type == "DEFINE":
        return f"{about_keyword(before)}; a definition is written `define name(i : NATURAL) = F;`"
    if expected == {"NAME"} and after is not None and after.type == "IN":  # forall(if in REAL | …)
        return about_keyword(found)
    if start == "formula":
        said = _in_formula(tokens[:at], before, found, after, expected)
    elif start == "topics":
        said = _in_topics(tokens, at, found, expected)
    else:
        said = _in_types(start, tokens, at, found, expected)
    return said or about_keyword(found)


def _in_formula(
    earlier: Sequence[Token], before: Token | None, found: Token, after: Token | None, expected: frozenset[str]
) -> str | None:
    return (
        _in_relation(earlier, before, found, after, expected)
        or _in_quantifier(earlier, before, found, expected)
        or _in_general(earlier, before, found, expected)
    )


def _in_relation(
    earlier: Sequence[Token], before: Token | None, found: Token, after: Token | None, expected: frozenset[str]
) -> str | None:
    """Comparisons and names of inputs and outputs."""
    if before is not None and before.end < found.start and before.text + found.text in SYMBOLS:
        return f"write `{before.text}{found.text}` without a space in it"
    if before is not None and before.type == "LPAR" and found.type == "STAR":
        return "a comment is written `/* … */`"
    if before is not None and before.type == "LPAR" and found.type in (*_ORDER, "AND", "OR", "IMPLIES"):
        return "an operator stands between what it joins: `r > 3 and r < 5`"
    if found.type == "EQUALS" or (before is not None and before.type == "EQUALS"):
        return "equality is written `==`"
    if found.type in ("SINCE", "UNTIL") and "AND" in expected:
        return f"`{found.text}` does not chain: put the parentheses that you mean"
    if found.type == "EMPTY_SEQUENCE" and "NE" in expected:
        return "unequal is written `!=`"
    if found.type == "NOT" and after is not None and after.type in ("IN", "EQ", "EQUALS"):
        return "write `!in`" if after.type == "IN" else "write `!=`"
    if _has_no_left_side(earlier, before, found, expected):
        return "say what is compared each time: `0 < r and r < 3`, or `0 < r < 3`"
    if expected == {"DOT"} and before is not None:
        name = found if found.type == "NAME" else after
        if name is not None and name.type == "NAME":
            return f"write `{before.text}.{name.text}`"
        return f"write `{before.text}.v` for the {before.text}put `v`: `{before.text}` is a keyword"
    if found.type == "DOT" and len(earlier) > 2 and [t.type for t in earlier[-2:]] == ["DOT", "NAME"]:
        return f"a value has no fields: {FIELDS}"
    if found.type == "DOT" and after is not None and after.type == "NUMBER":
        return f"write `0.{after.text}`"
    return None


def _has_no_left_side(earlier: Sequence[Token], before: Token | None, found: Token, expected: frozenset[str]) -> bool:
    """`0 < r and < 3`: where `<` begins a sequence that is none, or another sign begins nothing."""
    if found.type in ("GT", "LE", "GE", "EQ", "NE", "IN", "NOT_IN"):
        return before is None or before.type in _CONNECTIVES
    if "GT" not in expected or "EQ" in expected:
        return False
    opening = next((i for i in range(len(earlier) - 1, -1, -1) if earlier[i].type == "LT"), None)
    return opening is not None and opening > 0 and earlier[opening - 1].type in _CONNECTIVES


def _in_quantifier(
    earlier: Sequence[Token], before: Token | None, found: Token, expected: frozenset[str]
) -> str | None:
    if before is not None and before.type in _QUANTIFIERS:
        return f"write `{before.text}(x in S | …)`"
    like = next(
        (t for t in earlier if t.type == "NAME" and t.text.casefold().replace("_", "") in _QUANTIFIER_LIKE), None
    )
    if like is not None and (found.type in ("BAR", "IN") or found.text == "for" or before is like):
        return f"write `{_QUANTIFIER_LIKE[like.text.casefold().replace('_', '')]}(x in S | …)`, not `{like.text}`"
    if found.type in _QUANTIFIERS and before is not None and before.type == "NAME":
        return f"write `{found.text}(x in S | …)`"
    if not any(t.type in _QUANTIFIERS for t in earlier):
        return None
    if found.type == "IN" and "NAME" in expected and before is not None and before.type in ("LPAR", "COMMA"):
        return "name the variable before `in`: `forall(x in REAL | …)`"
    if found.type == "BAR":
        if any(t.type == "SEMICOLON" for t in earlier):
            return "`;` stands for the `|`: separate the variables by commas, `x in REAL, y in REAL`"
        if expected != {"IN", "COMMA"}:
            return "one bar stands in a quantifier, between the variables and the formula: `forall(x in REAL | …)`"
    if expected <= {"IN", "COMMA"}:
        if any(t.type == "IN" for t in earlier) and found.type in _RELATIONS:
            return _BAR
        return "say what each variable ranges over before the bar: `forall(x, y in REAL, i in NATURAL | …)`"
    if before is not None and before.type == "LPAR" and found.type == "LPAR" and expected == {"NAME"}:
        return "the variables stand without parentheses: `exists_unique(x, y in REAL | …)`"
    if "BAR" not in expected:
        return _BAR if found.type == "COLON" else None
    if found.text == "x":
        return "a variable ranges over one type: write `x, y in REAL`, not `(x, y) in REAL x REAL`"
    if found.text in OPERATORS or found.type not in ("NAME", "NUMBER"):
        return _BAR
    return None


def _in_general(earlier: Sequence[Token], before: Token | None, found: Token, expected: frozenset[str]) -> str | None:
    if found.type in ("AND", "OR", "IMPLIES", "IFF") and expected >= _TERM:
        return f"`{found.text}` joins two formulas: one is missing before it"
    if found.type in _ORDER and "RBRACE" in expected:
        return "`{ … }` is a set: formulas are grouped by `( … )`"
    if found.type == "ARROW":
        return "implication is written `->`"
    if found.type == "SEMICOLON":
        if "RBRACE" in expected:
            return "separate them by commas"
        return "no `;` here: it ends a declaration, or stands for the `|` of a quantifier"
    if found.type == "COLON":
        return "no `:` here: `x in S` says that x is in S; a type is said in `inputs`, `outputs`, or the quantifier"
    if found.type == "BAR":
        return "the bar stands in quantifiers only; the length of a sequence is `length(s)`, and or is `or`"
    if earlier and earlier[0].text in ("If", "IF", "when", "When", "while"):
        return "write `A -> B` for: if A then B"
    if ({"THEN", "ELSE"} & expected and found.type == "$END") or found.type in ("THEN", "ELSE"):
        return "write `if F then s else t`; and `A -> B` for: if A then B"
    if found.type == "IF" and "NAME" in expected:
        return "put parentheses around it: `x == (if c then a else b)`"
    if found.type == "COMMA":
        if before is not None and any(t.type in ("IN", "NOT_IN") for t in earlier[-3:]):
            return "join formulas by `and`; a set has braces: `x in {a, b}`"
        return "join formulas by `and`"
    if found.type == "LBRACE" or (found.type == "BUILTIN" and before is not None):
        return "`{ … }` is a set: formulas are grouped by `( … )`" if found.type == "LBRACE" else None
    for token in (found, before):
        if (
            token is not None
            and token.type in ("NAME", "IF")
            and (token.text in OPERATORS or token.text.lower() in OPERATORS)
        ):
            return OPERATORS.get(token.text) or OPERATORS[token.text.lower()]
    if before is not None and before.text == "length":
        return "write `length(s)`"
    if found.type in ("NAME", "NUMBER", "STRING", "IN", "OUT") and "COMMA" in expected:
        return "separate them by commas"
    if found.type in ("NAME", "NUMBER", "STRING", "LPAR", "FORALL", "EXISTS", "UNIQUE", "NOT") and "AND" in expected:
        if before is not None and before.type == "NAME" and found.type in ("NAME", "NUMBER"):
            return f"write `{before.text}(…)` if it is applied; join formulas by `and`, `or` or `->`"
        return "join formulas by `and`, `or` or `->`"
    return None


def about_keyword(found: Token) -> str | None:
    """What to say where a name is wanted and a keyword stands."""
    return f"`{found.text}` is a keyword and cannot be a name" if found.text in KEYWORDS else None


_BAR = "a bar stands between the variables and the formula: `forall(x in REAL | …)`"
_ORDER = ("EQ", "NE", "LE", "GE", "LT", "GT")
_QUANTIFIERS = frozenset(("FORALL", "EXISTS", "UNIQUE"))
_CONNECTIVES = frozenset(("AND", "OR", "NOT", "IMPLIES", "IFF", "BAR"))
_RELATIONS = frozenset(("EQ", "NE", "LE", "GE", "LT", "GT", "LPAR", "DOT", "PLUS", "MINUS"))
_QUANTIFIER_LIKE = {
    **dict.fromkeys(("exists1", "existsone", "existsunique", "existsexactlyone", "unique"), "exists_unique"),
    **dict.fromkeys(("forall", "all", "every", "foreach", "forevery"), "forall"),
    **dict.fromkeys(("exists", "exist", "some", "forsome", "any"), "exists"),
}


SECTION_FORMS = {
    "INPUTS": "write `inputs( name : TYPE, … )`, or `inputs()` where there are none",
    "OUTPUTS": "write `outputs( name : TYPE, … )`, or `outputs()` where there are none",
    "TOPICS": "write `topics( package/Type name matches(in.variable), … )`, or `topics()` where there are none",
}
NEAR_SECTIONS = {
    **dict.fromkeys(("input", "ins"), "inputs"),
    **dict.fromkeys(("output", "outs"), "outputs"),
    "topic": "topics",
    **dict.fromkeys(("assumes", "assumption", "assumptions", "requires", "require"), "assume"),
    **dict.fromkeys(("guarantees", "garantee", "guarentee", "guaranty", "ensures", "ensure"), "guarantee"),
}


# --- declarations, lists of inputs or outputs, topics -----------------------------------------------------------------

_TOPIC = "a topic is `package/Type name` with, if it carries a variable, `matches(in.v)` or `matches(out.v)`"
_NAMES = "names are made of letters, digits and `_`"


def _in_topics(tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str]) -> str:
    """The hint for a topic list."""
    before = tokens[at - 1] if at else None
    recent = [t.type for t in tokens[max(0, at - 6) : at]]
    if found.type == "SEMICOLON" or (found.type == "NAME" and expected <= {"COMMA", "$END"}):
        return "separate topics by commas"
    if before is not None and before.type == "COMMA" and found.type == "$END":
        return "no comma after the last topic"
    if before is not None and before.type == "MATCHES":
        return "write `matches(in.v)` or `matches(out.v)`"
    if "MATCHES" in recent and "RPAR" not in recent:
        return _in_matches(before, found)
    if found.type == "MATCHES" and "COMMA" in expected:
        return "a topic that carries several variables is listed once for each"
    if found.type == "COLON" and tokens[at + 1 : at + 2] and tokens[at + 1].type == "NAME":
        return "the type stands first, without a colon: `package/Type name`"
    if found.type in ("DOT", "COLON") and before is not None:
        return f"write the type with slashes: `{before.text}/…`"
    if found.type in ("NAME", "IN", "OUT") and found.text.startswith("match"):
        return "did you mean `matches`?"
    if found.type == "MATCHES" and "SLASH" in recent:
        return "between type and name stands no slash: write `package/Type name matches(in.v)`"
    if found.type == "SLASH" and (before is None or before.type in ("COMMA", "NAME")):
        return f"{_TOPIC}; the name stands last"
    return _TOPIC


def _in_matches(before: Token | None, found: Token) -> str:
    if found.type == "COMMA":
        return "a topic that carries several variables is listed once for each"
    if found.type == "DOT" and before is not None and before.text.casefold() in ("input", "output"):
        return f"write `{before.text[:-3].lower()}.v`"
    if found.type == "DOT":
        return "match the variable alone; which field of the message it is, the plan says"
    return "write `matches(in.v)` or `matches(out.v)`"


def _in_types(start: str, tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str]) -> str | None:
    """The hint for a declaration or a list of ports."""
    before = tokens[at - 1] if at else None
    if start == "declaration":
        said = _in_declaration(tokens, at, before, found, expected)
    else:
        said = _in_ports(tokens, at, before, found, expected)
    return said or _in_type(before, found, expected)


def _in_declaration(
    tokens: Sequence[Token], at: int, before: Token | None, found: Token, expected: frozenset[str]
) -> str | None:
    value = any(t.type == "EQUALS" for t in tokens[:at])
    if expected == {"COLON", "EQUALS"}:
        if found.type in ("MINUS", "DOT", "SLASH"):
            return _NAMES
        if tokens[0].text in ("import", "include", "use", "using", "from", "package"):
            return "RCL imports nothing: files of one folder, or named in one plan, are read together"
        if found.type == "EQ":
            return "a constant is declared with `=`: `Name = value;`"
        if found.type == "LBRACE":
            return f"write `{tokens[0].text} : {{…}};`"
        return "write `Name : type;` or `Name = value;`, with no other word before the name"
    if found.type in ("NUMBER", "STRING", "MINUS", "TRUE", "FALSE") and at == 2 and tokens[1].type == "COLON":
        return "a constant is declared with `=`: `Name = value;`"
    if at == 0 and found.type == "BUILTIN":
        return f"`{found.text}` is a keyword: write `Name : {found.text};` or `Name = value;`"
    if found.type == "EQUALS":
        return "a type is declared with `:` alone, a constant with `=` alone"
    if not value:
        return None
    if before is not None and before.type == "EQUALS":
        return "a constant is `Name = value;`"
    if found.type in ("EQ", "NE", "LE", "GE", "LT", "GT", "AND", "OR", "IMPLIES", "IFF", "IN", "NOT_IN"):
        return "put a constant that is true or false in parentheses: `Name = (3 > 2);`"
    if found.type in ("NAME", "NUMBER", "STRING", "SEMICOLON") and "COMMA" in expected:
        return "separate them by commas"
    if found.type == "COMMA" and before is not None and before.type == "NUMBER":
        return "a decimal has a point: `1.5`; a declaration ends with `;`"
    if found.type == "COMMA":
        return "a declaration ends with `;`"
    return None


def _in_ports(
    tokens: Sequence[Token], at: int, before: Token | None, found: Token, expected: frozenset[str]
) -> str | None:
    colons = "COLON" in [t.type for t in tokens[max(at - 3, 0) : at + 2]]
    if expected == {"COLON"}:
        if found.type == "EQUALS":
            return "write `name : type`"
        if found.type in ("MINUS", "DOT", "SLASH", "NUMBER"):
            return _NAMES
        if found.type == "NAME" and not colons and before is not None:
            return f"the name stands first: `{found.text} : {FOREIGN_TYPES.get(before.text.casefold(), before.text)}`"
        return "write `name : type`"
    if "NAME" in expected and "BUILTIN" not in expected and "ARROW" not in expected:
        if found.type == "BUILTIN":
            name = tokens[at + 1].text if tokens[at + 1 : at + 2] and tokens[at + 1].type == "NAME" else "name"
            return f"the name stands first: `{name} : {found.text}`; a function is `a : REAL x REAL --> BOOL`"
        if found.type in ("IN", "OUT") and tokens[at + 1 : at + 2] and tokens[at + 1].type == "DOT":
            return f"here the name stands alone, without `{found.text}.`"
        if found.type == "$END" and before is not None and before.type == "COMMA":
            return "no comma after the last one"
        return f"write `name : type`; {_NAMES}" if found.type in ("SLASH", "LPAR", "COLON", "MINUS", "DOT") else None
    if found.type == "SEMICOLON" or (found.type == "COLON" and colons and before is not None and before.type == "NAME"):
        return "separate them by commas: `a : REAL, b : BOOL`"
    if found.type == "COLON" and tokens[max(at - 2, 0) : at] and tokens[at - 2].type in ("BUILTIN", "RBRACE", "NAME"):
        return "separate them by commas: `a : REAL, b : BOOL`"
    if found.type == "EQUALS":
        return "an input or output has a type, and no value: write `name : type`"
    return None


def _in_type(before: Token | None, found: Token, expected: frozenset[str]) -> str | None:
    if before is not None and before.text in _SEQUENCES:
        return "a type of sequences is written `<REAL>`"
    if before is not None and before.text in ("enum", "Enum", "one"):
        return "a type of named values is written `{red, green}`"
    if before is not None and before.text in ("set", "Set") and found.text in ("of", "<", "("):
        return "RCL has no type of sets: a relation `T --> BOOL` says which are in it"
    if found.type == "STAR":
        return "a type of sequences is written `<REAL>`, a function `A x B --> C`"
    if found.type in ("SEMICOLON", "COLON") and "RPAR" in expected and "$END" not in expected:
        return "a constructor lists the types of what it carries: `move(REAL, REAL)`"
    if found.type == "EMPTY_SEQUENCE" or (found.type == "$END" and "GT" in expected):
        return "a type of sequences is written `<REAL>`"
    if found.type in ("SLASH", "DOT") or (found.type == "COLON" and "ARROW" in expected):
        return "types of RCL stand here, such as `REAL` or `{red, green}`; ROS types stand in `topics`"
    if found.type == "ARROW":
        return "a function has one arrow, with all parameters before it: `A x B --> C`"
    if found.type in ("STRING", "NUMBER") and before is not None and before.type in ("LBRACE", "COMMA"):
        return "a set type lists names, as in `{red, green}`; a set of values is a constant: `Name = {1, 2};`"
    if "COMMA" in expected and "RBRACE" in expected and found.type != "$END":
        return "separate the elements by commas: `{red, green}`"
    if found.type in ("BAR", "IMPLIES", "COMMA") and expected & {"ARROW", "$END"}:
        return "write a function as `A x B --> C`, and a choice of values as `{a, b}`"
    if found.type == "LPAR" and "ARROW" in expected:
        return "constructors stand in a set: `{move(REAL, REAL), stop}`"
    if found.type == "RPAR" and before is not None and before.type == "LPAR":
        return "a constructor without arguments has no parentheses: `{stop, go(REAL)}`; a tuple has items"
    if found.type in ("RBRACE", "COMMA") and before is not None and before.type == "COMMA":
        return "one comma stands between two elements, and none after the last"
    if found.type == "LBRACE" and "RBRACE" in expected:
        return "sets do not hold sets: a set type lists names, as in `{red, green}`"
    if found.type in ("NAME", "BUILTIN") and "ARROW" in expected:
        return "one type stands here; several are `A x B`, or of a function `A x B --> C`"
    return None


_SEQUENCES = frozenset(("seq", "sequence", "list", "List", "Seq", "Sequence", "array", "Array", "vector", "Vec"))

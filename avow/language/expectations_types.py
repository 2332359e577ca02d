"""What to write instead of a token that cannot stand in a declaration, a list of inputs or outputs, or topics."""

from __future__ import annotations

from collections.abc import Sequence

from avow.language.foreign import FOREIGN_TYPES
from avow.language.lexer import Token

_TOPIC = "a topic is `package/Type name` with, if it carries a variable, `matches(in.v)` or `matches(out.v)`"
_NAMES = "names are made of letters, digits and `_`"


def in_topics(tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str]) -> str:
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


def in_types(start: str, tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str]) -> str | None:
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

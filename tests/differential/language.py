"""Small decisions and claims about them, written once and printed for each translator.

Expressions are tuples ``(operator, sort, part, …)``. Sorts are letters: R, I, N (numbers), B, C (Colour), D (Command),
M (NATURAL --> BOOL), L (NATURAL --> INTEGER), S (<INTEGER>), P ((INTEGER, Colour)). `oracle` gives them their meaning,
and shares no code with Avow.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

Expr = tuple[Any, ...]

TYPES = """context {
  Colour : {red, orange, green};
  Near = {red, orange};
  Command : { move(REAL, NATURAL), mark(NATURAL), halt };
  Marks : NATURAL --> BOOL;
  Levels : NATURAL --> INTEGER;
  Path : <INTEGER>;
  Pair : (INTEGER, Colour);
}
"""
INPUTS = {
    "r": "R", "t": "R", "k": "I", "j": "I", "m": "N", "w": "N", "flag": "B", "colour": "C", "command": "D",
    "before": "M", "level": "L", "path": "S", "pair": "P",
}  # fmt: skip
OUTPUTS = {
    "q": "R", "x": "I", "n": "N", "on": "B", "light": "C", "cmd": "D", "done": "M", "lev": "L", "trail": "S",
    "both": "P",
}  # fmt: skip
WRITTEN = {
    "R": "REAL", "I": "INTEGER", "N": "NATURAL", "B": "BOOL", "C": "Colour", "D": "Command", "M": "Marks",
    "L": "Levels", "S": "Path", "P": "Pair",
}  # fmt: skip
DAFNY = {
    "R": "real", "I": "int", "N": "nat", "B": "bool", "C": "Types.Colour", "D": "Types.Command", "M": "(nat) -> bool",
    "L": "(nat) -> int", "S": "seq<int>", "P": "(int, Types.Colour)",
}  # fmt: skip
ORDER = {"N": 0, "I": 1, "R": 2}


def is_expression(part: Any) -> bool:
    """Not so: a bound variable's name, the variables of a quantifier, a number's value."""
    return isinstance(part, tuple) and len(part) > 1 and all(isinstance(p, str) for p in part[:2])


def num(value: Any, sort: str = "") -> Expr:
    value = Fraction(value)
    return ("num", sort or ("R" if value.denominator != 1 else "N" if value >= 0 else "I"), value)


def var(name: str, sort: str) -> Expr:
    """An input ``in.k``, an output ``out.x`` or a bound variable."""
    return ("var", sort, name)


def inp(name: str) -> Expr:
    return var(f"in.{name}", INPUTS[name])


def out(name: str) -> Expr:
    return var(f"out.{name}", OUTPUTS[name])


def widen(e: Expr, sort: str) -> Expr:
    if ORDER[e[1]] >= ORDER[sort]:
        return e
    return num(e[2], sort) if e[0] == "num" else ("widen", sort, e)


def join(*parts: Expr) -> str:
    return max((p[1] for p in parts), key=lambda s: ORDER[s])


def arith(op: str, a: Expr, b: Expr) -> Expr:
    sort = join(a, b) if op in "+*" else max(join(a, b), "I", key=lambda s: ORDER[s])
    if op == "/":
        sort = "R"
    return (op, sort, widen(a, sort), widen(b, sort))


def compare(*parts: Any) -> Expr:
    """``compare(a, "<=", b, "<", c)``."""
    items = list(parts[::2])
    if items[0][1] in ORDER:
        sort = join(*items)
        items = [widen(e, sort) for e in items]
    return ("cmp", "B", tuple(parts[1::2]), *items)


def conj(*parts: Expr) -> Expr:
    return parts[0] if len(parts) == 1 else ("and", "B", *parts)


# -- text --------------------------------------------------------------------------------------------------------------


def number(value: Fraction) -> str:
    text = str(value.numerator) if value.denominator == 1 else f"{float(value)!r}"
    assert Fraction(text) == value
    return f"(-{text[1:]})" if value < 0 else text


def rcl(e: Expr) -> str:
    return _text(e, "rcl")


def imp(e: Expr) -> str:
    return _text(e, "imp")


def _text(e: Expr, to: str) -> str:
    op, _sort, *parts = e
    sub = [_text(p, to) if is_expression(p) and op != "cmp" else "" for p in parts]
    opening, closing = ("<", ">") if to == "rcl" else ("[", "]")
    match op:
        case "num":
            return number(parts[0])
        case "var":
            return str(parts[0]) if to == "rcl" else str(parts[0]).rpartition(".")[2]
        case "widen":
            return sub[0]
        case "true":
            return "TRUE"
        case "neg":
            return f"(-{sub[0]})"
        case "+" | "-" | "*" | "/" | "->" | "<=>":
            return f"({sub[0]} {op} {sub[1]})"
        case "and" | "or":
            return f"({f' {op} '.join(sub)})"
        case "not":
            return f"(not {sub[0]})"
        case "cmp":
            words = [_text(parts[1], to)]
            for comparator, item in zip(parts[0], parts[2:], strict=True):
                words += [comparator, _text(item, to)]
            return f"({' '.join(words)})"
        case "in" | "!in":
            return f"({sub[0]} {op} {{{', '.join(sub[1:])}}})"
        case "near":
            return f"({sub[0]} in Near)"
        case "within":
            return f"({sub[0]} in {sub[1]})"
        case "elem":
            return str(parts[0])
        case "data":
            return str(parts[0]) + (f"({', '.join(sub[1:])})" if sub[1:] else "")
        case "app" | "nth":
            return f"{sub[0]}({', '.join(sub[1:])})"
        case "len":
            return f"length({sub[0]})"
        case "seq":
            return f"{opening}{', '.join(sub)}{closing}"
        case "pair":
            return f"({', '.join(sub)})"
        case "ite":
            return f"(if {sub[0]} then {sub[1]} else {sub[2]})"
        case "xor" | "abs" | "min" | "max" | "mod" | "div":
            return f"{op}({', '.join(sub)})"
        case "forall" | "exists" | "exists_unique":
            names = ", ".join(f"{name} in {WRITTEN[s]}" for name, s in parts[0])
            return f"{op}({names} | {_text(parts[1], to)})"
        case "each" | "some":
            word = "forall" if op == "each" else "exists"
            return f"{word}({parts[0]} in <{_text(parts[1], to)} upto {_text(parts[2], to)}> | {_text(parts[3], to)})"
    raise AssertionError(op)


def python(e: Expr) -> str:
    op, sort, *parts = e
    sub = [python(p) if is_expression(p) and op != "cmp" else "" for p in parts]
    match op:
        case "num":
            return f'Fraction("{parts[0]}")' if sort == "R" else f"({parts[0]})"
        case "var":
            return str(parts[0]).rpartition(".")[2]
        case "widen":
            return f"Fraction({sub[0]})" if sort == "R" else sub[0]
        case "true":
            return "True"
        case "neg":
            return f"(-{sub[0]})"
        case "+" | "-" | "*" | "/":
            return f"({sub[0]} {op} {sub[1]})"
        case "->":
            return f"((not {sub[0]}) or {sub[1]})"
        case "<=>":
            return f"({sub[0]} == {sub[1]})"
        case "and" | "or":
            return f"({f' {op} '.join(sub)})"
        case "not":
            return f"(not {sub[0]})"
        case "cmp":
            words = [python(parts[1])]
            for comparator, item in zip(parts[0], parts[2:], strict=True):
                words += [comparator, python(item)]
            return f"({' '.join(words)})"
        case "in" | "!in":
            return f"({sub[0]} {'not in' if op == '!in' else 'in'} ({', '.join(sub[1:])},))"
        case "near":
            return f'({sub[0]} in ("red", "orange"))'
        case "within":
            return f"({sub[0]} in {sub[1]})"
        case "elem":
            return f'"{parts[0]}"'
        case "data":
            return f"({', '.join([repr(parts[0]), *sub[1:]])},)"
        case "app":
            return f"{sub[0]}({sub[1]})"
        case "nth":
            return f"{sub[0]}[{sub[1]}]"
        case "len":
            return f"len({sub[0]})"
        case "seq":
            return f"({''.join(s + ', ' for s in sub)})"
        case "pair":
            return f"({', '.join(sub)})"
    raise AssertionError(op)


def dafny(e: Expr) -> str:
    op, sort, *parts = e
    sub = [dafny(p) if is_expression(p) and op != "cmp" else "" for p in parts]
    match op:
        case "num":
            if sort != "R":
                return f"({parts[0]})"
            text = f"({abs(parts[0].numerator)}.0 / {parts[0].denominator}.0)"
            return f"(0.0 - {text})" if parts[0] < 0 else text
        case "var":
            return str(parts[0]).replace(".", "_")
        case "widen":
            return f"({sub[0]} as real)" if sort == "R" else sub[0]
        case "true":
            return "true"
        case "neg":
            return f"(-{sub[0]})"
        case "+" | "-" | "*" | "/":
            return f"({sub[0]} {op} {sub[1]})"
        case "->":
            return f"({sub[0]} ==> {sub[1]})"
        case "<=>":
            return f"({sub[0]} <==> {sub[1]})"
        case "and" | "or":
            return f"({(' && ' if op == 'and' else ' || ').join(sub)})"
        case "not":
            return f"(!{sub[0]})"
        case "cmp":
            items = [dafny(p) for p in parts[1:]]
            return f"({' && '.join(f'{a} {c} {b}' for a, c, b in zip(items, parts[0], items[1:], strict=False))})"
        case "in" | "!in":
            found = f"({' || '.join(f'{sub[0]} == {s}' for s in sub[1:])})"
            return f"(!{found})" if op == "!in" else found
        case "near":
            return f"({sub[0]} == Types.Colour.red || {sub[0]} == Types.Colour.orange)"
        case "within":
            return f"({sub[0]} in {sub[1]})"
        case "elem":
            return f"Types.Colour.{parts[0]}"
        case "data":
            return f"Types.Command.{parts[0]}" + (f"({', '.join(sub[1:])})" if sub[1:] else "")
        case "app":
            return f"{sub[0]}({sub[1]})"
        case "nth":
            return f"{sub[0]}[{sub[1]}]"
        case "len":
            return f"|{sub[0]}|"
        case "seq":
            return f"[{', '.join(sub)}]"
        case "pair":
            return f"({', '.join(sub)})"
    raise AssertionError(op)


# -- programs: ("set", output, expr), ("update", output, at, expr), ("if", test, [then], [else]),
#    ("match", constructor, names, [then], [else]) --------------------------------------------------------------------

Statement = tuple[Any, ...]
FIELDS = {"move": "RN", "mark": "N", "halt": ""}


def imp_lines(block: list[Statement], indent: str = "") -> list[str]:
    found: list[str] = []
    for kind, *parts in block:
        match kind:
            case "set":
                found.append(f"{indent}{parts[0]} := {imp(parts[1])}")
            case "update":
                found.append(f"{indent}{parts[0]}[{imp(parts[1])}] := {imp(parts[2])}")
            case "if":
                found.append(f"{indent}IF {imp(parts[0])} THEN")
                found += [*imp_lines(parts[1], indent + "  "), f"{indent}ELSE", *imp_lines(parts[2], indent + "  ")]
            case "match":
                names = f"({', '.join(parts[1])})" if parts[1] else ""
                found.append(f"{indent}MATCH command WITH {parts[0]}{names} THEN")
                found += [*imp_lines(parts[2], indent + "  "), f"{indent}ELSE", *imp_lines(parts[3], indent + "  ")]
    return found or [f"{indent}SKIP"]


def python_lines(block: list[Statement], indent: str = "    ") -> list[str]:
    found: list[str] = []
    for kind, *parts in block:
        match kind:
            case "set":
                found.append(f"{indent}out_{parts[0]} = {python(parts[1])}")
            case "update":
                at, value = python(parts[1]), python(parts[2])
                found.append(f"{indent}out_{parts[0]} = out_{parts[0]}.updated({at}, {value})")
            case "if":
                found.append(f"{indent}if {python(parts[0])}:")
                found += [*python_lines(parts[1], indent + "    "), f"{indent}else:"]
                found += python_lines(parts[2], indent + "    ")
            case "match":
                found.append(f'{indent}if command[0] == "{parts[0]}":')
                found += [f"{indent}    {name} = command[{k}]" for k, name in enumerate(parts[1], start=1)]
                found += [*python_lines(parts[2], indent + "    "), f"{indent}else:"]
                found += python_lines(parts[3], indent + "    ")
    return found or [f"{indent}pass"]


def dafny_lines(block: list[Statement], indent: str = "    ") -> list[str]:
    found: list[str] = []
    for kind, *parts in block:
        match kind:
            case "set":
                found.append(f"{indent}out_{parts[0]} := {dafny(parts[1])};")
            case "update":
                at, value, name = dafny(parts[1]), dafny(parts[2]), f"out_{parts[0]}"
                found.append(f"{indent}var old_{name}, at_{name} := {name}, {at};")
                found.append(f"{indent}{name} := (z: nat) => if z == at_{name} then {value} else old_{name}(z);")
            case "if":
                found.append(f"{indent}if {dafny(parts[0])} {{")
                found += [*dafny_lines(parts[1], indent + "  "), f"{indent}}} else {{"]
                found += [*dafny_lines(parts[2], indent + "  "), f"{indent}}}"]
            case "match":
                found.append(f"{indent}if in_command.{parts[0]}? {{")
                for k, name in enumerate(parts[1]):
                    found.append(f"{indent}  var {name} := in_command.{parts[0]}_{k};")
                found += [*dafny_lines(parts[2], indent + "  "), f"{indent}}} else {{"]
                found += [*dafny_lines(parts[3], indent + "  "), f"{indent}}}"]
    return found

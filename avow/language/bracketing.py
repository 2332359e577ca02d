"""Formulas that a hasty reader may bracket differently: `and`/`or` beside `->`/`<=>` without parentheses.

The language's reading is compared with the one in which `->` and `<=>` bind tighter than `and` and `or` (as the
prototype's grammar has it) over all truth values of the parts, as propositional letters. Only where the two differ is
there anything to say.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Literal

from avow.base.records import dataclass
from avow.base.tuning.bounds import ASSIGNMENTS_SAMPLED, LETTERS_EXHAUSTED, SAMPLES_BY_SIZE
from avow.base.tuning.shown import FORMULA_PARTS
from avow.language.syntax import Connective, Negation, Parentheses, Sign, Syntax, TermSyntax, Truth, children


@dataclass(frozen=True, slots=True)
class Misreading:
    """`mixed` (and/or) stands beside `operator` (-> or <=>); `shown` is the text as it is read, bracketed."""

    mixed: str
    operator: str
    shown: str
    start: int
    end: int


def misreadings(formula: TermSyntax, text: str) -> Iterator[Misreading]:
    """Every place in the formula where another bracketing means something else."""
    stack: list[Syntax] = [formula]
    while stack:
        tree = stack.pop()
        if not isinstance(tree, Connective):
            stack.extend(reversed(children(tree)))
            continue
        operands, operators = _flat(tree)
        stack.extend(reversed(operands))
        mixed = next((o for o in operators if o in ("and", "or")), None)
        tight = next((o for o in operators if o in ("->", "<=>")), None)
        if mixed is not None and tight is not None and _differ(operands, operators, text):
            yield Misreading(mixed, tight, _bracketed(tree, text), tree.start, tree.end)


def _flat(tree: Connective) -> tuple[list[TermSyntax], list[str]]:
    """The operands and the operators between them, of a formula without its (invisible) brackets."""
    operands: list[TermSyntax] = []
    operators: list[str] = []
    stack: list[TermSyntax | Sign] = [tree]
    while stack:
        part = stack.pop()
        if isinstance(part, Sign):
            operators.append(part)
        elif isinstance(part, Connective):
            for i, inner in enumerate(reversed(part.items)):
                if i:
                    stack.append(part.sign)
                stack.append(inner)
        else:
            operands.append(part)
    return operands, operators


_Way = Literal["ours", "other"]
_LEVELS: dict[_Way, tuple[str, ...]] = {
    "ours": ("<=>", "->", "or", "and"),
    "other": ("or", "and", "<=>", "->"),
}


def _differ(operands: list[TermSyntax], operators: list[str], text: str) -> bool:
    letters: dict[str, int] = {}
    atoms = [_literal(o, text, letters) for o in operands]
    for values in _assignments(len(letters), len(operators)):
        row = [constant if letter is None else values[letter] != negated for letter, negated, constant in atoms]
        if _value(row, operators, "ours") != _value(row, operators, "other"):
            return True
    return False


def _literal(tree: TermSyntax, text: str, letters: dict[str, int]) -> tuple[int | None, bool, bool]:
    """A letter and whether it is negated; or, without letter, a truth value."""
    negated = False
    while isinstance(tree, Parentheses | Negation):
        negated ^= isinstance(tree, Negation)
        tree = tree.body
    if isinstance(tree, Truth):
        return None, False, tree.value != negated
    key = " ".join(text[tree.start : tree.end].split())
    return letters.setdefault(key, len(letters)), negated, False


def _assignments(count: int, size: int) -> Iterator[list[bool]]:
    if count <= LETTERS_EXHAUSTED and size << count <= SAMPLES_BY_SIZE:
        for number in range(1 << count):
            yield [bool(number >> i & 1) for i in range(count)]
        return
    source = random.Random(count)
    for _ in range(max(20, min(ASSIGNMENTS_SAMPLED, SAMPLES_BY_SIZE // size))):
        weight = source.random()
        yield [source.random() < weight for _ in range(count)]


def _value(row: list[bool], operators: list[str], way: _Way) -> bool:
    """The truth value of ``row[0] operators[0] row[1] …`` where the levels bind from loosest to tightest."""
    values, signs = row, operators
    for level in reversed(_LEVELS[way]):
        if level in signs:
            values, signs = _reduce(values, signs, level)
    return values[0]


def _reduce(values: list[bool], signs: list[str], level: str) -> tuple[list[bool], list[str]]:
    """Apply one operator wherever it stands: `->` from the right, the others from the left."""
    if level == "->":
        values, signs = values[::-1], signs[::-1]
    out, left = [values[0]], []
    for sign, value in zip(signs, values[1:], strict=True):
        if sign != level:
            left.append(sign)
            out.append(value)
        elif level == "and":
            out[-1] = out[-1] and value
        elif level == "or":
            out[-1] = out[-1] or value
        elif level == "->":
            out[-1] = not value or out[-1]
        else:
            out[-1] = out[-1] == value
    return (out[::-1], left[::-1]) if level == "->" else (out, left)


def _bracketed(tree: Connective, text: str, among: int = 1) -> str:
    """The formula as it is read, with parentheses around what binds tighter. `among`: so many others stand around."""
    most = max(2, FORMULA_PARTS // among)
    left_out = len(tree.items) - most
    parts = []
    for part in tree.items if left_out <= 0 else (*tree.items[: most - 1], tree.items[-1]):
        if isinstance(part, Connective):
            parts.append(f"({_bracketed(part, text, min(len(tree.items), most) * among)})")
        else:
            parts.append(_shortened(text[part.start : part.end]))
    if left_out > 0:
        parts.insert(-1, "…")
    sign = f" {tree.sign} "
    if tree.sign is not Sign.IMPLIES:
        return sign.join(parts)
    shown = parts[-1]
    for i, before in enumerate(reversed(parts[:-1])):
        shown = f"{before}{sign}({shown})" if i else f"{before}{sign}{shown}"
    return shown


def _shortened(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 36 else f"{text[:24]} … {text[-8:]}"

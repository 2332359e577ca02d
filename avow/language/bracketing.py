"""Formulas that a reader may bracket wrongly: `and` or `or` beside `->` or `<=>` without parentheses."""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.records import dataclass
from avow.base.tuning.shown import FORMULA_PARTS
from avow.language.syntax import Connective, Sign, TermSyntax, walk


@dataclass(frozen=True, slots=True)
class Misreading:
    """`mixed` (and/or) occurs beside `operator` (-> or <=>); `shown` is the text with the brackets that the language
    implies."""

    mixed: str
    operator: str
    shown: str
    start: int
    end: int


def misreadings(formula: TermSyntax, text: str) -> Iterator[Misreading]:
    """Every place in the formula where the language's parse differs from one in which `->` and `<=>` bind tighter
    than `and` and `or`. (``a -> b or c`` means the same either way.)"""
    inner: set[int] = set()
    for tree in walk(formula):
        if not isinstance(tree, Connective) or tree.sign in (Sign.AND, Sign.OR) or id(tree) in inner:
            continue
        inner |= {id(item) for item in tree.items}
        items = tree.items
        if tree.sign is Sign.IMPLIES and isinstance(items[-1], Connective) and items[-1].sign is Sign.OR:
            items = items[:-1]
        parts = [part for item in items for part in (item, *_operands(item)) if isinstance(part, Connective)]
        mixed = next((part for part in parts if part.sign in (Sign.AND, Sign.OR)), None)
        if mixed is not None:
            yield Misreading(mixed.sign, tree.sign, _bracketed(tree, text), tree.start, tree.end)


def _operands(tree: TermSyntax) -> tuple[TermSyntax, ...]:
    return tree.items if isinstance(tree, Connective) else ()


def _bracketed(tree: Connective, text: str) -> str:
    """The formula as the language parses it, with parentheses around the parts that bind tighter."""
    parts = [
        f"({_bracketed(part, text)})" if isinstance(part, Connective) else _shortened(text, part) for part in tree.items
    ]
    if len(parts) > FORMULA_PARTS:
        parts = [*parts[: FORMULA_PARTS - 2], "…", parts[-1]]
    sign = f" {tree.sign} "
    if tree.sign is not Sign.IMPLIES:
        return sign.join(parts)
    shown = parts[-1]
    for k, before in enumerate(reversed(parts[:-1])):
        shown = f"{before}{sign}({shown})" if k else f"{before}{sign}{shown}"
    return shown


def _shortened(whole: str, tree: TermSyntax) -> str:
    text = " ".join(whole[tree.start : tree.end].split())
    return text if len(text) <= 36 else f"{text[:24]} … {text[-8:]}"

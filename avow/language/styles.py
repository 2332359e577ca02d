"""The notation of each style for the parts of a term: signs, words, names, and the escaping that LaTeX needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Literal as OneOf

from avow.base.records import dataclass
from avow.language.lexer import quote
from avow.language.operators import OPERATORS
from avow.language.sorts import BUILTINS
from avow.language.terms import Past, Quantifier

StyleName = OneOf["unicode", "rcl", "latex", "text"]


@dataclass(frozen=True, slots=True)
class Style:
    words: dict[str, str]
    quantifiers: dict[Quantifier, tuple[str, str, str]]
    """The texts before the variables, after them, and after the body."""
    sorts: dict[str, str]
    times: str
    arrow: str
    unspecified: str
    sequence: tuple[str, str]
    name: Callable[[str], str]
    string: Callable[[str], str]
    braces: Callable[[str], str]
    tight_quantifier: bool
    """Whether a quantifier is self-delimiting, so that it never needs parentheses."""
    comma: str = ", "
    """The separator of arguments and items; also a last-resort line break where lines are broken."""
    past: Callable[[Past], str] = str
    """The name of an operator that refers to other steps."""
    limit: Callable[[str], str] = lambda text: f"[{text}]"
    phrases: Mapping[str, str] = field(default_factory=dict)
    """Such operators in words; those with a limit under keys like `once limited`."""
    careful: bool = False
    """Whether `and` and `or` get parentheses beside `->` and `<=>`, though they need none."""


def latex_escape(text: str) -> str:
    """Any text as LaTeX text that every pdflatex can set; a character without a sign is shown by its number."""
    return "".join(_LATEX_TEXT.get(c) or (c if " " <= c <= "ÿ" and c.isprintable() else _code_point(c)) for c in text)


def _code_point(character: str) -> str:
    return rf"\texttt{{U+{ord(character):04X}}}"


_LATEX_TEXT = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "\n": " ",
    "\t": " ",
    "\u00a0": "~",
    "–": "--",
    "—": "---",
    "“": "``",
    "”": "''",
    "‘": "`",
    "’": "'",
    "…": r"\ldots{}",
    "≤": r"$\leq$",
    "≥": r"$\geq$",
    "≠": r"$\neq$",
    "→": r"$\rightarrow$",
    "∈": r"$\in$",
    "∀": r"$\forall$",
    "∃": r"$\exists$",
    "∧": r"$\land$",
    "∨": r"$\lor$",
}


def latex_name(name: str) -> str:
    """A name for mathematics mode."""
    body = name.rstrip("'")
    if len(body) == 1 and body.isalpha():
        return name
    shown = body.replace("_", r"\_").replace("'", r"\textquotesingle{}")
    return rf"\mathit{{{shown}}}{name[len(body) :]}"


_WORDS = {
    **{row.name: row.rcl for row in OPERATORS.values()},
    **{word: f" {word} " for word in ("in", "!in", "upto", "then", "else")},
    "TRUE": "TRUE",
    "FALSE": "FALSE",
}
_PHRASES = {
    "previous": "{0} one step before (at the first step {1})",
    "rose": "{0} has just become true",
    "fell": "{0} has just become false",
    "changed": "{0} has just changed",
    "once": "{0} at some step up to now",
    "once limited": "{0} at some time in the last {limit}",
    "historically": "{0} at every step up to now",
    "historically limited": "{0} throughout the last {limit}",
    "held": "{0} for {limit} already",
    "since": "{0} ever since {1}",
    "since limited": "{0} ever since {1}, which is {limit} ago",
    "counted": "the number of steps with {0} after the last with {1}",
    "next": "{0} at the next step",
    "within": "{0} within {limit}",
    "for": "{0} for {limit}",
    "until": "{0} until {1}",
    "eventually": "{0} eventually",
    "arrived": "a message of {0} has arrived",
    "steps": "a step {limit}",
}


def _latex_past(word: Past) -> str:
    return rf"\ \mathbf{{{word}}}" if word in (Past.SINCE, Past.UNTIL) else rf"\mathrm{{{word}}}"


def _latex_limit(text: str) -> str:
    shown = text
    for unit in (" steps", " s"):
        if text.endswith(unit):
            shown = rf"{text.removesuffix(unit)}\,\mathrm{{{unit.strip()}}}"
    return rf"_{{[{shown}]}}"


STYLES: dict[StyleName, Style] = {
    "rcl": Style(
        words=_WORDS,
        quantifiers={q: (f"{q.value}(", " | ", ")") for q in Quantifier},
        sorts={name: name for name in BUILTINS},
        times=" x ",
        arrow=" --> ",
        unspecified="{}",
        sequence=("<", ">"),
        name=str,
        string=quote,
        braces=lambda inner: f"{{{inner}}}",
        tight_quantifier=True,
        careful=True,
    ),
    "unicode": Style(
        words={
            **_WORDS,
            **{row.name: row.unicode for row in OPERATORS.values()},
            "in": " ∈ ",
            "!in": " ∉ ",
            "upto": " … ",
            "TRUE": "true",
            "FALSE": "false",
        },
        quantifiers={
            Quantifier.FORALL: ("∀ ", " · ", ""),
            Quantifier.EXISTS: ("∃ ", " · ", ""),
            Quantifier.UNIQUE: ("∃! ", " · ", ""),
        },
        sorts={"BOOL": "𝔹", "REAL": "ℝ", "INTEGER": "ℤ", "NATURAL": "ℕ", "STRING": "String"},
        times=" × ",
        arrow=" → ",
        unspecified="unspecified",
        sequence=("⟨", "⟩"),
        name=str,
        string=quote,
        braces=lambda inner: f"{{{inner}}}",
        tight_quantifier=False,
    ),
    "text": Style(
        words={
            **_WORDS,
            **{row.name: row.text for row in OPERATORS.values()},
            "in": " in ",
            "!in": " not in ",
            "TRUE": "true",
            "FALSE": "false",
            "upto": " to ",
        },
        quantifiers={
            Quantifier.FORALL: ("for all ", ": ", ""),
            Quantifier.EXISTS: ("for some ", ": ", ""),
            Quantifier.UNIQUE: ("for exactly one ", ": ", ""),
        },
        sorts={"BOOL": "booleans", "REAL": "reals", "INTEGER": "integers", "NATURAL": "naturals", "STRING": "strings"},
        times=" by ",
        arrow=" to ",
        unspecified="unspecified",
        sequence=("<", ">"),
        name=str,
        string=quote,
        braces=lambda inner: f"{{{inner}}}",
        tight_quantifier=False,
        phrases=_PHRASES,
    ),
    "latex": Style(
        words={
            **_WORDS,
            **{row.name: row.latex for row in OPERATORS.values()},
            "in": r" \in ",
            "!in": r" \notin ",
            "upto": r" \ldots ",
            "TRUE": r"\mathit{TRUE}",
            "FALSE": r"\mathit{FALSE}",
            "then": r"\ \mathbf{then}\ ",
            "else": r"\ \mathbf{else}\ ",
        },
        quantifiers={
            Quantifier.FORALL: (r"\forall ", r" \bullet ", ""),
            Quantifier.EXISTS: (r"\exists ", r" \bullet ", ""),
            Quantifier.UNIQUE: (r"\exists!\, ", r" \bullet ", ""),
        },
        sorts={
            "BOOL": r"\mathbb{B}",
            "REAL": r"\mathbb{R}",
            "INTEGER": r"\mathbb{Z}",
            "NATURAL": r"\mathbb{N}",
            "STRING": r"\mathit{STRING}",
        },
        times=r" \times ",
        arrow=r" \rightarrow ",
        unspecified=r"\text{(unspecified)}",
        sequence=(r"\langle ", r"\rangle "),
        comma=r",\penalty9000 ",
        name=latex_name,
        string=lambda value: rf"\text{{``{latex_escape(value)}''}}",
        braces=lambda inner: rf"\{{{inner}\}}",
        tight_quantifier=False,
        past=_latex_past,
        limit=_latex_limit,
    ),
}

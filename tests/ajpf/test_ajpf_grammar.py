"""What MCAPL's parser accepts and what it rejects, section by section: ours does the same.

`golden/grammar.csv` was written by MCAPL's own parser (GwendolenMASBuilder, MCAPL of December 2025), which reads the
text in its section of an otherwise plain agent. Ours refuses more (`REFUSED`) or less (`LENIENT`) where
it is meant to.
"""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from avow.backends.ajpf.files import program_text
from avow.backends.ajpf.parser import parse_system
from avow.base.diagnostics import Rejected

PLAIN = {"beliefs": "b", "rules": "r :- b;", "goals": "go [perform]", "plans": "+!go [perform] : { True } <- act;"}
REFUSED = {
    "a variable where nothing binds it": {"b([1|T])", "b(X)", "b(_)", "B", "go(X) [perform]", "r :- X;", "X :- b;"},
    "a plan for anything, an action that is a variable": {
        "+X : { True } <- act;",
        "+!X [perform] : { True } <- act;",
        "+!go [perform] : { True } <- X;",
    },
    "a cut as a rule's head": {"!;"},
    "what MCAPL drops without a word": {"b, c"},
    "needless parentheses, sums in beliefs": {
        "b((1-2))",
        "r :- [(X) < 2];",
        "+!go [perform] : { B c(((X + 1))) } <- act;",
    },
}
LENIENT = {
    "a goal without a kind, which MCAPL reports and reads": {
        "go",
        "+!go [perform] : { G go } <- act;",
        "+!go : { True } <- act;",
        "+!go [perform] : { True } <- +!g;",
        "+!go [perform] : { True } <- -!g;",
    },
    "white space within an initial goal": {"go(a,\nb) [perform]", "go [ perform ]"},
}
with (Path(__file__).parent / "golden" / "grammar.csv").open(newline="", encoding="utf-8") as table:
    ROWS = list(csv.DictReader(table))


def within(section: str, text: str) -> str:
    part = {**PLAIN, section: text}
    return (
        f"GWENDOLEN\n\n:name: ag\n\n:Initial Beliefs:\n\n{part['beliefs']}\n\n:Reasoning Rules:\n\n{part['rules']}\n\n"
        f":Initial Goals:\n\n{part['goals']}\n\n:Plans:\n\n{part['plans']}\n"
    )


def accepted(section: str, text: str) -> bool:
    try:
        parse_system(within(section, text), "ag.gwen")
    except Rejected:
        return False
    return True


@pytest.mark.parametrize("row", ROWS, ids=[f"{row['section']}: {row['text']}" for row in ROWS])
def test_the_parser_accepts_what_mcapls_does(row: dict[str, str]) -> None:
    expected = row["mcapl"] == "accepted"
    if any(row["text"] in texts for texts in (*REFUSED.values(), *LENIENT.values())):
        expected = not expected
    assert accepted(row["section"], row["text"]) is expected


def test_what_is_printed_is_within_the_grammar() -> None:
    """AJPF gets the program as it is printed anew."""
    for row in ROWS:
        if accepted(row["section"], row["text"]):
            printed = program_text(parse_system(within(row["section"], row["text"]), "ag.gwen"))
            assert program_text(parse_system(printed, "ag.gwen")) == printed
